"""Closed forms beside the formulas of structures."""

import numpy as np
import pytest
from scipy.special import iv, ivp, jnp_zeros

from beamchain import Beam, Lump, Material, ModalData, Rectangle, Round, Segment, Tube
from formulas import (
    Sections,
    Slosh,
    System,
    change_of_frequencies,
    independent_parts,
    nearest_body,
    realisable_body,
    rounding_of_residual,
    sections_at,
    within_body,
)

ROUNDED = 1e-12


def test_poisson_s_ratio_of_two_moduli():
    # G = E / (2 (1 + nu))
    material = Material(youngs_modulus=7e10, density=2700.0, shear_modulus=7e10 / 2.5)
    assert material.nu == pytest.approx(0.25, rel=ROUNDED)


def test_cowper_s_factor_of_a_circle_and_of_a_rectangle():
    assert Round(diameter=0.1).cowper(0.5, "xy") == pytest.approx(6.0 * 1.5 / (7.0 + 3.0))
    flat = Rectangle(width_y=0.1, width_z=0.2)
    assert flat.cowper(0.5, "xz") == pytest.approx(10.0 * 1.5 / (12.0 + 5.5))


@pytest.mark.parametrize(("is_round", "bent"), [(False, 30.0 + 40.0), (True, 50.0)])
def test_extreme_stress_of_a_section_is_at_its_corner_or_along_its_radius(is_round, bent):
    # N / A = 2000 / 2e-3 = 1 MPa; M_y z / I_y = 30 MPa, M_z y / I_z = 40 MPa
    one = np.ones(1)
    section = Sections(2e-3 * one, 1e-6 * one, 2e-6 * one, 0.1 * one, 0.2 * one, one * is_round > 0)
    force, moment = np.array([[[2000.0, 0.0, 0.0]]]), np.array([[[0.0, -300.0, 400.0]]])
    got = section.extreme_stress(force, moment)[0, 0]
    assert got / 1e6 == pytest.approx([1.0 + bent, 1.0 - bent], rel=ROUNDED)
    at_corner = section.stress(force, moment, -0.1, -0.2)[0, 0]
    assert at_corner / 1e6 == pytest.approx(1.0 + 30.0 + 40.0, rel=ROUNDED)


@pytest.mark.parametrize(("height", "radius"), [(0.6, 0.4), (0.3, 0.5), (1.0, 0.25)])
def test_inertia_of_a_locked_liquid_is_that_of_potential_flow(height, radius):
    # N. E. Joukowsky: phi = x z + psi about the centre; psi vanishes in slope at the ends and
    # undoes twice the wall's motion, x = sum a sin(k x), k = (2 n + 1) pi / h
    sign = (-1.0) ** np.arange(400)
    k = (2.0 * np.arange(400) + 1.0) * np.pi / height
    a = 4.0 * sign / (height * k**2)
    slope = ivp(1, np.minimum(k * radius, 700.0))
    one, two = (iv(n, np.minimum(k * radius, 700.0)) / slope for n in (1, 2))
    wall = np.pi * radius * (-radius * height**3 / 12.0 + 4.0 * np.sum(a * one * sign / k**3))
    half = height * radius**4 / 8.0 - 2.0 * radius**2 * np.sum(a * sign * two / k**2)
    wanted = 900.0 * (wall + 2.0 * np.pi * half)
    tank = Slosh(
        shape="cylinder", radius=radius, height=height, density=900.0, acceleration=1.0, ratio=0.01
    )
    assert tank.inertia == pytest.approx(wanted, rel=1e-5)
    mass = 900.0 * np.pi * radius**2 * height
    behind = tank.line().behind(np.array([0.0, height / 2.0]))
    rotary = wanted - mass * height**2 / 12.0
    about_root = wanted + mass * (height / 2.0) ** 2
    assert behind[:, 0, 0] == pytest.approx([mass, mass / 2.0], rel=ROUNDED)
    assert behind[:, 1, 5] == pytest.approx(mass * height * np.array([0.5, 0.375]), rel=ROUNDED)
    outer = mass * height**2 * 7.0 / 24.0 + rotary / 2.0
    assert behind[:, 5, 5] == pytest.approx([about_root, outer], rel=1e-5)
    assert behind[:, 3, 3] == pytest.approx([0.0, 0.0], abs=ROUNDED)
    whole = tank.rigid_mass()
    assert np.diag(whole) == pytest.approx([mass] * 3 + [0.0, about_root, about_root], rel=1e-5)
    assert whole[1, 5] == pytest.approx(mass * height / 2.0, rel=ROUNDED)


