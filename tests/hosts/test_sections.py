"""Profiles through sectionproperties against closed forms: thin-walled theory, sums over rectangles
and circles."""

import sys

import mujoco
import numpy as np
import pytest

import beamchain as bc

pytestmark = pytest.mark.host
analysis = pytest.importorskip(
    "sectionproperties.analysis",
    reason="the extra sections is not installed: pip install 'beamchain[sections]'",
)
pre = pytest.importorskip("sectionproperties.pre")
library = pytest.importorskip("sectionproperties.pre.library")
shapely = pytest.importorskip("shapely")

EXACT = 1e-9  # relative: polynomials over straight-edged elements
THIN = 0.02  # relative: thin-walled theory at walls of a hundredth of the width
CIRCLE = 2e-3  # relative: circles of 128 corners
TORSION = 5e-3  # relative: quadratic elements

ALUMINIUM = bc.Material(youngs_modulus=7e10, density=2700.0, poissons_ratio=0.33)
E, RHO, G = 7e10, 2700.0, 7e10 / 2.66


def shape(outline, holes=(), material=None):
    """A geometry by its corners."""
    given = {} if material is None else {"material": material}
    return pre.Geometry(shapely.Polygon(outline, holes), **given)


def meshed(geometry, size):
    geometry.create_mesh(mesh_sizes=size)
    return analysis.Section(geometry)


def distance(error):
    return float(str(error.value).split(" lies ")[1].split(" m ")[0])


def rectangle(y0, y1, z0, z1):
    return ((y0, z0), (y1, z0), (y1, z1), (y0, z1))


def test_a_channel_is_refused_with_the_distance_of_its_shear_centre():
    """Behind the web's middle line at 3 b^2 / (6 b + h), the centroid before it at b^2 / (2 b + h);
    b and h of the middle lines."""
    section = meshed(library.channel_section(d=0.1, b=0.05, t_f=0.001, t_w=0.001, r=0, n_r=1), 1e-6)
    with pytest.raises(bc.InputError, match=r"shear centre .* bending and torsion") as error:
        bc.spec.section_from(section, material=ALUMINIUM)
    b, h = 0.05 - 0.0005, 0.1 - 0.001
    expected = 3.0 * b**2 / (6.0 * b + h) + b**2 / (2.0 * b + h)
    assert distance(error) == pytest.approx(expected, rel=THIN)
    sys.stdout.write(f"channel: {distance(error):.6f} m, thin-walled {expected:.6f} m\n")


def test_an_angle_is_refused_with_the_distance_to_its_corner():
    section = meshed(library.angle_section(d=0.05, b=0.05, t=0.001, r_r=0, r_t=0, n_r=1), 1e-6)
    with pytest.raises(bc.InputError, match="shear centre") as error:
        bc.spec.section_from(section, material=ALUMINIUM)
    leg = 0.05 - 0.0005  # the centroid of two legs is a quarter of a leg from each
    assert distance(error) == pytest.approx(leg / 4.0 * np.sqrt(2.0), rel=THIN)


@pytest.mark.parametrize("cells", [1, 2])
def test_boxes_follow_bredt(cells):
    """J = 4 A^2 t / U; by symmetry a web in the middle carries no shear flow."""
    t, width, height = 0.001, 0.1, 0.06
    outline = rectangle(-width / 2, width / 2, -height / 2, height / 2)
    low, high = -height / 2 + t, height / 2 - t
    if cells == 1:
        holes = (rectangle(-width / 2 + t, width / 2 - t, low, high),)
    else:
        holes = (
            rectangle(-width / 2 + t, -t / 2, low, high),
            rectangle(t / 2, width / 2 - t, low, high),
        )
    section = bc.spec.section_from(meshed(shape(outline, holes), 5e-7), material=ALUMINIUM)
    area, around = (width - t) * (height - t), 2.0 * (width + height - 2.0 * t)
    assert section.torsion_stiffness == pytest.approx(G * 4.0 * area**2 * t / around, rel=THIN)
    web = (cells - 1) * t * (height - 2 * t)
    solid = width * height - (width - 2 * t) * (height - 2 * t) + web
    assert section.axial_stiffness == pytest.approx(E * solid, rel=EXACT)
    iz = (height * width**3 - (height - 2 * t) * (width - 2 * t) ** 3) / 12.0
    assert section.bending_stiffness_xy == pytest.approx(E * (iz + web * t**2 / 12.0), rel=EXACT)


