"""Closed forms beside searches of worst samples, their slopes, and a controller that is stepped."""

from itertools import product
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from msgspec import structs

import beamchain as bc
from beamchain.robust.least_margins import LeastMargin, WorstMargins
from formulas import linear_craft
from robust_doors import (
    Figure,
    Reach,
    Search,
    SteppedController,
    UncertainLoop,
    measured_in_mujoco,
    plan_of_run,
    samples_beside,
    simulated_gain,
    stability_limit,
    upper,
    whole_count,
    worst_margin_table,
)

RANDOM = np.random.default_rng(33)
# two modes, three deltas of which the second stands twice, two inputs and two outputs
PLANT = (
    np.array([[0, 1, 0, 0], [-4, -1.0, 0.1, 0], [0, 0, 0, 1], [0.2, 0, -16, -1.6]]),
    0.6 * RANDOM.normal(size=(4, 6)),
    0.6 * RANDOM.normal(size=(6, 4)),
    0.05 * RANDOM.normal(size=(6, 6)),
)
BLOCKS = [0, 1, 2, 1]
LAW = bc.spec.Controller(
    loop=(
        bc.spec.Loop(
            input="u", output="y", numerator=[0.3, 0.5], denominator=[0.1, 1.0], delay=0.15
        ),
        bc.spec.Loop(input="v", output="x", numerator=[0.4], denominator=[0.2, 1.0]),
    )
)
DELTAS = np.array([0.3, -0.6, 0.5])


def value(system, s):
    a, b, c, d = system
    return c @ np.linalg.solve(s * np.eye(len(a)) - a, b) + d


def closed_at(deltas, w, delay=0.15):
    """S at the inputs, and the plant: u = -K y, the first loop from y to u."""
    m = value(PLANT, 1j * w)
    delta = np.diag(deltas[BLOCKS])
    g = m[4:, 4:] + m[4:, :4] @ delta @ np.linalg.solve(np.eye(4) - m[:4, :4] @ delta, m[:4, 4:])
    s = 1j * w
    first = (0.3 * s + 0.5) / (0.1 * s + 1.0) * np.exp(-delay * s)
    k = np.array([[0.0, first], [0.4 / (0.2 * s + 1.0), 0.0]])
    return np.linalg.inv(np.eye(2) + k @ g), g


def slopes(function, deltas, size=1e-6):
    steps = size * np.eye(deltas.size)
    return np.array([(function(deltas + h) - function(deltas - h)) / (2.0 * size) for h in steps])


# -- gains of samples ------------------------------------------------------------------------------
def test_gain_of_a_sample_of_deltas_that_repeat():
    """From v to x + 0.25: G S, and its slope."""
    loops = UncertainLoop(PLANT, BLOCKS, ["u", "v"], ["x", "y"], LAW, ("v", "x"), offset=0.25)

    def gain(deltas, w):
        s, g = closed_at(deltas, w)
        return abs((g @ s)[0, 1] + 0.25)

    omega = np.array([0.3, 2.2, 5.0])
    assert loops.gain(DELTAS, omega) == pytest.approx([gain(DELTAS, w) for w in omega])
    of_n = loops.size(loops.exact(omega), DELTAS)
    assert of_n == pytest.approx([gain(DELTAS, w) for w in omega])
    for w in omega:
        wanted = slopes(lambda at, w=w: np.log(gain(at, w)), DELTAS)
        assert loops.slope(0, DELTAS, w) == pytest.approx(wanted, rel=1e-5, abs=1e-9)


def test_an_input_that_moves_nothing_has_no_worst_gain():
    still = PLANT[0], PLANT[1].copy(), PLANT[2], PLANT[3].copy()
    still[1][:, 5] = still[3][:, 5] = 0.0
    UncertainLoop(still, BLOCKS, ["u", "v"], ["x", "y"], LAW, ("u", "x")).check_gain()
    with pytest.raises(bc.InputError, match="'v' does not move output 'x'"):
        UncertainLoop(still, BLOCKS, ["u", "v"], ["x", "y"], LAW, ("v", "x")).check_gain()
    blind = *PLANT[:2], PLANT[2].copy(), PLANT[3].copy()
    blind[2][4] = blind[3][4] = 0.0
    with pytest.raises(bc.InputError, match="'u' does not move output 'x'"):
        UncertainLoop(blind, BLOCKS, ["u", "v"], ["x", "y"], LAW, ("u", "x")).check_gain()


