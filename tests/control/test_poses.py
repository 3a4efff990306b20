"""A plant per pose: what `pose` may list, what poses are called, which files say so, and the poses
of the command line."""

import json

import control
import mujoco
import numpy as np
import pytest
from scipy.io import loadmat

import beamchain as bc
from command import run
from posed import CRAFT

AGREE = 1e-7  # transfer functions after states were taken out
S = np.geomspace(0.05, 30.0, 40) * (0.01 + 1j)


@pytest.fixture(scope="module")
def made():
    section = bc.Equivalent(bending_stiffness_xy=2e3, bending_stiffness_xz=3e3, linear_mass=1.0)
    spec = bc.Spec(
        name="boom",
        segment=(bc.Segment(length=5.0, section=section),),
        modes=bc.Modes(xy=1, xz=1),
        damping=bc.Damping(ratio=0.003),
    )
    return bc.embed(CRAFT, {"mount": spec})


def positions(model, **joints):
    out = np.array(model.qpos0)
    for name, value in joints.items():
        out[model.joint(name).qposadr[0]] = value
    return out


@pytest.mark.slow
def test_poses_are_joints_keyframes_and_positions(made):
    poses = [
        {"drive": np.radians(45.0), "turn": np.radians(-30.0)},
        "drive",
        {"reach": 0.25, "turn": 0.0},
        positions(made.model, drive=-0.5, wheel=400.0),
        {},
        np.int64(1),
    ]
    scheduled = bc.plant(made, ["torque:bus"], pose=poses)
    assert scheduled.labels == (
        "drive 45°, turn -30°",
        "drive",
        "reach 0.25 m, turn 0°",
        "drive -28.6479°",
        "rest",
        "keyframe 1",
    )
    assert scheduled.joints == ("drive", "turn", "reach")  # a wheel's angle is none of a pose
    assert scheduled.units == ("rad", "rad", "m")
    np.testing.assert_allclose(scheduled.values[1], [0.5, 0.2, 0.1])
    np.testing.assert_allclose(scheduled.values[2], [0.0, 0.0, 0.25])
    assert (scheduled.joint, scheduled.angles, scheduled.grid) == (None, None, None)
    assert len(scheduled) == len(list(scheduled)) == 6
    assert len({plant.state_names for plant in scheduled}) == 1
    for pose, plant in zip(poses, scheduled, strict=True):
        alone = bc.plant(made, ["torque:bus"], pose=pose)(S, squeeze=False)
        size = np.abs(alone).max((1, 2), keepdims=True)
        assert np.max(np.abs(plant(S, squeeze=False) - alone) / size) < AGREE
    assert [m.shape for m in scheduled.matrices()] == [
        (6, *getattr(scheduled[0], name).shape) for name in "ABCD"
    ]
    assert "6 poses ('drive 45°, turn -30°', 'drive', " in repr(scheduled)
    axis = scheduled.plot()
    assert [tick.get_text() for tick in axis.get_xticklabels()] == list(scheduled.labels)


@pytest.mark.slow
def test_a_grid_of_one_joint_stays(made):
    grid = bc.plant(made, ["torque:bus"], pose={"drive": [0.0, 0.5], "turn": 0.25})
    listed = bc.plant(made, ["torque:bus"], pose=[{"drive": a, "turn": 0.25} for a in (0.0, 0.5)])
    assert grid.joint == "drive"
    np.testing.assert_allclose(grid.angles, [0.0, 0.5])
    np.testing.assert_allclose(grid.grid[0], np.degrees([0.0, 0.5]))
    assert (
        grid.labels == listed.labels == ("drive 0°, turn 14.3239°", "drive 28.6479°, turn 14.3239°")
    )
    assert np.array_equal(grid.matrices()[0], listed.matrices()[0])
    slid = bc.plant(made, ["torque:bus"], pose={"reach": [0.0, 0.5]})
    assert slid.labels == ("reach 0 m", "reach 0.5 m")
    assert slid.grid[1] == "m"
    assert slid.plot().get_xlabel() == "reach, m"


