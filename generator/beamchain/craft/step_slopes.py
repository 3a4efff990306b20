"""What one step of MuJoCo makes of a craft's states and inputs, by differences of `mj_step`."""

from collections.abc import Sequence

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.engine.linear import Linear, slopes
from beamchain.engine.operating_point import OperatingPoint
from beamchain.engine.signals import Input
from beamchain.ports.motions import Array

# perturbation of positions over a step: chains of hinges are far less linear than what is read
# off them
MOVED = 2e-4


def step_slopes(
    point: OperatingPoint, linear: Linear, inputs: Sequence[Input]
) -> tuple[Array, Array]:
    """A and B of one step of the model's own integrator over (q, q', a),
    by differences of `mj_step`.

    `linear` is the same model in continuous time, which says how strong the inputs are.
    """
    model = point.model
    nv = model.nv
    na = model.na
    h = float(model.opt.timestep)
    data = mujoco.MjData(model)
    balance = np.array(point.data().qfrc_applied)
    # rates are moved by as much as moves positions alike
    fast = max(1.0, min(1.0 / h, 1.0 / MOVED))

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

    accelerations = np.linalg.solve(linear.mass, linear.inputs.force)
    pushed = h * np.vstack([accelerations, linear.activations.feed])
    # so that the rates change by no more than the step
    size = 1.0 / np.maximum(np.abs(pushed).max(axis=0), 1e-300)
    return slopes(state, 2 * nv + na, MOVED), slopes(driven, len(inputs), MOVED)
