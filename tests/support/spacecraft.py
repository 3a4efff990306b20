"""The fixtures' places and appendages, and small readers that share nothing with the package."""

from pathlib import Path

import mujoco
import numpy as np

from mechanics import by_differences, quiet

CRAFTS = Path(__file__).parents[1] / "crafts"
APPENDAGES = CRAFTS / "appendages"


def spec(name: str) -> Path:
    return APPENDAGES / f"{name}.toml"


#: style: file, what is embedded where
STYLES = {
    "free hub, two arrays and a boom": (
        "observer.xml",
        {"left": spec("array_left"), "right": spec("array_right"), "boom_mount": spec("boom")},
    ),
    "planar hub on slides and a hinge": ("planar.xml", {"mount": spec("rod")}),
    "nested bodies behind a solar-array drive": ("drive.xml", {"panel_mount": spec("array_left")}),
    "includes": ("included.xml", {"mount": spec("array_right")}),
    "attach": ("attached.xml", {"bracket": spec("boom")}),
}


def frequencies(model: mujoco.MjModel) -> np.ndarray:
    """Undamped frequencies [rad/s] from forces and MuJoCo's mass matrix: no A, no B,
    nothing of ours."""
    model = quiet(model)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    mass, _, stiffness = by_differences(model)
    squares = np.sort(
        np.linalg.eigvals(np.linalg.solve(mass, (stiffness + stiffness.T) / 2.0)).real
    )
    return np.sqrt(squares[squares > 1e-9 * squares.max()])


def response(model: mujoco.MjModel, seconds: float = 20.0, timestep: float = 2e-3) -> np.ndarray:
    """`(k, 7)` position and attitude of the root body of the first joint over free motion
    by RK4, hub kicked."""
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.opt.timestep = timestep
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data = mujoco.MjData(model)
    kick(data)
    body = int(model.jnt_bodyid[0])
    out = []
    for _ in range(round(seconds / timestep)):
        mujoco.mj_step(model, data)
        out.append(np.concatenate([data.xpos[body], data.xquat[body]]))
    return np.array(out)


def kick(data: mujoco.MjData) -> None:
    """Initial velocity of the hub: it shakes every mode."""
    data.qvel[:6] = [0.01, -0.02, 0.015, 0.02, 0.03, -0.01]