@pytest.mark.slow
def test_all_joints_move_together_between_two_poses(made):
    """Through a contact too, which no plant holds: the order is that of a fine grid of poses."""
    start, end = {"drive": 0.0, "turn": 0.0}, {"drive": 1.9, "turn": 1.2}
    coarse = bc.plant(made, ["torque:bus"], pose=[start, end])
    path = [
        {name: (1.0 - share) * start[name] + share * end[name] for name in start}
        for share in np.linspace(0.0, 1.0, 11)
    ]
    open_craft = bc.embed(
        CRAFT.replace('name="wall"', 'name="wall" contype="0" conaffinity="0"'),
        {a.at: a.spec for a in made.appendages},
    )
    fine = bc.plant(open_craft, ["torque:bus"], pose=path)
    np.testing.assert_allclose(coarse.frequency[-1], fine.frequency[-1], rtol=1e-9)
    with pytest.raises(bc.InputError, match=r"pose\[7\]: '(wall|arm)' touches"):
        bc.plant(made, ["torque:bus"], pose=path)


# an arm whose elbow is damped or held by a servo: what oscillates stretched does not when bent
ARM = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="90 80 70"/>
<body name="upper" pos="0.5 0 0"><joint name="root" axis="0 0 1" stiffness="4000" damping="2"/>
<inertial pos="1.5 0 0" mass="12" diaginertia="1 9 9"/>
<body name="fore" pos="3 0 0"><joint name="elbow" axis="0 0 1" damping="{damping}"/>
<inertial pos="0.1 0 0" mass="2" diaginertia="1 1 1"/>
<body name="hand" pos="0.2 0 0"><joint name="tip" axis="0 0 1" stiffness="2000" damping="1"/>
<inertial pos="2 0 0" mass="8" diaginertia="1 6 6"/></body></body></body></body></worldbody>
<actuator><general name="elbow" joint="elbow" gainprm="1" biastype="affine" biasprm="0 -{kp} 0"/>
</actuator></mujoco>"""


def attitude_of_arm(damping, kp, angle):
    """Attitude about z per torque by the equations of motion, masses by MuJoCo's mj_fullM."""
    model = mujoco.MjModel.from_xml_string(ARM.format(damping=damping, kp=kp))
    data = mujoco.MjData(model)
    data.joint("elbow").qpos[0] = angle
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    lossy = np.diag([0.0] * 6 + [2.0, damping, 1.0])
    springs = np.diag([0.0] * 6 + [4000.0, kp, 2000.0])
    push = np.zeros(9)
    push[7] = 1.0
    return np.array([np.linalg.solve(mass * s**2 + lossy * s + springs, push)[5] for s in S])


@pytest.mark.parametrize(("damping", "kp"), [(124, 0), (150, 300)])
@pytest.mark.slow
def test_what_oscillates_in_one_pose_and_not_in_another(damping, kp, tmp_path):
    """The states are the modes' own coordinates, so that a plant between two poses can be had from
    theirs."""
    angles = np.array([0.0, 1.5, 1.55, 1.6])
    craft = ARM.format(damping=damping, kp=kp)
    scheduled = bc.plant(craft, ["elbow"], ["attitude"], pose={"elbow": angles})
    assert len({plant.state_names for plant in scheduled}) == 1
    assert len({plant.modes for plant in scheduled}) > 1
    for angle, plant in zip(angles, scheduled, strict=True):
        true = attitude_of_arm(damping, kp, angle)
        found = plant(S, squeeze=False)[2, 0]
        assert np.max(np.abs(found / true - 1.0)) < 1e-9
        alone = bc.plant(craft, ["elbow"], ["attitude"], pose={"elbow": float(angle)})
        assert plant.modes == alone.modes
        np.testing.assert_allclose(plant.frequency, alone.frequency, rtol=1e-12)
    oscillates = [[name in plant.modes for name in scheduled.modes] for plant in scheduled]
    assert np.array_equal(np.isfinite(scheduled.frequency), oscillates)
    a, b, c, d = ((one[1] + one[3]) / 2.0 for one in scheduled.matrices())
    between = control.ss(a, b, c, d)(S, squeeze=False)[2, 0]
    true = attitude_of_arm(damping, kp, angles[2])
    assert np.max(np.abs(between / true - 1.0)) < 0.01
    words = json.loads(scheduled.write(tmp_path / "p.json").read_text())
    assert words["ModeName"] == list(scheduled.modes)
    assert np.array_equal([[w is not None for w in row] for row in words["Frequency"]], oscillates)


def test_a_wheel_that_turns_in_one_pose_alone(made):
    inputs = ["torque:bus", "spin"]
    scheduled = bc.plant(made, inputs, pose=["drive", "fast"])
    for pose, plant in zip(["drive", "fast"], scheduled, strict=True):
        alone = bc.plant(made, inputs, pose=pose)(S, squeeze=False)
        size = np.abs(alone).max((1, 2), keepdims=True)
        assert np.max(np.abs(plant(S, squeeze=False) - alone) / size) < AGREE


