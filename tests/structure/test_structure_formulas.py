"""Closed forms beside the formulas of structures."""

import numpy as np
import pytest
from scipy.special import jnp_zeros

from beamchain import Material, ModalData, Rectangle, Round
from formulas import (
    Sections,
    Slosh,
    System,
    change_of_frequencies,
    independent_parts,
    nearest_body,
    rounding_of_residual,
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
    assert tank.frequencies()[:2] == pytest.approx(
        np.sqrt(pull * xi * np.tanh(deep) / radius), rel=ROUNDED
    )


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
