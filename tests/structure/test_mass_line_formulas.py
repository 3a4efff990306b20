"""Closed forms beside the formulas of mass along an axis and beside it."""

from dataclasses import replace

import numpy as np
import pytest

from beamchain import InputError
from formulas import (
    MassBesideAxis,
    MassLine,
    MassPiece,
    default_length,
    mass_beside_axis,
    mass_line_of_pieces,
    of_moments,
    spread_mass,
    uniform_length,
)

ROUNDED = 1e-12


def body_of(masses, places):
    """`(6, 6)` about the origin of points: sum of m J^T J, J a point's motion per the origin's."""
    total = np.zeros((6, 6))
    for m, (x, y, z) in zip(masses, places, strict=True):
        motion = np.hstack([np.eye(3), [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]])
        total += m * motion.T @ motion
    return total


def on_axis(moments):
    """`(6, 6)` of mass, first, second, polar and rotary inertias."""
    mass, first, second, polar, rotary_xy, rotary_xz = moments
    out = np.diag([mass, mass, mass, polar, second + rotary_xz, second + rotary_xy])
    out[1, 5] = out[5, 1] = first
    out[2, 4] = out[4, 2] = -first
    return out


def test_the_mass_matrix_of_each_moment():
    for moment in np.eye(6):
        found = (moment @ of_moments()).reshape(6, 6)
        assert found == pytest.approx(on_axis(moment), abs=0.0)


# -- stated lines ----------------------------------------------------------------------------------
PIECES = (
    MassPiece(0.5, 2.0, np.array([[3.0, 0.1, 0.2, 0.3], [5.0, 0.4, 0.1, 0.2]])),
    MassPiece(2.5, 1.0, np.array([[1.0, 0.0, 0.0, 0.0], [2.0, 0, 0, 0], [7.0, 0.6, 0.0, 0.9]])),
)
POINTS = np.array([[0.5, 0.7, 0.11, 0.12, 0.13], [3.0, 1.3, 0.2, 0.3, 0.4], [4.0, 2.1, 0.5, 0, 0]])
LINE = MassLine(4.0, PIECES, POINTS)


def moments_of_pieces(start, end):
    """The same densities as polynomials of x, integrated term by term."""
    x = np.poly1d([1.0, 0.0])
    polynomials = []
    for piece in PIECES:
        nodes = piece.start + piece.length * np.linspace(0.0, 1.0, len(piece.densities))
        columns = [np.poly1d(np.polyfit(nodes, c, nodes.size - 1)) for c in piece.densities.T]
        polynomials.append((piece.start, piece.start + piece.length, columns))
    total = np.zeros(6)
    for low, high, (mass, *inertias) in polynomials:
        a, b = max(low, start), min(high, end)
        if a < b:
            terms = [mass, mass * x, mass * x * x, *inertias]
            total += [term.integ()(b) - term.integ()(a) for term in terms]
    return total


def moments_of_points(rows):
    return np.sum([[m, m * x, m * x**2, *more] for x, m, *more in POINTS[rows]], axis=0)


@pytest.mark.parametrize(
    ("start", "end", "points"),
    [
        (0.0, 4.0 - 5e-9, [0, 1]),
        (0.0, 4.0 - 2e-9, [0, 1, 2]),
        (0.0, 4.0, [0, 1, 2]),
        (0.0, 4.5, [0, 1, 2]),
        (0.5, 3.0, [0]),
        (0.5 + 2e-9, 3.0 + 5e-9, [0, 1]),
        (0.5 + 5e-9, 3.0 + 2e-9, []),
        (0.9, 3.2, [1]),
    ],
)
def test_moments_of_a_stretch(start, end, points):
    wanted = moments_of_pieces(start, end)
    if points:
        wanted = wanted + moments_of_points(points)
    assert LINE.moments([start, end])[0] == pytest.approx(wanted, rel=ROUNDED)


