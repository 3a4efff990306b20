"""Least margins of craft on which some motion is left to itself: axes without a loop, momentum of
wheels, nutation. `bc.margins` calls such loops stable, and so does the search for the worst.

The truth is a bus, a wheel that turns and a sprung rotor as four equations of motion, written here.
"""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain import robust
from beamchain.control.controllers import Controller, Loop

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
RANGE = bc.spec.Uncertainty(relative=0.3, distribution="uniform")
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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("axes", "rate"),
    [("z", 40.0), ("xyz", 1.0), ("xy", 300.0)],
)
def test_motion_that_no_loop_touches_is_no_instability(axes, rate):
    model = mujoco.MjModel.from_xml_string(CRAFT)
    rates = {"wheel": rate} if rate else {}
    plant = bc.plant(model, ["torque:bus"], ["attitude"], rates=rates)
    controller = loops(axes)
    assert bc.margins(plant, controller).stable
    uncertain = robust.uncertain(
        plant, bc.spec.UncertainCraft(joint={"drive": bc.spec.UncertainJoint(stiffness=RANGE)})
    )
    found = uncertain.worst_margins(controller, samples=20)
    assert found.stable
    rows = [row for row in found if row.kind == "disk" and row.at.startswith("torque")]
    assert [row.at for row in rows] == [f"torque_{axis}" for axis in axes]
    omega = np.geomspace(1e-3, 100.0, 15_000)
    nominal = disks(axes, rate, STIFFNESS, omega)
    ranged = np.linspace(0.7, 1.3, 11) * STIFFNESS
    least = np.min([disks(axes, rate, k, omega) for k in ranged], axis=0)
    assert [row.nominal for row in rows] == pytest.approx(nominal.tolist(), rel=FOUND)
    assert [row.worst for row in rows] == pytest.approx(least.tolist(), rel=FOUND)


@pytest.mark.slow
def test_a_loop_that_drives_the_craft_away_is_refused_as_before():
    model = mujoco.MjModel.from_xml_string(CRAFT)
    plant = bc.plant(model, ["torque:bus"], ["attitude"], rates={"wheel": 300.0})
    uncertain = robust.uncertain(
        plant, bc.spec.UncertainCraft(joint={"drive": bc.spec.UncertainJoint(stiffness=RANGE)})
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
    with pytest.raises(bc.InputError, match="not stable"):
        uncertain.worst_margins(wrong)


@pytest.mark.slow
def test_a_gain_to_motion_that_no_loop_holds_is_refused_as_before():
    """A torque about z turns the craft about x, where nothing stops it."""
    model = mujoco.MjModel.from_xml_string(CRAFT)
    plant = bc.plant(model, ["torque:bus"], ["attitude"])
    uncertain = robust.uncertain(
        plant, bc.spec.UncertainCraft(joint={"drive": bc.spec.UncertainJoint(stiffness=RANGE)})
    )
    assert uncertain.worst_case(loops("z"), "torque_z", "attitude_z", simulate=False).stable
    with pytest.raises(bc.InputError, match="close loops.*'attitude_x'"):
        uncertain.worst_case(loops("z"), "torque_x", "attitude_x")


@pytest.fixture(scope="module")
def winged():
    """Two booms on sprung drives at 45 and -45 degrees."""
    wings = "".join(
        f"""<body name="{name}" pos="0 {y} 0" xyaxes="0 {turn} 0 {-turn} 0 0">
<joint name="{name}" axis="1 0 0" stiffness="4000" damping="40" springref="{45 * turn}"/>
<inertial pos="0.1 0 0" mass="9" diaginertia="0.4 0.3 0.3"/>
<site name="{name}_wing" pos="0.2 0.02 0.05"/></body>"""
        for name, y, turn in (("north", 0.9, 1), ("south", -0.9, -1))
    )
    craft = f"""<mujoco><option gravity="0 0 0" timestep="0.01"/><worldbody><body name="bus">
<freejoint/><inertial pos="0 0 0" mass="900" diaginertia="500 420 550"/>{wings}
<body name="wheel" pos="0.3 0 -0.4" zaxis="0.8 0 0.6"><joint name="wheel" axis="0 0 1"/>
<inertial pos="0 0 0" mass="5" diaginertia="0.02 0.02 0.025"/></body></body></worldbody></mujoco>"""
    section = bc.Equivalent(bending_stiffness_xy=2e3, bending_stiffness_xz=3e3, linear_mass=4.0)
    boom = bc.Spec(
        name="boom",
        segment=(bc.Segment(length=6.0, section=section),),
        modes=bc.Modes(xy=1, xz=1),
        damping=bc.Damping(ratio=0.005),
        fit=bc.spec.FitOptions(springs="modes"),
    )
    return bc.embed(craft, {"north_wing": boom, "south_wing": boom}, retime=False)


@pytest.mark.slow
def test_flexible_craft_in_a_pose_keep_their_margins(winged):
    """Every least disk margin is the one that `bc.margins` states at its values."""
    pose = {"north": np.pi / 4.0, "south": -np.pi / 4.0}
    plant = bc.plant(winged, ["torque:bus"], ["attitude"], pose=pose, rates={"wheel": 1.0})
    scaled = Controller(
        loop=tuple(
            Loop(
                input=one.input,
                output=one.output,
                numerator=(400.0, 60.0),
                denominator=(0.05, 1.0),
            )
            for one in loops("xz").loop
        )
    )
    known = bc.margins(plant, scaled)
    assert known.stable
    uncertain = robust.uncertain(
        plant,
        bc.spec.UncertainCraft(
            body={"bus": bc.spec.UncertainBody(inertia_zz=bc.spec.Uncertainty(relative=0.05))}
        ),
    )
    found = uncertain.worst_margins(scaled, samples=2)
    rows = [row for row in found if row.kind == "disk" and row.at.startswith("torque")]
    for i, row in enumerate(rows):
        assert row.nominal == pytest.approx(known.loops[i].disk, rel=1e-6)
        again = bc.margins(uncertain.sample(row.values), scaled)
        assert row.worst == pytest.approx(again.loops[i].disk, rel=1e-6)
        assert row.worst < row.nominal
    # loops of different axes hardly couple: all at once are as good as the worst, but for rounding
    assert found.all_at_once.nominal == pytest.approx(known.all_at_once.value, rel=1e-6)
    for kind in ("nominal", "worst"):
        least = min(getattr(row, kind) for row in rows)
        assert getattr(found.all_at_once, kind) <= least * (1.0 + 1e-9)
