"""Closed forms beside single poles that are followed, and beside whose they are."""

from types import SimpleNamespace

import control
import numpy as np
import pytest
from scipy.linalg import eig

import beamchain as bc
from beamchain.control.closed_loop import ClosedLoop
from beamchain.control.feedback import Feedback
from beamchain.control.instability import sentences as sentences_of
from beamchain.control.pole_paths import Pole, crossing, follow, open_pole, pole_of
from formulas import (
    StartOfPoles,
    assigned_poles,
    continued_poles,
    instabilities,
    number_of_pole,
    own_direction,
    owners_of_poles,
    pole_moved,
    pole_settled,
    rate_of_pole,
    start_of_poles,
    way_from_open,
)

RANDOM = np.random.default_rng(17)
A, B = RANDOM.normal(size=(5, 5)), RANDOM.normal(size=(5, 5))


def between(gain):
    return A + gain * B


def poles_at(closed, gain):
    values, vectors = np.linalg.eig(closed(gain))
    return [pole_of(closed, gain, complex(v), vectors[:, k]) for k, v in enumerate(values)]


def growth(poles):
    poles = np.asarray(poles)
    return poles.real / (1e-9 * np.abs(poles)) - 1.0


def second_order(middle, last):
    """`s^2 + middle(g) s + last`."""
    return lambda g: np.array([[0.0, 1.0], [-last, -middle(g)]])


# -- steps -----------------------------------------------------------------------------------------
def test_left_eigenvectors_and_rates_of_poles_are_those_of_the_matrix():
    values, left, _ = eig(A, left=True)
    for pole in poles_at(between, 0.0):
        wanted = left[:, np.argmin(np.abs(values - pole.value))]
        assert abs(np.vdot(wanted, pole.left)) == pytest.approx(1.0)
        change = 1e-6 * B
        moved = np.linalg.eigvals(A + change)
        moved = moved[np.argmin(np.abs(moved - pole.value))] - pole.value
        found = 1e-6 * rate_of_pole(between, 0.0, pole.right, pole.left)
        assert abs(found - moved) < 1e-4 * abs(moved)


def test_a_direction_that_is_off_is_found_again():
    for pole in poles_at(between, 0.3):
        found = pole_of(between, 0.3, pole.value, pole.right + 0.3)
        assert abs(np.vdot(found.right, pole.right)) == pytest.approx(1.0)
        off = between(0.3) @ found.right - pole.value * found.right
        assert np.linalg.norm(off) < 1e-10


def test_a_pole_settles_where_the_matrix_has_one():
    for pole in poles_at(between, 0.3):
        near = pole.value * (1.0 + 1e-3)
        value, right, left = pole_settled(between(0.3), near, pole.right + 0.01, pole.left)
        assert value == pytest.approx(pole.value, rel=1e-10)
        assert abs(np.vdot(right, pole.right)) == pytest.approx(1.0)
        assert abs(np.vdot(left, pole.left)) == pytest.approx(1.0)
    assert pole_settled(A, complex("nan"), np.ones(5) + 0j, np.ones(5) + 0j) is None


def test_a_pole_at_rest_settles_beside_fast_ones():
    """Zero, of which no part is small, beside -1000: rounding is that of the matrix."""
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    matrix = turn @ np.diag([0.0, -1000.0]) @ turn.T
    value, right, _ = pole_settled(matrix, 1e-9 + 0j, turn[:, 0] + 0.01 + 0j, turn[:, 0] + 0j)
    assert abs(value) < 1e-11
    assert abs(np.vdot(right, turn[:, 0])) == pytest.approx(1.0)


def test_a_pole_that_swings_by_a_tenth_is_not_real():
    """-1 - g +- 0.1 j."""
    swinging = np.array([[-1.0, 0.1], [-0.1, -1.0]])
    one = Pole(0.0, -1.0 + 0.1j, np.array([1.0, 1.0j]) / np.sqrt(2.0) + 0j,
               np.array([1.0, 1.0j]) / np.sqrt(2.0) + 0j)  # fmt: skip
    found = pole_moved(lambda g: swinging - g * np.eye(2), one, 0.01)
    assert found.value == pytest.approx(-1.01 + 0.1j, rel=1e-9)


def test_a_real_pole_stays_real_whatever_the_phase_of_its_direction():
    every = np.diag([-1.0, -2.0, -4.0]) + 0.3 * A[:3, :3]
    values, vectors = np.linalg.eig(every)
    turned = np.exp(0.7j) * vectors[:, 0]
    pole = pole_of(lambda g: every + g * B[:3, :3], 0.0, complex(values[0]), turned)
    found = pole_moved(lambda g: every + g * B[:3, :3], pole, 1e-3)
    assert values[0].imag == found.value.imag == 0.0
    wanted = np.linalg.eigvals(every + 1e-3 * B[:3, :3])
    assert np.abs(wanted - found.value).min() < 1e-9


