"""Appendages in space that the tests and benchmarks of issue B share: tubes, bars,
deployed arrays."""

import numpy as np

from beamchain import Beam, Equivalent, Joint, Lump, Material, Rectangle, Segment, Tube

ALUMINIUM = Material(youngs_modulus=7e10, density=2700.0, poissons_ratio=0.33)


def tube() -> Beam:
    """A round tube: one stiffness in every plane."""
    section = Tube(outer_diameter=0.05, wall=0.002)
    return Beam(segments=(Segment(length=8.0, section=section, material=ALUMINIUM),))


def flat_bar() -> Beam:
    """A uniform rectangle 5:1: planes whose stiffnesses have one ratio everywhere."""
    section = Rectangle(width_y=0.05, width_z=0.01)
    return Beam(segments=(Segment(length=8.0, section=section, material=ALUMINIUM),))


def space_beam() -> Beam:
    """L = EI = m = 1 in both planes, next to no polar inertia."""
    section = Equivalent(
        bending_stiffness_xy=1.0,
        bending_stiffness_xz=1.0,
        linear_mass=1.0,
        torsion_stiffness=1.0,
        axial_stiffness=1.0,
        polar_inertia=1e-6,
    )
    return Beam(segments=(Segment(length=1.0, section=section),))


def deployed_array() -> Beam:
    """A yoke and two tapered panels on hinge lines soft in plane xz only, with a lump;
    EI varies differently."""
    yoke = Segment(length=1.0, section=Tube(outer_diameter=0.05, wall=0.002), material=ALUMINIUM)
    inner, outer = (
        Segment(
            length=2.5,
            section=Rectangle(width_y=a[0], width_z=a[1]),
            section_end=Rectangle(width_y=b[0], width_z=b[1]),
            material=ALUMINIUM,
            nonstructural_mass=2.0,
        )
        for a, b in (((0.3, 0.02), (0.2, 0.015)), ((0.2, 0.015), (0.2, 0.01)))
    )
    joints = (
        Joint(after_segment=1, stiffness_xz=500.0),
        Joint(after_segment=2, stiffness_xz=300.0),
    )
    return Beam(
        segments=(yoke, inner, outer),
        joints=joints,
        lumps=(Lump(x=4.0, mass=1.5, inertia=(0.01, 0.01, 0.01)),),
    )


def random_array(seed: int) -> Beam:
    """Three tapered panels, two hinge lines soft in plane xz only, a lump: like `deployed_array`,
    drawn at random.

    Widths fall outwards, thicknesses go up and down, each hinge line's stiffness lies between 0.5
    and 30 times EI / L of plane xz, the lump weighs 0.1 to 0.6 of the panels.
    """
    rng = np.random.default_rng(seed)
    lengths = rng.uniform(1.5, 3.0, 3)
    widths = np.sort(rng.uniform(0.15, 0.5, 4))[::-1]
    thick = rng.uniform(0.01, 0.03, 4)
    segments = tuple(
        Segment(
            length=float(lengths[i]),
            section=Rectangle(width_y=float(widths[i]), width_z=float(thick[i])),
            section_end=Rectangle(width_y=float(widths[i + 1]), width_z=float(thick[i + 1])),
            material=ALUMINIUM,
            nonstructural_mass=float(rng.uniform(0.0, 3.0)),
        )
        for i in range(3)
    )
    plain = Beam(segments=segments)
    stiffness = 1.0 / plain.compliance(0.0, plain.length, "xz")
    joints = tuple(
        Joint(after_segment=i, stiffness_xz=float(stiffness * 10.0 ** rng.uniform(-0.3, 1.5)))
        for i in (1, 2)
    )
    x = float(plain.length * rng.uniform(0.2, 0.95))
    mass = float(rng.uniform(0.1, 0.6) * plain.rigid_mass()[0, 0])
    return Beam(
        segments=segments, joints=joints, lumps=(Lump(x=x, mass=mass, inertia=(0.02, 0.02, 0.03)),)
    )
