"""Points of mass, counts and shares by hand beside the links of a chain and what it needs."""

from types import SimpleNamespace

import numpy as np
import pytest

from beamchain import Beam, Equivalent, PortModel, Segment
from beamchain.chain.build import cut_chain
from beamchain.errors import InputError, RealisationError
from formulas import (
    BuildOptions,
    Chain,
    Hinge,
    Link,
    MassLine,
    MassPiece,
    ModeGroup,
    Nodes,
    assembled_chain,
    bodies,
    build_exact,
    hinge_counts,
    modes_to_give,
    polar_inertias,
    raise_polar_inertia,
    real_polar,
    required_hinges,
    rigid_link,
    settle_links,
    shared_nodes,
    spread_mass,
    with_real_polar,
    without_rounding,
)

ROUNDED = 1e-12


def points(masses, places):
    """`(6, 6)` about the origin: sum of m J^T J, J a point's motion per the origin's."""
    total = np.zeros((6, 6))
    for m, (x, y, z) in zip(masses, places, strict=True):
        motion = np.hstack([np.eye(3), [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]])
        total += m * motion.T @ motion
    return total


def line_of(masses, places, length):
    """A line whose mass is that of points."""
    masses, places = np.array(masses), np.array(places)

    def moments(edges, *, inner):
        assert inner
        ends = np.append(edges[1:-1], np.inf)
        starts = np.append(-np.inf, edges[1:-1])
        return (places[:, 0] > starts[:, None]) & (places[:, 0] <= ends[:, None])

    def matrices(taken):
        return np.array([points(masses[these], places[these]) for these in taken])

    whole = points(masses, places)
    return SimpleNamespace(length=length, whole=whole, moments=moments, matrices=matrices)


MASSES = [1.0, 2.0, 0.5, 1.5, 0.7, 1.1]
PLACES = [
    [0.2, 0.9, -0.1],
    [0.6, 0.5, 0.4],
    [0.8, 0.1, 0.6],
    [2.4, -0.2, 0.2],
    [2.7, 0.3, 0.7],
    [3.0, 0.3, -0.7],
]


def test_bodies_beside_the_axis_have_their_centre_and_their_inertia():
    pieces = bodies(line_of(MASSES, PLACES, 4.0), np.array([1.0, 2.0]))
    assert [(one.start, one.length) for one in pieces] == [(0.0, 1.0), (1.0, 1.0), (2.0, 2.0)]
    assert pieces[1] == Link(1.0, 1.0, 0.0, 1.0, (0.0, 0.0, 0.0))
    for piece, own in ((pieces[0], slice(3)), (pieces[2], slice(3, None))):
        masses, places = np.array(MASSES[own]), np.array(PLACES[own])
        assert piece.mass == pytest.approx(masses.sum(), rel=ROUNDED)
        centre = masses @ places / masses.sum()
        assert piece.centre == pytest.approx(centre, rel=ROUNDED)
        r = places - centre
        inertia = sum(
            m * (one @ one * np.eye(3) - np.outer(one, one))
            for m, one in zip(masses, r, strict=True)
        )
        assert piece.inertia_matrix() == pytest.approx(inertia, rel=1e-9)
        assert piece.mass_matrix() == pytest.approx(points(masses, places), rel=1e-9)
        rows = piece.rows()
        assert rows.T @ rows == pytest.approx(points(masses, places), rel=1e-9, abs=1e-9)


def test_what_rounding_leaves_beside_the_axis_is_none():
    """1e-13 of the length, and of the whole inertia for products."""
    masses, places = [2.0, 3.0], np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    for part, left in ((0.9, False), (1.1, True)):
        beside = np.array([[0.0, part * 4e-13, 0.0]] * 2)
        (one,) = bodies(line_of(masses, places + beside, 4.0), np.zeros(0))
        assert (one.beside[0] != 0.0) is left


@pytest.mark.parametrize(
    ("least", "noise", "raised"),
    [
        (-0.9e-6, 1e-6, True),
        (-1.1e-6, 1e-6, False),  # no rounding
        (0.9e-12, 1e-6, True),
        (1.1e-12, 1e-6, False),  # thicker than a lamina is
    ],
)
def test_a_lamina_has_some_thickness(least, noise, raised):
    """Second moments 2 and 1 in its plane, 1e-12 of the larger across it."""
    axes = np.linalg.qr(np.array([[1.0, 2.0, 0.5], [0.3, 1.0, -1.0], [2.0, 0.1, 1.0]]))[0]

    def inertia(*moments):
        return np.sum(moments) * np.eye(3) - (axes * moments) @ axes.T

    about = inertia(2.0, 1.0, 2.0 * least)
    found = without_rounding(about, 2.0 * noise)
    if raised:
        moments = np.trace(found) / 2.0 * np.eye(3) - found
        assert np.linalg.eigvalsh(moments) == pytest.approx([2e-12, 1.0, 2.0], abs=1e-15)
        assert found == pytest.approx(inertia(2.0, 1.0, 2e-12), abs=1e-12)
    else:
        assert found is about


