"""Closed forms beside bounds over intervals: the loop there, parts of ranges, what is halved."""

from time import perf_counter
from types import SimpleNamespace

import control
import numpy as np
import pytest

import beamchain as bc
from beamchain.robust.bounds import FEWER, FIRST, MANY, Bounder, Box, GainBound, Interval
from beamchain.robust.multipliers import ComplexSystem, Multipliers
from complex_systems import complex_system, gains_of, hermitian, value
from robust_doors import (
    LocalLoop,
    UncertainLoop,
    extended_multipliers,
    halves_of_box,
    in_box,
    is_narrow,
    local_loop,
    looked_at,
    middle_of,
    unknown_behind,
)

D, G = hermitian(1, 2), hermitian(2, 2)


# -- the loop over an interval ---------------------------------------------------------------------
RANDOM = np.random.default_rng(21)
PLANT = (
    np.array([[0, 1, 0, 0], [-4, -1.3, 0.1, 0], [0, 0, 0, 1], [0.2, 0, -9, -1.5]], dtype=float),
    RANDOM.normal(size=(4, 4)),
    RANDOM.normal(size=(4, 4)),
    0.1 * RANDOM.normal(size=(4, 4)),
)
# and an output that no loop measures
PLANT = PLANT[0], PLANT[1], np.vstack([PLANT[2], np.ones(4)]), np.vstack([PLANT[3], np.zeros(4)])


def law(delays):
    """Two weak loops."""
    return bc.spec.Controller(
        loop=tuple(
            bc.spec.Loop(
                input=u, output=y, numerator=[0.1, 0.2], denominator=[1.0, 2.0], delay=delay
            )
            for u, y, delay in zip(("u", "v"), ("x", "y"), delays, strict=True)
        )
    )


def loops_of(delays, offset=0.0):
    return UncertainLoop(
        PLANT, [0, 1], ["u", "v"], ["x", "y", "z"], law(delays), ("v", "x"), offset=offset
    )


def nominal_loop(w, delays, offset=0.0):
    """N by its linear equations: y = P [w, u], u = d - K y, e = y_x."""
    p = value(PLANT, w)[:4]
    k = [(0.1j * w + 0.2) / (1j * w + 2.0) * np.exp(-1j * w * delay) for delay in delays]
    k = np.diag(k)
    closed = np.linalg.inv(np.eye(2) + p[2:, 2:] @ k)  # y = closed (P_yw w + P_yu d)
    driven = p[:, [0, 1, 3]]
    measured = closed @ driven[2:]
    whole = driven - p[:, 2:] @ k @ measured
    out = whole[[0, 1, 2]]
    out[2, 2] += offset
    return out


@pytest.mark.parametrize("delays", [(0.0, 0.0), (0.3, 0.0), (0.2, 0.7)])
def test_the_closed_loop_of_the_deltas(delays):
    found = loops_of(delays, 0.25).exact(np.array([0.4, 2.5]))
    for k, w in enumerate((0.4, 2.5)):
        np.testing.assert_allclose(found[k], nominal_loop(w, delays, 0.25), rtol=1e-10)


@pytest.mark.parametrize("delays", [(0.0, 0.0), (0.0, 0.9), (0.8, 0.5)])
def test_errors_of_dead_times_make_the_loop_over_an_interval_exact(delays):
    """exp(-s T) is the expansion about the middle plus error times eps, |eps| at most 1."""
    low, high = 0.5, 4.9
    loop = local_loop(loops_of(delays, 0.25), low, high)
    late = [delay for delay in delays if delay]
    assert loop.errors.size == len(late)
    count = 2 + len(late)
    top, bottom = control.pade(1.0, 4)
    for w in (1.0, 1.9, 4.8):
        n = loop.system.at(np.array([w]))[0]
        eps = []
        for delay, error in zip(late, loop.errors, strict=True):
            x = 1j * (w - 2.7) * delay
            expansion = np.exp(-2.7j * delay) * np.polyval(top, x) / np.polyval(bottom, x)
            eps.append((np.exp(-1j * w * delay) - expansion) / error)
        assert np.all(np.abs(eps) <= 1.0 + 1e-3)
        keep = [0, 1, count]
        inner = n[2:count, 2:count] * np.array(eps)[None]
        across = np.linalg.solve(np.eye(len(late)) - inner, n[2:count][:, keep])
        found = n[np.ix_(keep, keep)] + n[keep][:, 2:count] * np.array(eps) @ across
        np.testing.assert_allclose(found, nominal_loop(w, delays, 0.25), rtol=1e-9)


