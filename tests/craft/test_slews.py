"""Large slews of an arm of two flexible links: what `stability` states of the chains and of the
step, against a geometrically exact arm and against MuJoCo by itself.

Truth: `planar_arm`, converged to 3e-7 m and rad (degree 4 against 5 of the curvature).

Tolerances: 0.2 of what is stated of the chains' error: its own reference has three times as many
modes, not all; 0.01 of the elastic motion and of the step's error, looked at at other times; 1e-9
for what RK4 keeps of the angular momentum.
"""

import json
import sys

import mujoco
import numpy as np
import pytest

import beamchain as bc
from command import call
from planar_arm import PlanarArm, Push, Rod, slew

YOUNG, DENSITY = 7e10, 2700.0
UPPER, FORE = (6.0, 0.05, 0.08), (5.0, 0.04, 0.05)
CRAFT = """<mujoco model="arm"><option timestep="{step}" gravity="0 0 0" integrator="Euler"/>
<worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="400" diaginertia="80 100 120"/><site name="shoulder" pos="0.5 0 0"/>
<body name="elbow" pos="6.5 0 0"><joint name="elbow" axis="0 0 1" {joint}/>
<inertial pos="0 0 0" mass="4" diaginertia=".02 .02 .02"/><site name="forearm"/>
<body name="hand" pos="5 0 0"><inertial pos="0 0 0" mass="20" diaginertia=".5 .5 .5"/></body>
</body></body></worldbody></mujoco>"""
STATED = 0.2
AGREES = 0.01
KEPT = 1e-9
TOLERANCE = 0.02
TRUTH = PlanarArm(
    *(Rod(a, YOUNG * z * y**3 / 12.0, DENSITY * y * z) for a, y, z in (UPPER, FORE)),
    masses=(400.0, 4.0, 20.0),
    inertias=(120.0, 0.02, 0.5),
    shoulder=0.5,
    degree=4,
)


def link(name, sizes, carries, scene=""):
    length, width_y, width_z = sizes
    return f"""name = "{name}"
[[segment]]
length = {length}
section = {{ shape = "rectangle", width_y = {width_y}, width_z = {width_z} }}
material = {{ youngs_modulus = {YOUNG}, density = {DENSITY}, poissons_ratio = 0.33 }}
[[port]]
name = "end"
x = {length}
carries = ["{carries}"]
[modes]
xy = 2
xz = 2
torsion = 1
{scene}"""


def flexible(folder, step="0.0005", joint="", scene=""):
    """The arm with its links, written to a file; its path."""
    for name, sizes, carries in (("upper", UPPER, "elbow"), ("fore", FORE, "hand")):
        (folder / f"{name}.toml").write_text(link(name, sizes, carries, scene))
    at = {"shoulder": folder / "upper.toml", "forearm": folder / "fore.toml"}
    path = folder / "flexible.xml"
    bc.embed(CRAFT.format(step=step, joint=joint), at).write(path)
    return path


def simulated(path, push, times, *, rk4=False):
    """Angles of bus and hand and places of the hand at some times, and the angular momentum about
    the centre of mass over the largest behind the elbow; the file as it is, fed with means of two
    inputs, or under RK4 without timing."""
    model = mujoco.MjModel.from_xml_path(str(path))
    if rk4:
        bc.retime(model, 0.0)
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    data, seen = mujoco.MjData(model), mujoco.MjData(model)
    dof = model.jnt_dofadr[model.joint("elbow").id]
    h = model.opt.timestep
    out = []
    wanted = set(np.round(times / h).astype(int).tolist())
    pushes = push.means(h, max(wanted) + 1)
    if not rk4:
        pushes = (pushes + np.append(0.0, pushes[:-1])) / 2.0
    for k, torque in enumerate(pushes):
        if k in wanted:
            seen.qpos[:], seen.qvel[:] = data.qpos, data.qvel
            mujoco.mj_forward(model, seen)
            mujoco.mj_subtreeVel(model, seen)
            angles = [
                np.arctan2(seen.body(name).xmat[3], seen.body(name).xmat[0])
                for name in ("bus", "hand")
            ]
            place = seen.body("hand").xpos[:2].copy()
            momentum = np.linalg.norm(seen.subtree_angmom[model.body("bus").id])
            out.append((*angles, place, momentum, behind(model, seen)))
        data.qfrc_applied[dof] = torque
        mujoco.mj_step(model, data)
    bus, hand, place, momentum, outer = (np.array(values) for values in zip(*out, strict=True))
    return bus, hand, place, np.max(momentum) / np.max(outer)


