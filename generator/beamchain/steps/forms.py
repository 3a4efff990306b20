"""What each form writes on the modal tendons: stiffness, damping, armature, and the phase up to which modes keep their frequency.

The forms are described in `beamchain.steps.retime`.

Theory: docs/theory.md, section 5.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import linear_sum_assignment

from beamchain.engine.library import mujoco
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.steps import discrete
from beamchain.steps.modal import (
    Modal,
)
from beamchain.steps.tune import tune

T = TypeVar("T")


MARGIN = {"RK4": 7.6}  #: `h^2 lambda_max` allowed; of 8


SEMI_IMPLICIT_MARGIN = 3.8  #: the same for the others; of 4


EXACT = 1e-6  # pole error below which tuning is taken to have succeeded


LOWEST = 0.05  # [rad] phase below which the limit is not lowered


@dataclass(frozen=True)
class ModeTime:
    """One mode made exact in time.

    Args:
        name: of its tendon; `coupled<k>` where form 3 laid no mode on one tendon alone.
        frequency: [rad/s] that it should show; form 2: of the held appendage, form 3: of the craft.
        ratio: of damping.
        mass: `m'`, its tendon's armature and 1.
        damping: `c'` of its tendon [1/s].
        pole: that its mass and damping place [1/s], `log(z)/h`; of several appendages' blocks only nearly that of the craft.
        slowed: it is beyond the phase limit.
        clamped: the integrator would need negative armature; its pole is only near.
    """

    name: str
    frequency: float
    ratio: float
    mass: float
    damping: float
    pole: complex
    slowed: bool
    clamped: bool


@dataclass(frozen=True, eq=False)
class Plan:
    """Numbers for the tendons; `turn` `(n, n)`: new coefficients are `turn @ rows`, None: as they are."""

    stiffness: Array
    damping: Array
    armature: Array
    turn: Array | None
    phase: float
    lambda_max: float
    left_out: float
    modes: tuple[ModeTime, ...]


def stability(integrator: str, c: Array, stiffness: Array, damping: Array, armature: Array, timestep: float) -> float:
    """`h^2 lambda_max` of modal springs and dampers on a craft: the step is stable below 4, RK4's below 8.

    The pencil is `(h^2 K + 2 h D, C + mu)` where tendon damping is explicit, `(h^2 K - 2 h D, C + mu)` where it is
    implicit (a pole leaves the unit circle at z = -1). For RK4 it is `(h^2 K, C + mu)` undamped; damped, 8 times the squared
    ratio of the step to the largest one that its polynomial takes.

    Args:
        integrator: MuJoCo's name.
        c: `(n, n)` condensed mass of the modal coordinates.
        stiffness: `(n, n)` K in modal coordinates.
        damping: `(n, n)` D.
        armature: `(n, n)` mu.
        timestep: h [s].
    """
    h = float(timestep)
    if integrator == "RK4" and np.any(damping):
        return _explicit(c + armature, stiffness, damping, h)
    sign = 0.0 if integrator == "RK4" else -1.0 if discrete.SCHEMES[integrator].implicit_damping else 1.0
    return float(np.max(eigh(h**2 * stiffness + 2.0 * sign * h * damping, c + armature, eigvals_only=True)))


def _explicit(mass: Array, stiffness: Array, damping: Array, h: float) -> float:
    n = mass.shape[0]
    root = np.linalg.inv(np.linalg.cholesky(mass))
    k, d = root @ stiffness @ root.T, root @ damping @ root.T
    poles = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-(h**2) * k, -h * d]])).astype(np.complex128)
    return 8.0 * max(1.0 / discrete.runge_kutta_limit(complex(p)) ** 2 for p in poles if p.imag >= 0.0)


def _limit(integrator: str) -> float:
    return MARGIN.get(integrator, SEMI_IMPLICIT_MARGIN)


def form2(modal: Modal, c: Array, integrator: str, h: float) -> Plan:
    """Every mode of the held appendage exact; the phase limit lowered until the craft is stable."""
    w = modal.frequency
    zeta = modal.damping / (2.0 * w)

    def at(phase: float) -> tuple[discrete.Timed, float]:
        t = discrete.timed(integrator, w, zeta, h, phase=phase)
        return t, stability(
            integrator, c, np.diag(modal.stiffness), np.diag(t.damping), np.diag(t.mass - 1.0), h
        )  # fmt: skip

    (t, largest), phase = _lowered(integrator, at)
    return Plan(
        modal.stiffness, t.damping, t.mass - 1.0, None, phase, largest, 0.0,
        _modes(modal.names, integrator, w, zeta, modal.stiffness, t, h),
    )  # fmt: skip


def form4(modal: Modal, c: Array, integrator: str, h: float, plan: Plan) -> Plan:
    """Form 2's plan, tuned; or itself where the integrator cannot be exact or tuning would cost stability."""
    if not discrete.SCHEMES[integrator].exact:
        return plan
    _, _, poles = coupled_modes(c, modal.stiffness, modal.damping)
    first, second = poles.T
    turn = np.maximum(np.abs(first), np.abs(second)) * h
    for phase in dict.fromkeys((discrete.SCHEMES[integrator].phase, plan.phase)):
        # tuned to the craft's own poles, the usual limit may do where form 2 had to lower it
        wanted = np.exp(first * h * np.where(turn > phase, phase / turn, 1.0))
        if np.any(np.imag(wanted) <= 0.0):  # overdamped
            return plan
        found = tune(integrator, c, modal.stiffness, plan.armature, plan.damping, wanted, h)
        largest = stability(integrator, c, np.diag(modal.stiffness), np.diag(found.damping), np.diag(found.armature), h)
        if largest <= _limit(integrator) and (found.error < EXACT or phase == plan.phase):
            t = discrete.Timed(
                1.0 + found.armature,
                found.damping,
                np.array([mode.slowed for mode in plan.modes]),
                np.array([mode.clamped for mode in plan.modes]),
            )
            w = modal.frequency
            modes = _modes(modal.names, integrator, w, modal.damping / (2.0 * w), modal.stiffness, t, h)
            return replace(
                plan, armature=found.armature, damping=found.damping, lambda_max=largest, phase=phase, modes=modes
            )
    return plan