def test_a_part_of_the_ranges_is_a_loop_of_its_own():
    """Deltas centre + half d, one of them twice, an error that stays as it is."""
    system = complex_system(3, 5, 31)
    loop = LocalLoop(system, [1, 0, 1], np.array([0.1]))
    centre, half = np.array([0.3, -0.2]), np.array([0.5, 0.25])
    d, eps = np.array([-0.6, 0.9]), 0.4 - 0.2j
    part = in_box(loop, centre, half)
    for w in (0.3, 2.0):
        whole = gains_of(value(system, w), np.append((centre + half * d)[[1, 0, 1]], eps))
        assert gains_of(value(part, w), np.append(d[[1, 0, 1]], eps)) == pytest.approx(whole)


def test_channels_that_programs_need_not_know_stand_behind():
    system = complex_system(2, 6, 3)
    found = unknown_behind(system, 2, np.array([False, True, False]))
    order = [0, 1, 3, 2, 4, 5]
    np.testing.assert_allclose(found.d, system.d[np.ix_(order, order)])
    np.testing.assert_allclose(found.b, system.b[:, order])
    np.testing.assert_allclose(found.c, system.c[order])
    wider = extended_multipliers(Multipliers(D, G), 4)
    np.testing.assert_allclose(wider.d[:2, :2], D)
    np.testing.assert_allclose(wider.d[2:], [[0, 0, 1, 0], [0, 0, 0, 1]])
    np.testing.assert_allclose(wider.g[:2, :2], G)
    assert np.abs(wider.g).sum() == pytest.approx(np.abs(G).sum())


# -- intervals -------------------------------------------------------------------------------------
def box(gain=1.0, floor=0.5, split=0, centre=(0.0, 0.0), half=(1.0, 1.0)):
    return Box(np.array(centre), np.array(half), gain, floor, split, np.zeros(2))


def test_boxes_and_intervals_are_halved():
    left, right = halves_of_box(box(split=1, centre=(0.2, -0.1), half=(0.8, 0.4)))
    np.testing.assert_allclose(left, [[0.2, -0.3], [0.8, 0.2]])
    np.testing.assert_allclose(right, [[0.2, 0.1], [0.8, 0.2]])
    assert middle_of(2.0, 8.0) == pytest.approx(4.0)
    assert middle_of(0.05, 0.8) == pytest.approx(0.2)
    assert middle_of(0.0, 8.0) == 4.0
    assert middle_of(3.0, np.inf) == 6.0
    assert is_narrow(Interval(2.0, 2.0 * 1.0009, ()))
    assert not is_narrow(Interval(2.0, 2.0 * 1.0011, ()))
    assert Interval(0.0, 1.0, (box(2.0), box(3.0), box(1.0))).gain == 3.0


def bounder(omega, sampled, best=1.0, late=False, repetitions=(1, 1)):
    made = Bounder.__new__(Bounder)
    made._omega, made._sampled = np.array(omega), np.array(sampled)
    made._repetitions, made.best = list(repetitions), (np.zeros(2), best)
    made._blocks = [SimpleNamespace(name=name) for name in "ab"]
    made._end = -np.inf if late else np.inf
    return made


def test_the_best_sample_and_the_most_that_samples_reach():
    pytest.importorskip("cvxpy")
    gains = {1.0: [0.3, 0.9, 0.2], -1.0: [0.8, 0.1, 0.4], 0.5: [0.1, 0.2, 0.6]}
    loops = SimpleNamespace(
        exact=lambda omega: np.arange(omega.size),
        size=lambda at, deltas: np.array(gains[deltas[0]])[at],
    )
    blocks = [SimpleNamespace(name="a", repetitions=3)]
    samples = np.array([[0.5], [-1.0], [1.0]])
    made = Bounder(loops, blocks, samples, np.array([1.0, 2.0, 3.0]), 60.0)
    assert made._sampled.tolist() == [0.8, 0.9, 0.6]
    assert (made.best[0].tolist(), made.best[1]) == ([1.0], 0.9)
    assert not made._late
    assert made.programs == 0
    assert Bounder(loops, blocks, samples, np.array([1.0, 2.0, 3.0]), 0.0)._late


def test_samples_inside_an_interval_or_beside_it():
    made = bounder([1.0, 2.0, 3.0, 4.0], [5.0, 7.0, 6.0, 1.0])
    assert made._peak(1.0, 3.0) == (2.0, 7.0)
    assert made._peak(2.1, 2.9) == (2.0, 7.0)
    assert made._peak(2.6, 2.9) == (3.0, 6.0)
    assert made._peak(0.0, 0.5) == (1.0, 5.0)
    assert made._peak(3.6, np.inf) == (4.0, 1.0)
    assert bounder([0.01, 2.0], [5.0, 7.0])._peak(0.05, 1.9) == (0.01, 5.0)