def test_a_box_agrees_with_the_shape_that_needs_no_extra():
    box = bc.Box(width_y=0.05, width_z=0.1, wall=0.001)
    section = meshed(
        library.rectangular_hollow_section(d=0.1, b=0.05, t=0.001, r_out=0, n_r=1), 5e-7
    )
    found = bc.spec.section_from(section, material=ALUMINIUM)
    wanted = box.geometry(box, np.zeros(1))
    assert found.bending_stiffness_xy == pytest.approx(E * wanted.second_moment_z[0], rel=EXACT)
    assert found.bending_stiffness_xz == pytest.approx(E * wanted.second_moment_y[0], rel=EXACT)
    assert found.axial_stiffness == pytest.approx(E * wanted.area[0], rel=EXACT)
    assert found.linear_mass == pytest.approx(RHO * wanted.area[0], rel=EXACT)
    assert found.polar_inertia == pytest.approx(RHO * wanted.polar_moment[0], rel=EXACT)
    assert found.torsion_stiffness == pytest.approx(G * wanted.torsion_constant[0], rel=THIN)


def test_an_open_profile():
    """An I: EI of three rectangles, GJ = G sum b t^3 / 3."""
    d, b, t = 0.1, 0.05, 0.001
    section = meshed(library.i_section(d=d, b=b, t_f=t, t_w=t, r=0, n_r=1), 1e-6)
    found = bc.spec.section_from(section, material=ALUMINIUM)
    xz = (b * d**3 - (b - t) * (d - 2 * t) ** 3) / 12.0
    xy = (2.0 * t * b**3 + (d - 2 * t) * t**3) / 12.0
    assert found.bending_stiffness_xz == pytest.approx(E * xz, rel=EXACT)
    assert found.bending_stiffness_xy == pytest.approx(E * xy, rel=EXACT)
    j = (2.0 * b + d - t) * t**3 / 3.0
    assert found.torsion_stiffness == pytest.approx(G * j, rel=THIN)
    # what restrained warping would add: E Gamma, Gamma = I_flanges h^2 / 2, is left out
    gamma = t * b**3 / 12.0 * (d - t) ** 2 / 2.0
    for length in (1.0, 3.0, 10.0):
        k = length * np.sqrt(G * j / (E * gamma))
        stiffer = 1.0 / (1.0 - np.tanh(k) / k) - 1.0
        sys.stdout.write(f"I profile of {length:g} m: {100.0 * stiffer:.0f} % stiffer in torsion\n")


def test_concentric_tubes_of_two_materials():
    """EI, GJ and masses add up; the shear moduli are not proportional to Young's moduli."""
    steel = pre.Material("steel", 2e11, 0.3, 1.0, 7800.0, "grey")
    resin = pre.Material("resin", 1e10, 0.05, 1.0, 1300.0, "red")
    core = library.circular_section_by_area(area=np.pi * 0.02**2, n=128, material=resin)
    sleeve = library.circular_section_by_area(area=np.pi * 0.025**2, n=128, material=steel) - core
    found = bc.spec.section_from(meshed(sleeve + core, 2e-6))
    inner, outer = np.pi * 0.02**4 / 4.0, np.pi * (0.025**4 - 0.02**4) / 4.0
    shear = {"steel": 2e11 / 2.6, "resin": 1e10 / 2.1}
    assert found.bending_stiffness_xy == pytest.approx(2e11 * outer + 1e10 * inner, rel=CIRCLE)
    assert found.bending_stiffness_xz == pytest.approx(found.bending_stiffness_xy, rel=CIRCLE)
    twist = 2.0 * (shear["steel"] * outer + shear["resin"] * inner)
    assert found.torsion_stiffness == pytest.approx(twist, rel=TORSION)
    assert found.polar_inertia == pytest.approx(2.0 * (7800.0 * outer + 1300.0 * inner), rel=CIRCLE)
    areas = np.pi * (0.025**2 - 0.02**2), np.pi * 0.02**2
    assert found.linear_mass == pytest.approx(7800.0 * areas[0] + 1300.0 * areas[1], rel=CIRCLE)
    assert found.axial_stiffness == pytest.approx(2e11 * areas[0] + 1e10 * areas[1], rel=CIRCLE)


def sandwich(*strips):
    """A plate of aluminium with carbon strips, `(z0, z1)` each."""
    plate = pre.Material("plate", 7e10, 0.33, 1.0, 2700.0, "grey")
    carbon = pre.Material("carbon", 1.2e11, 0.2, 1.0, 1600.0, "black")
    parts = [shape(rectangle(-0.05, 0.05, -0.002, 0.002), material=plate)]
    parts += [shape(rectangle(-0.03, 0.03, *z), material=carbon) for z in strips]
    return meshed(pre.CompoundGeometry(parts), 2e-6)


