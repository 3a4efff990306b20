"""Plants, fits and embedded craft can be pickled and copied, and say the same afterwards."""

import copy
import pickle
from importlib.resources import files

import numpy as np
import pytest

import beamchain as bc
from plant_truth import CRAFTS, embedded, wheel_rates

NAME = "a boom on a damped drive"
ROUNDING = 1e-12
OMEGA = np.geomspace(0.1, 50.0, 20)


@pytest.fixture(scope="module")
def made():
    return embedded(NAME)


def pickled(value):
    return pickle.loads(pickle.dumps(value))


@pytest.mark.parametrize("travel", [pickled, copy.deepcopy, copy.copy])
@pytest.mark.parametrize("discrete", [None, 0.01])
def test_a_plant_says_the_same_afterwards(made, travel, discrete):
    inputs = ["torque:hub", "drive_motor"]
    outputs = ["attitude", "rate", "motion:unit", "gyro", "star"]
    rates = wheel_rates(CRAFTS[NAME])
    plant = bc.plant(made, inputs, outputs, {}, rates=rates, discrete=discrete)
    other = travel(plant)
    at = np.exp(1j * OMEGA * 0.01) if discrete else 1j * OMEGA
    np.testing.assert_array_equal(other(at, squeeze=False), plant(at, squeeze=False))
    assert (other.input_labels, other.output_labels, other.modes) == (
        plant.input_labels,
        plant.output_labels,
        plant.modes,
    )
    assert repr(other) == repr(plant)
    np.testing.assert_array_equal(other.gain, plant.gain)
    assert not other.A.flags.writeable
    state = np.ones(plant.nstates)
    drive = np.ones(plant.ninputs)
    np.testing.assert_array_equal(
        other.dynamics(0.0, state, drive), plant.dynamics(0.0, state, drive)
    )


def test_what_a_plant_carries_travels_too(made):
    """The exact plant."""
    plant = bc.plant(made, ["torque:hub"], ["attitude"])
    other = pickled(plant)
    assert other.truncation(OMEGA) == pytest.approx(
        plant.truncation(OMEGA), rel=ROUNDING, abs=ROUNDING
    )


@pytest.mark.slow
def test_an_embedded_craft_and_its_fits_travel(made):
    other = pickled(made)
    assert other.to_mjcf() == made.to_mjcf()
    assert other.craft_error == made.craft_error
    fit = made.appendages[0].fit
    assert pickled(fit).to_mjcf() == fit.to_mjcf()
    assert copy.deepcopy(fit).scene_mjcf() == fit.scene_mjcf()


@pytest.mark.slow
def test_a_tree_travels_whatever_was_computed_of_it(tmp_path):
    """Its exact poses hold responses; so do those under a load."""
    shipped = files("beamchain") / "examples"
    places = {"shoulder": shipped / "upper.toml", "forearm": shipped / "fore.toml"}
    arm = bc.embed(shipped / "arm.xml", places, retime=False)
    for name in ("assembly", "promise", "composite"):
        getattr(arm, name)
    arm.modes_at("square")
    other = pickled(arm)
    assert other.promise.poses == arm.promise.poses
    assert other.headline == arm.headline
    plant = bc.plant(arm, ["elbow_motor"], ["attitude"], pose="square")
    np.testing.assert_array_equal(pickled(plant).truncation(OMEGA), plant.truncation(OMEGA))
