"""Closed forms beside the formulas of a choice of modes."""

import numpy as np
import pytest

import beamchain as bc
from beamchain import PortModel
from formulas import Promise, imported_warnings, weights_of_modes


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