def test_what_lies_behind_a_station_of_two_segments():
    # 2 m of 5 x 3 cm, then 1 m of 4 x 2 cm, a lump at the joint between them
    material = Material(youngs_modulus=7e10, density=2700.0)
    inner = Rectangle(width_y=0.05, width_z=0.03)
    outer = Rectangle(width_y=0.04, width_z=0.02)
    beam = Beam(
        segments=[
            Segment(length=2.0, section=inner, material=material),
            Segment(length=1.0, section=outer, material=material),
        ],
        lumps=[Lump(x=2.0, mass=5.0, inertia=(0.1, 0.2, 0.3))],
    )
    m1, m2 = 2700.0 * 0.05 * 0.03, 2700.0 * 0.04 * 0.02
    got = beam.line.behind(np.array([0.5, 2.0, 2.5, 3.0]))
    wanted = [(m1 * 1.5 + m2 + 5.0), m2, m2 / 2.0, 0.0]
    assert got[:, 0, 0] == pytest.approx(wanted, rel=ROUNDED, abs=ROUNDED)
    first = [m1 * (4.0 - 0.25) / 2.0 + m2 * 2.5 + 10.0, m2 * 2.5, m2 * (9.0 - 6.25) / 2.0, 0.0]
    assert got[:, 1, 5] == pytest.approx(first, rel=ROUNDED, abs=ROUNDED)
    polar = [2700.0 * w * h * (w**2 + h**2) / 12.0 for w, h in ((0.05, 0.03), (0.04, 0.02))]
    about_x = [polar[0] * 1.5 + polar[1] + 0.1, polar[1], polar[1] / 2.0, 0.0]
    assert got[:, 3, 3] == pytest.approx(about_x, rel=ROUNDED, abs=ROUNDED)


def test_sections_where_two_segments_meet_are_those_of_the_outer():
    material = Material(youngs_modulus=7e10, density=2700.0)
    beam = Beam(
        segments=[
            Segment(
                length=2.0,
                section=Tube(outer_diameter=0.1, wall=0.01),
                section_end=Tube(outer_diameter=0.06, wall=0.01),
                material=material,
            ),
            Segment(length=1.0, section=Rectangle(width_y=0.04, width_z=0.02), material=material),
        ]
    )
    found = sections_at(beam, np.array([0.0, 1.0, 2.0, 3.0]))
    assert found.is_round.tolist() == [True, True, False, False]
    circles = [np.pi / 4.0 * (d**2 - i**2) for d, i in ((0.1, 0.08), (0.08, 0.06))]
    assert found.area == pytest.approx([*circles, 8e-4, 8e-4], rel=ROUNDED)
    assert found.half_y == pytest.approx([0.05, 0.04, 0.02, 0.02], rel=ROUNDED)
    assert found.half_z == pytest.approx([0.05, 0.04, 0.01, 0.01], rel=ROUNDED)
    about_z = [np.pi / 64.0 * (d**4 - i**4) for d, i in ((0.1, 0.08), (0.08, 0.06))]
    assert found.second_moment_z[:2] == pytest.approx(about_z, rel=ROUNDED)
    assert found.second_moment_z[2] == pytest.approx(0.02 * 0.04**3 / 12.0, rel=ROUNDED)
    assert found.second_moment_y[2] == pytest.approx(0.04 * 0.02**3 / 12.0, rel=ROUNDED)
    # a taper counts from where its own segment begins
    turned = Beam(segments=[beam.segments[1], beam.segments[0]])
    (area,) = sections_at(turned, np.array([2.0])).area
    assert area == pytest.approx(np.pi / 4.0 * (0.08**2 - 0.06**2), rel=ROUNDED)


