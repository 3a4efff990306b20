"""Closed forms beside the formulas of a craft."""

from types import SimpleNamespace

import numpy as np
import pytest

import beamchain as bc
from formulas import ModalForm, check_inertia, load_of_modes_left_out


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


# -- modal forms -----------------------------------------------------------------------------------
def response(form, s):
    n = len(form.a)
    return form.c @ np.linalg.solve(s * np.eye(n) - form.a, form.b) + form.d


def form_of(b, c):
    """Two rigid directions and two modes; positions stand before rates."""
    a = np.zeros((8, 8))
    a[:2, 2:4] = np.eye(2)
    for i, (w, ratio) in enumerate(((3.0, 0.01), (7.0, 0.02))):
        a[4 + 2 * i : 6 + 2 * i, 4 + 2 * i : 6 + 2 * i] = [[0.0, 1.0], [-(w**2), -2.0 * ratio * w]]
    names = ("x", "y", "x_rate", "y_rate", "one", "one_rate", "two", "two_rate")
    weight = np.array([1.0, 0.5, 1.0, 0.5, 1.0, 3.0, 1.0, 7.0])
    return ModalForm(a, b, c, np.array([[0.3]]), names, ("",) * 8, weight, (2, 2))


B = np.array([[0, 0, 0.2, 0.5, 0, 1.1, 0, -0.7]]).T
C = np.array([[1.0, -2.0, 0, 0, 0.4, 0, 0.9, 0]])
S = 0.3 + 2.1j


def test_a_reduced_form_has_the_response_of_its_states():
    """Rigid positions and rates side by side, then what is kept."""
    form = form_of(B, C)
    whole = form.reduced(np.ones(8, dtype=bool))
    assert whole.names == ("x", "x_rate", "y", "y_rate", "one", "one_rate", "two", "two_rate")
    assert response(whole, S) == pytest.approx(response(form, S), rel=1e-13)
    less = form.reduced(np.array([True] * 6 + [False] * 2))
    wanted = 0.3 + (0.2 - 1.0) / S**2 + 0.4 * 1.1 / (S**2 + 0.06 * S + 9.0)
    assert response(less, S)[0, 0] == pytest.approx(wanted, rel=1e-13)
    assert less.states_of("one") == [4, 5]
    assert less.oscillators(["one", "two"]) == ["one"]


def test_one_input_drives_one_rigid_direction():
    form = form_of(B, C)
    spanned = form.reduced(np.ones(8, dtype=bool)).spanned()
    assert spanned.rigid == (1, 1)
    assert len(spanned.names) == 6
    assert response(spanned, S) == pytest.approx(response(form, S), rel=1e-12)


def test_states_that_nothing_drives_or_sees_are_not_active():
    b, c = B.copy(), C.copy()
    b[5], c[0, 6] = 0.0, 0.0  # the first mode is not driven, the second not seen
    assert form_of(b, c).active().tolist() == [True] * 4 + [False] * 4
    assert form_of(B, C).active().all()


# -- uncertain inertia -----------------------------------------------------------------------------
@pytest.mark.parametrize(("reach", "kept"), [(0.9, True), (1.1, False)])
def test_principal_moments_stay_a_body_s_at_every_corner(reach, kept):
    """Moments 3, 4, 6: the largest may grow by 1 until it is the sum of the others."""
    range_of = SimpleNamespace(kind="inertia_zz", nominal=6.0, reach=reach)
    if kept:
        check_inertia("bus", np.diag([3.0, 4.0, 6.0]), [range_of])
    else:
        with pytest.raises(bc.InputError, match="bus.*3, 4, 7.1"):
            check_inertia("bus", np.diag([3.0, 4.0, 6.0]), [range_of])
