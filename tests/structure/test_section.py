"""Sections have the area, moments, torsion constant and shear factor that closed forms and
printed tables give."""

import numpy as np
import pytest

from appendages import close
from beamchain import Beam, Box, Custom, Equivalent, Rectangle, Round, Segment, Tube
from beamchain.spec import Draw

CLOSED = 1e-14  # the same closed form in another order of operations: a few roundings
SERIES = 1e-12  # a series summed to its end against the same constant by another series
TABLE = 5e-4  # Timoshenko and Goodier, art. 109, print three or four decimals

HERE = np.array([0.0])


def properties(section):
    """Section properties at one station as plain numbers."""
    return [float(v[0]) for v in section.geometry(section, HERE)]


def test_round_is_the_solid_circle():
    d = 0.012
    area, iz, iy, j, polar = properties(Round(diameter=d))
    r = d / 2
    assert area == close(np.pi * r**2, rel=CLOSED)
    assert (iz, iy) == close((np.pi * r**4 / 4,) * 2, rel=CLOSED)
    assert (j, polar) == close((np.pi * r**4 / 2,) * 2, rel=CLOSED)


def test_tube_is_the_outer_circle_less_the_inner():
    d, t = 0.1, 0.015
    outer = properties(Round(diameter=d))
    inner = properties(Round(diameter=d - 2 * t))
    assert properties(Tube(outer_diameter=d, wall=t)) == close(
        np.subtract(outer, inner).tolist(), rel=CLOSED
    )


def test_tube_whose_wall_closes_it_is_round():
    assert properties(Tube(outer_diameter=0.1, wall=0.05)) == close(
        properties(Round(diameter=0.1)), rel=CLOSED
    )


@pytest.mark.parametrize("wall", [1e-3, 1e-6, 1e-9, 1e-12])
def test_thin_tube_loses_no_digits(wall):
    # about the mean radius r: area 2 pi r t, I = pi r t (r^2 + t^2 / 4), exact for any t
    r = (1.0 - wall) / 2
    area, iz, _, j, _ = properties(Tube(outer_diameter=1.0, wall=wall))
    assert area == close(2 * np.pi * r * wall, rel=CLOSED)
    assert iz == close(np.pi * r * wall * (r**2 + wall**2 / 4), rel=CLOSED)
    assert j == close(2 * iz, rel=CLOSED)


def test_rectangle_bends_in_xy_about_z():
    by, bz = 0.03, 0.05
    area, iz, iy, _, polar = properties(Rectangle(width_y=by, width_z=bz))
    assert area == close(by * bz, rel=CLOSED)
    assert iz == close(bz * by**3 / 12, rel=CLOSED)
    assert iy == close(by * bz**3 / 12, rel=CLOSED)
    assert polar == close(by * bz * (by**2 + bz**2) / 12, rel=CLOSED)


@pytest.mark.parametrize(
    ("ratio", "printed"),
    [
        (1.0, 0.1406),
        (1.2, 0.166),
        (1.5, 0.196),
        (2.0, 0.229),
        (3.0, 0.263),
        (5.0, 0.291),
        (10.0, 0.312),
    ],
)
def test_rectangle_torsion_is_the_printed_table(ratio, printed):
    a = 0.04  # the short side; J = k1 b a^3
    j = properties(Rectangle(width_y=a, width_z=ratio * a))[3]
    assert j / (ratio * a * a**3) == close(printed, abs=TABLE)


@pytest.mark.parametrize("ratio", [1.0, 1.3, 2.0, 4.0, 50.0])
def test_rectangle_torsion_is_the_whole_series(ratio):
    # J = b h^3 / 3 (1 - 192 / pi^5 (h / b) sum tanh(n pi b / 2h) / n^5); beyond n = 999 every tanh
    # is 1, and sum over all odd n of n^-5 = 31/32 zeta(5)
    zeta5 = 1.03692775514336992633
    n = np.arange(1, 1000, 2, dtype=np.float64)
    total = 31 / 32 * zeta5 - float(np.sum((1.0 - np.tanh(n * np.pi * ratio / 2)) / n**5))
    expected = ratio / 3 * (1 - 192 / np.pi**5 / ratio * total)
    assert properties(Rectangle(width_y=ratio, width_z=1.0))[3] == close(expected, rel=SERIES)
    assert properties(Rectangle(width_y=1.0, width_z=ratio))[3] == close(expected, rel=SERIES)


