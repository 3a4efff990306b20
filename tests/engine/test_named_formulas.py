"""MuJoCo's own frames and forces beside the inputs and outputs of a plant."""

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
)

MODEL = """<mujoco><option gravity="0 0 0"/><worldbody>
<site name="still" pos="5 1 2" euler="20 -35 60"/>
<body name="bus" pos="1 2 3" euler="10 20 30"><freejoint/>
<inertial pos=".1 -.2 .05" euler="5 15 40" mass="20" diaginertia="4 5 6"/>
<site name="port" pos=".3 -.1 .2" euler="40 20 -70"/><geom name="panel" size=".1" euler="0 50 5"/>
<camera name="eye" euler="30 10 0"/>
<body name="link" pos=".5 0 0" euler="0 0 25"><joint name="ball" type="ball"/>
<inertial pos="2 0 0" mass="3" diaginertia=".3 .3 .4"/>
<body pos="1 0 0"><joint name="slide" type="slide"/><joint name="hinge" axis="0 1 0"/>
<inertial pos="0 0 1" mass="1" diaginertia=".1 .1 .1"/></body></body></body>
<body name="dock" pos="0 0 9"><joint name="lid"/><inertial pos="0 0 0" mass="500"
diaginertia="9 9 9"/></body></worldbody>
<actuator><motor name="turn" joint="hinge"/><muscle name="muscle" joint="slide"
lengthrange="-1 1"/></actuator>
<sensor><gyro name="gyro" site="port"/><ballquat name="ball" joint="ball"/>
<framequat name="star" objtype="camera" objname="eye"/>
<framepos name="place" objtype="site" objname="port" reftype="geom" refname="panel"/>
<framelinvel name="speed" objtype="body" objname="link" reftype="body" refname="bus"/>
<framepos name="plain" objtype="xbody" objname="link"/>
<framexaxis name="beside" objtype="site" objname="port" reftype="site" refname="still"/>
<jointpos name="travel" joint="slide"/><jointvel name="going" joint="slide"/>
<jointpos name="angle" joint="hinge" cutoff=".5"/><ballangvel name="spin" joint="ball"/>
<framequat name="body" objtype="xbody" objname="link"/></sensor></mujoco>"""


@pytest.fixture
def point():
    return rest_point(mujoco.MjModel.from_xml_string(MODEL))


def forward(point):
    data = point.data()
    mujoco.mj_forward(point.model, data)
    return data


def test_axes_of_sensors_are_those_they_are_told_in(point):
    data = forward(point)
    wanted = {
        "gyro": data.site("port").xmat,
        "ball": data.body("link").xmat,
        "spin": data.body("link").xmat,
        "star": data.cam("eye").xmat,
        "body": data.body("link").xmat,
        "place": data.geom("panel").xmat,
        "speed": data.body("bus").ximat,
        "plain": np.eye(3).ravel(),
        "beside": data.site("still").xmat,
    }
    for name, axes in wanted.items():
        found = sensor_axes(point.model, data, point.model.sensor(name).id)
        assert found == pytest.approx(axes.reshape(3, 3)), name
    assert sensor_axes(point.model, data, point.model.sensor("travel").id) is None


def test_labels_units_and_reach_of_sensors(point):
    data = forward(point)
    wanted = {
        "gyro": (["gyro_x", "gyro_y", "gyro_z"], "rad/s", True),
        "ball": (["ball_x", "ball_y", "ball_z"], "rad", True),
        "place": (["place_x", "place_y", "place_z"], "m", True),
        "travel": (["travel"], "m", True),
        "going": (["going"], "m/s", True),
        "angle": (["angle"], "rad", True),
        "beside": (["beside_x", "beside_y", "beside_z"], "", True),
    }
    for name, (labels, unit, local) in wanted.items():
        output = named_output(point, data, name)[1]
        assert (list(output.labels), set(output.units)) == (labels, {unit})
        assert output.local == local


@pytest.mark.parametrize(("start", "taken"), [(0.49, True), (-0.49, True), (0.5, False), (-2.0, 0)])
def test_a_sensor_at_its_cutoff_has_no_slope(point, start, taken):
    data = point.data()
    data.qpos[-2] = start
    mujoco.mj_forward(point.model, data)
    if not taken:
        with pytest.raises(InputError, match=r"at its cutoff, 0\.5"):
            named_output(point, data, "angle")
        return
    output = named_output(point, data, "angle")[1]
    data.qpos[-2] = 7.0 * start
    mujoco.mj_forward(point.model, data)
    assert output.read(data) == pytest.approx([6.0 * start])


