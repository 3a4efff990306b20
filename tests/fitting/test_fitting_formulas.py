"""Closed forms beside the formulas of a choice of modes."""

from types import SimpleNamespace

import numpy as np
import pytest

import beamchain as bc
from beamchain import PortModel
from beamchain.structure.section import SOFT
from formulas import Promise, doubtful, imported_warnings, step_warnings, weights_of_modes


@pytest.mark.parametrize(("hub", "coupled"), [(1e3, False), (1e-3, True)])
def test_a_heavy_hub_uncouples_what_a_light_one_does_not(hub, coupled):
    # 1e-11 off the diagonal of ones: 1e-14 of a hub of 1e3, 1e-11 of one of 1e-3; 1e-12 couples
    rigid = np.array([[1.0, 1e-11], [1e-11, 1.0]])
    exact = PortModel(rigid, np.array([2.0]), np.array([[0.5, 0.0]]))
    promise = Promise(exact, hub * np.eye(2), [0], 1.0, 0.01)
    assert promise.reaches([0])
    assert promise.reaches([1]) is coupled


def test_a_mode_weighs_what_it_carries_at_its_peak_or_beyond_the_band():
    """In the band 1 / (2 ratio), beyond it r^2 / (1 - r^2) with r = band / w, times the share of
    its effective mass in that of appendage and hub."""
    full = PortModel(
        np.diag([4.0, 2.0]),
        np.array([0.5, 2.0, 4.0]),
        np.array([[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]]),
        np.array([0.01, 0.01, 0.0]),
    )
    found = weights_of_modes(full, np.diag([6.0, 3.0]), 1.0)
    wanted = [0.1 * 50.0, 0.2 / 3.0, (0.025 + 0.05) / 15.0]
    assert found == pytest.approx(wanted, rel=1e-12)


def delivery(mass, length):
    arm = length / 2.0
    rigid = np.diag(
        [mass] * 3 + [1e-3 * mass * length**2, mass * arm**2 * 1.5, mass * arm**2 * 1.5]
    )
    rigid[1, 5] = rigid[5, 1] = mass * arm
    rigid[2, 4] = rigid[4, 2] = -mass * arm
    row = np.zeros((1, 6))
    row[0, 1] = 0.5 * np.sqrt(mass)
    return bc.ModalData(rigid, np.array([1.0]), row, length=length)


@pytest.mark.parametrize(
    ("mass", "length", "told"),
    [
        (5.0, 199.0, False),
        (5.0, 201.0, True),  # longer than any appendage
        (0.011, 10.0, False),
        (0.009, 10.0, True),  # below 1 g/m
    ],
)
def test_a_file_in_other_units_is_asked_about(mass, length, told):
    said = imported_warnings(delivery(mass, length), [1])
    assert told == any(one.code == "file-units" for one in said)


# -- slips of units --------------------------------------------------------------------------------
def codes(length, section, youngs_modulus=7e10, density=2700.0, damping=None):
    material = bc.Material(youngs_modulus=youngs_modulus, density=density)
    part = bc.Segment(length=length, section=section, material=material)
    return {one.code for one in doubtful([part], damping)}


@pytest.mark.parametrize(
    ("code", "just", "not_yet"),
    [
        ("light-material", {"density": 4.9}, {"density": 5.1}),
        ("soft-material", {"youngs_modulus": 0.9 * SOFT}, {"youngs_modulus": 1.1 * SOFT}),
        # a square of side d: bending over axial stiffness d^2 / 12
        ("stocky-beam", {"length": 9.9 * 0.5}, {"length": 10.1 * 0.5}),
        ("high-damping", {"damping": 0.1}, {"damping": 0.099}),
        ("least-damping", {"damping": 0.95e-5}, {"damping": 1.05e-5}),
    ],
)
def test_a_doubtful_number_is_told_from_its_threshold_on(code, just, not_yet):
    for change, told in ((just, True), (not_yet, False)):
        given = {"length": 20.0, "section": bc.Rectangle(width_y=0.5, width_z=0.5), **change}
        if "damping" in given:
            given["damping"] = bc.Damping(ratio=given["damping"])
        assert (code in codes(**given)) == told


@pytest.mark.parametrize(
    ("length", "y", "z", "told"),
    [
        (8.0, 2.1, 0.1, True),  # a quarter of the length
        (8.0, 1.9, 0.1, False),
        (2.0, 0.9, 0.1, False),  # nothing below 1 m
        (2.0, 1.1, 0.1, True),
        (8.0, 7.9, 0.04, False),  # a panel may be as wide as it is long
        (8.0, 8.1, 0.04, True),
    ],
)
def test_a_wide_section_is_doubted_unless_it_is_a_panel(length, y, z, told):
    section = bc.Rectangle(width_y=y, width_z=z)
    assert ("huge-section" in codes(length, section)) == told


def test_the_depth_of_a_stocky_beam_is_that_of_the_kept_planes():
    material = bc.Material(youngs_modulus=7e10, density=2700.0)
    flat = bc.Rectangle(width_y=0.5, width_z=0.01)
    part = bc.Segment(length=4.0, section=flat, material=material)
    for ports, told in ((("xy", "xz"), True), (("xz",), False), (("torsion",), False)):
        assert any(one.code == "stocky-beam" for one in doubtful([part], ports=ports)) == told


@pytest.mark.parametrize(
    ("step", "code"), [(0.011, "unstable-step"), (0.009, "inaccurate-step"), (0.004, None)]
)
def test_a_step_is_told_where_it_is_unstable_or_inaccurate(step, code):
    limits = SimpleNamespace(largest_step={"Euler": 0.01, "RK4": 1.0})
    choices = [
        SimpleNamespace(integrator="RK4", step=0.5),
        SimpleNamespace(integrator="Euler", step=0.005),
    ]
    scene = bc.Scene(integrator="Euler", tolerance=0.01)
    found = [one.code for one in step_warnings(scene, step, limits, choices)]
    assert found == ([] if code is None else [code])
