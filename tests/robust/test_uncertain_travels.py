"""Uncertain plants can be pickled, and say the same afterwards."""

import pickle

import mujoco
import numpy as np

import beamchain as bc
from beamchain import robust
from posed import CRAFT

OMEGA = np.geomspace(0.1, 50.0, 20)


def pickled(value):
    return pickle.loads(pickle.dumps(value))


def test_an_uncertain_plant_travels():
    """Also one of a plant that has travelled itself."""
    model = mujoco.MjModel.from_xml_string(CRAFT)
    other = pickled(bc.plant(model, ["torque:bus"], ["attitude"]))
    mass = bc.spec.UncertainBody(mass=bc.spec.Uncertainty(relative=0.1))
    uncertain = robust.uncertain(other, bc.spec.UncertainCraft(body={"bus": mass}))
    again = pickled(uncertain)
    values = {"bus.mass": 1.05 * uncertain.values(np.zeros(1))["bus.mass"]}
    np.testing.assert_array_equal(
        again.sample(values)(1j * OMEGA), uncertain.sample(values)(1j * OMEGA)
    )
    np.testing.assert_array_equal(again.nominal(1j * OMEGA), uncertain.nominal(1j * OMEGA))