def _lowered(integrator: str, at: Callable[[float], tuple[T, float]]) -> tuple[tuple[T, float], float]:
    """What `at` gives at the largest phase limit at which the craft is stable."""
    phase = discrete.SCHEMES[integrator].phase
    best = at(phase)
    if not np.isfinite(phase) or best[1] <= _limit(integrator):
        return best, phase
    low, high = LOWEST, phase
    best = at(low)
    for _ in range(14):
        middle = float(np.sqrt(low * high))
        found = at(middle)
        if found[1] <= _limit(integrator):
            low, best = middle, found
        else:
            high = middle
    return best, low


def _modes(
    names: tuple[str, ...], integrator: str, w: Array, zeta: Array, stiffness: Array, t: discrete.Timed, h: float
) -> tuple[ModeTime, ...]:
    z = discrete.step_pole(integrator, t.mass, t.damping, stiffness, h)
    s = np.log(z) / h
    return tuple(
        ModeTime(n, float(a), float(b), float(m), float(c), complex(p), bool(slow), bool(clamp))
        for n, a, b, m, c, p, slow, clamp in zip(names, w, zeta, t.mass, t.damping, s, t.slowed, t.clamped, strict=True)
    )


def coupled_modes(c: Array, stiffness: Array, damping: Array) -> tuple[Array, Array, "discrete.Complex"]:
    """Undamped coupled modes, and the pole of each with all of the damping.

    Args:
        c: `(n, n)` condensed mass of the modal coordinates.
        stiffness: `(n,)` of the tendons.
        damping: `(n,)` of the tendons.

    Returns:
        `(n,)` frequencies [rad/s], `(n, n)` modes in columns, `y^T C y = 1`, and `(n, 2)` both poles [1/s].
    """
    n = stiffness.size
    # for 1/w^2: the slow modes keep all their digits beside very fast ones
    inverse, shapes = eigh(c, np.diag(stiffness))
    w = 1.0 / np.sqrt(inverse[::-1])
    y = shapes[:, ::-1] * w
    own = np.einsum("ki,k,ki->i", y, damping, y)
    first, second = discrete.continuous_poles(w, own / (2.0 * w))
    poles = np.stack([first, second], axis=1)
    if np.any(damping > 0.0):
        d = y.T @ (damping[:, None] * y)
        f = np.block([[np.zeros((n, n)), np.diag(w)], [-np.diag(w), -d]])  # balanced: states w q, q'
        s = np.linalg.eigvals(f).astype(np.complex128)
        upper = s[s.imag > 1e-9 * np.abs(s)]
        if upper.size == n:
            order = linear_sum_assignment(np.abs(first[:, None] - upper[None, :]) / w[:, None])[1]
            poles = np.stack([upper[order], np.conj(upper[order])], axis=1)
    return w, y, poles


