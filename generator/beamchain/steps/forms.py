"""The numbers that each form of `beamchain.steps.retime` gives the modal tendons.

Theory: docs/theory.md, section 5.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import linear_sum_assignment, lsq_linear

from beamchain.ports.motions import Array
from beamchain.steps.integrators import (
    SCHEMES,
    Complex,
    StepMap,
    Timed,
    is_stable,
    spare_armature,
    step_factors,
    step_pole,
    time_modes,
)
from beamchain.steps.modal import Modal
from beamchain.steps.step_map import MOSTLY, Motion

MARGIN = 0.95  # of `h^2 lambda_max` at which a step becomes unstable
EXACT = 1e-6  # pole error below which tuning is taken to have succeeded
LOWEST = 0.05  # [rad] phase below which the limit is not lowered
HALVINGS = 14  # of the phase limit
ITERATIONS = 12  # of Newton's method
CLOSE = 1e-13  # relative pole error at which to stop
NEAR = 1e-11  # the same below which rounding may keep it from falling further
STUCK = 0.01  # relative change of the pole error below which bounds keep it from falling
# imaginary part of a pole above which it oscillates;
# rigid motions come out as far beside 1 by rounding
RINGING = 1e-7
PRIORITY = 1.0  # power of a pole's phase by which slow poles count more where not all can be had
STEADY = 1e-7  # weight that keeps unknowns where the poles do not ask for a change


@dataclass(frozen=True)
class ModeTime:
    """One mode made exact in time; frequency [rad/s], pole [1/s]."""

    name: str  #: of its tendon
    frequency: float
    ratio: float  #: damping ratio
    mass: float  #: modal mass that it is given, its own 1
    damping: float  #: of its tendon [1/s]
    pole: complex
    slowed: bool  #: too fast for the step
    clamped: bool  #: a negative armature would be needed; the mass is 1 and the pole only near


@dataclass(frozen=True, eq=False)
class TendonValues:
    """Damping [1/s] and armature `(n,)` for the tendons, and what they do to the modes; stiffness
    [1/s^2] where it changes too."""

    damping: Array
    armature: Array
    phase: float
    lambda_max: float
    modes: tuple[ModeTime, ...]
    stiffness: Array | None = None


def stability(
    integrator: str, c: Array, stiffness: Array, damping: Array, armature: Array, timestep: float
) -> float:
    """`h^2 lambda_max` of modal tendons `(n,)` on a craft, worst of its poses: stable below 4,
    RK4's below 8.

    `c` `(p, n, n)`: condensed mass of the modal coordinates in every pose. Of armatures a, of
    which g are to spare, the pencil is `(4 (a - g), C + a)`; of RK4 it is 8 times the squared ratio
    of the step to its largest one.
    """
    masses = c + np.diag(armature)
    if integrator == "RK4":
        k, d = np.diag(stiffness), np.diag(damping)
        steps = [StepMap(integrator, k, 0.0 * d, d, timestep, mass) for mass in masses]
        return 8.0 * max((timestep / step.largest_step()) ** 2 for step in steps)
    needed = armature - spare_armature(integrator, armature, stiffness, damping, timestep)
    force = np.diag(needed / SCHEMES[integrator].limit)
    return max(float(np.max(eigh(force, mass, eigvals_only=True))) for mass in masses)


def _limit(integrator: str) -> float:
    return MARGIN / SCHEMES[integrator].limit


def form2(modal: Modal, c: Array, integrator: str, h: float) -> TendonValues:
    """Every mode of the held appendage exact; the phase limit lowered until the craft is stable in
    every pose; `c` as of `stability`."""
    many, phase = _form2(integrator, c[:, None], modal.stiffness[None], modal.damping[None], h)
    t = Timed(*(values[0] for values in many))
    largest = stability(integrator, c, modal.stiffness, t.damping, t.mass - 1.0, h)
    zeta = modal.damping / (2.0 * modal.frequency)
    return TendonValues(
        t.damping,
        t.mass - 1.0,
        float(phase[0, 0]),
        largest,
        _modes(modal.names, integrator, modal.frequency, zeta, modal.stiffness, t, h),
    )


def form2_many(
    integrator: str, c: Array, stiffness: Array, damping: Array, timestep: float
) -> Timed:
    """What `form2` gives each of k crafts, in one array operation for all of them.

    `c` `(p, k, n, n)`, or `(p, 1, n, n)` where it is the same for all: condensed mass of each in
    every pose; `stiffness` [1/s^2] and `damping` [1/s] `(k, n)` of the tendons before they were
    made exact.
    """
    return _form2(integrator, c, stiffness, damping, timestep)[0]


def _form2(
    integrator: str, c: Array, stiffness: Array, damping: Array, timestep: float
) -> tuple[Timed, Array]:
    """The modes of k crafts, and their phase limits `(k, 1)`."""
    w = np.sqrt(stiffness)
    zeta = damping / (2.0 * w)
    c = np.broadcast_to(c, (len(c), len(w), *c.shape[2:]))
    phase = np.full((w.shape[0], 1), SCHEMES[integrator].phase)
    out = time_modes(integrator, w, zeta, timestep, phase=phase)
    short = np.flatnonzero(~_stable(integrator, c, stiffness, out, timestep))
    if short.size and np.isfinite(phase[0, 0]):
        low = np.full((short.size, 1), LOWEST)
        high = phase[short]
        for _ in range(HALVINGS):
            middle = np.sqrt(low * high)
            tried = time_modes(integrator, w[short], zeta[short], timestep, phase=middle)
            good = _stable(integrator, c[:, short], stiffness[short], tried, timestep)[:, None]
            low, high = np.where(good, middle, low), np.where(good, high, middle)
        phase[short] = low
        out = time_modes(integrator, w, zeta, timestep, phase=phase)
    return out, phase


def _stable(integrator: str, c: Array, stiffness: Array, t: Timed, h: float) -> NDArray[np.bool_]:
    """`(k,)`: whether `h^2 lambda_max` of each craft is within the margin of its integrator, in
    every pose."""
    if SCHEMES[integrator].implicit_springs:
        return np.ones(stiffness.shape[0], dtype=np.bool_)
    armature = t.mass - 1.0
    if integrator == "RK4":  # the poles of the modes, within the same share of its stability region
        unit = np.eye(c.shape[-1])
        k, d, a = (values[:, :, None] * unit for values in (stiffness, t.damping, armature))
        reach = h / np.sqrt(MARGIN)
        growth = [StepMap(integrator, k, 0.0 * d, d, reach, mass + a).growth for mass in c]
        return np.all(np.array(growth) <= 1.0 + 1e-9, axis=0)
    spare = spare_armature(integrator, armature, stiffness, t.damping, h)
    spare -= (1.0 - MARGIN) * armature
    return np.all([is_stable(MARGIN * mass, spare) for mass in c], axis=0)


def appendage_poles(modal: Modal, motion: Motion) -> Complex:
    """Poles [1/s] that `form4` gives a craft whose motion was read without timing."""
    return Craft.of(modal, motion).appendage_poles()


def form4(
    modal: Modal,
    c: Array,
    integrator: str,
    h: float,
    plan: TendonValues,
    motions: Sequence[Motion],
    poles: Sequence[Complex] | None = None,
) -> TendonValues:
    """Form 2's plan, tuned; or itself where that cannot be or would cost stability.

    `c` as of `stability`; `motions`: of the whole craft without timing in its tendons, at this
    step, in every pose; what its own springs and dampers do is taken into account, but only the
    poles of appendages are asked for; `poles`: what they should be in every pose, where those
    motions have not them themselves.
    """
    if not SCHEMES[integrator].exact:
        return plan
    crafts = [Craft.of(modal, motion) for motion in motions]
    poles = [craft.appendage_poles() for craft in crafts] if poles is None else poles
    if not all(each.size for each in poles):
        return plan
    for phase in dict.fromkeys((SCHEMES[integrator].phase, plan.phase)):
        # tuned to the craft's own poles, the usual limit may do where form 2 had to lower it
        wanted = [np.exp(each * h * np.minimum(phase / (np.abs(each) * h), 1.0)) for each in poles]
        found = tune(crafts, plan.armature, plan.damping, wanted, h)
        largest = stability(integrator, c, modal.stiffness, found.damping, found.armature, h)
        if largest <= _limit(integrator) and (found.error < EXACT or phase == plan.phase):
            slowed, clamped = np.array([(mode.slowed, mode.clamped) for mode in plan.modes]).T
            t = Timed(1.0 + found.armature, found.damping, slowed, clamped)
            w = modal.frequency
            modes = _modes(
                modal.names, integrator, w, modal.damping / (2.0 * w), modal.stiffness, t, h
            )
            return replace(
                plan,
                armature=found.armature,
                damping=found.damping,
                lambda_max=largest,
                phase=phase,
                modes=modes,
            )
    return plan


@dataclass(frozen=True, eq=False)
class Craft:
    """A craft without timing, and the modal tendons on it.

    Args:
        motion: of the craft.
        rows: `(n, nv)` of the modal tendons by its coordinates.
        stiffness, damping: `(n,)` of the modal tendons.
    """

    motion: Motion
    rows: Array
    stiffness: Array
    damping: Array

    @classmethod
    def of(cls, modal: Modal, motion: Motion) -> "Craft":
        """The craft whose motion was read from a compiled model without timing."""
        return cls(motion, modal.rows @ motion.shapes, modal.stiffness, modal.damping)

    def appendage_poles(self) -> Complex:
        """Oscillating poles of the craft [1/s] above the real axis whose strain energy is
        mostly in modal tendons."""
        squares = self.motion.squares
        n = squares.size
        w = np.sqrt(np.maximum(squares, 0.0))
        scale = np.where(w > 0.0, w, 1.0)  # balanced: states w y, y'
        f = np.block(
            [[np.zeros((n, n)), np.diag(scale)], [-np.diag(squares / scale), -self.motion.damping]]
        )
        s, vectors = (np.asarray(part, dtype=np.complex128) for part in np.linalg.eig(f))
        shapes = vectors[:n] / scale[:, None]
        held = (self.stiffness[:, None] * np.abs(self.rows @ shapes) ** 2).sum(axis=0)
        total = (squares[:, None] * np.abs(shapes) ** 2).sum(axis=0)
        mine = (s.imag > 1e-9 * np.abs(s)) & (held > MOSTLY * total)
        return s[mine][np.argsort(np.abs(s[mine]))]


def _modes(
    names: tuple[str, ...],
    integrator: str,
    w: Array,
    zeta: Array,
    stiffness: Array,
    t: Timed,
    h: float,
) -> tuple[ModeTime, ...]:
    z = step_pole(integrator, t.mass, t.damping, stiffness, h)
    s = np.log(z) / h
    return tuple(
        ModeTime(n, float(a), float(b), float(m), float(c), complex(p), bool(slow), bool(clamp))
        for n, a, b, m, c, p, slow, clamp in zip(
            names, w, zeta, t.mass, t.damping, s, t.slowed, t.clamped, strict=True
        )
    )


class Tuned(NamedTuple):
    """Armature and damping `(n,)`, and the worst relative error of a pole."""

    armature: Array
    damping: Array
    error: float


def tune(
    crafts: Sequence[Craft],
    armature: Array,
    damping: Array,
    wanted: Sequence[Complex],
    timestep: float,
) -> Tuned:
    """Armature and damping `(n,)` for which the craft's step has the poles `wanted` `(k,)` in each
    of its poses, by Newton's method.

    The poles obey `P(z) y = 0` with all of P symmetric, so that a change of P moves a pole by `dz =
    -y^T dP y/(y^T P'(z) y)`. Like appendages, and several poses, get the least-squares answer, in
    which slow poles count more than fast ones; no damping stays none.
    """
    h = float(timestep)
    turns = [np.abs(np.log(each)) for each in wanted]
    slowest = min(float(np.min(turn)) for turn in turns)
    sizes = [
        np.abs(each - 1.0) * (turn / slowest) ** PRIORITY
        for each, turn in zip(wanted, turns, strict=True)
    ]
    # in which the dampers weigh as the armature does
    unit = (1.0 - np.exp(-h * np.sqrt(crafts[0].stiffness))) / h
    unit = unit if np.any(damping > 0.0) else unit[:0]
    now = Tuned(np.array(armature), np.array(damping), float("inf"))
    best: Tuned | None = None
    for _ in range(ITERATIONS):
        steps = [_Step.of(craft, now.armature, now.damping) for craft in crafts]
        shown = [step.paired(each) for step, each in zip(steps, wanted, strict=True)]
        if any(z.size < each.size for (z, _), each in zip(shown, wanted, strict=True)):
            break
        miss = np.concatenate(
            [(each - z) / size for (z, _), each, size in zip(shown, wanted, sizes, strict=True)]
        )
        error = float(np.max(np.abs(miss)))
        before = float("inf") if best is None else best.error
        if best is None or error < before:
            best = now._replace(error=error)
        rises = error > (0.5 if error < NEAR else 2.0) * before
        stays = abs(error - before) < STUCK * before
        if error < CLOSE or rises or stays:
            break
        slopes = [step.derivatives(*found) for step, found in zip(steps, shown, strict=True)]
        # (2 k, n) or (2 k, 2 n), pose by pose
        jacobian = np.vstack(
            [
                np.hstack([by_armature, by_damping[:, : unit.size] * unit]) / size[:, None]
                for (by_armature, by_damping), size in zip(slopes, sizes, strict=True)
            ]
        )
        lowest = -np.concatenate([now.armature, now.damping[: unit.size] / unit])
        change = _bounded_step(jacobian, miss, lowest)
        n = now.armature.size
        moved = now.damping.copy()
        moved[: unit.size] += change[n:] * unit
        now = Tuned(
            np.maximum(now.armature + change[:n], 0.0), np.maximum(moved, 0.0), float("inf")
        )
    return best or Tuned(armature, damping, float("inf"))


def _bounded_step(jacobian: Complex, miss: Complex, lowest: Array) -> Array:
    """`(n,)` real change, not below `lowest`, that comes nearest to `jacobian @ change = miss`."""
    n = lowest.size
    rows = np.vstack([np.real(jacobian), np.imag(jacobian), STEADY * np.eye(n)])
    right = np.concatenate([np.real(miss), np.imag(miss), np.zeros(n)])
    bounds = (np.minimum(lowest, -1e-300), np.full(n, np.inf))
    return np.asarray(lsq_linear(rows, right, bounds, method="bvls").x, dtype=np.float64)


class _Step(NamedTuple):
    """The step of a craft with tuned tendons, rows `(n, nv)`."""

    rows: Array
    map: StepMap

    @classmethod
    def of(cls, craft: Craft, armature: Array, damping: Array) -> "_Step":
        """With armature and damping `(n,)` of the modal tendons."""
        rows, change = craft.rows, damping - craft.damping
        return cls(rows, craft.motion.with_tendons(rows, 0.0 * change, change, armature))

    def poles(self) -> tuple[Complex, Complex]:
        """Oscillating poles of the step, upper half plane, and the modes in columns."""
        step, vectors = np.linalg.eig(self.map.matrices()[0])
        upper = np.imag(step) > RINGING
        shapes = vectors[: self.rows.shape[1], upper]
        return 1.0 + step[upper].astype(np.complex128), shapes.astype(np.complex128)

    def paired(self, wanted: Complex) -> tuple[Complex, Complex]:
        """Of these the ones nearest to the `wanted` `(k,)`, in their order; fewer where the step
        has not so many."""
        z, y = self.poles()
        distance = np.abs(z[None, :] - wanted[:, None]) / np.abs(wanted - 1.0)[:, None]
        pick = linear_sum_assignment(distance)[1]
        return z[pick], y[:, pick]

    def derivatives(self, z: Complex, y: Complex) -> tuple[Complex, Complex]:
        """`(k, n)` of poles `(k,)` with modes `(nv, k)` by armature and by damping."""
        step = z - 1.0
        # -(b y)^2 / (y^T P'(z) y) of each tendon's row b
        lever = -((self.rows @ y) ** 2) / np.sum(y * self.map.slope(step, y), axis=0)
        _, implicit, explicit = step_factors(self.map.integrator, step, self.map.timestep)
        damper = implicit if SCHEMES[self.map.integrator].implicit_damping else explicit
        return lever.T, (lever * damper).T
