"""Integrals beside the moments, densities and compliance of a beam of two segments."""

import numpy as np
import pytest
from scipy.integrate import quad

from beamchain import (
    Beam,
    Equivalent,
    InputError,
    Joint,
    Lump,
    Material,
    Rectangle,
    Round,
    Segment,
)
from formulas import Moments

MATERIAL = Material(youngs_modulus=7e10, density=2700.0, poissons_ratio=0.25)
FLAT = Rectangle(width_y=0.05, width_z=0.03)


def two(**more):
    """2 m of a rectangle with shear, then 1.5 m of a cone from 4 to 1.5 cm."""
    return Beam(
        segments=(
            Segment(
                length=2.0,
                section=FLAT,
                material=MATERIAL,
                theory="timoshenko",
                nonstructural_mass=0.6,
            ),
            Segment(
                length=1.5,
                section=Round(diameter=0.04),
                section_end=Round(diameter=0.015),
                material=MATERIAL,
            ),
        ),
        **more,
    )


def diameter(x):
    return 0.04 - 0.025 * (x - 2.0) / 1.5


def inverse_stiffness(x, port):
    """1 / EI or 1 / GJ, with G = E / 2.5."""
    if x < 2.0:
        # S. Timoshenko, J. N. Goodier, art. 109, as a fit: R. J. Roark
        ratio = 0.03 / 0.05
        torsion = 0.05 * 0.03**3 * (1.0 / 3.0 - 0.21 * ratio * (1.0 - ratio**4 / 12.0))
        second = {"xy": 0.03 * 0.05**3 / 12.0, "xz": 0.05 * 0.03**3 / 12.0}
        return 1.0 / (2.8e10 * torsion) if port == "torsion" else 1.0 / (7e10 * second[port])
    second = np.pi / 64.0 * diameter(x) ** 4
    return 1.0 / (2.8e10 * 2.0 * second) if port == "torsion" else 1.0 / (7e10 * second)


@pytest.mark.parametrize(("port", "near"), [("xy", 1e-9), ("xz", 1e-9), ("torsion", 1e-2)])
def test_compliance_of_a_stretch_over_two_segments_and_a_joint(port, near):
    beam = two(joints=[Joint(after_segment=1, stiffness_xy=300.0, stiffness_torsion=80.0)])
    inside = {"xy": 1.0 / 300.0, "xz": 0.0, "torsion": 1.0 / 80.0}[port]
    for start, end, joint in ((0.5, 3.2, True), (0.5, 1.2, False), (2.1, 3.4, False)):
        wanted = quad(inverse_stiffness, start, end, (port,), points=[2.0], epsrel=1e-11)[0]
        assert beam.compliance(start, end, port) == pytest.approx(wanted + joint * inside, rel=near)
    # a joint belongs to the stretch that it starts
    at = beam.compliance(2.0, 2.5, port) - beam.compliance(2.0 + 2e-8, 2.5, port)
    assert at == pytest.approx(inside, abs=1e-6)