@pytest.mark.parametrize("is_round", [True, False])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_fibre_under_most_tension_is_where_navier_s_stress_is_largest(is_round, sign):
    section = Sections(
        *(np.array([v]) for v in (2e-3, 3e-6, 2e-6, 0.05, 0.05 if is_round else 0.03)),
        np.array([is_round]),
    )
    moment = np.array([9.0, -40.0, 25.0])
    y, z = section.fibre(0, moment, sign)
    assert section.fibre(0, 1e-3 * moment, sign) == pytest.approx((y, z), rel=ROUNDED)
    assert section.fibre(0, 0.0 * moment, sign) == (0.0, 0.0)
    got = section.per_load(0, y, z) @ np.concatenate([[100.0, 7.0, 8.0], moment])
    if is_round:
        towards = sign * np.array([-25.0, -40.0]) / np.hypot(25.0, 40.0)
        assert np.array([y, z]) == pytest.approx(0.05 * towards, rel=ROUNDED)
    else:
        assert (y, z) == (-sign * 0.05, -sign * 0.03)
    bent = -25.0 * y / 3e-6 + -40.0 * z / 2e-6
    assert got == pytest.approx(100.0 / 2e-3 + bent, rel=ROUNDED)


def test_modes_of_a_tank_are_those_of_potential_flow():
    # H. N. Abramson (ed.), NASA SP-106 (1966): m_n = m 2 tanh(xi h/R) / (xi h/R (xi^2 - 1)),
    # at h - (2 R / xi) tanh(xi h / 2R) above the bottom, w^2 = a xi tanh(xi h/R) / R
    radius, height, density, pull = 0.4, 0.6, 900.0, 2.0
    tank = Slosh(
        shape="cylinder",
        radius=radius,
        height=height,
        density=density,
        acceleration=pull,
        ratio=0.01,
    )
    mass = density * np.pi * radius**2 * height
    xi = jnp_zeros(1, 2)
    deep = xi * height / radius
    part = np.sqrt(mass * 2.0 * np.tanh(deep) / (deep * (xi**2 - 1.0)))
    at = height - 2.0 * radius / xi * np.tanh(deep / 2.0)
    rows = tank.participation()[:4]
    assert rows[0::2, 1] == pytest.approx(part, rel=ROUNDED)
    assert rows[0::2, 5] == pytest.approx(part * at, rel=ROUNDED)
    assert rows[1::2, 2] == pytest.approx(part, rel=ROUNDED)
    assert rows[1::2, 4] == pytest.approx(-part * at, rel=ROUNDED)
    squares = pull * xi * np.tanh(deep) / radius
    assert tank.frequencies()[:2] == pytest.approx(np.sqrt(squares), rel=ROUNDED)
    # a pendulum of the length l swings at w^2 = a / l
    assert tank.pendulums().pivots[:2] == pytest.approx(at + pull / squares, rel=ROUNDED)
    data = tank.data()
    assert data.frequencies[:4] ** 2 == pytest.approx(np.repeat(squares, 2), rel=ROUNDED)
    assert set(data.damping.tolist()) == {0.01}


def data(**more):
    rigid = np.diag([2.0, 2.0, 2.0, 0.5, 0.6, 0.7])
    rows = np.array([[0.0, 0.3, 0.0, 0.0, 0.0, 0.2]])
    return ModalData(rigid_mass=rigid, frequencies=np.array([3.0]), participation=rows, **more)


def test_units_of_lengths_and_masses():
    # millimetres and tonnes; a point is x, mass and three inertias
    points = np.array([[700.0, 0.5, 1.0, 2.0, 3.0]])
    got = data(points=points, length=1000.0).scaled(1e-3, 1e3)
    assert got.points == pytest.approx(np.array([[0.7, 500.0, 1e-3, 2e-3, 3e-3]]), rel=ROUNDED)
    assert got.rigid_mass == pytest.approx(
        np.diag([2e3, 2e3, 2e3, 0.5e-3, 0.6e-3, 0.7e-3]), rel=ROUNDED
    )
    assert got.participation[0, [1, 5]] == pytest.approx(
        np.sqrt(1e3) * np.array([0.3, 0.2e-3]), rel=ROUNDED
    )
    assert got.length == pytest.approx(1.0)


def test_half_a_last_digit_in_a_residual_mass():
    # d(M - L^T L) = dM + |L| dL + dL |L|; three digits: half of 0.01 for 2.5, of 0.1 for 30
    got = rounding_of_residual(np.array([[30.0, 0.0], [0.0, 2.5]]), np.array([[2.5, 0.0]]), 5e-3)
    assert got == pytest.approx(np.array([[0.05 + 2 * 2.5 * 5e-3, 0.0], [0.0, 5e-3]]), rel=ROUNDED)
    # of 0.02 and 0.5
    got = rounding_of_residual(np.array([[0.02]]), np.array([[0.5]]), 5e-3)
    assert got == pytest.approx(np.array([[5e-5 + 2 * 0.5 * 5e-4]]), rel=ROUNDED)


