"""Closed forms and MuJoCo's own frames and forces beside inputs and outputs by name, in a pose that
is turned about no axis alone."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from beamchain import InputError
from formulas import (
    Input,
    base,
    control_names,
    linear_at,
    named_inputs,
    named_output,
    rest_point,
    sensor_axes,
    unit_of_control,
)

GEARS = {
    "1 2 3 0 0 0": "N",
    "0 0 0 4 0 0": "N m",
    "0 0 0 0 0 5": "N m",
    "0 0 1 0 0 1": "",
    "1 0 0 1 0 0": "",
}
KINDS = ("none", "filter", "filterexact", "integrator", "muscle")
CRAFT = f"""<mujoco><option gravity="0 0 0"/><worldbody>
<site name="still" pos="5 1 2" euler="20 -35 60"/><body name="bus" pos="1 2 3"><freejoint/>
<inertial pos=".4 -.2 .1" quat=".9 .1 -.3 .2" mass="20" diaginertia="4 5 6"/>
<site name="port" pos=".3 -.1 .2" euler="40 20 -70"/><camera name="eye" euler="30 10 5"/>
<geom name="box" type="box" size=".1 .2 .3" pos=".1 .1 .1" euler="15 50 5" mass="0"/>
<body name="link" pos=".5 0 0" euler="0 20 25"><joint name="hinge" axis="0 0 1"/>
<joint name="rail" type="slide"/><inertial pos="2 0 0" mass="3" diaginertia=".3 .3 .4"/>
<site name="hand" pos="3 0 0" euler="0 30 0"/></body>
<body name="head" pos="0 0 1"><joint name="ball" type="ball"/>
<inertial pos=".1 .2 .3" mass="1" diaginertia=".1 .2 .2"/></body></body></worldbody><actuator>
{"".join(f'<motor site="port" gear="{gear}"/>' for gear in GEARS)}
{"".join(f'<general name="{k}" joint="hinge" dyntype="{k}" dynprm=".1 .1"/>' for k in KINDS)}
</actuator><sensor><framepos name="where" objtype="site" objname="hand"/>
<framequat name="turned" objtype="xbody" objname="link"/><gyro name="gyro" site="port"/>
<jointpos name="angle" joint="hinge" cutoff=".5"/><jointpos name="way" joint="rail"/>
<jointvel name="speed" joint="rail"/><ballquat name="look" joint="ball"/>
<framequat name="full" objtype="body" objname="bus"/><framequat name="geom" objtype="geom"
objname="box"/><framequat name="eye" objtype="camera" objname="eye"/><framequat name="site"
objtype="site" objname="port"/><framepos name="seen" objtype="site" objname="hand" reftype="geom"
refname="box"/><framelinvel name="slides" objtype="body" objname="link" reftype="body"
refname="bus"/><framexaxis name="beside" objtype="site" objname="port" reftype="site"
refname="still"/><ballangvel name="rolls" joint="ball"/><force name="force" site="hand"/>
<subtreeangmom name="whole" body="bus"/><touch name="touch" site="port"/><user name="user" dim="4"/>
</sensor></mujoco>"""
POSE = np.array([0.2, -0.3, 0.4, 0.5, 0.5, -0.1, 0.7, 0.4, 0.05, 0.8, 0.1, -0.5, 0.3])
POSE[3:7] /= np.linalg.norm(POSE[3:7])
POSE[9:13] /= np.linalg.norm(POSE[9:13])
HINGE, RAIL = 7, 8
SPEED = np.array([0.1, -0.2, 0.3, 0.7, -0.4, 0.9, 0.6, 0.2, 0.3, -0.5, 0.8])


@pytest.fixture
def point():
    return rest_point(mujoco.MjModel.from_xml_string(CRAFT), POSE)


@pytest.fixture
def data(point):
    return point.data()


# -- inputs ----------------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["torque:link", "force:link", "wrench:port"])
def test_a_wrench_acts_where_and_along_what_it_says(point, data, name):
    model = point.model
    place, inputs = named_inputs(model, data, name)
    kind, _, wanted = name.partition(":")
    assert place == wanted
    site = kind == "wrench"
    axes = (data.site("port") if site else data.body("link")).xmat.reshape(3, 3)
    at = data.site("port").xpos if site else data.body("link").xipos
    body = model.body("bus" if site else "link").id
    labels = [(k, axis) for k in ("force", "torque") if site or k == kind for axis in "xyz"]
    found = [(one.label, one.unit, one.body, one.centre) for one in inputs]
    assert found == [
        (f"{k}_{axis}", "N" if k == "force" else "N m", body, kind == "force") for k, axis in labels
    ]
    pushed = linear_at(point, inputs).inputs.force.T
    for (k, axis), one, force in zip(labels, inputs, pushed, strict=True):
        wrench = np.zeros((2, 3))
        wrench[("force", "torque").index(k)] = axes[:, "xyz".index(axis)]
        own = np.zeros(model.nv)
        mujoco.mj_applyFT(model, data, *wrench, at, body, own)
        assert force == pytest.approx(own, abs=1e-9)
        wrench[1] += np.cross(at - data.xipos[body], wrench[0])
        assert one.wrench == pytest.approx(wrench.ravel(), abs=1e-14)


def test_inputs_add_with_their_weights(data):
    data.ctrl[:2] = 10.0, 20.0
    data.xfrc_applied[2] = 1.0
    wrench = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    motor, push = Input("a", "", 1), Input("w", "", body=2, wrench=wrench)
    inner = Input("inner", "", parts=((3.0, motor), (0.5, push)))
    whole = Input("whole", "", parts=((-2.0, inner), (4.0, Input("b", "", 0)), (1.0, motor)))
    found = [(weight, one.label) for weight, one in whole.simple]
    assert found == [(-6.0, "a"), (-1.0, "w"), (4.0, "b"), (1.0, "a")]
    whole.apply(data, 0.7)
    assert data.ctrl[:2] == pytest.approx([10.0 + 2.8, 20.0 - 3.5])
    assert data.xfrc_applied[2] == pytest.approx(1.0 - 0.7 * wrench)


@pytest.mark.parametrize("kind", KINDS)
def test_an_actuator_with_a_linear_activation_is_an_input(point, data, kind):
    if kind == "muscle":
        with pytest.raises(InputError, match="'muscle' of inputs has an activation that is not li"):
            named_inputs(point.model, data, kind)
        return
    name, (only,) = named_inputs(point.model, data, kind)
    number = len(GEARS) + KINDS.index(kind)
    assert (name, only.actuator, only.wrench) == (kind, number, None)


def test_the_base_is_the_body_that_carries_most_degrees_of_freedom():
    heavy = '<body name="a"><joint type="slide"/><geom size=".9"/></body>'
    light = '<joint/><geom size=".1"/>'
    most = f'<body name="b">{light}<body>{light}</body></body>'
    for bodies in (heavy + most, most + heavy):
        model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
        assert model.body(base(model)).name == "b"
    with pytest.raises(InputError, match="no degree of freedom"):
        base(mujoco.MjModel.from_xml_string("<mujoco/>"))


def test_units_of_an_actuator_at_a_site_go_by_all_of_its_gear(point):
    found = [unit_of_control(point.model, i) for i in range(len(GEARS))]
    assert found == list(GEARS.values())


@pytest.mark.parametrize("gain", [0.02, 50.0])
def test_a_servo_takes_an_angle_or_a_rate_however_weak(gain):
    servos = f"""<position joint="turn" kp="{gain}"/><velocity joint="turn" kv="{gain}"/>
    <position joint="way" kp="{gain}"/><velocity joint="way" kv="{gain}"/>"""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><body><joint name="turn"/><joint name="way" type="slide"/>
        <geom size="1"/></body></worldbody><actuator>{servos}</actuator></mujoco>"""
    )
    assert [unit_of_control(model, i) for i in range(4)] == ["rad", "rad/s", "m", "m/s"]