@pytest.mark.parametrize(("size", "kept"), [(1e-7, True), (1e-3, False)])
def test_an_undamped_motion_takes_part_where_it_is_more_than_rounding(size, kept):
    """Of 1e-14 of the gain, or of 1e-6; 3 rad/s."""
    a = np.zeros((6, 6))
    a[:4, :4], a[4:, 4:] = PLANT[0], [[0.0, 3.0], [-3.0, 0.0]]
    b, c = np.zeros((6, 6)), np.zeros((6, 6))
    b[:4], c[:, :4] = PLANT[1], PLANT[2]
    b[5, 5], c[4, 4] = size, size  # from v to x
    whole = a, b, c, PLANT[3]
    loops = UncertainLoop(whole, BLOCKS, ["u", "v"], ["x", "y"], LAW, ("v", "x"))
    if kept:
        loops.check_gain()
        assert np.abs(loops.poles - 3j).min() > 0.1
        other = UncertainLoop(PLANT, BLOCKS, ["u", "v"], ["x", "y"], LAW, ("v", "x"))
        assert loops.reach(DELTAS).sizes == pytest.approx(other.reach(DELTAS).sizes, rel=1e-6)
    else:
        with pytest.raises(bc.InputError, match="not stable"):
            loops.check_gain()


@pytest.mark.parametrize("offset", [0.0, 0.25])
def test_partial_fractions_are_the_gain_without_dead_times(offset):
    """From poles of the closed loop and what each adds; from v to x."""
    first, second = LAW.loop
    law = bc.spec.Controller(loop=(structs.replace(first, delay=0.0), second))
    loops = UncertainLoop(PLANT, BLOCKS, ["u", "v"], ["x", "y"], law, ("v", "x"), offset=offset)
    made = loops.sample(DELTAS)
    omega = np.geomspace(0.05, 30.0, 9)
    g_s = [np.matmul(*reversed(closed_at(DELTAS, w, 0.0))) for w in omega]
    assert loops.gain(DELTAS, omega) == pytest.approx(np.abs(np.array(g_s)[:, 0, 1] + offset))
    assert made.poles.size == 6  # of two modes and two lags
    for pole in made.poles:  # where 1 + K G is singular
        m, delta = value(PLANT, pole), np.diag(DELTAS[BLOCKS])
        inner = np.linalg.solve(np.eye(4) - m[:4, :4] @ delta, m[:4, 4:])
        k = np.array(
            [[0.0, (0.3 * pole + 0.5) / (0.1 * pole + 1.0)], [0.4 / (0.2 * pole + 1.0), 0.0]]
        )
        assert abs(np.linalg.det(np.eye(2) + k @ (m[4:, 4:] + m[4:, :4] @ delta @ inner))) < 1e-9


@pytest.mark.parametrize(("through", "wanted"), [(0.0, False), (1e-9, True), (1e-13, False)])
def test_whether_an_input_reaches_an_output(through, wanted):
    """Two systems side by side, or one of them driven a little by the other's input."""
    a = np.diag([-1.0, -2.0])
    b = np.array([[0.1, 1.0, through], [0.0, 0.0, 1.0]])
    c = 1e3 * np.array([[0.2, 0], [1.0, 0], [0, 1.0]])
    law = bc.spec.Controller(
        loop=(bc.spec.Loop(input="v", output="y", numerator=[1e-3], denominator=[1.0]),)
    )
    made = UncertainLoop((a, b, c, np.zeros((3, 3))), [0], ["u", "v"], ["x", "y"], law, ("v", "x"))
    if wanted:
        made.check_gain()
    else:
        with pytest.raises(bc.InputError, match="does not move"):
            made.check_gain()


def test_a_sample_of_matrices_and_the_factors_of_its_slopes():
    """F_u(M, Delta) = M_yu + M_yw Delta (1 - M_zw Delta)^-1 M_zu, by differences."""
    m = RANDOM.normal(size=(5, 5)) + 1j * RANDOM.normal(size=(5, 5))

    def closed(delta):
        delta = np.diag(delta)
        return m[3:, 3:] + m[3:, :3] @ delta @ np.linalg.solve(
            np.eye(3) - m[:3, :3] @ delta, m[:3, 3:]
        )

    delta = np.array([0.2, 0.0, -0.3])
    found, left, right = (part[0] for part in upper(m[None], delta))
    np.testing.assert_allclose(found, closed(delta), rtol=1e-12)
    wanted = slopes(closed, delta)
    np.testing.assert_allclose(np.einsum("ec,cd->ced", left, right), wanted, rtol=1e-6, atol=1e-8)


