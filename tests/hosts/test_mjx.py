"""MJX (JAX) with a file that embed wrote: how far float32 follows MuJoCo's doubles."""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from spacecraft import APPENDAGES, CRAFTS

pytestmark = [pytest.mark.host, pytest.mark.filterwarnings("ignore")]  # JAX warns of its own future
mjx = pytest.importorskip("mujoco.mjx", reason="MJX is not installed: pip install 'beamchain[mjx]'")
jax = pytest.importorskip("jax", reason="JAX is not installed: pip install 'beamchain[mjx]'")

SINGLE = 2e-4  # of the peak: float32 carries 7 digits, 2000 steps at 0.01 s lose three of them
DOUBLE = 1e-9  # the same algebra in another order
STEP, STEPS = 0.01, 2000


@pytest.fixture(scope="module", params=[False, True], ids=["plain", "exact in time"])
def model(request):
    text = (
        (CRAFTS / "planar.xml").read_text().replace('integrator="RK4"', 'integrator="implicitfast"')
    )
    return bc.embed(text, {"mount": APPENDAGES / "rod.toml"}, retime=request.param).model


def plain(model) -> np.ndarray:
    data = mujoco.MjData(model)
    data.qvel[:3] = [0.01, -0.02, 0.05]
    out = []
    for _ in range(STEPS):
        mujoco.mj_step(model, data)
        out.append(data.qpos.copy())
    return np.array(out)


def in_mjx(model) -> np.ndarray:
    data = mujoco.MjData(model)
    data.qvel[:3] = [0.01, -0.02, 0.05]
    put = mjx.put_model(model)

    def step(state, _):
        state = mjx.step(put, state)
        return state, state.qpos

    # in doubles a step turns some of the tendons' indices into int64
    first = mjx.step(put, mjx.put_data(model, data))
    _, positions = jax.lax.scan(step, first, None, length=STEPS - 1)
    return np.vstack([np.array(first.qpos)[None], np.array(positions)]).astype(np.float64)


@pytest.mark.parametrize("double", [False, True])
def test_free_motion(model, double):
    with (
        jax.experimental.enable_x64(double)
        if hasattr(jax.experimental, "enable_x64")
        else jax.enable_x64(double)
    ):
        theirs = in_mjx(model)
    ours = plain(model)
    peak = np.abs(ours - ours[0]).max(axis=0)
    worst = float(np.max(np.abs(theirs - ours) / peak))
    print(  # noqa: T201
        f"MJX {'float64' if double else 'float32'} against MuJoCo over {STEP * STEPS:g} s: "
        f"{worst:.1e} of the peak"
    )
    assert worst < (DOUBLE if double else SINGLE)