# -- polar inertia ---------------------------------------------------------------------------------
def uniform(polar, length=4.0):
    return SimpleNamespace(
        length=length,
        moments=lambda edges: np.outer(polar * np.diff(edges), np.eye(6)[3]),
        rigid_mass=lambda: np.diag([2.0, 2.0, 2.0, polar * length, 9.0, 8.0]),
    )


def thin(number, across=3.0, mass=1.0):
    return Link(float(number), 1.0, mass, number + 0.5, (0.0, across, across))


def test_polar_inertia_of_pieces():
    assert real_polar(uniform(0.5), np.array([1.0, 3.5])) == pytest.approx([0.5, 1.25, 0.25])


@pytest.mark.parametrize(
    ("inertias", "turning", "polars"),
    [
        # a sum of 2 on 4 m: the first group ends at 1.2, 1.8 and 2.4 m, hinges at 1, 2 and 3 m
        ([0.6, 1.4], [0], [0.6, 1.4 / 3.0, 1.4 / 3.0, 1.4 / 3.0]),
        ([0.9, 1.1], [1], [0.45, 0.45, 0.55, 0.55]),
        ([1.2, 0.8], [1], [0.6, 0.6, 0.4, 0.4]),
        ([0.4, 0.9, 0.7], [0, 2], [0.4, 0.45, 0.45, 0.7]),
        ([2.0], [], [0.5, 0.5, 0.5, 0.5]),
        ([3.0, 7.0], [0], [3.0, 7.0 / 3.0, 7.0 / 3.0, 7.0 / 3.0]),
        ([0.0, 0.0, 0.0], [0, 1], [3e-6] * 4),  # none: a trace
        ([0.0, 0.0, 0.0, 0.0], [0, 1, 2], [3e-6] * 4),
    ],
)
def test_the_hinges_that_twist_are_those_nearest_to_where_the_groups_end(inertias, turning, polars):
    cuts, links = np.array([1.0, 2.0, 3.0]), [thin(k) for k in range(4)]
    line = uniform(0.5)
    found = polar_inertias(line, links, cuts, np.array(inertias), real_polar(line, cuts))
    assert found[0] == turning
    assert found[1] == pytest.approx(polars, rel=1e-9)


def test_groups_that_their_links_cannot_carry_end_elsewhere():
    # the first link carries 0.4 at most; the nearest hinge, at 1 m, would ask 0.6 of it
    cuts, line = np.array([1.0, 2.0, 3.0]), uniform(0.5)
    real = real_polar(line, cuts)
    links = [thin(0, 0.2), *(thin(k) for k in (1, 2, 3))]
    turning, polars = polar_inertias(line, links, cuts, np.array([0.6, 1.4]), real)
    assert turning == [1]
    assert polars == pytest.approx([0.3, 0.3, 0.7, 0.7], rel=1e-9)
    with pytest.raises(RealisationError, match="need 4 hinges, but there are 3"):
        polar_inertias(line, links, cuts, np.ones(5), real)


def test_a_link_without_inertia_along_the_axis_gets_a_trace():
    cuts, line = np.array([1.0]), uniform(0.0, 2.0)
    found = settle_links(line, [thin(0), thin(1, 5.0)], cuts)
    # half of a millionth of the two others
    assert [one.inertia[0] for one in found] == pytest.approx([3e-6, 5e-6])
    # what is a rigid body beside the axis stays
    beside = [thin(0), Link(1.0, 1.0, 1.0, 1.5, (0.0, 3.0, 3.0), beside=(0.0, 0.1))]
    assert settle_links(line, beside, cuts) == beside
    # polar inertia that is rounding: 1e-14 of the larger of the others, 9
    for part, none in ((0.9, True), (1.1, False)):
        slight = uniform(part * 1e-14 * 9.0 / 2.0, 2.0)
        (first, _) = settle_links(slight, [thin(0), thin(1)], cuts)
        assert (first.inertia[0] > 1e-9) is none


