"""`M q'' + C q' + K q = B u` of a craft at an operating point, what its outputs read, and what one step makes of it.

Slopes by differences of five points: what is linear or cubic in the perturbation (springs, dampers, gyroscopic moments)
comes out to rounding, small rotations to 1e-13. `mjd_transitionFD` is the proof in the tests.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from beamchain.craft.plants.operating_point import OperatingPoint
from beamchain.craft.plants.signals import Input, Output
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import dense_mass
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array

POSITION, RATE = 1e-3, 1.0  # perturbations
MOVED = 2e-4  # of positions over a step: chains of hinges are far less linear than what is read off them
STENCIL = ((1.0, 8.0 / 12.0), (-1.0, -8.0 / 12.0), (2.0, -1.0 / 12.0), (-2.0, 1.0 / 12.0))


@dataclass(frozen=True, eq=False)
class SecondOrder:
    """A linear craft; `a` are the actuators' activations.

    `M q'' + C q' + K q = F a + B u`, `a' = L a + E u`, `y = Y0 q + Y1 q' + Y2 q'' + Ya a + Yu u`.

    Args:
        mass, damping, stiffness: `(nv, nv)`; the damping holds the gyroscopic moments of the wheels.
        activation, force: `(nv, na)` F, `(nv, m)` B.
        lag, feed: `(na, na)` L and `(na, m)` E.
        of_position, of_rate, of_acceleration: `(p, nv)` Y0, Y1, Y2.
        of_activation, of_input: `(p, na)` Ya, `(p, m)` Yu.
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
    of_acceleration: Array
    of_activation: Array
    of_input: Array

    @cached_property
    def first_order(self) -> tuple[Array, Array, Array, Array]:
        """A, B, C, D over the states (q, q', a)."""
        nv, na = self.activation.shape
        sides = np.hstack([-self.stiffness, -self.damping, self.activation, self.force])
        solved = np.asarray(np.linalg.solve(self.mass, sides), dtype=np.float64)
        states = 2 * nv + na
        a = np.zeros((states, states))
        a[:nv, nv : 2 * nv], a[nv : 2 * nv], a[2 * nv :, 2 * nv :] = np.eye(nv), solved[:, :states], self.lag
        b = np.vstack([np.zeros((nv, self.force.shape[1])), solved[:, states:], self.feed])
        y = np.hstack([self.of_position, self.of_rate, self.of_activation, self.of_input])
        y = y + self.of_acceleration @ solved
        return a, b, y[:, :states], y[:, states:]

    def with_appendages(self, jacobians: Sequence[Array], models: Sequence[PortModel]) -> "SecondOrder":
        """This bare craft with appendages as port models, their modal coordinates behind its own degrees of freedom.

        `jacobians` `(6, nv)`: motion of each root, in its axes.
        """
        nv, extra = self.mass.shape[0], sum(model.modes for model in models)
        mass, damping, stiffness = (np.pad(m, (0, extra)) for m in (self.mass, self.damping, self.stiffness))
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
        wide = {name: np.pad(getattr(self, name), ((0, extra), (0, 0))) for name in ("activation", "force")}
        rows = ("of_position", "of_rate", "of_acceleration")
        wide |= {name: np.pad(getattr(self, name), ((0, 0), (0, extra))) for name in rows}
        return replace(self, mass=mass, damping=damping, stiffness=stiffness, **wide)


def slopes(function: "Callable[[int, float], Array]", size: int, step: float) -> Array:
    """`(n, size)` slope of a vector by each of `size` perturbations, by five points."""
    columns = [sum(weight / step * function(i, place * step) for place, weight in STENCIL) for i in range(size)]
    return np.array(columns).T.astype(np.float64) if columns else np.zeros((0, 0))


