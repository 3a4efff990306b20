"""`bc.Linear`: M, D, K, inputs and outputs of a model at a pose, against closed forms and against
MuJoCo's own `mjd_transitionFD`."""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from appendages import close

EXACT = 1e-12  # five-point differences of linear forces: rounding
FINITE = 1e-7  # mjd_transitionFD, two points at 1e-6, relative to the largest entry
RESPONSE = 1e-11  # one solve per frequency

# two sliders in a row between springs, the second with a damper, a force on it, and its travel
SLIDERS = """<mujoco><worldbody><body name="a"><joint name="x" type="slide" axis="1 0 0"
stiffness="30"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><body name="b">
<joint name="y" type="slide" axis="1 0 0" stiffness="50" damping="0.7"/>
<inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/></body></body></worldbody>
<actuator><motor name="push" joint="y"/></actuator>
<sensor><jointpos name="travel" joint="y"/><jointvel name="speed" joint="y"/></sensor></mujoco>"""
# a hub with a wheel that turns about its x axis
WHEEL = """<mujoco><worldbody><body name="hub"><freejoint/>
<inertial pos="0 0 0" mass="40" diaginertia="5 6 7"/><body name="rotor">
<joint name="wheel" axis="1 0 0"/><inertial pos="0 0 0" mass="2" diaginertia="0.3 0.2 0.2"/>
</body></body></worldbody><actuator><motor name="spin" joint="wheel"/></actuator></mujoco>"""


def written_out():
    """M, D, K of `SLIDERS`; y is relative to x."""
    mass = np.array([[5.0, 3.0], [3.0, 3.0]])
    return mass, np.diag([0.0, 0.7]), np.diag([30.0, 50.0])


def test_two_sliders_have_their_matrices():
    linear = bc.Linear.of(SLIDERS)
    for found, wanted in zip(
        (linear.mass, linear.damping, linear.stiffness), written_out(), strict=True
    ):
        assert found == close(wanted, abs=EXACT * 50.0)
    assert [signal.name for signal in linear.coordinates] == ["x", "y"]
    assert not linear.mass.flags.writeable


def test_response_and_first_order_are_those_of_the_equations():
    linear = bc.Linear.of(SLIDERS, inputs=["push"], outputs=["travel", "speed"])
    mass, damping, stiffness = written_out()
    omega = np.array([0.5, 3.0, 20.0])
    wanted = []
    for w in omega:
        x = np.linalg.solve(stiffness + 1j * w * damping - w**2 * mass, np.array([0.0, 1.0]))
        wanted.append([x[1], 1j * w * x[1]])
    wanted = np.array(wanted).T[:, None, :]
    found = linear.response(omega)
    assert found.shape == (2, 1, 3)
    assert np.abs(found - wanted).max() < RESPONSE * np.abs(wanted).max()
    a, b, c, d = linear.first_order()
    states = [c @ np.linalg.solve(1j * w * np.eye(4) - a, b) + d for w in omega]
    assert np.abs(np.moveaxis(states, 0, -1) - wanted).max() < RESPONSE * np.abs(wanted).max()
    assert [tuple(signal) for signal in linear.outputs.signals] == [
        ("travel", "m"),
        ("speed", "m/s"),
    ]
    assert [tuple(signal) for signal in linear.inputs.signals] == [("push", "N")]


def test_modes_are_those_of_the_characteristic_polynomial():
    # det(K - w^2 M) = 6 w^4 - 340 w^2 + 1500
    mass, _, stiffness = written_out()
    wanted = np.sqrt(np.sort(np.roots([6.0, -340.0, 1500.0])))
    modes = bc.Linear.of(SLIDERS).modes()
    assert modes.frequency == close(wanted, rel=EXACT)
    assert modes.shapes.T @ mass @ modes.shapes == close(np.eye(2), abs=EXACT)
    assert modes.shapes.T @ stiffness @ modes.shapes == close(
        np.diag(wanted**2), abs=EXACT * wanted[-1] ** 2
    )


def test_a_turning_wheel_adds_its_gyroscopic_moment():
    speed = 200.0
    still = bc.Linear.of(WHEEL)
    turning = bc.Linear.of(WHEEL, rates={"wheel": speed})
    assert np.abs(still.damping).max() == 0.0
    momentum = 0.3 * speed
    # moment w x h on the hub for a rate w, h along x: D w = w x h
    wanted = np.zeros((7, 7))
    wanted[4, 5] = momentum
    wanted[5, 4] = -momentum
    assert turning.damping == close(wanted, abs=EXACT * momentum)
    assert np.array_equal(turning.stiffness, np.zeros((7, 7)))


@pytest.mark.slow
def test_mujocos_own_linearisation_proves_it():
    angle = 0.6
    spec = bc.Spec(
        segment=(
            bc.Segment(
                length=4.0, section=bc.Equivalent(bending_stiffness_xy=300.0, linear_mass=2.0)
            ),
        )
    )
    craft = """<mujoco><worldbody><body name="bus"><freejoint/>
    <inertial pos="0 0 0" mass="60" diaginertia="9 8 7"/><body name="arm" pos="0.5 0 0">
    <joint name="drive" axis="0 0 1" stiffness="40" damping="0.5"/>
    <inertial pos="0.1 0 0" mass="3" diaginertia="0.1 0.1 0.1"/><site name="mount" pos="0.2 0 0"/>
    </body></body></worldbody></mujoco>"""
    model = bc.embed(craft, {"mount": spec}).model
    model.qpos_spring[model.joint("drive").qposadr[0]] = angle
    linear = bc.Linear.of(model, pose={"drive": angle})
    data = mujoco.MjData(model)
    data.qpos[model.joint("drive").qposadr[0]] = angle
    proof = bc.linearise(model, data)
    for ours, theirs in (
        (np.linalg.solve(linear.mass, linear.stiffness), proof.stiffness),
        (np.linalg.solve(linear.mass, linear.damping), proof.damping),
    ):
        assert ours == close(theirs, abs=FINITE * np.abs(theirs).max())
