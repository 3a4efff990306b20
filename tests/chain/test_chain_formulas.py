"""Closed forms beside the formulas of a chain."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import eigh

import beamchain as bc
from beamchain import Beam, Equivalent, PortModel, Segment
from beamchain.chain.recursion import realise_scalar
from beamchain.chain.seed import SeedRow
from formulas import (
    Chain,
    Hinge,
    Link,
    bodies,
    raise_polar_inertia,
    realise,
    settle_links,
    share,
    split,
)

ROUNDED = 1e-12  # relative, of a few operations


@pytest.mark.parametrize("reach", [0.0, 1e-6, 0.4])
def test_a_dumbbell_on_a_massless_rod_has_its_spring_at_the_hinge(reach):
    # m_1 on the hinge at x_0, m_2 beyond it by l: W^2 = c / (m_2 l^2), L = m_2 l (1, x_0 + l) / |.|
    m1, m2, length, spring = 700.0, 300.0, 1.5, 11.0
    end = reach + length
    rigid = np.array([[m1 + m2, m1 * reach + m2 * end], [0.0, m1 * reach**2 + m2 * end**2]])
    rigid[1, 0] = rigid[0, 1]
    moment = np.sqrt(m2) * np.array([[1.0, end]])
    nodes = realise(PortModel(rigid, np.array([np.sqrt(spring / m2) / length]), moment))
    assert nodes.masses == pytest.approx([0.0, m1, m2], rel=ROUNDED)
    assert nodes.lengths == pytest.approx([reach, length], rel=ROUNDED)
    assert nodes.stiffness == pytest.approx([spring], rel=ROUNDED)


@pytest.mark.parametrize("root", [0.0, 0.7])
def test_discs_on_springs_are_recovered_with_and_without_one_at_the_root(root):
    """J_0 - k_1 - J_1 - k_2 - J_2 - k_3 - J_3, in angles beyond the root's."""
    inertias, springs = np.array([2.0, 0.5, 1.1]), np.array([30.0, 50.0, 8.0])
    steps = np.eye(3) - np.eye(3, k=-1)
    squares, shapes = eigh(steps.T @ np.diag(springs) @ steps, np.diag(inertias))
    rigid = np.array([[root + inertias.sum()]])
    found = realise_scalar(PortModel(rigid, np.sqrt(squares), (shapes.T @ inertias)[:, None]))
    assert found[0] == pytest.approx([root, *inertias], rel=1e-9)
    assert found[1] == pytest.approx(springs, rel=1e-9)


@pytest.mark.parametrize("part", [0.95, 1.05])
def test_a_chain_a_million_times_as_long_as_its_mass_centre_is_far_is_none(part):
    """m_1 at the root and m_2 at the tip, l (m_1 + m_2) / m_2 from it."""
    m2, length = 3.0 / part, 40.0
    m1 = 3e6 - m2
    moment = np.sqrt(m2) * np.array([[1.0, length]])
    rigid = np.array([[m1 + m2, m2 * length], [m2 * length, m2 * length**2]])
    target = PortModel(rigid, np.array([0.8]), moment)
    if part < 1.0:
        assert realise(target).lengths == pytest.approx([0.0, length], rel=1e-6)
    else:
        with pytest.raises(bc.BeamchainError, match="far beyond the appendage"):
            realise(target)


@pytest.mark.parametrize("part", [-1.1, -0.9, 0.9, 1.1])
def test_a_hinge_within_a_billionth_of_the_mass_centre_s_distance_stands_at_the_root(part):
    m1, m2, length, spring = 700.0, 300.0, 30.0, 11.0
    reach = part * 1e-9 * m2 * length / (m1 + m2)
    end = reach + length
    rigid = np.array([[m1 + m2, m1 * reach + m2 * end], [0.0, m1 * reach**2 + m2 * end**2]])
    rigid[1, 0] = rigid[0, 1]
    target = PortModel(
        rigid, np.array([np.sqrt(spring / m2) / length]), np.sqrt(m2) * np.array([[1.0, end]])
    )
    if part < -1.0:
        with pytest.raises(bc.BeamchainError, match="before the root"):
            realise(target)
        return
    nodes = realise(target)
    assert nodes.lengths[0] == (pytest.approx(reach, rel=1e-5) if part > 1.0 else 0.0)
    assert nodes.lengths[1] == pytest.approx(length, rel=1e-9)


@pytest.mark.parametrize("part", [0.9, 1.1])
def test_a_trillionth_of_the_mass_must_stay_at_the_root(part):
    """A small mass on a hinge far beyond the large one: a link would be negative."""
    m2, length, spring = 700.0, 3.0, 11.0
    m1, reach = part * 1e-12 * m2, 5e5
    end = 0.4 + length
    rigid = np.array(
        [[m1 + m2, m1 * reach + m2 * end], [m1 * reach + m2 * end, m1 * reach**2 + m2 * end**2]]
    )
    moment = np.sqrt(m2) * np.array([[1.0, end]])
    target = PortModel(rigid, np.array([np.sqrt(spring / m2) / length]), moment)
    with pytest.raises(bc.BeamchainError, match="meets no mass" if part < 1.0 else "not physical"):
        realise(target)


