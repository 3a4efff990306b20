"""Closed forms beside a beam that its modes bend, and beside a liquid that hangs in its tank."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import jnp_zeros

import beamchain as bc
from formulas import (
    BentLine,
    Slosh,
    bent_line,
    hanging_liquid,
    lowest_modes,
    ranks_of_modes,
    springs_at_stated,
    turned_by,
)

RNG = np.random.default_rng(5)


# -- bent lines ------------------------------------------------------------------------------------
def test_cells_stand_one_behind_the_other():
    """Each turned against the one before, as long as the chord of its arc and what it stretches."""
    turns, bows = (0.3 * RNG.standard_normal((2, 3, 3)) for _ in range(2))
    stretches = 0.1 * RNG.standard_normal((2, 3))
    lengths, centres = np.array([1.0, 0.7, 1.4]), np.array([0.45, 0.4, 0.6])
    turn_at_end = 0.2 * RNG.standard_normal((2, 3))
    line = BentLine(
        None, np.arange(2), lengths, np.ones(3), centres, np.zeros((3, 3, 3)), turns, stretches,
        bows, ((2, np.zeros((2, 3))), (1, turn_at_end)), np.ones(2),
    )  # fmt: skip
    eta = RNG.standard_normal((4, 2))
    axes, ends, middles = line.bent(eta)
    for b, coordinates in enumerate(eta):
        turn, place = Rotation.identity(), np.zeros(3)
        for c in range(3):
            turn = turn * Rotation.from_rotvec(coordinates @ turns[:, c])
            bend = np.linalg.norm(coordinates @ bows[:, c])
            long = lengths[c] * (1.0 - bend**2 / 24.0) + coordinates @ stretches[:, c]
            along = long * turn.apply([1.0, 0.0, 0.0])
            np.testing.assert_allclose(axes[b, c], turn.as_matrix(), atol=1e-12)
            np.testing.assert_allclose(
                middles[b, c], place + along * centres[c] / lengths[c], atol=1e-12
            )
            place = place + along
            np.testing.assert_allclose(ends[b, c], place, atol=1e-12)
            if c == 1:
                wanted = turn * Rotation.from_rotvec(coordinates @ turn_at_end)
                at, tilted = line.port(1, axes, ends, eta)
                np.testing.assert_allclose(at[b], place, atol=1e-12)
                np.testing.assert_allclose(tilted[b], wanted.as_matrix(), atol=1e-12)


@pytest.mark.parametrize("size", [5e-5, 0.99e-4, 1.01e-4, 5e-4])
def test_small_rotations_to_every_digit(size):
    """Half of R - R^T is sin(a), and the trace 1 + 2 cos(a)."""
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    found = turned_by(size * axis)
    skew = (found - found.T) / 2.0
    wanted = np.sin(size) * axis
    np.testing.assert_allclose([skew[2, 1], skew[0, 2], skew[1, 0]], wanted, rtol=2e-11)
    grown = 3.0 - np.trace(found)
    assert grown == pytest.approx(4.0 * np.sin(size / 2.0) ** 2, rel=1e-6)


MATERIAL = bc.Material(youngs_modulus=7e10, density=2700.0)
SIDES = 0.04, 0.02


def beam(lumps=(), joints=(), lengths=(3.0,)):
    section = bc.Rectangle(width_y=SIDES[0], width_z=SIDES[1])
    return bc.Beam(
        segments=[bc.Segment(length=x, section=section, material=MATERIAL) for x in lengths],
        lumps=list(lumps),
        joints=list(joints),
    )


LINE = 2700.0 * SIDES[0] * SIDES[1]  # kg/m


def test_a_rod_is_stretched_by_its_axial_modes():
    """sqrt(2 / m L) sin(pi x / 2 L)."""
    rod, length = beam(), 3.0
    line = bent_line(rod, {"axial": rod.port("axial", 3)}, rod.rigid_mass(), [], 50.0)
    eta = np.zeros((1, line.rows.size))
    eta[0, 0] = 1e-2
    axes, ends, _ = line.bent(eta)
    x = np.linspace(0.0, length, 41)[1:]
    size = np.sqrt(2.0 / (LINE * length))
    moved = 1e-2 * size * np.sin(np.pi * x / (2.0 * length))
    assert np.abs(ends[0, :, 0] - x) == pytest.approx(moved, rel=1e-4)
    np.testing.assert_allclose(axes[0], np.broadcast_to(np.eye(3), (40, 3, 3)), atol=1e-15)
    assert np.all(line.bows == 0.0)
    # the largest elongation over the length
    assert line.size[0] == pytest.approx(size / length, rel=1e-4)


def test_a_mode_is_as_large_as_its_largest_turn():
    """The slope of a cantilever at its tip, 1.3765 of the deflection there over the length."""
    rod, length = beam(), 3.0
    line = bent_line(rod, {"xz": rod.port("xz", 3)}, rod.rigid_mass(), [], 50.0)
    tip = 2.0 / np.sqrt(LINE * length)
    assert line.size[0] == pytest.approx(1.3765 * tip / length, rel=1e-3)
    # of the bend from cell to cell half is the start of the next
    eta = np.zeros((1, line.rows.size))
    eta[0, 0] = 1e-3
    axes, ends, _ = line.bent(eta)
    slope = -np.gradient(ends[0, :, 2], ends[0, :, 0])
    across = axes[0, :, 0, 2]
    assert across[5:-5] == pytest.approx((slope[5:-5] + slope[4:-6]) / 2.0, rel=1e-2)
    # turns about -y lift along z, and the line comes nearer by int w'^2 / 2
    assert np.sign(ends[0, -1, 2]) == np.sign(axes[0, -1, 2, 0])
    eta[0, 0] = 0.05
    _, ends, _ = line.bent(eta)
    x = np.linspace(0.0, length, 2001)
    b = 1.8751040687 / length
    ratio = (np.cosh(b * length) + np.cos(b * length)) / (np.sinh(b * length) + np.sin(b * length))
    rise = np.sinh(b * x) + np.sin(b * x) - ratio * (np.cosh(b * x) - np.cos(b * x))
    rise *= 0.05 * b / np.sqrt(LINE * length)
    assert length - ends[0, -1, 0] == pytest.approx(np.trapezoid(rise**2 / 2.0, x), rel=2e-3)


@pytest.mark.parametrize(("port", "axis"), [("xy", 2), ("xz", 1)])
def test_cells_bend_together_as_far_as_the_tip_turns(port, axis):
    rod, length = beam(), 3.0
    line = bent_line(rod, {port: rod.port(port, 3)}, rod.rigid_mass(), [], 50.0)
    tip = 2.0 / np.sqrt(LINE * length)
    together = line.bows[0].sum(axis=0)
    assert abs(together[axis]) == pytest.approx(1.3765 * tip / length, rel=2e-3)
    assert np.count_nonzero(together) == 1


def test_cells_have_the_mass_of_the_beam_and_its_lumps():
    """Cut at a port and at a hinge line that the even cuts miss; a lump counts where it stands."""
    lump = bc.Lump(x=1.03, mass=4.0, inertia=(0.05, 0.07, 0.09))
    tip = bc.Lump(x=3.0, mass=2.0, inertia=(0.03, 0.02, 0.04))
    joint = bc.Joint(after_segment=1, stiffness_xy=500.0)
    bent = beam([lump, tip], [joint], (1.73, 1.27))
    models = {port: bent.port(port, count, [0.31]) for port, count in (("xy", 4), ("torsion", 2))}
    line = bent_line(bent, models, bent.rigid_mass(), [0.31], 50.0)
    assert np.all(line.bows[..., 0] == 0.0)  # twist shortens no chord
    x = np.concatenate([[0.0], np.cumsum(line.lengths)])
    even = np.linspace(0.0, 3.0, 41)
    assert x == pytest.approx(np.sort([*even, 0.31, 1.73]))
    h = np.diff(x)
    masses, firsts = LINE * h, LINE * h**2 / 2.0
    across = LINE * h**3 / 3.0
    polar = LINE * h * (SIDES[0] ** 2 + SIDES[1] ** 2) / 12.0
    turned = [polar, across.copy(), across.copy()]
    for each, cell in ((lump, int(np.searchsorted(x, 1.03)) - 1), (tip, h.size - 1)):
        out = each.x - x[cell]
        masses[cell] += each.mass
        firsts[cell] += each.mass * out
        for k in range(3):
            turned[k][cell] += each.inertia[k] + (each.mass * out**2 if k else 0.0)
    centres = firsts / masses
    assert line.masses == pytest.approx(masses)
    assert line.centres == pytest.approx(centres)
    assert line.inertias[:, 0, 0] == pytest.approx(turned[0])
    for k in (1, 2):
        assert line.inertias[:, k, k] == pytest.approx(turned[k] - masses * centres**2)
    assert line.ends[0][0] == list(np.round(x, 9)).index(0.31) - 1
    # across the hinge line the beam has a kink: the cell behind it is turned by more
    number = list(np.round(x, 9)).index(1.73)
    first = np.flatnonzero(np.any(line.turns[:, :, 2] != 0.0, axis=1))[0]
    jumps = np.abs(line.turns[first, :, 2])
    assert int(np.argmax(jumps[1:])) + 1 == number
    # M = k times the kink: EI w'' = M there
    stiff = 7e10 * SIDES[1] * SIDES[0] ** 3 / 12.0
    bends = line.bows[first, :, 2] / h
    near = (bends[number - 1] + bends[number]) / 2.0
    kink = line.turns[first, number, 2] - near * (h[number - 1] + h[number]) / 2.0
    assert 500.0 * kink == pytest.approx(stiff * near, rel=2e-2)


@pytest.mark.parametrize(
    ("frequencies", "count"),
    [
        (np.linspace(1.0, 5.0, 5), 5),  # all there are
        (np.linspace(31.0, 60.0, 20), 6),  # at least six
        (np.array([*np.linspace(1.0, 30.0, 5), *np.linspace(30.1, 90.0, 9)]), 8),  # and three more
        (np.array([*np.linspace(1.0, 29.9, 4), *np.linspace(30.1, 90.0, 9)]), 7),
    ],
)
def test_modes_up_to_three_times_the_band_and_three_more(frequencies, count):
    rows = RNG.standard_normal((frequencies.size, 2))
    damping = np.linspace(0.01, 0.02, frequencies.size)
    model = bc.PortModel(1e6 * np.eye(2), frequencies, rows, damping=damping)
    low = lowest_modes(model, "xy", [], 10.0)
    assert low.frequencies == pytest.approx(frequencies[:count])
    # with the static shapes of loads on the second point
    points = RNG.standard_normal((frequencies.size, 6))
    for port, columns in (("xy", [2, 3]), ("torsion", [1])):
        m = len(columns)
        given = bc.PortModel(
            1e6 * np.eye(m),
            frequencies,
            rows[:, :m],
            damping=damping,
            tip=points,
            points=(9.0, 1.5, *range(2, 6 // m)),
        )
        points = given.tip
        low = lowest_modes(given, port, [1.5], 10.0)
        shapes = min(len(columns), frequencies.size - count)
        assert low.modes == count + shapes
        # their flexibility is that of all modes
        whole = (points / frequencies[:, None] ** 2).T @ points
        found = (low.tip / low.frequencies[:, None] ** 2).T @ low.tip
        square = np.ix_(columns, columns)
        np.testing.assert_allclose(found[square], whole[square], rtol=1e-9)
        beyond = np.mean(damping[count:]) if shapes else 0.0
        wanted = [*damping[:count], *[beyond] * shapes]
        assert low.damping == pytest.approx(wanted)


def test_modes_of_all_ports_are_counted_by_frequency():
    models = {
        "xy": SimpleNamespace(frequencies=np.array([1.0, 4.0, 9.0]), modes=3),
        "xz": SimpleNamespace(frequencies=np.array([2.0, 4.0]), modes=2),
        "torsion": SimpleNamespace(frequencies=np.array([3.0]), modes=1),
    }
    found = ranks_of_modes(models)
    assert {port: rank.tolist() for port, rank in found.items()} == {
        "xy": [0, 3, 5],
        "xz": [1, 4],
        "torsion": [2],
    }


# -- liquids ---------------------------------------------------------------------------------------
TANK = Slosh(shape="cylinder", radius=0.6, height=0.9, density=800.0, ratio=0.01, acceleration=2.5)


def test_a_hanging_liquid_has_the_mass_of_the_rigid_one():
    """m_n, L_n and h_n of Abramson; the fixed mass is what they leave."""
    liquid, (radius, height) = hanging_liquid(TANK), (0.6, 0.9)
    mass = np.pi * radius**2 * height * 800.0
    xi = jnp_zeros(1, 12)
    tilted = np.tanh(xi * height / radius)
    masses = mass * 2.0 * radius * tilted / (xi * height * (xi**2 - 1.0))
    lengths = radius / (xi * tilted)
    places = height - 2.0 * radius / xi * np.tanh(xi * height / (2.0 * radius))
    assert liquid.masses[1:] == pytest.approx(masses)
    assert liquid.lengths == pytest.approx(lengths)
    assert liquid.places[1:] == pytest.approx(places)
    assert np.sum(liquid.masses) == pytest.approx(mass)
    assert liquid.masses @ liquid.places == pytest.approx(mass * height / 2.0)
    series = jnp_zeros(1, 200)
    about = height**2 / 12.0 - 0.75 * radius**2
    about += (
        16.0
        * radius**3
        / height
        * np.sum(np.tanh(series * height / (2.0 * radius)) / (series**3 * (series**2 - 1.0)))
    )
    across = liquid.masses @ liquid.places**2 + liquid.inertias[:, 1, 1].sum()
    assert across == pytest.approx(mass * (about + height**2 / 4.0), rel=1e-9)
    assert liquid.inertias[0, 2, 2] == liquid.inertias[0, 1, 1]
    assert liquid.inertias.shape == (13, 3, 3)
    assert np.count_nonzero(liquid.inertias) == 2
    assert liquid.rows.tolist() == list(range(24))
    # a surface that turns by 1 moves the mass by L, in either plane
    assert liquid.size == pytest.approx(np.repeat(1.0 / (np.sqrt(masses) * lengths), 2))


def test_pendulums_rise_by_the_square_of_what_they_move_aside():
    liquid = hanging_liquid(TANK)
    eta = RNG.standard_normal((3, 24))
    axes, ends, centres = liquid.bent(eta)
    assert ends is centres
    assert axes.shape == (3, 13, 3, 3)
    assert np.all(axes == np.eye(3))
    for b in range(3):
        np.testing.assert_allclose(centres[b, 0], [liquid.places[0], 0.0, 0.0])
        for n in range(12):
            y, z = eta[b, 2 * n : 2 * n + 2] / np.sqrt(liquid.masses[n + 1])
            rise = (y**2 + z**2) / (2.0 * liquid.lengths[n])
            wanted = [liquid.places[n + 1] + rise, y, z]
            np.testing.assert_allclose(centres[b, n + 1], wanted, rtol=1e-12)
    with pytest.raises(NotImplementedError):
        liquid.port(0, axes, ends, eta)


def test_springs_of_the_kept_pendulums():
    """m_n a L_n, about y and z."""
    liquid = hanging_liquid(TANK)
    wanted = liquid.masses[1:3] * liquid.lengths[:2] * 2.5
    assert np.sort(springs_at_stated(TANK)) == pytest.approx(
        np.sort(np.repeat(wanted, 2)), rel=1e-9
    )
