"""Thresholds of what is told beside a fit, from both sides."""

from types import SimpleNamespace

import numpy as np
import pytest

import beamchain as bc
from beamchain.structure.readers.imported import Units
from beamchain.warning_codes import Caution
from formulas import (
    doubtful,
    fit_warnings,
    imported_warnings,
    rigid_plane,
    step_warnings,
    turn_warning,
)

LIMITS = SimpleNamespace(largest_step={"Euler": 0.0123, "implicitfast": 0.456})


def said(**given):
    """Codes and texts of a fit of which all that is not given has nothing to tell."""
    spec = {"unsaid": (), "scene": None, "exact_step": 0.0, "damping": None, "kept": {}}
    spec |= {key: given[key] for key in spec if key in given}
    chain = SimpleNamespace(tendons=given.get("tendons", ()))
    measured = SimpleNamespace(couplings=given.get("couplings", {}))
    achieved = given.get("achieved", {})
    found = fit_warnings(SimpleNamespace(**spec), measured, achieved, chain, LIMITS)
    return [(one.code, str(one)) for one in found]


def tendon(damping, *, is_mode=True):
    return SimpleNamespace(is_mode=is_mode, damping=damping)


def test_nothing_is_told_of_a_plain_fit():
    assert said() == []
    assert said(unsaid=("xz",)) == [("rigid-plane", rigid_plane("xz"))]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"tendons": [tendon(0.0), tendon(0.03)]}, True),
        ({"tendons": [tendon(0.0)]}, False),
        ({"tendons": [tendon(0.3, is_mode=False)]}, False),
        ({"tendons": [tendon(0.3)], "scene": bc.Scene()}, False),  # implicitfast
        ({"tendons": [tendon(0.3)], "scene": bc.Scene(integrator="Euler")}, True),
        ({"tendons": [tendon(0.3)], "exact_step": 0.01}, False),
    ],
)
def test_euler_is_told_of_damped_modes(given, told):
    found = said(**given)
    assert [code for code, _ in found] == (["tendon-damping"] if told else [])
    if told:
        assert "up to 0.0123 s only (implicitfast 0.456 s)" in found[0][1]


@pytest.mark.parametrize(("off", "told"), [(0.0099, False), (0.0103, True), (-0.0103, True)])
def test_plain_joint_damping_is_told_beyond_a_hundredth_of_what_is_wanted(off, told):
    damping = bc.Damping(ratio={"xy": (0.02, 0.004)}, form="hinge")
    model = SimpleNamespace(modes=3, damping=np.array([0.02, 0.004 * (1.0 + off), 0.9]))
    found = said(damping=damping, kept={"xy": 2}, achieved={"xy": model})
    assert bool(found) == told
    if told:
        assert found[0][0] == "hinge-damping"
        assert f"(xy 2: {0.004 * (1.0 + off):.4g} for 0.004)" in found[0][1]
    modal = bc.Damping(ratio={"xy": (0.02, 0.004)})
    assert said(damping=modal, kept={"xy": 2}, achieved={"xy": model}) == []
    # a port of which all is kept
    assert said(damping=damping, achieved={"xy": model})[0][1].count(" for 0.004") == 1 + told


@pytest.mark.parametrize(("value", "told"), [(0.9e-9, False), (1.1e-9, True)])
def test_ports_that_share_more_than_rounding_are_told(value, told):
    assert [code for code, _ in said(couplings={"xy-xz": value})] == ["ports-coupled"] * told


@pytest.mark.parametrize(
    ("error", "rates", "told"),
    [(1.1e-3, True, True), (0.9e-3, True, False), (1.1e-3, False, False), (None, True, False)],
)
def test_a_turn_with_more_error_than_the_tolerance_is_told(error, rates, told):
    scene = bc.Scene(tolerance=1e-3, rates=(0.1, 0.0, -0.2) if rates else None)
    found = list(turn_warning(error, scene, "RK4", 0.05, " at dawn"))
    assert [one.code for one in found] == ["turn-error"] * told
    if told:
        assert "RK4 at 0.05 s turns the rigid spacecraft at dawn" in found[0]
        assert "(0.1, 0, -0.2) rad/s with an error of 0.0011 " in found[0]


