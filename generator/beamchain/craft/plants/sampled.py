"""The plant that MuJoCo really runs at a step: exact in time, with the input half of this and half of the last value.

Theory: docs/theory.md, section 5.
"""

import copy

import numpy as np

from beamchain.caution import Caution
from beamchain.craft.plants.operating_point import OperatingPoint
from beamchain.craft.plants.second_order import SecondOrder, slopes
from beamchain.craft.plants.signals import Input
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS
from beamchain.ports.motions import Array
from beamchain.steps.integrators import SCHEMES
from beamchain.steps.modal import modal_tendons
from beamchain.steps.retime import retime

MOVED = 2e-4  # perturbation of positions: chains of hinges are far less linear than what is read off them


def at_step(model: "mujoco.MjModel", timestep: float, qpos: Array) -> "tuple[mujoco.MjModel, list[str]]":
    """A copy of a model for a step [s], its appendages exact in time where they can be, and sentences on where not.

    The craft's coupling is looked at in the pose `qpos`.
    """
    out, said = copy.copy(model), list[str]()
    out.opt.timestep = timestep
    name, modal = NUMBERS[int(model.opt.integrator)], modal_tendons(model)
    if modal.names and SCHEMES[name].exact:
        made = {None if mark is None else (mark.timestep, mark.integrator) for mark in modal.made_for}
        right = made == {(timestep, name)}
        said += retime(copy.copy(out) if right else out, timestep, name, form=4, qpos=qpos).slowed
    else:
        why = f"{name} cannot be made exact in time" if modal.names else "its flexible parts have no modal tendons"
        said.append(Caution("not-exact-in-time", f"the discrete plant has the step's own error: {why}."))
    return out, said


def step_slopes(point: OperatingPoint, linear: SecondOrder, inputs: "list[Input]") -> tuple[Array, Array]:
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


def held_input(system: tuple[Array, Array, Array, Array]) -> tuple[Array, Array, Array, Array]:
    """The same system fed with half of this and half of the previous input, which becomes a state."""
    a, b, c, d = system
    n, m = b.shape
    both = np.block([[a, b / 2.0], [np.zeros((m, n + m))]])
    return both, np.vstack([b / 2.0, np.eye(m)]), np.hstack([c, d / 2.0]), d / 2.0