def test_files_hold_the_poses(made, tmp_path):
    poses = [{"drive": 0.5}, "drive"]
    scheduled = bc.plant(made, ["torque:bus"], pose=poses)
    matlab = loadmat(scheduled.write(tmp_path / "p.mat"))
    plain = np.load(scheduled.write(tmp_path / "p.npz"))
    words = json.loads(scheduled.write(tmp_path / "p.json").read_text())
    assert words["PoseLabel"] == list(plain["PoseLabel"]) == ["drive 28.6479°", "drive"]
    assert [str(cell[0]) for cell in matlab["PoseLabel"][:, 0]] == words["PoseLabel"]
    assert words["PoseJoint"] == ["drive", "turn", "reach"]
    assert words["PoseUnit"] == ["rad", "rad", "m"]
    for pose in (matlab["Pose"], plain["Pose"], np.array(words["Pose"])):
        np.testing.assert_allclose(pose, [[0.5, 0.0, 0.0], [0.5, 0.2, 0.1]])
    assert "Angle" not in words
    assert matlab["A"].shape == (*scheduled[0].A.shape, 2)


# -- the command line ------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def place(made, tmp_path_factory):
    out = tmp_path_factory.mktemp("poses")
    made.write(out / "flexible.xml")
    return out


def asked(place, capsys, monkeypatch, *words):
    monkeypatch.chdir(place)
    common = ["plant", "flexible.xml", "--from", "torque:bus", "-o", "p.npz", "--force"]
    return run([*common, *words], capsys, monkeypatch)


def test_poses_are_given_in_degrees_and_metres(place, capsys, monkeypatch):
    words = ["--pose", "drive=45,reach=0.25", "--pose", "drive", "--pose", "turn=-30", "--json"]
    code, out, _ = asked(place, capsys, monkeypatch, *words)
    record = json.loads(out)
    assert code == 0
    assert record["poses"] == ["drive 45°, reach 0.25 m", "drive", "turn -30°"]
    assert record["angles"] is None
    assert len(record["frequencies"]) == 3
    plain = np.load(place / "p.npz")
    np.testing.assert_allclose(plain["Pose"][0], [np.pi / 4.0, 0.0, 0.25])
    # one pose is one plant
    code, out, _ = asked(place, capsys, monkeypatch, "--pose", "drive=45,reach=0.25", "--json")
    assert code == 0
    assert json.loads(out)["poses"] is None
    assert np.load(place / "p.npz")["A"].ndim == 2


@pytest.mark.slow
def test_radians_typed_for_degrees_are_noted(place, capsys, monkeypatch):
    """A slide's metres and plain degrees are not."""

    def noted(*words):
        code, out, _ = asked(place, capsys, monkeypatch, *words, "--json")
        assert code == 0
        found = json.loads(out)["warnings"]
        return [each["message"] for each in found if each["code"] == "pose-in-radians"]

    for word, degrees in {"1.5708": 90, "-0.7854": -45}.items():
        (text,) = noted("--pose", f"turn={word}")
        assert f"--pose turn={word}: poses are in degrees" in text
        assert f"give turn={degrees}" in text
    assert len(noted("--pose", "drive=0,0.785,1.5708")) == 2
    assert noted("--pose", "drive=1.56,reach=0.5236") == []
    assert noted("--pose", "drive", "--pose", "turn=45") == []


