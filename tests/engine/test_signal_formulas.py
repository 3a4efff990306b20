"""Closed forms beside inputs and outputs by name, in a pose that is turned about no axis alone."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import beamchain as bc
from formulas import (
    Input,
    base,
    control_names,
    named_inputs,
    named_output,
    rest_point,
    sensor_axes,
    unit_of_control,
)

BODY = """<mujoco><worldbody><body name="bus" pos="1 2 3"><freejoint/>
<inertial pos=".4 -.2 .1" quat=".9 .1 -.3 .2" mass="20" diaginertia="4 5 6"/>
<site name="port" pos=".3 -.1 .2" euler=".4 .2 -.7"/><camera name="eye" euler="1 .5 .2"/>
<geom name="box" type="box" size=".1 .2 .3" pos=".1 .1 .1" euler=".3 -.8 .1" mass="0"/>
<body name="link" pos=".5 0 0"><joint name="hinge" axis="0 0 1"/><joint name="rail" type="slide"/>
<inertial pos="2 0 0" mass="3" diaginertia=".3 .3 .4"/><site name="hand" pos="3 0 0"/></body>
<body name="head" pos="0 0 1"><joint name="ball" type="ball"/>
<inertial pos=".1 .2 .3" mass="1" diaginertia=".1 .2 .2"/></body>
</body></worldbody>{rest}</mujoco>"""
POSE = np.array([0.2, -0.3, 0.4, 0.5, 0.5, -0.1, 0.7, 0.4, 0.05, 0.8, 0.1, -0.5, 0.3])
POSE[3:7] /= np.linalg.norm(POSE[3:7])
POSE[9:13] /= np.linalg.norm(POSE[9:13])
SPEED = np.array([0.1, -0.2, 0.3, 0.7, -0.4, 0.9, 0.6, 0.2, 0.3, -0.5, 0.8])


def craft(rest=""):
    return mujoco.MjModel.from_xml_string(BODY.format(rest=rest))


def posed(model, speed=None):
    data = mujoco.MjData(model)
    data.qpos[:] = POSE
    if speed is not None:
        data.qvel[:] = speed
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    return data


# -- inputs ----------------------------------------------------------------------------------------
def test_a_wrench_at_a_site_acts_along_its_axes():
    model = craft()
    data = posed(model)
    place, inputs = named_inputs(model, data, "wrench:port")
    assert place == "port"
    assert [(one.label, one.unit) for one in inputs] == [
        *((f"force_{axis}", "N") for axis in "xyz"),
        *((f"torque_{axis}", "N m") for axis in "xyz"),
    ]
    axes, arm = (
        data.site("port").xmat.reshape(3, 3),
        data.site("port").xpos - data.body("bus").xipos,
    )
    for k in range(3):
        force, torque = inputs[k], inputs[3 + k]
        assert force.wrench == pytest.approx([*axes[:, k], *np.cross(arm, axes[:, k])], abs=1e-14)
        assert torque.wrench == pytest.approx([0, 0, 0, *axes[:, k]], abs=1e-14)
        assert force.body == torque.body == model.body("bus").id
        assert not force.centre


def test_a_force_acts_at_the_mass_centre_of_a_body_and_a_torque_about_its_axes():
    model = craft()
    data = posed(model)
    axes = data.body("link").xmat.reshape(3, 3)
    for kind, part in (("force", slice(3)), ("torque", slice(3, 6))):
        _, inputs = named_inputs(model, data, f"{kind}:link")
        assert len(inputs) == 3
        for k, one in enumerate(inputs):
            wanted = np.zeros(6)
            wanted[part] = axes[:, k]
            assert one.wrench == pytest.approx(wanted, abs=1e-14)
            assert one.label == f"{kind}_{'xyz'[k]}"
            assert one.centre == (kind == "force")
            assert one.body == model.body("link").id


def test_inputs_add_with_their_weights():
    model = craft('<actuator><motor joint="hinge"/><motor joint="rail"/></actuator>')
    data = posed(model)
    data.ctrl[:] = 10.0, 20.0
    data.xfrc_applied[2] = 1.0
    wrench = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    inner = Input(
        "inner", "", parts=((3.0, Input("a", "", 1)), (0.5, Input("w", "", body=2, wrench=wrench)))
    )
    whole = Input("whole", "", parts=((-2.0, inner), (4.0, Input("b", "", 0))))
    assert [weight for weight, _ in whole.simple] == [-6.0, -1.0, 4.0]
    whole.apply(data, 0.7)
    assert data.ctrl == pytest.approx([10.0 + 2.8, 20.0 - 4.2])
    assert data.xfrc_applied[2] == pytest.approx(1.0 - 0.7 * wrench)


@pytest.mark.parametrize(
    ("kind", "kept"),
    [("none", 1), ("filter", 1), ("filterexact", 1), ("integrator", 1), ("muscle", 0)],
)
def test_an_actuator_with_a_linear_activation_is_an_input(kind, kept):
    second = f'<general name="two" joint="hinge" dyntype="{kind}" dynprm=".1 .1"/>'
    model = craft(f'<actuator><motor name="one" joint="rail"/>{second}</actuator>')
    data = posed(model)
    if kept:
        name, (only,) = named_inputs(model, data, "two")
        assert (name, only.actuator, only.wrench) == ("two", 1, None)
    else:
        with pytest.raises(bc.InputError, match="activation that is not linear"):
            named_inputs(model, data, "two")


def test_the_base_is_the_body_that_carries_most():
    light = '<body name="a"><joint type="slide"/><geom size=".1"/></body>'
    heavy = (
        """<body name="b"><joint/><geom size=".1"/><body><joint/><geom size=".1"/></body></body>"""
    )
    for bodies in (light + heavy, heavy + light):
        model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
        assert model.body(base(model)).name == "b"


def test_units_of_an_actuator_at_a_site_go_by_all_of_its_gear():
    gears = {
        "1 2 3 0 0 0": "N",
        "0 0 0 4 0 0": "N m",
        "0 0 0 0 0 5": "N m",
        "0 0 1 0 0 1": "",
        "1 0 0 1 0 0": "",
    }
    motors = "".join(f'<motor site="port" gear="{gear}"/>' for gear in gears)
    model = craft(f"<actuator>{motors}</actuator>")
    assert [unit_of_control(model, i) for i in range(model.nu)] == list(gears.values())


def test_names_without_points_are_all_different():
    assert control_names(["a.b", "a_b", "c", "a.b.", "a.b"]) == [
        "a_b_",
        "a_b",
        "c",
        "a_b__",
        "a_b___",
    ]


# -- outputs ---------------------------------------------------------------------------------------
def test_attitude_and_rate_are_told_in_the_axes_of_the_base():
    model = craft()
    point = rest_point(model)
    data = posed(model, SPEED)
    _, attitude = named_output(point, data, "attitude")
    _, rate = named_output(point, data, "rate")
    assert attitude.read(data) == pytest.approx(np.zeros(3), abs=1e-14)
    # a free joint's rates are in the axes of the body
    assert rate.read(data) == pytest.approx(SPEED[3:6], abs=1e-12)
    turn = np.array([2.0, -1.0, 2.0]) / 3.0
    start = Rotation.from_quat(POSE[3:7], scalar_first=True)
    data.qpos[3:7] = (start * Rotation.from_rotvec(0.3 * turn)).as_quat(scalar_first=True)
    mujoco.mj_forward(model, data)
    assert attitude.read(data) == pytest.approx(np.sin(0.3) * turn, abs=1e-14)
    assert (attitude.labels[2], attitude.units) == ("attitude_z", ("rad",) * 3)
    assert (rate.labels[0], rate.units) == ("rate_x", ("rad/s",) * 3)


def test_labels_and_units_of_a_motion():
    model = craft()
    _, motion = named_output(rest_point(model), posed(model), "motion:hand")
    assert motion.labels[1:5:2] == ("displacement_y", "rotation_x")
    assert motion.units == ("m", "m", "m", "rad", "rad", "rad")


SENSORS = """<sensor><framepos name="where" objtype="site" objname="hand"/>
<framequat name="turned" objtype="xbody" objname="link"/><gyro name="gyro" site="port"/>
<jointpos name="angle" joint="hinge"/><jointpos name="way" joint="rail"/>
<jointvel name="speed" joint="rail"/><ballquat name="look" joint="ball"/>
<framequat name="full" objtype="body" objname="bus"/><framequat name="geom" objtype="geom"
objname="box"/><framequat name="eye" objtype="camera" objname="eye"/><framequat name="site"
objtype="site" objname="port"/><framepos name="seen" objtype="site" objname="hand" reftype="site"
refname="port"/><ballangvel name="rolls" joint="ball"/><force name="force" site="hand"/>
<jointpos name="short" joint="hinge" cutoff=".41"/><jointpos name="shorter" joint="hinge"
cutoff=".39"/><subtreeangmom name="whole" body="bus"/><touch name="touch" site="port"/></sensor>"""


def test_sensors_are_read_from_where_they_start():
    model = craft(SENSORS)
    data = posed(model)
    point = rest_point(model)
    outputs = {
        name: named_output(point, data, name)[1]
        for name in ("where", "turned", "gyro", "angle", "way", "speed", "whole")
    }
    before = {name: data.sensor(name).data.copy() for name in ("where", "gyro")}
    turn = np.array([2.0, -1.0, 2.0]) / 3.0
    start = Rotation.from_quat(POSE[3:7], scalar_first=True)
    inside = data.body("link").xmat.reshape(3, 3).T @ start.apply(0.02 * turn)
    data.qpos[3:7] = (start * Rotation.from_rotvec(0.02 * turn)).as_quat(scalar_first=True)
    data.qpos[7:9] += 0.0, 0.03
    data.qvel[:] = SPEED
    mujoco.mj_forward(model, data)
    read = {name: one.read(data) for name, one in outputs.items()}
    assert read["where"] == pytest.approx(data.sensor("where").data - before["where"], abs=1e-14)
    # a rotation vector in the axes of what turns
    assert read["turned"] == pytest.approx(inside, abs=1e-12)
    assert read["gyro"] == pytest.approx(data.sensor("gyro").data - before["gyro"], abs=1e-14)
    assert (read["angle"], read["way"]) == (pytest.approx([0.0], abs=1e-14), pytest.approx([0.03]))
    labels = {name: (one.labels, one.units) for name, one in outputs.items()}
    assert labels["where"] == (("where_x", "where_y", "where_z"), ("m",) * 3)
    assert labels["turned"] == (("turned_x", "turned_y", "turned_z"), ("rad",) * 3)
    assert labels["angle"] == (("angle",), ("rad",))
    assert labels["way"] == (("way",), ("m",))
    assert labels["speed"] == (("speed",), ("m/s",))
    assert labels["gyro"][1] == ("rad/s",) * 3
    assert labels["whole"][1] == ("N m s",) * 3
    assert [name for name, one in outputs.items() if not one.local] == ["whole"]


def test_a_sensor_at_its_cutoff_or_of_contact_has_no_linear_part():
    model = craft(SENSORS)
    data, point = posed(model), rest_point(model)
    _, short = named_output(point, data, "short")  # 0.4 rad
    assert short.read(data) == pytest.approx([0.0])
    assert model.sensor("short").cutoff[0] == 0.0
    with pytest.raises(bc.InputError, match=r"at its cutoff, 0\.39"):
        named_output(point, data, "shorter")
    with pytest.raises(bc.InputError, match="a touch sensor has none"):
        named_output(point, data, "touch")


def test_axes_in_which_a_sensor_tells():
    model = craft(SENSORS)
    data = posed(model)
    bus, port = data.body("bus"), data.site("port").xmat
    wanted = {
        "gyro": port,
        "turned": data.body("link").xmat,
        "full": bus.ximat,
        "geom": data.geom("box").xmat,
        "eye": data.cam("eye").xmat,
        "site": port,
        "look": data.body("head").xmat,
        "rolls": data.body("head").xmat,
        "seen": port,
        "force": data.site("hand").xmat,
        "where": np.eye(3),
        "whole": np.eye(3),
    }
    for name, axes in wanted.items():
        found = sensor_axes(model, data, model.sensor(name).id)
        assert found == pytest.approx(np.reshape(axes, (3, 3)), abs=1e-14), name
    for name in ("angle", "touch"):
        assert sensor_axes(model, data, model.sensor(name).id) is None


def test_a_sensor_of_other_sizes_has_numbered_labels():
    model = craft('<sensor><user name="four" dim="4"/><user name="two" dim="2"/></sensor>')
    with pytest.raises(bc.InputError, match="a user sensor has none"):
        named_output(rest_point(model), posed(model), "four")