class Hill(SimpleNamespace):
    """log reach = -(delta - top)^2 weighted, unstable beyond a sum of deltas."""

    figures = (Figure(0),)

    def reach(self, deltas):
        if deltas.sum() > self.end:
            return Reach(np.array([np.inf]), np.array([10.0 * deltas.sum()]))
        size = np.exp(-(self.weight @ (deltas - self.top) ** 2))
        return Reach(np.array([size]), np.array([5.0]))

    def slope(self, figure, deltas, omega):
        assert (figure, omega) == (0, 5.0)
        return -2.0 * self.weight * (deltas - self.top)

    def corners(self):
        return []


def hill(top, end=np.inf):
    return Hill(top=np.array(top), weight=np.array([1.0, 3.0]), end=end)


def test_a_search_climbs_to_a_top_inside_and_to_a_corner():
    search = Search(hill((0.3, -0.4)))
    search.run([np.array([0.9, 0.9]), np.array([-1.0, 0.2])])
    np.testing.assert_allclose(search.worst(0), [0.3, -0.4], atol=1e-4)
    assert search.sizes == pytest.approx([1.0])
    assert search.stable
    outside = Search(hill((2.0, -3.0)))
    outside.climb(0, np.zeros(2))
    assert outside.tried[-1].tolist() == [1.0, -1.0]
    assert all(np.abs(one).max() <= 1.0 for one in outside.tried)


def test_a_search_ends_in_the_corner_to_which_small_slopes_point():
    slope = np.array([-0.05, 0.05])
    loop = SimpleNamespace(
        figures=(Figure(0),),
        reach=lambda deltas: Reach(np.array([np.exp(slope @ deltas)]), np.ones(1)),
        slope=lambda *_: slope,
    )
    search = Search(loop)
    search.climb(0, np.array([0.3, -0.2]))
    assert search.worst(0).tolist() == [-1.0, 1.0]
    assert search.sizes == pytest.approx([np.exp(0.1)])


def test_every_point_counts_for_every_figure_and_none_is_tried_twice():
    """Two figures whose tops lie apart; what was tried for one is the start of the other."""
    tops, asked, told = np.array([[0.3, -0.4], [-0.5, 0.6]]), [], []

    def reach(deltas):
        asked.append(deltas.tobytes())
        return Reach(np.exp(-((deltas - tops) ** 2).sum(axis=1)), np.array([1.0, 2.0]))

    loop = SimpleNamespace(
        figures=(Figure(0), Figure(1)),
        reach=reach,
        slope=lambda figure, deltas, omega: 2.0 * (tops[int(omega) - 1] - deltas),
        corners=lambda: [np.ones(2)],
    )
    search = Search(loop, told.append)
    search.run([np.zeros(2), np.array([-0.5, 0.59])])
    assert search.tried[1].tolist() == [-0.5, 0.59]
    assert len(set(asked)) == len(asked) == len(search.tried)
    np.testing.assert_allclose(search.found(), tops, atol=1e-3)  # 1e-6 of what they reach
    assert told[-1] == f"samples tried: {len(asked)}"


def test_of_samples_that_reach_as_far_the_first_is_kept():
    sizes = iter([[1.0, 0.2], [1.0 + 1e-9, 0.9], [0.5, 0.9]])
    loop = SimpleNamespace(reach=lambda _: Reach(np.array(next(sizes)), np.ones(2)))
    search = Search(loop)
    for value in (0.0, 0.1, 0.2):
        search.reach(np.array([value]))
    assert [deltas.tolist() for deltas in search.found()] == [[0.0], [0.1]]


def test_an_unstable_sample_ends_a_search_where_stability_does():
    search = Search(hill((0.9, 0.9), end=0.7))
    search.run([np.zeros(2)])
    assert not search.stable
    assert search.worst(0).sum() > 0.7
    unstable = hill((0.9, 0.9), end=0.7)
    assert stability_limit(unstable, np.ones(2)) == pytest.approx(7.0, abs=1e-7)
    early = Search(unstable)
    early.run([np.ones(2), np.zeros(2)])
    assert len(early.tried) == 1


# -- margins of samples ----------------------------------------------------------------------------
def sample_loops():
    return UncertainLoop(PLANT, BLOCKS, ["u", "v"], ["x", "y"], LAW)