@pytest.mark.parametrize("around", [0.3, 2.0])
def test_directions_of_spherical_coordinates(around):
    point = np.array([np.sin(0.7) * np.cos(around), np.sin(0.7) * np.sin(around), np.cos(0.7)])
    outwards, down, tangent = System("S", np.zeros(3), np.eye(3)).axes_at(2.0 * point)
    assert outwards == pytest.approx(point, rel=ROUNDED)
    assert down[2] == pytest.approx(-np.sin(0.7), rel=ROUNDED)
    assert np.cross(outwards, down) == pytest.approx(tangent, abs=ROUNDED)


def test_nearest_body_has_one_mass_and_an_antisymmetric_first_moment():
    mass = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    mass[3, 1] = mass[1, 3] = 0.4
    mass[4, 0] = mass[0, 4] = 0.2
    got = nearest_body(mass)
    assert np.diag(got) == pytest.approx([2.0, 2.0, 2.0, 4.0, 5.0, 6.0])
    assert got[3, 1] == pytest.approx(0.1)
    assert got[4, 0] == pytest.approx(-0.1)


def test_parts_below_the_noise_are_uncoupled():
    mass = np.eye(8)
    mass[1, 5] = mass[5, 1] = 0.5  # of one port, xy
    mass[1, 6] = mass[6, 1] = 0.2
    mass[0, 7] = mass[7, 0] = 1e-6  # below the noise
    got = independent_parts(mass, np.eye(2), np.full(8, 1e-2))
    wanted = mass.copy()
    wanted[0, 7] = wanted[7, 0] = 0.0
    assert got == pytest.approx(wanted)


def test_frequencies_of_other_number_have_not_settled():
    two = np.array([2.0, 4.0])
    assert change_of_frequencies((two, two), (two * 1.01, two)) == pytest.approx(0.01, rel=1e-9)
    assert change_of_frequencies((two, two), (two, two[:1])) == np.inf


def test_a_rod_s_rounded_inertia_becomes_that_of_masses():
    """Principal moments are sums of two second moments, none of which is below zero."""
    axes = np.linalg.qr(np.array([[1.0, 2.0, 0.5], [0.3, 1.0, -1.0], [2.0, 0.1, 1.0]]))[0]
    for moments, wanted in (
        ((0.0, 2.0, 2.1), (0.05, 2.025, 2.075)),  # second moments 2.05, 0.05 and 0
        ((1.0, 2.0, 2.9), (1.0, 2.0, 2.9)),
    ):
        x, y, z = 0.4, -0.3, 0.7
        arm = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        own = axes @ np.diag(moments) @ axes.T
        body = 3.0 * np.block([[np.eye(3), -arm], [arm, own / 3.0 - arm @ arm]])
        found = np.linalg.eigvalsh(realisable_body(body)[3:, 3:] + 3.0 * arm @ arm)
        assert 2.0 * found[2] <= np.sum(found) * (1.0 + 1e-12)
        if moments == wanted:
            assert found == pytest.approx(wanted)
        else:  # the nearest: what is missing, 0.1, is spread as (1, 1, -1) / 3 of it
            assert found == pytest.approx(np.array(moments) + np.array([1, 1, -1]) * 0.1 / 3.0)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e9])
def test_freedoms_that_a_spring_joins_are_one_part_in_every_unit(size):
    """A mass below the noise stays within a part; 1e-14 of its springs is no spring."""
    mass = np.eye(8)
    mass[6, 7] = mass[7, 6] = 1e-6
    for part, kept in ((0.5, True), (1.5e-14, True), (0.5e-14, False)):
        stiffness = size * np.array([[1.0, part], [part, 1.0]])
        found = independent_parts(mass, stiffness, np.full(8, 1e-2))
        assert found[6, 7] == (1e-6 if kept else 0.0)


@pytest.mark.parametrize("share", [0.8, 1.2])
def test_one_mode_takes_a_body_s_mass_but_for_the_room(share):
    rigid = np.diag([2.0, 2.0, 2.0, 0.5, 0.6, 0.7])
    row = np.array([[0.0, share * np.sqrt(2.0), 0.0, 0.0, 0.0, 0.0]])
    found = within_body(row, rigid, 0.19)
    assert found[0] == pytest.approx(min(share, 0.9) / share * row[0], rel=ROUNDED, abs=1e-15)
