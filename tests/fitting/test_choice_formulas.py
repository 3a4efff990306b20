"""Closed forms beside the choice of modes: errors on hubs by hand, what a scene makes of tables of
errors whose best entry is seen at once, and all counts of a uniform beam."""

from collections import Counter
from itertools import product

import numpy as np
import pytest
from scipy.optimize import brentq

import beamchain as bc
from beamchain import PortModel
from formulas import Body, Promise, body_of, select, with_polar_inertia

RATIO = 0.02
GRID = 3e-3  # relative, of a maximum on a grid


# -- the error -------------------------------------------------------------------------------------
def dynamic(rigid, rows, w, rates, omega):
    s = 1j * omega[:, None, None]
    inner = s**2 * np.eye(len(w)) + s * rates + np.diag(w**2)
    return rigid - rows.T @ np.linalg.solve(inner, s**2 * rows)


def curve(hub, exact, model, keep, omega):
    """The error by its definition; each of `(rigid, rows, w, rates)`."""
    scale = np.sqrt(np.diag(hub + exact[0]))[keep]

    def accelerance(dynamic_mass):
        return np.linalg.inv(hub + dynamic_mass)[..., keep, :][..., keep] * np.outer(scale, scale)

    true, ours = (accelerance(dynamic(*of, omega)) for of in (exact, model))
    size = np.linalg.norm(true, 2, axis=(1, 2))
    size = np.maximum(size, np.linalg.norm(accelerance(exact[0]), 2))
    return np.linalg.norm(ours - true, 2, axis=(1, 2)) / size


def grid(band):
    return np.linspace(band / 3000.0, band, 3000)


def worst(hub, exact, model, keep, band):
    """The in-band error, on a fine grid."""
    return np.max(curve(hub, exact, model, keep, grid(band)))


RIGID = np.array([[4.0, 1.5], [1.5, 3.0]])
ROWS = np.array([[1.2, 0.5], [-0.4, 0.8]])
W = np.array([2.0, 5.0])
RATES = np.diag(2.0 * RATIO * W)
EXACT = PortModel(RIGID, W, ROWS, np.full(2, RATIO))
ONE = PortModel(RIGID, W[:1], ROWS[:1], np.full(1, RATIO))
PLANE = [1, 5]  # which of the six motions these are


def test_the_error_without_a_hub_is_the_worst_on_three():
    """Of 0.1, 1 and 10 times the rigid mass."""
    promise = Promise(EXACT, None, PLANE, PLANE, 3.0, 0.005)
    assert [hub[0, 0] for hub in promise.hubs] == pytest.approx([0.4, 4.0, 40.0])
    exact, one = (RIGID, ROWS, W, RATES), (RIGID, ROWS[:1], W[:1], RATES[:1, :1])
    wanted = [worst(k * RIGID, exact, one, [0, 1], 3.0) for k in (0.1, 1.0, 10.0)]
    assert len(set(np.round(wanted, 3))) == 3
    assert promise.error(ONE) == pytest.approx(max(wanted), rel=GRID)


@pytest.mark.parametrize("keep", [[0], [1], [0, 1]])
def test_the_error_is_that_of_the_motions_that_matter(keep):
    hub = np.array([[9.0, -2.0], [-2.0, 5.0]])
    promise = Promise(EXACT, hub, PLANE, [PLANE[i] for i in keep], 3.0, 0.005)
    assert (promise.wanted, promise.band) == (keep, 3.0)
    exact, one = (RIGID, ROWS, W, RATES), (RIGID, ROWS[:1], W[:1], RATES[:1, :1])
    wanted = worst(hub, exact, one, keep, 3.0)
    # the rigid mass of what is compared does not count
    other = PortModel(2.0 * RIGID, W[:1], ROWS[:1], np.full(1, RATIO))
    for model in (ONE, other):
        assert promise.error(model) == pytest.approx(wanted, rel=GRID)


