"""Closed forms beside roots along a run; poses by number, names apart, numbers that changed."""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.engine.combinations import inputs_of, outputs_of
from beamchain.engine.model_diff import differences, ids_of, others
from beamchain.engine.operating_point import (
    OperatingPoint,
    check_pose,
    is_cyclic,
    operating_point,
    poses_between,
    state_at,
    value_text,
)
from beamchain.engine.root_motion import STATE, Root, Run, motion_of

# -- roots along a run -----------------------------------------------------------------------------
LINK = """<mujoco><option gravity="0.3 -9.1 0.7"/><worldbody>
<body name="arm"><joint axis="0 0 1"/><inertial pos="1 0 0" mass="2" diaginertia="1 1 1"/>
<body name="link" pos="2 0 0"><joint axis="0 0 1"/>
<inertial pos="1 0.2 0.1" mass="3" diaginertia="0.5 0.6 0.7"/><site name="end" pos="3 0.5 0"/>
<body name="tip" pos="3 0.5 0"><inertial pos="0.1 0.3 0" mass="1.5" diaginertia="0.2 0.3 0.4"/>
</body></body></body></worldbody></mujoco>"""
GRAVITY = np.array([0.3, -9.1, 0.7])


def moment_and_force(weights, at, about, acceleration, rate, turning, gravity):
    """What bodies `(mass, place, inertia about z)` of a link that turns about z at a rate put on
    what carries them, about a point; `at`, `acceleration` of the link's origin, its axes."""
    force, moment = np.zeros(3), np.zeros(3)
    for mass, place, inertia in weights:
        arm = place - at
        z = np.array([0.0, 0.0, 1.0])
        moved = acceleration + turning * np.cross(z, arm) - rate**2 * arm * [1.0, 1.0, 0.0]
        one = -mass * (moved - gravity)
        force += one
        moment += np.cross(place - about, one) - inertia * turning * z
    return np.concatenate([force, moment])


@pytest.mark.parametrize("off", [False, True])
def test_a_link_on_an_arm_that_turns(off):
    """Both hinges about z, with gravity and where its flag switches it off."""
    model = mujoco.MjModel.from_xml_string(LINK)
    gravity = GRAVITY * (not off)
    if off:
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    qpos = np.array([[0.3, 0.5], [-1.1, 0.2]])
    qvel = np.array([[0.7, -0.2], [0.4, 0.9]])
    qacc = np.array([[0.6, 1.3], [-0.8, 0.5]])
    run = Run(np.array([0.0, 2.0]), None, {"qpos": qpos, "qvel": qvel, "qacc": qacc})
    tip = model.body("tip").id, model.site("end").id
    roots = [Root(model.body("link").id, (tip,)), Root(model.body("arm").id, ())]
    found = motion_of(model, run, roots)
    np.testing.assert_array_equal(found.qacc, qacc)
    np.testing.assert_array_equal(found.qpos, qpos)
    link, arm = found.roots
    assert arm.carried.shape == (2, 0, 6)
    # off x, y, with a height 0.1 of the mass, whose centrifugal moment rod inertia misses
    weights = [(3.0, np.array([1.0, 0.2, 0.1]), 0.7), (1.5, np.array([3.1, 0.8, 0.0]), 0.4)]
    for t in range(2):
        (first, second), (w, more), (a, rises) = qpos[t], qvel[t], qacc[t]
        angle, rate, turning = first + second, w + more, a + rises
        cos, sin = np.cos(second), np.sin(second)
        into = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        moved = into @ [-2.0 * w**2, 2.0 * a, 0.0]
        cos, sin = np.cos(angle), np.sin(angle)
        weight = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ gravity
        np.testing.assert_allclose(link.acceleration[t], [*moved, 0.0, 0.0, turning], atol=1e-12)
        np.testing.assert_allclose(link.gravity[t], weight, atol=1e-12)
        np.testing.assert_allclose(link.spin[t], [0.0, 0.0, rate], atol=1e-12)
        origin = np.zeros(3)
        load = moment_and_force(weights, origin, origin, moved, rate, turning, weight)
        np.testing.assert_allclose(link.load[t], load, atol=1e-11)
        end = np.array([3.0, 0.5, 0.0])
        carried = moment_and_force(weights[1:], origin, end, moved, rate, turning, weight)
        np.testing.assert_allclose(link.carried[t, 0], carried, atol=1e-11)
        np.testing.assert_allclose(arm.acceleration[t], [0.0, 0.0, 0.0, 0.0, 0.0, a], atol=1e-12)