def test_attitude_rate_and_quaternions_by_small_turns(point):
    data = forward(point)
    outputs = {name: named_output(point, data, name)[1] for name in ("attitude", "rate", "star")}
    turn = 1e-4 * np.array([0.3, -0.5, 0.8])
    start = Rotation.from_quat(data.qpos[3:7], scalar_first=True)
    data.qpos[3:7] = (start * Rotation.from_rotvec(turn)).as_quat(scalar_first=True)
    data.qvel[3:6] = [0.2, 0.7, -0.4]
    mujoco.mj_forward(point.model, data)
    assert outputs["attitude"].read(data) == pytest.approx(turn, rel=1e-6)
    assert outputs["rate"].read(data) == pytest.approx([0.2, 0.7, -0.4])
    eye = Rotation.from_matrix(data.body("bus").xmat.reshape(3, 3)).inv() * Rotation.from_matrix(
        data.cam("eye").xmat.reshape(3, 3)
    )
    assert outputs["star"].read(data) == pytest.approx(eye.inv().apply(turn), rel=1e-6)


@pytest.mark.parametrize("name", ["torque:link", "force:link", "wrench:port"])
def test_a_wrench_acts_where_and_along_what_it_says(point, name):
    data = forward(point)
    model = point.model
    place, inputs = named_inputs(model, data, name)
    assert place == name.split(":")[1]
    site = name == "wrench:port"
    axes = (data.site("port") if site else data.body("link")).xmat.reshape(3, 3)
    at = data.site("port").xpos if site else data.body("link").xipos
    body = model.body("bus" if site else "link").id
    kinds = [k for k in ("force", "torque") if name.startswith(k) or site]
    assert [one.label for one in inputs] == [f"{k}_{a}" for k in kinds for a in "xyz"]
    linear = linear_at(point, inputs)
    for column, one in enumerate(inputs):
        line = axes[:, "xyz".index(one.label[-1])]
        force = line if one.label.startswith("force") else np.zeros(3)
        torque = np.zeros(3) if one.label.startswith("force") else line
        wanted = np.zeros(model.nv)
        mujoco.mj_applyFT(model, data, force, torque, at, body, wanted)
        assert linear.inputs.force[:, column] == pytest.approx(wanted, abs=1e-9)
        assert one.unit == ("N" if one.label.startswith("force") else "N m")
        assert one.centre == (name == "force:link")


def test_a_combination_drives_its_parts_by_their_weights(point):
    data = forward(point)
    motor = named_inputs(point.model, data, "turn")[1][0]
    push = named_inputs(point.model, data, "force:bus")[1][1]
    both = Input("both", "", parts=((2.0, motor), (-3.0, push)))
    deep = Input("deep", "", parts=((0.5, both), (0.25, motor)))
    assert [(w, s.label) for w, s in deep.simple] == [
        (1.0, "turn"),
        (-1.5, "force_y"),
        (0.25, "turn"),
    ]
    deep.apply(data, 4.0)
    assert data.ctrl[0] == pytest.approx(5.0)
    bus = point.model.body("bus").id
    assert data.xfrc_applied[bus, :3] == pytest.approx(-6.0 * data.xmat[bus].reshape(3, 3)[:, 1])
    motor.apply(data, 2.0)
    assert data.ctrl[0] == pytest.approx(7.0)


def test_the_base_carries_most_and_a_muscle_is_not_linear(point):
    data = forward(point)
    # the bus with its link has eleven degrees of freedom, the heavier dock one
    assert base(point.model) == point.model.body("bus").id
    with pytest.raises(InputError, match="'muscle' of inputs has an activation"):
        named_inputs(point.model, data, "muscle")
    with pytest.raises(InputError, match="no degree of freedom"):
        base(mujoco.MjModel.from_xml_string("<mujoco/>"))


def test_names_of_signals_without_points_are_all_different():
    assert control_names(["a.b", "a_b", "c", "c.d", "c.d"]) == ["a_b_", "a_b", "c", "c_d", "c_d_"]