def test_dampers_that_couple_modes_count():
    hub = np.array([[9.0, -2.0], [-2.0, 5.0]])
    rates = np.array([[0.08, 0.05], [0.05, 0.2]])
    promise = Promise(EXACT, hub, PLANE, PLANE, 6.0, 0.005)
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
    promise = Promise(exact, hub, PLANE, PLANE, 6.0, 0.005)
    first = PortModel(exact.rigid_mass, W[:1], np.array([[1.2, 0.0]]), np.full(1, RATIO))
    second = PortModel(exact.rigid_mass, W[1:], np.array([[0.0, 0.8]]), np.full(1, RATIO))
    assert promise.error(first) == pytest.approx(errors[0], rel=GRID)
    assert promise.error(second) == pytest.approx(errors[1], rel=GRID)
    none = PortModel(exact.rigid_mass, np.zeros(0), np.zeros((0, 2)), np.zeros(0))
    assert promise.error(none) == pytest.approx(errors[2], rel=GRID)
    assert promise.error(exact) == pytest.approx(0.0, abs=1e-12)


def in_six(model):
    """A model of the plane among all motions."""
    rigid, rows = np.eye(6), np.zeros((model.modes, 6))
    rigid[np.ix_(PLANE, PLANE)] = model.rigid_mass
    rows[:, PLANE] = model.participation
    return PortModel(rigid, model.frequencies, rows, model.damping)


def test_the_error_of_a_model_in_six_motions_is_that_of_those_that_there_are():
    hub = np.array([[9.0, -2.0], [-2.0, 5.0]])
    promise = Promise(EXACT, hub, PLANE, [1, 3, 5], 3.0, 0.005)
    assert promise.asked == {1, 3, 5}  # of which nothing turns about x
    exact, one = (RIGID, ROWS, W, RATES), (RIGID, ROWS[:1], W[:1], RATES[:1, :1])
    wanted = worst(hub, exact, one, [0, 1], 3.0)
    assert promise.of_models([in_six(ONE)]) == pytest.approx(wanted, rel=GRID)
    assert promise.of_models([in_six(ONE)], 1e-3) == pytest.approx(wanted, rel=0.02)
    assert promise.of_models([in_six(EXACT)]) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("hubs", ["one", "three"])
def test_no_model_does_better_than_where_another_is_worst(hubs):
    """Which needs a few frequencies alone; the worst of three hubs where none is stated."""
    stated = np.array([[9.0, -2.0], [-2.0, 5.0]])
    promise = Promise(EXACT, stated if hubs == "one" else None, PLANE, PLANE, 6.0, 0.005)
    others = {
        "itself": (RIGID, ROWS[:1], W[:1], RATES[:1, :1]),
        "second": (RIGID, ROWS[1:], W[1:], RATES[1:, 1:]),
        "soft": (RIGID, ROWS, W * [1.0, 0.97], RATES),
        "exact": (RIGID, ROWS, W, RATES),
    }
    floor = promise.floor([in_six(ONE)])
    for rigid, rows, w, rates in others.values():
        found = floor([in_six(PortModel(rigid, w, rows, np.diag(rates) / (2.0 * w)))])
        there, anywhere = [], []
        for hub in [stated] if hubs == "one" else [k * RIGID for k in (0.1, 1.0, 10.0)]:
            exact = others["exact"]
            at = grid(6.0)[np.argmax(curve(hub, exact, others["itself"], [0, 1], grid(6.0)))]
            near = np.minimum(at * np.linspace(0.999, 1.001, 11), 6.0)
            there.append(np.min(curve(hub, exact, (rigid, rows, w, rates), [0, 1], near)))
            anywhere.append(worst(hub, exact, (rigid, rows, w, rates), [0, 1], 6.0))
        assert found <= max(anywhere) * (1.0 + GRID) + 1e-12
        assert found >= max(there) * (1.0 - 0.02)
    wanted = promise.of_models([in_six(ONE)])
    assert floor([in_six(ONE)]) == pytest.approx(wanted, rel=0.02)


