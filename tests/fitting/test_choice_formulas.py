"""Closed forms beside the choice of modes: errors on hubs by hand, and the search over tables of
errors whose best entry is seen at once."""

from collections import Counter
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from beamchain import PortModel
from formulas import Candidates, Promise, choose, with_polar_inertia

RATIO = 0.02
GRID = 3e-3  # relative, of a maximum on a grid


# -- the error -------------------------------------------------------------------------------------
def dynamic(rigid, rows, w, rates, omega):
    s = 1j * omega[:, None, None]
    inner = s**2 * np.eye(len(w)) + s * rates + np.diag(w**2)
    return rigid - rows.T @ np.linalg.solve(inner, s**2 * rows)


def worst(hub, exact, model, keep, band):
    """The in-band error by its definition, on a fine grid; each of `(rigid, rows, w, rates)`."""
    scale = np.sqrt(np.diag(hub + exact[0]))[keep]

    def accelerance(dynamic_mass):
        return np.linalg.inv(hub + dynamic_mass)[..., keep, :][..., keep] * np.outer(scale, scale)

    omega = np.linspace(band / 3000.0, band, 3000)
    true, ours = (accelerance(dynamic(*of, omega)) for of in (exact, model))
    size = np.linalg.norm(true, 2, axis=(1, 2))
    size = np.maximum(size, np.linalg.norm(accelerance(exact[0]), 2))
    return np.max(np.linalg.norm(ours - true, 2, axis=(1, 2)) / size)


RIGID = np.array([[4.0, 1.5], [1.5, 3.0]])
ROWS = np.array([[1.2, 0.5], [-0.4, 0.8]])
W = np.array([2.0, 5.0])
RATES = np.diag(2.0 * RATIO * W)
EXACT = PortModel(RIGID, W, ROWS, np.full(2, RATIO))
ONE = PortModel(RIGID, W[:1], ROWS[:1], np.full(1, RATIO))


def test_the_error_without_a_hub_is_the_worst_on_three():
    """Of 0.1, 1 and 10 times the rigid mass."""
    promise = Promise(EXACT, None, [0, 1], 3.0, 0.005)
    assert [hub[0, 0] for hub in promise.hubs] == pytest.approx([0.4, 4.0, 40.0])
    exact, one = (RIGID, ROWS, W, RATES), (RIGID, ROWS[:1], W[:1], RATES[:1, :1])
    wanted = [worst(k * RIGID, exact, one, [0, 1], 3.0) for k in (0.1, 1.0, 10.0)]
    assert len(set(np.round(wanted, 3))) == 3
    assert promise.error(ONE) == pytest.approx(max(wanted), rel=GRID)


@pytest.mark.parametrize("keep", [[0], [1], [0, 1]])
def test_the_error_is_that_of_the_motions_that_matter(keep):
    hub = np.array([[9.0, -2.0], [-2.0, 5.0]])
    promise = Promise(EXACT, hub, keep, 3.0, 0.005)
    exact, one = (RIGID, ROWS, W, RATES), (RIGID, ROWS[:1], W[:1], RATES[:1, :1])
    wanted = worst(hub, exact, one, keep, 3.0)
    # the rigid mass of what is compared does not count
    other = PortModel(2.0 * RIGID, W[:1], ROWS[:1], np.full(1, RATIO))
    for model in (ONE, other):
        assert promise.error(model) == pytest.approx(wanted, rel=GRID)


def test_dampers_that_couple_modes_count():
    hub = np.array([[9.0, -2.0], [-2.0, 5.0]])
    rates = np.array([[0.08, 0.05], [0.05, 0.2]])
    promise = Promise(EXACT, hub, [0, 1], 6.0, 0.005)
    wanted = worst(hub, (RIGID, ROWS, W, RATES), (RIGID, ROWS, W, rates), [0, 1], 6.0)
    ratios = rates / np.sqrt(np.outer(W, W)) / 2.0
    found = promise.error(PortModel(2.0 * RIGID, W, ROWS, ratios))
    assert found == pytest.approx(wanted, rel=GRID)