def test_inner_stretches_take_the_points_at_their_outer_edges():
    """The first one all that stand before it, the last one the tip's."""
    found = LINE.moments([0.9, 3.0, 4.0], inner=True)
    for i, (start, end, points) in enumerate(((0.9, 3.0, [0, 1]), (3.0, 4.0, [2]))):
        wanted = moments_of_pieces(start, end) + moments_of_points(points)
        assert found[i] == pytest.approx(wanted, rel=ROUNDED)
    (near,) = LINE.moments([0.5 - 5e-9, 3.0 - 5e-9], inner=True)
    assert near[0] == pytest.approx(moments_of_pieces(0.5, 3.0)[0] + POINTS[0, 1], rel=1e-7)


def test_pieces_that_overlap_add_up():
    more = MassPiece(1.0, 2.0, np.array([[2.0, 0.1, 0.2, 0.3], [6.0, 0.3, 0.2, 0.1]]))
    line = MassLine(4.0, (*LINE.pieces, more), POINTS)
    edges = np.array([0.0, 1.0, 2.2, 2.7, 4.0])
    x = np.poly1d([1.0, 0.0])
    flat = np.poly1d([0.2])
    densities = [2.0 * x, 2.0 * x * x, 2.0 * x**3, 0.1 * x, flat, 0.4 - 0.1 * x]
    for i in range(4):
        low, high = np.clip(edges[i : i + 2], 1.0, 3.0)
        added = [d.integ()(high) - d.integ()(low) for d in densities]
        wanted = LINE.moments(edges)[i] + added
        assert line.moments(edges)[i] == pytest.approx(wanted, rel=ROUNDED, abs=ROUNDED)


def test_the_outermost_of_a_taper_keeps_its_digits():
    """1 kg/m at the root, 1/30 at the tip: a hair of mass before the tip."""
    line = MassLine(
        2.0,
        (MassPiece(0.0, 2.0, np.array([[1.0, 0, 0, 0], [1.0 / 30.0, 0, 0, 0]])),),
        np.zeros((0, 5)),
    )
    out = 1e-5
    (found,) = line.behind(np.array([2.0 - out]))
    slope = (1.0 - 1.0 / 30.0) / 2.0
    mass = out / 30.0 + slope * out**2 / 2.0
    assert found[0, 0] == pytest.approx(mass, rel=1e-11)
    before = out**2 / 60.0 + slope * out**3 / 3.0  # first moment about the tip
    assert found[1, 5] == pytest.approx(2.0 * mass - before, rel=1e-11)


def test_a_point_hangs_before_what_lies_behind():
    places = np.array([-1.0, 0.5, 0.9, 3.0 - 5e-9, 3.0 - 2e-9, 3.7])
    behind = ([0, 1, 2], [1, 2], [1, 2], [1, 2], [2], [2])
    wanted = [
        on_axis(moments_of_pieces(x, 4.0) + moments_of_points(rows))
        for x, rows in zip(places, behind, strict=True)
    ]
    assert LINE.behind(places) == pytest.approx(np.array(wanted), rel=ROUNDED, abs=ROUNDED)
    assert LINE.rigid_mass() == pytest.approx(wanted[0], rel=ROUNDED, abs=ROUNDED)
    twice = LINE.times(2.0)
    assert twice.behind(places) == pytest.approx(2.0 * np.array(wanted), rel=ROUNDED, abs=ROUNDED)
    assert twice.bodies[:, 0] == pytest.approx(POINTS[:, 0])


@pytest.mark.parametrize(("off", "taken"), [(0.9e-6, True), (1.1e-6, False)])
def test_a_stated_line_has_the_rigid_mass_to_a_millionth(off, taken):
    total = on_axis(moments_of_pieces(0.0, 4.0) + moments_of_points([0, 1, 2]))
    rigid = total.copy()
    rigid[4, 2] += off * np.sqrt(total[4, 4] * total[2, 2])
    given = {"pieces": PIECES, "points": POINTS}
    if taken:
        assert mass_line_of_pieces(4.0, rigid, **given).rigid_mass() == pytest.approx(rigid)
    else:
        with pytest.raises(InputError, match=r"in \(rotation y, z\)"):
            mass_line_of_pieces(4.0, rigid, **given)