def test_what_lies_far_above_the_band_is_gathered_where_models_are_exchanged():
    """At 25 times the band, with its static flexibility: 200 rad/s acts as 75 does."""
    hub, far = np.array([[9.0, -2.0], [-2.0, 5.0]]), np.array([[0.9, -0.7]])
    promise = Promise(EXACT, hub, PLANE, PLANE, 3.0, 0.005)
    w = np.array([2.0, 200.0])
    given = PortModel(RIGID, w, np.vstack([ROWS[:1], far]), np.full(2, RATIO))
    rows, w = np.vstack([ROWS[:1], far * 75.0 / 200.0]), np.array([2.0, 75.0])
    gathered = RIGID, rows, w, np.diag(2.0 * RATIO * w)
    wanted = worst(hub, (RIGID, ROWS, W, RATES), gathered, [0, 1], 3.0)
    assert promise.of_exchange(0, in_six(given)) == pytest.approx(wanted, rel=GRID)


@pytest.mark.parametrize(("part", "reached"), [(1e-9, True), (1e-14, False)])
@pytest.mark.parametrize("mass", [1e-8, 1.0, 1e8])
def test_one_mode_couples_the_motions_that_it_moves_by_more_than_rounding(mass, part, reached):
    """x with the twist, and with one of the two motions of a plane; nothing with y."""
    # relative to the root of the motion's mass
    rows = np.array([[0.5, 0.0, 0.0, part * np.sqrt(mass), part * np.sqrt(mass)]])
    exact = PortModel(np.diag([1.0, 2.0, 3.0, mass, mass]), np.array([2.0]), rows)
    hub = np.diag([5.0, 6.0, 5.0, 7.0, 7.0])
    promise = Promise(exact, hub, [0, 1, 2, 3, 4], [0], 1.0, 0.01)
    assert promise.reaches("axial")
    assert promise.reaches("torsion") is reached
    assert promise.reaches("xz") is reached
    assert not promise.reaches("xy")


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

    def reached(hub, wanted):
        promise = Promise(rod, hub, range(6), wanted, 10.0, 0.005)
        return {port for port in ("xy", "xz", "torsion", "axial") if promise.reaches(port)}

    hub = np.diag([40.0, 40.0, 40.0, 9.0, 9.0, 9.0])
    assert reached(hub, [5]) == {"xy"}
    assert reached(hub, [1, 4]) == {"xy", "xz"}
    assert reached(hub, [0]) == {"axial"}
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


# -- what a scene keeps ----------------------------------------------------------------------------
MOTIONS = {"xy": 2, "xz": 2, "torsion": 1, "axial": 1}
SIZES = (9, 9, 3, 2)  # modes of the ports that are known


def model(port, count, part=0.0):
    """At 1, 2, 3, ... rad/s; the tip stands still."""
    rows, w = np.full((count, MOTIONS[port]), part), 1.0 + np.arange(count)
    return PortModel(np.eye(MOTIONS[port]), w, rows, tip=np.zeros_like(rows), points=(5.0,))


class Table:
    """A promise that knows each error by the numbers of modes in xy and xz, and what a port costs
    of which alone so many are kept."""

    asked = frozenset((1, 2, 5))

    def __init__(self, errors, otherwise, alone, sizes, band, searched):
        self.errors, self.otherwise, self.alone = errors, otherwise, alone
        self.sizes, self.band, self.searched = sizes, band, searched

    def reaches(self, port):
        return port in ("xy", "xz")

    def of_models(self, models, tolerance=None):
        (one,) = models
        kept = Counter(one.labels)
        error = self.errors.get((kept["xy"], kept["xz"]), self.otherwise)
        return error if tolerance is None else self.searched * error

    def of_exchange(self, number, one):
        assert number == 0
        kept = Counter(one.labels)
        (lacking,) = [port for port, size in self.sizes.items() if kept[port] < size]
        return self.alone.get((lacking, kept[lacking]), 0.0)

    def floor(self, models):
        del models
        return lambda others: 0.0