def test_a_pole_moves_by_small_steps_and_not_past_a_doubt():
    for pole in poles_at(between, 0.3):
        moved = pole_moved(between, pole, 0.303)
        values = np.linalg.eigvals(between(0.303))
        assert np.abs(values - moved.value).min() < 1e-9
        assert moved.gain == 0.303
        assert abs(moved.value - pole.value) < 0.1
    # -g +- sqrt(g^2 - 1) meet at 1, where nothing is smooth
    meeting = second_order(lambda g: 2.0 * g, 1.0)
    one = poles_at(meeting, 0.99)[0]
    assert pole_moved(meeting, one, 1.01) is None
    real = poles_at(meeting, 1.5)[0]
    assert pole_moved(meeting, real, 1.51).value.imag == 0.0
    # a swap: the direction stays
    pole = poles_at(lambda g: np.diag([1.0 + g, 2.0 - g]), 0.0)[0]
    assert pole_moved(lambda g: np.diag([1.0 + g, 2.0 - g]), pole, 1.0).value == 2.0


@pytest.mark.parametrize(("more", "taken"), [(2.9, True), (3.5, False)])
def test_a_step_at_whose_ends_a_pole_moves_at_other_rates_is_none(more, taken):
    """0.1 sqrt(1 + g) moves by 0.05 g at first and 0.05 g / sqrt(1 + g) at last, which differ by
    half of the first from g = 3 on, where their mean misses it by less than a tenth."""

    def closed(gain):
        return 0.1 * np.array([[0.0, 1.0], [1.0 + gain, 0.0]])

    (pole,) = (one for one in poles_at(closed, 0.0) if one.value.real > 0.0)
    found = pole_moved(closed, pole, more)
    if taken:
        assert found.value == pytest.approx(0.1 * np.sqrt(1.0 + more))
    else:
        assert found is None


@pytest.mark.parametrize(("first", "last"), [(1.0, 0.0), (0.0, 1.0), (0.4, 0.9)])
def test_a_path_holds_poles_of_the_matrix_without_a_jump(first, last):
    every = [np.linalg.eigvals(between(g)) for g in np.linspace(first, last or 2.0**-20, 300)]
    for pole in poles_at(between, first)[1:4]:
        path = follow(between, pole, last)
        gains = np.array([one.gain for one in path.poles])
        assert gains[0] == first
        assert gains[-1] == max(last, 2.0**-20 if first > last else 0.0)
        assert np.all(np.diff(gains) * np.sign(last - first) > 0.0)
        assert np.abs(np.diff(gains)).max() <= 0.05 * (1.0 + 1e-12)
        for one in path.poles[1:]:
            off = between(one.gain) @ one.right - one.value * one.right
            assert np.linalg.norm(off) < 1e-8
        value = pole.value
        for values in every:
            value = values[np.argmin(np.abs(values - value))]
        if all(abs(one.value.imag) > 0.05 for one in path.poles):
            assert path.poles[-1].value == pytest.approx(value, rel=1e-6)


def test_a_pair_that_meets_on_the_real_axis_goes_two_ways():
    """-g +- sqrt(g^2 - 1)."""
    closed = second_order(lambda g: 2.0 * g, 1.0)
    up = follow(closed, poles_at(closed, 0.2)[0], 3.0)
    found = sorted([up.poles[-1].value, follow(closed, up.partner, 3.0).poles[-1].value], key=abs)
    assert found == pytest.approx([-3.0 + np.sqrt(8.0), -3.0 - np.sqrt(8.0)])
    down = follow(closed, poles_at(closed, 3.0)[0], 0.2)
    assert down.partner is None
    assert abs(down.poles[-1].value) == pytest.approx(1.0)
    assert down.poles[-1].value.real == pytest.approx(-0.2)


def test_the_open_pole_from_which_one_comes():
    start = np.linalg.eig(A)
    for pole in poles_at(between, 2.0**-20):
        number = open_pole(between, pole, start)
        assert start[0][number] == pytest.approx(pole.value, rel=1e-4)


@pytest.mark.parametrize(("angle", "order"), [(48.0, [0, 1]), (51.0, [1, 0])])
def test_poles_are_continued_by_distance_and_direction(angle, order):
    """10 and 12 become 10 and 11, each 1 from the other: d / (d + 1) costs 1/2 straight and 2/3 +
    1/2 crossed, 3 (1 - overlap) of each: even where sin - cos = 1/9, at 49.5 degrees."""
    turn = np.radians(angle)
    directions = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]) + 0j
    poles, new = np.array([10.0, 12.0]) + 0j, np.array([10.0, 11.0]) + 0j
    assert continued_poles(poles, np.eye(2) + 0j, new, directions).tolist() == order


