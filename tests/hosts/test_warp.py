"""MuJoCo Warp with a file that embed wrote: how far float32 follows MuJoCo's doubles."""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from spacecraft import APPENDAGES, CRAFTS

# Warp warns of its own future
pytestmark = [pytest.mark.host, pytest.mark.filterwarnings("ignore")]
wp = pytest.importorskip("warp", reason="Warp is not installed: pip install 'beamchain[warp]'")
mjw = pytest.importorskip(
    "mujoco_warp", reason="MuJoCo Warp is not installed: pip install 'beamchain[warp]'"
)

SINGLE = 2e-4  # of the peak: float32 carries 7 digits, 2000 steps at 0.01 s lose three of them
STEP, STEPS = 0.01, 2000


@pytest.mark.parametrize("timed", [False, True], ids=["plain", "exact in time"])
def test_free_motion(timed):
    text = (
        (CRAFTS / "planar.xml").read_text().replace('integrator="RK4"', 'integrator="implicitfast"')
    )
    model = bc.embed(text, {"mount": APPENDAGES / "rod.toml"}, retime=timed).model
    data = mujoco.MjData(model)
    data.qvel[:3] = [0.01, -0.02, 0.05]
    mujoco.mj_forward(model, data)
    with wp.ScopedDevice("cpu"):
        put = mjw.put_model(model)
        state = mjw.put_data(model, data)
        theirs, ours = [], []
        for _ in range(STEPS):
            mjw.step(put, state)
            theirs.append(state.qpos.numpy()[0].copy())
            mujoco.mj_step(model, data)
            ours.append(data.qpos.copy())
    ours = np.array(ours)
    peak = np.abs(ours - ours[0]).max(axis=0)
    worst = float(np.max(np.abs(np.array(theirs) - ours) / peak))
    print(f"MuJoCo Warp float32 against MuJoCo over {STEP * STEPS:g} s: {worst:.1e} of the peak")  # noqa: T201
    assert worst < SINGLE
