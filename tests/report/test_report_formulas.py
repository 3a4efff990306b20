"""Closed forms beside the formulas of a drawing."""

import numpy as np
import pytest

from formulas import Drawn, steepest


def test_the_steepest_part_of_two_appendages_turns_as_fast_as_its_own_rate():
    # a straight middle moved by w x r turns by w; beyond 2 m it turns by 0.7 in place of 0.3
    x = np.array([0.0, 1.0, 2.0, 2.5, 4.0])
    rest = np.column_stack([x, 0.0 * x, 0.0 * x])
    bent = np.column_stack([0.0 * x, 0.3 * x + 0.4 * np.clip(x - 2.0, 0.0, None), 0.0 * x])
    still = Drawn([], [rest, rest], [], [])
    assert steepest(Drawn([], [bent, 0.5 * bent], [], []), still) == pytest.approx(0.7, rel=1e-12)
