"""Closed forms beside margins: figures of an open loop, of all at once, and words on them."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import brentq, minimize, minimize_scalar

from beamchain.ports.peaks import Extremum
from formulas import (
    LoopOfMargins,
    balanced_bounds,
    long_delays,
    margin_figures,
    margins_of_all,
    power_sum,
    refined_bounds,
    structured_bound,
)

GRID, COARSE = np.geomspace(1e-2, 1e2, 400), np.geomspace(0.1, 10.0, 5)


def closed_of(loop, omega=GRID, limit=None, step=0.0, axis=(), stable=True):
    """A closed loop of which nothing but the open loop `(s) -> (k, n, n)` is known."""
    size = loop(np.array([1.2345j])).shape[-1]
    return SimpleNamespace(
        omega=omega,
        open_loop=lambda w: loop(1j * w),
        inputs=tuple("abc"[:size]),
        limit=limit,
        step=step,
        held=None,
        stable=stable,
        undamped=lambda w: any(abs(w - pole) < 1e-3 * pole for pole in axis),
    )


def figures(closed, i=0):
    s = np.linalg.inv(np.eye(len(closed.inputs)) + closed.open_loop(closed.omega))
    return margin_figures(closed, i, 1.0 / s[:, i, i] - 1.0)


def alone(function):
    return lambda s: function(s)[:, None, None]


def two_loops(s):
    first = 30.0 * (s + 1.0) ** 2 / s**3 / (0.02 * s + 1.0) ** 2
    second = 4.0 / (s * (0.1 * s + 1.0) * (0.05 * s + 1.0))
    across = 0.7 / (s + 2.0), -1.1 * (s + 3.0) / (s**2 + s + 9.0)
    return np.moveaxis(np.array([[first, across[0]], [across[1], second]]), 2, 0)


def zeros(function, w):
    values = function(w)
    at = np.flatnonzero(values[1:] * values[:-1] < 0.0)
    return [brentq(lambda x: function(np.array([x]))[0], w[k], w[k + 1], xtol=1e-13) for k in at]


@pytest.mark.parametrize("i", [0, 1])
def test_figures_of_a_loop_that_another_couples_to(i):
    """L_i = L_ii - L_ij L_ji / (1 + L_jj)."""
    j = 1 - i

    def of(w):
        loop = two_loops(1j * np.atleast_1d(w))
        return loop[:, i, i] - loop[:, i, j] * loop[:, j, i] / (1.0 + loop[:, j, j])

    fine = np.geomspace(1e-2, 1e2, 20_000)
    found = figures(closed_of(two_loops), i)
    real = [(-1.0 / of(w)[0].real, w) for w in zeros(lambda w: of(w).imag, fine)]
    factors = [one for one in real if one[0] > 0.0]
    gain = min(one for one in factors if one[0] > 1.0)
    assert found.gain == pytest.approx(gain, rel=1e-8)
    lower = [one for one in factors if one[0] < 1.0]
    if lower:
        assert found.lowest == pytest.approx(max(lower), rel=1e-8)
    else:
        assert found.lowest == (0.0, np.inf)
    assert bool(lower) == (i == 0)
    phases = [
        (np.degrees(np.angle(-of(w)[0])), w) for w in zeros(lambda w: np.abs(of(w)) - 1.0, fine)
    ]
    assert found.phase == pytest.approx(min(phases, key=lambda one: abs(one[0])), rel=1e-8)
    assert found.delay == pytest.approx(min(np.radians(p % 360.0) / w for p, w in phases), rel=1e-8)

    def least(function):
        at = fine[np.argmin(function(fine))]
        best = minimize_scalar(
            lambda w: function(w)[0], bounds=(at / 1.01, at * 1.01), options={"xatol": 1e-10}
        )
        return best.fun, best.x

    assert found.modulus == pytest.approx(least(lambda w: np.abs(1.0 + of(w))), rel=1e-6)
    disk = least(lambda w: 2.0 * np.abs((1.0 + of(w)) / (1.0 - of(w))))
    assert found.disk == pytest.approx(disk, rel=1e-6)


@pytest.mark.parametrize(
    ("falling", "value", "gain"),
    [
        (-0.3, 0.8, np.inf),
        (0.3, 0.4, np.inf),
        (0.3, 0.05, np.inf),
        (0.3, -0.4, 2.5),
        (-0.3, -0.4, 1.0 / 0.7),
    ],
)
def test_limits_at_infinite_frequency(falling, value, gain):
    """L = falling / (s + 1) + value: at infinity it is the value."""
    closed = closed_of(alone(lambda s: falling / (s + 1.0) + value), limit=np.array([[value]]))
    found = figures(closed)
    assert found.gain == pytest.approx((gain, 0.0 if falling + value < value < 0.0 else np.inf))
    assert (found.lowest.value, found.delay) == (0.0, np.inf)
    ends = np.array([falling + value, value])
    assert found.modulus.value == pytest.approx(min(1.0 + ends), rel=1e-3)
    assert (found.modulus.frequency == np.inf) == (falling > 0.0)
    sizes = abs((1.0 - ends) / (1.0 + ends))
    assert found.disk.value == pytest.approx(2.0 / max(sizes), rel=1e-3)
    assert (found.disk.frequency == np.inf) == (sizes[1] > sizes[0])


@pytest.mark.parametrize(
    ("value", "lowest", "delay"),
    [(-1.6, 1.0 / 1.59, 0.0), (1.6, 0.0, 0.0), (-0.9, 0.0, np.inf), (1.0, 0.0, 0.0)],
)
def test_direct_parts_of_size_one_bear_no_dead_time(value, lowest, delay):
    closed = closed_of(alone(lambda s: value + 0.01 / (s + 1.0)), limit=np.array([[value]]))
    found = figures(closed)
    assert found.lowest.value == pytest.approx(lowest)
    assert found.delay == delay


def test_of_several_crossings_those_next_to_one_count():
    """A response of which the imaginary part changes its sign at 1, 2, ..., 5 of the grid."""
    omega = np.arange(0.5, 6.0)
    real = {1.0: -4.0, 2.0: -2.5, 3.0: -0.5, 4.0: -0.2, 5.0: 0.9}

    def at(s):
        w = s.imag
        value = np.interp(w, list(real), list(real.values()))
        return value + 1j * np.sin(np.pi * w) * 0.1

    found = figures(closed_of(alone(at), omega))
    assert found.gain == pytest.approx((2.0, 3.0))
    assert found.lowest == pytest.approx((0.4, 2.0))


@pytest.mark.parametrize("falls", [True, False])
def test_a_response_that_is_negative_on_one_side_of_its_crossing_alone(falls):
    """0.3 and -0.9 at the points of the grid, -0.3 between them."""
    ends = [0.3, -0.9] if falls else [-0.9, 0.3]

    def at(s):
        return np.interp(s.imag, [0.5, 1.5], ends) + 0.1j * np.cos(np.pi * s.imag / 2.0)

    found = figures(closed_of(alone(at), np.array([0.5, 1.5])))
    assert found.gain == pytest.approx((1.0 / 0.3, 1.0))


@pytest.mark.parametrize("size", [8e-6, 8e4])
def test_loops_of_any_size_cross_the_phase(size):
    """k / (s + 1)^3 is -k / 8 at sqrt(3)."""
    found = figures(closed_of(alone(lambda s: size / (s + 1.0) ** 3)))
    limit = found.gain if size < 8.0 else found.lowest
    assert limit == pytest.approx((8.0 / size, np.sqrt(3.0)), rel=1e-8)


def test_a_factor_just_above_one_limits_the_gain_and_not_its_fall():
    omega = np.arange(0.5, 4.0)
    real = {1.0: -1.0 / 0.4, 2.0: -1.0 / 1.05, 3.0: -0.1}

    def at(s):
        value = np.interp(s.imag, list(real), list(real.values()))
        return value + 0.1j * np.sin(np.pi * s.imag)

    found = figures(closed_of(alone(at), omega))
    assert found.gain == pytest.approx((1.05, 2.0))
    assert found.lowest == pytest.approx((0.4, 1.0))


@pytest.mark.parametrize("lacks", [40.0, -40.0])
def test_a_phase_that_may_rise_is_reached_by_a_dead_time_most_of_a_turn_later(lacks):
    """Of the size one at 2 rad/s alone."""
    loop = alone(lambda s: -2.0 / s.imag * np.exp(1j * np.radians(lacks)))
    found = figures(closed_of(loop))
    assert found.phase == pytest.approx((lacks, 2.0))
    assert found.delay == pytest.approx(np.radians(lacks % 360.0) / 2.0)


def test_an_undamped_pole_is_passed_through_infinity_and_a_zero_through_nothing():
    """(s^2 + 4) / (s^2 + 1) under a lag that puts both in the left half plane."""
    loop = alone(lambda s: 3.0 * (s**2 + 4.0) / (s**2 + 1.0) / (0.1 * s + 1.0) ** 2)
    found = figures(closed_of(loop, axis=(1.0,)))
    assert not found.gain.value < 10.0  # neither the pole at 1 nor the zero at 2
    assert found.lowest.value == 0.0


@pytest.mark.parametrize(("size", "limited"), [(0.5, True), (-0.5, False)])
def test_responses_at_rest_that_are_real_limit_the_gain(size, limited):
    loop = alone(lambda s: -size / (s + 1.0))
    found = figures(closed_of(loop))
    assert found.gain == (pytest.approx((2.0, 0.0)) if limited else (np.inf, np.inf))
    # an integrator is not at rest: its size still grows, and it is imaginary
    for order, sign in ((1, -1.0), (2, -1.0), (2, 1.0)):
        size = 0.01 * sign
        rising = figures(closed_of(alone(lambda s, n=order, k=size: k / s**n / (s + 1.0) ** 2)))
        assert rising.lowest.frequency != 0.0
        assert rising.gain.frequency != 0.0


@pytest.mark.parametrize(("step", "value"), [(np.pi / 1e2, -0.25), (np.pi / 1.1e2, -0.25)])
def test_the_last_of_a_sampled_loop_is_real(step, value):
    """At pi / T, if the grid goes so far."""
    loop = alone(lambda s: value + 0.0 * s)
    found = figures(closed_of(loop, step=step))
    ends = closed_of(alone(lambda s: np.where(s.imag > 99.0, value, 0.1j)), step=step)
    assert found.gain.value == pytest.approx(4.0)
    last = figures(ends).gain
    assert last == (pytest.approx((4.0, 1e2)) if step > np.pi / 1.05e2 else (np.inf, np.inf))


# -- all at once -----------------------------------------------------------------------------------
@pytest.fixture
def quickly(monkeypatch):
    monkeypatch.setattr("beamchain.ports.peaks.POLISHED", 1)
    monkeypatch.setattr("beamchain.control.mu.SHARPER", (64.0, 4096.0))


@pytest.mark.usefixtures("quickly")
def test_peaks_of_all_loops_and_the_disk_of_all_at_once():
    """mu of two channels is the least norm of D M D^-1 over one scale."""
    grid = np.geomspace(0.3, 60.0, 50)
    found = margins_of_all(
        closed_of(two_loops, grid), np.linalg.inv(np.eye(2) + two_loops(1j * grid))
    )

    def s_at(w):
        return np.linalg.inv(np.eye(2) + two_loops(1j * np.array([w])))[0]

    def mu(m):
        def norm(log):
            d = np.array([1.0, np.exp(log)])
            return np.linalg.norm(m * d[:, None] / d, 2)

        return minimize_scalar(norm, bounds=(-12.0, 12.0), options={"xatol": 1e-9}).fun

    sizes = (
        lambda w: 1.0 / mu(s_at(w) - np.eye(2) / 2.0),
        lambda w: np.linalg.norm(s_at(w), 2),
        lambda w: np.linalg.norm(np.eye(2) - s_at(w), 2),
    )
    for one, size, sign in zip(found, sizes, (1.0, -1.0, -1.0), strict=True):
        assert one.value == pytest.approx(size(one.frequency), rel=1e-5)
        w = np.append(one.frequency * np.array([0.999, 1.001]), np.geomspace(0.3, 60.0, 20))
        assert min(sign * size(x) for x in w) >= sign * one.value * (1.0 + 1e-6 * sign) - 1e-5
    assert all(np.isnan(one.value) for one in margins_of_all(closed_of(two_loops, stable=False), 0))


@pytest.mark.usefixtures("quickly")
def test_with_direct_parts_infinite_frequency_counts():
    """K G at infinity is larger than anywhere else: S and T are those of the limit."""
    limit = np.array([[-0.5, 0.2], [0.3, -0.4]])
    closed = closed_of(lambda s: limit * (s / (s + 1.0))[:, None, None], COARSE, limit=limit)
    at_all, s, t = margins_of_all(closed, np.linalg.inv(np.eye(2) + closed.open_loop(COARSE)))
    inverse = np.linalg.inv(np.eye(2) + limit)
    assert s == pytest.approx((np.linalg.norm(inverse, 2), np.inf))
    assert t == pytest.approx((np.linalg.norm(np.eye(2) - inverse, 2), np.inf))
    middle = inverse - np.eye(2) / 2.0
    norms = []
    for d in np.geomspace(0.5, 2.0, 401):
        norms.append(np.linalg.norm(middle * np.array([[1.0], [d]]) / np.array([1.0, d]), 2))
    assert at_all == pytest.approx((1.0 / min(norms), np.inf), rel=1e-5)


def test_bounds_are_refined_from_the_highest_down_until_nothing_matters():
    """Of rank one, mu is the sum of the diagonal's sizes."""
    exact = np.array([2.0, 5.0, 1.0, 4.9])
    u = np.array([1.0, 0.5j])
    matrices = np.array([size * np.outer(u, 1.0 / u) / 2.0 for size in exact])
    found = refined_bounds(matrices, np.array([2.1, 5.5, 1.5, 6.0]))
    assert found == pytest.approx([2.1, 5.0, 1.5, 4.9], rel=1e-5)