@pytest.mark.parametrize(("angle", "order"), [(47.74, [0, 1]), (47.78, [1, 0])])
def test_the_distance_of_a_slow_pole_counts_beside_a_thousandth_of_the_largest(angle, order):
    """1 and 3 become 0 and 5 beside 1000: 1/2 + 2/7 straight and 4/9 + 3/4 crossed, so that the
    directions decide where sin - cos = (4/9 + 3/4 - 1/2 - 2/7) / 6, at 47.76 degrees."""
    turn = np.radians(angle)
    directions = np.eye(3) + 0j
    directions[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    poles, new = np.array([1.0, 3.0, 1000.0]) + 0j, np.array([0.0, 5.0, 1000.0]) + 0j
    assert continued_poles(poles, np.eye(3) + 0j, new, directions).tolist() == [*order, 2]


def test_poles_that_are_one_share_a_plane():
    """By any directions in it: the third is told by its own."""
    turned = np.linalg.qr(RANDOM.normal(size=(2, 2)))[0]
    directions = np.eye(3) + 0j
    directions[1:, 1:] = turned
    poles, new = np.array([5.0, 7.0, 7.0]) + 0j, np.array([7.0, 5.0, 5.0 * (1.0 + 1e-7)]) + 0j
    found = continued_poles(poles, np.eye(3) + 0j, new, directions)
    assert found[0] == 0
    apart = continued_poles(poles, np.eye(3) + 0j, np.array([5.001, 7.0, 7.0]) + 0j, directions)
    assert apart[0] == 0


@pytest.mark.parametrize(
    ("at", "apart", "order"),
    [
        (0.0, 0.9e-6, [0, 1, 2]),
        (0.0, 1.1e-6, [1, 0, 2]),
        (2.0, 2.9e-6, [0, 1, 2]),
        (2.0, 3.1e-6, [1, 0, 2]),
    ],
)
def test_poles_within_a_millionth_are_told_apart_by_distance_alone(at, apart, order):
    """1e-6 (at + 1e-3 1000), whatever their directions, which have changed places."""
    poles = np.array([at, at + apart, 1000.0]) + 0j
    swapped = np.eye(3)[:, [1, 0, 2]] + 0j
    assert continued_poles(poles, np.eye(3) + 0j, poles, swapped).tolist() == order


def test_poles_that_pass_each_other_keep_their_directions():
    """Two that swap places: by distance alone each would stay."""
    turned = np.linalg.qr(RANDOM.normal(size=(2, 2)))[0]

    def closed(gain):
        return turned @ np.diag([1.0 + gain, 2.0 - gain]) @ turned.T

    for pole in poles_at(closed, 0.49):
        found, other = assigned_poles(closed, pole, 0.51)
        assert abs(np.vdot(found.right, pole.right)) == pytest.approx(1.0)
        assert other is None
    values, vectors = np.linalg.eig(between(0.0))
    for k, pole in enumerate(poles_at(between, 0.0)):
        assert number_of_pole((values, vectors), pole) == k
    # two at one place are told apart by their directions
    same = np.array([2.0 + 0j, 2.0, 5.0]), np.eye(3, dtype=complex)
    for k in range(3):
        direction = np.eye(3)[k] + 0j
        pole = Pole(1.0, complex(same[0][k]), direction, direction)
        assert number_of_pole(same, pole) == k


@pytest.mark.parametrize(("apart", "number"), [(0.9e-6, 1), (1.1e-6, 0), (1e-4, 0)])
def test_slow_poles_are_one_within_a_millionth_of_their_size(apart, number):
    found = np.array([1e-3, 1e-3 * (1.0 + apart), 5.0]) + 0j, np.eye(3) + 0j
    direction = np.eye(3)[1] + 0j
    assert number_of_pole(found, Pole(1.0, 1e-3 + 0j, direction, direction)) == number


# -- where a pole crosses --------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("middle", "gain", "at"),
    [
        (lambda g: 0.4 - g, 0.4, 2j),
        (lambda g: 3.0 * (g - 0.2) * (0.7 - g), 0.7, 2j),  # that from which on it grows
        (lambda g: -g, 0.0, None),  # from the axis on
    ],
)
def test_the_gain_from_which_on_a_pole_grows(middle, gain, at):
    closed = second_order(middle, 4.0)
    last = poles_at(closed, 1.0)[0]
    path = follow(closed, last, 0.0)
    first = min(poles_at(closed, 0.0), key=lambda one: abs(one.value - path.poles[-1].value))
    poles = [first, *reversed(path.poles)]
    found, there = crossing(closed, poles, growth)
    assert found == pytest.approx(gain, abs=1e-9)
    if at is not None:
        assert abs(there.imag) == pytest.approx(2.0)
        assert there.real == pytest.approx(0.0, abs=1e-6)


