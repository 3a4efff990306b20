"""Uncertain plants can be pickled, and say the same afterwards."""

import pickle

import numpy as np
import pytest

import beamchain as bc
from beamchain import robust
from plant_truth import embedded

OMEGA = np.geomspace(0.1, 50.0, 20)


def pickled(value):
    return pickle.loads(pickle.dumps(value))


@pytest.mark.slow
def test_an_uncertain_plant_travels(tmp_path):
    """Also one of a plant that has travelled itself."""
    other = pickled(bc.plant(embedded("a boom on a damped drive"), ["torque:hub"], ["attitude"]))
    (tmp_path / "uncertain.toml").write_text("[body.hub]\nmass = { relative = 0.1 }\n")
    uncertain = robust.uncertain(other, tmp_path / "uncertain.toml")
    again = pickled(uncertain)
    values = {"hub.mass": 95.0}
    np.testing.assert_array_equal(
        again.sample(values)(1j * OMEGA), uncertain.sample(values)(1j * OMEGA)
    )
    np.testing.assert_array_equal(again.nominal(1j * OMEGA), uncertain.nominal(1j * OMEGA))