def boom(**more):
    section = bc.Equivalent(bending_stiffness_xy=400.0, bending_stiffness_xz=300.0, linear_mass=1.6)
    return bc.Spec(name="boom", segment=(bc.Segment(length=5.0, section=section),), **more)


def found(
    errors, otherwise=5.0, alone=None, *, sizes=SIZES, tip=False, band=3.5, searched=1.0, **typed
):
    """What is kept to a tolerance of 1."""
    scene = bc.Scene(bandwidth=band, tolerance=1.0, axes=("z", "ty"), tip=tip)
    root = bc.spec.Root(target="clamped")
    spec = boom(scene=scene, root=root, modes=bc.Modes(**typed) if typed else None)
    known = {port: size for port, size in zip(MOTIONS, sizes, strict=True) if size}
    body = Body(spec, {port: model(port, size) for port, size in known.items()})
    body.__dict__["promise"] = Table(errors, otherwise, alone or {}, known, band, searched)
    return select(body)


def modes(kept):
    return kept.choice.modes["xy"], kept.choice.modes["xz"]


PATH = {(0, 0): 3.0, (1, 0): 2.0, (0, 1): 2.5, (2, 0): 1.9, (1, 1): 1.2, (2, 1): 1.1, (1, 2): 0.95}


def test_the_mode_that_leaves_the_least_error_is_added():
    """(1, 1) before (2, 0), (1, 2) before (2, 1); none of them can go again."""
    kept = found(PATH)
    choice = kept.choice
    assert choice.modes == {"xy": 1, "xz": 2, "torsion": 0, "axial": 0}
    assert (kept.counts, kept.target, choice.target) == ({"xy": 1, "xz": 2}, "clamped", "clamped")
    assert choice.met
    assert choice.error == 0.95
    assert choice.reasoning == (
        'target "clamped": 1 in xy, 2 in xz, in-band error 9.50e-01',
        'chosen: target "clamped", 3 flexible modes',
        "mode 1 in xy: in-band error 3.00e+00 -> 2.00e+00",
        "mode 1 in xz: in-band error 2.00e+00 -> 1.20e+00",
        "mode 2 in xz: in-band error 1.20e+00 -> 9.50e-01",
    )


def test_nothing_is_kept_where_nothing_is_needed():
    kept = found({}, otherwise=0.5)
    assert (kept.counts, modes(kept)) == ({}, (0, 0))
    assert kept.choice.reasoning == (
        'target "clamped": rigid, in-band error 5.00e-01',
        'chosen: target "clamped", 0 flexible modes',
    )


def test_1_01_times_the_error_keeps_the_tolerance():
    assert modes(found({**PATH, (1, 2): 0.99})) == (1, 2)
    kept = found({**PATH, (1, 2): 0.995, (2, 2): 0.8})
    assert modes(kept) == (2, 2)
    missed = found({(0, 0): 0.995}).choice
    assert not missed.met
    assert missed.reasoning[0].endswith(
        "9.95e-01 (too near the tolerance 1: 1.01 times the error exceeds it)"
    )


def test_what_is_stated_is_the_error_itself_though_the_search_sees_it_roughly():
    choice = found(PATH, searched=0.97).choice
    assert choice.error == 0.95
    assert choice.reasoning[0].endswith("9.50e-01")
    # 0.98 is seen as 0.97 times that, and 1.005 as 0.97485
    kept = found({**PATH, (1, 2): 0.98, (1, 1): 1.005}, searched=0.97)
    assert (modes(kept), kept.choice.error, kept.choice.met) == ((1, 1), 1.005, False)


