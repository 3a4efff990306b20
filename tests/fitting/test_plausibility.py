"""Slips of units and theory are asked about, sound numbers are not.

No tolerances: words only.
"""

import re

import pytest

import beamchain as bc
from appendages import panels, seed_boom, stepped_boom
from modes_of_beam import modes_of_beam

CRAFT = """<mujoco><option gravity="0 0 0" integrator="implicitfast"/><worldbody><body name="hub">
<freejoint/>
<geom size=".5" mass="500"/><site name="mount"/></body></worldbody></mujoco>"""


def said(length=5.0, diameter=0.02, modulus=7e10, density=2700.0, theory="euler"):
    material = bc.Material(youngs_modulus=modulus, density=density, poissons_ratio=0.3)
    section = bc.Round(diameter=diameter)
    fit = bc.fit(
        bc.Beam(
            segments=[bc.Segment(length=length, section=section, material=material, theory=theory)]
        )
    )
    return " ".join(fit.warnings)


@pytest.mark.slow
def test_sound_numbers_pass_in_silence():
    assert said() == ""
    for beam in (seed_boom(), stepped_boom(), panels()):
        assert bc.fit(beam).warnings == ()


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"modulus": 70.0}, "if GPa were meant, write 7e+10"),
        ({"density": 2.7}, "if g/cm^3 were meant, write 2700"),
        ({"length": 0.1}, 'set theory = "timoshenko"'),
    ],
)
def test_slips_are_asked_about(wrong, words):
    assert words in said(**wrong)


@pytest.mark.slow
def test_damping_in_per_cent_is_asked_about():
    damping = bc.Damping(ratio={"xy": (0.005, 0.3)})
    said_of = bc.fit(seed_boom(), damping=damping).warnings
    wanted = (
        "damping.ratio.xy[1] = 0.3 is 30% of critical, where structures have 0.001 to 0.02: a "
        "likely slip; if 0.3 % were meant, write 0.003."
    )
    assert wanted in said_of
    craft = bc.embed(CRAFT, {"mount": bc.Spec(segment=seed_boom().segments, damping=damping)})
    assert f"mount: {wanted}" in craft.warnings


def test_damping_of_a_structure_is_no_slip():
    assert "slip" not in " ".join(bc.fit(seed_boom(), damping=bc.Damping(ratio=0.05)).warnings)


def test_damping_of_imported_modes_is_asked_about():
    data = modes_of_beam(seed_boom(), {"xy": 2})
    assert "likely slip" in " ".join(bc.fit(data, damping=bc.Damping(ratio=0.3)).warnings)


def test_a_plane_that_is_left_out_needs_no_theory():
    """A panel 1.2 m wide and 5 m long bends out of its plane;
    how deep it is in its plane matters where that is kept."""
    panel = bc.Segment(
        length=5.0,
        section=bc.Rectangle(width_y=0.02, width_z=1.2),
        material=bc.Material(youngs_modulus=7e10, density=90.0),
    )
    beam = bc.Beam(segments=[panel])
    assert "timoshenko" not in " ".join(bc.fit(beam, modes={"xy": 1}).warnings)
    assert "timoshenko" in " ".join(bc.fit(beam, modes={"xz": 1}).warnings)


def test_a_wide_panel_is_no_slip():
    panel = bc.Segment(
        length=8.0,
        section=bc.Rectangle(width_y=0.02, width_z=1.9),
        material=bc.Material(youngs_modulus=7e10, density=90.0),
    )
    assert "if mm were meant" not in " ".join(bc.fit(bc.Beam(segments=[panel])).warnings)


def test_timoshenko_answers_the_question():
    assert "deep" not in said(length=0.1, theory="timoshenko")


@pytest.mark.parametrize(("typed", "meant"), [(90.0, 9e10), (70000.0, 7e10)])
def test_a_modulus_in_the_wrong_unit_is_refused_where_a_band_chooses_the_modes(typed, meant):
    """A band of hundreds of modes would be searched; with their number typed it is a warning."""
    material = bc.Material(youngs_modulus=typed, density=1600.0)
    section = bc.Tube(outer_diameter=0.12, wall=0.003)
    segment = bc.Segment(length=7.0, section=section, material=material)
    with pytest.raises(bc.InputError, match=re.escape(f"write {meant:g}")) as said:
        bc.Spec(segment=(segment,), scene=bc.Scene(bandwidth=12.0))
    assert f"youngs_modulus = {typed:g}" in str(said.value)
    assert bc.Spec(segment=(segment,), modes=bc.Modes(xy=2)).segment
