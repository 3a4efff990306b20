"""Least margins of craft on which some motion is left to itself: axes without a loop, momentum of
wheels, nutation. `bc.margins` calls such loops stable, and so does the search for the worst.

The truth is a bus, a wheel that turns and a sprung rotor as four equations of motion, written here.
"""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.plants.controllers import Controller, Loop

BUS = np.array([[9.0, 0.4, 1.1], [0.4, 11.0, -0.7], [1.1, -0.7, 7.0]])
WHEEL = np.diag([0.05, 0.03, 0.03])  # about its axis, which is x
ROTOR = np.diag([1.0, 1.2, 2.0])
AXIS = np.array([0.28, 0.0, 0.96])  # of the rotor's hinge
STIFFNESS, DAMPING = 12.0, 0.04
CRAFT = f"""<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="100" fullinertia="9 11 7 0.4 1.1 -0.7"/>
<body name="wheel"><joint name="wheel" axis="1 0 0"/>
<inertial pos="0 0 0" mass="2" diaginertia="0.05 0.03 0.03"/></body>
<body name="rotor"><joint name="drive" axis="0.28 0 0.96" stiffness="{STIFFNESS}"
 damping="{DAMPING}"/><inertial pos="0 0 0" mass="5" diaginertia="1 1.2 2"/></body>
</body></worldbody></mujoco>"""
LAW = [12.0, 4.0], [0.1, 1.0]
RANGE = bc.Uncertainty(relative=0.3, distribution="uniform")
FOUND = 1e-4  # relative, of the least on a grid of frequencies and values


def loops(axes):
    return Controller(
        loop=tuple(
            Loop(
                input=f"torque_{axis}",
                output=f"attitude_{axis}",
                numerator=tuple(LAW[0]),
                denominator=tuple(LAW[1]),
            )
            for axis in axes
        )
    )


def disks(axes, rate, stiffness, omega):
    """`(axes,)` disk margins: `M q'' + D q' + K q = torque`, q the bus's turn and the rotor's."""
    s = 1j * omega[:, None, None]
    mass = np.zeros((4, 4))
    # the wheel turns freely about its axis, so that the bus does not feel its inertia there
    mass[:3, :3] = BUS + ROTOR + WHEEL - WHEEL[0, 0] * np.diag([1.0, 0.0, 0.0])
    mass[:3, 3] = mass[3, :3] = ROTOR @ AXIS
    mass[3, 3] = AXIS @ ROTOR @ AXIS
    rates = np.diag([0.0, 0.0, 0.0, DAMPING])
    # omega x h = h (0, omega_z, -omega_y)
    rates[1, 2], rates[2, 1] = WHEEL[0, 0] * rate, -WHEEL[0, 0] * rate
    springs = np.diag([0.0, 0.0, 0.0, stiffness])
    driven = ["xyz".index(axis) for axis in axes]
    plant = np.linalg.inv(s**2 * mass + s * rates + springs)[:, driven][:, :, driven]
    law = np.polyval(LAW[0], s) / np.polyval(LAW[1], s)
    sensitivity = np.linalg.inv(np.eye(len(axes)) + law * plant)
    at = np.arange(len(axes))
    return 1.0 / np.abs(sensitivity[:, at, at] - 0.5).max(axis=0)


@pytest.mark.parametrize(
    ("axes", "rate"),
    [("z", 0.0), ("z", 40.0), ("xyz", 1.0), ("xyz", 300.0), ("xy", 300.0)],
)
def test_motion_that_no_loop_touches_is_no_instability(axes, rate):
    model = mujoco.MjModel.from_xml_string(CRAFT)
    rates = {"wheel": rate} if rate else {}
    plant = bc.plant(model, ["torque:bus"], ["attitude"], rates=rates)
    controller = loops(axes)
    assert bc.margins(plant, controller).stable
    uncertain = plant.uncertain(
        bc.UncertainCraft(joint={"drive": bc.UncertainJoint(stiffness=RANGE)})
    )
    found = uncertain.worst_margins(controller, samples=50)
    assert found.stable
    rows = [row for row in found if row.kind == "disk" and row.at.startswith("torque")]
    assert [row.at for row in rows] == [f"torque_{axis}" for axis in axes]
    omega = np.geomspace(1e-3, 100.0, 40_000)
    nominal = disks(axes, rate, STIFFNESS, omega)
    ranged = np.linspace(0.7, 1.3, 31) * STIFFNESS
    least = np.min([disks(axes, rate, k, omega) for k in ranged], axis=0)
    assert [row.nominal for row in rows] == pytest.approx(nominal.tolist(), rel=FOUND)
    assert [row.worst for row in rows] == pytest.approx(least.tolist(), rel=FOUND)


def test_a_loop_that_drives_the_craft_away_is_refused_as_before():
    model = mujoco.MjModel.from_xml_string(CRAFT)
    plant = bc.plant(model, ["torque:bus"], ["attitude"], rates={"wheel": 300.0})
    uncertain = plant.uncertain(
        bc.UncertainCraft(joint={"drive": bc.UncertainJoint(stiffness=RANGE)})
    )
    wrong = Controller(
        loop=(
            Loop(
                input="torque_x",
                output="attitude_x",
                numerator=(-12.0, -4.0),
                denominator=(0.1, 1.0),
            ),
        )
    )
    assert not bc.margins(plant, wrong).stable
    with pytest.raises(bc.InputError, match="nominal plant is not stable"):
        uncertain.worst_margins(wrong)


def test_a_gain_to_motion_that_no_loop_holds_is_refused_as_before():
    """A torque about z turns the craft about x, where nothing stops it."""
    model = mujoco.MjModel.from_xml_string(CRAFT)
    plant = bc.plant(model, ["torque:bus"], ["attitude"])
    uncertain = plant.uncertain(
        bc.UncertainCraft(joint={"drive": bc.UncertainJoint(stiffness=RANGE)})
    )
    assert uncertain.worst_case(loops("z"), "torque_z", "attitude_z", simulate=False).stable
    with pytest.raises(bc.InputError, match="close loops that hold all that 'attitude_x' shows"):
        uncertain.worst_case(loops("z"), "torque_x", "attitude_x")