def test_where_no_mode_pays_the_port_grows_whose_lack_alone_costs_most():
    """Both ports need two modes before the error falls at all."""
    errors = {(i, j): 3.0 for i in range(3) for j in range(3)} | {(2, 2): 0.9}
    alone = {("xy", 0): 2.0, ("xz", 0): 1.5, ("xy", 1): 1.6, ("xz", 1): 1.5}
    kept = found(errors, alone=alone)
    assert modes(kept) == (2, 2)
    assert [line.partition(":")[0] for line in kept.choice.reasoning[2:]] == [
        "mode 1 in xy",
        "mode 2 in xy",
        "mode 1 in xz",
        "mode 2 in xz",
    ]
    # less than a twentieth of the error is not its cause
    small = {key: 0.02 * cost for key, cost in alone.items()}
    missed = found(errors, alone=small)
    assert (modes(missed), missed.choice.met) == ((0, 0), False)
    assert missed.choice.reasoning[2:] == ()


def test_modes_that_were_needed_only_on_the_way_go_again():
    """(2, 0) pays at first, but (0, 2) does as well as (2, 2)."""
    errors = {(0, 0): 4.0, (1, 0): 3.0, (2, 0): 2.0, (2, 1): 1.5, (2, 2): 0.9}
    kept = found({**errors, (1, 2): 0.95, (0, 2): 0.98, (0, 1): 3.5})
    assert modes(kept) == (0, 2)
    assert kept.counts == {"xz": 2}
    assert len(kept.choice.reasoning) == 2 + 4


def test_neither_port_goes_beyond_its_modes_nor_beyond_eight():
    """2 in xy and 8 in xz at most, whatever more would do."""
    errors = {(i, j): 5.0 - 0.1 * i - 0.1 * j for i in range(11) for j in range(11)}
    errors[2, 9] = errors[3, 8] = 0.1
    alone = {(port, n): 1.0 for port in ("xy", "xz") for n in range(11)}
    kept = found(errors, alone=alone, sizes=(2, 9, 3, 2))
    assert modes(kept) == (2, 8)
    assert not kept.choice.met
    assert "above the tolerance 1" in kept.choice.reasoning[0]


def test_the_typed_number_is_kept_though_fewer_would_do():
    kept = found({}, otherwise=0.5, xy=3, torsion=2)
    assert kept.counts == {"xy": 3, "torsion": 2}
    assert modes(kept) == (3, 0)


def test_typed_ports_are_never_offered():
    """One more in xy would do."""
    errors = {(1, j): 3.0 - 0.3 * j for j in range(5)} | {(2, j): 0.5 for j in range(9)}
    alone = {("xy", 1): 2.0, ("xz", 0): 1.0, ("xz", 1): 1.0}
    kept = found(errors, alone=alone, xy=1)
    assert (modes(kept), kept.choice.met) == ((1, 4), False)
    assert {line.split()[3] for line in kept.choice.reasoning[2:]} == {"xz:"}
    both = found(errors, alone=alone, xy=1, xz=0, torsion=0, axial=1)
    assert both.counts == {"xy": 1, "axial": 1}
    assert len(both.choice.reasoning) == 2


def test_modes_that_hardly_help_are_not_kept_where_typed_numbers_miss_the_tolerance():
    """xz is typed, and the lack in xy is less than a twentieth of what is left."""
    errors = {(i, 1): error for i, error in enumerate((4.0, 3.0, 2.99, 2.95, 2.92, 2.90))}
    kept = found(errors, alone={("xy", 1): 0.14}, xz=1)
    assert (modes(kept), kept.choice.met) == ((1, 1), False)
    kept = found(errors, alone={("xy", 1): 0.16, ("xy", 2): 0.16}, xz=1)
    assert modes(kept) == (3, 1)


def test_what_is_typed_and_not_there_is_refused():
    with pytest.raises(bc.InputError, match="only 3 there; ask for fewer"):
        found({}, torsion=4)
    with pytest.raises(bc.InputError, match="rigid there; set it to 0"):
        found({}, sizes=(9, 9, 0, 2), torsion=1)
    assert found({}, otherwise=0.5, sizes=(9, 9, 0, 2), torsion=0).counts == {}