DAMPED = """<mujoco><option gravity="0 0 0" timestep="0.1" integrator="{}"/><worldbody>
<body name="wheel"><joint name="axle" axis="0 0 1" damping="4"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 2"/></body></worldbody>
<tendon><fixed damping="3"><joint joint="axle" coef="0.5"/></fixed></tendon></mujoco>"""


@pytest.mark.parametrize(
    ("integrator", "explicit", "implicit"),
    [
        ("RK4", (), 0.0),  # the equations of motion
        ("Euler", (), 4.0),  # the joint's damper alone at the end of the step
        ("Euler", (0,), 4.0),
        ("implicitfast", (), 4.75),  # and the tendon's, 3 0.5^2
        ("implicitfast", (0,), 4.0),
    ],
)
def test_accelerations_are_those_of_a_step(integrator, explicit, implicit):
    """-(4 + 0.75) v / (I + h d) with what the step takes at its end."""
    model = mujoco.MjModel.from_xml_string(DAMPED.format(integrator))
    data = mujoco.MjData(model)
    data.qvel[0] = 1.6
    state = np.empty((1, mujoco.mj_stateSize(model, STATE)))
    mujoco.mj_getState(model, data, state[0], STATE)
    found = motion_of(model, Run(np.array([3.0]), state, {}), [Root(1, ())], explicit)
    assert found.qacc[0, 0] == pytest.approx(-4.75 * 1.6 / (2.0 + 0.1 * implicit))
    assert found.qvel[0, 0] == 1.6
    assert found.roots[0].acceleration[0, 5] == pytest.approx(found.qacc[0, 0])


# -- poses -----------------------------------------------------------------------------------------
CRAFT = """<mujoco><worldbody><body name="bus" pos="0 0 1"><freejoint name="free"/>
<geom size="1" mass="9"/>
<body name="rotor" pos="0 0 2"><joint name="wheel" axis="0 0 1"/><geom size=".2" mass="2"/>
<site name="left"/><site name="right"/></body>
<body pos="3 0 0"><joint name="drive" axis="0 1 0"/><geom size=".2" pos=".5 0 0" mass="1"/></body>
</body></worldbody>
<actuator><motor name="one" joint="wheel"/><motor name="two" joint="drive"/></actuator>
<keyframe><key name="first" qpos="1 2 3 1 0 0 0 .1 .2" qvel="1 2 3 0 0 0 5 0"/>
<key name="last" qpos="0 0 0 1 0 0 0 .3 .4"/></keyframe></mujoco>"""


def test_poses_by_name_and_number():
    model = mujoco.MjModel.from_xml_string(CRAFT)
    for pose, wheel, rate in ((0, 0.1, 5.0), ("first", 0.1, 5.0), (1, 0.3, 0.0), ("last", 0.3, 0)):
        qpos, qvel = state_at(model, pose)
        assert (qpos[7], qvel[6]) == (wheel, rate)
    for pose in (-1, 2, True):
        with pytest.raises(bc.InputError, match="is no keyframe"):
            state_at(model, pose)
    qpos, qvel = state_at(model, {"drive": 0.7})
    assert qpos.tolist() == [0, 0, 1, 1, 0, 0, 0, 0, 0.7]
    assert not qvel.any()
    # a craft that drifts far out is the same craft
    point = operating_point(model, "first", {"wheel": 7.0})
    assert point.qpos.tolist() == [0, 0, 0, 1, 0, 0, 0, 0.1, 0.2]
    assert point.qvel.tolist() == [0, 0, 0, 0, 0, 0, 7, 0]
    assert not point.model.opt.gravity.any()
    assert operating_point(model, "first", {"wheel": 0.0}).qvel[6] == 0.0
    # what stands still may be any joint, but one of the craft
    assert operating_point(model, "first", {"free": 0.0}).qvel.tolist() == [0.0] * 6 + [5.0, 0.0]
    # but not one that turns
    turning = CRAFT.replace('qvel="1 2 3 0', 'qvel="1 2 3 .4')
    with pytest.raises(bc.InputError, match="'free' moves"):
        operating_point(mujoco.MjModel.from_xml_string(turning), "first")
    for name, rate in (("free", 1.0), ("none", 0.0)):
        with pytest.raises(bc.InputError, match=name):
            operating_point(model, "first", {name: rate})