def test_the_middle_of_s_and_minus_t_of_a_sample_and_its_slopes():
    """E = S - 1/2; dE / d(delta_c) is a column times a row."""
    made = sample_loops()
    omega = np.array([0.7, 3.0])
    deltas = np.array([DELTAS, -0.4 * DELTAS])
    e, left, right = made._middles(made._factors_at(omega), deltas)
    for k, w in enumerate(omega):
        np.testing.assert_allclose(e[k], closed_at(deltas[k], w)[0] - np.eye(2) / 2.0, rtol=1e-9)
        wanted = slopes(lambda at, w=w: closed_at(at, w)[0], deltas[k])
        found = np.zeros((3, 2, 2), dtype=complex)
        for channel, block in enumerate(BLOCKS):
            found[block] += np.outer(left[k][:, channel], right[k][channel])
        np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=1e-8)


def test_figures_of_every_input_and_of_all():
    made = sample_loops()
    assert made.names == ["u", "v"]
    singles = [(port, ray) for port in (0, 1) for ray in (None, 1.0, -1.0, 1j)]
    assert list(made.figures) == [*singles, (None, None)]
    assert Figure(0, 1j).directions == (1j, -1j)
    assert Figure(0, -1.0).directions == (-1.0,)


def test_the_disk_of_an_input_is_the_peak_of_its_middle():
    ends = "v", "total of v"
    loops = UncertainLoop(PLANT, BLOCKS, ["u", "v"], ["x", "y"], LAW, ends, offset=-0.5)
    omega = np.array([0.5, 2.0])
    wanted = [abs(closed_at(DELTAS, w)[0][1, 1] - 0.5) for w in omega]
    assert loops.gain(DELTAS, omega) == pytest.approx(wanted)


def test_how_far_a_locus_reaches_along_each_ray():
    """One input: straight lines between points."""
    law = bc.spec.Controller(loop=LAW.loop[:1])
    made = UncertainLoop(PLANT, BLOCKS, ["u", "v"], ["x", "y"], law)
    points = np.array([0.1 + 0.3j, 0.9 - 0.1j, -0.6 - 0.5j, -0.5 + 0.3j, -0.1 + 0.7j, 0.2 + 0.2j])
    sizes, at = made._farthest(points[:, None, None])
    # right between the first two, left between the third and fourth; up and down at 0.34 and more
    up = points[4] + (points[5] - points[4]) / 3.0
    assert sizes[0] == pytest.approx(abs(0.9 - 0.1j))
    assert sizes[1] == pytest.approx(0.7)
    assert sizes[2] == pytest.approx(0.6 - 0.1 * 5.0 / 8.0)
    assert sizes[3] == pytest.approx(up.imag)
    assert at.tolist() == [1, 0, 2, 4]
    none = np.full((3, 1, 1), 0.3 + 0.2j)
    assert made._farthest(none)[0] == pytest.approx([abs(0.3 + 0.2j), 1e-9, 1e-9, 1e-9])


def test_of_all_inputs_the_reach_is_the_structured_value():
    """Diagonal: the larger element; of rank one: the sum of the sizes."""
    made = sample_loops()
    e = np.zeros((4, 2, 2), dtype=complex)
    e[0], e[1] = np.diag([0.3, 0.4j]), np.diag([0.9, 0.1])
    e[2] = np.outer([2.0, 0.5], [0.2j, 1.0])  # 0.4 and 0.5
    e[3] = np.diag([0.2, 0.3])
    sizes, at = made._farthest(e)
    assert sizes[-1] == pytest.approx(0.9, rel=1e-4)
    assert at[-1] in (1, 2)
    e[2] *= 1.2
    sizes, at = made._farthest(e)
    assert (sizes[-1], at[-1]) == (pytest.approx(1.08, rel=1e-4), 2)


def test_a_direct_loop_reaches_farthest_at_infinite_frequency():
    """E = (1 + K D)^-1 - 1/2 there, D closed by the deltas: at the second input, not the first."""
    a, b, c, d = PLANT
    direct = np.array([[-0.9, 0.3], [-0.4, 0.7]])
    plant = a, b, 0.3 * c, d + np.pad(direct, ((4, 0), (4, 0)))
    gains = np.diag([-0.9, -0.7])
    law = bc.spec.Controller(
        loop=tuple(
            bc.spec.Loop(input=u, output=y, numerator=[gain], denominator=[1.0])
            for u, y, gain in (("u", "x", -0.9), ("v", "y", -0.7))
        )
    )
    made = UncertainLoop(plant, BLOCKS, ["u", "v"], ["x", "y"], law)

    def middle(m):
        delta = np.diag(DELTAS[BLOCKS])
        inner = delta @ np.linalg.solve(np.eye(4) - m[:4, :4] @ delta, m[:4, 4:])
        return np.linalg.inv(np.eye(2) + gains @ (m[4:, 4:] + m[4:, :4] @ inner)) - np.eye(2) / 2.0

    end = np.abs(np.diag(middle(plant[3])))
    grid = [np.abs(np.diag(middle(value(plant, 1j * w)))) for w in np.geomspace(1e-2, 1e3, 400)]
    top = np.max(grid, axis=0)
    assert (top > end * (1.0 + 1e-9)).tolist() == [True, False]
    sizes, omega = made.reach(DELTAS)
    disks = [made.figures.index(Figure(port)) for port in (0, 1)]
    assert sizes[disks] == pytest.approx([top[0], end[1]], rel=1e-3)
    assert sizes[disks[1]] == pytest.approx(end[1], rel=1e-9)
    assert np.isinf(omega[disks]).tolist() == [False, True]


