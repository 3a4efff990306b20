"""A beam's moments, rigid mass and compliance are the integrals they claim to be."""

import numpy as np
import pytest
from scipy.integrate import quad

import finite_elements as fe
from appendages import (
    STEEL,
    close,
    panels,
    seed_boom,
    stepped_boom,
    tapered_boom,
    timoshenko_boom,
    unit_beam,
)
from beamchain import (
    Beam,
    Box,
    Equivalent,
    Lump,
    Rectangle,
    Round,
    Segment,
    Tube,
)
from formulas import Moments
from spec_tables import table_of

QUADRATURE = 1e-12  # scipy's quad on a smooth integrand, asked for 1e-13
CLOSED = 1e-13  # a closed form in another order, summed over a few segments
ELEMENTS = 1e-8  # two discretisations, each converged beyond it
STRONG = 1e-8  # one Gauss rule of 40 points on x^-4 over a taper of 30 to 1

TAPERS = {
    "cone": tapered_boom,
    "tube": lambda: Beam(
        segments=(
            Segment(
                length=7.0,
                section=Tube(outer_diameter=0.1, wall=0.004),
                section_end=Tube(outer_diameter=0.04, wall=0.001),
                material=STEEL,
                nonstructural_mass=0.3,
            ),
        )
    ),
    "rectangle": lambda: Beam(
        segments=(
            Segment(
                length=3.0,
                section=Rectangle(width_y=0.02, width_z=0.3),
                section_end=Rectangle(width_y=0.05, width_z=0.1),
                material=STEEL,
            ),
        )
    ),
    "box": lambda: Beam(
        segments=(
            Segment(
                length=3.0,
                section=Box(width_y=0.2, width_z=0.3, wall=0.01),
                section_end=Box(width_y=0.1, width_z=0.1, wall=0.002),
                material=STEEL,
            ),
        )
    ),
    "equivalent": lambda: Beam(
        segments=(
            Segment(
                length=4.0,
                section=Equivalent(
                    bending_stiffness_xy=10.0,
                    bending_stiffness_xz=30.0,
                    linear_mass=2.0,
                    polar_inertia=0.4,
                    torsion_stiffness=6.0,
                ),
                section_end=Equivalent(
                    bending_stiffness_xy=2.0,
                    bending_stiffness_xz=4.0,
                    linear_mass=0.5,
                    polar_inertia=0.1,
                    torsion_stiffness=1.0,
                ),
            ),
        )
    ),
}


def station(beam, x, name):
    """One property of a one-segment beam at x."""
    segment = beam.segments[0]
    return float(np.ravel(getattr(segment.at(np.array([x / segment.length])), name))[0])


def integral(function, a, b):
    return quad(function, a, b, epsabs=0.0, epsrel=1e-13, limit=200)[0]


# -- moments ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", TAPERS)
@pytest.mark.parametrize(("start", "end"), [(0.0, 1.0), (0.2, 0.65)])
def test_moments_are_the_integrals(name, start, end):
    beam = TAPERS[name]()
    a = start * beam.length
    b = end * beam.length
    m = Moments(*beam.line.moments([a, b])[0])
    for value, power, what in (
        (m.mass, 0, "mass"),
        (m.first, 1, "mass"),
        (m.second, 2, "mass"),
        (m.polar, 0, "polar"),
    ):
        assert value == close(
            integral(lambda x, p=power, w=what: station(beam, x, w) * x**p, a, b), rel=QUADRATURE
        )
    assert m.rotary_xy == m.rotary_xz == 0.0  # Euler


def test_moments_of_pieces_add_up():
    beam = stepped_boom()
    edges = [0.0, 1.1, 3.0, 6.9, beam.length]
    parts = beam.line.moments(edges)
    assert np.sum(parts, axis=0) == close(beam.line.moments([0.0, beam.length])[0], rel=CLOSED)


def test_seed_boom_s_mass_is_the_papers():
    # printed to three decimals
    assert seed_boom().line.whole[0, 0] == close(13.232, abs=5e-4)


def test_a_lump_belongs_to_the_stretch_that_starts_at_it():
    lump = Lump(x=0.5, mass=3.0, inertia=(0.1, 0.2, 0.25))
    beam = Beam(segments=unit_beam().segments, lumps=(lump,))
    (bare,) = unit_beam().line.moments([0.5, 1.0])
    inner, outer = beam.line.moments([0.0, 0.5, 1.0])
    assert inner[0] == close(0.5, rel=CLOSED)
    assert outer[0] == close(3.5, rel=CLOSED)
    assert outer - bare == close(np.array([3.0, 1.5, 0.75, 0.1, 0.25, 0.2]), rel=CLOSED)


