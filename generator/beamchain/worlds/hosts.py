"""What steps the worlds: MuJoCo's own batch; MJX and Warp are modules of their own.

All have the methods of `Batch`, and `qpos` `(k, nq)`, `qvel` `(k, nv)`, `sensors` `(k,
nsensordata)` as they are now.
"""

import os
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beamchain.errors import InputError
from beamchain.toolkit import Array, mujoco, quiet

HOSTS = ("mujoco", "mjx", "warp")
NEEDS = {"mjx": "mujoco.mjx", "warp": "mujoco_warp"}
BAD = [int(getattr(mujoco.mjtWarning, f"mjWARN_BAD{name}")) for name in ("QPOS", "QVEL", "QACC")]
WHOLE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
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


def host_of(name: str, model: "mujoco.MjModel", count: int, threads: int, stage: int) -> "Batch":
    """The host of that name."""
    if name in NEEDS:
        return _module(name).Host(model, count, stage)
    return Batch(model, count, threads, stage)


def bytes_of(name: str, model: "mujoco.MjModel") -> float:
    """What a host keeps of one world [bytes]."""
    if name in NEEDS:
        return float(_module(name).bytes_of(model))
    return 8.0 * (mujoco.mj_stateSize(model, WHOLE) + model.nsensordata)


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
    return import_module(f"beamchain.worlds.{name}_host")


class Batch:
    """`mujoco.batch`, 3.17 and later: bit for bit what a loop over one MjData per world gives."""

    def __init__(self, model: "mujoco.MjModel", count: int, threads: int, stage: int) -> None:
        try:
            module: Any = import_module("mujoco.batch")
        except ImportError:
            raise InputError(
                f"worlds need MuJoCo 3.17 or later, and this is {mujoco.__version__}; install it "
                "with: pip install -U mujoco."
            ) from None
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