def behind(model, data):
    """Angular momentum of what is behind the elbow about the craft's centre of mass."""
    body, bus = model.body("elbow").id, model.body("bus").id
    arm = data.subtree_com[body] - data.subtree_com[bus]
    speed = data.subtree_linvel[body] - data.subtree_linvel[bus]
    own = data.subtree_angmom[body] + model.body_subtreemass[body] * np.cross(arm, speed)
    return np.linalg.norm(own)


def worst(one, other):
    apart = np.asarray(one) - np.asarray(other)
    return float(np.max(np.abs(apart) if apart.ndim == 1 else np.linalg.norm(apart, axis=1)))


def moments(row, period):
    """Times at which a slew is looked at, on its steps."""
    count = round((row.duration + period) / row.timestep)
    return row.timestep * np.unique(np.linspace(0, count, 400).astype(int))


@pytest.mark.slow
def test_what_is_stated_of_a_slew_is_what_a_geometrically_exact_arm_shows(tmp_path):
    """By 90 degrees in two durations, undamped, 20 kg in the hand."""
    path = flexible(tmp_path, scene=f"[scene]\nbandwidth = 20.0\ntolerance = {TOLERANCE}\n")
    study = bc.stability(path)
    rows = [row for row in study.slews if row.angle == np.pi / 2.0]
    assert [row.joint for row in study.slews] == ["elbow"] * 3
    assert [row.duration for row in rows] == pytest.approx(
        [rows[0].duration, 2.0 * rows[0].duration]
    )
    period = rows[0].duration / 5.0
    slowest = min(study.budgets[0].frequencies)
    assert period == pytest.approx(2.0 * np.pi / slowest)
    for row in rows:
        bus, _, hand = row.bodies
        assert [body.name for body in row.bodies] == ["bus", "elbow", "hand"]
        times = moments(row, period)
        push = Push(TRUTH, row.angle, row.duration, times[-1] + 1.0)
        exact = [np.array(values) for values in zip(*slew(TRUTH, push, times), strict=True)]
        rigid = [np.array(v) for v in zip(*(push.seen(t) for t in times), strict=True)]
        fine = simulated(path, push, times, rk4=True)
        own = simulated(path, push, times)
        for what, stated, found in (
            ("chains, bus, rad", bus.chain_attitude, worst(fine[0], exact[0])),
            ("chains, hand, m", hand.chain_place, worst(fine[2], exact[3])),
            ("step, bus, rad", bus.step_attitude, worst(own[0], fine[0])),
            ("momentum lost", row.momentum, own[3]),
            ("momentum lost by RK4", row.momentum_rk4, fine[3]),
        ):
            line = f"{row.duration:.2f} s, {what}: stated {stated:.3g}, found {found:.3g}"
            sys.stdout.write(f"{line}\n")
        # what the chains hold
        assert bus.chain_attitude == pytest.approx(worst(fine[0], exact[0]), rel=STATED)
        assert hand.chain_place == pytest.approx(worst(fine[2], exact[3]), rel=STATED)
        assert row.chain_share < TOLERANCE
        # how large the elastic motion is
        assert bus.elastic_attitude == pytest.approx(worst(exact[0], rigid[0]), rel=AGREES)
        assert hand.elastic_attitude == pytest.approx(worst(exact[1], rigid[1]), rel=AGREES)
        assert hand.elastic_place == pytest.approx(worst(exact[3], rigid[3]), rel=AGREES)
        # what the step does
        assert bus.step_attitude == pytest.approx(worst(own[0], fine[0]), rel=AGREES)
        assert hand.step_attitude == pytest.approx(worst(own[1], fine[1]), rel=AGREES)
        assert hand.step_place == pytest.approx(worst(own[2], fine[2]), rel=AGREES)
        assert row.momentum == pytest.approx(own[3], rel=AGREES)
        assert row.momentum > 1e-4
        assert row.momentum_rk4 < KEPT
        assert fine[3] < KEPT
    held = max(study.slews, key=lambda row: row.step_share)
    assert held.step_share > TOLERANCE
    assert {one.code for one in study.warnings} == {"slew-step"}


