"""Curves over frequency: resonances that are resolved, largest values, zeros."""

import numpy as np
import pytest

from beamchain.ports.peaks import around, crossing, crossings, half_widths, largest


def test_a_resonance_is_looked_at_within_its_width_and_far_beyond():
    """Half of `1/|1 + j x|` lies within one half width x, and 1/20 of it at 20."""
    steps = half_widths(4.0, 25)
    assert np.abs(steps).max() == pytest.approx((np.exp(4.0) - np.exp(-4.0)) / 2.0)
    omega = around(np.array([3.0, 8.0]), np.array([0.01, 0.5]), steps)
    assert omega.size == 50
    for frequency, width in ((3.0, 0.01), (8.0, 0.5)):
        x = np.sort((omega - frequency) / width)
        near = x[np.abs(x) < 28.0]
        assert np.sum(np.abs(near) < 1.0) >= 5
        answer = 1.0 / np.abs(1.0 + 1j * near)
        assert np.abs(np.diff(np.log(answer))).max() < 0.5


def test_peaks_between_and_at_the_ends_of_a_grid():
    omega = np.arange(1.0, 9.0)

    def hills(w):
        return 3.0 - (w - 2.3) ** 2 if w < 4.5 else 3.05 - 4.0 * (w - 6.4) ** 2

    values = np.array([hills(w) for w in omega])
    assert largest(omega, values, hills) == pytest.approx((3.05, 6.4), rel=1e-9)
    assert largest(omega, values, hills, 3.04) == pytest.approx((3.05, 6.4), rel=1e-9)
    assert largest(omega, values, hills, 3.06) == (3.06, np.inf)
    for sign, end in ((1.0, 8.0), (-1.0, 1.0)):
        found = largest(omega, sign * omega, lambda w, s=sign: s * w)
        assert found == pytest.approx((sign * end, end), rel=1e-6)


def test_of_many_peaks_nearly_alike_each_is_polished():
    """On the grid the highest of six, between its points, is the lowest."""
    omega = np.arange(1.0, 13.0, 0.5)
    places = np.array([2.0, 4.0, 6.0, 8.0, 10.0, 11.74])
    heights = np.array([1.0, 1.001, 1.002, 1.001, 1.0, 1.004])

    def hills(w):
        return float(np.max(heights - 0.1 * (w - places) ** 2))

    values = np.array([hills(w) for w in omega])
    assert largest(omega, values, hills) == pytest.approx((1.004, 11.74), rel=1e-8)


def test_crossings_of_a_curve_and_the_points_before_them():
    omega = np.arange(0.3, 10.0, 0.5)
    found = crossings(omega, np.sin(omega), np.sin)
    assert [w for _, w in found] == pytest.approx(np.pi * np.arange(1, 4), rel=1e-12)
    assert all(omega[k] < w < omega[k + 1] for k, w in found)


@pytest.mark.parametrize(("low", "high"), [(0.5, 4.0), (0.5, 2.0), (2.0, 4.0)])
def test_where_a_function_crosses_zero(low, high):
    assert crossing(lambda w: w**2 - 4.0, low, high) == pytest.approx(2.0, rel=1e-12)


def test_without_a_change_of_sign_the_nearer_end_is_the_zero():
    assert crossing(lambda w: w - 1.0, 2.0, 3.0) == 2.0
    assert crossing(lambda w: 4.0 - w, 2.0, 3.0) == 3.0