def test_masses_and_densities_of_two_segments():
    beam = two(lumps=[Lump(x=1.0, mass=4.0), Lump(x=3.5, mass=2.0, inertia=(0.1, 0.2, 0.25))])
    flat = 2700.0 * 0.0015 + 0.6
    cone = 2700.0 * np.pi / 12.0 * 1.5 * (0.04**2 + 0.04 * 0.015 + 0.015**2)
    assert beam.own_mass == pytest.approx(2.0 * flat + cone, rel=1e-12)
    # rotary inertia is Timoshenko's
    second = {"xy": 0.03 * 0.05**3 / 12.0, "xz": 0.05 * 0.03**3 / 12.0}
    for port in ("xy", "xz"):
        wanted = [flat, 0.7 * flat, 0.49 * flat + 2700.0 * second[port]]
        assert beam.density(0.7, port) == pytest.approx(wanted, rel=1e-12)
        thin = 2700.0 * np.pi / 4.0 * diameter(3.0) ** 2
        assert beam.density(3.0, port) == pytest.approx([thin, 3.0 * thin, 9.0 * thin], rel=1e-12)
    total = Moments(*beam.line.moments([0.0, 3.5])[0])
    assert total.mass == pytest.approx(2.0 * flat + cone + 6.0)
    assert total.rotary_xy == pytest.approx(2.0 * 2700.0 * second["xy"] + 0.25, rel=1e-12)
    assert total.rotary_xz == pytest.approx(2.0 * 2700.0 * second["xz"] + 0.2, rel=1e-12)
    assert beam.line.behind(np.array([3.5 - 1e-6]))[0][1, 5] == pytest.approx(7.0)
    assert beam.depth(1.0, "xy") == pytest.approx(0.05)
    assert beam.depth(1.0, "xz") == pytest.approx(0.03)
    assert beam.depth(2.6, "xz") == pytest.approx(diameter(2.6))
    assert beam.hinge_lines("xy") == ()
    hinged = two(
        joints=[Joint(after_segment=1, stiffness_xy=3.0), Joint(after_segment=0, stiffness_xz=3.0)]
    )
    assert hinged.hinge_lines("xy") == (2.0,)
    assert hinged.hinge_lines("xz") == (0.0,)


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"lumps": [Lump(x=3.5 * (1.0 + 0.9e-9), mass=1.0)]}, None),
        ({"lumps": [Lump(x=3.5 * (1.0 + 1.1e-9), mass=1.0)]}, "beyond the tip"),
        ({"joints": [Joint(after_segment=1, stiffness_xy=1.0)]}, None),
        ({"joints": [Joint(after_segment=2, stiffness_xy=1.0)]}, "between 0 .the root. and 1"),
        ({"joints": [Joint(after_segment=1, stiffness_xy=1.0)] * 2}, "merge them"),
        ({"lumps": [Lump(x=1.0, mass=1e-3)] * 1000}, None),
        ({"lumps": [Lump(x=1.0, mass=1e-3)] * 1001}, "at most 1000"),
    ],
)
def test_what_a_beam_may_carry(more, says):
    if says is None:
        two(**more)
    else:
        with pytest.raises(InputError, match=says):
            two(**more)


@pytest.mark.parametrize(
    ("mass", "inertia", "says"),
    [
        # the segments are 6 kg on 4 m: 6e12 kg and 9.6e13 kg m^2
        (5.9e12, (0.0, 0.0, 0.0), None),
        (6.1e12, (0.0, 0.0, 0.0), r"lump\.mass"),
        (1.0, (0.0, 9.5e13, 9.5e13), None),
        (1.0, (0.0, 9.7e13, 9.7e13), r"lump\.inertia"),
        (1.0, (1.0, 2.0, 3.0), None),
        (1.0, (1.0, 3.0 + 4e-9, 2.0), "belongs to no rigid body"),
    ],
)
def test_bodies_that_leave_a_beam_its_digits(mass, inertia, says):
    section = Equivalent(bending_stiffness_xy=1.0, linear_mass=1.5)

    def make():
        return Beam(
            segments=(Segment(length=4.0, section=section),),
            lumps=[Lump(x=1.0, mass=mass, inertia=inertia)],
        )

    if says is None:
        make()
    else:
        with pytest.raises(InputError, match=says):
            make()


@pytest.mark.parametrize(
    ("segments", "uniform"),
    [
        ([{}], True),
        ([{"section_end": Rectangle(width_y=0.06, width_z=0.03)}], False),
        ([{"theory": "timoshenko"}], False),
        ([{}, {}], False),
    ],
)
def test_one_plain_segment_is_uniform(segments, uniform):
    parts = [
        Segment(**{"length": 1.0, "section": FLAT, "material": MATERIAL, **s}) for s in segments
    ]
    assert Beam(segments=parts).uniform is uniform
    assert not Beam(segments=parts, lumps=[Lump(x=0.5, mass=1.0)]).uniform
    assert not Beam(segments=parts, joints=[Joint(after_segment=0, stiffness_xy=1.0)]).uniform