@pytest.mark.parametrize(
    ("gains", "wanted"),
    [
        ((1.01, 2.0, 1.01), 1),  # above the largest gain found
        ((3.0, 2.0, 1.01), 0),
        ((1.01, 1.01, 1.01), 2),  # 1.01 above its samples, 0.8
        ((1.01, 1.01, 0.99), None),
        ((1.03, 1.01, 0.99), 0),
        ((np.inf, 2.0, 1.01), 0),
    ],
)
def test_the_interval_that_is_refined_next(gains, wanted):
    """Of 1.02 of the largest gain, and 1.25 of what samples reach there."""
    for unit in (1e-3, 1.0, 7.0):
        made = bounder([0.5, 1.5, 2.5], unit * np.array([1.0, 1.0, 0.8]), best=unit)
        intervals = [Interval(k, k + 1.0, (box(unit * gain),)) for k, gain in enumerate(gains)]
        assert made._next(intervals) == wanted
    spent = [one._replace(low=one.high / 1.0005, boxes=one.boxes * 32) for one in intervals]
    assert made._next(spent) is None


@pytest.mark.parametrize(
    ("floor", "high", "may_halve", "parts"),
    [
        (2.6, 3.0, True, 2),  # half of what is missing, 4 less 1, is missing in the program
        (2.4, 3.0, True, 1),
        (2.4, 3.0, False, 2),
        (2.4, 2.001, True, 2),
        (np.inf, 2.1, True, 2),
        (np.inf, 2.3, True, 1),
    ],
)
def test_an_interval_is_halved_in_frequency_or_in_a_range(floor, high, may_halve, parts):
    made = bounder([2.0, 3.0], [1.0, 1.0])
    asked = []

    def interval(low, high, several):
        asked.append((low, high, len(several)))
        return Interval(low, high, tuple(box(9.0) for _ in several))

    made._interval = interval
    given = Interval(2.0, high, (box(3.0, 1.0), box(4.0, floor), box(2.0, 1.0)))
    found = made._refined(given, may_halve)
    if parts == 2:
        assert asked == [(2.0, high, 2)]
        assert [one.gain for one in found[0].boxes] == [3.0, 9.0, 9.0, 2.0]
    else:
        middle = np.sqrt(2.0 * high)
        np.testing.assert_allclose(asked, [(2.0, middle, 3), (middle, high, 3)])
        assert len(found) == 2


@pytest.mark.parametrize(
    ("low", "high", "centre", "half"), [(0.5, 1.5, 0.0, 1.0), (1.2, np.inf, 0.4, 0.3)]
)
def test_a_program_and_its_proof_bound_the_gain_in_a_part_of_the_range(low, high, centre, half):
    """x'' + 0.4 x' + (2 + 0.8 delta) x = d."""
    pytest.importorskip("cvxpy")
    b, c = np.array([[0, 0], [-1.0, 1.0]]), np.array([[0.8, 0], [1.0, 0]])
    system = ComplexSystem(
        np.array([[0, 1.0], [-2.0, -0.4]]) + 0j, b + 0j, c + 0j, np.zeros((2, 2), complex)
    )
    loop = LocalLoop(system, [0], np.zeros(0))
    omega = np.linspace(low, high if np.isfinite(high) else 12.0, 200)
    stiffness = 2.0 + 0.8 * (centre + half * np.linspace(-1.0, 1.0, 101))
    gains = 1.0 / np.abs(stiffness[:, None] - omega**2 + 0.4j * omega)
    nominal = 1.0 / np.abs(2.0 - omega**2 + 0.4j * omega)
    made = bounder(omega, nominal, repetitions=(1,))
    made.programs = 0
    found = made._box(loop, low, high, np.array([centre]), np.array([half]))
    assert gains.max() * (1.0 - 1e-6) <= found.gain <= 1.03 * gains.max()
    assert found.floor == pytest.approx(found.gain, rel=0.03)
    worst = centre + half * np.linspace(-1.0, 1.0, 101)[gains.max(axis=1).argmax()]
    assert found.likely[0] == pytest.approx(worst, abs=0.15)
    assert found.split == 0
    assert 1 <= made.programs <= 3
    made._end = -np.inf
    late = made._box(loop, low, high, np.array([centre]), np.array([half]))
    assert (late.gain, late.floor, late.likely.tolist()) == (np.inf, np.inf, [centre])


def test_what_is_doubtful_where_there_is_no_bound():
    made = bounder([1.0], [1.0], repetitions=(2, 1))
    boxes = [box(np.inf, split=1), box(1.0, split=0), box(np.inf, split=1), box(np.inf, split=0)]
    intervals = [Interval(0.0, 1.0, tuple(boxes[:2])), Interval(1.0, 2.0, tuple(boxes[2:]))]
    assert made._doubtful_names(intervals) == ["b", "a"]
    n = np.diag([0.5, -0.7, 0.6, 9.0]).astype(complex)
    constant = ComplexSystem(np.zeros((0, 0), complex), np.zeros((0, 4)), np.zeros((4, 0)), n)
    assert made._doubtful(constant, np.array([1.0])) == 0
    n[2, 2] = 0.8j
    assert made._doubtful(constant, np.array([1.0])) == 1


