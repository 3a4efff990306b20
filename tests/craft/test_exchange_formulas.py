"""Closed forms beside the formulas of a craft whose appendages are exchanged for a search."""

import mujoco
import numpy as np
import pytest

from beamchain import Linear, PortModel
from beamchain.ports.motions import offset_matrix
from formulas import Exchange

OMEGA = np.array([0.4, 1.9, 3.1])
BUS = """<mujoco><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="20" diaginertia="4 5 6"/></body></worldbody></mujoco>"""


def appendage(mass, frequencies, rows, ratio):
    return PortModel(
        np.diag([mass] * 3 + [0.2 * mass] * 3),
        np.array(frequencies),
        np.array(rows),
        np.full(len(frequencies), ratio),
    )


LEFT = appendage(3.0, [2.0], [[0.0, 1.1, 0.0, 0.0, 0.0, 0.3]], 0.01)
OTHER = appendage(2.5, [1.5, 4.0], [[0.3, 0.9, 0, 0.1, 0, 0.2], [0, 0.2, 0.7, 0, 0.3, 0]], 0.02)
RIGHT = appendage(4.0, [3.0], [[0.0, 0.0, 0.8, 0.0, 0.2, 0.0]], 0.005)


def dynamic_mass(model, w):
    """M - s^2 sum l l^T / (s^2 + 2 z W s + W^2)."""
    out = model.rigid_mass.astype(complex)
    for W, row, z in zip(model.frequencies, model.participation, model.damping, strict=True):
        out += w**2 * np.outer(row, row) / (W**2 - w**2 + 2j * z * W * w)
    return out


def test_an_exchanged_appendage_leaves_the_craft_as_if_it_had_been_there():
    """Two appendages off the centre of a free bus: the inverse of the sum of dynamic masses."""
    craft = Linear.of(mujoco.MjModel.from_xml_string(BUS)).on_body(np.eye(6))
    places = [offset_matrix(np.array(at)) for at in ([0.5, 0.1, 0.0], [-0.4, 0.0, 0.3])]
    exchange = Exchange(craft, [LEFT, RIGHT], places, OMEGA)
    bus = np.diag([20.0, 20.0, 20.0, 4.0, 5.0, 6.0])
    for number, pair in ((0, (OTHER, RIGHT)), (1, (LEFT, OTHER))):
        for w, found in zip(OMEGA, exchange.response(number, OTHER), strict=True):
            whole = bus + sum(
                place.T @ dynamic_mass(model, w) @ place
                for place, model in zip(places, pair, strict=True)
            )
            assert found == pytest.approx(np.linalg.inv(whole), rel=1e-10, abs=1e-12)