def test_names_without_points_are_all_different():
    labels = ["a.b", "a_b", "c", "a.b.", "a.b", "c.d"]
    assert control_names(labels) == ["a_b_", "a_b", "c", "a_b__", "a_b___", "c_d"]


# -- outputs ---------------------------------------------------------------------------------------
def test_labels_units_and_reach_of_outputs(point, data):
    wanted = {
        "rad": "attitude turned look angle",
        "rad/s": "rate gyro",
        "m": "where seen way",
        "m/s": "speed",
        "N": "force",
        "N m s": "whole",
        "": "beside",
    }
    for unit, name in ((unit, name) for unit, names in wanted.items() for name in names.split()):
        _, output = named_output(point, data, name)
        alone = name in ("angle", "way", "speed")
        labels = (name,) if alone else tuple(f"{name}_{axis}" for axis in "xyz")
        assert (output.labels, output.units) == (labels, (unit,) * len(labels))
        # the others do not feel what hangs on the craft, given its motion
        assert output.local == (name not in ("force", "whole"))
    place, motion = named_output(point, data, "motion:hand")
    assert (place, motion.labels[1:5:2]) == ("hand", ("displacement_y", "rotation_x"))
    assert motion.units == ("m", "m", "m", "rad", "rad", "rad")


def test_outputs_are_read_from_where_they_start(point, data):
    names = ("attitude", "rate", "motion:port", "where", "turned", "eye", "gyro", "angle", "way")
    outputs = {name: named_output(point, data, name)[1] for name in names}
    before = {name: data.sensor(name).data.copy() for name in ("where", "gyro")}
    start = Rotation.from_quat(POSE[3:7], scalar_first=True)
    line = np.array([2.0, -1.0, 2.0]) / 3.0  # in the axes of the bus
    in_port, in_link, in_eye = (
        one.xmat.reshape(3, 3).T @ start.apply(line)
        for one in (data.site("port"), data.body("link"), data.cam("eye"))
    )
    axes, place = data.site("port").xmat.reshape(3, 3).copy(), data.site("port").xpos.copy()
    data.qpos[3:7] = (start * Rotation.from_rotvec(0.3 * line)).as_quat(scalar_first=True)
    data.qpos[RAIL] += 0.03
    data.qvel[:] = SPEED
    mujoco.mj_forward(point.model, data)
    read = {name: one.read(data) for name, one in outputs.items()}
    assert read["attitude"] == pytest.approx(np.sin(0.3) * line, abs=1e-14)
    # a free joint's rates are in the axes of the body
    assert read["rate"] == pytest.approx(SPEED[3:6], abs=1e-12)
    motion = [*(axes.T @ (data.site("port").xpos - place)), *(np.sin(0.3) * in_port)]
    assert read["motion:port"] == pytest.approx(motion, abs=1e-14)
    # a rotation vector in the axes of what turns
    assert read["turned"] == pytest.approx(0.3 * in_link, abs=1e-12)
    assert read["eye"] == pytest.approx(0.3 * in_eye, abs=1e-12)
    for name, first in before.items():
        assert read[name] == pytest.approx(data.sensor(name).data - first, abs=1e-14)
    assert (read["angle"], read["way"]) == (pytest.approx([0.0], abs=1e-14), pytest.approx([0.03]))