@pytest.mark.parametrize(
    ("inertia", "wanted"),
    [
        ((0.0, 2.0, 3.0), 1.0),
        ((0.0, 3.0, 3.0), 3e-6),
        ((0.0, 3.0, 2.0), 1.0),
        ((0.05, 3.0, 2.0), 0.05),
    ],
)
def test_a_recipe_s_links_get_what_a_body_needs(inertia, wanted):
    links = (Link(0.0, 1.0, 0.05, 0.5, inertia), Link(1.0, 1.0, 0.0, 1.5, (0.0, 0.0, 0.0)))
    found = with_real_polar(Chain(links, (Hinge(1.0, {"xy": 1.0}),), 2.0))
    assert found.links[0].inertia == (pytest.approx(wanted), *inertia[1:])
    assert found.links[1].inertia == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("part", [0.95, 1.05])
def test_bending_that_would_feel_it_keeps_a_link_as_it_is(part):
    """1e-9 of the lightest link's 0.5 kg times 4 m^2 are missing across, or more."""
    missing = part * 1e-9 * 0.5 * 4.0
    least = 1e-6
    links = (
        Link(0.0, 0.5, 2.0, 0.25, (0.0, 1.0, 1.0)),
        Link(0.5, 0.5, 0.0, 0.5, (0.0, 1.0, 1.0)),
        Link(1.0, 1.0, 0.5, 1.5, (least, least - missing, 1.0)),
    )
    chain = Chain(links, (Hinge(0.5, {"xy": 3.0}), Hinge(1.0, {"xy": 3.0})), 2.0)
    found, words = raise_polar_inertia(chain, least)
    assert found.links[0].inertia == (least, 1.0, 1.0)
    assert found.links[1].inertia == (0.0, 1.0, 1.0)  # without mass
    raised = least - missing if part > 1.0 else least
    assert found.links[2].inertia == (least, raised, 1.0)
    assert f"so {1 if part > 1.0 else 2} of them carry 1e-06" in words


@pytest.mark.parametrize("part", [0.95, 1.05])
def test_what_links_have_counts_against_what_they_get(part):
    """0.7 and 0.9 of the least of two links are missing: a thousandth of what the chain has across
    the root at most."""
    across = 1.0 * 0.5**2 + 1.0 * 1.5**2 + 6.0
    least = part * 1e-3 * across / 1.6
    links = tuple(
        Link(float(k), 1.0, 1.0, k + 0.5, (own * least, 3.0, 3.0))
        for k, own in ((0, 0.3), (1, 0.1))
    )
    chain = Chain(links, (Hinge(1.0, {"xy": 3.0}),), 2.0)
    found = raise_polar_inertia(chain, least)[0]
    assert (found is chain) is (part > 1.0)


def test_a_chain_that_twists_or_hangs_keeps_its_polar_inertia():
    links = (thin(0), thin(1))
    for more, kept in (({}, False), ({"hung": True}, True)):
        chain = Chain(links, (Hinge(1.0, {"xy": 3.0}),), 2.0, **more)
        assert (raise_polar_inertia(chain, 1e-6)[0] is chain) is kept
    twisting = Chain(links, (Hinge(1.0, {"torsion": 3.0}),), 2.0)
    assert raise_polar_inertia(twisting, 1e-6)[0] is twisting
    # as light as the least inertia in number is not too light
    light = (thin(0), thin(1, mass=1e-6))
    found = raise_polar_inertia(Chain(light, (Hinge(1.0, {"xy": 3.0}),), 2.0), 1e-6)[0]
    assert [one.inertia[0] for one in found.links] == [1e-6, 1e-6]


# -- hinges that modes need ------------------------------------------------------------------------
def modes(rows, ports=("xy",), **more):
    rows = np.array(rows, dtype=float)
    return ModeGroup(ports, np.arange(1.0, 1.0 + len(rows)), rows, np.zeros(len(rows)), **more)


@pytest.mark.parametrize(
    ("rows", "count"),
    [
        ([[1.0, 2.0], [3.0, 4.0], [5.0, 7.0]], 3),
        ([[1.0, 2.0]], 2),  # one more, since the hinges move the root in two ways
        ([[1.0, 2.0], [2.0, 4.0], [3.0, 6.0]], 4),
        ([[1.0, 2.0], [1.0, 2.0 * (1.0 + 1e-8)]], 2),
        ([[1.0, 2.0], [1.0, 2.0 * (1.0 + 1e-10)]], 3),
        ([[1.0, 0.0]], 2),
        ([[1e-12, 2.0], [3e-12, 4.0]], 2),  # of each motion by itself
        (np.zeros((0, 2)), 2),
    ],
)
def test_a_port_needs_a_hinge_per_mode_and_per_motion_that_no_mode_has(rows, count):
    assert hinge_counts(modes(rows)) == {"xy": count}


