"""The simulation of logs: against momentum, quadrature of the beam's shapes, an integrator,
and itself on other samples."""

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from scipy.integrate import solve_ivp

from flight_log import (
    Gyro,
    Hub,
    as_seen,
    boom,
    cramer_rao,
    motion,
    record,
    response,
    seen,
    steps_at,
    turn,
    wings,
)
from uniform_beam import held_roots

CLOSED = 1e-10  # closed forms against Gauss quadrature
EXACT = 1e-11  # the same numbers by another order of rounding
INTEGRATED = 1e-8  # against an integrator with rtol 1e-11

TURN = np.linalg.qr(np.array([[1.0, 0.3, -0.2], [0.1, 1.0, 0.5], [0.4, -0.3, 1.0]]))[0]
TURN *= np.sign(np.linalg.det(TURN))
HUB = Hub(
    inertia=np.array([[100.0, 3.0, -2.0], [3.0, 120.0, 4.0], [-2.0, 4.0, 150.0]]),
    centre=np.array([0.02, -0.03, 0.05]),
    port=np.array([0.5, 0.2, -0.1]),
    axes=TURN,
)
BOOM = boom(8.0, 1.2, 500.0, 900.0, 60.0, 0.05)


def test_participation_is_that_of_the_shapes():
    """Shapes by their own formula, integrated; frequencies from strain energy."""
    nodes, weight = leggauss(80)
    x, weight = 0.5 + 0.5 * nodes, 0.5 * weight
    for k, b in enumerate(held_roots(4)):
        s = (np.sinh(b) - np.sin(b)) / (np.cosh(b) + np.cos(b))
        shape = np.cosh(b * x) - np.cos(b * x) - s * (np.sinh(b * x) - np.sin(b * x))
        bent = b**2 * (np.cosh(b * x) + np.cos(b * x) - s * (np.sinh(b * x) + np.sin(b * x)))
        mass, push, turned, energy = weight @ np.column_stack([shape**2, shape, x * shape, bent**2])
        mode = np.flatnonzero(BOOM.participation[1])[k]
        size = np.sqrt(1.2 * 8.0 / mass)
        assert abs(BOOM.participation[1, mode] / (size * push) - 1.0) < CLOSED
        assert abs(BOOM.participation[5, mode] / (size * 8.0 * turned) - 1.0) < CLOSED
        assert (
            abs(BOOM.frequency[mode] ** 2 / (500.0 / 1.2 / 8.0**4 * energy / mass) - 1.0) < CLOSED
        )


@pytest.mark.parametrize("elastic", [BOOM, wings(5.0, 1.0, 200.0, 350.0, 50.0, 0.05)])
def test_the_modes_carry_almost_all_of_the_mass_and_no_more(elastic):
    left = elastic.rigid - elastic.participation @ elastic.participation.T
    assert np.linalg.eigvalsh(left).min() > 0.0
    assert left[5, 5] < 1e-4 * elastic.rigid[5, 5]
    assert elastic.frequency.size == 40


def test_torque_is_the_change_of_angular_momentum():
    inertia, turning, _ = seen(HUB, BOOM)
    a, b = motion(HUB, BOOM)
    held = np.hstack([np.zeros((3, 43)), inertia, turning])
    assert np.abs(held @ b - np.eye(3)).max() < EXACT
    assert np.abs(held @ a).max() < EXACT * np.abs(inertia).max() * np.abs(a).max()


def test_the_samples_are_those_of_an_integrator_also_at_unequal_steps():
    time = np.cumsum(np.random.default_rng(1).choice([0.05, 0.1, 0.25], 60))
    torque = np.random.default_rng(2).standard_normal((60, 3))
    few = BOOM.kept(4)
    a, b = motion(HUB, few)
    rates, angles = turn(HUB, few, time, torque)
    state = np.zeros(14)
    for k in range(59):
        state = solve_ivp(
            lambda _, x, k=k: a @ x + b @ torque[k],
            time[k : k + 2],
            state,
            "DOP853",
            rtol=1e-11,
            atol=1e-14,
        ).y[:, -1]
        assert np.abs(state[7:10] - rates[k + 1]).max() < INTEGRATED * np.abs(rates).max()
        assert np.abs(state[:3] - angles[k + 1]).max() < INTEGRATED * np.abs(angles).max()


def test_the_response_is_that_of_the_equations_of_motion():
    omega = np.array([0.3, 2.0, 15.0])
    a, b = motion(HUB, BOOM)
    half = a.shape[0] // 2
    direct = [np.linalg.solve(1j * w * np.eye(2 * half) - a, b)[half : half + 3] for w in omega]
    assert np.allclose(response(HUB, BOOM, omega), direct, rtol=1e-7, atol=1e-12)


def test_seen_from_a_hub_that_cannot_be_pushed_the_modes_are_the_clamped_ones():
    heavy = Hub(mass=1e12, port=np.array([0.5, 0.0, 0.0]))
    frequency, damping, rows = as_seen(heavy, BOOM.kept(6))
    assert np.allclose(frequency, BOOM.frequency[:6], rtol=1e-9)
    assert np.allclose(damping, 0.005, rtol=1e-9)
    about_centre = (
        BOOM.participation[3:, :6] + np.cross([0.5, 0, 0], BOOM.participation[:3, :6].T).T
    )
    assert np.allclose(np.abs(rows), np.abs(about_centre), atol=1e-8)


@pytest.mark.slow
def test_the_bound_on_the_variance_shrinks_with_the_root_of_the_samples():
    pair = wings(5.0, 1.0, 200.0, 350.0, 50.0, 0.05)
    pair = pair.kept(np.flatnonzero(pair.participation[5])[:1])
    bound = [
        cramer_rao(Hub(), pair, time, {"z": steps_at(time, dwell=4.0)}, 1e-5)
        for time in (np.arange(0.0, 100.0, 0.02), np.arange(0.0, 100.0, 0.005))
    ]
    assert np.allclose(bound[0] / bound[1], 2.0, rtol=0.05)


def test_the_gyro():
    time = np.arange(0.0, 50.0, 0.1)
    exact = record(HUB, BOOM, time, {"z": steps_at(time)})["rate_z"]
    read = record(HUB, BOOM, time, {"z": steps_at(time)}, Gyro(1e-4, 1e-3, 5e-5, 0.01), 3)["rate_z"]
    assert np.abs(read / 5e-5 - np.round(read / 5e-5)).max() < 1e-6
    assert np.abs(read).max() <= 0.01
    assert abs(np.mean(read - np.clip(exact + 1e-3, -0.01, 0.01))) < 5e-5