@pytest.mark.parametrize("start", [0.49, -0.49, 0.5, -2.0])
def test_a_sensor_at_its_cutoff_has_no_linear_part(point, data, start):
    data.qpos[HINGE] = start
    mujoco.mj_forward(point.model, data)
    if abs(start) >= 0.5:
        with pytest.raises(InputError, match=r"at its cutoff, 0\.5"):
            named_output(point, data, "angle")
        return
    _, output = named_output(point, data, "angle")
    assert point.model.sensor("angle").cutoff[0] == 0.0
    data.qpos[HINGE] = 7.0 * start
    mujoco.mj_forward(point.model, data)
    assert output.read(data) == pytest.approx([6.0 * start])


@pytest.mark.parametrize("kind", ["touch", "user"])
def test_a_sensor_of_contact_or_of_a_user_has_no_linear_part(point, data, kind):
    with pytest.raises(InputError, match=f"a {kind} sensor has none"):
        named_output(point, data, kind)


def test_axes_in_which_a_sensor_tells(point, data):
    wanted = {
        "gyro site": data.site("port").xmat,
        "force": data.site("hand").xmat,
        "beside": data.site("still").xmat,
        "turned": data.body("link").xmat,
        "look rolls": data.body("head").xmat,
        "full slides": data.body("bus").ximat,
        "geom seen": data.geom("box").xmat,
        "eye": data.cam("eye").xmat,
        "where whole": np.eye(3),
    }
    for names, axes in wanted.items():
        for name in names.split():
            found = sensor_axes(point.model, data, point.model.sensor(name).id)
            assert found == pytest.approx(np.reshape(axes, (3, 3)), abs=1e-14), name
    for name in ("angle", "way", "touch"):
        assert sensor_axes(point.model, data, point.model.sensor(name).id) is None