BOOM = """name = "boom"
[[segment]]
length = 8.0
section = { shape = "equivalent", bending_stiffness_xy = 2e3, linear_mass = 4.0 }
[modes]
xy = 2
xz = 0
[scene]
bandwidth = 10.0
tolerance = 0.003
"""
DRIVEN = """<mujoco model="driven"><option timestep="{step}" gravity="0 0 0" integrator="{by}"/>
<worldbody><body name="bus">{free}<inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
<body name="yoke" pos="0.5 0 0"><joint name="drive" axis="0 0 1" {joint}/>
<inertial pos="0 0 0" mass="2" diaginertia=".1 .1 .1"/><site name="mount"/></body></body>
</worldbody>{more}</mujoco>"""


def driven(folder, joint, *, step="0.01", by="Euler", free="<freejoint/>", more=""):
    """A boom behind a drive, written to a file; its path."""
    (folder / "boom.toml").write_text(BOOM)
    text = DRIVEN.format(step=step, by=by, free=free, joint=joint, more=more)
    path = folder / "driven.xml"
    bc.embed(text, {"mount": folder / "boom.toml"}).write(path)
    return path


@pytest.mark.slow
def test_a_drive_is_slewed_within_its_range_and_the_record_says_it_all(tmp_path):
    path = driven(tmp_path, 'range="-40 20"')
    done = call("inspect", path, "--steps", "-o", tmp_path / "out")
    assert done.status == 0, done.err
    assert "Slews of hinges: what the chains hold" in done.out
    record = json.loads((tmp_path / "out/stability.json").read_text())
    assert [row["joint"] for row in record["slews"]] == ["drive"] * 2
    assert [row["angle"] for row in record["slews"]] == pytest.approx([-np.radians(40.0)] * 2)
    for row in record["slews"]:
        assert row["rate"] == pytest.approx(35.0 / 16.0 * abs(row["angle"]) / row["duration"])
        assert row["momentum_rk4"] < KEPT < 1e-5 < row["momentum"]
        assert [body["name"] for body in row["bodies"]] == ["bus", "yoke"]
    codes = {item["code"] for item in record["warnings"]}
    assert codes == {"slew-chain", "slew-step"}
    page = (tmp_path / "out/report.html").read_text()
    assert "what the chains hold" in page
    assert "what Euler at 0.01 s does" in page


@pytest.mark.slow
def test_a_servo_turns_the_drive_it_holds_under_rk4(tmp_path):
    servo = '<actuator><position joint="drive" kp="500" kv="50"/></actuator>'
    rows = bc.stability(driven(tmp_path, "", more=servo, by="RK4", step="0.002")).slews
    assert {row.integrator for row in rows} == {"RK4"}
    assert max(row.momentum for row in rows) < 1e-7
    assert max(row.step_share for row in rows) < 1e-4


@pytest.mark.parametrize(
    ("joint", "free"),
    [
        pytest.param('stiffness="30"', "<freejoint/>", id="sprung"),
        pytest.param("", "", id="base", marks=pytest.mark.slow),
    ],
)
def test_without_a_hinge_to_slew_nothing_changes(tmp_path, joint, free):
    study = bc.stability(driven(tmp_path, joint, free=free))
    assert study.slews == []
    assert study.warnings == []


