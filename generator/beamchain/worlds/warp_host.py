"""The host "warp": MuJoCo Warp, in float32, on the GPU where there is one."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np

from beamchain.errors import InputError
from beamchain.toolkit import Array, mujoco
from beamchain.worlds.hosts import LARGEST, Flags, Ids

wp: Any = import_module("warp")
mjw: Any = import_module("mujoco_warp")

# what a simulation without constraints continues from
STATE = ("qpos", "qvel", "act", "time", "qacc_warmstart")


def bytes_of(model: "mujoco.MjModel") -> float:
    """What Warp keeps of one world [bytes]."""
    data = mjw.make_data(model, nworld=2)
    held = [value for value in vars(data).values() if isinstance(value, wp.array)]
    return sum(value.capacity / 2.0 for value in held if value.shape and value.shape[0] == 2)


class Host:
    """Worlds on Warp's device."""

    def __init__(self, model: "mujoco.MjModel", count: int, stage: int) -> None:
        self._stage, self._count = stage, count
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        try:
            self._model, self._data = mjw.put_model(model), mjw.put_data(model, data, nworld=count)
        except NotImplementedError as error:
            raise InputError(
                f"MuJoCo Warp does not run this model: {error}; use host='mujoco'."
            ) from None

    @property
    def qpos(self) -> Array:
        return self._data.qpos.numpy().astype(np.float64)

    @property
    def qvel(self) -> Array:
        return self._data.qvel.numpy().astype(np.float64)

    @property
    def sensors(self) -> Array:
        if self._stage:
            mjw.forward(self._model, self._data)
        return self._data.sensordata.numpy().astype(np.float64)

    def write_fields(self, fields: Mapping[str, Array], ids: Ids) -> None:
        for name, values in fields.items():
            now = getattr(self._model, name, None)
            if now is None:
                continue
            shared = now.numpy()
            if now.shape[0] in (1, self._count) and shared.ndim == values.ndim:
                rows = np.array(np.broadcast_to(shared, (self._count, *shared.shape[1:])))
                rows[ids] = values
                setattr(self._model, name, wp.array(rows, dtype=now.dtype))
            elif np.any(values != values[:1]):
                raise InputError(
                    f"MuJoCo Warp holds {name} once for all worlds; use host='mujoco' or 'mjx' to "
                    "vary it."
                )

    def step(self, first: Array, then: Array, count: int) -> Flags:
        for k in range(count):
            if k < 2:
                self._data.ctrl.assign((then if k else first).astype(np.float32))
            mjw.step(self._model, self._data)
        return np.asarray(~(np.abs(np.hstack([self.qpos, self.qvel])).max(axis=1) < LARGEST))

    def reset(self, ids: Ids, qpos: Array, qvel: Array) -> None:
        which = np.zeros(self._count, dtype=np.bool_)
        which[ids] = True
        mjw.reset_data(self._model, self._data, wp.array(which, dtype=bool))
        for name, values in (("qpos", qpos), ("qvel", qvel)):
            now = getattr(self._data, name)
            rows = now.numpy()
            rows[ids] = values
            now.assign(rows)

    def state(self) -> Any:
        return {name: getattr(self._data, name).numpy().copy() for name in STATE}

    def restore(self, state: Any) -> None:
        for name, values in state.items():
            getattr(self._data, name).assign(values)
