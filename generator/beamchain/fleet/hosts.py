"""What steps the worlds: MuJoCo's own batch, or its rollouts before 3.17;
MJX and Warp are modules of their own.

All have the methods of `Batch`, and `qpos` `(k, nq)`, `qvel` `(k, nv)`, `sensors` `(k,
nsensordata)` as they are now.
"""

import os
from collections.abc import Iterable, Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamchain.engine.library import mujoco, quiet
from beamchain.errors import InputError
from beamchain.fleet.fields import with_fields
from beamchain.ports.motions import Array

HOSTS = ("mujoco", "mjx", "warp")
NEEDS = {"mjx": "mujoco.mjx", "warp": "mujoco_warp"}
BAD = [int(getattr(mujoco.mjtWarning, f"mjWARN_BAD{name}")) for name in ("QPOS", "QVEL", "QACC")]
WHOLE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
FULL = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)
FEW = 32  # worlds for which waking other threads costs more than they save
LARGEST = 1e10  # mjMAXVAL
CGROUP = Path("/sys/fs/cgroup")  # of a container
# its limit, what it uses, and the part of that which the system takes back when it is needed
LIMITS = (
    ("memory.max", "memory.current", "memory.stat", "inactive_file"),
    (
        "memory/memory.limit_in_bytes",
        "memory/memory.usage_in_bytes",
        "memory/memory.stat",
        "total_inactive_file",
    ),
)

Ids = NDArray[np.intp]
Flags = NDArray[np.bool_]


def host_of(
    name: str, model: "mujoco.MjModel", count: int, threads: int, stage: int
) -> "Batch | Rollouts":
    """The host of that name."""
    if name in NEEDS:
        return _module(name).Host(model, count, stage)
    return (Batch if has_batch() else Rollouts)(model, count, threads, stage)


def bytes_of(name: str, model: "mujoco.MjModel") -> float:
    """What a host keeps of one world [bytes]."""
    if name in NEEDS:
        return float(_module(name).bytes_of(model))
    size = 8.0 * (mujoco.mj_stateSize(model, WHOLE) + model.nsensordata)
    return size if has_batch() else size + 2.0 * model.nbuffer


def available() -> float:
    """Memory that is free for new arrays [bytes]; infinity where the system does not say."""
    out = float("inf")
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        out = 1024.0 * next(
            int(line.split()[1]) for line in lines if line.startswith("MemAvailable")
        )
    except (OSError, StopIteration, ValueError):
        if hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
            out = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    for limit, usage, stat, idle in LIMITS:
        try:
            most, used = (
                float((CGROUP / name).read_text(encoding="ascii")) for name in (limit, usage)
            )
            lines = (CGROUP / stat).read_text(encoding="ascii").splitlines()
            back = next(float(line.split()[1]) for line in lines if line.startswith(f"{idle} "))
        except (OSError, StopIteration, ValueError):  # no limit is written as "max"
            continue
        out = min(out, max(most - used + back, 0.0))
    return out


def check_memory(count: int, each: float, free: float) -> None:
    """Refuse `count` worlds of `each` bytes where only `free` bytes are left."""
    if count * each > free:
        needed, single, left = (_size_in_words(size) for size in (count * each, each, free))
        raise InputError(
            f"{count} worlds need {needed} ({single} each), and {left} are free; at most "
            f"{int(free / each)} fit: give count a smaller value."
        )


def _size_in_words(size: float) -> str:
    for unit in ("B", "kB", "MB"):
        if size < 1000.0:
            return f"{size:.3g} {unit}"
        size /= 1000.0
    return f"{size:.4g} GB"


def _module(name: str) -> Any:
    try:
        import_module(NEEDS[name])
    except ImportError as error:
        raise InputError(
            f"host = {name!r} is not installed ({error}); install it with: pip install "
            f"'beamchain[{name}]'."
        ) from None
    return import_module(f"beamchain.fleet.{name}_host")


def has_batch() -> bool:
    """Whether this MuJoCo has `mujoco.batch`."""
    return find_spec("mujoco.batch") is not None