def test_thin_strip_twists_as_b_t3_over_3():
    b, t = 1.0, 1e-6
    assert properties(Rectangle(width_y=t, width_z=b))[3] == close(b * t**3 / 3, rel=t / b)


def test_box_is_the_outer_rectangle_less_the_inner():
    by, bz, t = 0.08, 0.05, 0.004
    outer = properties(Rectangle(width_y=by, width_z=bz))
    inner = properties(Rectangle(width_y=by - 2 * t, width_z=bz - 2 * t))
    area, iz, iy, j, polar = properties(Box(width_y=by, width_z=bz, wall=t))
    assert (area, iz, iy) == close(
        (outer[0] - inner[0], outer[1] - inner[1], outer[2] - inner[2]), rel=CLOSED
    )
    assert polar == close(iz + iy, rel=CLOSED)
    # Bredt: J = 4 A_m^2 / (perimeter / t) about the wall's middle line
    am = (by - t) * (bz - t)
    perimeter = 2 * (by - t + bz - t)
    assert j == close(4 * am**2 * t / perimeter, rel=CLOSED)


def test_dimensions_taper_linearly():
    fraction = np.array([0.0, 0.25, 1.0])
    geometry = Round(diameter=0.04).geometry(Round(diameter=0.02), fraction)
    assert geometry.area == close(np.pi / 4 * np.array([0.04, 0.035, 0.02]) ** 2, rel=CLOSED)
    tube = Tube(outer_diameter=0.1, wall=0.01).geometry(
        Tube(outer_diameter=0.05, wall=0.002), np.array([0.5])
    )
    assert tube.area[0] == close(np.pi * 0.006 * (0.075 - 0.006), rel=CLOSED)


def test_ratio_is_the_strongest_taper():
    assert Rectangle(width_y=0.1, width_z=0.2).ratio(Rectangle(width_y=0.05, width_z=0.6)) == close(
        3.0, rel=CLOSED
    )
    assert Round(diameter=0.1).ratio(Round(diameter=0.1)) == 1.0


def test_custom_passes_its_numbers_on():
    section = Custom(area=1e-3, second_moment_z=2e-6, second_moment_y=3e-6, torsion_constant=4e-7)
    assert properties(section) == close([1e-3, 2e-6, 3e-6, 4e-7, 5e-6], rel=CLOSED)


def test_custom_polar_moment_left_out_at_one_end_is_the_sum_there():
    numbers = {"area": 1.0, "second_moment_z": 2.0, "second_moment_y": 3.0, "torsion_constant": 1.0}
    polar = (
        Custom(**numbers)
        .geometry(Custom(**numbers, polar_moment=5.0), np.array([0.0, 0.3, 1.0]))
        .polar_moment
    )
    assert polar == close([5.0, 5.0, 5.0], rel=CLOSED)


# -- Cowper's shear factors (J. Appl. Mech. 33, 1966, 335) -----------------------------------------
def test_cowper_has_the_printed_values_at_nu_0_3():
    assert Round(diameter=1.0).cowper(0.3, "xy") == close(0.886, abs=TABLE)
    assert Rectangle(width_y=1.0, width_z=2.0).cowper(0.3, "xz") == close(0.850, abs=TABLE)
    assert Tube(outer_diameter=1.0, wall=1e-9).cowper(0.3, "xy") == close(0.531, abs=TABLE)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.5])
