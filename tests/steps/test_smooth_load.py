"""A load that is a smooth function of time, in an appendage that is exact in time: taken at the
instant of the step, while one that is held is taken as the mean of this and the last input."""

import mujoco
import numpy as np
import pytest

import beamchain as bc

STEP = 0.05
CRAFT = f"""<mujoco><option gravity="0 0 0" timestep="{STEP}"/><worldbody><body name="bus">
<freejoint/><inertial pos="0 0 0" mass="300" diaginertia="60 90 120"/>
<site name="mount" pos="0.5 0 0"/></body></worldbody></mujoco>"""
TUBE = bc.Tube(outer_diameter=0.05, wall=0.002)
ALUMINIUM = bc.Material(youngs_modulus=7e10, density=2700.0)
BOOM = bc.Spec(segment=(bc.Segment(length=8.0, section=TUBE, material=ALUMINIUM),))


def torque(t):
    """N m about z: smooth, and zero with its slope at the start."""
    return np.sin(0.7 * t) ** 2


def angles(step, load):
    """Attitude about z at every 0.05 s under a load of (this step's time, the last one's)."""
    model = bc.embed(CRAFT.replace(str(STEP), str(step)), {"mount": BOOM}, retime=True).model
    data = mujoco.MjData(model)
    every = round(STEP / step)
    out = []
    for k in range(200 * every):
        data.qfrc_applied[5] = load(data.time, step)
        mujoco.mj_step(model, data)
        if (k + 1) % every == 0:
            out.append(2.0 * np.arctan2(data.qpos[6], data.qpos[3]))
    return np.array(out)


@pytest.fixture(scope="module")
def truth():
    return angles(STEP / 50.0, lambda t, h: torque(t))


@pytest.mark.slow
def test_a_smooth_load_is_taken_at_the_instant_of_the_step(truth):
    at_once = angles(STEP, lambda t, h: torque(t))
    averaged = angles(STEP, lambda t, h: 0.5 * (torque(t) + torque(t - h)))
    size = np.max(np.abs(truth))
    off = np.max(np.abs(at_once - truth)) / size
    late = np.max(np.abs(averaged - truth)) / size
    assert off < 1e-3
    assert late > 5.0 * off