@pytest.mark.parametrize(("start", "end"), [(0.0, 4.0), (-3e-9, 4.0 + 3e-9), (0.05, 4.0)])
def test_a_stated_line_may_begin_behind_the_root_and_at_it_to_a_billionth(start, end):
    piece = MassPiece(start, end - start, np.array([[3.0, 0.1, 0.2, 0.3]]))
    long = 4.0 - max(start, 0.0)
    first, second = (3.0 * (4.0**n - max(start, 0.0) ** n) / n for n in (2, 3))
    wanted = on_axis([3.0 * long, first, second, 0.1 * long, 0.2 * long, 0.3 * long])
    line = mass_line_of_pieces(4.0, wanted, pieces=(piece,), points=np.zeros((0, 5)))
    assert on_axis(line.moments([0.0, 4.0])[0]) == pytest.approx(wanted, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize(
    ("start", "length"), [(0.5, 0.0), (1.0, -0.5), (-0.1, 1.0), (3.0, 1.1)], ids=str
)
def test_a_piece_of_a_stated_line_lies_between_root_and_tip(start, length):
    piece = MassPiece(start, length, np.ones((1, 4)))
    with pytest.raises(InputError, match="line: a piece runs from"):
        mass_line_of_pieces(4.0, np.eye(6), pieces=(piece,), points=POINTS)


# -- beside the axis -------------------------------------------------------------------------------
MASSES = np.array([1.0, 2.0, 0.5, 1.5, 0.7])
PLACES = np.array(
    [[0.2, 0.9, -0.1], [1.0, 0.5, 0.4], [1.7, 0.1, 0.6], [2.4, -0.2, 0.2], [3.0, 0.3, 0.7]]
)


def test_mass_beside_an_axis_is_the_regression_on_it():
    second, beside = mass_beside_axis(body_of(MASSES, PLACES))
    x = PLACES[:, 0]
    assert second == pytest.approx(MASSES @ x**2, rel=ROUNDED)
    slopes, values = np.polyfit(x, PLACES[:, 1:], 1, w=np.sqrt(MASSES))
    assert beside.lean == pytest.approx(np.column_stack([values, slopes]), rel=1e-11)
    rest = PLACES[:, 1:] - values - np.outer(x, slopes)
    wanted = rest.T @ (MASSES[:, None] * rest) / MASSES.sum()
    assert beside.covariance == pytest.approx(wanted, rel=1e-11)
    along = MASSES.sum(), MASSES @ x, MASSES @ x**2
    assert beside.mass_matrix(*along) == pytest.approx(body_of(MASSES, PLACES), rel=1e-11)


def test_a_spread_mass_beside_its_axis_has_the_body_s_matrix():
    body = body_of(MASSES, PLACES)
    line = spread_mass(body, 3.2)
    assert line.behind(np.array([-1.0]))[0] == pytest.approx(body, rel=1e-9)
    assert line.behind(np.array([3.5]))[0] == pytest.approx(np.zeros((6, 6)))


def test_a_matrix_that_is_not_symmetric_by_rounding_is_taken_in_the_middle():
    body = body_of(MASSES, PLACES)
    skew = np.zeros((6, 6))
    skew[3:, :3] = 0.01 * np.array([[1.0, 2.0, 3.0], [-1.0, 0.5, 1.0], [2.0, -3.0, -1.0]])
    skew[:3, 3:] = -skew[3:, :3].T
    skew[4, 5], skew[5, 4] = 0.01, -0.01
    second, beside = mass_beside_axis(body + skew)
    other_second, other = mass_beside_axis(body)
    assert second == pytest.approx(other_second, rel=ROUNDED)
    assert beside.lean == pytest.approx(other.lean, rel=1e-11)


@pytest.mark.parametrize(("mass", "first"), [(2.0, 3.0), (0.02, 0.03), (0.0, 0.0)])
def test_a_stretch_of_mass_beside_an_axis(mass, first):
    lean = np.array([[0.1, 0.2], [-0.3, 0.05]])
    covariance = np.array([[0.04, 0.01], [0.01, 0.09]])
    found = MassBesideAxis(lean, covariance).mass_matrix(mass, first, 1.8 * first)
    if mass == 0.0:
        assert not found.any()
        return
    # two stations with these moments along x, at each four points with this covariance
    spread = np.sqrt(1.8 * first / mass - (first / mass) ** 2)
    across = np.sqrt(2.0) * np.linalg.cholesky(covariance).T
    points = [
        [x, *(lean @ [1.0, x] + sign * row)]
        for x in (first / mass - spread, first / mass + spread)
        for row in across
        for sign in (1.0, -1.0)
    ]
    assert found == pytest.approx(body_of([mass / 8.0] * 8, points), rel=1e-11, abs=ROUNDED)


@pytest.mark.parametrize("apart", [0.0, 2e-5])
def test_a_body_at_one_place_does_not_lean(apart):
    places = np.array([[2.0 + apart, 0.1, 0.3], [2.0, -0.3, 0.2], [2.0 - apart, 0.4, -0.4]])
    second, beside = mass_beside_axis(body_of([1.0, 2.0, 1.0], places))
    assert second == pytest.approx(16.0)
    assert beside.lean == pytest.approx(np.array([[-0.025, 0.0], [0.075, 0.0]]), abs=1e-14)


@pytest.mark.parametrize("axis", [0, 1])
def test_moments_that_no_body_has_lie_beside_no_axis(axis):
    # a negative spread along x, or across it
    for size, taken in ((-0.5e-9, True), (-1.5e-9, False)):
        body = np.diag([2.0] * 3 + [0.0] * 3)
        body[1, 5] = body[5, 1] = 3.0
        body[2, 4] = body[4, 2] = -3.0
        about = np.diag([4.5 + 1.0, 0.3, 0.4])  # 9 / 2 of the centre
        about[axis, axis] -= (1.0, 0.3)[axis]
        about[axis, axis] += size * about[0, 0]
        body[3:, 3:] = np.trace(about) * np.eye(3) - about
        assert (mass_beside_axis(body) is not None) == taken


# -- lengths and spread masses ---------------------------------------------------------------------
def test_lengths_of_a_uniform_rod_and_of_one_that_must_be_longer():
    rod = on_axis([3.0, 3.0 * 2.5, 3.0 * (2.5**2 + 1.0 / 12.0), 0.2, 0.1, 0.1])
    assert uniform_length(rod) == pytest.approx(3.0)  # from 2 to 3 m
    assert default_length(rod) == pytest.approx(3.0)
    near = on_axis([0.1, 0.01, 0.03, 0.4, 0.1, 0.3])
    assert uniform_length(near) == pytest.approx(0.1 + np.sqrt(3.0 * (0.3 - 0.01)))
    assert default_length(near) == pytest.approx(3.0)  # second over first
    ring = np.diag([2.0, 2.0, 2.0, 0.5, 0.6, 0.6])  # about its centre
    assert default_length(ring) == pytest.approx(uniform_length(ring))
    small = on_axis([2.0, 0.0, 2.0 * 0.01**2 / 3.0, 0.0, 0.0, 0.0])
    assert default_length(small) == pytest.approx(0.01)  # from -1 to 1 cm


def test_moments_that_no_mass_beside_an_axis_has_are_taken_on_it():
    # rotary inertias that differ by more than the polar one: the smaller belongs to the places
    body = on_axis([2.0, 1.0, 0.7, 0.1, 0.5, 0.2])
    assert mass_beside_axis(body) is None
    (found,) = spread_mass(body, 1.5).moments([0.0, 1.5])
    assert found == pytest.approx([2.0, 1.0, 0.9, 0.1, 0.3, 0.0], rel=1e-9, abs=ROUNDED)
    other = spread_mass(on_axis([2.0, 1.0, 0.7, 0.1, 0.2, 0.5]), 1.5)
    (found,) = other.moments([0.0, 1.5])
    assert found == pytest.approx([2.0, 1.0, 0.9, 0.1, 0.0, 0.3], rel=1e-9, abs=ROUNDED)


@pytest.mark.parametrize("power", [0, 2])
@pytest.mark.parametrize(("centre", "spread"), [(0.5, 0.3), (0.4, 0.25), (0.85, 0.1), (0.15, 0.2)])
def test_a_spread_mass_has_the_moments_and_inertias_per_mass(centre, spread, power):
    length, mass = 4.0, 3.0
    first, second = mass * centre * length, mass * (centre**2 + spread**2) * length**2
    moments = np.array([mass, first, second, 0.9, 0.4, 0.5])
    line = spread_mass(on_axis(moments), length, power)
    assert line.moments([0.0, length])[0] == pytest.approx(moments, rel=1e-9)
    per_mass = moments[3:] / mass
    smooth = replace(line, bodies=np.zeros((0, 5)))
    edges = length * np.array([0.0, 0.2, 0.5, 1.0])
    parts = smooth.moments(edges)
    assert parts[:, 3:] == pytest.approx(np.outer(parts[:, 0], per_mass))
    grown = np.diff(edges ** (power + 1)) / length ** (power + 1)
    assert parts[:, 0] == pytest.approx(parts[:, 0].sum() * grown)
    assert line.bodies[:, 2:] == pytest.approx(np.outer(line.bodies[:, 1], per_mass))
    assert np.all(line.bodies[:, 1] > 0.0)
    assert np.all(line.bodies[:, 0] <= length)


def test_a_uniform_and_a_growing_mass_need_no_points():
    for power in (0, 1, 3):
        first, second = (power + 1.0) / (power + 2.0), (power + 1.0) / (power + 3.0)
        body = on_axis([2.0, 2.0 * first, 2.0 * second, 0.1, 0.06, 0.04])
        line = spread_mass(body, 1.0, power)
        assert len(line.bodies) == 0
        grown = 2.0 * np.array([0.3, 0.7, 1.0]) ** (power + 1)
        assert line.moments([0.0, 0.3, 0.7, 1.0])[:, 0].cumsum() == pytest.approx(grown)


@pytest.mark.parametrize(
    ("share", "points", "power"),
    [
        (0.5, [(0.2, 0.2), (1.0, 0.3)], 0),  # no nearer to the root than a fifth
        (0.7, [(0.6, 0.3)], 0),  # as much as leaves one point
        (0.3, [(0.2, 0.5), (1.0, 0.2)], 2),
        (0.6, [(0.4, 0.4)], 1),
        (0.95, [(0.45, 0.05)], 0),
        (0.02, [(0.05, 0.6), (1.0, 0.38)], 0),  # no link without mass
    ],
)
def test_as_much_as_possible_is_smooth(share, points, power):
    places, masses = np.array(points).T
    first = masses @ places + share * (power + 1.0) / (power + 2.0)
    second = masses @ places**2 + share * (power + 1.0) / (power + 3.0)
    body = on_axis([1.0, first, second, 0.01, 0.004, 0.006])
    line = spread_mass(body, 1.0, power)
    smooth = replace(line, bodies=np.zeros((0, 5)))
    assert smooth.moments([0.0, 1.0])[0, 0] == pytest.approx(share, rel=1e-6)
    heavy = line.bodies[:, 1] > 1e-6
    assert line.bodies[heavy, 0] == pytest.approx(places, rel=1e-5)
    assert line.bodies[heavy, 1] == pytest.approx(masses, rel=1e-5)


@pytest.mark.parametrize(
    ("first", "second", "says"),
    [
        (-0.1, 1.0, "not outwards of the root"),
        (1.01, 1.03, "does not hold the mass"),  # beyond the tip
        (0.5, 0.51, "does not hold the mass"),  # more than first
        (0.5, 0.49, None),
        (0.5, 0.24, "does not hold the mass"),  # less than first^2
        (0.5, 0.26, None),
        (0.05, 0.02, None),
    ],
)
def test_moments_that_a_unit_length_holds(first, second, says):
    body = on_axis([1.0, first, second, 0.01, 0.004, 0.006])
    if says is None:
        (total,) = spread_mass(body, 1.0).moments([0.0, 1.0])
        assert total[:3] == pytest.approx([1.0, first, second], rel=1e-9)
    else:
        with pytest.raises(InputError, match=says):
            spread_mass(body, 1.0)
