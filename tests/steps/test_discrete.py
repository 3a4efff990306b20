"""One step of a mode, per integrator: the formulas against the exact motion and against steps taken by hand."""

import numpy as np
import pytest
from scipy.linalg import expm

from beamchain.errors import InputError
from beamchain.steps import integrators as d
from beamchain.steps.start import HeldInput

ANGLES = np.array([1e-4, 1e-2, 0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 2.5])
RATIOS = (0.0, 0.001, 0.005, 0.02, 0.1, 0.5, 1.0, 1.5)


def wanted_pole(frequency, ratio, h):
    return np.exp(d.continuous_poles(frequency, ratio)[0] * h)


def step_by_hand(integrator, m, c, k, h):
    """The (2, 2) map of (q, v) of one step, written out as the integrators take it."""
    if integrator == "RK4":
        f = np.array([[0.0, 1.0], [-k / m, -c / m]]) * h
        return np.eye(2) + f + f @ f / 2 + f @ f @ f / 6 + f @ f @ f @ f / 24
    if integrator == "Euler":
        pull, keep = h * k / m, 1 - h * c / m
    elif integrator == "discrete":
        pull, keep = h * k / (m + h * c + h**2 * k), m / (m + h * c)
    else:
        pull, keep = h * k / (m + h * c), m / (m + h * c)
    return np.array([[1 - h * pull, h * keep], [-pull, keep]])


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "discrete", "RK4"])
@pytest.mark.parametrize("ratio", [0.0, 0.01, 0.3])
def test_poles_are_those_of_the_step_written_out(integrator, ratio):
    h, m = 0.3, 1.7
    for x in (0.05, 0.4, 1.1, 1.9):
        k = m * (x / h) ** 2
        c = 2 * ratio * x / h * m
        z = np.linalg.eigvals(step_by_hand(integrator, m, c, k, h))
        want = z[np.argmax(z.imag)] if np.any(np.abs(z.imag) > 1e-12) else z[np.argmax(np.abs(z))]
        assert abs(d.step_pole(integrator, m, c, k, h) - want) < 1e-13


@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("h", [1.0, 0.02])
def test_euler_is_exact_at_every_ratio(ratio, h):
    w = ANGLES / h
    got = d.timed("Euler", w, ratio, h)
    fast = np.abs(d.continuous_poles(w, ratio)[1]) * h < d.PHASE
    z = d.step_pole("Euler", got.mass, got.damping, w**2, h)
    loss = 1e-7 if ratio == 1.0 else 1e-14  # a double pole moves by the root of the rounding
    assert np.max(np.abs(z - wanted_pole(w, ratio, h))[fast]) < loss
    assert np.all(got.mass >= 1.0)
    assert np.all(got.slowed == ~fast)
    assert not np.any(got.clamped)


def test_undamped_mass_is_fox_and_goodwins():
    got = d.timed("Euler", ANGLES, 0.0, 1.0).mass
    assert np.allclose(got, ANGLES**2 / (4 * np.sin(ANGLES / 2) ** 2), rtol=1e-13)
    small = ANGLES[:4]
    assert np.allclose(got[:4] - 1, small**2 / 12 + small**4 / 240, rtol=2e-4, atol=1e-15)
    assert np.array_equal(got, d.timed("implicitfast", ANGLES, 0.0, 1.0).mass)


@pytest.mark.parametrize("ratio", [0.001, 0.01, 0.05, 0.1])
def test_implicit_is_exact_above_the_clamp_and_near_below(ratio):
    x = np.linspace(0.01, 2.5, 250)
    got = d.timed("implicitfast", x, ratio, 1.0)
    z, want = d.step_pole("implicitfast", got.mass, got.damping, x**2, 1.0), wanted_pole(x, ratio, 1.0)
    error = np.abs(z - want) / x
    assert np.max(error[~got.clamped]) < 1e-13
    edge = x[got.clamped].max()
    assert edge == pytest.approx(12 * ratio, rel=0.25, abs=0.02)  # zeta > x/12
    plain = d.step_pole("implicitfast", 1.0, 2 * ratio * x, x**2, 1.0)
    assert np.all(error[got.clamped] <= 1.0001 * (np.abs(plain - want) / x)[got.clamped])
    assert np.max(error) < 2.0 * ratio**2


def test_slowed_modes_turn_by_the_limit_and_keep_their_static_response():
    for integrator, limit in (("Euler", 2.6), ("implicitfast", 2.6), ("Euler", 2.2)):
        for x in (2.7, 5.0, 41.0, 1e4):
            for ratio in (0.0, 0.01, 0.1):
                got = d.timed(integrator, x, ratio, 1.0, phase=limit)
                assert got.slowed
                z = d.step_pole(integrator, got.mass, got.damping, x**2, 1.0)
                assert abs(z - wanted_pole(limit, ratio, 1.0)) < 1e-12
    assert d.timed("Euler", 5.0, 0.0, 1.0).mass == pytest.approx(25.0 / (4 * np.sin(1.3) ** 2), rel=1e-14)


def test_rk4_leaves_what_it_can_and_slows_the_rest():
    x = np.array([0.5, 1.9, 2.1, 8.0, 100.0])
    got = d.timed("RK4", x, 0.02, 1.0)
    assert np.allclose(got.mass, [1.0, 1.0, 1.05**2, 16.0, 2500.0])
    assert np.array_equal(got.slowed, [False, False, True, True, True])
    for ratio in (0.0, 0.1, 0.7, 1.0, 3.0):
        got = d.timed("RK4", x, ratio, 1.0)
        assert np.all(np.abs(d.step_pole("RK4", got.mass, got.damping, x**2, 1.0)) <= 1.0)


