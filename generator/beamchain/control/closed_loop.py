"""A plant and a controller closed: open loops with exact dead times, poles, a grid that resolves
them, and the count of unstable poles by Nyquist's criterion."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import control
import numpy as np
from numpy.typing import NDArray

from beamchain.control.controllers import ORDER, Controller
from beamchain.control.feedback import Feedback, Given, Signals, feedback
from beamchain.control.sampling import sampled
from beamchain.control.systems import (
    ROUNDED,
    Complex,
    System,
    growth,
    linking,
    response,
    size_at_rest,
    touched,
    with_states,
)
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.ports.peaks import around, half_widths

ORDERS = (ORDER, 8, 10, 12)  # of Pade approximations, until the number of unstable poles is right
UNDAMPED = 1e-8  # damping ratio, and relative distance to a pole, that are rounding
NEAR = half_widths(6.0, 62)
PER_DECADE = 400  # frequencies
ALGEBRAIC = 1e-12  # relative, of an algebraic loop that is singular
BESIDE = 1e-6  # rad beside the imaginary axis, where Nyquist's criterion counts
TURN = 0.4  # rad between neighbouring points of the count
ROUNDS = 40  # of points put between
DEAD_BEAT = 600.0  # of |s| T: z = 0, which is taken as 1e-300 where a logarithm is


def dead_beat(poles: Complex, step: float) -> NDArray[np.bool_]:
    """`(k,)` which poles s of a loop that is sampled with a step [s] are at z = 0."""
    return np.abs(poles) * step > DEAD_BEAT


class Names(NamedTuple):
    """How a plant calls its signals, states and modes."""

    signals: Signals
    states: tuple[str, ...]
    modes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """`u = -K G u` at the inputs that a controller drives.

    Args:
        plant: A, B, C, D from these inputs to the outputs it measures, at its samples.
        controller: A, B, C, D of K, dead times as Pade approximations.
        fed: K.
        inputs: names of the inputs.
        measured: names of the outputs that each is fed from.
        states: names of the states of the plant.
        modes: names of its modes.
        step: [s] of the samples; 0: continuous.
        held: A, B, C, D of a continuous plant that is sampled; None: it is not, or known only at
            its samples.
        count: of unstable poles by Nyquist's criterion, dead times exact; None: not counted.
    """

    plant: System
    controller: System
    fed: Feedback
    inputs: tuple[str, ...]
    measured: tuple[tuple[str, ...], ...]
    states: tuple[str, ...]
    modes: tuple[str, ...]
    step: float
    held: System | None = None
    count: int | None = None

    def closed(self, gain: complex, loops: NDArray[Any]) -> NDArray[Any]:
        """The matrix of the closed loop with the gains of all loops times `gain`, and those of
        each input times 0 or 1."""
        plant_a, plant_b, plant_c, plant_d = self.plant
        a, b, c, d = self.controller
        n = plant_a.shape[0]
        # K = g C (s - A)^-1 B + g D, in equal parts on B and C: without gain nothing is coupled
        root, by_input = np.sqrt(gain), loops[:, None]
        # u = -(C_K x_K + D_K y) with y = C x + D u
        law = np.hstack([gain * by_input * (d @ plant_c), root * by_input * c])
        u = np.linalg.solve(np.eye(loops.size) + gain * by_input * (d @ plant_d), -law)
        open_loops = np.zeros((n + a.shape[0],) * 2, dtype=u.dtype)
        open_loops[:n, :n], open_loops[n:, n:] = plant_a, a
        open_loops[n:, :n] = root * (b @ plant_c)
        return open_loops + np.vstack([plant_b, root * (b @ plant_d)]) @ u

    @cached_property
    def eigenvalues(self) -> Complex:
        """`(n,)` poles s, or z, of the closed loop."""
        matrix = self.closed(1.0, np.ones(len(self.inputs)))
        return np.linalg.eigvals(matrix).astype(np.complex128)

    def to_s(self, poles: Complex) -> Complex:
        """Poles s of poles s, or z; dead-beat ones, at z = 0, are very fast."""
        if not self.step:
            return poles
        size = np.maximum(np.abs(poles), 1e-300)
        logs = np.log(size) + 1j * np.angle(poles)
        return (logs / self.step).astype(np.complex128)

    def to_point(self, omega: Array) -> Complex:
        """`(k,)` s, or z, at frequencies `(k,)` [rad/s]."""
        s = 1j * omega
        return (np.exp(s * self.step) if self.step else s).astype(np.complex128)

    @cached_property
    def top(self) -> float:
        """Size of the fastest pole [rad/s]."""
        if self.step:
            return np.pi / self.step
        return float(np.abs(self.eigenvalues).max(initial=1e-300))

    @cached_property
    def rest(self) -> float:
        """Size of an open pole below which it is at rest [rad/s]; no pole of the closed loop is."""
        poles = self.to_s(np.linalg.eigvals(self.plant[0]).astype(np.complex128))
        return size_at_rest(poles, self.to_s(self.eigenvalues), self.top)

    def growth(self, poles: Complex) -> Array:
        """`(k,)` growth of poles s, or z, beside rounding, less one: above zero they are unstable,
        at -1 on the axis. Those at rest do not grow."""
        return growth(self.to_s(poles), self.rest, self.top)

    @cached_property
    def limit(self) -> Array | None:
        """`(inputs, inputs)` K G at infinite frequency; None where there is none, or it is zero."""
        direct = self.controller[3] @ self.plant[3]
        return None if self.step or self.fed.delayed or not direct.any() else direct

    def undamped(self, omega: float) -> bool:
        """Whether an open pole on the axis is at a frequency [rad/s]."""
        far = np.abs(self.open_poles - 1j * omega)
        still = np.abs(self.open_poles.real) <= UNDAMPED * np.abs(self.open_poles)
        return bool(np.any(still & (far <= UNDAMPED * omega)))

    @cached_property
    def growing(self) -> Complex:
        """Unstable poles s, or z."""
        return self.eigenvalues[self.growth(self.eigenvalues) > 0.0]

    @property
    def stable(self) -> bool:
        """Whether no pole grows; where dead times were counted exactly, that counts."""
        return self.growing.size == 0 if self.count is None else self.count == 0

    def open_loop(self, omega: Array) -> Complex:
        """`(k, inputs, inputs)` K G at frequencies [rad/s]."""
        return self.open_loop_at(self.to_point(omega))

    def open_loop_at(self, point: Complex) -> Complex:
        """`(k, inputs, inputs)` K G at s, or z."""
        return self.fed.response(point) @ response(self.plant, point)

    @cached_property
    def open_poles(self) -> Complex:
        """Poles s of plant and controller."""
        both = [np.linalg.eigvals(part[0]) for part in (self.plant, self.controller)]
        return self.to_s(np.concatenate(both).astype(np.complex128))

    @cached_property
    def omega(self) -> Array:
        """`(k,)` frequencies that resolve open and closed loop [rad/s]; of a sampled one up to
        pi/T."""
        return self.frequencies(PER_DECADE, NEAR)

    def frequencies(self, per_decade: int, near: Array) -> Array:
        """The same with so many per decade, and `near` `(n,)` half widths beside a resonance."""
        poles = np.concatenate([self.to_s(self.eigenvalues), self.open_poles])
        limit = np.pi / self.step if self.step else np.inf
        size = np.abs(poles)
        seen = (size > max(self.rest, ROUNDED * self.top)) & ~dead_beat(poles, self.step)
        poles = poles[seen & (poles.imag >= 0.0)]
        if not poles.size:
            poles = np.ones(1, dtype=np.complex128)
        size = np.abs(poles)
        ratio = np.clip(np.abs(poles.real) / size, 1e-6, 0.02)
        low, high = 0.01 * min(float(size.min()), limit), min(10.0 * float(size.max()), limit)
        decades = np.log10(high / low)
        wide = np.geomspace(low, high, int(per_decade * decades) + 2)
        wide[-1] = high
        grid = np.unique(np.concatenate([around(size, ratio * size, near), wide]))
        return grid[(grid >= low) & (grid <= high)]


def close(plant: control.StateSpace, names: Names, controller: Given) -> ClosedLoop:
    """A controller closed around a plant.

    Raises:
        InputError: they do not fit each other.
    """
    fed = feedback(controller, names.signals)
    plant_step = _plant_step(plant)
    step = plant_step if fed.step is None else fed.step
    if plant_step and not step:
        raise InputError(
            f"controller: {_what_samples(controller, plant_step)}, or leave discrete out of the "
            "plant (dead times are then exact)."
        )
    a, b, c, d = (np.asarray(getattr(plant, name), dtype=np.float64) for name in "ABCD")
    if not all(np.all(np.isfinite(part)) for part in (a, b, c, d)):
        raise InputError("plant: A, B, C or D holds a number that is not finite.")
    return counted(closed_around((a, b, c, d), fed, names, plant_step))


def closed_around(
    plant: System, fed: Feedback, names: Names, plant_step: float = 0.0
) -> ClosedLoop:
    """The same from a plant's state space at a step [s], dead times not yet counted."""
    a, b, c, d = plant
    step = plant_step if fed.step is None else fed.step
    system = a, b[:, fed.columns], c[fed.rows], d[np.ix_(fed.rows, fed.columns)]
    keep = linking(system)
    # motion at rest that no loop touches stays at rest, and is no part of what is closed
    system, among = touched(with_states(system, keep), 1.0 if plant_step else 0.0)
    keep = [keep[i] for i in among]
    held = system if step and not plant_step else None
    if step:
        system = sampled(system, plant_step, step)
    loops = fed.realise(ORDER)
    _check_algebraic(system, loops)
    return ClosedLoop(
        plant=system,
        controller=loops,
        fed=fed,
        inputs=tuple(names.signals.inputs[i] for i in fed.columns),
        measured=tuple(
            tuple(names.signals.outputs[i] for i in some) for some in fed.measured(loops)
        ),
        states=tuple(names.states[i] for i in keep),
        modes=names.modes,
        step=step,
        held=held,
    )


