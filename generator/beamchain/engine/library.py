"""The one place that imports MuJoCo, so that a broken installation is met with its cure."""

import ctypes
import logging
import os
import platform
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cython_blas

from beamchain.errors import EngineError
from beamchain.import_lock import importing

if TYPE_CHECKING:
    from mujoco.rollout import Rollout

OLDEST = (3, 16)

try:
    import mujoco as mujoco
except (
    ImportError,
    RuntimeError,
    AttributeError,
) as error:  # an upgrade 3.x -> 4 by plain pip leaves the split wheels half replaced
    if "MUJOCO_GL" in os.environ:
        raise EngineError(
            f"MuJoCo cannot be imported with MUJOCO_GL = {os.environ['MUJOCO_GL']!r} ({error}); "
            "set it to egl, osmesa or glfw, whichever this machine has, or unset it."
        ) from error
    raise EngineError(
        f"MuJoCo cannot be imported ({error}). If it was upgraded from 3.x to 4.x, repair it with: "
        "pip install --force-reinstall --no-deps mujoco mujoco-core mujoco-studio"
    ) from error

if tuple(int(part) for part in mujoco.__version__.split(".")[:2]) < OLDEST:
    raise EngineError(
        f"MuJoCo {mujoco.__version__} is too old; beamchain needs {OLDEST[0]}.{OLDEST[1]} or "
        "newer: pip install -U mujoco"
    )

#: where MuJoCo's warnings go, in place of MUJOCO_LOG.TXT in the working folder and standard output
LOG = logging.getLogger("beamchain.mujoco")

if mujoco.get_mju_user_warning() is None:  # else the user's program has its own
    mujoco.set_mju_user_warning(LOG.warning)


def rollout_engine() -> "Rollout":
    """MuJoCo's rollouts on the calling thread, imported when asked for."""
    with importing:
        from mujoco.rollout import Rollout

    return Rollout(nthread=0)


def rest(model: "mujoco.MjModel", qpos: NDArray[np.float64] | None = None) -> "mujoco.MjData":
    """Data at the rest pose, or another, kinematics and Jacobians ready."""
    data = mujoco.MjData(model)
    if qpos is not None:
        data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


def rotation_matrix(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """`(3, 3)` of a quaternion `(4,)`, scalar first, of any length."""
    out = np.zeros(9)
    mujoco.mju_quat2Mat(out, quaternion / np.linalg.norm(quaternion))
    return out.reshape(3, 3)


def hangs_on(model: "mujoco.MjModel", body: int, top: int) -> bool:
    """Whether a body is `top` or is carried by it."""
    while body not in (0, top):
        body = int(model.body_parentid[body])
    return body == top


class _WhileAny:
    """A setting of the whole process: made by the first thread that enters,
    undone by the last that leaves.

    `make` makes it and returns what undoes it.
    """

    def __init__(self, make: Callable[[], Callable[[], object]]) -> None:
        self._make = make
        self._undo: Callable[[], object] | None = None
        self._inside = 0
        self._lock = Lock()

    @contextmanager
    def __call__(self) -> Generator[None]:
        with self._lock:
            if self._inside == 0:
                self._undo = self._make()
            self._inside += 1
        try:
            yield
        finally:
            with self._lock:
                self._inside -= 1
                if self._inside == 0 and self._undo is not None:
                    self._undo()


def _silence() -> Callable[[], object]:
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(_silent)
    return partial(mujoco.set_mju_user_warning, before)


def _silent(message: str) -> None:
    """MuJoCo's warning handler while warnings are expected."""


#: `with quiet():` within it MuJoCo's warnings, which are expected, go nowhere.
quiet = _WhileAny(_silence)


def machine() -> dict[str, Any]:
    """Where it was measured."""
    return {
        "system": platform.platform(terse=True),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "mujoco": mujoco.__version__,
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next(
        (line.partition(":")[2].strip() for line in lines if line.startswith("model name")),
        platform.machine(),
    )


STEMS = (
    "scipy_openblas_{}_num_threads64_",
    "scipy_openblas_{}_num_threads",
    "openblas_{}_num_threads64_",
    "openblas_{}_num_threads",
)


def _one_blas_thread() -> Callable[[], object]:
    before = [(put, int(get())) for get, put in _switches()]
    for put, _ in before:
        put(1)

    def undo() -> None:
        for put, count in before:
            put(count)

    return undo


#: `with one_thread():` or `@one_thread()`: within it OpenBLAS, NumPy's and SciPy's, works on one
#: thread. The package's matrices are small, so that more threads only wait for each other. Every
#: public function and result that computes with MuJoCo or with matrices of a craft has it;
#: docs/craft.md lists them.
one_thread = _WhileAny(_one_blas_thread)


@cache
def _switches() -> tuple[tuple[Callable[[], int], Callable[[int], object]], ...]:
    """Per OpenBLAS that is loaded: what reads its number of threads, and what sets it."""
    out: list[tuple[Callable[[], int], Callable[[int], object]]] = []
    for module in (getattr(np.linalg, "_umath_linalg", None), cython_blas):
        try:
            # a symbol is looked for in what the module itself loads
            library = ctypes.CDLL(str(getattr(module, "__file__", "none")))
        except (AttributeError, OSError):
            continue
        for stem in STEMS:
            get, put = (getattr(library, stem.format(verb), None) for verb in ("get", "set"))
            if get is not None and put is not None:
                out.append((partial(get), partial(put)))
                break
    return tuple(out)