def test_independent_motions_have_their_own_errors():
    """One mode in each of two motions."""
    exact = PortModel(
        np.diag([4.0, 3.0]), np.array([2.0, 5.0]), np.diag([1.2, 0.8]), np.full(2, RATIO)
    )
    hub = np.diag([9.0, 5.0])

    whole = (exact.rigid_mass, exact.participation, W, RATES)

    def only(k):
        return exact.rigid_mass, exact.participation[k], W[k], RATES[np.ix_(k, k)]

    errors = [worst(hub, whole, only(k), [0, 1], 6.0) for k in ([0], [1], [])]
    promise = Promise(exact, hub, [0, 1], 6.0, 0.005)
    first = PortModel(exact.rigid_mass, W[:1], np.array([[1.2, 0.0]]), np.full(1, RATIO))
    second = PortModel(exact.rigid_mass, W[1:], np.array([[0.0, 0.8]]), np.full(1, RATIO))
    assert promise.error(first) == pytest.approx(errors[0], rel=GRID)
    assert promise.error(second) == pytest.approx(errors[1], rel=GRID)
    none = PortModel(exact.rigid_mass, np.zeros(0), np.zeros((0, 2)), np.zeros(0))
    assert promise.error(none) == pytest.approx(errors[2], rel=GRID)
    assert promise.error(exact) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("part", "reached"), [(1e-9, True), (1e-14, False)])
@pytest.mark.parametrize("mass", [1e-8, 1.0, 1e8])
def test_one_mode_couples_the_motions_that_it_moves_by_more_than_rounding(mass, part, reached):
    # relative to the root of the motion's mass
    rows = np.array([[0.5, 0.0, part * np.sqrt(mass)]])
    exact = PortModel(np.diag([1.0, 2.0, mass]), np.array([2.0]), rows)
    promise = Promise(exact, np.diag([5.0, 6.0, 7.0]), [0], 1.0, 0.01)
    assert promise.reaches([2]) is reached
    assert promise.reaches([1, 2]) is reached
    assert not promise.reaches([1])


def test_ports_reach_the_motions_that_their_rigid_mass_or_modes_couple():
    """A rod of 12 kg and 4 m with a mode in each plane and one that twists it."""
    rigid = np.diag([12.0, 12.0, 12.0, 3.0, 64.0, 64.0])
    rigid[1, 5] = rigid[5, 1] = 24.0
    rigid[2, 4] = rigid[4, 2] = -24.0
    rows = np.zeros((3, 6))
    rows[0, [1, 5]] = 2.5, 7.0
    rows[1, [2, 4]] = 2.0, -6.0
    rows[2, 3] = 1.2
    rod = PortModel(rigid, np.array([2.0, 3.0, 5.0]), rows)
    ports = {"xy": [1, 5], "xz": [2, 4], "torsion": [3]}

    def reached(hub, wanted):
        promise = Promise(rod, hub, wanted, 10.0, 0.005)
        return {port for port, motions in ports.items() if promise.reaches(motions)}

    hub = np.diag([40.0, 40.0, 40.0, 9.0, 9.0, 9.0])
    assert reached(hub, [5]) == {"xy"}
    assert reached(hub, [1, 4]) == {"xy", "xz"}
    assert reached(hub, [0]) == set()
    assert reached(hub, [3]) == {"torsion"}
    # products of the hub couple torsion with a plane: 1e-12 of the roots of 12 and 73 kg m^2
    for part, both in ((1.1e-12, True), (-1.1e-12, True), (0.9e-12, False)):
        hub[3, 4] = hub[4, 3] = part * np.sqrt(12.0 * 73.0)
        assert reached(hub, [2]) == ({"xz", "torsion"} if both else {"xz"})


def test_what_has_no_polar_inertia_gets_a_trace_of_the_largest():
    mass = np.diag([1.0, 2.0, 3.0, 0.0, 5.0, 7.0])
    mass[1, 5] = mass[5, 1] = 0.3
    wanted = np.array(mass)
    wanted[3, 3] = 7e-9
    assert with_polar_inertia(mass) == pytest.approx(wanted, rel=1e-12, abs=0.0)
    wanted[3, 3] = 8e-9
    assert np.array_equal(with_polar_inertia(wanted), wanted)