def test_the_gain_is_found_between_two_poles_alone():
    closed = second_order(lambda g: 0.4 - g, 4.0)
    ends = [max(poles_at(closed, gain), key=lambda one: one.value.imag) for gain in (0.3, 0.5)]
    found, there = crossing(closed, ends, growth)
    assert found == pytest.approx(0.4, abs=1e-9)
    assert there == pytest.approx(2j, abs=1e-6)


def test_a_pole_that_comes_back_from_infinity():
    """-1 / (1 - 2 g)."""

    def closed(gain):
        if gain == 0.5:
            raise np.linalg.LinAlgError
        return np.array([[-1.0 / (1.0 - 2.0 * gain)]])

    poles = [poles_at(closed, gain)[0] for gain in (0.0, 0.2, 0.45, 0.6, 1.0)]
    found, there = crossing(closed, poles, growth)
    assert found == pytest.approx(0.5, abs=1e-9)
    assert np.isinf(there)


def test_a_pole_that_sank_just_below_the_axis_grows_from_there():
    """Real, at (g - 0.1) (g - 0.4) (g - 0.7): it grows, sinks and grows again."""

    def closed(gain):
        return np.array([[(gain - 0.1) * (gain - 0.4) * (gain - 0.7)]])

    def told(values):
        # -0.008, at a gain of 0.5, is a twentieth of the rounding left of the axis
        return np.interp(np.real(values), [-0.028, -0.008, 0.0, 0.1], [-3.0, -1.05, -1.0, 2.0])

    poles = [poles_at(closed, gain)[0] for gain in (0.0, 0.2, 0.5, 0.95)]
    found, there = crossing(closed, poles, told)
    assert found == pytest.approx(0.7, abs=1e-9)
    assert there == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("size", "gain"), [(0.9, 0.0), (1.1, 0.3)])
def test_a_pole_that_begins_within_rounding_of_the_axis_does_not_cross_it(size, gain):
    """-0.3 + g, which is one rounding left of the axis at rest, or a little more."""

    def closed(gain):
        return np.array([[gain - 0.3]])

    poles = [poles_at(closed, gain)[0] for gain in (0.0, 0.2, 0.5)]
    found, there = crossing(closed, poles, lambda v: np.real(v) * size / 0.3 - 1.0)
    assert found == pytest.approx(gain, abs=1e-9)
    assert there == pytest.approx(gain - 0.3, abs=1e-9)


@pytest.mark.parametrize(("before", "after"), [(1.0, 1e12), (1e12, 1.0), (1.0, 1.0)])
def test_a_pole_is_endless_beside_the_largest_of_either_side(before, after):
    """1 / (1/3 - g) goes to infinity and back; as its interval is halved it reaches 1e15."""

    def closed(gain):
        return np.diag([1.0 / (gain - 1.0 / 3.0), -before if gain.real < 0.4 else -after])

    poles = [poles_at(closed, gain)[0] for gain in (0.0, 0.1, 0.3, 0.5)]
    found, there = crossing(closed, poles, growth)
    assert found == pytest.approx(1.0 / 3.0, abs=1e-9)
    assert np.isinf(there) == (before == after)