@pytest.mark.parametrize(
    ("weights", "counts"),
    [
        # the fourth by Webster's rule: 2.5 of xy beside 1.5
        ({"xy": 2.5, "torsion": 1.0}, {"xy": 3, "torsion": 1}),
        ({"xy": 1.68, "torsion": 1.0}, {"xy": 3, "torsion": 1}),
        ({"xy": 1.655, "torsion": 1.0}, {"xy": 2, "torsion": 2}),
        ({"xy": 1.0, "torsion": 3.0}, {"xy": 2, "torsion": 2}),
        ({"xy": 0.0, "torsion": 1.0}, {"torsion": 4}),
    ],
)
def test_hinges_are_shared_out_as_modes_move_the_ports(weights, counts):
    """Four modes of three motions; two of a plane at least, one in torsion."""
    rows = np.random.default_rng(0).normal(size=(4, 3))
    assert hinge_counts(modes(rows, ("xy", "torsion"), weights=weights)) == counts
    few = modes(rows[:1], ("xy", "torsion"), weights=weights)
    if weights["xy"]:
        assert hinge_counts(few) == {"xy": 2, "torsion": 1}


def test_a_root_without_mass_stands_on_a_hinge():
    """What no mode carries away is 1e-9 of a motion's mass at least."""
    rigid = np.diag([2.0, 2.0, 2.0, 0.5, 8.0, 8.0])
    line = SimpleNamespace(whole=rigid, hinge_lines={"xz": (0.7,)})
    for part, bare in ((0.9, True), (1.1, False)):
        row = [[np.sqrt(8.0 * (1.0 - part * 1e-9)), 0.0][::-1]]
        found = required_hinges(line, modes(row, ("xz",)), [1.5])
        assert found == {"xz": (0.0, 0.7, 1.5) if bare else (0.7, 1.5)}
    found = required_hinges(line, modes([[0.5, 0.0, 0.1]], ("xy", "torsion")), [0.4, 0.2])
    assert found == {"xy": (0.2, 0.4), "torsion": (0.2, 0.4)}


def test_planes_share_nodes_that_are_equal():
    masses, lengths, springs = np.array([0.5, 1.0, 2.0]), np.array([1.0, 3.0]), np.array([4.0])
    first = Nodes(masses, lengths, springs)
    for part, same in ((0.9, True), (-0.9, True), (1.1, False), (-1.1, False)):
        other = np.array([0.5, 1.0, 2.0 * (1.0 + part * 1e-9)])
        both = {"xy": first, "xz": Nodes(other, lengths, 9.0 * springs)}
        assert (shared_nodes(both, 0.0) is first) is same
        other = np.array([1.0, 3.0 * (1.0 + part * 1e-9)])
        both = {"xy": first, "xz": Nodes(masses, other, springs)}
        assert (shared_nodes(both, 0.0) is first) is same
    assert shared_nodes({"xy": first}, 0.9e-9) is first
    assert shared_nodes({"xy": first}, 1.1e-9) is None
    assert shared_nodes({}, 0.0) is None
    shorter = Nodes(masses[:2], lengths[:1], springs[:0])
    assert shared_nodes({"xy": first, "xz": shorter}, 0.0) is None


@pytest.mark.parametrize(("part", "taken"), [(0.9, True), (-0.9, True), (1.1, False)])
def test_imported_mass_may_differ_between_the_planes_by_what_is_printed(part, taken):
    """1e-5 of the second moment about the root, where one plane alone bends: 2 m of 1 kg/m."""
    whole = 8.0 / 3.0

    rotary = 0.2 + part * 1e-5 * whole
    smooth = MassPiece(0.0, 2.0, np.array([[1.0, 0.01, rotary / 2.0, 0.1]]))
    line = MassLine(2.0, (smooth,), np.zeros((0, 5)))
    nodes = Nodes(np.array([0.5, 1.0, 0.5]), np.array([1.0, 1.0]), np.array([4.0]))
    if not taken:
        with pytest.raises(RealisationError, match="do not share their hinges"):
            assembled_chain(line, {"xy": nodes}, {})
        return
    chain = assembled_chain(line, {"xy": nodes}, {})
    assert [(hinge.x, dict(hinge.stiffness)) for hinge in chain.hinges] == [(1.0, {"xy": 4.0})]
    # two rods, each of two masses of half a kilogram
    assert [(one.mass, one.com) for one in chain.links] == [(1.0, 0.5), (1.0, 1.5)]
    assert [one.inertia for one in chain.links] == [pytest.approx((0.01, 0.25, 0.25))] * 2