class Batch:
    """`mujoco.batch`, 3.17 and later: bit for bit what a loop over one MjData per world gives."""

    def __init__(self, model: "mujoco.MjModel", count: int, threads: int, stage: int) -> None:
        module: Any = import_module("mujoco.batch")
        threads = threads or (0 if count > FEW else 1)
        self._batch = module.Batch(model, count, threads)
        self._error = module.SimulationError
        self._stage = stage
        self.qpos: Any = self._batch.bind("qpos")
        self.qvel: Any = self._batch.bind("qvel")
        self._ctrl = self._batch.bind("ctrl")
        self.sensors: Any = self._batch.bind("sensordata") if stage else np.zeros((count, 0))

    def write_fields(self, fields: Mapping[str, Array], ids: Ids) -> None:
        """Fields `(n, ...)` of the model of some worlds."""
        for name, values in fields.items():
            self._batch.expand(name)[ids] = values

    def step(self, first: Array, then: Array, count: int) -> Flags:
        """`count` steps with the input `first` `(k, nu)` and after one step `then`;
        which worlds diverged `(k,)`."""
        failed: list[int] = []
        runs = [(then, count)] if first is then else [(first, 1), (then, count - 1)]
        with quiet():
            for ctrl, steps in runs:
                if steps:
                    self._ctrl[:] = ctrl
                    try:
                        self._batch.step(nstep=steps, stage=self._stage)
                    except self._error as error:
                        failed += list(error.ids)
        warned = np.any(self._batch.warning[:, BAD, 1] > 0, axis=1)
        bad = warned | ~np.isfinite(self.qvel.sum(axis=1))
        bad[failed] = True
        return bad

    def reset(self, ids: Ids, qpos: Array, qvel: Array) -> None:
        """Some worlds back to t = 0 with positions `(n, nq)` and rates `(n, nv)`,
        or the same for all of them."""
        self._batch.reset(ids.astype(np.int32), stage=0)
        self._batch.warning[ids] = 0
        self.qpos[ids], self.qvel[ids] = qpos, qvel
        if self._stage:
            self._batch.forward(ids.astype(np.int32), stage=self._stage)

    def load(self, world: int, model: "mujoco.MjModel", data: "mujoco.MjData") -> None:
        """The state of one world into a data."""
        mujoco.mj_setState(model, data, self._batch.state[world], WHOLE)

    def store(self, world: int, model: "mujoco.MjModel", data: "mujoco.MjData") -> None:
        """The state of one world from a data."""
        state = np.zeros(mujoco.mj_stateSize(model, WHOLE))
        mujoco.mj_getState(model, data, state, WHOLE)
        self._batch.state[world] = state
        if self._stage:
            self._batch.forward(np.array([world], dtype=np.int32), stage=self._stage)

    def state(self) -> Any:
        """All that a simulation continues from."""
        return self._batch.state.copy()

    def restore(self, state: Any) -> None:
        """Back to what `state` gave."""
        self._batch.state[:] = state
        if self._stage:
            self._batch.forward(stage=self._stage)


class Rollouts:
    """`mujoco.rollout`, for MuJoCo before 3.17: one model per world, the same numbers. Sensors,
    which a step of it leaves as before the step, are read anew."""

    def __init__(self, model: "mujoco.MjModel", count: int, threads: int, stage: int) -> None:
        module: Any = import_module("mujoco.rollout")
        # a world that diverges keeps its numbers, by which it is known
        model = with_fields(model, {})
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self._models: list[Any] = [with_fields(model, {}) for _ in range(count)]
        self._data = [mujoco.MjData(model) for _ in range(max(threads, 1))]
        self._engine = module.Rollout(nthread=threads if threads > 1 else 0)
        self._state = np.zeros((count, mujoco.mj_stateSize(model, FULL)))
        mujoco.mj_getState(model, self._data[0], self._state[0], FULL)
        self._state[:] = self._start = self._state[0].copy()
        self.qpos: Array = self._state[:, 1 : 1 + model.nq]
        self.qvel: Array = self._state[:, 1 + model.nq : 1 + model.nq + model.nv]
        self._ctrl = np.zeros((count, model.nu))
        self.sensors: Array = np.zeros((count, model.nsensordata if stage else 0))
        self._read_sensors(range(count))

    def _read_sensors(self, ids: Iterable[int]) -> None:
        """The sensors of worlds in the state in which they are."""
        if not self.sensors.size:
            return
        data = self._data[0]
        with quiet():
            for i in ids:
                model = self._models[i]
                mujoco.mj_resetData(model, data)
                mujoco.mj_setState(model, data, self._state[i], FULL)
                data.ctrl[:] = self._ctrl[i]
                mujoco.mj_forward(model, data)
                self.sensors[i] = data.sensordata

    def write_fields(self, fields: Mapping[str, Array], ids: Ids) -> None:
        for row, i in enumerate(ids):
            for name, values in fields.items():
                getattr(self._models[i], name)[:] = values[row]

    def step(self, first: Array, then: Array, count: int) -> Flags:
        control = np.repeat(then[:, None], count, axis=1)
        control[:, 0] = first
        with quiet():
            state, _ = self._engine.rollout(
                self._models,
                self._data,
                self._state,
                control,
                nstep=count,
                control_spec=int(mujoco.mjtState.mjSTATE_CTRL),
            )
        self._state[:], self._ctrl[:] = state[:, -1], then
        self._read_sensors(range(len(state)))
        return np.asarray(~(np.abs(self._state).max(axis=1) < LARGEST))

    def reset(self, ids: Ids, qpos: Array, qvel: Array) -> None:
        self._state[ids], self._ctrl[ids] = self._start, 0.0
        self.qpos[ids], self.qvel[ids] = qpos, qvel
        self._read_sensors(ids)

    def load(self, world: int, model: "mujoco.MjModel", data: "mujoco.MjData") -> None:
        mujoco.mj_setState(model, data, self._state[world], FULL)

    def store(self, world: int, model: "mujoco.MjModel", data: "mujoco.MjData") -> None:
        state = np.zeros(self._state.shape[1])
        mujoco.mj_getState(model, data, state, FULL)
        self._state[world] = state
        self._read_sensors([world])

    def state(self) -> Any:
        return np.hstack([self._state, self._ctrl])

    def restore(self, state: Any) -> None:
        self._state[:], self._ctrl[:] = np.split(state, [self._state.shape[1]], axis=1)
        self._read_sensors(range(len(state)))