# -- whose they are --------------------------------------------------------------------------------
def modal_loop(modes, gains, extra=None, names=None):
    """Modes `(w, ratio, of inputs, of rates)`, every input fed from a rate with minus a gain."""
    n = 2 * len(modes)
    a, b = np.zeros((n, n)), np.zeros((n, len(gains)))
    c = np.zeros((len(gains), n))
    for i, (w, ratio, drives, shows) in enumerate(modes):
        a[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = [[0.0, 1.0], [-(w**2), -2.0 * ratio * w]]
        b[2 * i + 1], c[:, 2 * i + 1] = drives, shows
    names = names or tuple(f"m{i}" for i in range(len(modes)))
    states = tuple(word for name in names for word in (name, f"{name}_rate"))
    count = len(gains)
    law = (np.zeros((0, 0)), np.zeros((0, count)), np.zeros((count, 0)), np.diag(gains))
    law = law if extra is None else extra
    every = list(range(count))
    fed = Feedback(every, every, lambda _: law, lambda _: law[3], 0.0, (0.0,) * count)
    inputs = tuple("uvw"[:count])
    modes = tuple(name for name in names if name.startswith("m"))
    plant = (a, b, c, np.zeros((count, count)))
    return ClosedLoop(plant, law, fed, inputs, ((),) * count, states, modes, 0.0)


def test_a_loop_that_takes_more_damping_than_a_mode_has():
    """s^2 + (2 r w - k) s + w^2 grows from k = 2 r w on."""
    closed = modal_loop([(3.0, 0.05, [1.0], [1.0]), (8.0, 0.3, [0.2], [0.1])], [-0.9])
    (found,) = instabilities(closed)
    assert (found.origin, found.kind) == ("m0", "mode")
    assert found.gain == pytest.approx(0.3 / 0.9, rel=3e-2)
    assert found.crossing == pytest.approx(3.0, rel=1e-2)
    assert found.alone == {"u": pytest.approx(found.gain)}
    assert found.stable_without == ("u",)
    assert found.pole.real == pytest.approx(0.3, rel=3e-2)
    assert found.pole.imag > 0.0


def test_no_loop_alone_makes_it_grow_but_both_together():
    """Two that take 0.2 and 0.25 of a damping of 0.3."""
    closed = modal_loop([(3.0, 0.05, [1.0, 1.0], [1.0, 1.0])], [-0.2, -0.25])
    (found,) = instabilities(closed)
    assert found.alone == {}
    assert found.stable_without == ("u", "v")
    assert found.gain == pytest.approx(0.3 / 0.45)
    assert found.crossing == pytest.approx(3.0)
    assert found.pole == pytest.approx(0.075 + 1j * np.sqrt(9.0 - 0.075**2))


def test_axes_of_one_design_have_each_their_own_pole():
    modes = [(3.0, 0.05, [1.0, 0.0], [1.0, 0.0]), (3.01, 0.05, [0.0, 1.0], [0.0, 1.0])]
    found = instabilities(modal_loop(modes, [-0.8, -0.6]))
    assert [one.origin for one in found] == ["m0", "m1"]
    assert [list(one.alone) for one in found] == [["u"], ["v"]]
    assert [one.gain for one in found] == pytest.approx([0.3 / 0.8, 0.301 / 0.6])
    assert [one.crossing for one in found] == pytest.approx([3.0, 3.01])
    # two of one frequency and growth: both grow without either loop
    assert [one.stable_without for one in found] == [("u",), ("v",)]


def test_one_loop_that_is_enough_is_told_from_one_that_only_helps():
    """Of a damping of 0.3 one loop takes 0.302 and the other 0.1: the first grows alone, and
    without the second it still does."""
    closed = modal_loop([(3.0, 0.05, [1.0, 1.0], [1.0, 1.0])], [-0.1, -0.302])
    (found,) = instabilities(closed)
    assert found.alone == {"v": pytest.approx(0.3 / 0.302)}
    assert found.stable_without == ("v",)
    assert found.gain == pytest.approx(0.3 / 0.402)


def test_the_pair_of_a_very_slow_mode_is_told_once():
    closed = modal_loop([(1e-5, 0.05, [1.0], [1.0])], [-4e-6])
    (found,) = instabilities(closed)
    assert found.pole == pytest.approx(1.5e-6 + 1e-5j * np.sqrt(1.0 - 0.15**2))
    assert found.gain == pytest.approx(1.0 / 4.0)


def loop_of_one(plant, law, step=0.0, states=("x",)):
    """A plant around a law, of which nothing is a mode."""
    count = law[3].shape[0]
    every = list(range(count))
    fed = Feedback(every, every, lambda _: law, lambda _: law[3], step, (0.0,) * count)
    return ClosedLoop(plant, law, fed, ("u", "v")[:count], ((),) * count, states, (), step)


def constant(gains):
    count = len(gains)
    return np.zeros((0, 0)), np.zeros((0, count)), np.zeros((count, 0)), np.diag(gains)


def test_a_sampled_loop_crosses_the_circle_at_its_angle_over_the_step():
    """z = (rho + g) exp(+-j theta) of both loops; of one alone |z|^2 = rho (rho + g)."""
    rho, theta, step, g = 0.95, 0.4, 0.2, 0.2
    turn = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
    plant = rho * turn, np.eye(2), turn, np.zeros((2, 2))
    (found,) = instabilities(loop_of_one(plant, constant([-g, -g]), step, ("x", "y")))
    assert found.pole == pytest.approx((np.log(rho + g) + 1j * theta) / step)
    assert found.gain == pytest.approx((1.0 - rho) / g, rel=1e-5)
    assert found.crossing == pytest.approx(theta / step)
    alone = (1.0 / rho - rho) / g
    assert found.alone == {name: pytest.approx(alone, rel=1e-5) for name in "uv"}
    assert found.stable_without == ()
    assert found.timestep == step


def test_a_pole_that_comes_back_from_infinity_crosses_there():
    """-1 / (1 - 2 g)."""
    plant = tuple(np.full((1, 1), value) for value in (-1.0, 1.0, -1.0, 1.0))
    (found,) = instabilities(loop_of_one(plant, constant([-2.0])))
    assert found.pole == pytest.approx(1.0)
    assert found.gain == pytest.approx(0.5, abs=1e-6)
    assert found.crossing == np.inf


def test_an_integrator_alone_grows_at_any_gain():
    """g / 2, and nothing at all at rest."""
    plant = tuple(np.full((1, 1), value) for value in (0.0, 1.0, 1.0, 0.0))
    (found,) = instabilities(loop_of_one(plant, constant([-0.5])))
    assert (found.pole, found.gain, found.alone) == (0.5, 0.0, {"u": 0.0})


@pytest.mark.parametrize(
    ("slow", "fast", "origin", "kind"),
    [
        (1.0, (2.0, 3.0), "state x with the controller", "several"),
        (3.0, (1.0, 2.0), "the controller", "controller"),
    ],
)
def test_a_pair_that_met_on_the_real_axis_has_two_origins(slow, fast, origin, kind):
    """(s + 1) (s + 2) (s + 3) + 120: -1 and -2 meet, and grow from 60 on at sqrt(11)."""
    law = control.ss(control.tf([120.0], np.polymul([1.0, fast[0]], [1.0, fast[1]])))
    law = tuple(np.asarray(part) for part in (law.A, law.B, law.C, law.D))
    plant = tuple(np.full((1, 1), value) for value in (-slow, 1.0, 1.0, 0.0))
    (found,) = instabilities(loop_of_one(plant, law))
    assert (found.origin, found.kind) == (origin, kind)
    assert found.gain == pytest.approx(0.5)
    assert found.crossing == pytest.approx(np.sqrt(11.0))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_both_of_a_pair_are_followed_to_the_open_loop_itself(side, monkeypatch):
    """s^2 + 2 m s + 1, m = 1.5 - g / 1.8, met at 0.9 and came from (-3 +- sqrt(5)) / 2; a pole at
    -3 stands still, and until then its direction changes places with that of their rates."""

    def matrix(gain):
        angle = np.pi / 2.0 * (gain / 0.85 if gain.real < 0.85 else 1.0)
        turn = np.eye(3) * gain**0
        turn[1:, 1:] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        inner = np.array([[0.0, 1.0, 0.0], [-1.0, gain / 0.9 - 3.0, 0.0], [0.0, 0.0, -3.0]])
        return turn @ inner @ turn.T

    monkeypatch.setattr("beamchain.control.pole_paths.FIRST", 2.0**-4)
    origins = start_of_poles(modal_loop([(3.0, 0.05, [1.0], [1.0])], [1.0])).origins
    start = StartOfPoles(*(part + 0j for part in np.linalg.eig(matrix(0.0))), [origins[0]] * 3)
    (pole,) = (one for one in poles_at(matrix, 1.0) if side * one.value.imag > 0.0)
    loop = SimpleNamespace(closed=lambda gain, loops: matrix(gain))
    way = way_from_open(loop, np.ones(1), pole, start)
    found = np.sort(start.poles[list(way.numbers)].real)
    assert found == pytest.approx([(-3.0 - np.sqrt(5.0)) / 2.0, (-3.0 + np.sqrt(5.0)) / 2.0])
    assert way.poles[0].value == start.poles[way.numbers[0]]
    assert way.poles[-1].value == pole.value


@pytest.mark.parametrize(("second", "told"), [(30.3, True), (33.0, False)])
def test_poles_that_lie_together_are_those_of_the_loops_that_have_them_alone(second, told):
    """Within a twentieth of each other; s^2 + (2 r w - k) s + w^2 of each."""
    modes = [(30.0, 0.05, [1.0, 0.0], [1.0, 0.0]), (second, 0.05, [0.0, 1.0], [0.0, 1.0])]
    closed = modal_loop(modes, [-5.0, -4.0])
    growth_of = np.array([(5.0 - 3.0) / 2.0, (4.0 - 0.1 * second) / 2.0])
    w = np.array([30.0, second])
    poles = growth_of + 1j * np.sqrt(w**2 - growth_of**2)
    found = owners_of_poles(closed, poles, start_of_poles(closed))
    if told:
        assert [(one.input, one.is_same, one.ends_without) for one in found] == [
            ("u", True, True),
            ("v", True, True),
        ]
    else:
        assert found == [None, None]


@pytest.mark.parametrize(
    ("off", "told"), [(0.9e-3, True), (1.1e-3, False), (0.19, False), (0.21, None)]
)
def test_a_pole_is_of_the_loop_that_has_it_alone_within_a_fifth_of_its_growth(off, told):
    """And the others do nothing to it within a thousandth."""
    modes = [(30.0, 0.05, [1.0, 0.0], [1.0, 0.0]), (30.3, 0.05, [0.0, 1.0], [0.0, 1.0])]
    closed = modal_loop(modes, [-3.4, -3.37])
    growth_of = np.array([3.4 - 3.0, 3.37 - 3.03]) / 2.0
    poles = growth_of + 1j * np.sqrt(np.array([30.0, 30.3]) ** 2 - growth_of**2)
    found = owners_of_poles(closed, poles + 1j * off * growth_of, start_of_poles(closed))
    if told is None:
        assert found == [None, None]
    else:
        assert [(one.input, one.is_same) for one in found] == [("u", told), ("v", told)]


def test_what_grows_without_any_loop_is_of_none():
    """At 30 rad/s by itself, beside 30.3 rad/s that the loop makes grow."""
    modes = [(30.0, -0.005, [0.0], [0.0]), (30.3, 0.05, [1.0], [1.0])]
    closed = modal_loop(modes, [-4.0])
    growth_of = np.array([0.15, (4.0 - 3.03) / 2.0])
    poles = growth_of + 1j * np.sqrt(np.array([30.0, 30.3]) ** 2 - growth_of**2)
    first, second = owners_of_poles(closed, poles, start_of_poles(closed))
    assert first is None
    assert (second.input, second.is_same) == ("u", True)


def test_a_loop_is_opened_wholly_to_see_whether_its_pole_ends():
    """A tenth of either would still outdo a damping of 0.06."""
    modes = [(30.0, 0.001, [1.0, 0.0], [1.0, 0.0]), (30.3, 0.001, [0.0, 1.0], [0.0, 1.0])]
    closed = modal_loop(modes, [-5.0, -4.0])
    poles = closed.to_s(closed.growing)
    found = owners_of_poles(closed, poles[poles.imag > 0.0], start_of_poles(closed))
    assert sorted((one.input, one.is_same, one.ends_without) for one in found) == [
        ("u", True, True),
        ("v", True, True),
    ]


def test_slow_poles_that_lie_together_are_told_apart_like_fast_ones():
    """All of it 1e-4 times as fast, and as far from the open poles."""
    modes = [(3e-3, 0.05, [1.0, 0.0], [1.0, 0.0]), (3.03e-3, 0.05, [0.0, 1.0], [0.0, 1.0])]
    closed = modal_loop(modes, [-5e-4, -4e-4])
    growth_of = np.array([2e-4, 0.97e-4]) / 2.0
    poles = growth_of + 1j * np.sqrt(np.array([3e-3, 3.03e-3]) ** 2 - growth_of**2)
    found = owners_of_poles(closed, poles, start_of_poles(closed))
    assert [(one.input, one.is_same) for one in found] == [("u", True), ("v", True)]


def test_told_of_progress_the_fastest_first():
    modes = [(3.0, 0.05, [1.0, 0.0], [1.0, 0.0]), (7.0, 0.05, [0.0, 1.0], [0.0, 1.0])]
    told = []
    found = instabilities(modal_loop(modes, [-0.5, -1.5]), lambda *done: told.append(done))
    assert told == [(0, 2), (1, 2)]
    assert [one.origin for one in found] == ["m1", "m0"]
    assert found[0].pole.real > found[1].pole.real
    assert [one.alone for one in found] == [
        {"v": pytest.approx(0.7 / 1.5)},
        {"u": pytest.approx(0.3 / 0.5)},
    ]


def test_open_poles_belong_to_states_of_the_plant_or_to_the_controller():
    law = (np.array([[-5.0]]), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1)))
    modes = [(3.0, 0.05, [1.0], [1.0]), (8.0, 0.3, [0.2], [0.1]), (1.0, 0.1, [1.0], [1.0])]
    names = ("m0", "rigid_x", "lag")
    found = start_of_poles(modal_loop(modes, [1.0], law, names))
    of = {
        round(abs(pole), 6): (origin.name, origin.kind)
        for pole, origin in zip(found.poles, found.origins, strict=True)
    }
    assert of[3.0] == ("m0", "mode")
    assert of[8.0] in (("x", "rigid"), ("x_rate", "rigid"))
    assert of[1.0][1] == "state"
    assert of[5.0] == ("the controller", "controller")
    assert found.vectors.shape == (7, 7)
    assert np.abs(found.vectors[:6, 6]).max() == 0.0


