"""The fixtures' places and appendages, and small readers that share nothing with the package."""

import copy
from pathlib import Path

import mujoco
import numpy as np

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
    model = copy.copy(model)  # its switches are changed
    data = mujoco.MjData(model)
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= int(
        mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    )

    def pull(step: np.ndarray) -> np.ndarray:
        mujoco.mj_resetData(model, data)
        mujoco.mj_integratePos(model, data.qpos, step, 1.0)
        mujoco.mj_forward(model, data)
        return data.qfrc_passive.copy()

    eye = 1e-4 * np.eye(model.nv)
    stiffness = np.array([(pull(-e) - pull(e)) / 2e-4 for e in eye])
    mujoco.mj_resetData(model, data)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    for i, e in enumerate(np.eye(model.nv)):
        column = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, column, e)
        mass[:, i] = column
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