@pytest.mark.parametrize(("before", "inside"), [(0.9, True), (1.1, False)])
def test_a_lump_belongs_to_a_stretch_from_a_billionth_of_the_length_before_it(before, inside):
    section = Equivalent(bending_stiffness_xy=1.0, linear_mass=1.0)
    lump = Lump(x=500.0 - before * 1e-6, mass=5.0)
    beam = Beam(segments=(Segment(length=1000.0, section=section),), lumps=(lump,))
    ((mass, *_),) = beam.line.moments([500.0, 600.0])
    assert mass == close(105.0 if inside else 100.0, rel=CLOSED)


def test_a_lump_at_the_tip_belongs_to_the_last_stretch():
    beam = Beam(segments=unit_beam().segments, lumps=(Lump(x=1.0, mass=2.0),))
    assert beam.line.moments([0.0, 0.7, 1.0])[:, 0] == close(np.array([0.7, 2.3]), rel=CLOSED)


@pytest.mark.parametrize("x", [0.0, 1.0 / 3.0, 0.999999, 1.0])
def test_every_lump_is_counted_once_whatever_the_cuts(x):
    beam = Beam(segments=unit_beam().segments, lumps=(Lump(x=x, mass=1.0),))
    for edges in ([0.0, 1.0], [0.0, 1.0 / 3.0, 1.0], [0.0, 0.25, 0.5, 1.0]):
        assert beam.line.moments(edges)[:, 0].sum() == close(2.0, rel=CLOSED)


def test_rigid_mass_of_the_uniform_rod():
    beam = seed_boom()
    m = 7800.0 * np.pi * 0.006**2 * 15.0
    length = 15.0
    r = 0.006
    expected = np.diag([m, m, m, m * r**2 / 2, m * length**2 / 3, m * length**2 / 3])
    expected[1, 5] = expected[5, 1] = m * length / 2
    expected[2, 4] = expected[4, 2] = -m * length / 2
    assert beam.rigid_mass() == close(expected, rel=CLOSED)


def test_rigid_mass_agrees_with_every_port():
    beam = panels()
    mass = beam.rigid_mass()
    planes = {
        "xy": mass[np.ix_([1, 5], [1, 5])],
        "torsion": mass[3:4, 3:4],
        "axial": mass[0:1, 0:1],
    }
    # plane xz turns about -y
    planes["xz"] = mass[np.ix_([2, 4], [2, 4])] * np.array([[1, -1], [-1, 1]])
    for port, expected in planes.items():
        assert beam.port(port, 3).rigid_mass == close(expected, rel=CLOSED)


def test_timoshenko_adds_its_rotary_inertia():
    beam = timoshenko_boom()
    b, h, length, rho = 0.3, 0.2, 2.0, 7800.0
    moments = Moments(*beam.line.moments([0.0, length])[0])
    assert moments.rotary_xy == close(rho * h * b**3 / 12 * length, rel=CLOSED)
    assert moments.rotary_xz == close(rho * b * h**3 / 12 * length, rel=CLOSED)
    # with it, the bar's inertia is the solid block's about the middle of its end
    block = rho * b * h * length * (length**2 / 3 + b**2 / 12)
    assert beam.rigid_mass()[5, 5] == close(block, rel=CLOSED)
    assert beam.port("xy", 2).rigid_mass[1, 1] == close(block, rel=CLOSED)


# -- compliance ------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", TAPERS)
@pytest.mark.parametrize(
    ("port", "property_"), [("xy", "bending_xy"), ("xz", "bending_xz"), ("torsion", "torsion")]
)
def test_compliance_is_the_integral_of_the_inverse_stiffness(name, port, property_):
    beam = TAPERS[name]()
    a, b = 0.1 * beam.length, 0.95 * beam.length
    expected = integral(lambda x: 1.0 / station(beam, x, property_), a, b)
    assert beam.compliance(a, b, port) == close(expected, rel=QUADRATURE)


