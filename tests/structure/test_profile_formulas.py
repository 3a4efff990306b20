"""Sums over rectangles beside what is taken of sectionproperties' sections, in its units.

The sections here have that package's names, and rectangles for their mesh.
"""

import re
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from beamchain import InputError, Material
from beamchain.spec import section_from
from formulas import Properties


@dataclass(frozen=True)
class Stuff:
    """A material as sectionproperties has it."""

    name: str
    elastic_modulus: float
    poissons_ratio: float
    density: float

    @property
    def shear_modulus(self):
        return self.elastic_modulus / (2.0 * (1.0 + self.poissons_ratio))


class Profile:
    """Rectangles, with every property weighted by the modulus of its part."""

    def __init__(self, geometry):
        self.geometry = geometry
        self.parts = getattr(geometry, "geoms", None) or [geometry]
        self.materials = [part.material for part in self.parts]
        corners = [part.at + np.array(s) * part.size / 2.0 for part in self.parts for s in SIGNS]
        self.mesh_nodes = np.array(corners)
        self.section_props = SimpleNamespace()

    def calculate_geometric_properties(self):
        weight = np.array([m.elastic_modulus for m in self.materials])
        size, at = (np.array([getattr(p, name) for p in self.parts]) for name in ("size", "at"))
        area = weight * np.prod(size, axis=1)
        centre = area @ at / area.sum()
        apart = at - centre
        own = area[:, None] * size**2 / 12.0
        about = np.sum(own + area[:, None] * apart**2, axis=0)
        props = self.section_props
        props.ea, (props.cx, props.cy) = area.sum(), centre
        props.iyy_c, props.ixx_c = about  # of x^2 and of y^2
        props.ixy_c = area @ np.prod(apart, axis=1)

    def calculate_warping_properties(self):
        weight = np.array([m.elastic_modulus for m in self.materials])
        self.section_props.j = weight @ [part.torsion for part in self.parts]

    def get_sc_t(self):
        return self.section_props.cx + self.parts[0].beside, self.section_props.cy


SIGNS = ((1, 1), (1, -1), (-1, 1), (-1, -1))


def part(x, y, width, height, stuff, torsion=1.0, beside=0.0):
    return SimpleNamespace(
        at=np.array([x, y]),
        size=np.array([width, height]),
        material=stuff,
        torsion=torsion,
        beside=beside,
    )


HARD, SOFT = Stuff("hard", 8e4, 0.25, 3e-6), Stuff("soft", 2e4, 0.0, 1e-6)  # N/mm^2, kg/mm^3


def sandwich(**more):
    """Two faces of 20 x 2 mm on a core of 20 x 10 mm."""
    return SimpleNamespace(
        geoms=[
            part(5.0, 6.0, 20.0, 2.0, HARD, 30.0, **more),
            part(5.0, -6.0, 20.0, 2.0, HARD, 30.0),
            part(5.0, 0.0, 20.0, 10.0, SOFT, 700.0),
        ]
    )


def test_sums_over_two_materials_are_in_si():
    found = section_from(Profile(sandwich()), unit=1e-3)
    # 80 and 200 mm^2; y^2 as of 20 mm of width, z^2 as of faces 6 mm beside
    assert found.axial_stiffness == pytest.approx(8e4 * 80.0 + 2e4 * 200.0)
    assert found.bending_stiffness_xy == pytest.approx((8e4 * 80.0 + 2e4 * 200.0) * 400.0 / 12e6)
    faces, core = 80.0 * (4.0 / 12.0 + 36.0), 200.0 * 100.0 / 12.0
    assert found.bending_stiffness_xz == pytest.approx((8e4 * faces + 2e4 * core) / 1e6)
    assert found.torsion_stiffness == pytest.approx((3.2e4 * 60.0 + 1e4 * 700.0) / 1e6)
    assert found.linear_mass == pytest.approx((3e-6 * 80.0 + 1e-6 * 200.0) * 1e3)
    polar = 3e-6 * (80.0 * 400.0 / 12.0 + faces) + 1e-6 * (200.0 * 400.0 / 12.0 + core)
    assert found.polar_inertia == pytest.approx(polar / 1e3)
    assert (found.draw.width, found.draw.thickness) == (pytest.approx(0.02), pytest.approx(0.014))


