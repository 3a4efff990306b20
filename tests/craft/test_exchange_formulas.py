"""Closed forms beside the formulas of a craft whose appendages are exchanged for a search."""

import mujoco
import numpy as np
import pytest

from beamchain import Linear, PortModel
from beamchain.ports.motions import offset_matrix
from formulas import Exchange, PortLoads, rigid_body

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


# -- what ports carry ------------------------------------------------------------------------------
def moved(x, y, z):
    """Motion of a point by that of the origin, v - r x w."""
    out = np.eye(6)
    out[:3, 3:] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    return out


BODY = np.diag([20.0, 20.0, 20.0, 4.0, 5.0, 6.0])  # of the bus
HAND = np.diag([2.0, 2.0, 2.0, 0.3, 0.2, 0.4])
PALM = np.diag([1.5, 1.5, 1.5, 0.1, 0.2, 0.2])
TURN = np.kron(np.eye(2), [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
# the inner boom stands on the bus, a hand on its first port and the outer boom, turned, on its
# second; a palm on that of the outer boom; and a boom that carries nothing on the bus
INNER, AT_HAND, AT_OUTER = moved(0.5, 0.1, 0.0), moved(2.5, 0.1, 0.0), moved(1.5, 0.1, 0.0)
AT_PALM, SIDE = moved(1.2, 0.0, 0.1), moved(-0.4, 0.0, 0.3)


def on_ports(model, seed, *points):
    tip = np.random.default_rng(seed).normal(size=(model.modes, 6 * len(points)))
    return model.replaced(tip=tip, points=points)


def accelerance(inner, outer, side, w):
    """The bus, by all modes for coordinates: the inverse of M + C / s + K / s^2."""
    models = inner, outer, side
    counts = [6, *(model.modes for model in models)]
    bus, *modes = np.split(np.eye(sum(counts)), np.cumsum(counts)[:-1])
    inner_tip, outer_tip = (
        np.zeros((0, size)) if model.tip is None else model.tip
        for model, size in ((inner, 12), (outer, 6))
    )
    hand = AT_HAND @ bus + inner_tip[:, :6].T @ modes[0]
    far = TURN @ (AT_OUTER @ bus + inner_tip[:, 6:].T @ modes[0])
    palm = AT_PALM @ far + outer_tip.T @ modes[1]
    bodies = (bus, BODY), (hand, HAND), (palm, PALM)
    dynamic = sum(motion.T @ mass @ motion for motion, mass in bodies).astype(complex)
    roots = INNER @ bus, far, SIDE @ bus
    s = 1j * w
    for model, root, by_mode in zip(models, roots, modes, strict=True):
        pushed = by_mode.T @ model.participation @ root
        spring = 1.0 + 2.0 * model.damping * model.frequencies / s + (model.frequencies / s) ** 2
        dynamic += root.T @ model.rigid_mass @ root + pushed + pushed.T
        dynamic += by_mode.T @ np.diag(spring) @ by_mode
    return np.linalg.inv(dynamic)[:6, :6]


def test_an_exchanged_boom_of_a_tree_leaves_it_as_if_it_had_been_there():
    """Booms that carry bodies and each other: an exact inner, outer or other one is exchanged, also
    for one that is rigid."""
    one, zero = np.eye(6), np.zeros((6, 6))
    # by the motion of the bus and of the three ports
    by_hand = np.hstack([AT_HAND, one, zero, zero])
    far = TURN @ np.hstack([AT_OUTER, zero, one, zero])
    by_palm = AT_PALM @ far + np.hstack([zero, zero, zero, one])
    mass = by_hand.T @ HAND @ by_hand + by_palm.T @ PALM @ by_palm
    whole = BODY + mass[:6, :6]
    mass[:6, :6] = 0.0
    roots = np.hstack([INNER, zero, zero, zero]), far, np.hstack([SIDE, zero, zero, zero])
    carrying = PortLoads(roots, mass, ((0, 2.0), (0, 1.0), (1, 1.2)))
    exact = on_ports(OTHER, 1, 2.0, 1.0), on_ports(LEFT, 2, 1.2), RIGHT
    exchange = Exchange(rigid_body(whole), exact, [], OMEGA, carrying)
    rigid = appendage(2.0, [], np.zeros((0, 6)), 0.0)
    for number, others in (
        (0, (exact[0], on_ports(RIGHT, 3, 2.0, 1.0), rigid)),
        (1, (on_ports(OTHER, 4, 1.2), rigid)),
        (2, (OTHER, rigid)),
    ):
        for other in others:
            models = [*exact[:number], other, *exact[number + 1 :]]
            for w, found in zip(OMEGA, exchange.response(number, other), strict=True):
                wanted = accelerance(*models, w)
                assert found == pytest.approx(wanted, rel=1e-10, abs=1e-12)
