"""`M q'' + C q' + K q = B u` of a craft at an operating point, and what its outputs read.

Slopes by differences of five points: what is linear or cubic in the perturbation (springs, dampers, gyroscopic moments)
comes out to rounding, small rotations to 1e-13. `mjd_transitionFD` is the proof in the tests.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.engine.linearise import dense_mass
from beamchain.plants.operating_point import OperatingPoint
from beamchain.plants.signals import Input, Output
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array

POSITION, RATE = 1e-3, 1.0  # perturbations
STENCIL = ((1.0, 8.0 / 12.0), (-1.0, -8.0 / 12.0), (2.0, -1.0 / 12.0), (-2.0, 1.0 / 12.0))


@dataclass(frozen=True, eq=False)
class SecondOrder:
    """A linear craft; `a` are the actuators' activations.

    `M q'' + C q' + K q = F a + B u`, `a' = L a + E u`, `y = Yq q + Yv q' + Ya a + Yu u`.

    Args:
        mass, damping, stiffness: `(nv, nv)`; the damping holds the gyroscopic moments of the wheels.
        activation: `(nv, na)` F.
        force: `(nv, m)` B.
        lag, feed: `(na, na)` L and `(na, m)` E.
        of_position, of_rate, of_activation, of_input: `(p, ...)` Yq, Yv, Ya, Yu.
        of_acceleration: `(p, nv)` what the outputs read of an acceleration (Yq, Yv and Yu hold it already).
    """

    mass: Array
    damping: Array
    stiffness: Array
    activation: Array
    force: Array
    lag: Array
    feed: Array
    of_position: Array
    of_rate: Array
    of_activation: Array
    of_input: Array
    of_acceleration: Array

    @cached_property
    def first_order(self) -> tuple[Array, Array, Array, Array]:
        """A, B, C, D over the states (q, q', a)."""
        nv, na = self.activation.shape
        m = self.force.shape[1]
        solved = np.linalg.solve(self.mass, np.hstack([-self.stiffness, -self.damping, self.activation, self.force]))
        a = np.zeros((2 * nv + na, 2 * nv + na))
        a[:nv, nv : 2 * nv] = np.eye(nv)
        a[nv : 2 * nv] = solved[:, :-m]
        a[2 * nv :, 2 * nv :] = self.lag
        b = np.vstack([np.zeros((nv, m)), solved[:, -m:], self.feed])
        return a, b, np.hstack([self.of_position, self.of_rate, self.of_activation]), self.of_input

    def with_appendages(self, jacobians: Sequence[Array], models: Sequence[PortModel]) -> "SecondOrder":
        """This bare craft with appendages as port models, their modal coordinates behind its own degrees of freedom.

        Args:
            jacobians: `(6, nv)` motion of each root, in its axes.
            models: with six motions.
        """
        nv, extra = self.mass.shape[0], sum(model.modes for model in models)
        size = nv + extra

        def grown(matrix: Array, rows: int, columns: int) -> Array:
            return np.pad(matrix, ((0, rows), (0, columns)))

        mass, damping = grown(self.mass, extra, extra), grown(self.damping, extra, extra)
        stiffness = grown(self.stiffness, extra, extra)
        start = nv
        for jacobian, model in zip(jacobians, models, strict=True):
            mine = slice(start, start + model.modes)
            mass[:nv, :nv] += jacobian.T @ model.rigid_mass @ jacobian
            mass[mine, :nv] = model.participation @ jacobian
            mass[:nv, mine] = mass[mine, :nv].T
            mass[mine, mine] = np.eye(model.modes)
            stiffness[mine, mine] = np.diag(model.frequencies**2)
            damping[mine, mine] = np.diag(2.0 * model.damping * model.frequencies)
            start += model.modes
        out = replace(
            self, mass=mass, damping=damping, stiffness=stiffness, activation=grown(self.activation, extra, 0),
            force=grown(self.force, extra, 0),
        )  # fmt: skip
        own, all_ = self._accelerations(), out._accelerations()
        seen = grown(self.of_acceleration, 0, extra)
        parts = [self.of_position, self.of_rate, self.of_activation, self.of_input]
        new = [
            grown(part - self.of_acceleration @ mine, 0, width - part.shape[1]) + seen @ whole
            for part, mine, whole, width in zip(
                parts, own, all_, (size, size, self.lag.shape[0], self.of_input.shape[1]), strict=True
            )
        ]
        return replace(
            out, of_position=new[0], of_rate=new[1], of_activation=new[2], of_input=new[3], of_acceleration=seen
        )

    def _accelerations(self) -> list[Array]:
        """q'' by q, q', a and u."""
        sides = (-self.stiffness, -self.damping, self.activation, self.force)
        return [np.asarray(np.linalg.solve(self.mass, side), dtype=np.float64) for side in sides]


def slopes(function: "Callable[[int, float], Array]", size: int, step: float) -> Array:
    """`(n, size)` slope of a vector by each of `size` perturbations, by five points."""
    columns = [sum(weight / step * function(i, place * step) for place, weight in STENCIL) for i in range(size)]
    return np.array(columns).T.astype(np.float64) if columns else np.zeros((0, 0))


def second_order(point: OperatingPoint, inputs: Sequence[Input], outputs: Sequence[Output]) -> SecondOrder:
    """The craft at an operating point, linear.

    Args:
        point: where.
        inputs, outputs: its signals.
    """
    model, data = point.model, point.data()
    nv, na = model.nv, model.na
    mass = dense_mass(model, data)
    count = sum(len(output.labels) for output in outputs)

    def seen() -> Array:
        mujoco.mj_forward(model, data)
        read = [output.read(data) for output in outputs]
        return np.concatenate([data.qfrc_passive + data.qfrc_actuator, data.qfrc_bias, data.act_dot, *read])

    def reset() -> None:
        data.qpos[:], data.qvel[:] = point.qpos, point.qvel
        data.act[:], data.ctrl[:], data.xfrc_applied[:], data.qfrc_applied[:] = 0.0, 0.0, 0.0, 0.0

    def position(i: int, by: float) -> Array:
        reset()
        mujoco.mj_integratePos(model, data.qpos, np.eye(nv)[i], by)
        return seen()

    def rate(i: int, by: float) -> Array:
        reset()
        data.qvel[i] += by
        return seen()

    def activation(i: int, by: float) -> Array:
        reset()
        data.act[i] = by
        return seen()

    def control(i: int, by: float) -> Array:
        reset()
        inputs[i].apply(data, by)
        return seen()

    def acceleration(i: int, by: float) -> Array:
        reset()
        data.qfrc_applied[:] = by * mass[:, i]
        return seen()

    def table(function: "Callable[[int, float], Array]", size: int, step: float) -> Array:
        return slopes(function, size, step).reshape(2 * nv + na + count, size)

    by_q, by_v = table(position, nv, POSITION), table(rate, nv, RATE)
    by_a, by_u, by_acc = table(activation, na, RATE), table(control, len(inputs), RATE), table(acceleration, nv, RATE)
    force = by_u[:nv] + np.column_stack([_applied(model, point.data(), item) for item in inputs])
    stiffness, damping = -by_q[:nv], -by_v[:nv]
    rest = slice(2 * nv, 2 * nv + na)
    y = slice(2 * nv + na, None)
    return SecondOrder(
        mass, (damping + damping.T) / 2.0 + by_v[nv : 2 * nv], (stiffness + stiffness.T) / 2.0, by_a[:nv], force,
        by_a[rest], by_u[rest], by_q[y], by_v[y], by_a[y], by_u[y], by_acc[y],
    )  # fmt: skip


def _applied(model: "mujoco.MjModel", data: "mujoco.MjData", item: Input) -> Array:
    """`(nv,)` generalised force of a wrench; zero for an actuator, whose force MuJoCo gives."""
    out = np.zeros(model.nv)
    if item.wrench is not None:
        mujoco.mj_applyFT(model, data, item.wrench[:3], item.wrench[3:], data.xipos[item.body], item.body, out)
    return out
