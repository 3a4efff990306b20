"""Port models that no appendage has are refused, with the number that is wrong. No tolerances:
sentences only."""

import numpy as np
import pytest

from beamchain import InputError, PortModel
from beamchain.errors import RealisationError

I2 = np.eye(2)
ONE = np.array([1.0])
ROW = np.array([[0.1, 0.1]])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: PortModel(I2, ONE, np.ones((1, 3)) / 9),
            r"participation \(n, m\).*got \(2, 2\), \(1,\), \(1, 3\)",
        ),
        (lambda: PortModel(np.ones((2, 3)), ONE, ROW), r"needs rigid_mass \(m, m\).*got \(2, 3\)"),
        (
            lambda: PortModel(np.ones(2), np.zeros(0), np.zeros((0, 2))),
            r"needs rigid_mass \(m, m\).*got \(2,\)",
        ),
        (lambda: PortModel(I2, ONE, ROW, np.zeros(2)), r"\(n, n\); got .*, \(2,\)\."),
        (
            lambda: PortModel(I2, np.array([np.nan]), ROW),
            "frequencies holds a value that is not finite",
        ),
        (
            lambda: PortModel(np.diag([np.inf, 1.0]), ONE, ROW),
            "rigid_mass holds a value that is not finite",
        ),
        (
            lambda: PortModel(I2, ONE, ROW * np.nan),
            "participation holds a value that is not finite",
        ),
        (
            lambda: PortModel(I2, np.array([0.0]), ROW),
            r"frequencies = \[0\.0\] must be positive and ascending",
        ),
        (
            lambda: PortModel(I2, np.array([2.0, 1.0]), np.vstack([ROW, ROW])),
            r"\[2\.0, 1\.0\] must be positive and asc",
        ),
        (
            lambda: PortModel(I2, ONE, np.array([[1.2, 0.0]])),
            r"the residual mass .* has eigenvalue -4\.400e-01 relative to the rigid mass, which is "
            r"negative",
        ),
    ],
)
def test_unphysical_ports_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PortModel(I2, ONE, ROW, np.array([np.nan])), "damping"),
        (lambda: PortModel(I2, ONE, ROW, np.array([-0.1])), "damping"),
        (lambda: PortModel(np.array([[1.0, 0.5], [0.2, 1.0]]), ONE, ROW), "rigid_mass"),
        (lambda: PortModel(np.diag([-1.0, 1.0]), np.zeros(0), np.zeros((0, 2))), "mass"),
        (lambda: PortModel(np.diag([0.0, 1.0]), np.zeros(0), np.zeros((0, 2))), "mass"),
    ],
    ids=[
        "damping nan",
        "damping negative",
        "rigid mass not symmetric",
        "mass negative",
        "mass zero",
    ],
)
def test_other_nonsense_is_refused_too(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_a_tiny_negative_residual_is_taken_for_rounding():
    PortModel(I2, ONE, np.array([[1.0 + 1e-11, 0.0]]))


def test_a_mass_above_all_others_is_said():
    """Two motions of one far point: in double precision the mass matrix of a port has
    one direction only."""
    far = PortModel(np.array([[1.0, 1e10], [1e10, 1e20]]), ONE, np.array([[0.5, 0.5e10]]))
    with pytest.raises(
        RealisationError, match=r"the rigid mass matrix \(diagonal 1, 1e\+20\) is singular"
    ):
        far.free_frequencies
