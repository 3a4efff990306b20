"""What steps the worlds: MuJoCo's own batch, or its rollouts before 3.17; MJX and Warp are modules of their own."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from beamchain.craft.worlds.fields import with_fields
from beamchain.engine.library import mujoco, quiet
from beamchain.errors import InputError
from beamchain.ports.motions import Array

HOSTS = ("mujoco", "mjx", "warp")
NEEDS = {"mjx": "mujoco.mjx", "warp": "mujoco_warp"}
BAD = [
    int(w)
    for w in (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
]
WHOLE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
FEW = 32  # worlds for which waking other threads costs more than they save
LARGEST = 1e10  # mjMAXVAL

Ids = NDArray[np.intp]
Flags = NDArray[np.bool_]


class Host(Protocol):
    """Worlds that are stepped together; `qpos` `(k, nq)`, `qvel` `(k, nv)`, `sensors` `(k, nsensordata)` are those of now."""

    @property
    def qpos(self) -> Array: ...  # noqa: D102
    @property
    def qvel(self) -> Array: ...  # noqa: D102
    @property
    def sensors(self) -> Array: ...  # noqa: D102

    def put(self, fields: Mapping[str, Array], ids: Ids | None) -> None:
        """Fields `(n, ...)` of the model of some worlds or all."""
        ...

    def step(self, first: Array, then: Array, count: int) -> Flags:
        """`count` steps with the input `first` `(k, nu)` and after one step `then`; which worlds diverged `(k,)`."""
        ...

    def reset(self, ids: Ids, qpos: Array, qvel: Array) -> None:
        """Some worlds back to t = 0 with positions `(n, nq)` and rates `(n, nv)`."""
        ...

    def state(self) -> Any:
        """All that a simulation continues from."""
        ...

    def restore(self, state: Any) -> None:
        """Back to what `state` gave."""
        ...


def host_of(name: str, model: "mujoco.MjModel", count: int, threads: int, stage: int) -> Host:
    """The host of that name.

    Raises:
        InputError: there is none of that name, or it is not installed.
    """
    if name in NEEDS:
        return _module(name).make(model, count, stage)
    return Batch(model, count, threads, stage) if has_batch() else Rollouts(model, count, threads)


def bytes_of(name: str, model: "mujoco.MjModel") -> float:
    """What a host keeps of one world [bytes]."""
    if name in NEEDS:
        return float(_module(name).bytes_of(model))
    size = 8.0 * (mujoco.mj_stateSize(model, WHOLE) + model.nsensordata)
    return size if has_batch() else size + 2.0 * model.nbuffer


def _module(name: str) -> Any:
    try:
        import_module(NEEDS[name])
    except ImportError as error:
        raise InputError(
            f"host = {name!r} is not installed ({error}); install it with: pip install 'beamchain[{name}]'."
        ) from None
    return import_module(f"beamchain.craft.worlds.{name}_host")


def has_batch() -> bool:
    """Whether this MuJoCo has `mujoco.batch`."""
    try:
        import_module("mujoco.batch")
    except ImportError:
        return False
    return True


class Batch:
    """`mujoco.batch`, 3.17 and later: bit for bit what a loop over one MjData per world gives."""

    qpos: Any
    qvel: Any
    sensors: Any

    def __init__(self, model: "mujoco.MjModel", count: int, threads: int, stage: int) -> None:
        module: Any = import_module("mujoco.batch")
        threads = threads or (0 if count > FEW else 1)
        self._batch, self._error, self._stage = module.Batch(model, count, threads), module.SimulationError, stage
        self.qpos, self.qvel = self._batch.bind("qpos"), self._batch.bind("qvel")
        self.sensors = self._batch.bind("sensordata") if stage else np.zeros((count, 0))
        self._ctrl = self._batch.bind("ctrl")

    def put(self, fields: Mapping[str, Array], ids: Ids | None) -> None:
        """As `Host.put`."""
        for name, values in fields.items():
            self._batch.expand(name)[slice(None) if ids is None else ids] = values

    def step(self, first: Array, then: Array, count: int) -> Flags:
        """As `Host.step`."""
        raised: list[int] = []
        with quiet():
            for ctrl, steps in [(then, count)] if first is then else [(first, 1), (then, count - 1)]:
                if steps:
                    self._ctrl[:] = ctrl
                    try:
                        self._batch.step(nstep=steps, stage=self._stage)
                    except self._error as error:
                        raised += list(error.ids)
        bad = np.any(self._batch.warning[:, BAD, 1] > 0, axis=1) | ~np.isfinite(self.qvel.sum(axis=1))
        bad[raised] = True
        return bad

    def reset(self, ids: Ids, qpos: Array, qvel: Array) -> None:
        """As `Host.reset`."""
        self._batch.reset(ids.astype(np.int32), stage=0)
        self._batch.warning[ids] = 0
        self.qpos[ids], self.qvel[ids] = qpos, qvel
        if self._stage:
            self._batch.forward(ids.astype(np.int32), stage=self._stage)

    def state(self) -> Array:
        """As `Host.state`."""
        return self._batch.state.copy()

    def restore(self, state: Array) -> None:
        """As `Host.restore`."""
        self._batch.state[:] = state
        if self._stage:
            self._batch.forward(stage=self._stage)


class Rollouts:
    """`mujoco.rollout`, for MuJoCo before 3.17: one model per world, the same numbers."""

    qpos: Array
    qvel: Array
    sensors: Array

    def __init__(self, model: "mujoco.MjModel", count: int, threads: int) -> None:
        module: Any = import_module("mujoco.rollout")
        model = with_fields(model, {})  # a world that diverges keeps its numbers, by which it is known
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self._models: list[Any] = [with_fields(model, {}) for _ in range(count)]
        self._data = [mujoco.MjData(model) for _ in range(max(threads, 1))]
        self._engine = module.Rollout(nthread=threads if threads > 1 else 0)
        self._control = int(mujoco.mjtState.mjSTATE_CTRL)
        full = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)
        self._state = np.zeros((count, mujoco.mj_stateSize(model, full)))
        mujoco.mj_getState(model, self._data[0], self._state[0], full)
        self._state[:] = self._start = self._state[0].copy()
        self.qpos = self._state[:, 1 : 1 + model.nq]
        self.qvel = self._state[:, 1 + model.nq : 1 + model.nq + model.nv]
        self.sensors = np.zeros((count, model.nsensordata))

    def put(self, fields: Mapping[str, Array], ids: Ids | None) -> None:
        """As `Host.put`."""
        for row, i in enumerate(range(len(self._models)) if ids is None else ids):
            for name, values in fields.items():
                part, _, inner = name.partition(".")
                if inner:
                    setattr(getattr(self._models[i], part), inner, values[row])
                else:
                    getattr(self._models[i], name)[:] = values[row]

    def step(self, first: Array, then: Array, count: int) -> Flags:
        """As `Host.step`."""
        control = np.repeat(then[:, None], count, axis=1)
        control[:, 0] = first
        with quiet():
            state, sensors = self._engine.rollout(
                self._models, self._data, self._state, control, control_spec=self._control, nstep=count
            )
        self._state[:] = state[:, -1]
        self.sensors[:] = sensors[:, -1]
        return np.asarray(~(np.abs(self._state).max(axis=1) < LARGEST))

    def reset(self, ids: Ids, qpos: Array, qvel: Array) -> None:
        """As `Host.reset`."""
        self._state[ids] = self._start
        self.qpos[ids], self.qvel[ids] = qpos, qvel

    def state(self) -> Array:
        """As `Host.state`."""
        return self._state.copy()

    def restore(self, state: Array) -> None:
        """As `Host.restore`."""
        self._state[:] = state
