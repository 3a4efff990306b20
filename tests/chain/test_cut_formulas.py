"""Integrals beside the margin of a cut, and cuts whose best place is seen at once."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import block_diag, eigh

from beamchain import Beam, Equivalent, Segment
from beamchain.errors import RealisationError
from formulas import (
    Effort,
    HingeDemand,
    Margins,
    ModeGroup,
    best_cut,
    choose_cut,
    climb,
    even_cut,
    fewest_hinges,
    margin_sentence,
    merge_close,
    patterns_of_cuts,
    shortest_link,
    whitening,
)

ROUNDED = 1e-12
ENOUGH = 0.02  # margin that is asked for


# -- the margin ------------------------------------------------------------------------------------
def test_the_shortest_link_is_over_the_length():
    assert shortest_link(np.array([0.4, 1.0]), 4.0) == pytest.approx(0.1)
    assert shortest_link(np.array([0.8, 1.4, 3.7]), 4.0) == pytest.approx(0.3 / 4.0)
    # a hinge at the root leaves no link before it
    assert shortest_link(np.array([0.9e-9 * 4.0, 1.0]), 4.0) == pytest.approx(0.25)
    assert shortest_link(np.array([1.1e-9 * 4.0, 1.0]), 4.0) == pytest.approx(1.1e-9)
    assert shortest_link(np.zeros(0), 4.0) == 1.0


def test_what_measures_a_block_makes_it_a_unit():
    """So that the least eigenvalue of what is seen with it is that of the pair."""
    random = np.random.default_rng(5)
    roots = random.normal(size=(4, 3, 3))
    blocks = roots @ roots.swapaxes(1, 2) + 0.1 * np.eye(3)
    blocks[2, 0, 0] = -0.1  # not positive
    left = random.normal(size=(3, 3))
    left = left + left.T
    for k, own in enumerate(whitening(blocks)):
        if k == 2:
            assert not np.all(np.isfinite(own))
            continue
        assert own.T @ blocks[k] @ own == pytest.approx(np.eye(3), abs=1e-12)
        wanted = eigh(left, blocks[k], eigvals_only=True)[0]
        assert np.linalg.eigvalsh(own.T @ left @ own)[0] == pytest.approx(wanted, rel=1e-9)
    assert not np.all(np.isfinite(whitening(np.zeros((1, 2, 2)))))


LENGTH, POLAR = 2.0, 0.3
ROD = Equivalent(bending_stiffness_xy=1.0, linear_mass=0.5, polar_inertia=POLAR)
LINE = Beam(segments=(Segment(length=LENGTH, section=ROD),))


def integrals(x, places=(), *, twists=False):
    """P over the motion of further places, and Q, of a rod with hinges at `x`, in a plane; with a
    twist as well."""
    rod = np.poly1d([0.5])
    along = np.poly1d([0.5, 0.0])
    arms = [np.poly1d([1.0, -at]) for at in x]
    pairs = list(zip(arms, x, strict=True))

    def over(polynomial, start):
        whole = np.polyint(polynomial)
        return whole(LENGTH) - whole(start)

    behind = POLAR * (LENGTH - x)
    none = np.zeros(x.size)
    bent = [
        [over(rod * arm, at) for arm, at in pairs],
        [over(along * arm, at) for arm, at in pairs],
    ]
    rows = [[*row, *none] for row in bent] + [[*none, *behind]] * twists
    for place in places:
        before = 1.0 * (x < place)
        rows += [[*((place - x) * before), *none], [*before, *none]]
        rows += [[*none, *before]] * twists
    inertia = np.zeros((2 * x.size, 2 * x.size))
    for k, (a, p) in enumerate(pairs):
        inertia[k, : x.size] = [over(rod * a * b, max(p, q)) for b, q in pairs]
        inertia[x.size + k, x.size :] = POLAR * (LENGTH - np.maximum(x, p))
    keep = slice(None) if twists else slice(x.size)
    return np.array(rows)[:, keep], inertia[keep, keep]


def least_of(rows, kinematics, inertia, m=2):
    """Least of `P Q^-1 P^T - L^T L` over `M - L^T L`, of further places over their own motion."""
    mass = np.diag([1.0, 4.0 / 3.0, POLAR * LENGTH][:m])
    mass[0, 1] = mass[1, 0] = 1.0
    reached = kinematics @ np.linalg.solve(inertia, kinematics.T)
    blocks = [mass - rows[:, :m].T @ rows[:, :m]]
    blocks += [reached[k : k + m, k : k + m] for k in range(m, len(reached), m)]
    return eigh(reached - rows.T @ rows, block_diag(*blocks), eigvals_only=True)[0]


@pytest.mark.parametrize("ports", [("xy",), ("xz",), ("xz", "torsion"), ("xy", "torsion")])
@pytest.mark.parametrize("further", [(), (1.0,), (1.0, 1.5)])
def test_margin_of_a_uniform_rod_s_cut(ports, further):
    x = np.array([0.2, 0.6, 1.2, 1.4, 1.6])
    kinematics, inertia = integrals(x, further, twists=len(ports) > 1)
    random = np.random.default_rng(1)
    rows = 0.1 * random.normal(size=(2, len(kinematics)))
    group = ModeGroup(ports, np.array([1.0, 2.0]), rows, np.zeros(2))
    search = Margins(LINE.line, (HingeDemand(group, dict.fromkeys(ports, 5), {}),), further)
    margin, chosen, margins = search.assigned(x)
    assert margin == pytest.approx(
        least_of(rows, kinematics, inertia, 2 + ("torsion" in ports)), rel=1e-6
    )
    assert margins == [margin]
    assert chosen == [[(k, port) for k in range(5) for port in sorted(ports)]]
    assert search.effort.tried == 1 + 5 * len(ports) // 8
    assert search.value(x) == margin
    assert search.value(x[::-1]) == -np.inf
    assert search.value(np.array([0.2, 0.6, 1.2, 1.4, 1.4 + 1.8e-3])) == -np.inf
    assert np.isfinite(search.value(np.array([0.2, 0.6, 1.2, 1.4, 1.4 + 2.2e-3])))


def masses_behind(x):
    """`(h, 6, 6)` of what lies behind places along the rod, about the root."""
    out = np.zeros((x.size, 6, 6))
    for mass, at in zip(out, x, strict=True):
        line, arm, turned = (0.5 * (LENGTH**k - at**k) / k for k in (1, 2, 3))
        np.fill_diagonal(mass, [line, line, line, POLAR * (LENGTH - at), turned, turned])
        mass[1, 5] = mass[5, 1] = arm
        mass[2, 4] = mass[4, 2] = -arm
    return out


@pytest.mark.parametrize("further", [(), (1.0,), (1.0, 1.5)])
def test_margins_of_several_choices_at_once_are_those_of_each(further):
    """Three of five hinges; those with a hinge that has nothing behind it do not disturb the
    others."""
    x = np.array([0.2, 0.4, 0.7, 0.9, 1.6])
    rows = 0.1 * np.random.default_rng(2).normal(size=(2, 2 + 2 * len(further)))
    group = ModeGroup(("xy",), np.array([1.0, 2.0]), rows, np.zeros(2))
    demand = HingeDemand(group, {"xy": 3}, {})
    search = Margins(LINE.line, (demand,), further)
    picks = [(0, 1, 4), (0, 1, 2), (1, 2, 4), (0, 2, 3)]
    choices = [[(k, "xy") for k in pick] for pick in picks]
    found = search.margins(demand, x, choices, masses_behind(x))
    wanted = [least_of(rows, *integrals(x[list(pick)], further)) for pick in picks]
    assert found == pytest.approx(wanted, rel=1e-6)
    ended = np.array([*x[:4], LENGTH])
    found = search.margins(demand, ended, choices, masses_behind(ended))
    assert found[[0, 2]].tolist() == [-np.inf] * 2
    assert found[[1, 3]] == pytest.approx([wanted[1], wanted[3]], rel=1e-6)


@pytest.mark.parametrize(
    ("size", "taken"),
    [
        (0.2, (0, 3)),  # spread evenly, though others have more
        (0.45, (0, 1)),  # the first pair after that with enough
        (0.55, (0, 1)),  # none has enough: the best
    ],
)
def test_the_first_choice_with_enough_or_the_best_is_taken(size, taken):
    """Two of six hinges: spread evenly, the first two, then pair by pair."""
    x = np.array([0.1, 0.2, 0.4, 1.0, 1.2, 1.7])
    rows = size * np.array([[0.0, 1.0]])
    group = ModeGroup(("xy",), np.ones(1), rows, np.zeros(1))
    search = Margins(LINE.line, (HingeDemand(group, {"xy": 2}, {}),), ())
    margin, (chosen,), _ = search.assigned(x)
    assert chosen == [(k, "xy") for k in taken]
    wanted = least_of(rows, *integrals(x[list(taken)]))
    assert margin == pytest.approx(wanted, rel=1e-4, abs=1e-5)
    assert (wanted < ENOUGH) == (size == 0.55)


def test_the_least_margin_of_all_groups_and_no_more_of_them_than_are_asked_for():
    x = np.array([0.2, 0.6])
    small, large = (
        ModeGroup((port,), np.ones(1), np.array([[part, 0.0]]), np.zeros(1))
        for port, part in (("xy", 0.1), ("xz", 0.4))
    )
    wanted = [HingeDemand(group, {group.ports[0]: 2}, {}) for group in (large, small)]
    both = [least_of(group.rows, *integrals(x)) for group in (large, small)]
    assert both[0] < ENOUGH < both[1]
    found = Margins(LINE.line, tuple(wanted), ()).assigned(x)
    assert found[2] == pytest.approx(both, rel=1e-6)
    assert found[0] == found[2][0]
    assert Margins(LINE.line, tuple(wanted), ()).assigned(x, whole=False)[2] == [found[0]]
    turned = Margins(LINE.line, tuple(wanted[::-1]), ())
    assert turned.assigned(x, whole=False)[2] == found[2][::-1]


def test_a_group_takes_fixed_hinges_and_spreads_the_others():
    """Of a rod that has nothing to twist, so that no choice is better than the first."""
    x = np.array([0.2, 0.6, 1.0, 1.4, 1.8])
    group = ModeGroup(("torsion",), np.zeros(0), np.zeros((0, 1)), np.zeros(0))
    thin = Equivalent(bending_stiffness_xy=1.0, linear_mass=0.5)
    line = Beam(segments=(Segment(length=2.0, section=thin),)).line
    for fixed, count, hinges in (
        ((), 2, [0, 2]),
        ((), 3, [0, 1, 3]),
        ((1.4 + 1.9e-9,), 3, [0, 2, 3]),
        ((1.4 + 2.1e-9,), 3, [0, 1, 3]),
        ((1.4, 0.2), 2, [0, 3]),
        ((), 5, [0, 1, 2, 3, 4]),
        ((), 9, [0, 1, 2, 3, 4]),
    ):
        wanted = HingeDemand(group, {"torsion": count}, {"torsion": fixed})
        margin, ((*chosen,),), _ = Margins(line, (wanted,), ()).assigned(x)
        assert [i for i, _ in chosen] == hinges
        assert margin == -np.inf


def test_wanted_hinges_grow_in_all_ports_and_shrink_in_one():
    group = ModeGroup(("xy", "torsion"), np.ones(1), np.ones((1, 3)), np.zeros(1))
    wanted = HingeDemand(group, {"xy": 3, "torsion": 1}, {})
    assert wanted.more().counts == {"xy": 4, "torsion": 2}
    assert wanted.more().fewer("xy").counts == {"xy": 3, "torsion": 2}


# -- the search ------------------------------------------------------------------------------------
def told(margin, length=2.0, further=()):
    """A search of which the margin of hinges is told."""

    def value(x, *, whole=True):
        del whole
        return margin(x) if shortest_link(x, length) >= 1e-3 else -np.inf

    return SimpleNamespace(
        line=SimpleNamespace(length=length), effort=Effort(), further=further, value=value
    )


def test_places_that_are_one():
    close = 4.0 * 1e-9
    found = merge_close([0.5, 0.2 + 0.9 * close, 0.2, 0.5 + 1.1 * close], 4.0)
    assert found.tolist() == [0.2, 0.5, 0.5 + 1.1 * close]


def test_the_worst_group_is_told_with_its_share():
    groups = [SimpleNamespace(modes=SimpleNamespace(ports=p)) for p in (("xy",), ("xz", "axial"))]
    assert "in xz and axial the limp chain weighs 1.25 times" in margin_sentence(
        groups, [0.1, -0.25]
    )
    assert "0.98 is the limit" in margin_sentence(groups, [0.1, -0.25])
    assert "in xy leave" in margin_sentence(groups, [-np.inf, 0.1])


def test_patterns_are_even_in_a_root_of_the_place():
    found = [pattern(0.2) for pattern in patterns_of_cuts(2.0, 3, ())]
    for x, power in zip(found, (1.0, 1.5, 2.0, 3.0, 4.0), strict=True):
        even = np.linspace(0.2 ** (1.0 / power), 1.0, 4)[:-1]
        assert x == pytest.approx(2.0 * even**power, rel=ROUNDED)
    (only,) = patterns_of_cuts(2.0, 1, ())
    assert only(0.2) == pytest.approx([0.4])


def test_patterns_by_a_further_port_stand_about_it():
    """At -1 and -0.4, -1 and 0.5, -0.5 and 0.5 of each distance; the rest up to 0.97 before."""
    found = [pattern(0.5) for pattern in patterns_of_cuts(2.0, 3, (1.8,))]
    wanted = []
    for gap in (0.6, 0.4, 0.268, 0.18, 0.12, 0.08, 0.04):
        for first, second in ((-1.0, -0.4), (-1.0, 0.5), (-0.5, 0.5)):
            own = [1.8 + gap * t for t in (first, second) if 1.8 + gap * t < 2.0]
            for power in (1.0, 1.5, 2.0):
                even = np.linspace(0.5 ** (1.0 / power), 1.0, 4 - len(own))[:-1]
                wanted.append([*(0.97 * own[0] * even**power), *own])
    assert len(found) == len(wanted)
    for x, y in zip(found, wanted, strict=True):
        assert x == pytest.approx(y, rel=ROUNDED)
    # more of them than there are hinges
    assert list(patterns_of_cuts(2.0, 1, (1.0,))) == []


@pytest.mark.parametrize(
    ("most", "fixed"), [(0.3, ()), (0.05, ()), (0.004, ()), (0.05, (1.1,)), (0.004, (1.1,))]
)
def test_the_longest_shortest_link_of_all_patterns(most, fixed):
    """Hinges before `most` leave enough."""
    search = told(lambda x: ENOUGH if x[0] <= 2.0 * most else most - x[0])
    fixed = np.array(fixed)
    found, margin = best_cut(search, fixed, 3)
    every = [
        np.sort(np.concatenate([fixed, pattern(float(a))]))
        for pattern in patterns_of_cuts(2.0, 3, ())
        for a in np.geomspace(0.5, 0.002, 24)
    ]
    kept = [x for x in every if search.value(x) >= ENOUGH]
    longest = max(shortest_link(x, 2.0) for x in kept)
    assert margin == ENOUGH
    assert shortest_link(found, 2.0) == pytest.approx(longest)
    assert found[0] <= 2.0 * most


def test_without_free_hinges_the_fixed_ones_are_all():
    found, margin = best_cut(told(lambda x: x[0]), np.array([0.3, 0.9]), 0)
    assert (found.tolist(), margin) == ([0.3, 0.9], 0.3)


def test_where_none_is_enough_the_best_is_climbed_from():
    """A hill of 0.01 at 0.73 m."""
    found, margin = best_cut(told(lambda x: 0.01 - (x[0] - 0.73) ** 2), np.zeros(0), 1)
    assert found == pytest.approx([0.73], abs=5e-3)
    assert margin == pytest.approx(0.01, abs=1e-4)


@pytest.mark.parametrize("further", [(), (1.0,)])
def test_a_climb_ends_at_a_tenth_or_at_the_top(further):
    """A hill of 0.5 at 0.74 m, beside a fixed hinge."""
    search = told(lambda x: 0.5 - 2.0 * (x[0] - 0.74) ** 2, further=further)
    start, fixed = np.array([0.05, 1.2]), np.array([1.2])
    found, margin = climb(search, fixed, search.value(start), start)
    assert found[1] == 1.2
    assert margin == search.value(found)
    if further:
        assert found[0] == pytest.approx(0.74, abs=5e-3)
    else:
        assert 0.1 <= margin < 0.45


@pytest.mark.parametrize(
    ("margin", "count", "tried", "climbs"),
    [
        (-0.64, 3, 0, True),
        (-0.66, 3, 0, False),  # hopeless
        (-0.66, 2, 0, True),
        (-np.inf, 1, 0, False),
        (-0.1, 1, 8001, False),
        (-0.1, 1, 8000, True),
    ],
)
def test_what_is_climbed_from(margin, count, tried, climbs):
    search = told(lambda x: 0.05 - (x[0] - 0.5) ** 2)
    search.effort.tried = tried
    start = np.linspace(0.1, 1.5, count)
    found, reached = climb(search, np.zeros(0), margin, start)
    assert (found is start) == (not climbs)
    assert (reached == margin) == (not climbs)


def test_a_climb_that_leads_down_is_not_taken():
    start = np.array([0.5])
    found, reached = climb(told(lambda x: -abs(x[0] - 0.5)), np.zeros(0), 0.3, start)
    assert found is start
    assert reached == 0.3


def test_hinges_go_to_the_middle_between_their_neighbours():
    found = even_cut(told(lambda _: ENOUGH), np.array([0.1, 0.5, 1.0]), np.array([1.0]))
    # between the root and 1 m the two converge as (1 / 4)^sweeps
    assert found == pytest.approx([1.0 / 3.0, 2.0 / 3.0, 1.0], abs=1e-3)
    (found,) = even_cut(told(lambda _: ENOUGH), np.array([0.1]), np.zeros(0))
    assert found == pytest.approx(1.0)


@pytest.mark.parametrize("off", [1.9e-6, 2.1e-6])
def test_hinges_do_not_go_a_millionth_of_the_length(off):
    """Of 2 m; the middle before a fixed hinge is as near."""
    start = np.array([0.5 - off, 1.0])
    found = even_cut(told(lambda _: ENOUGH), start, start[1:])
    assert found[0] == (start[0] if off < 2e-6 else 0.5)


def test_hinges_go_as_far_as_the_margin_allows():
    """From 0.4 towards 1: half of the way, then thrice 0.03 of the rest."""
    (found,) = even_cut(told(lambda x: ENOUGH * (x[0] <= 0.7295)), np.array([0.4]), np.zeros(0))
    assert found == pytest.approx(1.0 - 0.3 * 0.97**3, rel=1e-9)
    assert even_cut(told(lambda x: -1.0), np.array([0.4]), np.zeros(0)).tolist() == [0.4]


def test_a_first_hinge_in_the_middle_is_tried():
    found, _ = best_cut(told(lambda _: ENOUGH), np.zeros(0), 1)
    assert found == pytest.approx([1.0])


def test_a_port_gives_up_the_hinges_that_another_needed():
    """Bending needs the third hinge, torsion has no need of a second one."""
    x, rows = np.array([0.3, 0.8, 1.4]), 0.374 * np.array([[0.0, 1.0, 0.0]])
    kinematics, inertia = integrals(x, twists=True)
    enough = {}
    for bent, twisted in ((2, 1), (2, 2), (3, 1), (3, 2)):
        taken = [*range(bent), *range(3, 3 + twisted)]
        share = least_of(rows, kinematics[:, taken], inertia[np.ix_(taken, taken)], 3)
        enough[bent, twisted] = bool(share >= ENOUGH)
    assert enough == {(2, 1): False, (2, 2): False, (3, 1): True, (3, 2): True}
    group = ModeGroup(("xy", "torsion"), np.ones(1), rows, np.zeros(1))
    first = HingeDemand(group, {"xy": 2, "torsion": 1}, {})
    search = Margins(LINE.line, (first.more(),), ())
    (found,) = fewest_hinges(search, x, [first])
    assert found.counts == {"xy": 3, "torsion": 1}


def test_hinges_are_added_where_there_are_too_few_for_any_margin(monkeypatch):
    """A rod that twists, with a port at 1 m: one hinge cannot move it and the root apart."""
    for name, few in (("SWEEPS", 1), ("NEAR", (0.2,)), ("SPREADS", np.array([0.3]))):
        monkeypatch.setattr(f"beamchain.chain.cut.{name}", few)
    group = ModeGroup(("torsion",), np.ones(1), np.array([[0.1, 0.0]]), np.zeros(1))
    found = choose_cut(LINE.line, [HingeDemand(group, {"torsion": 1}, {})], (), (1.0,))
    assert (found.added, found.ports) == (1, (("torsion",),) * 2)
    behind = POLAR * (LENGTH - found.x)
    moved = np.array([behind, found.x < 1.0])
    reached = moved @ np.linalg.solve(np.minimum.outer(behind, behind), moved.T)
    blocks = np.diag([POLAR * LENGTH - 0.01, reached[1, 1]])
    share = eigh(reached - np.diag([0.01, 0.0]), blocks, eigvals_only=True)[0]
    assert found.margin == pytest.approx(share, rel=1e-4)
    assert found.margin >= ENOUGH


@pytest.mark.parametrize(
    ("most", "searches"), [(0, [1]), (1, [1, 2, 3, 4]), (3, [1, 2, 3, 4, 5, 6])]
)
def test_hinges_are_added_for_the_modes_and_for_every_line(most, searches, monkeypatch):
    """Three hinges are needed and two stand at lines."""
    free = list[int]()

    def best(search, fixed, count):
        assert fixed.tolist() == [0.4, 1.3]
        assert [wanted.counts["xy"] for wanted in search.wanted] == [2 + count]
        free.append(count)
        return fixed, -np.inf

    monkeypatch.setattr("beamchain.chain.cut._best", best)
    group = ModeGroup(("xy",), np.ones(1), np.array([[0.1, 0.2]]), np.zeros(1))
    with pytest.raises(RealisationError, match=f"hinges tried: {len(searches) - 1}"):
        choose_cut(LINE.line, [HingeDemand(group, {"xy": 3}, {})], (1.3, 0.4, 0.4), (), most)
    assert free == searches


def test_where_modes_take_all_mass_of_the_root_its_share_is_of_almost_nothing():
    """A twist whose modes take all of `J L`, of which 1e-11 counts as left: a hinge at x lets go of
    `J (L - x)`."""
    rows = np.array([[np.sqrt(POLAR * LENGTH)]])
    group = ModeGroup(("torsion",), np.ones(1), rows, np.zeros(1))
    search = Margins(LINE.line, (HingeDemand(group, {"torsion": 1}, {}),), ())
    for part in (0.0, 0.4, 2.5):
        margin = search.assigned(np.array([part * 1e-11 * LENGTH]))[0]
        assert margin == pytest.approx(1.0 - part, abs=1e-3)