@pytest.mark.parametrize("part", [0.9, 1.1])
def test_a_link_of_the_recursion_is_no_point(part):
    """1e-13 of the second moment about the root, which is far from 1, at the tip's link."""
    reach, end = 36.0, 60.0
    section = Equivalent(bending_stiffness_xy=1.0, linear_mass=0.9)
    line = Beam(segments=(Segment(length=end, section=section),)).line
    tip = part * 1e-13 * 0.6 * reach**2 / (end - reach) ** 2
    places = ((0.7, 0.0), (0.6, reach), (tip, end))
    along = [np.array([1.0, x]) for _, x in places]
    rigid = sum(m * np.outer(a, a) for (m, _), a in zip(places, along, strict=True))
    target = PortModel(rigid, np.array([3.0]), np.sqrt(tip) * along[2][None, :])

    def built():
        return build_exact(line, {"xy": 1}, lambda *_: target, BuildOptions(springs="hinges"))

    if part < 1.0:
        with pytest.raises(RealisationError, match="would be a point"):
            built()
    else:
        assert len(built().chain.links) == 2


@pytest.mark.parametrize("taken", [0, 1, 2, 4])
def test_what_is_too_wide_for_thin_links_gets_bodies_of_its_rigid_mass(taken, monkeypatch):
    """Mass that grows with a power of x: each is tried where the one before fails."""
    section = Equivalent(bending_stiffness_xy=1.0, linear_mass=0.5, polar_inertia=0.3)
    line = Beam(segments=(Segment(length=2.0, section=section),)).line
    tried = list[int]()

    def spread(rigid, length, *, power):
        tried.append(power)
        if power != taken:
            raise InputError("no")
        return spread_mass(rigid, length, power)

    def settle(mass, links, cuts):
        if mass is line:
            raise RealisationError("too wide")
        return settle_links(mass, links, cuts)

    monkeypatch.setattr("beamchain.chain.build.spread_mass", spread)
    monkeypatch.setattr("beamchain.chain.build.settle_links", settle)
    rows = np.array([[0.3, 0.4]])
    built = cut_chain(line, [modes(rows)], [1.1])
    assert tried == [power for power in (0, 1, 2, 4) if power <= taken]
    assert built.chain.rigid_mass() == pytest.approx(line.rigid_mass(), abs=1e-9)
    assert 1.1 in built.cut.x.tolist()
    assert "too wide" in built.how
    assert built.chain.port("xy").participation[0] == pytest.approx(rows[0], rel=1e-6)


def test_an_appendage_without_modes_is_one_body():
    line = line_of(MASSES, PLACES, 4.0)
    built = build_exact(line, {}, lambda port, count: pytest.fail(f"{port}, {count}"))
    assert built.chain.hinges == ()
    (only,) = built.chain.links
    assert (only.start, only.length, built.chain.length) == (0.0, 4.0, 4.0)
    assert built.chain.rigid_mass() == pytest.approx(points(MASSES, PLACES), rel=1e-9)
    assert (built.how, built.missing) == ("one rigid body", ())


# -- bodies and modes that are handed on -----------------------------------------------------------
def test_a_frozen_piece_of_a_line():
    """4 m of 0.5 kg/m, between 1 and 3 m."""
    section = Equivalent(bending_stiffness_xy=1.0, linear_mass=0.5)
    found = rigid_link(Beam(segments=(Segment(length=4.0, section=section),)).line, 1.0, 3.0)
    assert (found.start, found.length) == (1.0, 2.0)
    assert (found.mass, found.com) == pytest.approx((1.0, 2.0))
    assert found.inertia == pytest.approx((0.0, 1.0 / 3.0, 1.0 / 3.0))


@pytest.mark.parametrize("column", [0, 1, 2])
def test_modes_have_the_motion_of_their_further_ports(column):
    """Of three of them, at 6, 2 and 4 m, two motions each."""
    rows, tip = np.array([[1.0, 2.0], [3.0, 4.0]]), np.arange(12.0).reshape(2, 6)
    places = (6.0, 2.0, 4.0)
    ratios = np.array([0.01, 0.02])
    target = PortModel(
        9.0 * np.eye(2), np.array([2.0, 5.0]), rows / 10.0, ratios, tip=tip, points=places
    )
    for per_mode in (True, False):
        asked = BuildOptions(further=(places[column],), per_mode=per_mode)
        found = modes_to_give("xy", target, asked, 1)
        wanted = np.hstack([rows / 10.0, tip[:, 2 * column : 2 * column + 2]])
        assert np.array_equal(found.rows, wanted)
        assert found.damping.tolist() == ([0.01, 0.02] if per_mode else [0.0, 0.0])
        assert found.normal == 1