@pytest.mark.parametrize("stated", [False, True])
def test_one_material_is_that_of_the_section_or_the_one_stated(stated):
    one = Profile(part(0.0, 0.0, 0.02, 0.01, Stuff("steel", 8e10, 0.25, 3e3), 2e-9))
    own = Material(youngs_modulus=7e10, density=2700.0, poissons_ratio=0.4)
    found = section_from(one, material=own if stated else None)
    e, g, density = (7e10, 2.5e10, 2700.0) if stated else (8e10, 3.2e10, 3e3)
    assert found.axial_stiffness == pytest.approx(e * 2e-4)
    assert found.bending_stiffness_xy == pytest.approx(e * 0.01 * 0.02**3 / 12.0)
    assert found.bending_stiffness_xz == pytest.approx(e * 0.02 * 0.01**3 / 12.0)
    assert found.torsion_stiffness == pytest.approx(g * 2e-9)
    assert found.linear_mass == pytest.approx(density * 2e-4)
    assert found.polar_inertia == pytest.approx(density * 2e-4 * (4e-4 + 1e-4) / 12.0)


def test_a_shear_centre_beside_the_mass_is_told_in_metres():
    with pytest.raises(InputError, match=r"shear centre .* lies 0\.003 m .*\(y 0\.003, z 0;"):
        section_from(Profile(sandwich(beside=3.0)), unit=1e-3)
    lopsided = sandwich()
    lopsided.geoms[0].material = SOFT  # with its centres of mass and of stiffness apart
    mass = (3e-6 * -240.0 + 1e-6 * 240.0) / (3e-6 * 40.0 + 1e-6 * 240.0)
    stiff = (8e4 * -240.0 + 2e4 * 240.0) / (8e4 * 40.0 + 2e4 * 240.0)
    with pytest.raises(InputError) as told:
        section_from(Profile(lopsided), unit=1e-3)
    away = float(re.search(r"z (\S+);", str(told.value))[1])
    assert away == pytest.approx((stiff - mass) * 1e-3, rel=1e-5)


def properties(**more):
    """A radius of gyration of 0.2 m."""
    given = {
        "axial": 1.0,
        "bending_xy": 4.0,
        "bending_xz": 9.0,
        "product": 0.0,
        "torsion": 1.0,
        "mass": 5.0,
        "polar": 0.2,
        "shear_centre": (0.0, 0.0),
        "elastic_centre": (0.0, 0.0),
        "extent": (0.1, 0.3),
    }
    return Properties(**{**given, **more})


@pytest.mark.parametrize(
    ("given", "said"),
    [
        # a hundredth of 0.2 m
        ({"shear_centre": (0.0, 1.99e-3)}, None),
        ({"shear_centre": (1.6e-3, -1.21e-3)}, "shear centre"),
        ({"elastic_centre": (1.99e-3, 0.0)}, None),
        ({"elastic_centre": (-1.6e-3, 1.21e-3)}, "elastic centre"),
        # 1e-4 of the root of both, 6
        ({"product": 5.9e-4}, None),
        ({"product": -5.9e-4}, None),
        ({"product": 6.1e-4}, "principal axes"),
        ({"product": -6.1e-4}, "principal axes"),
    ],
)
def test_what_couples_bending_is_refused_from_some_size_on(given, said):
    if said is None:
        properties(**given).check()
    else:
        with pytest.raises(InputError, match=said):
            properties(**given).check()


@pytest.mark.parametrize(("long", "short"), [(9.0, 4.0), (4.0, 9.0)])
@pytest.mark.parametrize(("turned", "told"), [(10.0, 10.0), (-30.0, -30.0), (60.0, -30.0)])
def test_turned_axes_are_told_and_turned_back(turned, told, long, short):
    """Sums of y^2, z^2 and y z of a profile that is turned about x; the nearest of four axes."""
    angle = np.radians(turned)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    sums = turn @ np.diag([long, short]) @ turn.T
    with pytest.raises(InputError) as said:
        properties(bending_xy=sums[0, 0], bending_xz=sums[1, 1], product=sums[0, 1]).check()
    words = str(said.value)
    assert float(re.search(r"turned by (\S+) degrees", words)[1]) == pytest.approx(told, rel=1e-4)
    back = float(re.search(r"rotate_section\((\S+?)\)", words)[1])
    assert back == pytest.approx(-told, rel=1e-6)
    assert float(re.search(r"mounted on by (\S+) degrees", words)[1]) == pytest.approx(told)


def test_a_profile_is_drawn_as_large_as_it_is():
    found = properties().equivalent()
    assert (found.draw.width, found.draw.thickness) == (0.3, 0.1)
    assert (found.bending_stiffness_xy, found.bending_stiffness_xz) == (4.0, 9.0)