def test_frequencies_at_which_samples_are_looked_at():
    loops = SimpleNamespace(
        plant=(np.array([[0.0, 30.0], [-30.0, 0.0]]),), poles=np.array([-0.5, -3.0 + 4.0j])
    )
    found = looked_at(loops, np.array([0.2, 5.0]))
    np.testing.assert_allclose(
        found, np.union1d([0.2, 5.0], np.geomspace(0.05, 60.0, 600)), rtol=1e-12
    )
    wide = looked_at(loops, np.array([0.01, 1.0, 90.0]))
    assert (wide[0], wide[-1]) == pytest.approx((0.01, 90.0))
    assert np.sum(wide < 0.02) > 9
    assert np.sum(wide > 80.0) > 5


@pytest.mark.parametrize(("repetitions", "count"), [((1, 1), FIRST), ((MANY, 1), FEWER)])
def test_the_first_intervals_are_even_between_the_ends_of_interest(repetitions, count):
    """By logarithm, with one to either side; where samples reach the most goes first."""
    made = bounder([0.5, 1.0, 3.0, 8.0], [1.0, 3.0, 1.0, 2.0], late=True, repetitions=repetitions)
    made._start, made.programs, asked = perf_counter() - 9.0, 0, []

    def interval(low, high, parts):
        asked.append((low, high))
        ((centre, half),) = parts
        assert (centre.tolist(), half.tolist()) == ([0.0, 0.0], [1.0, 1.0])
        return Interval(low, high, (box(low + 1.0),))

    made._interval = interval
    found = made.bound()
    inner = 0.5 * 16.0 ** (np.arange(count - 1) / (count - 2.0))
    assert found.edges == pytest.approx([0.0, *inner, np.inf])
    assert found.gains == pytest.approx(1.0 + found.edges[:-1])
    assert 0.7 < asked[0][0] < 2.0  # nearest to 1 rad/s
    assert (found.late, set(found.boxes)) == (True, {1})
    assert 9.0 <= found.seconds < 60.0


def test_what_is_refined_stands_in_place_of_what_it_was(monkeypatch):
    """Halved while there are fewer than the most intervals, here 25."""
    monkeypatch.setattr("beamchain.robust.bounds.MOST", FEWER + 1)
    made = bounder([0.5, 1.0, 8.0], [1.0, 3.0, 2.0], repetitions=(MANY, 1))
    made._start, made.programs, halved = perf_counter(), 0, []
    made._interval = lambda low, high, parts: Interval(low, high, (box(2.0),))
    made._next = lambda intervals: 3 if len(halved) < 2 else None

    def refined(interval, may_halve):
        halved.append(may_halve)
        middle = middle_of(interval.low, interval.high)
        return [
            Interval(interval.low, middle, (box(5.0),)),
            Interval(middle, interval.high, (box(7.0), box(6.0))),
        ]

    made._refined = refined
    found = made.bound()
    assert halved == [True, False]
    ends = 0.5 * 16.0 ** (np.arange(FEWER - 1) / (FEWER - 2.0))
    quarter = ends[2] * (ends[3] / ends[2]) ** 0.25
    half = ends[2] * (ends[3] / ends[2]) ** 0.5
    wanted = [0.0, *ends[:3], quarter, half, *ends[3:], np.inf]
    assert found.edges == pytest.approx(wanted)
    assert found.gains.tolist() == [2.0] * 3 + [5.0, 7.0, 7.0] + [2.0] * (FEWER - 4)
    assert found.boxes == (1,) * 4 + (2, 2) + (1,) * (FEWER - 4)


def test_a_bound_in_words():
    edges, gains = np.array([0.0, 1.0, 2.0, 4.0]), np.array([2.0, np.inf, 3.0])
    made = GainBound(edges, gains, gains, (1, 3, 2), ("a", "b", "c", "d"), False, 7, 2.0)
    assert not made.stable
    assert made.frequency == (1.0, 2.0)
    assert "no bound in 1 of 3 intervals, between 1 and 2 rad/s" in made.sentence
    assert "a, b, c are too wide" in made.sentence
    assert "in 3 parts" in made.sentence
    ended = GainBound(edges, np.array([2.0, 5.0, 3.0]), gains, (1, 3, 2), (), False, 7, 2.0)
    assert ended.frequency == (1.0, 2.0)
    assert ended.sentence == "at most 5 for all values (7 programs in 3 intervals, 2 s)"
    assert ended.at([0.5, 1.0, 2.0, 3.9, 4.0, 9.0]).tolist() == [2, 5, 5, 3, 3, 3]
