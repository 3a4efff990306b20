"""Tests an internal, `structure.exact.UniformBeam`, the reference curve of reports:
right at every frequency.

Modal series, static limits, 50-digit arithmetic.
"""

from math import factorial

import mpmath
import numpy as np
import pytest
from scipy.special import polygamma

from appendages import close
from beamchain.structure.exact import UniformBeam, krylov
from uniform_beam import dynamic_mass as reference
from uniform_beam import free_roots, held_roots

# 50-digit reference; the solution cancels terms of cosh^2 z, at z = 6 a factor 1e2..1e3 of rounding
DIGITS = 1e-12
SERIES = 1e-12  # modal series with its tail: what is left out is below 1e-14 of the sum
# det(M_hub + D) within this relative distance of zero, measured as a shift in frequency
RESIDUAL = 1e-11
UNIT = UniformBeam(1.0, 1.0, 1.0)


@pytest.mark.parametrize(
    "z",
    [
        0.01,
        0.1,
        0.5,
        1.0,
        1.4999999,
        1.5,
        1.5000001,
        2.0,
        3.0,
        4.0,
        5.0,
        5.5,
        5.999999,
        6.0,
        6.000001,
        7.0,
        10.0,
        20.0,
        50.0,
        200.0,
        800.0,
    ],
)
def test_no_digit_is_lost_anywhere(z):
    d = UNIT.D(z**2)[:, :, 0]
    expected = reference(z)
    scale = np.sqrt(np.abs(np.outer(np.diag(expected), np.diag(expected)))) + np.abs(expected)
    assert np.max(np.abs(d - expected) / scale) < DIGITS


@pytest.mark.parametrize("z", [1.5, 6.0])
def test_the_switches_between_formulas_cannot_be_seen(z):
    below, above = UNIT.D(np.array([np.nextafter(z, 0.0), np.nextafter(z, 9.0)]) ** 2).transpose(
        2, 0, 1
    )
    assert below == close(above, rel=DIGITS)


def test_krylov_functions_in_50_digits():
    for z in (0.0, 1e-3, 0.7, 1.49, 1.51, 4.0):
        with mpmath.workdps(50):
            x = mpmath.mpf(z)
            c = mpmath.cos(x)
            s = mpmath.sin(x)
            ch = mpmath.cosh(x)
            sh = mpmath.sinh(x)
            expected = [float(v / 2) for v in (ch + c, sh + s, ch - c, sh - s)]
        assert list(krylov(z)) == close(expected, rel=1e-14)


# -- limits ----------------------------------------------------------------------------------------
def test_at_rest_it_is_the_rigid_mass():
    beam = UniformBeam(length=3.0, bending_stiffness=5.0, linear_mass=2.0)
    rigid = np.array([[6.0, 9.0], [9.0, 18.0]])  # m, m L / 2, m L^2 / 3
    assert beam.D(0.0)[:, :, 0] == close(rigid, rel=1e-15)
    assert beam.D(1e-8)[:, :, 0] == close(rigid, rel=1e-14)
    assert beam.W(0.0)[:, :, 0] == close(np.linalg.inv(rigid), rel=1e-13)


def test_slowly_it_bends_under_its_own_inertia():
    # D = M + omega^2 S + ...; S: work of the inertia load of each rigid motion in the other's
    # static deflection, L = m = EI = 1: 1/20, 13/360, 11/420
    expected = np.array([[1 / 20, 13 / 360], [13 / 360, 11 / 420]])
    rigid = np.array([[1.0, 0.5], [0.5, 1.0 / 3.0]])
    w = np.array([0.1, 0.2])
    near, far = ((UNIT.D(x)[:, :, 0] - rigid) / x**2 for x in w)
    # one Richardson step; the next term is (w / w1)^4
    assert (4.0 * near - far) / 3.0 == close(expected, rel=1e-5)


def test_it_scales_with_length_mass_and_stiffness():
    beam = UniformBeam(length=15.0, bending_stiffness=209.7, linear_mass=0.882)
    w = np.array([0.3, 3.0, 40.0])
    unit = UNIT.D(w / (np.sqrt(209.7 / 0.882) / 15.0**2))
    m, length = 0.882 * 15.0, 15.0
    scale = np.array([[m, m * length], [m * length, m * length**2]])[:, :, None]
    assert beam.D(w) == close(unit * scale, rel=1e-11)  # the rounding of z near the poles
    per_root = np.sqrt(209.7 / 0.882) / 15.0**2
    assert beam.cantilever_frequencies(3) == close(held_roots(3) ** 2 * per_root, rel=1e-13)
    for hub in (np.zeros((2, 2)), np.array([[2.0, 0.3], [0.3, 0.4]])):
        found = beam.coupled_frequencies(hub * scale[:, :, 0], 3)
        assert found == close(UNIT.coupled_frequencies(hub, 3) * per_root, rel=1e-12)