@pytest.mark.slow
def test_positions_of_one_joint_are_a_pose_each(place, capsys, monkeypatch):
    code, out, _ = asked(place, capsys, monkeypatch, "--pose", "drive=0,45", "--json")
    record = json.loads(out)
    assert code == 0
    assert record["angles"] == pytest.approx([0.0, 45.0])
    by_angle = np.load(place / "p.npz")["A"]
    words = ["--pose", "drive=0", "--pose", "drive=45", "--json"]
    code, out, _ = asked(place, capsys, monkeypatch, *words)
    assert code == 0
    assert json.loads(out)["poses"] == record["poses"] == ["drive 0°", "drive 45°"]
    assert np.array_equal(np.load(place / "p.npz")["A"], by_angle)
    assert asked(place, capsys, monkeypatch, "--pose", "drive")[0] == 0
    model = mujoco.MjModel.from_xml_path(str(place / "flexible.xml"))
    at_key = bc.plant(model, ["torque:bus"], pose="drive")
    assert np.array_equal(np.load(place / "p.npz")["A"], at_key.A)
    # of a slide in metres
    code, out, _ = asked(place, capsys, monkeypatch, "--pose", "reach=0,0.5", "--json")
    assert code == 0
    assert json.loads(out)["poses"] == ["reach 0 m", "reach 0.5 m"]
    assert json.loads(out)["angles"] == pytest.approx([0.0, 0.5])


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--pose", "turn"], "--pose 'turn' is a joint and no keyframe"),
        (["--pose", "drives"], "keyframe of --pose = 'drives' is unknown; did you mean 'drive'"),
        (["--pose", "driv=4"], "joint of --pose = 'driv' is unknown; did you mean 'drive'"),
        (["--pose", "drive=x"], "--pose 'drive=x' is not JOINT=POSITION"),
        (["--pose", "drive=4,turn"], "--pose 'drive=4,turn' is not JOINT=POSITION"),
        (["--pose", "drive=1,drive=2"], "gives 'drive' twice"),
        (
            ["--pose", "drive=1,turn=2", "--pose", "turn=2,drive=1.0"],
            "--pose 'turn=2,drive=1.0' is given twice; give each pose once",
        ),
        (["--pose", "drive=nan"], "drive = nan cannot be used"),
        (["--pose", "drive=180"], "its range, -114.592 to 114.592 degrees"),
        (["--pose", "reach=3"], "joint 'reach' = 3 is outside its range, -1 to 1 m"),
        (["--pose", "drive=0,1", "--pose", "drive"], "--pose 'drive=0,1' is several poses"),
        (["--pose", "drive=0,1,turn=2"], "gives several positions of a joint, and another"),
        (["--pose", "drive=0,180"], "its range, -114.592 to 114.592 degrees"),
    ],
)
def test_mistakes_on_the_command_line_are_named(place, capsys, monkeypatch, words, sentence):
    code, out, error = asked(place, capsys, monkeypatch, *words)
    assert code == 2
    assert out == ""
    assert sentence in error


def driven_wing(key: str = ""):
    """A wing on a drive, whose modes are chosen for turns about z at the file's poses."""
    craft = f"""<mujoco><worldbody><body name="bus"><freejoint/>
      <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
      <body name="yoke" pos="0.5 0 0"><joint name="drive" axis="1 0 0"/>
        <inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/><site name="mount"/></body>
      </body></worldbody>
      <actuator><position joint="drive" kp="1e5" kv="100"/></actuator>{key}</mujoco>"""
    section = bc.Equivalent(
        bending_stiffness_xy=2e3,
        bending_stiffness_xz=4e3,
        torsion_stiffness=1e4,
        linear_mass=4.0,
        polar_inertia=1.0,
    )
    scene = bc.Scene(bandwidth=5.0, axes=("z",), tolerance=1e-3)
    wing = bc.Spec(name="wing", segment=(bc.Segment(length=8.0, section=section),), scene=scene)
    return bc.embed(craft, {"mount": wing})


def test_a_pose_that_the_file_was_not_fitted_for_is_told():
    bare = driven_wing()
    keyed = driven_wing('<keyframe><key name="side" qpos="0 0 0 1 0 0 0 1.5708"/></keyframe>')
    side = {"drive": 1.5708}
    turned = [
        np.append(craft.model.qpos0[:7], [1.5708, *craft.model.qpos0[8:]])
        for craft in (bare, keyed)
    ]
    assert [a.fit.target.keys() for a in bare.appendages] == [{"xy"}]
    assert bare.error_at(turned[0]) > 0.1  # the plane that shakes z there was left out
    assert keyed.error_at(turned[1]) == pytest.approx(keyed.promise.poses["side"], rel=1e-6)

    def told(model, pose):
        plant = bc.plant(model, ["torque:bus"], ["attitude"], pose)
        plant = getattr(plant, "plants", (plant,))[0]
        return "pose-not-proven" in [getattr(w, "code", "") for w in plant.warnings]

    assert [told(bare, pose) for pose in (None, side, [{"drive": 0.0}, side])] == [
        False,
        True,
        True,
    ]
    assert not told(keyed, side)
    assert [told(craft.model, side) for craft in (bare, keyed)] == [True, False]
    with pytest.raises(bc.InputError, match="qpos"):
        bare.error_at(turned[0][:-1])
