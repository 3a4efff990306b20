"""Closed forms beside the formulas of a choice of modes."""

import numpy as np
import pytest

from beamchain import PortModel
from formulas import Promise


@pytest.mark.parametrize(("hub", "coupled"), [(1e3, False), (1e-3, True)])
def test_a_heavy_hub_uncouples_what_a_light_one_does_not(hub, coupled):
    # 1e-11 off the diagonal of ones: 1e-14 of a hub of 1e3, 1e-11 of one of 1e-3; 1e-12 couples
    rigid = np.array([[1.0, 1e-11], [1e-11, 1.0]])
    exact = PortModel(rigid, np.array([2.0]), np.array([[0.5, 0.0]]))
    promise = Promise(exact, hub * np.eye(2), [0], 1.0, 0.01)
    assert promise.reaches([0])
    assert promise.reaches([1]) is coupled