# -- the search ------------------------------------------------------------------------------------
ALL = 12  # modes of a port that stays whole
INSIDE = 0.1
MOTIONS = {"xy": 2, "xz": 2, "torsion": 1, "axial": 1}
EXACTLY = 1.25  # of an error that is not only searched for, over the same in the search


def model(port, count):
    frequencies = 1.0 + np.arange(count)
    return PortModel(np.eye(MOTIONS[port]), frequencies, np.zeros((count, MOTIONS[port])))


class Table:
    """A promise that knows each error by the numbers of modes in xy and xz."""

    exact = SimpleNamespace(rigid_mass=np.eye(6))

    def __init__(self, errors, otherwise, bandwidth=3.5):
        self.errors, self.otherwise = errors, otherwise
        self.bandwidth, self.wanted = bandwidth, [1, 2, 5]
        self.asked = []

    def reaches(self, motions):
        return {(1, 5): True, (2, 4): True, (3,): False, (0,): False}[tuple(motions)]

    def error(self, model, tolerance):
        kept = Counter(model.labels)
        at = kept["xy"], kept["xz"]
        self.asked.append(at)
        error = INSIDE if at == (ALL, ALL) else self.errors.get(at, self.otherwise)
        return error if tolerance == 1.0 else EXACTLY * error


def candidates(sizes=(9, 9, 3, 2), reduce=None):
    return Candidates(
        {port: model(port, ALL) for port in MOTIONS},
        {port: 1.0 + np.arange(size) for port, size in zip(MOTIONS, sizes, strict=True)},
        reduce or (lambda _, port, count: model(port, count)),
    )


def found(errors, otherwise=5.0, fixed=None, *, sizes=(9, 9, 3, 2), tip=False, bandwidth=3.5):
    promise = Table(errors, otherwise, bandwidth)
    return choose(promise, candidates(sizes), ["clamped"], 1.0, fixed or {}, tip)


def modes(choice):
    return choice.modes["xy"], choice.modes["xz"]


ALONE = {(1, ALL): 0.9, (0, ALL): 2.0, (ALL, 0): 3.0, (ALL, 1): 2.0, (ALL, 2): 0.9}


def test_ports_take_what_they_need_alone():
    choice = found({**ALONE, (1, 2): 0.95})
    assert choice.modes == {"xy": 1, "xz": 2, "torsion": 0, "axial": 0}
    assert choice.met
    assert choice.error == EXACTLY * 0.95
    assert choice.reasoning == (
        'target "clamped": 1 in xy, 2 in xz, in-band error 1.19e+00',
        'chosen: target "clamped", 3 flexible modes',
        "xy alone, the others whole: 9.00e-01 with 1 modes",
        "xz alone, the others whole: 9.00e-01 with 2 modes",
        "torsion alone, the others whole: 1.00e-01 with 0 modes",
        "axial alone, the others whole: 1.00e-01 with 0 modes",
    )


def test_1_01_times_the_error_keeps_the_tolerance():
    assert modes(found({**ALONE, (1, 2): 0.99})) == (1, 2)
    assert modes(found({**ALONE, (1, 2): 0.995, (2, 2): 0.98})) == (2, 2)


def test_ports_that_need_more_together_take_the_best_mode_first():
    """(1, 2) -> (1, 3), which is better than (2, 2) -> (2, 3); none of it can go again."""
    errors = {**ALONE, (1, 2): 1.5, (2, 2): 1.2, (1, 3): 1.1, (2, 3): 0.95, (1, 4): 1.05}
    choice = found(errors)
    assert modes(choice) == (2, 3)
    # which was enough for each port alone, not what it got
    assert choice.reasoning[2:4] == (
        "xy alone, the others whole: 9.00e-01 with 1 modes",
        "xz alone, the others whole: 9.00e-01 with 2 modes",
    )
    assert [line.split()[0] for line in found(errors, fixed={"xy": 1}).reasoning[2:]] == [
        "xz",
        "torsion",
        "axial",
    ]
    # and stop where no mode lowers the error
    for third in (1.5, 1.55):
        errors = {**ALONE, (1, 2): 1.5, (1, 3): third, (1, 4): 0.5, (3, 3): 0.5}
        assert modes(found(errors)) == (1, 2)
    # or there are none; a fourth would do
    errors = {**ALONE, (1, 2): 1.5, (1, 3): 1.2, (1, 4): 0.5}
    assert modes(found(errors, sizes=(9, 3, 3, 2))) == (1, 3)