def _what_samples(controller: Given, step: float) -> str:
    """What a continuous controller is beside a sampled plant, and how it is sampled."""
    sample = f"control.c2d(system, {step:g})"
    if isinstance(controller, Controller | str | Path):
        return (
            f"the loops of a file are continuous, the plant sampled at {step:g} s; give a system "
            f"of python-control that is sampled, {sample}"
        )
    return f"it is continuous, the plant sampled at {step:g} s; sample the controller, {sample}"


def _plant_step(plant: control.StateSpace) -> float:
    """Step of a plant [s]; 0: continuous."""
    step: float | bool | None = plant.dt  # pyright: ignore[reportUnknownMemberType]
    if step is True:
        raise InputError("plant: it does not say its step (dt = True); give it in seconds.")
    return float(step or 0.0)


def _check_algebraic(plant: System, controller: System) -> None:
    """Refuse loops that no time passes in, and that have no solution."""
    through = np.eye(plant[3].shape[1]) + controller[3] @ plant[3]
    least = float(np.linalg.svd(through, compute_uv=False).min(initial=np.inf))
    if not least > ALGEBRAIC * max(1.0, float(np.abs(through).max(initial=0.0))):
        raise InputError(
            "controller: with the direct part of the plant it makes an algebraic loop that has no "
            "solution, 1 + K G = 0 at infinite frequency; give the controller a pole or a delay."
        )