# -- scaling ---------------------------------------------------------------------------------------
RANDOM = np.random.default_rng(23)


def of_rank_one(size):
    """u v^T: its mu for one complex number per channel is the sum of |u_i v_i|."""
    u, v = RANDOM.normal(size=(2, size, 2)) @ [1.0, 1.0j]
    return np.outer(u, v), float(np.sum(np.abs(u * v)))


def test_bounds_of_matrices_of_rank_one_are_their_mu():
    """Of unit size, large, small, and of one channel."""
    for size in (1, 2, 3):
        matrix, mu = of_rank_one(size)
        for scale in (1.0, 1e3, 1e-9):
            assert structured_bound(scale * matrix) == pytest.approx(scale * mu, rel=2e-5)
    assert structured_bound(np.zeros((2, 2)) + 0j) == 0.0


def test_quick_bounds_make_rows_as_long_as_columns():
    """Off the diagonal, of D M D^-1; of two channels d^2 = |m_01| / |m_10|."""
    m = RANDOM.normal(size=(4, 2, 2)) + 1j * RANDOM.normal(size=(4, 2, 2))
    m[1, 0, 1], m[2, 1, 0], m[3] = 40.0, 1e-4, np.diag([3.0, -7.0j])
    wanted = []
    for one in m[:3]:
        d = np.array([1.0, np.sqrt(abs(one[0, 1] / one[1, 0]))])
        wanted.append(np.linalg.norm(one * d[:, None] / d, 2))
    np.testing.assert_allclose(balanced_bounds(m), [*wanted, 7.0], rtol=1e-6)
    three = RANDOM.normal(size=(1, 3, 3)) + 0j
    scale = np.array([1.0, 50.0, 0.3])
    assert balanced_bounds(three * scale[:, None] / scale) == pytest.approx(balanced_bounds(three))
    off = np.abs(three[0]) ** 2 * (1.0 - np.eye(3))
    logs = minimize(
        lambda x: np.sum(off * np.exp(2.0 * np.subtract.outer(np.append(0.0, x), [0.0, *x]))),
        np.zeros(2),
        tol=1e-12,
    ).x  # rows and columns are alike where the sum of squares is least
    d = np.exp(np.append(0.0, logs))
    norm = np.linalg.norm(three[0] * d[:, None] / d, 2)
    assert balanced_bounds(three)[0] == pytest.approx(norm, rel=1e-5)
    assert balanced_bounds(np.array([[[3.0 - 4.0j]]])) == pytest.approx([5.0])