def test_the_way_up_is_one_mode_at_a_time():
    """(2, 1) is lower than (1, 3), but leads nowhere."""
    errors = {(1, 2): 1.5, (2, 2): 1.45, (2, 1): 1.3, (1, 3): 1.4, (1, 4): 1.35, (1, 5): 0.9}
    assert modes(found({**ALONE, **errors})) == (1, 5)


def test_modes_that_a_port_needs_only_alone_go_again():
    errors = {**ALONE, (1, 2): 0.9, (1, 1): 0.95, (0, 1): 2.0, (1, 0): 2.0}
    assert modes(found(errors)) == (1, 1)
    # but not those that it needs, though the way down is easy and there is no way up again
    alone = {(2, ALL): 2.0, (3, ALL): 0.9, (ALL, 2): 2.0, (ALL, 3): 0.9}
    falling = {(2, 3): 4.0, (1, 3): 4.5, (0, 3): 5.0, (0, 2): 5.1, (0, 1): 5.2, (0, 0): 5.3}
    assert modes(found({**alone, **falling, (3, 3): 0.9, (1, 1): 5.0}, otherwise=7.0)) == (3, 3)
    # also where the tolerance is missed, but the error is no larger without
    errors = {**ALONE, (1, 2): 2.0, (0, 2): 1.9, (0, 1): 2.1, (0, 3): 2.0, (1, 1): 2.0}
    assert modes(found(errors)) == (0, 2)


@pytest.mark.parametrize(
    ("others", "wanted"),
    [
        ({(1, 3): 0.5}, (1, 3)),  # one more and one less
        ({(3, 1): 0.5}, (3, 1)),
        ({(3, 1): 0.5, (2, 0): 0.7}, (2, 0)),  # and on from there
        ({(3, 1): 0.5, (3, 0): 0.7}, (3, 0)),
        ({(1, 3): 0.5, (0, 3): 0.7}, (0, 3)),
        ({(3, 1): 0.9, (1, 3): 0.8}, (1, 3)),  # the better of two
        ({(3, 2): 0.5, (2, 3): 0.4, (3, 3): 0.1}, (2, 2)),  # more modes are not better
        ({(4, 0): 0.5}, (2, 2)),  # two away
    ],
)
def test_a_neighbour_with_less_error_or_fewer_modes_is_taken(others, wanted):
    alone = {(1, ALL): 2.0, (2, ALL): 0.9, (ALL, 1): 2.0, (ALL, 2): 0.9}
    assert modes(found({**alone, (2, 2): 0.95, **others})) == wanted


def test_the_two_of_a_missed_tolerance_are_stepped_together():
    """Neither one more in one port nor one less in it is better, but one more in both is."""
    alone = {(1, ALL): 2.0, (2, ALL): 0.9, (ALL, 1): 2.0, (ALL, 2): 0.9}
    assert modes(found({**alone, (2, 2): 3.0, (3, 3): 2.0})) == (3, 3)
    assert modes(found({**alone, (2, 2): 3.0, (3, 1): 2.0, (4, 1): 0.9})) == (4, 1)
    assert modes(found({**alone, (2, 2): 3.0, (3, 3): 2.0, (4, 4): 0.5, (4, 3): 0.9})) == (4, 3)


