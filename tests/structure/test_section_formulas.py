"""Closed forms beside the formulas of sections and materials."""

import numpy as np
import pytest

from beamchain import Box, Custom, Equivalent, InputError, Material, Rectangle, Round, Tube
from beamchain.spec import Draw
from formulas import soft_modulus

ROUNDED = 1e-13
PART = np.array([0.0, 0.4, 1.0])  # of a taper


def test_moduli_and_the_ratio_that_joins_them():
    # G = E / (2 (1 + nu))
    plain, modulus = {"youngs_modulus": 7e10, "density": 2700.0}, 7e10 / 2.5
    assert Material(**plain).g == pytest.approx(7e10 / 2.6, rel=ROUNDED)
    assert Material(**plain, poissons_ratio=0.25).g == pytest.approx(modulus, rel=ROUNDED)
    assert Material(**plain, shear_modulus=3e10).g == 3e10
    for off, taken in ((0.9e-6, True), (1.1e-6, False), (-0.9e-6, True), (-1.1e-6, False)):
        both = {"poissons_ratio": 0.25, "shear_modulus": modulus * (1.0 + off)}
        if taken:
            assert Material(**plain, **both).nu == 0.25
        else:
            with pytest.raises(InputError, match="disagree"):
                Material(**plain, **both)


@pytest.mark.parametrize(
    ("modulus", "meant"),
    [(70.0, "GPa were meant, write 7e+10"), (999.0, "GPa"), (1e3, "MPa"), (7e4, "write 7e+10")],
)
def test_unit_of_a_modulus_that_is_too_soft(modulus, meant):
    assert meant in soft_modulus(modulus)


@pytest.mark.parametrize(
    ("section", "end", "half_y", "half_z"),
    [
        (Round(diameter=0.2), Round(diameter=0.1), (0.1, 0.08, 0.05), None),
        (
            Tube(outer_diameter=0.2, wall=0.01),
            Tube(outer_diameter=0.1, wall=0.02),
            (0.1, 0.08, 0.05),
            None,
        ),
        (
            Rectangle(width_y=0.2, width_z=0.4),
            Rectangle(width_y=0.1, width_z=0.9),
            (0.1, 0.08, 0.05),
            (0.2, 0.3, 0.45),
        ),
        (
            Box(width_y=0.2, width_z=0.4, wall=0.01),
            Box(width_y=0.1, width_z=0.9, wall=0.01),
            (0.1, 0.08, 0.05),
            (0.2, 0.3, 0.45),
        ),
    ],
)
def test_half_widths_of_a_taper(section, end, half_y, half_z):
    found = section.half_widths(end, PART)
    assert found.half_y == pytest.approx(half_y, rel=ROUNDED)
    assert found.half_z == pytest.approx(half_z or half_y, rel=ROUNDED)
    assert found.is_round == (half_z is None)


def test_outline_of_custom_numbers_is_not_known():
    numbers = {"area": 1.0, "second_moment_z": 2.0, "second_moment_y": 3.0, "torsion_constant": 4.0}
    section, end = Custom(**numbers), Custom(**{name: 2.0 * v for name, v in numbers.items()})
    found = section.half_widths(end, PART)
    assert np.isnan([found.half_y, found.half_z]).all()
    assert not found.is_round
    assert section.depth("xy") == 0.0
    assert section.cowper(0.3, "xy", end, PART) == 1.0
    geometry = np.array(section.geometry(end, PART))
    assert geometry == pytest.approx(np.outer([1, 2, 3, 4, 5], [1.0, 1.4, 2.0]), rel=ROUNDED)