def test_the_sum_of_powers_and_its_slope():
    m = RANDOM.normal(size=(3, 3)) + 1j * RANDOM.normal(size=(3, 3))

    def wanted(logs, exponent):
        d = np.exp(np.append(0.0, logs))
        sizes = np.linalg.svd(m * d[:, None] / d, compute_uv=False)
        return np.log(np.sum(sizes**exponent)) / exponent

    at, h = np.array([0.3, -0.8]), 1e-6
    for exponent in (2.0, 5.0):
        value, slope = power_sum(at, m, exponent)
        assert value == pytest.approx(wanted(at, exponent), rel=1e-12)
        for k, e in enumerate(h * np.eye(2)):
            difference = (wanted(at + e, exponent) - wanted(at - e, exponent)) / (2.0 * h)
            assert slope[k] == pytest.approx(difference, rel=1e-6)


# -- words -----------------------------------------------------------------------------------------
@pytest.mark.parametrize(("delay", "told"), [(1.3, True), (1.2, False)])
def test_a_dead_time_is_long_beside_the_period_of_the_first_crossover(delay, told):
    """The size passes one first before 5 rad/s: a period of 1.257 s."""
    omega = np.array([1.0, 2.0, 5.0, 9.0, 20.0])
    loop = np.zeros((5, 2, 2))
    loop[:, 0, 0], loop[:, 1, 1] = 0.9, [3.0, 1.1, 0.9, 1.2, 0.3]
    closed = SimpleNamespace(
        inputs=("a", "b"), omega=omega, fed=SimpleNamespace(delays=(50.0, delay))
    )
    found = long_delays(closed, loop.astype(complex))
    assert len(found) == told
    if told:
        assert found[0].startswith("b: delay = 1.3 s")
        assert "(1.26 s, at 5 rad/s)" in found[0]


def test_figures_in_decibels_and_those_that_are_limited():
    nan = np.nan
    loop = LoopOfMargins(
        "torque", ("one", "two"), True, False, 10.0, 3.0, 0.0, np.inf, -40.0, 5.0, 0.2, 0.6, 0.0,
        1.1, 7.0, np.array([1.0]), np.array([1.0j]),
    )  # fmt: skip
    assert loop.name == "torque from one + two"
    assert loop.gain_db == pytest.approx(20.0)
    assert loop.lowest_gain_db == -np.inf
    assert loop.limited == {"gain": 3.0, "phase": 5.0, "disk": 7.0}
    record = loop.as_dict()
    assert record["lowest_gain_db"] is None
    assert record["disk"] == 1.1
    assert Extremum(nan, nan).value != 0.0