def test_neither_port_goes_beyond_its_modes():
    """2 in xy and 8 in xz at most, whatever more would do."""
    errors = {(i, j): 5.0 - 0.1 * i - 0.1 * j for i in range(11) for j in range(11)}
    alone = {(i, ALL): 5.0 for i in range(11)} | {(ALL, j): 5.0 for j in range(11)}
    choice = found({**errors, **alone}, sizes=(2, 9, 3, 2))
    assert modes(choice) == (2, 8)
    assert not choice.met


def test_modes_that_hardly_help_go_where_typed_numbers_miss_the_tolerance():
    """xz is typed; 5 lowers the error by 3 % over 1, and 4 has less than 1 % more than 5."""
    one = {0: 4.0, 1: 3.0, 2: 2.99, 3: 2.95, 4: 2.92, 5: 2.90}
    errors = {(i, 1): error for i, error in one.items()}
    errors |= {(0, ALL): 2.0, (1, ALL): 0.9, (ALL, 1): 2.0}
    choice = found(errors, fixed={"xz": 1})
    assert modes(choice) == (4, 1)
    assert not choice.met
    # all of it, but for what the port needs alone
    errors |= {(i, 1): 3.0 - 0.001 * i for i in range(9)}
    assert modes(found(errors, fixed={"xz": 1})) == (1, 1)


def test_the_typed_number_is_kept_though_fewer_would_do():
    assert modes(found({}, otherwise=0.5, fixed={"xy": 3, "torsion": 2})) == (3, 0)


@pytest.mark.parametrize(
    ("bandwidth", "sizes", "wanted"),
    [
        (3.0, (9, 9, 3, 2), (3, 3)),  # a mode on the band's end is inside
        (2.99, (9, 9, 3, 2), (2, 2)),
        (9.5, (9, 5, 3, 2), (8, 5)),  # 8 at most
        (0.5, (9, 9, 3, 2), (0, 0)),
    ],
)
def test_a_tip_keeps_the_bending_modes_of_the_band(bandwidth, sizes, wanted):
    choice = found({}, otherwise=0.5, tip=True, bandwidth=bandwidth, sizes=sizes)
    assert choice.modes == {"xy": wanted[0], "xz": wanted[1], "torsion": 0, "axial": 0}


@pytest.mark.parametrize(
    ("clamped", "free", "target"),
    [
        ((2.0, 0.9, 0.8), (0.95, 0.9, 0.8), "free"),
        ((0.95, 0.9, 0.8), (0.9, 0.8, 0.7), "clamped"),  # as many: the first
        ((2.0, 1.9, 1.2), (3.0, 2.0, 0.9), "free"),  # what keeps the tolerance
        ((2.0, 1.9, 1.8), (2.0, 1.9, 1.7), "free"),  # what misses it by less
        ((2.0, 1.9, 1.7), (2.0, 1.9, 1.8), "clamped"),
    ],
)
def test_the_target_that_needs_the_fewest_modes(clamped, free, target):
    """Told apart by their damping, as is the number of modes by their labels."""
    by_ratio = {0.01: (3.0, *clamped), 0.02: (3.0, *free)}

    def error(model, tolerance):
        del tolerance
        own = model.damping[np.array(model.labels) == "xy"]
        return INSIDE if own.size == ALL else by_ratio[float(own[0])][own.size] if own.size else 3.0

    def reduce(name, port, count):
        ratio = {"clamped": 0.01, "free": 0.02}[name]
        return model(port, count).replaced(damping=np.full(count, ratio))

    promise = Table({}, 5.0)
    promise.error = error
    made = candidates((3, 0, 0, 0), reduce)
    choice = choose(promise, made, ["clamped", "free"], 1.0, {})
    assert choice.target == target
    assert len([line for line in choice.reasoning if line.startswith("target")]) == 2


