"""Tests internals, `engine.slew`: which mode a turn rings, and that it is seen.

READ_BACK: relative, between the frequencies of a file read twice. BEYOND: of the bending in
proportion to a small turn: large angles, and frames between.
"""

from functools import cache

import numpy as np
import pytest

import beamchain as bc
from beamchain.cli import shipped
from beamchain.engine.slew import MOST_BENT, simulate
from turns import bent

READ_BACK = 1e-6
BEYOND = 1.3


@cache
def satellite():
    """The shipped spacecraft with an array on either side."""
    craft = shipped.pick(shipped.everything(), "craft", "kind").path
    array = shipped.pick(shipped.everything(), "array", "kind").path
    return bc.embed(craft, {"left": array, "right": array})


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [10.0, pytest.param(20.0, marks=pytest.mark.slow), 30.0])
def test_a_turn_rings_a_mode_that_is_seen(degrees):
    """The lowest mode of two equal arrays bends both to the same side of the bus and does not turn
    it: the next, in which they bend against each other, rings, about the axis across them."""
    model = satellite().model
    slew = simulate(model, angle=np.radians(degrees), frames=108)
    assert slew.axis == 2
    assert slew.omega == pytest.approx(bc.linearise(model).frequencies()[1], rel=READ_BACK)
    left, right = np.split(slew.positions[:, list(slew.elastic)], 2, axis=1)
    np.testing.assert_allclose(left, right, atol=0.01)  # rad, about axes of their own
    turned = bent(model, slew)
    assert 0.7 * MOST_BENT < turned.max() < BEYOND * MOST_BENT
    assert turned[slew.times > slew.duration].max() > 0.2 * MOST_BENT