@pytest.mark.parametrize(
    ("band", "sizes", "wanted"),
    [
        (3.0, (9, 9, 3, 2), (3, 3)),  # a mode on the band's end is inside
        (2.99, (9, 9, 3, 2), (2, 2)),
        (9.5, (9, 5, 3, 2), (8, 5)),  # 8 at most
        (0.5, (9, 9, 3, 2), (0, 0)),
    ],
)
def test_a_tip_keeps_the_bending_modes_of_the_band(band, sizes, wanted):
    kept = found({}, otherwise=0.5, tip=True, band=band, sizes=sizes)
    assert kept.choice.modes == {"xy": wanted[0], "xz": wanted[1], "torsion": 0, "axial": 0}
    # what is typed is kept all the same
    assert modes(found({}, otherwise=0.5, tip=True, band=band, sizes=sizes, xy=1))[0] == 1


def test_more_modes_than_those_of_the_band_are_kept_with_a_tip_where_they_are_needed():
    errors = {(2, 2): 2.0, (3, 2): 0.9}
    assert modes(found(errors, tip=True, band=2.0)) == (3, 2)


@pytest.mark.parametrize(
    ("clamped", "hub", "target"),
    [
        ((2.0, 0.9, 0.8), (0.95, 0.9, 0.8), "hub"),
        ((0.95, 0.9, 0.8), (0.9, 0.8, 0.7), "clamped"),  # as many: the first
        ((2.0, 1.9, 1.2), (3.0, 2.0, 0.9), "hub"),  # what keeps the tolerance
        ((2.0, 1.9, 1.8), (2.0, 1.9, 1.7), "hub"),  # what misses it by less
        ((2.0, 1.9, 1.7), (2.0, 1.9, 1.8), "clamped"),
        ((2.0, 0.9, 0.8), (3.0, 2.0, 0.9), "clamped"),
    ],
)
def test_the_target_that_needs_the_fewest_modes(clamped, hub, target):
    """Told apart by the first frequency, which is 1 rad/s where the root is held; a fourth mode
    changes nothing. The second is tried with no more modes than are enough for the first."""
    tried = []
    by_target = {"clamped": (3.0, *clamped), "hub": (3.0, *hub)}

    class Told(Table):
        def of_models(self, models, tolerance=None):
            del tolerance
            (one,) = models
            first = one.frequencies[0] if one.modes else 1.0
            tried.append((first > 1.0001, one.modes))
            return by_target["hub" if first > 1.0001 else "clamped"][min(one.modes, 3)]

    scene = bc.Scene(bandwidth=3.5, tolerance=1.0, axes=("z",))
    root = bc.spec.Root(hub=bc.Hub(mass=1.0, inertia=(1.0, 1.0, 1.0)))
    body = Body(
        boom(scene=scene, root=root, modes=bc.Modes(xz=0)), {"xy": model("xy", 5, part=0.3)}
    )
    alone = {("xy", n): 2.0 for n in range(3)}
    body.__dict__["promise"] = Told({}, 5.0, alone, {"xy": 5}, 3.5, 1.0)
    kept = select(body)
    assert (kept.target, kept.choice.target) == (target, target)
    counts, errors = kept.choice.modes["xy"], by_target[target]
    assert kept.choice.error == errors[counts]
    enough = next((n for n, error in enumerate(by_target["clamped"]) if error < 0.99), 5)
    assert max(count for of_hub, count in tried if of_hub) <= enough
    lines = kept.choice.reasoning
    assert [line.split()[1] for line in lines[:2]] == ['"clamped":', '"hub":']
    assert lines[2] == f'chosen: target "{target}", {counts} flexible modes'
    # the steps are those of the chosen one
    climbed = [f"{a:.2e} -> {b:.2e}" for a, b in zip(errors, errors[1:], strict=False)]
    steps = [line.rpartition("error ")[2] for line in lines[3:]]
    assert steps == climbed[: len(steps)]
    assert steps