def test_discrete_is_left_alone():
    got = d.timed("discrete", ANGLES, 0.01, 1.0)
    assert np.array_equal(got.mass, np.ones(ANGLES.size))
    assert np.allclose(got.damping, 0.02 * ANGLES)
    assert not np.any(got.slowed)


def test_hinge_armature_is_fourth_order():
    for x in (0.1, 0.3, 0.5):
        m = 1 + d.hinge_armature(x**2, 1.0)
        w, _ = d.seen(d.step_pole("Euler", m, 0.0, x**2, 1.0), 1.0)
        assert abs(w / x - 1) == pytest.approx(x**4 / 480, rel=0.05)
    root6 = np.sqrt(6.0)
    for x, stable in ((0.999 * root6, True), (1.001 * root6, False)):
        assert bool(abs(d.step_pole("Euler", 1 + x**2 / 12, 0.0, x**2, 1.0)) <= 1 + 1e-12) is stable


@pytest.mark.parametrize("made_for", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("h", [0.1, 0.5, 1.0, 1.02])
def test_error_at_another_step(made_for, h):
    w = 0.8
    mass = d.timed("Euler", w, 0.0, made_for).mass if made_for else 1.0
    shown, _ = d.seen(d.step_pole("Euler", mass, 0.0, w**2, h), h)
    rate = 2 * np.sin(w * made_for / 2) / made_for if made_for else w  # sin(W h/2) = (h/h0) sin(w h0/2)
    assert shown == pytest.approx(2 * np.arcsin(rate * h / 2) / h, rel=1e-12)
    assert shown / w - 1 == pytest.approx(w**2 * (h**2 - made_for**2) / 24, rel=0.1, abs=1e-12)


def test_a_file_with_slowed_modes_is_unstable_just_above_its_step():
    mass = d.timed("Euler", 7.0, 0.0, 1.0).mass
    assert abs(d.step_pole("Euler", mass, 0.0, 49.0, 1.037)) == pytest.approx(1.0, abs=1e-9)
    assert abs(d.step_pole("Euler", mass, 0.0, 49.0, 1.039)) > 1.01


@pytest.mark.parametrize(
    ("x", "ratio"), [(x, z) for z in (0.0, 0.005, 0.1, 1.0, 2.0) for x in (1e-9, 0.05, 0.6, 2.1) if z < 1.0 or x < 1.0]
)
def test_a_mode_started_with_the_mean_rate_is_exact_at_every_sample(x, ratio):
    h, w = 0.25, x / 0.25
    got = d.timed("Euler", w, ratio, h)
    step = step_by_hand("Euler", got.mass, got.damping, w**2, h)
    exact = expm(np.array([[0.0, 1.0], [-(w**2), -2 * ratio * w]]) * h)
    q0, v0 = 0.7, -0.4 * max(w, 1e-3)
    state, truth = np.array([q0, d.start_rate(q0, v0, w, ratio, h)]), np.array([q0, v0])
    for _ in range(40):
        before = truth[0]
        state, truth = step @ state, exact @ truth
        assert state[0] == pytest.approx(truth[0], abs=3e-12)
        assert state[1] * h == pytest.approx(truth[0] - before, abs=3e-12)
    if ratio == 0.0 and x > 1e-3:
        assert d.start_rate(q0, v0, w, 0.0, h) == pytest.approx((q0 * (1 - np.cos(x)) + v0 * np.sin(x) / w) / h)


def test_with_the_true_rate_the_error_is_a_tenth_of_the_amplitude():
    x, h = 0.79, 1.0
    got = d.timed("Euler", x, 0.0, h)
    step = step_by_hand("Euler", got.mass, 0.0, x**2, h)
    state, worst = np.array([1.0, 0.0]), 0.0
    for k in range(1, 60):
        state = step @ state
        worst = max(worst, abs(state[0] - np.cos(k * x)))
    assert 0.05 < worst < 0.5


def test_all_samples_exact_with_the_averaged_input():
    rng = np.random.default_rng(3)
    w, h = np.array([0.3, 2.0, 9.0]), 0.25
    got = d.timed("Euler", w, 0.0, h)
    assert not np.any(got.slowed)
    q, v, truth = np.zeros(3), np.zeros(3), np.zeros((3, 2))
    held, torque = HeldInput(), rng.normal(size=300)
    for u in torque:
        mean = held(u)
        v = v + h / got.mass * (mean - w**2 * q)
        q = q + h * v
        turned = np.stack([np.cos(w * h), np.sin(w * h)], axis=1)
        offset = truth[:, 0] - u / w**2
        truth = np.stack(
            [
                offset * turned[:, 0] + truth[:, 1] / w * turned[:, 1] + u / w**2,
                -offset * w * turned[:, 1] + truth[:, 1] * turned[:, 0],
            ],
            axis=1,
        )
        assert np.max(np.abs(q - truth[:, 0]) * w) < 1e-11


def test_held_input():
    held = HeldInput()
    assert [float(held(u)) for u in (2.0, 2.0, 0.0, 0.0)] == [1.0, 2.0, 1.0, 0.0]
    held.reset()
    assert held(2.0) == 1.0
    started = HeldInput(before=[1.0, 3.0])
    assert np.array_equal(started([3.0, 3.0]), [2.0, 3.0])
    started.reset()
    assert np.array_equal(started([1.0, 3.0]), [1.0, 3.0])
    mine = np.zeros(2)
    held = HeldInput()
    held(mine)
    mine[:] = 9.0  # the caller's array may be used again
    assert np.array_equal(held(np.zeros(2)), [0.0, 0.0])


def test_unknown_integrator_is_named():
    with pytest.raises(InputError, match="leapfrog"):
        d.timed("leapfrog", 1.0, 0.0, 0.1)