def test_a_sandwich_is_fitted():
    """Strips on a plate: EI by hand, and the frequencies of MuJoCo's file from it."""
    section = bc.spec.section_from(sandwich((0.002, 0.003), (-0.003, -0.002)))
    strips = 2.0 * 0.06 * (0.003**3 - 0.002**3) / 3.0
    xz = 7e10 * 0.1 * 0.004**3 / 12.0 + 1.2e11 * strips
    xy = 7e10 * 0.004 * 0.1**3 / 12.0 + 1.2e11 * 2.0 * 0.001 * 0.06**3 / 12.0
    mass = 2700.0 * 0.1 * 0.004 + 1600.0 * 2.0 * 0.06 * 0.001
    assert section.bending_stiffness_xz == pytest.approx(xz, rel=EXACT)
    assert section.bending_stiffness_xy == pytest.approx(xy, rel=EXACT)
    assert section.linear_mass == pytest.approx(mass, rel=EXACT)
    made = bc.fit(
        bc.Spec(
            segment=(bc.Segment(length=3.0, section=section),),
            modes=bc.Modes(xz=2, xy=1, torsion=1),
        )
    )
    mujoco.MjModel.from_xml_string(made.scene_mjcf())
    first = 1.875104068711961**2 / 9.0 * np.sqrt(np.array([xz, xy]) / mass)
    assert made.achieved["xz"].frequencies[0] == pytest.approx(first[0], rel=1e-6)
    assert made.achieved["xy"].frequencies[0] == pytest.approx(first[1], rel=1e-6)


Z = ((-0.001, -0.025), (0.04, -0.025), (0.04, -0.023), (0.001, -0.023))
Z += tuple((-y, -z) for y, z in Z)


def test_a_z_profile_is_turned_as_the_message_says():
    """tan 2a = -2 I_yz / (I_yy - I_zz), by three rectangles."""
    geometry = shape(Z)
    with pytest.raises(bc.InputError, match="principal axes") as error:
        bc.spec.section_from(meshed(geometry, 1e-6), material=ALUMINIUM)
    pieces = [(-0.001, 0.001, -0.023, 0.023), (-0.001, 0.04, -0.025, -0.023)]
    pieces.append((-0.04, 0.001, 0.023, 0.025))
    moments = np.zeros(3)
    for y0, y1, z0, z1 in pieces:
        moments += [
            (y1 - y0) * (z1**3 - z0**3) / 3.0,
            (z1 - z0) * (y1**3 - y0**3) / 3.0,
            (y1**2 - y0**2) * (z1**2 - z0**2) / 4.0,
        ]
    yy, zz, yz = moments
    angle = float(str(error.value).split("turned by ")[1].split(" degrees")[0])
    assert np.tan(np.radians(2.0 * angle)) == pytest.approx(-2.0 * yz / (yy - zz), rel=1e-5)
    turn = float(str(error.value).split("rotate_section(")[1].split(")")[0])
    turned = bc.spec.section_from(meshed(geometry.rotate_section(turn), 1e-6), material=ALUMINIUM)
    mean, half = (yy + zz) / 2.0, np.hypot((yy - zz) / 2.0, yz)
    both = sorted([turned.bending_stiffness_xz / E, turned.bending_stiffness_xy / E])
    np.testing.assert_allclose(both, [mean - half, mean + half], rtol=1e-6)


def test_units_of_millimetres():
    aluminium = pre.Material("aluminium", 7e4, 0.33, 1.0, 2.7e-6, "grey")
    small = library.circular_hollow_section(d=50, t=2, n=128, material=aluminium)
    found = bc.spec.section_from(meshed(small, 2.0), unit=1e-3)
    tube = bc.Tube(outer_diameter=0.05, wall=0.002)
    wanted = tube.geometry(tube, np.zeros(1))
    assert found.bending_stiffness_xy == pytest.approx(E * wanted.second_moment_z[0], rel=CIRCLE)
    assert found.linear_mass == pytest.approx(RHO * wanted.area[0], rel=CIRCLE)
    assert found.torsion_stiffness == pytest.approx(G * wanted.torsion_constant[0], rel=TORSION)
    assert found.polar_inertia == pytest.approx(RHO * wanted.polar_moment[0], rel=CIRCLE)


def test_a_strip_on_one_side_moves_the_elastic_centre_off_the_mass():
    with pytest.raises(bc.InputError, match=r"(shear|elastic) centre"):
        bc.spec.section_from(sandwich((0.002, 0.003)))


def test_parts_that_do_not_touch_are_refused():
    with pytest.raises(bc.InputError, match="do not touch"):
        bc.spec.section_from(sandwich((0.004, 0.005), (-0.005, -0.004)))


def test_a_section_without_material_is_refused():
    with pytest.raises(bc.InputError, match="default material"):
        bc.spec.section_from(meshed(library.rectangular_section(d=0.1, b=0.05), 1e-4))
