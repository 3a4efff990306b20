"""A run of a spacecraft as recovery takes it: recorded, one state, or arrays by name."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from beamchain.checks import finite_array, of_type, unknown
from beamchain.engine.library import mujoco
from beamchain.engine.root_motion import STATE, Run
from beamchain.errors import InputError
from beamchain.ports.motions import Array


class Recorder:
    """Complete states of a run, one per call; `Embedded.recover` takes it in place of data.

    Example:
        >>> import beamchain as bc, mujoco
        >>> craft = '''<mujoco><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> flexible = bc.embed(craft, {"mount": spec})
        >>> data = mujoco.MjData(flexible.model)
        >>> data.qfrc_applied[5] = 1.0  # torque about z
        >>> record = flexible.recorder()
        >>> for _ in range(100):
        ...     record(data)
        ...     mujoco.mj_step(flexible.model, data)
        >>> len(record)
        100
    """

    def __init__(self, model: "mujoco.MjModel") -> None:
        self._model = model
        self._size = int(mujoco.mj_stateSize(model, STATE))
        self._time: list[float] = []
        self._states: list[Array] = []

    def __call__(self, data: "mujoco.MjData") -> None:
        """Record the state as it is, with the inputs that act in it.

        Call it where `ctrl` and applied forces are those of `data.time`: before the step.

        Raises:
            InputError: it is no MjData, or that of another model.
        """
        state = _state(self._model, data, self._size)
        self._time.append(float(data.time))
        self._states.append(state)

    def __len__(self) -> int:
        return len(self._time)

    def clear(self) -> None:
        """Forget what was recorded."""
        self._time.clear()
        self._states.clear()

    def run(self) -> Run:
        """What was recorded."""
        if not self._states:
            raise InputError(
                "the recorder has recorded nothing; call it with the data in every step: "
                "record(data)."
            )
        return Run(np.array(self._time), np.array(self._states), {})


def _state(model: "mujoco.MjModel", data: object, size: int) -> Array:
    of_type("data", data, mujoco.MjData, "the mujoco.MjData of the model with the appendages")
    assert isinstance(data, mujoco.MjData)
    if (data.qpos.size, data.qvel.size, data.ctrl.size) != (model.nq, model.nv, model.nu):
        raise InputError(
            f"data has {data.qpos.size} positions and {data.qvel.size} rates, the model with the "
            f"appendages {model.nq} and {model.nv}; give the data of embedded.model: "
            "mujoco.MjData(embedded.model)."
        )
    state = np.zeros(size)
    mujoco.mj_getState(model, data, state, STATE)
    return state


def run_of(model: "mujoco.MjModel", data: object) -> Run:
    """Instants from what a user gives: MjData, a `Recorder`, or arrays by name."""
    if isinstance(data, Recorder):
        return data.run()
    if isinstance(data, Mapping):
        return _run_of_arrays(model, data)
    state = _state(model, data, int(mujoco.mj_stateSize(model, STATE)))
    assert isinstance(data, mujoco.MjData)
    return Run(np.array([data.time]), state[None], {})


def _run_of_arrays(model: "mujoco.MjModel", given: "Mapping[Any, Any]") -> Run:
    shapes: dict[str, tuple[int, ...]] = {
        "qpos": (model.nq,),
        "qvel": (model.nv,),
        "qacc": (model.nv,),
        "ctrl": (model.nu,),
        "act": (model.na,),
        "qfrc_applied": (model.nv,),
        "xfrc_applied": (model.nbody, 6),
        "mocap_pos": (model.nmocap, 3),
        "mocap_quat": (model.nmocap, 4),
    }
    for name in given:
        if name not in (*shapes, "time"):
            raise unknown("an array of data", name, [*shapes, "time"])
    if "qpos" not in given:
        raise InputError(
            "data holds no qpos; give arrays by name: qpos (t, nq), qvel (t, nv), and qacc (t, nv) "
            "or ctrl (t, nu)."
        )
    arrays: dict[str, Array] = {}
    count = len(finite_array("qpos", given["qpos"], (None, model.nq)))
    for name, shape in shapes.items():
        if name in given:
            arrays[name] = finite_array(name, given[name], (count, *shape))
    if count == 0:
        raise InputError("data holds no instant; give at least one row of qpos.")
    time = given.get("time", float(model.opt.timestep) * np.arange(count))
    return Run(finite_array("time", time, (count,), unit="s"), None, arrays)