@pytest.mark.parametrize(
    ("angle", "within"), [(-0.51, False), (-0.5, True), (0.1, True), (0.7, True), (0.71, False)]
)
@pytest.mark.parametrize("kind", ["hinge", "slide"])
def test_a_pose_lies_within_the_ranges_of_its_joints(angle, within, kind):
    limited = '<compiler angle="radian"/><worldbody>'
    text = CRAFT.replace("<worldbody>", limited).split("<keyframe>")[0] + "</mujoco>"
    text = text.replace('name="drive"', f'name="drive" type="{kind}" range="-0.5 0.7"')
    model = mujoco.MjModel.from_xml_string(text)
    qpos = np.array(model.qpos0)
    qpos[7:] = 3.0, angle
    if within:
        check_pose(model, qpos)
    else:
        with pytest.raises(bc.InputError, match=r"'drive' .* outside its range \[-0\.5, 0\.7\]"):
            check_pose(model, qpos)


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_poses_on_the_way_from_one_keyframe_to_the_next(share):
    """Along lines, and about one axis by a share of 2 rad."""
    qpos = f"0 0 5 {np.cos(1.0)} 0 {np.sin(1.0)} 0 .3 .4"
    model = mujoco.MjModel.from_xml_string(CRAFT.replace("0 0 0 1 0 0 0 .3 .4", qpos))
    found = poses_between(model, share)
    assert list(found) == [
        f"{share:.0%} of the way from {way}" for way in ("rest to first", "first to last")
    ]
    first, last = found.values()
    lines = np.array([[1.0, 2.0, 2.0, 0.1, 0.2], [-1.0, -2.0, 2.0, 0.2, 0.2]]) * share
    apart = np.array([[0.0, 0.0, 1.0, 0.0, 0.0], [1.0, 2.0, 3.0, 0.1, 0.2]]) + lines
    assert first[[0, 1, 2, 7, 8]] == pytest.approx(apart[0])
    assert last[[0, 1, 2, 7, 8]] == pytest.approx(apart[1])
    assert first[3:7] == pytest.approx([1.0, 0.0, 0.0, 0.0])
    assert last[3:7] == pytest.approx([np.cos(share), 0.0, np.sin(share), 0.0])


def test_joints_that_slide_and_wheels_that_are_balanced():
    """The mass matrix does not know the angle of a balanced wheel, if nothing else hangs on it."""
    text = CRAFT.split("<keyframe>")[0] + "</mujoco>"
    slide = '<joint name="rail" type="slide"/>'
    model = mujoco.MjModel.from_xml_string(
        text.replace('<joint name="drive"', slide + '<joint name="drive"')
    )
    wheel, rail, drive = (model.joint(name).id for name in ("wheel", "rail", "drive"))
    for pose in (model.qpos0, model.qpos0 + 0.3):
        assert [is_cyclic(model, np.array(pose), joint) for joint in (wheel, rail, drive)] == [
            True,
            False,
            False,
        ]
    for unit in (1e-4, 1e4):
        heavy = mujoco.MjModel.from_xml_string(CRAFT)
        heavy.body_mass *= unit
        heavy.body_inertia *= unit
        there = [is_cyclic(heavy, heavy.qpos0, heavy.joint(one).id) for one in ("wheel", "drive")]
        assert there == [True, False]
    assert value_text(model, rail, -0.25) == "-0.25 m"
    assert value_text(model, drive, np.pi / 6.0) == "30°"
    assert value_text(model, drive, -1e-15) == "0°"


# -- names -----------------------------------------------------------------------------------------
def test_signals_of_one_name_are_told_apart_by_their_places():
    """The place stands behind labels that several have, and behind no others."""
    point = operating_point(mujoco.MjModel.from_xml_string(CRAFT))
    found = inputs_of(point, ["force:bus", "force:rotor", "torque:bus"])
    assert [one.label for one in found] == [
        *(f"force_{axis}_{at}" for at in ("bus", "rotor") for axis in "xyz"),
        *(f"torque_{axis}" for axis in "xyz"),
    ]
    assert [one.label for one in inputs_of(point, ["force:bus"])] == [
        f"force_{axis}" for axis in "xyz"
    ]
    # another name stands in front; one signal alone is called by it
    renamed = inputs_of(point, {"push": "force:bus", "spin": "one", "two": "two"})
    assert [one.label for one in renamed] == ["push_x", "push_y", "push_z", "spin", "two"]
    with pytest.raises(bc.InputError, match="names 'one' twice"):
        inputs_of(point, ["one", "two", "one"])
    with pytest.raises(bc.InputError, match="called 'push_x'"):
        inputs_of(point, {"push": "force:bus", "push_x": "one"})


def test_two_numbers_of_a_sensor_are_told_apart():
    eye = '<camera name="eye" pos="0 0 9" resolution="64 48"/>'
    dot = '<sensor><camprojection name="dot" site="dot" camera="eye"/></sensor>'
    bus = '<freejoint/><geom size=".1"/><site name="dot"/>'
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{eye}<body>{bus}</body></worldbody>{dot}</mujoco>"
    )
    (seen,) = outputs_of(operating_point(model), ["dot"])
    assert seen.labels == ("dot_0", "dot_1")