def test_symmetry_and_inverse():
    w = np.array([0.0, 0.7, 5.0, 30.0, 36.0, 37.0, 500.0, 5e4])
    d = UNIT.D(w)
    v = UNIT.W(w)
    assert d[0, 1] == close(d[1, 0], rel=1e-15)
    assert v[0, 1] == close(v[1, 0], rel=1e-11)
    product = np.einsum("ijf,jkf->fik", d, v)
    assert product - np.eye(2) == close(np.zeros((w.size, 2, 2)), abs=1e-10)


# -- modal series ----------------------------------------------------------------------------------
OMEGAS = np.array([0.5, 3.0, 10.0, 40.0, 100.0])


def test_dynamic_mass_is_the_cantilever_series():
    b = held_roots(4000)
    e = np.exp(-b)
    sigma = (1 + e**2 + 2 * np.cos(b) * e) / (1 - e**2 + 2 * np.sin(b) * e)
    lift, turn = 2 * sigma / b, 2 / b**2
    rigid = np.array([[1.0, 0.5], [0.5, 1.0 / 3.0]])
    for w in OMEGAS:
        weight = w**2 / (b**4 - w**2)
        series = rigid + np.array(
            [[weight @ lift**2, weight @ (lift * turn)], [weight @ (lift * turn), weight @ turn**2]]
        )
        assert UNIT.D(w)[:, :, 0] == close(series, rel=SERIES * 10)


def test_accelerance_is_the_free_series():
    count = 4000
    b = free_roots(count)
    e = np.exp(-b)
    sigma = (1 + e**2 - 2 * np.cos(b) * e) / (1 - e**2 - 2 * np.sin(b) * e)
    y = np.full(count, 2.0)
    turn = -2 * sigma * b
    rigid = np.linalg.inv(np.array([[1.0, 0.5], [0.5, 1.0 / 3.0]]))
    # beyond the last mode beta = (n + 1/2) pi and sigma = 1: sums of beta^-4, -3,
    # -2 are polygamma functions
    yy, yt, tt = (
        float(abs(polygamma(p - 1, count + 1.5))) / factorial(p - 1) / np.pi**p for p in (4, 3, 2)
    )
    tail = 4 * np.array([[yy, -yt], [-yt, tt]])
    for w in OMEGAS:
        weight = -(w**2) / (b**4 - w**2)
        series = rigid + np.array(
            [[weight @ y**2, weight @ (y * turn)], [weight @ (y * turn), weight @ turn**2]]
        )
        assert UNIT.W(w)[:, :, 0] == close(series - w**2 * tail, rel=SERIES * 10)


# -- frequencies -----------------------------------------------------------------------------------
def test_held_and_free_frequencies_are_the_roots():
    assert UNIT.cantilever_frequencies(20) == close(held_roots(20) ** 2, rel=1e-13)
    assert UNIT.coupled_frequencies(np.zeros((2, 2)), 20) == close(free_roots(20) ** 2, rel=1e-13)


@pytest.mark.parametrize("ratio", [1e-3, 1.0, 1e6])
@pytest.mark.slow
def test_coupled_frequencies_are_zeros_of_the_loaded_beam(ratio):
    hub = ratio * np.array([[1.0, 0.3], [0.3, 0.2]])
    found = UNIT.coupled_frequencies(hub, 8)
    for w in found:
        left, right = (
            np.linalg.det(hub + reference(np.sqrt(w * (1 + s)))) for s in (-RESIDUAL, RESIDUAL)
        )
        assert left * right < 0.0
    # interlacing: a heavier hub lowers every coupled frequency, towards the held ones
    assert np.all(np.diff(found) > 0.0)
    assert np.all(found < UNIT.coupled_frequencies(np.zeros((2, 2)), 8))
    assert np.all(found > UNIT.cantilever_frequencies(8))


def test_heavy_hub_gives_the_cantilever():
    assert UNIT.coupled_frequencies(np.diag([1000.0, 100.0]), 1)[0] == close(3.5228, abs=5e-5)
    assert UNIT.coupled_frequencies(np.diag([0.1, 0.01]), 1)[0] == close(14.355, abs=5e-4)