def form3(model: "mujoco.MjModel", modal: Modal, c: Array, integrator: str, h: float) -> Plan:
    """The tendons become the coupled modes of one craft."""
    groups = modal.groups()
    _check_groups(model, modal, groups)
    n = modal.stiffness.size
    k = np.diag(modal.stiffness)
    w, y, poles = coupled_modes(c, modal.stiffness, modal.damping)
    a = c @ y  # rows of its transpose: the coupled coordinates over the modal ones
    couples = y.T @ (modal.damping[:, None] * y)
    own = np.sqrt(np.maximum(np.diag(couples), 1e-300))
    left_out = float(np.max(np.abs(couples - np.diag(np.diag(couples))) / np.outer(own, own), initial=0.0))
    flexible = np.linalg.inv(c)

    def at(phase: float) -> tuple[tuple[discrete.Timed, Array, Array, Array, Array], float]:
        t = discrete.placed(
            integrator, w**2, poles[:, 0], poles[:, 1], h, phase=phase, damping=np.diag(couples)
        )  # fmt: skip
        mu, d = (a * (t.mass - 1.0)) @ a.T, (a * t.damping) @ a.T
        turn = np.zeros((n, n))
        stiffness, damping, armature = np.zeros(n), np.zeros(n), np.zeros(n)
        for group in groups:
            g = np.ix_(group.tolist(), group.tolist())
            if len(groups) == 1:
                rows, scale = a.T, w**2
                stiff, drag, extra = w**2, t.damping, t.mass - 1.0
            else:
                # u = V^T K y: springs of 1 each; scaled to unit mass with everything else free
                v = eigh((mu[g] + mu[g].T) / 2.0, k[g])[1]
                rows = v.T @ k[g]
                scale = np.einsum("ij,jk,ik->i", rows, flexible[g], rows)
                rows = rows / np.sqrt(scale)[:, None]
                stiff = scale
                drag = scale * np.einsum("ji,jk,ki->i", v, d[g], v)
                extra = scale * np.einsum("ji,jk,ki->i", v, mu[g], v)
            order = np.argsort(scale)  # ascending, laid on the tendons by ascending frequency
            place = group[np.argsort(modal.stiffness[group])]
            signs = np.sign(np.einsum("ij,ji->i", rows[order], flexible[np.ix_(group.tolist(), place.tolist())]))
            turn[np.ix_(place.tolist(), group.tolist())] = rows[order] * np.where(signs == 0.0, 1.0, signs)[:, None]
            stiffness[place], damping[place] = stiff[order], np.maximum(drag[order], 0.0)
            armature[place] = np.maximum(extra[order], 0.0)
        back = turn.T
        return (t, turn, stiffness, damping, armature), stability(
            integrator, c, k, (back * damping) @ turn, (back * armature) @ turn, h
        )

    ((t, turn, stiffness, damping, armature), largest), phase = _lowered(integrator, at)
    zeta = -np.real(poles[:, 0]) / np.abs(poles[:, 0])
    names = (
        tuple(modal.names[i] for i in np.argsort(modal.stiffness))
        if len(groups) == 1
        else tuple(f"coupled{i + 1}" for i in range(n))
    )
    modes = _modes(names, integrator, np.abs(poles[:, 0]), zeta + 0.0, w**2, t, h)
    return Plan(stiffness, damping, armature, turn, phase, largest, left_out, modes)


def _check_groups(model: "mujoco.MjModel", modal: Modal, groups: "list[NDArray[np.intp]]") -> None:
    """Tendons may exchange coefficients where they hold the same joints, each once, and groups share none."""
    seen = np.zeros(model.nv, dtype=np.intp)
    for group in groups:
        seen += modal.rows[group[0]] != 0.0
        counts = {int(model.tendon_num[modal.index[i]]) for i in group}
        if counts != {int(np.count_nonzero(modal.rows[group[0]]))}:
            raise InputError(
                f"form 3 needs tendons that hold every joint once; {modal.names[group[0]]!r} does not. Take form 2."
            )
    if np.any(seen > 1):
        raise InputError(
            "form 3 needs tendons that hold either the same joints or none in common; those of "
            f"{modal.names[0]!r} and others overlap. Take form 2."
        )