def test_either_end_of_every_range_is_tried_beside_a_sample():
    moved = [row.tolist() for row in samples_beside(DELTAS)]
    first, second, third = DELTAS
    assert moved == [
        *([end, second, third] for end in (-1.0, 1.0)),
        *([first, end, third] for end in (-1.0, 1.0)),
        *([first, second, end] for end in (-1.0, 1.0)),
    ]
    assert DELTAS.tolist() == [first, second, third]


def test_slopes_of_a_reach_are_those_of_its_logarithm():
    made = sample_loops()
    sizes, omega = made.reach(DELTAS)
    wanted = slopes(lambda at: np.log(made.reach(at).sizes), DELTAS, 1e-2)
    limited = np.flatnonzero(np.isfinite(omega) & (sizes > 0.1))
    assert limited.size >= 6
    for figure in limited:
        found = made.slope(figure, DELTAS, omega[figure])
        assert found == pytest.approx(wanted[:, figure], rel=2e-2, abs=2e-3)


def test_corners_to_which_slopes_point():
    """Every corner is tried whose middle reaches farther than its neighbours, in any direction."""
    made = sample_loops()
    found = made.corners()
    assert found
    # or the middle, from which they start
    assert all(np.all(np.abs(corner) == np.abs(corner[0])) for corner in found)
    assert len({corner.tobytes() for corner in found}) == len(found)
    search = Search(made)
    search.run([np.zeros(3)])
    best = np.max([made.reach(deltas).sizes for deltas in search.found()], axis=0)
    sides = [-1.0, 1.0]
    for corner in np.array([[a, b, c] for a in sides for b in sides for c in sides]):
        assert np.all(made.reach(corner).sizes <= best * (1.0 + 2e-3))


def test_one_turn_of_slopes_goes_to_the_corner_that_reaches_farther(monkeypatch):
    """By differences, at every frequency and along every ray: tops above 1/2 are tried."""
    monkeypatch.setattr("beamchain.robust.uncertain_loop.TURNS", 2)
    monkeypatch.setattr("beamchain.robust.uncertain_loop.SMOOTH", (5, np.zeros(1)))
    made = sample_loops()
    omega = made.closed(np.zeros(3)).frequencies(5, np.zeros(1))
    middles, steep = [], []
    for w in omega:
        middles.append({(0.0, 0.0, 0.0): closed_at(np.zeros(3), w)[0] - np.eye(2) / 2.0})
        steep.append(slopes(lambda at, w=w: closed_at(at, w)[0], np.zeros(3)))
        for corner in product((-1.0, 1.0), repeat=3):
            middles[-1][corner] = closed_at(np.array(corner), w)[0] - np.eye(2) / 2.0
    wanted = set()
    for i, ray in product(range(2), (None, 1.0, -1.0, 1j, -1j)):
        best, farthest = [], []
        for middle, slope in zip(middles, steep, strict=True):
            nominal = middle[0.0, 0.0, 0.0][i, i]
            along = np.conj(nominal / abs(nominal) if ray is None else ray)
            rising = (slope[:, i, i] * along).real
            corner = tuple(np.where(rising < 0.0, -1.0, 1.0))
            there = middle[corner][i, i]
            reached = abs(there) if ray is None else (there * along).real
            before = (nominal * along).real
            best.append(corner if reached > before else (0.0, 0.0, 0.0))
            farthest.append(max(before, reached))
        ends = np.concatenate([[-np.inf], farthest, [-np.inf]])
        for k, far in enumerate(farthest):
            if far >= ends[k] and far >= ends[k + 2] and far > 0.5:
                wanted.add(best[k])
    assert {tuple(corner) for corner in made.corners()} == wanted
    assert len(wanted) > 1


