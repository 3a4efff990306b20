"""Tests internals, `engine.draw`: where the camera stands, and its light."""

import mujoco
import numpy as np
import pytest

from beamchain.engine import draw

PLAIN = "<mujoco><worldbody>{}<geom size='1'/></worldbody></mujoco>"
LAMP = "<light pos='0 0 9'/>"


@pytest.mark.parametrize("degrees", [0.0, 35.0, 90.0])
@pytest.mark.parametrize("sides", [(1.0,), (1.0, -1.0)], ids=["one side", "both sides"])
@pytest.mark.parametrize("lean", [(0.01, 0.0, 0.0), (0.0, -0.01, 0.0)])
def test_arrays_are_seen_from_the_side_on_one_side_and_on_both(degrees, sides, lean):
    """What stands on both sides has its mean near the body, in any direction from it."""
    way = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0])
    points = np.array([side * x * way for side in sides for x in np.linspace(0.5, 6.0, 20)]) + lean
    model = mujoco.MjModel.from_xml_string(PLAIN.format(""))
    camera, _ = draw._camera(model, points, np.zeros(3), 1.6)
    again = 360.0 / len(sides)  # either end of what stands on both sides is its direction
    off = (camera.azimuth - degrees - draw.AZIMUTH) % again
    assert min(off, again - off) == pytest.approx(0.0, abs=1.0)


@pytest.mark.parametrize("lamp", ["", LAMP], ids=["no light", "a light"])
def test_what_faces_the_camera_is_lit_whatever_lights_the_file_has(lamp):
    model = draw.stage(PLAIN.format(lamp))
    assert min(*model.vis.headlight.ambient, *model.vis.headlight.diffuse) >= 0.3
