"""Closed forms beside the formulas of plants."""

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import beamchain as bc
from beamchain.plants.error_indices import ErrorIndex
from formulas import ModalForm, ModalResponse, running_mean, states_of_a_rising_load, total_index


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
    drive, tau, times = np.arange(1.0, len(matrix) + 1.0), 0.4, np.array([0.0, 0.1, 0.7, 2.0])
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


# -- margins in closed form ------------------------------------------------------------------------
def loop_of(plant, delay=0.0, step=0.0):
    """Margins of a plant under 1, the loop closed with minus."""
    system = control.ss(plant)
    controller = bc.Controller(
        loop=(
            bc.Loop(
                input=system.input_labels[0],
                output=system.output_labels[0],
                numerator=[1.0],
                denominator=[1.0],
                delay=delay,
            ),
        )
    )
    return bc.margins(system, controller)


def test_gain_margin_at_rest_is_that_of_the_static_gain():
    """L(0) = -0.4: unstable from 2.5 on, at frequency 0."""
    (loop,) = loop_of(control.tf([-0.4], [1.0, 1.0])).loops
    assert loop.gain == pytest.approx(2.5, rel=1e-9)


def test_gain_and_phase_margin_of_three_lags():
    """k / (s + 1)^3 is -k / 8 at sqrt(3); with k = 2 sqrt(2) its size is 1 at 1."""
    (loop,) = loop_of(control.tf([2.0 * np.sqrt(2.0)], [1.0, 3.0, 3.0, 1.0])).loops
    assert loop.gain == pytest.approx(8.0 / (2.0 * np.sqrt(2.0)), rel=1e-7)
    assert abs(loop.phase) == pytest.approx(45.0, rel=1e-7)


@pytest.mark.parametrize(("delay", "told"), [(3.5, True), (3.0, False)])
def test_a_dead_time_longer_than_a_period_of_the_crossover_is_told(delay, told):
    """4 / (s + 2 sqrt(3)) is 1 at 2 rad/s, a period of 3.14 s."""
    found = loop_of(control.tf([4.0], [1.0, 2.0 * np.sqrt(3.0)]), delay)
    assert told == any(getattr(one, "code", "") == "long-delay" for one in found.warnings)
