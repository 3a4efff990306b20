"""Tests internals, `engine.slew`: which mode a turn rings, and that it is seen.

READ_BACK: relative, between the frequencies of a file read twice. BEYOND: of the bending in
proportion to a small turn: large angles, and frames between.
"""

import numpy as np
import pytest

import beamchain as bc
from beamchain.cli import shipped
from beamchain.engine.slew import MOST_BENT, simulate
from turns import bent

READ_BACK = 1e-6
BEYOND = 1.3


@pytest.mark.slow
def test_a_turn_rings_a_mode_that_is_seen():
    """The lowest mode of the shipped spacecraft's two equal arrays bends both to the same side of
    the bus and does not turn it: the next, in which they bend against each other, rings, about the
    axis across them."""
    craft = shipped.pick(shipped.everything(), "craft", "kind").path
    array = shipped.pick(shipped.everything(), "array", "kind").path
    model = bc.embed(craft, {"left": array, "right": array}).model
    slew = simulate(model, angle=np.radians(30.0), frames=108)
    assert slew.axis == 2
    assert slew.omega == pytest.approx(bc.linearise(model).frequencies()[1], rel=READ_BACK)
    left, right = np.split(slew.positions[:, list(slew.elastic)], 2, axis=1)
    np.testing.assert_allclose(left, right, atol=0.01)  # rad, about axes of their own
    turned = bent(model, slew)
    assert 0.7 * MOST_BENT < turned.max() < BEYOND * MOST_BENT
    assert turned[slew.times > slew.duration].max() > 0.2 * MOST_BENT
