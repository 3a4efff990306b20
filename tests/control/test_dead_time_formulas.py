"""Closed forms beside dead times between the samples of a loop."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from beamchain.control.closed_loop import ClosedLoop
from beamchain.control.feedback import Feedback
from formulas import (
    SizeOneCrossings,
    crossings_between,
    crossings_of_size_one,
    loop_by_state,
    polished_delay,
    sampled_delay_margin,
    states_driven_for,
)


def value(of, s):
    a, b, c, d = of
    s = np.atleast_1d(s)[:, None, None]
    return c @ np.linalg.solve(s * np.eye(len(a)) - a, np.broadcast_to(b, (len(s), *b.shape))) + d


def closed_loop(plant, law, *, step):
    """One gain or several around a sampled plant."""
    every = list(range(len(law[3])))
    fed = Feedback(every, every, lambda _: law, lambda z: value(law, z), step, (0.0,) * len(every))
    names = tuple("abcdef"[: len(plant[0])])
    return ClosedLoop(plant, law, fed, ("u", "v", "w")[: len(every)], ((),), names, (), step)


STEP = 0.5
HELD = (
    np.array([[0.0, 1.0, 0.0], [-9.0, -0.4, 0.3], [0.2, 0.0, -0.8]]),
    np.array([[0.0, 0.2], [2.0, 0.5], [0.4, 1.0]]),
    np.array([[1.0, 0.1, 0.0], [0.0, 0.2, 1.0]]),
    np.array([[0.02, 0.0], [0.1, 0.05]]),
)
GAINS = np.array([[0.9, -0.2], [0.3, 0.6]])
STATIC = (np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((2, 0)), GAINS)


def held(time):
    a, b, _, _ = HELD
    whole = expm(np.block([[a, b], [np.zeros((2, 5))]]) * time)
    return whole[:3, :3], whole[:3, 3:]


def at_samples():
    return (*held(STEP), HELD[2], HELD[3])


@pytest.mark.parametrize("times", [np.array([0.2, 0.9]), np.linspace(0.0, 0.9, 4)])
def test_states_after_an_input_was_one(times):
    a, b = HELD[0], HELD[1][:, 1]
    for time, found in zip(times, states_driven_for(HELD, 1, times), strict=True):
        wanted = solve_ivp(lambda _, x: a @ x + b, (0.0, time), np.zeros(3), rtol=1e-11, atol=1e-13)
        np.testing.assert_allclose(found, wanted.y[:, -1], atol=1e-9)


@pytest.mark.parametrize("i", [0, 1])
def test_the_loop_by_the_states_that_an_input_drives(i):
    """Without a dead time it is L_i = 1 / S_ii - 1."""
    closed = closed_loop(at_samples(), STATIC, step=STEP)
    omega = np.array([0.4, 2.0, 5.5])
    left, direct, z = loop_by_state(closed, i, omega)
    np.testing.assert_allclose(z, np.exp(1j * omega * STEP))
    loop = GAINS @ value(at_samples(), z)
    wanted = 1.0 / np.linalg.inv(np.eye(2) + loop)[:, i, i] - 1.0
    np.testing.assert_allclose(left @ held(STEP)[1][:, i] + direct, wanted)


def spectral_radius(i, delay):
    """Of the samples of plant, gains and the late inputs that are still on their way."""
    whole = int(delay // STEP)
    rest = delay - whole * STEP
    a, both = held(STEP)
    now = held(STEP - rest)[1]
    _, _, c, d = HELD
    late = whole + 1  # inputs before, the youngest first
    n = 3 + late
    # u = -K y is solved for both inputs; the late one acts by what was before
    arrives = np.zeros(n)
    arrives[3 + whole] = 1.0  # in y through d, a sample later than `whole` if there is a rest
    other = 1 - i
    e = np.eye(2)
    # y = C x + d_i q + d_o u_o, u = -K y
    seen = np.zeros((2, n))
    seen[:, :3] = c
    seen += np.outer(d[:, i], arrives)
    k = np.linalg.inv(e + GAINS @ np.outer(d[:, other], e[other])) @ GAINS
    u = -k @ seen
    out = np.zeros((n, n))
    out[:3, :3] = a
    older = np.zeros(n)
    older[3 + whole] = 1.0
    newer = u[i] if whole == 0 else np.eye(n)[3 + whole - 1]
    out[:3] += np.outer(now[:, i], newer) + np.outer(both[:, i] - now[:, i], older)
    out[:3] += np.outer(both[:, other], u[other])
    out[3] = u[i]
    out[4:, 3:-1] = np.eye(late - 1)
    return np.abs(np.linalg.eigvals(out)).max()


@pytest.mark.parametrize(("i", "size"), [(0, 1.0), (1, 1.0), (1, 2.2)])
def test_the_shortest_dead_time_that_a_sampled_loop_does_not_bear(i, size, monkeypatch):
    """The late input delayed by whole samples and a rest of one, its samples' eigenvalues."""
    monkeypatch.setitem(globals(), "GAINS", size * GAINS)
    law = (*STATIC[:3], size * STATIC[3])
    closed = closed_loop(at_samples(), law, step=STEP)
    closed.__dict__["omega"] = np.linspace(0.05, np.pi / STEP, 600)
    found = sampled_delay_margin(closed, HELD, i)
    steps = np.arange(0.01, 6.0, 0.02)
    beyond = [delay for delay in steps if spectral_radius(i, delay) > 1.0 + 1e-9]
    assert found == pytest.approx(beyond[0] if beyond else np.inf, abs=0.02)
    if beyond:
        assert spectral_radius(i, found) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(
    ("w", "ratio", "push", "lead", "gain"),
    [(7.185, 0.0955, 5.123, 0.0315, 2.477), (5.918, 0.299, -7.374, -0.138, 2.021)],
)
def test_a_dead_time_at_which_samples_change_their_sign_every_time(w, ratio, push, lead, gain):
    """Through z = -1: 1 + k C (z - A)^-1 (B(T - f) + (B(T) - B(T - f)) / z) = 0."""
    a, b = np.array([[0.0, 1.0], [-(w**2), -2.0 * ratio * w]]), np.array([[0.0], [push]])
    c, d = np.array([[1.0, lead]]), np.zeros((1, 1))

    def driven(time):
        return np.linalg.solve(a, (expm(a * time) - np.eye(2)) @ b)

    def rest(delay):
        now = driven(STEP - delay)
        acting = now - (driven(STEP) - now)
        return 1.0 + gain * (c @ np.linalg.solve(-np.eye(2) - expm(a * STEP), acting))[0, 0]

    law = (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), gain * np.ones((1, 1)))
    closed = closed_loop((expm(a * STEP), driven(STEP), c, d), law, step=STEP)
    closed.__dict__["omega"] = np.linspace(0.05, np.pi / STEP, 600)
    found = sampled_delay_margin(closed, (a, b, c, d), 0)
    delays = np.linspace(0.0, STEP, 201)
    values = np.array([rest(delay) for delay in delays])
    first = int(np.flatnonzero(values[1:] * values[:-1] < 0.0)[0])
    wanted = brentq(rest, delays[first], delays[first + 1])
    assert found == pytest.approx(wanted, rel=1e-4)


