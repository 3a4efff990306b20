"""Closed forms beside what a budget adds up: errors, transients, disturbances."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from beamchain.pointing.error_indices import ErrorIndex
from formulas import ModalForm
from pointing_doors import (
    ModalResponse,
    WheelSweep,
    closed_in,
    deviation_share,
    largest_deviation,
    nodes_of_density,
    running_mean,
    states_of_a_rising_load,
    total_index,
    windowed_variance,
)


def index(rms, peak):
    return ErrorIndex(np.array([rms]), np.array([peak]))


def test_peaks_that_may_meet_add_up_and_random_errors_add_squares():
    # periodic 1 + 2, transient 4; random 3 sigma of sqrt(3^2 + 4^2) = 5
    indices = [index(0.5, 1.0), index(1.2, 2.0), index(np.nan, 4.0)]
    random = [index(3.0, 9.0), index(4.0, 12.0)]
    total = total_index(indices + random, ["wheel", "wheel", "snap", "psd", "psd"])
    assert total.peak == pytest.approx([7.0 + 15.0], rel=1e-14)
    assert total.rms == pytest.approx([np.sqrt(0.25 + 1.44 + 25.0)], rel=1e-14)
    assert np.isnan(total_index(indices[2:], ["snap"]).rms[0])


# -- transients ------------------------------------------------------------------------------------
SYSTEMS = {
    "two modes": [[0, 1, 0, 0], [-9, -0.2, 0.5, 0], [0, 0, 0, 1], [0.4, 0, -25, -0.3]],
    "integrators": [[0, 1, 0], [0, 0, 1], [0, 0, 0]],
    "a mode on a free body": [[0, 1, 0, 0], [0, 0, 4, 0.1], [0, 0, 0, 1], [0, 0, -7, -0.2]],
    "critically damped": [[0, 1], [-4, -4]],
    "as slow as the load": [[-2.5, 0], [0, -1]],
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_states_under_a_load_that_rises_are_those_of_an_integrator(name):
    """x' = A x + b (1 - exp(-t / tau)), from rest."""
    matrix = np.array(SYSTEMS[name], dtype=float)
    drive, tau, times = np.arange(1.0, len(matrix) + 1.0), 0.4, np.linspace(0.0, 2.0, 7)
    wanted = solve_ivp(
        lambda t, x: matrix @ x - drive * np.expm1(-t / tau),
        (0.0, 2.0),
        np.zeros(len(matrix)),
        "DOP853",
        times,
        rtol=1e-11,
        atol=1e-12,
    ).y.T
    found = states_of_a_rising_load(matrix, drive, times, tau)
    np.testing.assert_allclose(found, wanted, rtol=1e-8, atol=1e-9)
    later = states_of_a_rising_load(matrix, drive, times[2:], tau)
    np.testing.assert_allclose(later, wanted[2:], rtol=1e-8, atol=1e-9)


def test_contributions_of_modes_add_up_to_the_response():
    """A rigid motion, two modes of which gyroscopes couple one to it, and a direct part."""
    a = np.zeros((6, 6))
    a[0, 1] = a[2, 3] = a[4, 5] = 1.0
    a[3, 2:4], a[5, 4:6] = [-9.0, -0.2], [-25.0, -0.3]
    a[1, 3], a[3, 1] = 0.4, -0.4
    names = ("x", "x_rate", "one", "one_rate", "two", "two_rate")
    b, c = np.array([[0, 1, 0, 0.5, 0, -0.8]]).T, np.array([[1.0, 0, 0.3, 0, 2.0, 0]])
    d = np.array([[0.1]])
    form = ModalForm(a, b, c, d, names, ("",) * 6, np.ones(6), (1, 1))
    split = ModalResponse(form, ["one", "two", "lost"])
    omega = np.array([0.7, 4.0])
    parts = split.parts(omega, np.array([2.0]))
    assert split.names == ("one", "two", "rigid motion")
    for k, s in enumerate(1j * omega):
        states = np.linalg.solve(s * np.eye(6) - a, 2.0 * b[:, 0])
        assert parts[0, k, 0] == pytest.approx(0.3 * states[2], rel=1e-12)
        assert parts[1, k, 0] == pytest.approx(2.0 * states[4], rel=1e-12)
        assert parts[2, k, 0] == pytest.approx(states[0] + 0.2, rel=1e-12)
    found = np.sort_complex(split.poles)
    np.testing.assert_allclose(found, np.sort_complex(np.linalg.eigvals(a)), atol=1e-9)


def test_running_mean_of_a_straight_line_is_its_value_and_less_at_its_ends():
    line = np.column_stack([np.arange(7.0), 2.0 - 3.0 * np.arange(7.0)])
    found = running_mean(line, 2)
    np.testing.assert_allclose(found[2:5], line[2:5], rtol=1e-14)
    np.testing.assert_allclose(found[0], (line[0] + line[2]) / 2.0)
    np.testing.assert_allclose(found[1], (line[0] + line[3]) / 2.0)
    np.testing.assert_allclose(found[-1], (line[-1] + line[-3]) / 2.0)
    bent = np.array([[0.0], [0.0], [6.0], [0.0], [0.0]])
    np.testing.assert_allclose(running_mean(bent, 1)[:, 0], [0.0, 1.5, 3.0, 1.5, 0.0])