def test_corners_of_every_direction_are_those_of_its_slopes(monkeypatch):
    """E = e + 0.3 s1 d1 + s2 d2 of three frequencies, the middle one the top; the corner of a
    direction has the signs of the slopes along it."""
    middles = np.array([0.5, 2.0 - 3.0j, 0.4])
    slopes_there = np.array([0.3 + 0.1j, 0.05 - 0.4j])
    made = UncertainLoop.__new__(UncertainLoop)
    made.count, made.blocks, made.offset = 2, np.array([0, 1, 1]), -0.5
    made.figures = tuple(Figure(0, ray) for ray in (None, 1.0, -1.0, 1j))
    still = SimpleNamespace(frequencies=lambda *_: np.array([1.0, 2.0, 3.0]))
    monkeypatch.setattr(made, "closed", lambda deltas: still, raising=False)
    every = SimpleNamespace(shifts=1, at=np.arange(3), some=lambda at: SimpleNamespace(at=at))
    monkeypatch.setattr(made, "_factors_at", lambda *_: every, raising=False)

    def affine(responses, deltas):
        e = middles[responses.at] + deltas @ slopes_there
        left = np.array([[0.2 + 0.5j, 1.3 - 0.2j, 0.4 + 0.1j]])
        of_channels = np.array([slopes_there[0], 0.4 * slopes_there[1], 0.6 * slopes_there[1]])
        right = (of_channels / left[0])[:, None]
        whole = np.ones((e.size, 1, 1))
        return e[:, None, None], whole * left, whole * right

    monkeypatch.setattr(made, "_middles", affine, raising=False)
    # the size, and the real axis: towards 2 - 3j, then 1; -1j; -1 and 1j lead away from 1/2
    assert {tuple(corner) for corner in made.corners()} == {(1.0, 1.0), (-1.0, 1.0)}


def margin(at, kind, worst):
    return LeastMargin(at, kind, "", 1.0, worst, 2.0, {}, None, {})


def test_the_least_of_margins_is_that_which_leaves_the_least():
    rows = (
        margin("u", "disk", 0.9), margin("v", "disk", 0.7),
        margin("all loops at once", "disk", 0.4),
        margin("u", "phase", -30.0), margin("v", "phase", 40.0),
        margin("u", "gain down, factor", 0.3), margin("v", "gain down, factor", 0.6),
        margin("u", "gain up, factor", 2.0), margin("v", "gain up, factor", 1.5),
    )  # fmt: skip
    found = WorstMargins(rows, True, {})
    assert found.least().at == "v"
    assert found.least("phase").worst == -30.0
    assert found.least("gain down, factor").worst == 0.6
    assert found.least("gain up, factor").worst == 1.5
    assert found.all_at_once.worst == 0.4
    assert (len(found), found[1].at) == (9, "v")
    with pytest.raises(bc.InputError, match="delay"):
        found.least("delay")


# -- a controller that is stepped ------------------------------------------------------------------
def test_loops_are_stepped_by_the_trapezoidal_rule():
    random = np.random.default_rng(2)
    a, b, c, d = (random.normal(size=shape) for shape in ((3, 3), (3, 2), (2, 3), (2, 2)))
    h, x, y = 0.13, random.normal(size=3), random.normal(size=(5, 2))
    made = SteppedController((a, b, c, d), h, x, y[0])
    for now, following in zip(y, y[1:], strict=False):
        assert made.free + made.gain @ now == pytest.approx(c @ x + d @ now)
        made.advance(now)
        right = (np.eye(3) + h / 2.0 * a) @ x + h / 2.0 * b @ (now + following)
        x = np.linalg.solve(np.eye(3) - h / 2.0 * a, right)


def craft_with(fastest):
    a = np.array([[0.0, 1.0], [-(fastest**2), 0.0]])
    return SimpleNamespace(linear=SimpleNamespace(first_order=lambda: (a, None, None, None)))