def test_the_ledger_has_what_was_left_out_and_its_own_error():
    """And what the model has no answer to."""
    choice = found(PATH, alone={("xy", 1): 0.7, ("xz", 2): 0.8}, band=2.5).choice
    assert [(item.what, item.why, item.cost) for item in choice.left_out] == [
        ("xy mode 2 (2 rad/s) and above", "inside 2.5 rad/s", 0.7),
        ("xz mode 3 (3 rad/s) and above", "outside 2.5 rad/s", 0.8),
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
    assert len(choice.cannot) == 5
    whole = found({}, otherwise=0.5, sizes=(1, 2, 1, 0), tip=True, xy=1, xz=0, torsion=1).choice
    assert [item.what for item in whole.left_out] == ["xz (first mode 1 rad/s)"]
    assert whole.cannot == ("bending loads in xz: xz is rigid",)
    every = found({}, otherwise=0.5, sizes=(1, 2, 1, 0), tip=True, xy=1, xz=2, torsion=1).choice
    assert (every.left_out, every.cannot) == ((), ())


# -- every count of a uniform beam -----------------------------------------------------------------
LENGTH, LINE = 3.0, 1.7
STIFF = {"xy": 400.0, "xz": 300.0}
KNOWN = 30  # modes of a plane in the truth
MOST = 5  # of a plane that are tried


def held_roots(count):
    """cos z cosh z = -1."""

    def lean(z):
        return np.cos(z) + 1.0 / np.cosh(z)

    return np.array(
        [brentq(lean, k * np.pi + 1e-9, (k + 1) * np.pi, xtol=1e-14) for k in range(count)]
    )


def cantilever(port):
    """Frequencies and rows in six motions, by the series of a uniform cantilever."""
    z, mass = held_roots(KNOWN), LINE * LENGTH
    w = z**2 * np.sqrt(STIFF[port] / LINE) / LENGTH**2
    lean = np.tanh(z / 2.0) ** np.where(np.arange(KNOWN) % 2, -1.0, 1.0)
    rows = np.zeros((KNOWN, 6))
    side, turn, sign = {"xy": (1, 5, 1.0), "xz": (2, 4, -1.0)}[port]
    rows[:, side] = np.sqrt(mass) * 2.0 * lean / z
    rows[:, turn] = sign * np.sqrt(mass) * 2.0 * LENGTH / z**2
    return w, rows


def rod():
    mass = LINE * LENGTH
    out = np.diag([mass] * 3 + [1e-9 * mass] + [mass * LENGTH**2 / 3.0] * 2)
    out[1, 5] = out[5, 1] = mass * LENGTH / 2.0
    out[2, 4] = out[4, 2] = -mass * LENGTH / 2.0
    return out


def body_mass(mass, inertia, offset):
    """`(6, 6)` about the root of a rigid body whose centre lies `offset` before it."""
    x, y, z = (-v for v in offset)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.block(
        [[mass * np.eye(3), -mass * cross], [mass * cross, np.diag(inertia) - mass * cross @ cross]]
    )


MASS, INERTIA, OFFSET = 30.0, (10.0, 12.0, 15.0), (0.5, 0.4, 0.3)
AXES = {"tx": 0, "ty": 1, "tz": 2, "x": 3, "y": 4, "z": 5}


def errors_of_counts(axes, band):
    """The in-band error of so many modes in xy and xz, frequency by frequency."""
    hub, rigid = body_mass(MASS, INERTIA, OFFSET), rod()
    keep = [AXES[axis] for axis in axes]
    scale = np.sqrt(np.diag(hub + rigid))[keep]
    modes = {port: cantilever(port) for port in STIFF}
    every = np.concatenate([w for w, _ in modes.values()])
    peaks = every[every < 1.5 * band]
    whole = np.block(
        [
            [hub + rigid, *(r.T for _, r in modes.values())],
            [np.vstack([r for _, r in modes.values()]), np.eye(every.size)],
        ]
    )
    inner = np.diag([0.0] * 6 + list(every**2))
    free = np.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(whole, inner))))
    peaks = np.concatenate([peaks, free[(free > 0.01) & (free < 1.5 * band)]])
    near = np.outer(peaks, 1.0 + RATIO * np.linspace(-4.0, 4.0, 65)).ravel()
    omega = np.concatenate([np.linspace(band / 2000.0, band, 2000), near[near <= band]])
    s = 1j * omega[:, None]

    def felt(port):
        """`(count + 1, f, 6, 6)` of the first modes."""
        w, rows = modes[port]
        gain = s**2 / (s**2 + 2.0 * RATIO * w * s + w**2)
        each = np.einsum("fk,ki,kj->kfij", gain, rows, rows)
        none = np.zeros((1, *each.shape[1:]))
        return np.concatenate([none, np.cumsum(each, axis=0)])[[*range(MOST + 1), KNOWN]]

    first, second = felt("xy"), felt("xz")

    def response(dynamic):
        return np.linalg.inv(hub + dynamic)[..., keep, :][..., keep] * np.outer(scale, scale)

    true = response(rigid - first[-1] - second[-1])
    size = np.linalg.norm(true, 2, axis=(1, 2))
    size = np.maximum(size, np.linalg.norm(response(rigid), 2))
    return {
        (i, j): float(
            np.max(
                np.linalg.norm(response(rigid - first[i] - second[j]) - true, 2, axis=(1, 2)) / size
            )
        )
        for i, j in product(range(MOST + 1), repeat=2)
    }


