"""Closed forms beside torque distributed over actuators."""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from formulas import (
    Allocated,
    allocated,
    inverse_of_torques,
    largest_torque,
    null_directions,
    torque_of_actuator,
    torques_of_allocation,
)

CRAFT = """<mujoco><worldbody><body name="bus" pos="1 2 3" euler=".3 -.5 .9"><freejoint/>
<inertial pos=".4 -.2 .1" mass="20" diaginertia="4 5 6"/><site name="jet" pos=".7 -.3 .5"
euler=".4 .2 -.7"/>
<body name="rotor"><joint name="wheel" axis="1 2 -2"/><inertial pos="0 0 0" mass="1"
diaginertia=".1 .1 .1"/><site name="on" pos=".1 0 0"/></body>
<body name="panel"><joint name="drive" axis="0 0 1"/><joint name="tilt" axis="0 1 0"/>
<inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/><body name="far"><joint name="away"/>
<inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/></body></body>
<body name="rail"><joint name="slide" type="slide"/><inertial pos="0 0 0" mass="1"
diaginertia=".1 .1 .1"/></body></body></worldbody><actuator>
<motor name="spin" joint="wheel" gear="3"/><general name="strong" joint="wheel" gainprm="2"/>
<general name="jet" site="jet" gear="1 -2 .5 .3 .7 -.4" gainprm="1.5"/>
<motor name="beside" site="on" refsite="jet" gear="0 0 0 1 0 0"/>
<motor name="on" site="on" gear="0 0 0 1 0 0"/><motor name="drive" joint="drive"/>
<motor name="away" joint="away"/><motor name="slide" joint="slide"/>
<position name="servo" joint="wheel" kp="3"/><intvelocity name="slow" joint="wheel" kp="3"
actrange="-1 1"/><damper name="damper" joint="wheel" kv="1" ctrlrange="0 1"/>
<general name="spring" joint="wheel" biastype="affine" biasprm="5 0 0"/>
<general name="rate" joint="wheel" biastype="affine" biasprm="0 0 -2"/></actuator></mujoco>"""


def craft():
    model = mujoco.MjModel.from_xml_string(CRAFT)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def torque(name):
    model, data = craft()
    return torque_of_actuator(
        model, data, "allocation", model.actuator(name).id, model.body("bus").id
    )


def test_a_wheel_turns_the_body_the_other_way():
    axis = np.array([1.0, 2.0, -2.0]) / 3.0
    assert torque("spin") == pytest.approx(-3.0 * axis, abs=1e-14)
    assert torque("strong") == pytest.approx(-2.0 * axis, abs=1e-14)
    assert torque("spring") == pytest.approx(
        -axis, abs=1e-14
    )  # a constant beside it does not count


def test_a_jet_turns_the_body_by_its_torque_and_its_arm():
    _, data = craft()
    frame, turn = data.body("bus").xmat.reshape(3, 3), data.site("jet").xmat.reshape(3, 3)
    inside = frame.T @ turn
    arm = np.array([0.3, -0.1, 0.4])  # from the mass centre
    wanted = inside @ [0.3, 0.7, -0.4] + np.cross(arm, inside @ [1.0, -2.0, 0.5])
    assert torque("jet") == pytest.approx(1.5 * wanted, abs=1e-13)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("on", "site 'on', which is not on 'bus'"),
        ("beside", "acts neither on a hinge nor at a site"),
        ("drive", "not the only hinge of its body"),
        ("slide", "not the only hinge of its body"),
        ("away", "turns 'far', which does not hang on 'bus'"),
        *((name, "takes no torque or force") for name in ("servo", "slow", "damper", "rate")),
    ],
)
def test_what_gives_the_body_no_torque_is_refused(name, why):
    with pytest.raises(bc.InputError, match=why):
        torque(name)


WHEELS = np.array([[1.0, 0.0, 0.0, 0.6], [0.0, 2.0, 0.0, 0.6], [0.0, 0.0, -4.0, 0.4]])
SOME = bc.allocate(["a", "b", "c", "d"])