@pytest.mark.parametrize(
    ("fastest", "omega", "settling", "window", "span", "still"),
    [
        (10.0, 2.0, 7.0, 400, np.pi, False),
        (1000.0, 2.0, 7.0, 1571, np.pi, False),  # ceil(500 pi)
        (1000.0, 1e-3, 7.0, 3500, 7.0, True),
        (10.0, 2e-3, 7.0, 15708, 1000.0 * np.pi, False),  # 0.014 rad: not still
        (10.0, 0.0, 7.0, None, None, None),
    ],
)
def test_how_a_run_goes(fastest, omega, settling, window, span, still):
    if window is None:
        with np.errstate(all="ignore"), pytest.raises(ZeroDivisionError):
            plan_of_run(craft_with(fastest), omega, settling)
        return
    run = plan_of_run(craft_with(fastest), omega, settling)
    assert (run.window, run.still) == (window, still)
    assert run.timestep == pytest.approx(span / window)
    assert run.steps == int(np.ceil(settling / run.timestep)) + window
    assert whole_count(2.1) == 3
    assert whole_count(1e9) == 300_001


def test_the_amplitude_of_a_run(monkeypatch):
    """A sine beside what drifts, and a mean of what hardly turns."""

    def measured(omega):
        def measure(_, __, ___, run):
            t = run.timestep * np.arange(run.steps - run.window, run.steps)
            return t, 0.3 * np.cos(omega * t) - 0.4 * np.sin(omega * t) + 5.0 - 0.2 * t

        return measure

    monkeypatch.setattr("beamchain.robust.simulated_gain._measure", measured(2.0))
    assert simulated_gain(craft_with(10.0), None, ("u", "y"), 2.0, 7.0) == pytest.approx(0.5)
    assert np.isnan(simulated_gain(craft_with(10.0), None, ("u", "y"), 2.0, 3000.0))
    assert np.isfinite(simulated_gain(craft_with(10.0), None, ("u", "y"), 2.0, 2350.0))

    def still(_, __, ___, run):
        t = run.timestep * np.arange(run.window)
        return t, -0.7 * np.cos(1e-3 * t)

    monkeypatch.setattr("beamchain.robust.simulated_gain._measure", still)
    assert simulated_gain(craft_with(10.0), None, ("u", "y"), 1e-3, 7.0) == pytest.approx(0.7)
    monkeypatch.setattr(
        "beamchain.robust.simulated_gain._measure", lambda *_: (np.ones(3), np.full(3, np.nan))
    )
    assert np.isnan(simulated_gain(craft_with(10.0), None, ("u", "y"), 2.0, 7.0))


OSCILLATOR = """<mujoco><option gravity="0 0 0"/><worldbody><body>
<joint name="x" type="slide" stiffness="18" damping="1.1"/><inertial pos="0 0 0" mass="2"
diaginertia="1 1 1"/><site name="on"/></body></worldbody><actuator>
<motor name="push" joint="x" gear="3"/>
<general name="slow" joint="x" dyntype="filter" dynprm="0.2" gainprm="5"/></actuator>
<sensor><jointpos name="at" joint="x"/><accelerometer name="felt" site="on"/></sensor></mujoco>"""
STEPPED_LAW = bc.spec.Controller(
    loop=(
        bc.spec.Loop(input="push", output="at", numerator=[2.0, 4.0], denominator=[0.1, 1.0]),
        bc.spec.Loop(input="slow", output="felt_z", numerator=[0.3, 0.5], denominator=[0.2, 1.0]),
        bc.spec.Loop(input="push", output="felt_z", numerator=[0.2], denominator=[1.0]),
    )
)


@pytest.mark.parametrize(("driven", "seen"), list(product(("push", "slow"), ("at", "felt_z"))))
def test_a_run_is_the_steady_motion_from_its_first_step(driven, seen):
    """2 x'' + 1.1 x' + 18 x = 3 u + 5 a, 0.2 a' = v - a; u and v read x and its acceleration,
    which a force changes at once."""
    craft = linear_craft(
        mujoco.MjModel.from_xml_string(OSCILLATOR), None, None, None, ["at", "felt"]
    )
    omega, s = 2.5, 2.5j
    run = plan_of_run(craft, omega, 0.0)._replace(steps=40, window=30)
    times, found = measured_in_mujoco(craft, STEPPED_LAW, (driven, seen), run)
    x = np.array([3.0, 5.0 / (0.2 * s + 1.0)]) / (2.0 * s**2 + 1.1 * s + 18.0)
    g = np.array([x, s**2 * x])
    law = np.array([[(2.0 * s + 4.0) / (0.1 * s + 1.0), 0.2],
                    [0.0, (0.3 * s + 0.5) / (0.2 * s + 1.0)]])  # fmt: skip
    closed = np.linalg.solve(np.eye(2) + g @ law, g)
    gain = closed[("at", "felt_z").index(seen), ("push", "slow").index(driven)]
    np.testing.assert_allclose(times, run.timestep * np.arange(10, 40))
    wanted = (gain * np.exp(s * times)).real
    np.testing.assert_allclose(found, wanted, atol=5e-5 * abs(gain))