@pytest.mark.parametrize(
    ("w", "ratio", "push", "lead", "gain"),
    [(6.511, 0.1991, 4.372, -0.2818, 2.209), (8.028, 0.1259, -4.111, 0.2896, 2.669)],
)
def test_samples_that_change_their_sign_from_a_whole_late_sample_on(w, ratio, push, lead, gain):
    """1 - k C (z - A)^-1 (B(T - f) + (B(T) - B(T - f)) / z) = 0 at z = -1, late by T + f."""
    a, b = np.array([[0.0, 1.0], [-(w**2), -2.0 * ratio * w]]), np.array([[0.0], [push]])
    c = np.array([[1.0, lead]])

    def driven(time):
        return np.linalg.solve(a, (expm(a * time) - np.eye(2)) @ b)

    def rest(late):
        acting = 2.0 * driven(STEP - late) - driven(STEP)
        return 1.0 - gain * (c @ np.linalg.solve(-np.eye(2) - expm(a * STEP), acting))[0, 0]

    law = (*(part[:, :1] for part in STATIC[:2]), np.zeros((1, 0)), gain * np.ones((1, 1)))
    closed = closed_loop((expm(a * STEP), driven(STEP), c, np.zeros((1, 1))), law, step=STEP)
    closed.__dict__["omega"] = np.linspace(0.05, np.pi / STEP, 300)
    found = sampled_delay_margin(closed, (a, b, c, np.zeros((1, 1))), 0)
    late = np.linspace(0.0, STEP, 101)
    values = np.array([rest(one) for one in late])
    first = int(np.flatnonzero(values[1:] * values[:-1] < 0.0)[0])
    wanted = STEP + brentq(rest, late[first], late[first + 1])
    assert found == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize(("w", "count"), [(7.0, 24 + 13), (3.0, 24 + 5), (9.0, 40)])
