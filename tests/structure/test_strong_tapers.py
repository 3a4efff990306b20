"""Beams whose tapers leave the lowest frequencies far apart: an answer or one sentence,
after bounded work."""

import beamchain as bc
from beamchain.structure import elements
from refused import check_refused

ALU = bc.Material(youngs_modulus=7e10, density=2700.0, poissons_ratio=0.33)
LIGHT = bc.Material(youngs_modulus=7e10, density=0.0021, poissons_ratio=0.33)


def rectangle(y: float, z: float) -> bc.Rectangle:
    return bc.Rectangle(width_y=y, width_z=z)


def test_a_taper_beyond_what_double_precision_holds_apart_is_named(monkeypatch):
    """After as few checks as are asked for here: forty take half a minute."""
    monkeypatch.setattr(elements, "MOST_CHECKS", 1)
    first = bc.Round(diameter=0.128)
    last = bc.Round(diameter=0.0959)
    pairs = (
        (rectangle(0.168, 0.152), rectangle(0.175, 4.88e-9)),
        (rectangle(0.0569, 0.116), rectangle(0.0427, 1.43e7)),
    )
    beam = bc.Beam(
        segments=(
            bc.Segment(
                length=4.7, section=first, section_end=last, material=LIGHT, theory="timoshenko"
            ),
            bc.Segment(
                length=5.4,
                section=pairs[0][0],
                section_end=pairs[0][1],
                material=ALU,
                theory="timoshenko",
            ),
            bc.Segment(length=2.7, section=pairs[1][0], section_end=pairs[1][1], material=ALU),
        ),
        joints=(bc.Joint(after_segment=1, stiffness_xy=4.86e-5),),
        lumps=(bc.Lump(x=12.8, mass=4e4),),
    )
    words = ('port "xy"', "12 lowest", "1.23e+08", "x = 10.1 to 12.8 m")
    check_refused(lambda: beam.port("xy", 12), bc.BeamchainError, words)


def test_a_taper_is_not_followed_beyond_its_end_by_rounding():
    """The second moment falls from 1e21 to 3e-7 m^4: one rounding step behind the tip it would be
    negative, and so would the polar inertia."""

    def section(second_moment_z: float) -> bc.Custom:
        return bc.Custom(
            area=1e-3,
            second_moment_z=second_moment_z,
            second_moment_y=2e-7,
            torsion_constant=1.4e-7,
        )

    beam = bc.Beam(
        segments=(
            bc.Segment(length=1.9291952950958438, section=section(3e-7), material=ALU),
            bc.Segment(length=2.1770100999011186, section=section(2e-7), material=ALU),
            bc.Segment(
                length=4.321459122939692,
                section=section(1180591620717411303424.0),
                section_end=section(2.758735939189126e-07),
                material=ALU,
            ),
        ),
        lumps=(bc.Lump(x=1.7220586198526213, mass=0.31, inertia=(0.02, 0.02, 0.02)),),
    )
    try:
        model = beam.port("torsion", 4)
    except bc.BeamchainError as refusal:
        assert "taper" in str(refusal)
    else:
        assert model.modes > 0