def counted(closed: ClosedLoop) -> ClosedLoop:
    """The same with a Pade approximation that has as many unstable poles as the dead times
    themselves, if there is one."""
    count = unstable_count(closed) if closed.fed.delayed else None
    if count is None:
        return closed
    for order in ORDERS:
        better = replace(closed, controller=closed.fed.realise(order), count=count)
        if better.growing.size == count:
            return better
    return replace(closed, count=count)


def unstable_count(closed: ClosedLoop) -> int | None:
    """Poles that grow of a continuous closed loop, dead times exact, by the turns of
    `det(1 + K G)` along a ray just right of the imaginary axis; None: it does not end at rest.

    The half turns of the determinant along the ray are those of the open loop's unstable poles less
    those of the closed loop's.
    """
    low, high = 1e-3 * float(closed.omega[0]), float(closed.omega[-1])

    def size(omega: float) -> float:
        return float(np.linalg.norm(closed.open_loop(np.array([omega]))[0], 2))

    for _ in range(4):
        if size(high) > 0.2:
            high *= 10.0
    if size(high) > 0.2:
        return None
    arc = np.linspace(0.0, np.pi / 2.0 - BESIDE, 60)
    ray = np.concatenate([closed.omega, np.geomspace(low, high, 2000)])
    ray = np.unique(ray[(ray > low) & (ray <= high)])
    path = np.concatenate([low * np.exp(1j * arc), ray * np.exp(1j * arc[-1])])
    turned = _turn(lambda s: _determinant(closed, s), path.astype(np.complex128))
    poles = np.concatenate(
        [np.linalg.eigvals(closed.plant[0]), np.linalg.eigvals(closed.fed.realise(0)[0])]
    )
    right = (np.abs(np.angle(poles)) < np.pi / 2.0 - BESIDE) & (np.abs(poles) > low)
    found = int(np.sum(right)) - turned / np.pi
    count = round(found)
    return count if abs(found - count) < 0.2 and count >= 0 else None


def _determinant(closed: ClosedLoop, s: Complex) -> Complex:
    loop = closed.open_loop_at(s)
    return np.asarray(np.linalg.det(np.eye(loop.shape[1]) + loop), dtype=np.complex128)


def _turn(function: Callable[[Complex], Complex], path: Complex) -> float:
    """Angle [rad] by which a function turns along a path, points put between where it turns far."""
    values = function(path)
    for _ in range(ROUNDS):
        far = np.flatnonzero(np.abs(np.angle(values[1:] / values[:-1])) > TURN)
        if not far.size:
            break
        between = (path[far] + path[far + 1]) / 2.0
        path = np.insert(path, far + 1, between)
        values = np.insert(values, far + 1, function(between))
    return float(np.sum(np.angle(values[1:] / values[:-1])))