def test_weighted_sums_of_inputs_and_outputs():
    point = operating_point(mujoco.MjModel.from_xml_string(CRAFT))
    (both,) = inputs_of(point, {"both": {"one": 2.0, "two": -0.5}})
    assert (both.label, both.unit) == ("both", "N m")
    assert [(weight, one.label) for weight, one in both.parts] == [(2.0, "one"), (-0.5, "two")]
    (mixed, *_) = inputs_of(point, {"mixed": {"force:bus": 1.0, "torque:bus": 1.0}})
    assert mixed.unit == ""
    (turns,) = outputs_of(point, {"sum": {"attitude": 3.0, "rate": -1.0}})
    assert turns.labels == ("sum_x", "sum_y", "sum_z")
    data = point.data()
    data.qpos[3:7] = [np.cos(1e-4), np.sin(1e-4), 0.0, 0.0]
    data.qvel[3:6] = [0.0, 0.5, 0.0]
    mujoco.mj_forward(point.model, data)
    assert turns.read(data) == pytest.approx([6e-4, -0.5, 0.0], abs=1e-9)
    (double,) = outputs_of(point, {"double": {"rate": 2.0}})
    assert double.labels == ("double_x", "double_y", "double_z")
    assert double.read(data) == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)
    for weights in ({"one": 0.0}, {"one": 1.0, "force:bus": 1.0}):
        with pytest.raises(bc.InputError):
            inputs_of(point, {"sum": weights})


# -- what changed ----------------------------------------------------------------------------------
def test_numbers_that_changed_are_said_and_shorter_user_data_end_in_zeros():
    def model(mass, user, more=""):
        return mujoco.MjModel.from_xml_string(f"""<mujoco><worldbody><body name="bus">
        <joint name="drive"/><geom name="box" size="1" mass="{mass}" user="{user}"/></body>
        <body name="other" pos="5 0 0">{more}<geom size="1"/></body></worldbody></mujoco>""")

    first = model(2.0, "1 2")
    mine = ids_of(first, {"body": {"bus"}, "jnt": {"drive"}, "geom": {"box"}})
    assert (mine["body"], mine["jnt"], mine["dof"], mine["geom"]) == ([1], [0], [0], [0])
    assert others(first, mine)["body"] == [0, 2]
    pairs = {kind: (mine[kind], mine[kind]) for kind in ("body", "jnt", "geom")}
    assert differences(first, model(2.0, "1 2 0 0"), pairs) == []
    changed = differences(first, model(2.0, "1 2 0 3"), pairs)
    assert [(one.element, one.field, one.wanted, one.found) for one in changed] == [
        ("box", "geom_user", 0.0, 3.0)
    ]
    assert differences(first, model(2.0, "1 2 0 3"), pairs, user=False) == []
    # of the first, within its tolerance times the largest of the row
    heavier = differences(first, model(2.02, "1 2"), pairs)
    masses = [one for one in heavier if one.field == "body_mass"]
    assert [(one.element, one.wanted, one.found) for one in masses] == [("bus", 2.0, 2.02)]
    assert differences(first, model(2.02, "1 2"), pairs, tolerance=0.0101) == []
    assert differences(first, model(2.02, "1 2"), pairs, tolerance=0.0099)
    light = differences(model(0.02, "1 2"), model(0.0202, "1 2"), pairs, tolerance=0.0099)
    assert "body_mass" in [one.field for one in light]
    counts = differences(first, first, {"body": ([1], [1, 2])})
    assert [(one.element, one.wanted, one.found) for one in counts] == [("body", 1, 2)]


def test_a_point_is_in_balance_whatever_pulls_and_drags_there():
    text = """<mujoco><option gravity="1 2 -9.81"/><worldbody><body>
    <joint name="a" axis="0 1 0" stiffness="7" damping=".3"/><geom size=".1" pos=".5 0 .2"/>
    <body pos="1 0 0"><joint name="b" axis="1 0 1" damping=".2"/><geom size=".2" pos="0 .3 0"/>
    </body></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = OperatingPoint(model, np.array([0.4, -0.7]), np.array([0.9, 1.3])).data()
    assert np.max(np.abs(data.qfrc_smooth)) < 1e-9
    assert np.max(np.abs(data.qacc)) < 1e-9
    assert (data.qpos.tolist(), data.qvel.tolist()) == ([0.4, -0.7], [0.9, 1.3])
