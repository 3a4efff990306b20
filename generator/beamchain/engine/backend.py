"""Which OpenGL MuJoCo draws with: chosen before MuJoCo is imported, since it looks only once."""

import os
import subprocess
import sys

from beamchain.errors import EngineError

OFF_SCREEN = ("egl", "osmesa")
PATIENCE = 60  # seconds for a driver to answer
_TRY = (
    "import mujoco; m = mujoco.MjModel.from_xml_string('<mujoco><worldbody><geom "
    'size=".1"/></worldbody></mujoco>\'); d = mujoco.MjData(m); r = mujoco.Renderer(m, 16, 16); '
    "r.update_scene(d); r.render(); r.close()"
)


def choose_renderer() -> str:
    """Set MUJOCO_GL, where the user has not, to a renderer that needs no screen."""
    given = os.environ.get("MUJOCO_GL", "").strip().lower()
    if "mujoco" in sys.modules:  # it has looked already
        return given
    for name in (given,) if given else OFF_SCREEN:
        if _works(name):
            os.environ["MUJOCO_GL"] = name
            return name
    said = (
        f"MUJOCO_GL = {given!r} does not draw here"
        if given
        else "neither EGL nor OSMesa draws here"
    )
    raise EngineError(
        f"{said}; install one (Debian, Ubuntu: apt-get install libegl1 libgl1-mesa-dri, or "
        "libosmesa6) or set MUJOCO_GL to egl, osmesa or glfw, whichever this machine has."
    )


def _works(name: str) -> bool:
    """Draw one picture in a process of its own: a missing driver may end the process that asks."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", _TRY],
            env={**os.environ, "MUJOCO_GL": name},
            capture_output=True,
            timeout=PATIENCE,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0