def test_a_run_stays_small_however_much_an_input_moves():
    """A site 2 m from a hinge with a spring, under a motor of 1e6 N m, moves by 2 sin(turn)."""
    text = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="x" axis="0 1 0"
    stiffness="20" damping="0.4"/><inertial pos="0 0 0" mass="2" diaginertia="2.5 2.5 2.5"/>
    <site name="end" pos="0 0 2"/></body></worldbody>
    <actuator><motor name="push" joint="x" gear="1e6"/></actuator>
    <sensor><framepos name="at" objtype="site" objname="end"/></sensor></mujoco>"""
    craft = linear_craft(mujoco.MjModel.from_xml_string(text), None, None, None, ["at"])
    run = plan_of_run(craft, 3.0, 0.0)._replace(steps=20, window=20)
    law = bc.spec.Controller(
        loop=(bc.spec.Loop(input="push", output="at_x", numerator=[2e-6], denominator=[1.0]),)
    )
    times, found = measured_in_mujoco(craft, law, ("push", "at_x"), run)
    gain = 2e6 / (20.0 + 4.0 - 2.5 * 9.0 + 0.4 * 3.0j)
    wanted = (gain * np.exp(3.0j * times)).real
    np.testing.assert_allclose(found, wanted, atol=5e-5 * abs(gain))


def test_a_run_reads_the_rate_beside_that_of_the_point():
    """2.5 kg m^2 turning at 2 rad/s, held by 0.7 N m per rad/s beside that and 0.1 per rad/s^2."""
    text = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus">
    <joint name="x" axis="0 0 1"/><inertial pos="0 0 0" mass="2" diaginertia="2.5 2.5 2.5"/></body>
    </worldbody><actuator><motor name="push" joint="x"/></actuator>
    <sensor><frameangacc name="turned" objtype="body" objname="bus"/></sensor></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    craft = linear_craft(model, None, {"x": 2.0}, None, ["rate", "turned"])
    run = plan_of_run(craft, 3.0, 0.0)._replace(steps=20, window=20)
    law = bc.spec.Controller(
        loop=(
            bc.spec.Loop(input="push", output="rate_z", numerator=[0.7], denominator=[1.0]),
            bc.spec.Loop(input="push", output="turned_z", numerator=[0.1], denominator=[1.0]),
        )
    )
    times, found = measured_in_mujoco(craft, law, ("push", "rate_z"), run)
    gain = 1.0 / (2.6 * 3.0j + 0.7)
    wanted = (gain * np.exp(3.0j * times)).real
    np.testing.assert_allclose(found, wanted, atol=5e-5 * abs(gain))


@pytest.mark.parametrize("proved", [0.0, None, 0.4])
def test_what_is_proved_has_a_column_where_something_is(proved):
    row = LeastMargin("u", "disk", "", 0.9, 0.7, 1.3, {}, proved, {})
    free = LeastMargin("u", "phase", "degrees", 40.0, 30.0, 2.0, {}, 0.0, {})
    table = worst_margin_table([WorstMargins((row, free), True, {}, "")])
    columns = {column.key: list(column.values) for column in table.columns}
    assert columns["nominal"] == [0.9, 40.0]
    assert columns["worst"] == [0.7, 30.0]
    assert columns["frequency"] == [1.3, 2.0]
    assert columns.get("proved") == ([proved, 0.0] if proved else None)


def test_a_phase_that_may_rise_is_looked_for_on_the_negative_imaginary_axis():
    """4 s^2 / (s + 1)^2 is of size one at 1 / sqrt(3), at 120 degrees: E = -j / (2 tan(30))."""
    plant = (
        np.array([[0.0, 1.0], [-1.0, -2.0]]), np.array([[0.0], [1.0]]), np.array([[-1.0, -2.0]]),
        np.ones((1, 1)),
    )  # fmt: skip
    law = bc.spec.Controller(
        loop=(bc.spec.Loop(input="u", output="y", numerator=[4.0], denominator=[1.0]),)
    )
    made = UncertainLoop(plant, [], ["u"], ["y"], law)
    found = made.reach(np.zeros(0))
    at = made.figures.index(Figure(0, 1j))
    assert found.sizes[at] == pytest.approx(np.sqrt(3.0) / 2.0, rel=1e-3)
    assert found.omega[at] == pytest.approx(1.0 / np.sqrt(3.0), rel=1e-2)
