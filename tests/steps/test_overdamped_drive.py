"""A tree with an overdamped drive, whose wheel turns: what damps the drive leaves fewer oscillators
than modes, and the craft's slow nutation is none of them.

Against the compiled file, differenced here with numpy: accelerations that MuJoCo returns.
"""

import numpy as np
import pytest

import beamchain as bc
from overdamped_drive import Truth, made

RATE = 9.0  # of the wheel [rad/s]
CLOSE = 1e-5  # of a response


@pytest.fixture(scope="module", params=["in memory", "from a file"])
def craft(request, tmp_path_factory):
    return made(request.param, tmp_path_factory.mktemp("tree"))


@pytest.mark.slow
def test_the_plant_with_its_wheel_at_speed(craft):
    plant = bc.plant(craft, ["torque:bus"], ["attitude"], rates={"rw": RATE})
    truth = Truth(craft, RATE)
    poles = np.linalg.eigvals(truth.matrix)
    nutation = poles.imag[poles.imag > 1e-3].min()
    assert nutation < 0.1 * plant.frequency.min()
    assert np.sum((np.abs(poles.imag) < 1e-6) & (np.abs(poles) > 1e-3)) == 2  # of the drive
    for omega in (0.5, 3.0, 8.0, 20.0):
        found = plant(1j * omega)
        for axis in range(3):
            wrench = np.concatenate([np.zeros(3), np.eye(3)[axis]])
            wanted = truth.attitude(truth.pushed("bus", wrench), omega)
            assert np.allclose(found[:, axis], wanted, rtol=0.0, atol=CLOSE * np.abs(wanted).max())


@pytest.mark.slow
def test_a_wrong_joint_lists_the_spacecrafts_own(craft):
    with pytest.raises(bc.InputError, match=r"'gimbal'.* from rw, drive\.$"):
        bc.plant(craft, rates={"gimbal": RATE})