def second_order(point: OperatingPoint, inputs: Sequence[Input], outputs: Sequence[Output]) -> SecondOrder:
    """The craft at an operating point, linear."""
    model, data = point.model, point.data()
    nv, na = model.nv, model.na
    mass, start = dense_mass(model, data), point.data()
    count = sum(len(output.labels) for output in outputs)

    def seen(i: int = -1, by: float = 0.0) -> Array:
        """Forces and outputs of the state in data, with `by` for the acceleration of one degree of freedom, else none."""
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_sensorPos(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_subtreeVel(model, data)
        mujoco.mj_sensorVel(model, data)
        mujoco.mj_fwdActuation(model, data)
        data.qacc[:] = 0.0
        if i >= 0:
            data.qacc[i] = by
        mujoco.mj_rnePostConstraint(model, data)
        mujoco.mj_sensorAcc(model, data)
        read = [output.read(data) for output in outputs]
        return np.concatenate([data.qfrc_passive + data.qfrc_actuator, data.qfrc_bias, data.act_dot, *read])

    def table(change: "Callable[[int, float], int | None]", size: int, step: float) -> Array:
        def value(i: int, by: float) -> Array:
            data.qpos[:], data.qvel[:] = point.qpos, point.qvel
            data.act[:], data.ctrl[:], data.xfrc_applied[:] = 0.0, 0.0, 0.0
            accelerated = change(i, by)
            return seen() if accelerated is None else seen(accelerated, by)

        return slopes(value, size, step).reshape(2 * nv + na + count, size)

    by_q = table(lambda i, by: mujoco.mj_integratePos(model, data.qpos, np.eye(nv)[i], by), nv, POSITION)
    by_v = table(lambda i, by: data.qvel.__setitem__(i, point.qvel[i] + by), nv, RATE)
    by_a = table(lambda i, by: data.act.__setitem__(i, by), na, RATE)
    by_u = table(lambda i, by: inputs[i].apply(data, by), len(inputs), RATE)
    by_acceleration = table(lambda i, _: i, nv, RATE)
    force = by_u[:nv] + np.column_stack([_applied(model, start, item) for item in inputs])
    stiffness, damping = -by_q[:nv], -by_v[:nv]
    rest, y = slice(2 * nv, 2 * nv + na), slice(2 * nv + na, None)
    return SecondOrder(
        mass, (damping + damping.T) / 2.0 + by_v[nv : 2 * nv], (stiffness + stiffness.T) / 2.0, by_a[:nv], force,
        by_a[rest], by_u[rest], by_q[y], by_v[y], by_acceleration[y], by_a[y], by_u[y],
    )  # fmt: skip


def _applied(model: "mujoco.MjModel", data: "mujoco.MjData", item: Input) -> Array:
    """`(nv,)` generalised force of a wrench; zero for an actuator, whose force MuJoCo gives."""
    out = np.zeros(model.nv)
    if item.wrench is not None:
        mujoco.mj_applyFT(model, data, item.wrench[:3], item.wrench[3:], data.xipos[item.body], item.body, out)
    return out


def step_slopes(point: OperatingPoint, linear: SecondOrder, inputs: Sequence[Input]) -> tuple[Array, Array]:
    """A and B of one step of the model's own integrator over (q, q', a), by differences of `mj_step`.

    `linear` is the same model in continuous time, which says how strong the inputs are.
    """
    model = point.model
    nv, na, h = model.nv, model.na, float(model.opt.timestep)
    data, balance = mujoco.MjData(model), np.array(point.data().qfrc_applied)
    fast = max(1.0, min(1.0 / h, 1.0 / MOVED))  # rates are moved by as much as moves positions alike

    def ends() -> Array:
        mujoco.mj_step(model, data)
        return np.array(data.qpos)

    def reset() -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = point.qpos, point.qvel, balance

    reset()
    nominal = ends()

    def after() -> Array:
        moved = np.zeros(nv)
        mujoco.mj_differentiatePos(model, moved, 1.0, nominal, ends())
        return np.concatenate([moved, data.qvel - point.qvel, data.act])

    def state(i: int, by: float) -> Array:
        reset()
        if i < nv:
            mujoco.mj_integratePos(model, data.qpos, np.eye(nv)[i], by)
        elif i < 2 * nv:
            data.qvel[i - nv] += by * fast
        else:
            data.act[i - 2 * nv] = by * fast
        return after() / (1.0 if i < nv else fast)

    def driven(i: int, by: float) -> Array:
        reset()
        inputs[i].apply(data, by * size[i])
        return after() / size[i]

    pushed = np.vstack([h * np.linalg.solve(linear.mass, linear.force), linear.feed * h])
    size = 1.0 / np.maximum(np.abs(pushed).max(axis=0), 1e-300)  # so that the rates change by no more than the step
    return slopes(state, 2 * nv + na, MOVED), slopes(driven, len(inputs), MOVED)