def test_cowper_of_a_closed_tube_is_the_circles(nu):
    assert Tube(outer_diameter=1.0, wall=0.5).cowper(nu, "xy") == close(
        Round(diameter=1.0).cowper(nu, "xy"), rel=CLOSED
    )
    # thin round tube: 2 (1 + nu) / (4 + 3 nu)
    assert Tube(outer_diameter=1.0, wall=1e-9).cowper(nu, "xy") == close(
        2 * (1 + nu) / (4 + 3 * nu), rel=1e-8
    )


@pytest.mark.parametrize("plane", ["xy", "xz"])
@pytest.mark.parametrize(("width_y", "width_z"), [(1.0, 1.0), (1.0, 3.0), (2.0, 0.7)])
def test_cowper_of_a_thin_box_without_lateral_contraction_is_the_shear_flow_s_energy(
    width_y, width_z, plane
):
    # nu = 0: k = I^2 / (A integral of Q^2 / t), Q the first moment of the area beyond
    h, b = (width_y, width_z) if plane == "xy" else (width_z, width_y)  # h along the shear force
    t = 1.0
    second = t * h**3 / 6 + b * t * h**2 / 2
    area = 2 * t * (b + h)
    flanges = 4 * (t * h / 2) ** 2 * (b / 2) ** 3 / 3 / t
    # web: Q = t h b / 4 + t (h^2 / 4 - y^2) / 2 = p - q y^2
    p = t * h * b / 4 + t * h**2 / 8
    q = t / 2
    e = h / 2
    webs = 2 * 2 * (p**2 * e - 2 * p * q * e**3 / 3 + q**2 * e**5 / 5) / t
    expected = second**2 / (area * (flanges + webs))
    assert Box(width_y=width_y, width_z=width_z, wall=1e-9).cowper(0.0, plane) == close(
        expected, rel=1e-8
    )


def test_depth_is_the_extent_in_the_plane():
    assert Round(diameter=0.3).depth("xy") == Tube(outer_diameter=0.3, wall=0.1).depth("xz") == 0.3
    for section in (Rectangle(width_y=0.1, width_z=0.2), Box(width_y=0.1, width_z=0.2, wall=0.01)):
        assert (section.depth("xy"), section.depth("xz")) == (0.1, 0.2)
    assert Equivalent(bending_stiffness_xy=1.0, linear_mass=1.0).depth("xy") == 0.0


# -- what is drawn ---------------------------------------------------------------------------------
def test_the_width_drawn_lies_across_the_softer_plane():
    draw = Draw(width=1.2, thickness=0.03)
    soft_in_xy = Equivalent(
        bending_stiffness_xy=1.0, bending_stiffness_xz=2.0, linear_mass=1.0, draw=draw
    )
    soft_in_xz = Equivalent(
        bending_stiffness_xy=2.0, bending_stiffness_xz=1.0, linear_mass=1.0, draw=draw
    )
    even = Equivalent(bending_stiffness_xy=2.0, linear_mass=1.0, draw=draw)
    assert [soft_in_xy.depth(plane) for plane in ("xy", "xz")] == [0.03, 1.2]
    assert [soft_in_xz.depth(plane) for plane in ("xy", "xz")] == [1.2, 0.03]
    assert [even.depth(plane) for plane in ("xy", "xz")] == [0.03, 1.2]


def test_what_is_drawn_is_no_dimension_of_a_taper():
    thick, thin = (
        Equivalent(bending_stiffness_xy=2.0, linear_mass=1.0, draw=Draw(width=w, thickness=w))
        for w in (1.0, 0.1)
    )
    assert thick.ratio(thin) == 1.0
    segment = Segment(length=2.0, section=thick, section_end=thin)
    assert segment.taper == 1.0
    assert Beam(segments=(segment,)).depth(1.0, "xy") == pytest.approx(0.55)
    bare = Segment(
        length=2.0, section=thick, section_end=Equivalent(bending_stiffness_xy=2.0, linear_mass=1.0)
    )
    assert Beam(segments=(bare,)).depth(1.0, "xy") == pytest.approx(1.0)
