"""Beams whose tapers leave the lowest frequencies far apart: an answer or one sentence,
after bounded work."""

import pytest

import beamchain as bc

ALU = bc.Material(youngs_modulus=7e10, density=2700.0, poissons_ratio=0.33)
LIGHT = bc.Material(youngs_modulus=7e10, density=0.0021, poissons_ratio=0.33)


def rectangle(y: float, z: float) -> bc.Rectangle:
    return bc.Rectangle(width_y=y, width_z=z)


def test_a_taper_beyond_what_double_precision_holds_apart_is_named():
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
    with pytest.raises(
        bc.BeamchainError, match=r'port "xy": the 12 lowest .* taper is 1\.23e\+08'
    ) as refusal:
        beam.port("xy", 12)
    assert "x = 10.1 to 12.8 m" in str(refusal.value)