def test_commands_have_the_least_sum_of_squares():
    found = inverse_of_torques(WHEELS, SOME, "here", "bus")
    assert found == pytest.approx(WHEELS.T @ np.linalg.inv(WHEELS @ WHEELS.T), rel=1e-12)
    two = bc.allocate(["a", "b"], about="xz")
    # about x and z by wheels that have none about y
    turned = np.array([[1.0, 2.0], [0.0, 0.0], [-1.0, 3.0]])
    found = inverse_of_torques(turned, two, "here", "bus")
    assert turned @ found == pytest.approx(np.eye(3)[:, [0, 2]], abs=1e-12)
    with pytest.raises(bc.InputError, match=r"in 2 of 3 directions, and not about y alone.*\"xz\""):
        inverse_of_torques(turned, bc.allocate(["a", "b"]), "here", "bus")
    # torque about y is only had with torque about x
    with pytest.raises(bc.InputError, match=r"in 2 of 3 .* x, y alone.*about = \"z\""):
        inverse_of_torques(
            np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 5.0]]), bc.allocate(["a", "b"]), "h", "bus"
        )


def test_directions_without_torque_are_those_of_the_fewest():
    """1, 2 and -4 N m about x, y, z and a fourth of (0.6, 0.6, 0.4): by (-0.6, -0.3, 0.1) of the
    first three and 1 of the fourth."""
    (only,) = null_directions(WHEELS, ("a", "b", "c", "d"))
    shares = np.array(list(only.values()))
    assert list(only) == ["a", "b", "c", "d"]
    assert shares == pytest.approx(np.array([-0.6, -0.3, 0.1, 1.0]), abs=1e-12)
    # two that are alike, and one that is alone
    pair = np.array([[1.0, 2.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 3.0]])
    (only,) = null_directions(pair, ("a", "b", "c"))
    assert only == pytest.approx({"a": 1.0, "b": -0.5})
    # (-0.85, 0.39) is -1.7275 times (1, 0) and 0.975 times (0.9, 0.4); the largest share is 1
    plane = np.array([[1.0, 0.9, -0.85], [0.0, 0.4, 0.39], [0.0, 0.0, 0.0]])
    (only,) = null_directions(plane, ("a", "b", "c"))
    assert only == pytest.approx({"a": 1.0, "b": -0.975 / 1.7275, "c": 1.0 / 1.7275})
    (other,) = null_directions(plane[:, [1, 0, 2]], ("b", "a", "c"))
    assert other == pytest.approx(only)
    assert null_directions(np.diag([1.0, 2.0, 3.0]), ("a", "b", "c")) == []
    # whatever the unit
    assert null_directions(1e-9 * pair, ("a", "b", "c")) == null_directions(pair, ("a", "b", "c"))


def test_an_actuator_is_named_once():
    with pytest.raises(bc.InputError, match="name 'a' twice"):
        bc.allocate(["a", "b", "a"])


def test_an_allocation_in_a_pose():
    model, data = craft()
    matrix = [[0.3, -0.2, 0.1], [0.5, 0.7, -0.9]]
    given = bc.allocate(["spin", "jet"], axes="bus", matrix=matrix)
    found = allocated(model, data, "all", given)
    assert found.body == "bus"
    assert found.commands == pytest.approx(np.array(matrix))
    assert found.torque[:, 0] == pytest.approx(torque("spin"))
    assert found.torque[:, 1] == pytest.approx(torque("jet"))
    assert found.without_torque == ()
    assert allocated(model, data, "all", bc.allocate(["jet"], matrix=[[1, 2, 3]])).body == "bus"
    inputs = torques_of_allocation(model, "all", found)
    assert [one.label for one in inputs] == ["all_x", "all_y", "all_z"]
    for k, one in enumerate(inputs):
        weights = {part.actuator: weight for weight, part in one.parts}
        assert weights == {0: matrix[0][k], model.actuator("jet").id: matrix[1][k]}
        assert one.unit == "N m"