def test_bodies_are_the_pieces_between_the_hinges():
    # 0.04 kg/m on 2 m with a hinge at 0.5 m: rods of 0.02 and 0.06 kg
    thin = Equivalent(bending_stiffness_xy=1.0, linear_mass=0.04)
    line = Beam(segments=(Segment(length=2.0, section=thin),)).line
    pieces = bodies(line, np.array([0.5]))
    for piece, start, length in zip(pieces, (0.0, 0.5), (0.5, 1.5), strict=True):
        mass = 0.04 * length
        across = mass * length**2 / 12.0
        assert [piece.start, piece.length, piece.mass] == pytest.approx([start, length, mass])
        assert piece.com == pytest.approx(start + length / 2.0, rel=ROUNDED)
        # a rod is taken for a body of 1e-12 of its length
        assert piece.inertia == pytest.approx((0.0, across, across), abs=3e-12 * across, rel=1e-10)


def link(number, *inertia):
    return Link(float(number), 1.0, 1.0, number + 0.5, inertia)


def test_polar_inertia_is_shared_as_the_pieces_have_it_where_bodies_can_carry_it():
    # |I_zz - I_yy| <= I_xx: the first carries 0.5 at least, where halves of 0.6 would be 0.3
    links = [link(0, 0.0, 1.0, 1.5), link(1, 0.0, 2.0, 2.0)]
    assert share(links, [0.6], [[0, 1]], np.ones(2)) == pytest.approx([0.5, 0.1], rel=1e-9)
    assert share(links, [2.0], [[0, 1]], np.ones(2)) == pytest.approx([1.0, 1.0], rel=1e-9)
    assert share(links, [2.0], [[0, 1]], np.array([1.0, 3.0])) == pytest.approx([0.5, 1.5])


def test_links_that_are_rigid_bodies_stay_as_they_are():
    line = SimpleNamespace(
        length=2.0,
        rigid_mass=lambda: np.diag([2.0, 2.0, 2.0, 0.4, 3.0, 3.0]),
        moments=lambda edges: np.outer(0.2 * np.diff(edges), np.eye(6)[3]),
    )
    solid = [link(0, 0.3, 1.0, 1.0), link(1, 0.1, 1.0, 1.0)]
    assert settle_links(line, solid, np.array([1.0])) == solid
    flat = [link(0, 0.4, 1.0, 1.0), link(1, 0.0, 1.0, 1.0)]
    settled = settle_links(line, flat, np.array([1.0]))
    assert [one.inertia[0] for one in settled] == pytest.approx([0.2, 0.2], rel=1e-9)


def test_inertias_below_the_least_are_raised_where_bending_does_not_feel_it():
    # 5e-13 kg m^2 are missing across, of 1e-9 times 1 kg m^2 that bending does not feel
    links = (link(0, 0.0, 1.0, 1.0), link(1, 0.0, 5e-13, 5e-13))
    chain = Chain(links, (Hinge(1.0, {"xy": 3.0}),), 2.0)
    raised = raise_polar_inertia(chain, 1e-12)[0]
    assert [one.inertia for one in raised.links] == [(1e-12, 1.0, 1.0), (1e-12, 1e-12, 1e-12)]


@pytest.mark.parametrize("hung", [False, True])
def test_kinetic_energy_of_links_in_a_row_and_of_links_that_hang_side_by_side(hung):
    links = tuple(link(k, 0.1, 0.2, 0.3) for k in range(3))
    hinges = (Hinge(1.0, {"xy": 3.0}), Hinge(1.5, {"xy": 3.0}))
    chain = Chain(links, hinges, 3.0, hung=hung)
    elastic = chain.rows(((0, "xy"), (1, "xy")))[1]
    # each behind its hinge: 1 kg at 1.5 m from x = 1 m, at 2.5 m from x = 1.5 m
    if hung:
        mass = np.diag([0.3 + 0.5**2, 0.3 + 1.0**2])
    else:
        mass = np.array([[0.6 + 0.5**2 + 1.5**2, 0.3 + 1.5 * 1.0], [0.3 + 1.5 * 1.0, 0.3 + 1.0**2]])
    assert elastic.T @ elastic == pytest.approx(mass, rel=ROUNDED, abs=ROUNDED)


def test_pendulums_that_hang_have_springs_of_their_weight():
    """Behind a hinge at x hangs m with its centre before it: c + a m (x - centre)."""
    links = tuple(Link(float(k), 1.0, 2.0, k + 0.5, (0.1, 0.2, 0.3)) for k in range(3))
    hinges = (Hinge(1.8, {"xy": 3.0}), Hinge(3.0, {"xy": 0.0}))
    chain = Chain(links, hinges, 3.0, hung=True, acceleration=4.0)
    wanted = [3.0 + 4.0 * 2.0 * 0.3, 4.0 * 2.0 * 0.5]
    assert chain.stiffness(((0, "xy"), (1, "xy"))) == pytest.approx(np.diag(wanted), rel=ROUNDED)
    # in a port without hinges it is a rigid body
    locked = chain.port("torsion")
    assert (locked.modes, locked.rigid_mass.tolist()) == (0, [[pytest.approx(0.3)]])