# -- disturbances ----------------------------------------------------------------------------------
def test_orders_meet_modes_where_their_multiple_of_the_speed_is_the_frequency():
    poles = np.array([-0.03 + 4.0j, -0.1 + 10.0j, -0.1 - 10.0j])
    orders = SimpleNamespace(_orders=[SimpleNamespace(order=k, poles=poles) for k in (1.0, 2.0)])
    found = WheelSweep.crossings(orders, 1.5, 6.0)
    assert [(one.order, one.speed) for one in found] == [(1.0, 4.0), (2.0, 2.0), (2.0, 5.0)]
    assert found[0].frequency == pytest.approx(np.hypot(0.03, 4.0))
    assert found[2].damping == pytest.approx(0.1 / np.hypot(0.1, 10.0))


def test_an_integral_over_frequency_resolves_resonances_and_the_density_s_corners():
    noise = SimpleNamespace(frequency=(0.5, 1.3, 4.0))  # Hz
    w, ratio = 9.0, 1e-4
    poles = np.array([w * (-ratio + 1j * np.sqrt(1.0 - ratio**2))])
    omega, weights = nodes_of_density(poles, noise, window=3.0)
    low, corner, high = 2.0 * np.pi * np.array(noise.frequency)
    assert np.sum(weights) == pytest.approx(high - low, rel=1e-12)
    bent = np.abs(omega - corner)
    area = ((corner - low) ** 2 + (high - corner) ** 2) / 2.0
    assert weights @ bent == pytest.approx(area, rel=1e-12)
    sizes = 1.0 / np.abs((1j * omega - poles[0]) * (1j * omega - poles[0].conj())) ** 2
    whole = np.pi / (4.0 * ratio * w**3)  # from 0 to infinity
    # and what lies outside, where damping does not count
    above = quad(lambda x: 1.0 / (x**2 - w**2) ** 2, high, np.inf)[0]
    below = quad(lambda x: 1.0 / (x**2 - w**2) ** 2, 0.0, low)[0]
    assert weights @ sizes == pytest.approx(whole - below - above, rel=1e-6)


@pytest.mark.parametrize(("low", "high"), [(1.001, 3.0), (1.01, 3.0), (0.1, 0.997), (0.1, 0.99)])
def test_a_density_that_ends_beside_an_undamped_mode(low, high):
    """Of 1 Hz, where the integrand is 1/(w^2 - x^2)^2, whose integral is in the tables."""
    w = 2.0 * np.pi
    omega, weights = nodes_of_density(
        np.array([1j * w]), SimpleNamespace(frequency=(low, high)), window=3.0
    )

    def primitive(x):
        return x / (2.0 * w**2 * (w**2 - x**2)) + np.log(np.abs((w + x) / (w - x))) / (4.0 * w**3)

    whole = primitive(w * high) - primitive(w * low)
    assert weights @ (1.0 / (w**2 - omega**2) ** 2) == pytest.approx(whole, rel=1e-9)


@pytest.mark.parametrize("top", [0.13, 0.5, 0.96])
def test_a_maximum_between_samples_is_closed_in(top):
    times = np.array([0.0, 0.5, 1.0])
    place = int(np.argmin(np.abs(times - top)))
    found = closed_in(lambda t: 1.0 - (t - top) ** 2, times, place)
    assert found == pytest.approx(top, abs=1e-4)


def test_a_maximum_is_closed_in_no_farther_than_the_next_sample():
    """A higher one stands between the next sample and the one after it."""
    times = np.arange(5.0)
    found = closed_in(lambda t: 1.0 - (t - 1.1) ** 2 + 9.0 * np.exp(-((20.0 * t - 50.0) ** 2)),
                      times, 1)  # fmt: skip
    assert found == pytest.approx(1.1, abs=1e-3)


def test_shares_of_a_harmonic_in_a_window():
    """Largest distance of cos(phi + w t) from its mean over a window about 0, by trying all."""
    phi, phases = np.linspace(0.0, 2.0 * np.pi, 361), np.array([0.2, 1.0, 2.0, 4.0, 8.0])
    for x, deviation, variance in zip(
        phases,
        deviation_share(phases, 2.0),
        windowed_variance(phases, 2.0),
        strict=True,
    ):
        inside = np.linspace(-x, x, 401)
        mean = np.cos(phi) * np.sin(x) / x
        wanted = np.max(np.abs(np.cos(phi + inside[:, None]) - mean))
        assert deviation == pytest.approx(wanted, rel=1e-3)
        assert variance == pytest.approx(1.0 - (np.sin(x) / x) ** 2)


def test_largest_deviation_of_samples_is_that_of_every_window():
    values, reach = np.random.default_rng(5).normal(size=(40, 2)), 3
    mean = values[::-1] / 3.0
    for mode, at in (("wrap", lambda k: k % 40), ("nearest", lambda k: np.clip(k, 0, 39))):
        wanted = [
            max(
                np.max(np.abs(values[at(np.arange(k - reach, k + reach + 1)), j] - mean[k, j]))
                for k in range(40)
            )
            for j in range(2)
        ]
        assert largest_deviation(values, mean, reach, mode) == pytest.approx(wanted)
