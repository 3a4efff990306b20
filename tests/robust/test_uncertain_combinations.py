"""Inputs and outputs that combine actuators and sensors, on an uncertain craft."""

import numpy as np
import pytest

import beamchain as bc
from beamchain import robust
from wheels_and_jets import CRAFT, INPUTS, OUTPUTS, array, off, response

PEAK = 0.02  # of the amplitude in a run of MuJoCo, which lasts until 2 % of a start is left
UNCERTAIN = bc.spec.UncertainCraft(
    body={
        "bus": bc.spec.UncertainBody(
            mass=bc.spec.Uncertainty(relative=0.1, distribution="uniform"),
            centre_x=bc.spec.Uncertainty(absolute=0.05, distribution="uniform"),
        )
    }
)


@pytest.fixture(scope="module")
def made():
    return bc.embed(CRAFT, {"mount": array()})


@pytest.mark.slow
def test_commands_do_not_change_with_an_uncertain_craft(made):
    """A flight computer knows the nominal craft alone: of a sample whose mass centre has moved,
    thrusters share a torque out as before."""
    thrusters = ["t_px", "t_nx", "t_py", "t_ny", "t_pz", "t_nz"]
    inputs = {"couple": bc.allocate(thrusters), "push": {"force:bus": 2.0}}
    plant = bc.plant(made, inputs, OUTPUTS)
    uncertain = robust.uncertain(plant, UNCERTAIN)
    values = {"bus.mass": 320.0, "bus.centre_x": 0.14}
    found = response(uncertain.sample(values))
    changed = uncertain.model(values)
    shares = plant.allocations["couple"].commands
    motors = response(bc.plant(changed, [*thrusters, "force:bus"], OUTPUTS))
    couples = np.einsum("pnk,na->pak", motors[:, :6], shares)
    assert off(found, np.concatenate([couples, 2.0 * motors[:, 6:]], axis=1)) < 1e-7
    # asked anew, the changed craft would have others
    anew = bc.plant(changed, inputs, OUTPUTS).allocations["couple"].torque
    assert not np.allclose(anew, plant.allocations["couple"].torque)


@pytest.mark.slow
def test_the_worst_sample_is_run_with_combined_signals(made):
    """The run applies the allocated torque and reads the turned sensor."""
    loops = [
        bc.spec.Loop(
            input=f"torque_{axis}",
            output=f"attitude_{axis}",
            numerator=(120.0, 20.0),
            denominator=(0.05, 1.0),
        )
        for axis in "xyz"
    ]
    uncertain = robust.uncertain(bc.plant(made, INPUTS, OUTPUTS), UNCERTAIN)
    controller = bc.spec.Controller(loop=tuple(loops))
    worst = uncertain.worst_case(controller, "torque_z", "attitude_z", samples=3)
    assert worst.stable
    assert worst.simulated == pytest.approx(worst.gain, rel=PEAK)