def chosen(axes, band, tolerance, **typed):
    section = bc.Equivalent(
        bending_stiffness_xy=STIFF["xy"], bending_stiffness_xz=STIFF["xz"], linear_mass=LINE
    )
    hub = bc.Hub(mass=MASS, inertia=INERTIA, offset=OFFSET)
    spec = bc.Spec(
        segment=(bc.Segment(length=LENGTH, section=section),),
        damping=bc.Damping(ratio=RATIO),
        root=bc.spec.Root(hub=hub, target="clamped"),
        scene=bc.Scene(bandwidth=band, tolerance=tolerance, axes=axes),
        modes=bc.Modes(**typed) if typed else None,
    )
    return select(body_of(spec))


BANDS = ((("z",), 20.0), (("y", "z"), 60.0), (("tx", "ty", "tz", "x", "y", "z"), 25.0))


@pytest.fixture(scope="module", params=BANDS)
def counted(request):
    """Axes, band, and errors of all counts."""
    return *request.param, errors_of_counts(*request.param)


@pytest.mark.parametrize("tolerance", [0.3, 0.05, 0.01])
def test_of_a_uniform_beam_the_fewest_modes_of_all_counts_are_kept(counted, tolerance):
    axes, band, errors = counted
    kept = chosen(axes, band, tolerance)
    met = {counts: e for counts, e in errors.items() if 1.01 * e <= tolerance}
    fewest = min(met, key=lambda counts: (sum(counts), met[counts]))
    assert kept.choice.met
    assert sum(modes(kept)) == sum(fewest)
    assert modes(kept) in met
    assert kept.choice.error == pytest.approx(errors[modes(kept)], rel=0.02)
    at = {"xy": 0, "xz": 0}
    for line in kept.choice.reasoning[2:]:
        name, _, told = line.partition(": in-band error ")
        before = errors[tuple(at.values())]
        at[name.split()[3]] += 1
        assert int(name.split()[1]) == at[name.split()[3]]
        told = [float(part) for part in told.split(" -> ")]
        assert told == pytest.approx([before, errors[tuple(at.values())]], rel=0.02)


def test_of_a_uniform_beam_the_typed_number_stays_and_the_other_port_is_chosen(counted):
    axes, band, errors = counted
    wanted = [j for j in range(MOST + 1) if 1.01 * errors[3, j] <= 0.05]
    assert modes(chosen(axes, band, 0.05, xy=3)) == (3, wanted[0])
