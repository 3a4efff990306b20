"""Slips of units and theory are asked about, sound numbers are not.

No tolerances: words only.
"""

import pytest

import beamchain as bc
from appendages import panels, seed_boom, stepped_boom


def said(length=5.0, diameter=0.02, modulus=7e10, density=2700.0, theory="euler"):
    material = bc.Material(youngs_modulus=modulus, density=density, poissons_ratio=0.3)
    section = bc.Round(diameter=diameter)
    fit = bc.fit(bc.Beam(segments=[bc.Segment(length=length, section=section, material=material, theory=theory)]))
    return " ".join(fit.warnings)


def test_sound_numbers_pass_in_silence():
    assert said() == ""
    for beam in (seed_boom(), stepped_boom(), panels()):
        assert bc.fit(beam).warnings == ()


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"modulus": 70.0}, "if GPa were meant, write 7e+10"),
        ({"density": 2.7}, "if g/cm^3 were meant, write 2700"),
        (
            {"length": 0.1},
            'only 5.8 times as long as it is deep; Euler\'s theory leaves shear out: set theory = "timoshenko"',
        ),
    ],
)
def test_slips_are_asked_about(wrong, words):
    assert words in said(**wrong)


def test_timoshenko_answers_the_question():
    assert "deep" not in said(length=0.1, theory="timoshenko")
