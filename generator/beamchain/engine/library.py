"""The one place that imports MuJoCo, so that a broken installation is met with its cure."""

from collections.abc import Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from beamchain.errors import EngineError

if TYPE_CHECKING:
    from mujoco.rollout import Rollout

OLDEST = (3, 13)

try:
    import mujoco as mujoco
except ImportError as error:  # an upgrade 3.x -> 4 by plain pip leaves the split wheels half replaced
    raise EngineError(
        f"MuJoCo cannot be imported ({error}). If it was upgraded from 3.x to 4.x, repair it with: "
        "pip install --force-reinstall --no-deps mujoco mujoco-core mujoco-studio"
    ) from error

if tuple(int(part) for part in mujoco.__version__.split(".")[:2]) < OLDEST:
    raise EngineError(
        f"MuJoCo {mujoco.__version__} is too old; beamchain needs {OLDEST[0]}.{OLDEST[1]} or newer: "
        "pip install -U mujoco"
    )


def rollout_engine() -> "Rollout":
    """MuJoCo's rollouts on the calling thread; imported when asked for, a fit does not need them."""
    from mujoco.rollout import Rollout

    return Rollout(nthread=0)


@contextmanager
def quiet() -> Generator[None]:
    """Keeps MuJoCo's warnings, which are counted in the data, out of MUJOCO_LOG.TXT in the working folder."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(_silent)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def _silent(message: str) -> None:
    """MuJoCo's warning handler while warnings are expected."""