def at(x):
    """Motion of a point at x per motion of the root: displacement, rotation."""
    return np.array([1.0, x])


def test_two_rods_with_a_mass_at_the_root_are_recovered():
    # m_0 at the root, m_1 at the hinge at l_1, m_2 beyond it by l_2
    m0, m1, m2, l1, l2, c = 4.0, 3.0, 1.5, 1.2, 0.8, 11.0
    points = ((m0, 0.0), (m1, l1), (m2, l1 + l2))
    target = PortModel(
        rigid_mass=sum(m * np.outer(at(x), at(x)) for m, x in points),
        frequencies=np.array([np.sqrt(c / (m2 * l2**2))]),
        participation=np.sqrt(m2) * at(l1 + l2)[None, :],
    )
    nodes = realise(target)
    assert nodes.masses == pytest.approx([m0, m1, m2], rel=1e-10)
    assert nodes.lengths == pytest.approx([l1, l2], rel=1e-10)
    assert nodes.stiffness == pytest.approx([c], rel=1e-10)


def test_masses_of_nodes_become_rods_with_the_same_moments():
    """Two point masses a, b at the ends of a rod of length l: mass a + b, centre l b / (a + b),
    inertia a b / (a + b) l^2; the wanted masses are taken where they lie between the bounds."""
    nodes = realise(
        PortModel(
            rigid_mass=sum(
                m * np.outer(at(x), at(x)) for m, x in ((4.0, 0.0), (3.0, 1.2), (1.5, 2.0))
            ),
            frequencies=np.array([3.0]),
            participation=np.sqrt(1.5) * at(2.0)[None, :],
        )
    )
    mass, com, inertia = split(nodes, np.array([5.0, 3.5]))
    assert mass == pytest.approx([5.0, 3.5])
    outer, inner = 1.0, 2.0  # of the node of 3 kg, to either rod
    assert com == pytest.approx([1.2 * outer / 5.0, 0.8 * 1.5 / 3.5])
    assert inertia == pytest.approx([4.0 * outer / 5.0 * 1.2**2, inner * 1.5 / 3.5 * 0.8**2])


def test_polar_inertia_beyond_what_a_link_can_carry_goes_to_the_others():
    # as 1 to 2 to 3, but the last carries at most 2.5 + 2.5
    links = [link(0, 0.0, 9.0, 9.0), link(1, 0.0, 9.0, 9.0), link(2, 0.0, 2.5, 2.5)]
    real = np.array([1.0, 2.0, 3.0])
    assert share(links, [6.0], [[0, 1, 2]], real) == pytest.approx([1.0, 2.0, 3.0])
    assert share(links, [14.0], [[0, 1, 2]], real) == pytest.approx([3.0, 6.0, 5.0])
    assert share(links, [3.0, 4.0], [[0, 1], [2]], real) == pytest.approx([1.0, 2.0, 4.0])
    with pytest.raises(bc.BeamchainError):
        share(links, [5.1], [[2]], real)
    # what their shape asks for at least, to a billionth
    flat = [link(0, 0.0, 1.0, 1.5), link(1, 0.0, 2.0, 4.0)]
    found = share(flat, [2.5 * (1.0 - 0.9e-9)], [[0, 1]], np.ones(2))
    assert found == pytest.approx([0.5, 2.0], rel=1e-8)
    with pytest.raises(bc.BeamchainError):
        share(flat, [2.5 * (1.0 - 1.1e-9)], [[0, 1]], np.ones(2))
    # one that has none gets a thousandth of a thousandth of what is across
    assert share(links, [0.0], [[0, 1, 2]], real) == pytest.approx([9e-6, 9e-6, 2.5e-6])


@pytest.mark.parametrize(
    ("polar", "least", "mass", "raised"),
    [
        (0.0, 1.9e-3, 1.0, True),  # a thousandth of the chain's transverse inertia may be added
        (0.0, 2.5e-3, 1.0, False),
        (0.0, 1e-4, 5e-5, False),  # lighter than the least inertia in number
        (1e-4, 0.9e-4, 1.0, False),
    ],
)
@pytest.mark.parametrize("larger", [1, 2])
def test_how_much_roll_inertia_is_raised(polar, least, mass, raised, larger):
    # about the root: 1 (0.5^2 + 1.5^2) and 2 across, 4.5 and two links to be raised
    own = (1.0, 0.5) if larger == 1 else (0.5, 1.0)
    links = tuple(Link(float(k), 1.0, mass, k + 0.5, (polar, *own)) for k in range(2))
    chain = Chain(links, (Hinge(1.0, {"xy": 3.0}),), 2.0)
    found = raise_polar_inertia(chain, least)[0]
    expected = least if raised else polar
    assert [one.inertia for one in found.links] == [(expected, *own)] * 2


def test_a_row_of_the_paper_s_table_is_off_by_a_share_of_what_is_printed():
    row = SeedRow("k1", 4.0, 4.5)
    assert row.difference == pytest.approx(0.125)