@pytest.mark.parametrize("nu", [0.0, 0.25, 0.5])
def test_cowper_s_factor_of_a_tapered_tube(nu):
    # m: inner over outer diameter, 0.5 in the middle
    found = Tube(outer_diameter=0.5, wall=0.05).cowper(
        nu, "xz", Tube(outer_diameter=0.3, wall=0.15), np.array([0.0, 0.5, 1.0])
    )
    m2 = np.array([0.64, 0.25, 0.0])
    wanted = [
        6.0 * (1.0 + nu) / (7.0 + 6.0 * nu + (20.0 + 12.0 * nu) * m2 / (1.0 + m2) ** 2) for m2 in m2
    ]
    assert found == pytest.approx(wanted, rel=ROUNDED)


@pytest.mark.parametrize("nu", [0.0, 0.25, 0.5])
def test_cowper_s_factor_of_a_tapered_box(nu):
    # his thin box of one wall: m = n = b / h, h along the force; numbers for n = 2 and 1 / 2
    wide = 490.0 * (1.0 + nu) / (2196.0 + 1483.0 * nu)
    deep = 62.5 * (1.0 + nu) / (102.375 + 90.25 * nu)
    section = Box(width_y=0.2, width_z=0.1, wall=0.001)
    end = Box(width_y=0.1, width_z=0.2, wall=0.001)
    ends = np.array([0.0, 1.0])
    assert section.cowper(nu, "xz", end, ends) == pytest.approx([wide, deep], rel=ROUNDED)
    assert section.cowper(nu, "xy", end, ends) == pytest.approx([deep, wide], rel=ROUNDED)
    assert section.cowper(nu, "xz") == pytest.approx(wide, rel=ROUNDED)


@pytest.mark.parametrize(("width_y", "width_z"), [(0.3, 0.2), (0.2, 0.3)])
def test_torsion_constant_of_a_rectangle_in_a_taper(width_y, width_z):
    # S. Timoshenko, J. N. Goodier, art. 109: J = 0.196 b a^3 for b / a = 1.5
    section = Rectangle(width_y=width_y, width_z=width_z)
    end = Rectangle(width_y=2.0 * width_y, width_z=2.0 * width_z)
    found = section.geometry(end, PART).torsion_constant
    sizes = 0.3 * 0.2**3 * np.array([1.0, 1.4, 2.0]) ** 4
    assert found / sizes == pytest.approx([0.1958] * 3, abs=5e-5)


def test_ratio_of_two_ends_leaves_out_what_is_zero():
    here = Equivalent(bending_stiffness_xy=8.0, linear_mass=0.02, torsion_stiffness=3.0)
    there = Equivalent(bending_stiffness_xy=4.0, linear_mass=0.02)
    assert here.ratio(there) == there.ratio(here) == 2.0
    assert here.pairs(there) == [(8.0, 4.0), (0.02, 0.02), (8.0, 4.0)]  # xz is as xy


def test_walls_as_thick_as_they_may_be():
    assert Tube(outer_diameter=0.1, wall=0.05 * (1.0 + 0.9e-12)).wall > 0.05
    assert Box(width_y=0.1, width_z=0.3, wall=0.0499).wall == 0.0499
    for make in (
        lambda: Tube(outer_diameter=0.1, wall=0.05 * (1.0 + 1.1e-12)),
        lambda: Box(width_y=0.3, width_z=0.1, wall=0.05),
    ):
        with pytest.raises(InputError, match="make the wall thinner"):
            make()


@pytest.mark.parametrize(
    ("polar", "taken"), [(4.74, False), (4.76, True), (5.24, True), (5.26, False)]
)
def test_polar_moment_within_five_per_cent_of_the_sum(polar, taken):
    numbers = {"area": 1.0, "second_moment_z": 2.0, "second_moment_y": 3.0, "torsion_constant": 4.0}
    if taken:
        section = Custom(**numbers, polar_moment=polar)
        assert section.geometry(section, PART).polar_moment == pytest.approx([polar] * 3)
    else:
        with pytest.raises(InputError, match="axes must be principal"):
            Custom(**numbers, polar_moment=polar)


def test_a_panel_is_thinner_than_a_quarter_of_its_width():
    assert [Draw(width=2.0, thickness=t).panel for t in (0.49, 0.5, 2.0)] == [True, False, False]