def test_dead_times_are_looked_at_two_dozen_to_a_turn_of_the_fastest_mode(w, count, monkeypatch):
    """And as many again, 40 at most; 24 times 3.5 rad are 13.4 turns."""
    monkeypatch.setattr("beamchain.control.delay_margin.MOST", 40)
    asked = list[np.ndarray]()

    def driven(held, i, times):
        asked.append(times)
        return states_driven_for(held, i, times)

    monkeypatch.setattr("beamchain.control.delay_margin._driven", driven)
    a, b = np.array([[0.0, 1.0], [-(w**2), 0.0]]), np.array([[0.0], [1.0]])
    c = np.array([[0.0, 0.1]])
    law = (*(part[:, :1] for part in STATIC[:2]), np.zeros((1, 0)), 0.1 * np.ones((1, 1)))
    whole = expm(np.block([[a, b], [np.zeros((1, 3))]]) * STEP)
    closed = closed_loop((whole[:2, :2], whole[:2, 2:], c, np.zeros((1, 1))), law, step=STEP)
    closed.__dict__["omega"] = np.array([0.5, 3.0])
    sampled_delay_margin(closed, (a, b, c, np.zeros((1, 1))), 0)
    np.testing.assert_allclose(asked[0], np.linspace(0.0, STEP, count + 1))


def test_a_mode_that_turns_several_times_in_a_sample():
    """At 41 rad/s, 3.3 turns in each: the eigenvalues of its samples leave the unit circle."""
    w, ratio, gain = 41.0, 0.004, 6.0
    a, b = np.array([[0.0, 1.0], [-(w**2), -2.0 * ratio * w]]), np.array([[0.0], [1.0]])
    c = np.array([[0.0, 1.0]])

    def driven(time):
        return np.linalg.solve(a, (expm(a * time) - np.eye(2)) @ b)

    def radius(delay):
        now, both = driven(STEP - delay), driven(STEP)
        matrix = np.zeros((3, 3))
        matrix[:2, :2] = expm(a * STEP) - gain * now @ c
        matrix[:2, 2:] = both - now
        matrix[2, :2] = -gain * c[0]
        return np.abs(np.linalg.eigvals(matrix)).max()

    law = (*(part[:, :1] for part in STATIC[:2]), np.zeros((1, 0)), gain * np.ones((1, 1)))
    closed = closed_loop((expm(a * STEP), driven(STEP), c, np.zeros((1, 1))), law, step=STEP)
    closed.__dict__["omega"] = np.linspace(0.05, np.pi / STEP, 600)
    found = sampled_delay_margin(closed, (a, b, c, np.zeros((1, 1))), 0)
    delays = np.linspace(0.0, STEP, 251)
    first = int(np.flatnonzero([radius(delay) > 1.0 for delay in delays])[0])
    wanted = brentq(lambda delay: radius(delay) - 1.0, delays[first - 1], delays[first])
    assert 0.0 < found == pytest.approx(wanted, rel=1e-6)


def test_the_loop_of_one_of_three_inputs():
    """L_i = 1 / S_ii - 1, whatever the others do to each other."""
    random = np.random.default_rng(8)
    a, b = -np.diag([0.4, 1.0, 2.0]), random.normal(size=(3, 3))
    c, d, gains = random.normal(size=(3, 3, 3)) * np.array([1.0, 0.1, 0.5])[:, None, None]
    sampled = expm(a * STEP), np.linalg.solve(a, (expm(a * STEP) - np.eye(3)) @ b), c, d
    law = (np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((3, 0)), gains)
    closed = closed_loop(sampled, law, step=STEP)
    omega = np.array([0.4, 5.5])
    wanted = np.linalg.inv(np.eye(3) + gains @ value(sampled, np.exp(1j * omega * STEP)))
    for i in range(3):
        left, direct, _ = loop_by_state(closed, i, omega)
        np.testing.assert_allclose(left @ sampled[1][:, i] + direct, 1.0 / wanted[:, i, i] - 1.0)