def test_an_open_pole_belongs_to_the_state_whose_own_rate_moves_it_most():
    """By differences of eigenvalues; of four states that all couple."""
    a = np.diag([-1.0, -2.0, -3.5, -6.0]) + 0.6 * np.random.default_rng(5).normal(size=(4, 4))
    plant = a, np.ones((4, 1)), np.ones((1, 4)), np.zeros((1, 1))
    found = start_of_poles(loop_of_one(plant, constant([1.0]), states=("p", "q", "r", "s")))
    step = 1e-6
    for pole, origin in zip(found.poles, found.origins, strict=True):
        moved = [np.linalg.eigvals(a + step * np.diag(unit)) for unit in np.eye(4)]
        rates = [np.abs(values - pole).min() / step for values in moved]
        assert origin.name == "pqrs"[int(np.argmax(rates))]


def test_of_rigid_motions_at_rest_the_one_in_whose_direction_a_pole_leaves():
    origins = start_of_poles(modal_loop([(3.0, 0.05, [1.0], [1.0])] * 2, [1.0])).origins
    start = StartOfPoles(np.array([0, 1e-9, 7.0, 0]) + 0j, np.eye(4) + 0j, [origins[0]] * 4)
    for direction, number in ((0, 0), (1, 1), (2, 0), (3, 3)):
        leaving = 0.9 * np.eye(4)[direction] + 0.1 * np.eye(4)[0] + 0j
        pole = Pole(1e-6, 0j, leaving, leaving)
        assert own_direction(start, 0, pole) == number
    other = start._replace(
        origins=[origins[0], origins[0]._replace(kind="rigid"), *[origins[0]] * 2]
    )
    leaving = np.array([0.1, 0.9, 0.0, 0.05]) + 0j
    assert own_direction(other, 0, Pole(1e-6, 0j, leaving, leaving)) == 0