@pytest.mark.slow
def test_marks_that_lead_nowhere_leave_the_step_limits(tmp_path):
    """A drive whose mark was taken out of the file: its limits stay, and why it was not slewed."""
    path = driven(tmp_path, "")
    text = path.read_text().replace('"at": "mount"', '"at": "gone"')
    path.write_text(text)
    study = bc.stability(path)
    assert study.rows
    assert study.slews == []
    assert [one.code for one in study.warnings] == ["large-motion-unknown"]


@pytest.mark.slow
def test_a_servo_whose_kv_limits_rk4_is_slewed_at_a_step_that_it_leaves(tmp_path):
    """RK4 is stable to 2.785 I/kv of the servo, here below a sixteen
    hundredth of a period; file and finely divided chains are slewed all the same."""
    servo = '<actuator><position joint="drive" kp="4e4" kv="8e3"/></actuator>'
    path = driven(tmp_path, "", more=servo, by="implicitfast", step="0.002")
    study = bc.stability(path)
    assert not [w for w in study.warnings if "unstable" in w]
    assert study.slews
    limit = next(row.largest for row in study.rows if row.integrator == "RK4")
    assert all(row.step_rk4 < limit for row in study.slews)
    assert limit < study.slews[0].duration / 5.0 / 1600.0
    assert max(row.momentum_rk4 for row in study.slews) < 1e-5  # 4e-6, near the limit
    # 2e-6 rad of half a turn, where RK4 is near its limit
    assert max(row.error_rk4 for row in study.slews) < 5e-6


@pytest.mark.slow
def test_a_hinge_that_is_not_slewed_is_refused_by_name(tmp_path):
    path = driven(tmp_path, "")
    with pytest.raises(bc.InputError, match=r"joints = 'driver'.* those are: drive\."):
        bc.stability(path, joints=["driver"])
    with pytest.raises(bc.InputError, match="boom.toml has no hinges"):
        bc.stability(tmp_path / "boom.toml", joints=["drive"])


TWO = DRIVEN.replace('<joint name="drive"', '<joint name="tilt" axis="0 1 0"/><joint name="drive"')


@pytest.mark.slow
def test_one_hinge_of_two_is_slewed_and_a_long_run_says_where_it_is(tmp_path):
    (tmp_path / "boom.toml").write_text(BOOM)
    text = TWO.format(step="0.01", by="Euler", free="<freejoint/>", joint="", more="")
    bc.embed(text, {"mount": tmp_path / "boom.toml"}).write(tmp_path / "two.xml")
    said: list[str] = []
    study = bc.stability(tmp_path / "two.xml", said.append, ["drive"])
    assert {row.joint for row in study.slews} == {"drive"}
    (first, *_) = (text for text in said if text.startswith("slewing drive by 90 degrees"))
    assert first.endswith("(hinge 1 of 1, slew 1 of 3)")


def test_a_range_of_force_does_not_hide_a_step_that_is_unstable(tmp_path):
    """RK4 takes kv at the start of a stage: what grows comes to the range soon. Truth: the closed
    form of a damped rotor, 2.785 I / kv."""
    (tmp_path / "rotor.xml").write_text(
        '<mujoco model="rotor"><option timestep="1e-4" gravity="0 0 0"/><worldbody><body>'
        '<joint name="drive" axis="0 0 1"/><inertial pos="0 0 0" mass="2" diaginertia="2 2 2"/>'
        '</body><body pos="9 0 0"><joint axis="0 0 1" stiffness="5"/><inertial pos="0 0 0" mass="2"'
        ' diaginertia="2 2 2"/></body></worldbody><actuator><position joint="drive" kp="0" '
        'kv="400" forcerange="-1e-9 1e-9"/></actuator></mujoco>'
    )
    rows = {row.integrator: row for row in bc.stability(tmp_path / "rotor.xml").rows}
    assert rows["RK4"].largest == pytest.approx(2.785 * 2.0 / 400.0, rel=2e-3)
    assert rows["Euler"].largest == pytest.approx(2.0 * 2.0 / 400.0, rel=5e-3)