def test_an_inaccurate_step_is_told_beside_the_best():
    steps = [SimpleNamespace(integrator=k, step=h) for k, h in (("RK4", 0.5), ("Euler", 0.005))]
    limits = SimpleNamespace(largest_step={"Euler": 0.01})
    (found,) = step_warnings(bc.Scene(integrator="Euler"), 0.0075, limits, steps)
    assert "Euler at 0.0075 s, whose own error is above the tolerance 0.001" in found
    assert "up to 0.005 s, RK4 up to 0.5 s" in found


# -- numbers of a specification --------------------------------------------------------------------
TUBE = bc.Tube(outer_diameter=0.1, wall=0.002)
ALLOY = bc.Material(youngs_modulus=7e10, density=2700.0)


def segments(*sections, **material):
    made = bc.Material(**{"youngs_modulus": 7e10, "density": 2700.0, **material})
    return [bc.Segment(length=10.0, section=one, material=made) for one in sections]


def text(found, code):
    (only,) = [str(one) for one in found if one.code == code]
    return only


def test_what_was_likely_meant_is_written_out():
    light = text(doubtful(segments(TUBE, density=2.7)), "light-material")
    assert "density = 2.7 kg/m^3" in light
    assert "write 2700." in light
    wide = bc.Rectangle(width_y=60.0, width_z=30.0)
    huge = text(doubtful(segments(TUBE, wide)), "huge-section")
    assert huge.startswith("segment[1]: width_y = 60 m on an appendage 20 m long")
    assert "write width_y = 0.06, width_z = 0.03." in huge
    damped = bc.Damping(ratio={"xy": (0.002, 0.5), "xz": (0.003,)})
    high = text(doubtful([], damped), "high-damping")
    assert high.startswith("damping.ratio.xy[1] = 0.5 is 50% of critical")
    assert high.endswith("write 0.005.")
    assert "damping.ratio[1] = 0.4 " in doubtful([], bc.Damping(ratio=(0.0001, 0.4)))[0]
    low = text(doubtful([], bc.Damping(ratio=(0.01, 5e-6))), "least-damping")
    assert low.startswith("damping.ratio[1] = 5e-06 is below 1e-05")
    # 10 m of a square of 2 m, thin beside none: 5 times as long as deep
    short = text(doubtful(segments(bc.Rectangle(width_y=2.0, width_z=2.0))), "stocky-beam")
    assert "only 5 times as long" in short


@pytest.mark.parametrize(("thick", "told"), [(0.049, False), (0.051, True)])
def test_a_panel_is_thinner_than_50_mm(thick, told):
    found = doubtful(segments(bc.Rectangle(width_y=3.0, width_z=thick)), ports=())
    assert any(one.code == "huge-section" for one in found) == told


# -- files of modes --------------------------------------------------------------------------------
ROWS = np.zeros((3, 6))
ROWS[0, 1], ROWS[0, 5] = 1.0, 3.0
ROWS[1, 2], ROWS[1, 4] = 1.2, -3.0
ROWS[2, 3] = 0.4


def data(**given):
    mass = np.diag([8.0, 8.0, 8.0, 0.5, 30.0, 30.0])
    return bc.ModalData(
        **{
            "rigid_mass": mass,
            "frequencies": np.array([2.0, 3.0, 7.0]),
            "participation": ROWS,
            "length": 5.0,
            **given,
        }
    )


def codes(of, numbers=(1, 2, 3), *rest, **given):
    return [one.code for one in imported_warnings(of, numbers, *rest, **given)]