@pytest.mark.parametrize(("off", "number"), [(2.9e-6, 1), (3.1e-6, 0)])
def test_open_poles_are_one_within_a_millionth_of_their_size_and_of_the_largest(off, number):
    """1e-6 (2 + 1e-3 1000)."""
    origin = start_of_poles(modal_loop([(3.0, 0.05, [1.0], [1.0])], [1.0])).origins[0]
    poles = np.array([2.0, 2.0 + off, -1000.0]) + 0j
    start = StartOfPoles(poles, np.eye(3) + 0j, [origin] * 3)
    leaving = np.array([0.1, 0.9, 0.05]) + 0j
    assert own_direction(start, 0, Pole(1e-6, 2.0 + 0j, leaving, leaving)) == number


def test_of_a_double_pole_each_stays_its_own():
    """Both have one direction."""
    origin = start_of_poles(modal_loop([(3.0, 0.05, [1.0], [1.0])], [1.0])).origins[0]
    start = StartOfPoles(np.zeros(2) + 0j, np.array([[1.0, 1.0], [0.0, 0.0]]) + 0j, [origin] * 2)
    for leaving in (np.array([1.0, 0.0]) + 0j, np.array([0.6, 0.8]) + 0j):
        for number in (0, 1):
            assert own_direction(start, number, Pole(1e-6, 0j, leaving, leaving)) == number