def test_crossings_of_size_one_between_points_of_a_grid():
    """By the logarithm of the size: 4 and 1/2 cross a third before the end."""
    omega = np.array([1.0, 2.0, 5.0, 6.0, 7.0])
    loop = np.array([4.0, -4.0j, -0.5j, 0.1, 10.0])
    found = crossings_of_size_one(omega, loop)
    assert found.omega == pytest.approx([4.0, 6.5])
    assert found.rises.tolist() == [False, True]
    assert found.lacks == pytest.approx([np.pi / 2.0, np.pi])
    # from 4 to 1/2 along a straight line: two thirds of the last
    ends = 4.0 * np.exp(0.4j), 0.5 * np.exp(-1.9j)
    [lacks] = crossings_of_size_one(omega[:2], np.array(ends)).lacks
    assert lacks == pytest.approx(np.pi + np.angle(ends[0] + 2.0 * ends[1]))


def test_a_dead_time_turns_a_crossing_to_minus_one():
    """Frequencies 2 and 3 that lack 0.3 and 0.5 before, and 0.5 and 0.3 after half a sample."""
    rises = np.array([True, False])
    before = SizeOneCrossings(np.array([2.0, 3.0]), np.array([6.2, 1.5]), rises)
    after = SizeOneCrossings(np.array([3.2, 2.2]), np.array([1.7, 0.1]), rises[::-1])
    found = crossings_between(before, after, np.array([0.2, 0.3]), 0.5)
    # whole samples d turn by w d T, and lacks + 2 pi n = w d T for one n: the first whole d
    wanted = []
    for w, v, lacks, later in ((2.0, 2.2, 6.2, 2.0 * np.pi + 0.1), (3.0, 3.2, 1.5, 1.7)):
        for n in range(-1, 50):
            ends = (lacks + 2.0 * np.pi * n) / (w * 0.5), (later + 2.0 * np.pi * n) / (v * 0.5)
            whole = np.ceil(min(ends))
            if 0.0 <= whole <= max(ends):
                share = (whole - ends[0]) / (ends[1] - ends[0])
                wanted.append((whole * 0.5 + 0.2 + share * 0.1, w + share * (v - w)))
                break
    assert len(wanted) == 2
    np.testing.assert_allclose(sorted(found), sorted(wanted))


def test_crossings_are_paired_by_the_ratio_of_their_frequencies():
    """2 and 2.1, 0.4 and 0.5, of which the products would be nearer to one crosswise."""
    rises = np.array([True, True])
    before = SizeOneCrossings(np.array([2.0, 0.4]), np.array([0.3, 0.1]), rises)
    after = SizeOneCrossings(np.array([0.5, 2.1]), np.array([0.05, 0.25]), rises)
    found = crossings_between(before, after, np.array([0.1, 0.2]), 0.25)
    # 0.3 / (2 T) = 0.6 and 0.25 / (2.1 T) = 0.48 samples at the ends: a whole one a turn later
    wanted = []
    for w, v, lacks, later in ((2.0, 2.1, 0.3, 0.25), (0.4, 0.5, 0.1, 0.05)):
        n = np.arange(50)
        ends = np.array([lacks + 2.0 * np.pi * n, later + 2.0 * np.pi * n]) / (
            0.25 * np.array([[w], [v]])
        )
        whole = np.ceil(ends.min(axis=0))
        k = int(np.flatnonzero(whole <= ends.max(axis=0))[0])
        share = (whole[k] - ends[0, k]) / (ends[1, k] - ends[0, k])
        wanted.append((whole[k] * 0.25 + 0.1 + share * 0.1, w + share * (v - w)))
    np.testing.assert_allclose(sorted(found), sorted(wanted))


def test_a_dead_time_of_a_small_part_of_a_sample_is_polished_as_it_is():
    found = polished_delay(lambda w, d: complex(w - 3.0, d - 0.02), 0.03, 2.9, 0.5)
    assert found == pytest.approx(0.02, abs=1e-9)


@pytest.mark.parametrize(
    ("near", "kept"), [(0.93, False), (1.18, False), (0.96, True), (1.04, True)]
)
def test_a_dead_time_is_polished_where_a_zero_is_near(near, kept):
    """1 + L = (w - 3) + j (d - 1): within a tenth of a sample of 0.5."""
    found = polished_delay(lambda w, d: complex(w - 3.0, d - 1.0), near, 2.9, 0.5)
    assert found == pytest.approx(1.0 if kept else near, abs=1e-9)
    lost = polished_delay(lambda w, d: complex(w**2 + 1.0, d - 1.0), 0.98, 2.9, 0.5)
    assert lost == 0.98