def test_what_a_reader_noted_is_told():
    noted = data(steps=(Caution("almost-rigid", "odd"), "turned"), source="f.op2")
    assert [str(one) for one in imported_warnings(noted, [1])] == ["f.op2: odd."]
    left = (Caution("ignored-damping", "damping is not read"),)
    assert codes(data(steps=left)) == ["ignored-damping"]
    assert codes(data(steps=left), (1,), bc.Damping(ratio=0.01)) == []
    assert codes(data(steps=left, damping=np.array([0.0, 0.01, 0.0]))) == []


@pytest.mark.parametrize(
    ("units", "words"),
    [
        ({"length": 1e-3}, ("length = 0.001 alone", "write mass = 1.0")),
        ({"mass": 1e3}, ("mass = 1000 alone", "write length = 1.0")),
        ({"length": 1e-3, "mass": 1e3}, ()),
        ({}, ()),
    ],
)
def test_half_of_the_units_is_told(units, words):
    found = imported_warnings(data(), [1], None, Units(**units))
    assert [one.code for one in found] == ["half-units"] * bool(words)
    assert all(word in str(found[0]) for word in words)


def test_modes_that_a_table_of_damping_leaves_out_are_told():
    given = bc.Damping(ratio={"xy": (0.01,)})
    found = text(imported_warnings(data(), (1, 2, 3), given), "undamped-modes")
    assert "leaves modes 2, 3 of the file (xz, torsion) undamped" in found
    found = text(imported_warnings(data(), (1, 3), given), "undamped-modes")
    assert "leaves mode 3 of the file (torsion) undamped" in found
    assert codes(data(), (1,), given) == []
    assert codes(data(), (1, 2), bc.Damping(ratio={"xy": (0.0,)})) == []


@pytest.mark.parametrize(
    ("axes", "band", "tolerance", "told"),
    [
        # of y 1.44 / 8 and of its rotation 9 / 30 are carried, so 0.7 of z's inertia is missing;
        # modes end at 7, so that (w / 7)^2 of it matters
        (("ty", "y", "z"), 0.9, 0.0142, True),  # (1 - 1 / 8) (0.9 / 7)^2 = 0.01446
        (("ty", "y", "z"), 0.9, 0.0146, False),
        (("y",), 0.9, 0.0115, True),  # 0.7 (0.9 / 7)^2 = 0.01157
        (("y",), 0.9, 0.0117, False),
        (("x",), 3.0, 0.12, True),  # (1 - 0.16 / 0.5) (3 / 7)^2 = 0.1249
        (("x",), 3.0, 0.13, False),
        (("tx",), 3.0, 1e-3, False),  # no mode of the file is of this motion
        (("y",), 0.69, 1e-4, False),  # ten times below the last
        (("y",), 0.71, 1e-4, True),
        (("y",), 100.0, 1.0, True),  # far beyond the last
    ],
)
def test_a_file_that_ends_too_soon_for_the_band_is_told(axes, band, tolerance, told):
    scene = bc.Scene(axes=axes, bandwidth=band, tolerance=tolerance)
    found = imported_warnings(data(), (1,), scene=scene)
    assert [one.code for one in found] == ["last-mode"] * told
    if axes == ("x",) and told:
        assert "end at 7 rad/s, 2.3 times" in found[0]
        assert "leave 68.0% of the effective mass in x" in found[0]
        assert "some 1.2e-01 of" in found[0]
        assert "up to 30 rad/s" in found[0]


def test_a_file_without_a_length_is_of_no_length():
    mass = 5e-5 * np.eye(6)
    light = bc.ModalData(mass, np.array([2.0]), 1e-3 * np.eye(6)[1:2])
    assert codes(light, (1,)) == []


def test_a_file_without_modes_ends_nowhere():
    scene = bc.Scene(axes=("y",), bandwidth=1.0, tolerance=1e-6)
    assert codes(data().frozen(), (), scene=scene) == []