# -- words -----------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("pole", "alone", "words", "pushed"),
    [
        (0.3 + 4.0j, {"u": 0.5}, "0.638 Hz, 4.011 rad/s", False),
        (0.3 + 0j, {"u": 0.0}, "without oscillation", True),
        (0.3 + 0j, {"u": 0.2}, "without oscillation", False),
        (0.3 + 2e-10j, {"u": 0.0}, "without oscillation", True),
        (0.3 + 4e-10j, {"u": 0.0}, "Hz", False),
    ],
)
def test_a_growing_pole_in_words(pole, alone, words, pushed):
    made = bc.results.Instability(pole, "m1", "mode", 0.5, 4.0, alone, ("v",), 0.0)
    assert words in made.finding
    assert "time constant 3.33 s" in made.finding
    assert made.pushed == pushed
    assert made.time_constant == pytest.approx(1.0 / 0.3)
    assert made.damping_ratio == pytest.approx(-0.3 / abs(pole))
    assert made.hertz == pytest.approx(abs(pole) / (2.0 * np.pi))
    assert made.causes == ("u",)
    assert ("at any part of its gain" in made.finding) == (alone["u"] == 0.0)


def test_signs_are_asked_for_once_where_two_poles_or_more_grow_at_any_gain():
    def pushed(name):
        return bc.results.Instability(0.3 + 0j, "m1", "mode", 0.0, 0.0, {name: 0.0}, (), 0.0)

    ringing = bc.results.Instability(0.3 + 4j, "m2", "mode", 0.5, 4.0, {"w": 0.5}, (), 0.0)
    assert sentences_of([pushed("u"), ringing]) == [pushed("u").sentence, ringing.sentence]
    asked, *others = sentences_of([pushed("v"), ringing, pushed("u")])
    assert "u and v" in asked
    assert " 2 poles" in asked
    assert others == [f"{one.finding}." for one in (pushed("v"), ringing, pushed("u"))]


def test_the_gain_of_every_loop_to_blame_is_told_once_where_it_is_the_same():
    def told(**alone):
        return bc.results.Instability(0.3 + 4j, "m1", "mode", 0.9, 4.0, alone, (), 0.0).finding

    assert told(u=0.123, v=0.1234).count("0.12 ") == 1
    apart = told(u=0.123, v=0.456)
    assert apart.index("u (") < apart.index("0.12 ") < apart.index("v (") < apart.index("0.46 ")
    assert "0.05 " in told(u=0.05)
    none = told()
    assert "0.9 " in none
    assert "no solution" not in none
    endless = bc.results.Instability(0.3 + 4j, "m1", "mode", 0.9, np.inf, {}, (), 0.0)
    assert endless.finding.startswith(none)
    assert "0.9 of" in endless.finding.removeprefix(none)
    both = bc.results.Instability(0.3 + 0j, "m1", "mode", 0.0, 0.0, {"w": 0.0, "u": 0.0, "v": 0.0},
                                  (), 0.0)  # fmt: skip
    assert "u, v and w" in sentences_of([both, both])[0]
