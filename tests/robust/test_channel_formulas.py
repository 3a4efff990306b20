"""Closed forms beside channels of uncertain quantities."""

import mujoco
import numpy as np
import pytest

from beamchain.engine.linear import Linear
from beamchain.robust.delta_channels import Channels
from formulas import Quantity, linear_craft
from robust_doors import channels_of_craft

SPUN = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint name="free"/>
<inertial pos="0.1 0 0.05" mass="50" diaginertia="9 8 7"/>
<body name="rotor" pos="0.2 -0.1 0.4" euler="20 35 0"><joint name="rw" axis="0 0 1" damping="0.01"/>
<inertial pos="0 0 0" mass="5" diaginertia="0.1 0.1 0.2"/></body>
<body name="panel" pos="0 1 0"><joint name="drive" axis="0 1 0" stiffness="60" damping="0.9"/>
<inertial pos="0.2 0 0" mass="4" diaginertia="0.4 0.6 0.7"/></body></body></worldbody>
<sensor><subtreeangmom name="momentum" body="bus"/></sensor></mujoco>"""


def test_channels_act_as_changes_of_the_equations_of_motion():
    """M q'' + D q' + K q = B u + sum of f w, w = delta z, z of motion, inputs and other w."""
    random = np.random.default_rng(6)
    model = mujoco.MjModel.from_xml_string(SPUN)
    linear = Linear.of(model, ["torque:bus"], ["attitude"])
    nv, m = model.nv, 3
    made = Channels(nv, m)
    rows = [
        {word: random.normal(size=nv) for word in ("position", "rate", "acceleration")}
        | {"input": random.normal(size=m)}
        for _ in range(3)
    ]
    forces = random.normal(size=(3, nv))
    assert made.add(1, forces[0], **rows[0]) == 0
    assert made.add(0, forces[1], {0: 0.7}, feedback=-0.4, **rows[1]) == 1
    assert made.add(1, forces[2], {0: 0.2, 1: -1.1}, rate=rows[2]["rate"]) == 2
    assert made.of == [1, 0, 1]
    rows[2] = {"rate": rows[2]["rate"]}
    order, reach = [2, 0, 1], np.array([0.5, 2.0, 0.3])
    wider = made.add_to(linear, order, reach)
    a, b, c, d = wider.first_order()
    s = 0.3 + 1.7j
    found = c @ np.linalg.solve(s * np.eye(len(a)) - a, b) + d
    through = np.array([[0, 0, 0], [0.7, -0.4, 0], [0.2, -1.1, 0]])
    zero = np.zeros(nv)
    powers = {"position": 1.0, "rate": s, "acceleration": s**2}
    motion = np.array([sum(powers[k] * row.get(k, zero) for k in powers) for row in rows])
    direct = np.array([row.get("input", np.zeros(m)) for row in rows])
    inverse = np.linalg.inv(s**2 * linear.mass + s * linear.damping + linear.stiffness)
    # channels in their order, then the plant's own inputs and outputs
    pushed = np.hstack([forces.T, linear.inputs.force])
    q = inverse @ pushed
    z = motion @ q + np.hstack([through, direct])
    y = (linear.outputs.position + s * linear.outputs.rate + s**2 * linear.outputs.acceleration) @ q
    y[:, 3:] += linear.outputs.feedthrough
    wanted = np.vstack([(reach[:, None] * z)[order], y])[:, [*order, 3, 4, 5]]
    np.testing.assert_allclose(found, wanted, rtol=1e-8, atol=1e-10)
    assert [signal.name for signal in wider.inputs.signals[:3]] == ["w1", "w2", "w3"]
    assert [signal.name for signal in wider.outputs.signals[:3]] == ["z1", "z2", "z3"]


def closed_with(craft, kind, index, delta):
    """From the inputs to the outputs of a craft, `w = delta z` in all channels of one quantity."""
    made = channels_of_craft(craft, [Quantity(f"one.{kind}", "", 1.0, None, index, "one")])
    n = len(made.of)
    a, b, c, d = made.add_to(craft.linear, range(n), np.ones(n)).first_order()
    s = 0.2 + 1.7j
    g = c @ np.linalg.solve(s * np.eye(len(a)) - a, b) + d
    inner = np.linalg.solve(np.eye(n) - delta * g[:n, :n], delta * g[:n, n:])
    return g[n:, n:] + g[n:, :n] @ inner


SLIDES = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="x" type="slide"
axis="1 0 0" stiffness="5"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/>
<body><joint name="y" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="4"
diaginertia="1 1 1"/></body></body></worldbody>
<tendon><fixed name="one" stiffness="9" damping="0.6"><joint joint="x" coef="0.7"/>
<joint joint="y" coef="1.4"/></fixed></tendon>
<actuator><motor name="u" joint="x"/><motor name="v" joint="y"/></actuator>
<sensor><jointpos name="at" joint="x"/><jointpos name="in" joint="y"/></sensor></mujoco>"""


def test_a_participation_divides_what_a_mode_gives_back_by_its_square():
    """E = eta'' + 0.6 eta' + 9 eta along 0.7 x + 1.4 y, of which p = 1.25 leaves E / p^2."""
    model = mujoco.MjModel.from_xml_string(SLIDES)
    craft = linear_craft(model, None, None, ["u", "v"], ["at", "in"])
    s, line = 0.2 + 1.7j, np.array([0.7, 1.4])
    rest = s**2 * np.array([[6.0, 4.0], [4.0, 4.0]]) + np.diag([5.0, 0.0])
    rest += np.outer(line, line) * (0.6 * s + 9.0)
    rest += np.outer(line, line) * (1.0 / 1.25**2 - 1.0) * (s**2 + 0.6 * s + 9.0)
    found = closed_with(craft, "participation", 0, 0.25)
    np.testing.assert_allclose(found, np.linalg.inv(rest), rtol=1e-9)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_mass_centre_moves_as_that_of_a_body_whose_frame_moves(axis):
    """The panel's by 0.03 m along one of its axes: M of MuJoCo, from a torque to the attitude."""
    model = mujoco.MjModel.from_xml_string(SPUN)
    craft = linear_craft(model, None, None, ["torque:bus"], ["attitude"])
    found = closed_with(craft, f"centre_{'xyz'[axis]}", model.body("panel").id, 0.03)
    model.body("panel").ipos[axis] += 0.03
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    for row, unit in zip(mass, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, row, unit)
    s = 0.2 + 1.7j
    rest = s**2 * mass + s * np.diag(model.dof_damping)
    rest += np.diag([*np.zeros(7), 60.0])
    np.testing.assert_allclose(found, np.linalg.inv(rest)[3:6, 3:6], rtol=1e-7, atol=1e-12)
