"""Closed forms beside the formulas of a craft."""

from types import SimpleNamespace

import numpy as np
import pytest

from formulas import load_of_modes_left_out


def test_centrifugal_load_of_axial_modes_left_out():
    # turning at w, a point at x is accelerated by -(w_y^2 + w_z^2) x along x
    inside = SimpleNamespace(
        drive=np.array([[0.2, 5.0]]),  # of acceleration, and of that per metre
        drive_carried=np.zeros((1, 0)),
        momentum=np.array([[[7.0]]]),
        left_out=np.array([[[0.0, 3.0]]]),
        left_out_carried=np.zeros((1, 1, 0)),
    )
    spin = np.array([[9.0, 0.3, 0.4], [0.0, 0.0, 2.0]])
    felt, carried = np.zeros((2, 6)), np.zeros((2, 0, 6))
    load, shift = load_of_modes_left_out("axial", inside, felt, spin, carried)
    away = np.array([-0.25, -4.0])
    assert load[:, 0, 0] == pytest.approx(away * 5.0 * 7.0, rel=1e-14)
    assert shift[:, 0, 0] == pytest.approx(away * 3.0, rel=1e-14)