@pytest.mark.parametrize(("ratio", "tolerance"), [(2.0, CLOSED), (10.0, CLOSED), (30.0, STRONG)])
def test_compliance_of_a_strong_cone(ratio, tolerance):
    d0, length = 0.3, 2.0
    d1 = d0 / ratio
    segment = Segment(
        length=length, section=Round(diameter=d0), section_end=Round(diameter=d1), material=STEEL
    )
    e = STEEL.youngs_modulus
    expected = 64 / (np.pi * e) * length / (3 * (d0 - d1)) * (1 / d1**3 - 1 / d0**3)
    assert Beam(segments=(segment,)).compliance(0.0, length, "xy") == close(expected, rel=tolerance)


def test_compliance_takes_in_the_joints_of_the_stretch():
    beam = panels()
    per_panel = 2.0 / 4000.0
    total = 3 * per_panel + 1 / 2500 + 2 / 1800
    assert beam.compliance(0.0, 6.0, "xy") == close(total, rel=CLOSED)
    # the joint at 2 m is beyond
    assert beam.compliance(0.0, 2.0, "xy") == close(per_panel + 1 / 2500, rel=CLOSED)
    assert beam.compliance(2.0, 4.0, "xy") == close(per_panel + 1 / 1800, rel=CLOSED)
    assert beam.compliance(2.1, 3.9, "xy") == close(1.8 / 4000.0, rel=CLOSED)
    # the joints are rigid there
    assert beam.compliance(0.0, 6.0, "xz") == close(6.0 / 9000.0, rel=CLOSED)


# -- the whole -------------------------------------------------------------------------------------
def test_lengths_and_starts():
    beam = stepped_boom()
    assert beam.length == 10.5
    assert beam.starts == [0.0, 3.0, 7.0]


@pytest.mark.parametrize(
    ("make", "uniform"),
    [
        (seed_boom, True),
        (unit_beam, True),
        (tapered_boom, False),
        (stepped_boom, False),
        (panels, False),
        (timoshenko_boom, False),
    ],
)
def test_uniform_means_one_prismatic_euler_segment_and_nothing_else(make, uniform):
    assert make().uniform is uniform


def test_round_booms_are_alike_in_both_planes():
    beam = tapered_boom()
    a = beam.port("xy", 4)
    b = beam.port("xz", 4)
    assert b.frequencies == close(a.frequencies, rel=0.0)
    assert b.participation == close(a.participation, rel=0.0)


def test_depth_follows_the_taper():
    beam = tapered_boom()
    assert [beam.depth(x, "xy") for x in (0.0, 5.0, 10.0)] == close([0.05, 0.035, 0.02], rel=CLOSED)


def test_an_xz_stiffness_left_out_at_one_end_is_the_xy_stiffness_there():
    segment = Segment(
        length=1.0,
        section=Equivalent(bending_stiffness_xy=4.0, linear_mass=1.0),
        section_end=Equivalent(bending_stiffness_xy=2.0, bending_stiffness_xz=8.0, linear_mass=1.0),
    )
    assert segment.at(np.array([0.0, 0.25, 1.0])).bending_xz == close(
        np.array([4.0, 5.0, 8.0]), rel=CLOSED
    )


@pytest.mark.parametrize(
    ("root", "tip"),
    [
        (Tube(outer_diameter=0.2, wall=0.1), Tube(outer_diameter=0.2, wall=0.005)),
        (
            Box(width_y=0.2, width_z=0.2, wall=0.005),
            Box(width_y=0.2, width_z=0.05, wall=0.005),
        ),
    ],
)
def test_the_shear_factor_follows_the_taper(root, tip):
    beam = Beam(
        segments=(
            Segment(length=1.0, section=root, section_end=tip, material=STEEL, theory="timoshenko"),
        )
    )
    for port in ("xy", "xz"):
        truth = fe.cantilever(table_of(beam), {port: 3}).frequencies
        assert beam.port(port, 3).frequencies[:3] == close(truth, rel=ELEMENTS)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_repeated_segment_stands_as_often(count):
    one = Segment(length=2.0, section=Round(diameter=0.1), material=STEEL)
    other = Segment(length=1.0, section=Round(diameter=0.2), material=STEEL)
    many = Segment(length=2.0, section=Round(diameter=0.1), material=STEEL, repeat=count)
    assert Beam(segments=(many, other)).segments == (one,) * count + (other,)


def test_beams_compare_by_value():
    assert seed_boom() == seed_boom()
    assert hash(seed_boom()) == hash(seed_boom())
    # a list is taken and frozen
    assert isinstance(Beam(segments=list(seed_boom().segments)).segments, tuple)
