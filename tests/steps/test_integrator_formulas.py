"""Special cases of what a step makes of a mode, beside their equations."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from formulas import (
    apparent_pole,
    map_modes,
    place_poles,
    runge_kutta_limit,
    start_rate,
    step_pole,
    time_modes,
)

H = 0.2


def series(x):
    return sum(x**k / math.factorial(k) for k in range(5))


@pytest.mark.parametrize(("fast", "slow"), [(-3.0, -0.5), (-3.4, -0.1), (-0.9, -0.3)])
def test_of_two_real_poles_of_rk4_the_one_that_decays_less(fast, slow):
    # m (s - fast/h) (s - slow/h)
    mass = 1.7
    damping, stiffness = -mass * (fast + slow) / H, mass * fast * slow / H**2
    found = step_pole("RK4", mass, damping, stiffness, H)
    assert found == pytest.approx(max(abs(series(fast)), abs(series(slow))))


@pytest.mark.parametrize(
    "roots", [(0.6, -0.5), (-0.6, 0.5), (-0.9, -0.2), (0.4, 0.3), (-0.3, -0.1)]
)
def test_of_two_real_poles_of_a_step_the_larger_modulus(roots):
    # z^2 - (2 - c h / m - k h^2 / m) z + 1 - c h / m
    total, product = sum(roots), roots[0] * roots[1]
    mass = 1.7
    damping = mass * (1.0 - product) / H
    stiffness = mass * (1.0 + product - total) / H**2
    found = step_pole("Euler", mass, damping, stiffness, H)
    assert complex(found) == pytest.approx(roots[np.argmax(np.abs(roots))], rel=1e-10)


@pytest.mark.parametrize("ratio", [0.0, 0.2, 0.9])
def test_the_largest_angle_of_rk4_puts_its_pole_on_the_unit_circle(ratio):
    pole = complex(-ratio, math.sqrt(1.0 - ratio**2))
    angle = map_modes("RK4", 1.0, 2.0 * ratio, 1.0, 1.0).largest_step()
    assert abs(series(angle * pole)) == pytest.approx(1.0, abs=1e-12)
    assert abs(series(1.001 * angle * pole)) > 1.0 > abs(series(0.999 * angle * pole))
    assert runge_kutta_limit(7.0 * pole) == pytest.approx(angle / 7.0, rel=1e-12)


def test_discrete_has_no_largest_angle_and_a_pole_right_of_the_axis_counts_as_undamped():
    assert map_modes("discrete", 1.0, 0.6, 1.0, 1.0).largest_step() == math.inf
    assert runge_kutta_limit(1e-9 + 5j) == pytest.approx(math.sqrt(8.0) / 5.0, rel=1e-9)


def test_an_apparent_pole_slower_than_a_tenth_and_one_at_rest():
    w, ratio = apparent_pole(np.exp([H * (-0.012 + 0.016j), 0.0]), H)
    assert w == pytest.approx([0.02, 0.0])
    assert ratio == pytest.approx([0.6, 0.0])


# -- placed poles ----------------------------------------------------------------------------------
STIFFNESS = 30.0


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
@pytest.mark.parametrize("poles", [(-0.2 + 5.5j, -0.2 - 5.5j), (-1.0 + 0j, -2.3 + 0j)])
def test_placed_poles_are_those_of_the_step(integrator, poles):
    for limit, share in ((None, 1.0), (0.4, 0.4 / (H * max(abs(s) for s in poles)))):
        found = place_poles(integrator, STIFFNESS, *poles, H, phase=limit)
        mass, damping = float(found.mass), float(found.damping)
        # a = z1 z2, b = (1 - z1) (1 - z2) = h^2 k / m
        z = np.exp(np.array(poles) * H * min(share, 1.0))
        held = mass + H * damping * (integrator == "implicitfast")
        assert H**2 * STIFFNESS / held == pytest.approx(np.prod(1.0 - z).real, rel=1e-10)
        kept = mass / held if integrator == "implicitfast" else 1.0 - H * damping / mass
        assert kept == pytest.approx(np.prod(z).real, rel=1e-10)
        assert found.slowed == (share < 1.0)
        assert not found.clamped


@pytest.mark.parametrize(
    ("pole", "stiffness"), [(-0.9 + 5.4j, 20.0), (-2.5 + 4.0j, 20.0), (0.3 + 4.5j, 8.0)]
)
def test_a_clamped_mode_has_the_damping_that_misses_its_pole_least(pole, stiffness):
    # residual of the step of a unit mass at z, a = 1 / (1 + h c): z^2 - z - a (z (1 - h^2 k) - 1)
    found = place_poles("implicitfast", stiffness, pole, np.conj(pole), H)
    z = np.exp(pole * H)
    slope, rest = z * (1.0 - H**2 * stiffness) - 1.0, z**2 - z
    columns = np.array([[slope.real], [slope.imag]])
    keep = np.linalg.lstsq(columns, np.array([rest.real, rest.imag]))[0][0]
    assert found.clamped
    assert found.mass == 1.0
    assert found.damping == pytest.approx((1.0 / min(keep, 1.0) - 1.0) / H, rel=1e-10)
    assert (found.damping == 0.0) == (pole.real > 0.0)


def test_euler_clamps_the_mass_and_leaves_the_drag():
    # a stiffness that is a tenth of the poles' own
    pole = -0.5 + 4.0j
    found = place_poles("Euler", 1.6, pole, np.conj(pole), H)
    z = np.exp(pole * H)
    mass = H**2 * 1.6 / abs(1.0 - z) ** 2
    assert mass < 1.0
    assert found.clamped
    assert found.mass == 1.0
    assert found.damping == pytest.approx(mass * (1.0 - abs(z) ** 2) / H)
    grows = place_poles("Euler", STIFFNESS, 0.5 + 4.0j, 0.5 - 4.0j, H)
    assert grows.damping == 0.0


@pytest.mark.parametrize(("integrator", "limit"), [("RK4", 2.0), ("discrete", math.inf)])
def test_modes_of_rk4_and_discrete_stay_or_are_slowed_to_the_limit(integrator, limit):
    w, ratio = np.array([3.0, 9.9, 10.1, 25.0]), np.array([0.1, 0.2, 0.3, 0.02])
    found = time_modes(integrator, w, ratio, H)
    factor = np.maximum(w * H / limit, 1.0)
    assert found.mass == pytest.approx(factor**2)
    assert found.damping == pytest.approx(2.0 * ratio * w * factor)
    assert found.slowed.tolist() == [False, False, integrator == "RK4", integrator == "RK4"]
    assert not found.clamped.any()
    poles = np.array([-0.5 + 3j, -2.0 + 0j]), np.array([-0.5 - 3j, -7.0 + 0j])
    own = place_poles(integrator, np.array([9.25, 14.0]), *poles, H, phase=1.0)
    assert own.mass == pytest.approx([1.0, 1.4**2])
    assert own.damping == pytest.approx([1.0, 9.0 * 1.4])


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
def test_semi_implicit_steps_slow_a_mode_beyond_their_usual_phase(integrator):
    for w, turn in ((12.9, 2.58), (13.1, 2.6), (40.0, 2.6)):
        found = time_modes(integrator, w, 0.0, H)
        z = step_pole(integrator, found.mass, found.damping, w**2, H)
        assert np.angle(z) == pytest.approx(turn, rel=1e-9)
        assert found.slowed == (w * H > 2.6)


# -- start -----------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("w", "ratio"), [(4.0, 0.3), (4.0, 1.0), (4.0, 1.8), (0.0, 0.0), (2e-6, 0.4)]
)
def test_a_mode_starts_with_its_mean_rate_over_the_step_before(w, ratio):
    q, v = 0.7, -0.4
    flow = np.array([[0.0, 1.0], [-(w**2), -2.0 * ratio * w]])
    before = expm(-H * flow) @ [q, v]
    assert start_rate(q, v, w, ratio, H) == pytest.approx((q - before[0]) / H, rel=1e-9)