def test_what_to_know_of_an_allocation():
    nothing = {"a": 1.0, "b": -0.25}

    def told(torque, commands, about="xyz", without=()):
        made = Allocated(("a", "b"), "bus", about, np.array(commands), np.array(torque), without)
        return [(one.code, str(one)) for one in made.cautions("all")]

    turn = np.diag([2.0, 4.0, 5.0])
    assert told(turn, np.diag([0.5, 0.25, 0.2])) == []
    assert told(turn, np.diag([0.5, 0.25, 0.2 + 1e-10])) == []
    ((code, text),) = told(turn, np.diag([0.5, -0.25, 0.2]))
    assert code == "allocation-matrix"
    assert "about y with a torque of (0, -1, 0) N m" in text
    assert told(turn, np.diag([0.5, 0.25, 0.2])[:, [0, 2]], about="xz") == []
    (code, text), *more = told(turn, np.diag([0.5, 0.25, 0.2]), without=(nothing,) * 5)
    assert (code, more) == ("allocation-null", [])
    assert text.count("a : b = 1 : -0.25") == 3
    assert "; 2 more in allocations['all']" in text
    assert "more in" not in told(turn, np.diag([0.5, 0.25, 0.2]), without=(nothing,) * 3)[0][1]


WHEEL = """<body><joint name="{0}" axis="{1}"/>
<inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/></body>"""


def about(axis, bodies, actuators):
    """The largest torque about an axis of a bus."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><body name="bus" euler="20 30 40"><freejoint/>
        <inertial pos="0 0 0" mass="20" diaginertia="4 5 6"/>{bodies}</body></worldbody>
        <actuator>{actuators}</actuator></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return largest_torque(model, data, model.body("bus").id, axis)


def test_the_largest_torque_of_wheels_is_within_their_ranges_and_about_the_axis_alone():
    # two wheels at +-60 degrees from x: along x both add, along y only their difference is left
    wheels = WHEEL.format("a", "1 1.7320508075688772 0") + WHEEL.format(
        "b", "1 -1.7320508075688772 0"
    )
    motors = (
        '<motor joint="a" gear="3" ctrlrange="-2 4"/><motor joint="b" gear="3" ctrlrange="-1 1"/>'
    )
    assert about(0, wheels, motors) == pytest.approx(2.0 * 0.5 * 3.0 * 1.0)
    assert about(1, wheels, motors) == pytest.approx(2.0 * np.sqrt(0.75) * 3.0 * 1.0)
    assert about(2, wheels, motors) == np.inf  # none turns it about z
    forced = motors.replace('gear="3" ctrlrange="-2 4"', 'gear="3" forcerange="-.2 .2"')
    assert about(0, wheels, forced) == pytest.approx(2.0 * 0.5 * 3.0 * 0.2)


def test_thrusters_push_one_way_each_and_the_smaller_way_counts():
    sites = '<site name="up" pos="0 2 0"/><site name="down" pos="0 -3 0"/>'
    jets = """<general site="up" gear="0 0 1 0 0 0" gainprm="2" ctrlrange="0 1"/>
        <general site="down" gear="0 0 1 0 0 0" gainprm="2" ctrlrange="0 1"/>"""
    assert about(0, sites, jets) == pytest.approx(2.0 * 2.0)


def test_a_motor_without_limits_and_one_that_turns_something_else_limit_nothing():
    wheel = WHEEL.format("a", "1 0 0")
    assert about(0, wheel, '<motor joint="a"/>') == np.inf
    hung = wheel.replace("</body>", WHEEL.format("far", "1 0 0") + "</body>")
    assert about(0, hung, '<motor joint="far" ctrlrange="-1 1"/>') == np.inf
    assert about(0, wheel, '<position joint="a" ctrlrange="-1 1"/>') == np.inf
