"""Closed forms beside the formulas of what is read from a model."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from formulas import small_turn, sum_of_poles


@pytest.mark.parametrize("axis", np.vstack([np.eye(3), [2 / 3, -1 / 3, 2 / 3]]))
def test_a_turn_is_its_axis_times_the_sine_in_the_axes_it_starts_from(axis):
    start = Rotation.from_rotvec([0.4, -0.2, 0.9])
    now = start * Rotation.from_rotvec(0.3 * axis)
    got = small_turn(start.as_matrix(), now.as_matrix())
    assert got == pytest.approx(np.sin(0.3) * axis, abs=1e-14)


def test_accelerance_of_poles_is_their_sum():
    # s^2 / (1 - s p): of 1 / p, the poles of s
    products = np.array([[[2.0 + 1.0j]], [[0.5 + 0.0j]]])
    slowness = np.array([0.2 + 0.1j, 0.4 + 0.0j])
    s = 1j * np.array([0.3, 2.0])
    wanted = 7.0 + s**2 * ((2.0 + 1.0j) / (1.0 - 0.2 * s - 0.1j * s) + 0.5 / (1.0 - 0.4 * s))
    got = sum_of_poles(slowness, products, np.array([[7.0]]), np.array([0.3, 2.0]))
    assert got[0, 0] == pytest.approx(wanted, rel=1e-13)