def test_the_ledger_has_what_was_left_out_and_its_own_error():
    """And what the model has no answer to."""
    choice = found({**ALONE, (1, 2): 0.95}, bandwidth=2.5)
    assert [(item.what, item.why, item.cost) for item in choice.left_out] == [
        ("xy mode 2 (2 rad/s) and above", "inside 2.5 rad/s", EXACTLY * 0.9),
        ("xz mode 3 (3 rad/s) and above", "outside 2.5 rad/s", EXACTLY * 0.9),
        ("torsion (first mode 1 rad/s)", "no path to hub axes ty, tz, z", 0.0),
        ("axial (first mode 1 rad/s)", "no path to hub axes ty, tz, z", 0.0),
    ]
    assert choice.cannot[:4] == (
        "xy motion above 2 rad/s",
        "xz motion above 3 rad/s",
        "twist and torsion loads: torsion is rigid",
        "axial loads: axial is rigid",
    )
    assert choice.cannot[4].startswith("tip pointing")
    whole = found({}, otherwise=0.5, fixed={"xy": 1, "xz": 0}, sizes=(1, 2, 0, 0), tip=True)
    assert [item.what for item in whole.left_out] == ["xz (first mode 1 rad/s)"]
    assert whole.cannot[0] == "bending loads in xz: xz is rigid"
    assert len(whole.cannot) == 3


# -- every count tried -----------------------------------------------------------------------------
THREE = ("xy", "xz", "torsion")
COUNTED = {"xy": 4, "xz": 3, "torsion": 3}
EVERY = list(product(*(range(COUNTED[p] + 1) for p in THREE)))


def error_of(counts, size, fall, joined):
    left = [size[p] * fall[p] ** counts[p] * (counts[p] < COUNTED[p]) for p in THREE]
    return max(left) + joined * left[0] * left[1]


def search(seed, tolerance, known=None):
    """The choice by a table of errors of the counts, and this table."""
    random = np.random.default_rng(seed)
    size = dict(zip(THREE, random.uniform(0.3, 2.0, 3), strict=True))
    fall = dict(zip(THREE, random.uniform(0.05, 0.6, 3), strict=True))
    table = known or {
        counts: error_of(dict(zip(THREE, counts, strict=True)), size, fall, 0.3) for counts in EVERY
    }
    promise = SimpleNamespace(
        exact=SimpleNamespace(rigid_mass=np.eye(6)),
        error=lambda model, _=None: table[tuple(model.labels.count(p) for p in THREE)],
        reaches=lambda _: True,
        bandwidth=10.0,
        wanted=[2, 5],
    )
    candidates = Candidates(
        whole={p: model(p, COUNTED[p]) for p in THREE},
        frequencies={p: model(p, COUNTED[p]).frequencies for p in THREE},
        reduce=lambda _, port, count: model(port, count),
    )
    return choose(promise, candidates, ("clamped",), tolerance, {}), table


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("tolerance", [0.6, 0.06])
def test_the_choice_is_the_fewest_modes_of_all_counts(seed, tolerance):
    choice, table = search(seed, tolerance)
    kept = {counts: e for counts, e in table.items() if 1.01 * e <= tolerance}
    fewest = min(kept, key=lambda counts: (sum(counts), kept[counts]))
    assert choice.met
    assert tuple(choice.modes.values()) == fewest
    assert choice.error == pytest.approx(kept[fewest])


def rank(error, counts, tolerance):
    return (0, sum(counts), error) if 1.01 * error <= tolerance else (1, 0, error)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("tolerance", [0.3, 0.03, 1e-4])
def test_no_neighbour_of_the_choice_is_better(seed, tolerance):
    """Errors that fall with the counts but for a draw, so that ports help and hinder each other."""
    random = np.random.default_rng(seed)
    known = {c: float(10.0 ** (random.normal(0.0, 0.5) - 0.3 * sum(c))) for c in EVERY}
    choice, _ = search(0, tolerance, known=known)
    counts = tuple(choice.modes.values())
    assert choice.error == known[counts]
    assert choice.met == (1.01 * known[counts] <= tolerance)
    own = rank(known[counts], counts, tolerance)
    for step in product((-1, 0, 1), repeat=3):
        near = tuple(a + b for a, b in zip(counts, step, strict=True))
        if near not in known or sum(map(abs, step)) > 2:
            continue
        other = rank(known[near], near, tolerance)
        # where the tolerance is missed, modes that lower the error by less than 1 % are left out
        assert own <= other or (own[0] == other[0] == 1 and own[2] <= 1.01 * other[2])
