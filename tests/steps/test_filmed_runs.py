"""Tests internals, `steps.deployment`, and `beamchain render --run` and `--torque`: runs with
hinges that latch and under commands, beside closed forms of a hinge or a wheel.

LATCHED: Runge-Kutta's step and frames between steps [rad].
"""

import os
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import beamchain as bc
from beamchain.cli import app
from beamchain.engine import backend
from beamchain.steps.deployment import commands, hinge_stages, simulate_run

LATCHED = 2e-5
DRIVEN = """<mujoco><option timestep="0.002" gravity="0 0 0" integrator="RK4"/><worldbody>
<body name="bus">{}</body></worldbody>
<keyframe><key name="folded" qpos="{}"/></keyframe></mujoco>"""
FLAP = """<body><joint name="{}" axis="0 0 1" stiffness="2" springref="100" range="0 90"/>
<inertial pos="1 0 0" mass="2" diaginertia=".1 .2 .2"/><geom size=".1" mass="0"/></body>"""
SWING = np.sqrt(2.0 / (2.0 + 0.2))  # rad/s
REACHED = np.arccos(1.0 - 90.0 / 100.0) / SWING  # s, from rest at 0 to the stop


def flaps(*names):
    inside = "".join(FLAP.format(name) for name in names)
    return mujoco.MjModel.from_xml_string(DRIVEN.format(inside, " ".join("0" for _ in names)))


def test_a_run_goes_on_after_its_last_hinge_has_latched():
    """0.25 rad at 0.8 rad/s on the way to 0.3 rad: there it stays."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><compiler angle="radian"/><option timestep="0.01" gravity="0 0 0"/><worldbody>
        <body><joint name="coasts" axis="0 0 1" range="-1 0.3"/><inertial pos="0 0 0" mass="1"
        diaginertia=".2 .2 .3"/></body></worldbody>
        <keyframe><key name="moving" qpos="0.25" qvel="0.8"/></keyframe></mujoco>"""
    )
    run = simulate_run(model, "moving", 0.2, 5, [["coasts"]])
    assert run.waiting == ()
    assert [one.time for one in run.latched] == pytest.approx([0.05 / 0.8], abs=0.0101)
    assert run.positions[0, 0] == 0.25
    assert run.positions[1, 0] == pytest.approx(0.25 + 0.05 * 0.8, abs=1e-9)


def test_hinges_unfold_stage_by_stage_as_closed_forms_say():
    model = flaps("a_left", "a_right", "b")
    before = np.array(model.jnt_stiffness)
    run = simulate_run(model, "folded", 5.0, 101, hinge_stages(model, ["a_*", "b"]))
    assert [one.joint for one in run.latched] == ["a_left", "a_right", "b"]
    assert run.waiting == ()
    times = [one.time for one in run.latched]
    assert times == pytest.approx([REACHED, REACHED, 2.0 * REACHED], abs=2.1 * 0.002)
    swinging = run.times < REACHED - 0.01
    moved = np.radians(100.0) * (1.0 - np.cos(SWING * run.times[swinging]))
    for hinge in (0, 1):
        np.testing.assert_allclose(run.positions[swinging, hinge], moved, atol=LATCHED)
    np.testing.assert_allclose(run.positions[swinging, 2], 0.0, atol=1e-12)
    held = run.positions[run.times > 2.0 * REACHED + 0.1]
    assert np.abs(np.degrees(held) - 90.0).max() < 5.0  # they ring about their stop
    np.testing.assert_array_equal(run.start, run.positions[[0]].repeat(101, 0))
    np.testing.assert_array_equal(model.jnt_stiffness, before)


def test_hinges_that_have_no_time_to_latch_are_named():
    model = flaps("a", "b")
    run = simulate_run(model, "folded", 1.2 * REACHED, 20, hinge_stages(model, ["a", "b"]))
    assert [one.joint for one in run.latched] == ["a"]
    assert run.waiting == ("b",)


def test_the_start_of_a_run_flies_with_the_spacecraft():
    text = """<mujoco><option gravity="0 0 0"/><worldbody><body><freejoint/><geom size=".5"/>
    <body><joint name="hinge"/><geom pos="1 0 0" size=".1"/></body></body></worldbody>
    <keyframe><key name="adrift" qpos="0 0 0 1 0 0 0 .5" qvel="1 0 0 0 0 0 2"/></keyframe>
    </mujoco>"""
    run = simulate_run(mujoco.MjModel.from_xml_string(text), "adrift", 1.0, 11)
    assert run.positions[-1, 0] > 0.5
    np.testing.assert_array_equal(run.start[:, :7], run.positions[:, :7])
    np.testing.assert_array_equal(run.start[:, 7], 0.5)
    assert run.positions[-1, 7] > 1.0


WHEEL = """<mujoco><option timestep="0.01" gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<geom type="box" size=".5 .5 .5" density="0"/><inertial pos="0 0 0" mass="9" diaginertia="3 3 3"/>
<body name="wheel"><joint name="wheel" axis="0 0 1"/><inertial pos="0 0 0" mass="1"
diaginertia=".1 .1 .2"/></body>{}</body></worldbody><actuator>
<motor name="rw" joint="wheel" gear="2" ctrlrange="-1 1"/><motor name="other" joint="wheel"/>
</actuator><keyframe><key name="pushed" ctrl="0 0.5"/></keyframe></mujoco>"""
BENDS = """<body pos="1 0 0"><joint axis="0 0 1" stiffness="2"/>
<geom type="box" size=".4 .1 .1" pos=".5 0 0" mass="1"/></body>"""
HISTORY = "time,rw\n0,0.3\n0.5,-0.1\n0.8,0\n"


def test_actuators_follow_the_history_that_is_given():
    """The wheel against the bus: torque over the reduced inertia, twice integrated; a row holds
    until the next, the last to the end."""
    model = mujoco.MjModel.from_xml_string(WHEEL.format(""))
    run = simulate_run(model, None, 1.0, 11, (), commands(model, HISTORY, "h"))
    reduced = 3.0 * 0.2 / 3.2
    torque = np.repeat([0.6, -0.2, 0.0], [50, 30, 20])
    rates = np.cumsum(torque) * 0.01 / reduced
    wanted = np.append(0.0, np.cumsum(rates) * 0.01)[::10]
    np.testing.assert_allclose(run.positions[:, 7], wanted, rtol=1e-6, atol=1e-9)
    pushed = simulate_run(model, "pushed", 1.0, 11, (), commands(model, HISTORY, "h"))
    rates = np.cumsum(torque + 0.5) * 0.01 / reduced  # what the keyframe commands besides
    wanted = np.append(0.0, np.cumsum(rates) * 0.01)[::10]
    np.testing.assert_allclose(pushed.positions[:, 7], wanted, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize(
    ("history", "said"),
    [
        ("time,wheel\n0,1\n1,0\n", "one or more of rw, other"),
        ("time,rw,rw\n0,1,1\n1,0,0\n", "one or more of rw, other"),
        ("time,rw\n0,1.5\n1,0\n", r"rw = 1.5 is beyond its ctrlrange \[-1, 1\]"),
        ("time,rw\n0,1\n", "at least two rows"),
        ("time,rw\n1,1\n2,0\n", "row 1 has the time 1; give times that start at 0"),
        ("time,rw\n0,1\n2,0\n1,0\n", "row 3 has the time 1; give times that start at 0"),
        ("time,rw\n0,1\n1,x\n", "row 2 is 1, x; give one finite number per column"),
    ],
)
def test_histories_that_no_actuator_can_follow_are_refused(history, said):
    with pytest.raises(bc.InputError, match=said):
        commands(mujoco.MjModel.from_xml_string(WHEEL.format("")), history, "h")


def test_a_file_without_actuators_follows_no_history():
    with pytest.raises(bc.InputError, match="the spacecraft has no actuator"):
        commands(flaps("a"), HISTORY, "h")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--torque", "h.csv", "--modes", "1"], "--modes and --torque are both given"),
        (["--run", "1", "--modes", "1"], "--modes and --run are both given"),
        (["--run", "1", "--joint", "a"], "--joint and --run are both given"),
        (["--pose", "folded"], "--pose is of a run"),
        (["--latch", "a"], "--latch is of a run"),
        (["--run", "1", "--angle", "9"], "--angle is of a turn"),
        (["--run", "0"], "--run = 0 is out of range"),
        (["--run", "nan"], "--run = nan is out of range"),
        (["--run", "1", "--exaggerate", "2"], "--run is drawn to scale"),
    ],
)
def test_options_of_a_run_are_checked(arguments, said, tmp_path):
    out = tmp_path / "o"
    done = CliRunner().invoke(app, ["render", "none.xml", "-o", str(out), *arguments])
    assert isinstance(done.exception, bc.BeamchainError)
    assert said in str(done.exception)
    assert not out.exists()


def render(arguments, folder, renderer):
    return subprocess.run(
        [sys.executable, "-m", "beamchain", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "MUJOCO_GL": renderer},
    )


@pytest.mark.slow
@pytest.mark.parametrize("renderer", ["egl", "osmesa"])
def test_a_run_is_filmed(renderer, tmp_path):
    if not backend._works(renderer):
        pytest.skip(f"MuJoCo cannot draw with {renderer} on this machine")
    (tmp_path / "flaps.xml").write_text(DRIVEN.format(FLAP.format("a") + FLAP.format("b"), "0 0"))
    arguments = ["render", "flaps.xml", "-o", "o", "--width", "200"]
    run = ["--run", "4", "--pose", "folded", "--latch", "a", "--latch", "b"]
    done = render([*arguments, *run], tmp_path, renderer)
    assert done.returncode == 0, done.stderr
    assert "simulated for 4 s from keyframe 'folded'" in done.stdout
    assert f"a latched at {REACHED:.2f}" in done.stdout
    assert "had not latched" not in done.stdout
    with Image.open(tmp_path / "o" / "flaps.gif") as moving:
        assert moving.n_frames == 84
        shots = [np.asarray(moving.convert("RGB")).astype(int)]
        moving.seek(83)
        shots.append(np.asarray(moving.convert("RGB")).astype(int))
    assert np.abs(shots[0] - shots[1]).max() > 50  # it moves
    short = [*arguments, "--run", "1", "--pose", "folded", "--latch", "a", "--force"]
    done = render(short, tmp_path, renderer)
    assert "warning: a had not latched after 1 s" in done.stdout


@pytest.mark.slow
def test_a_run_under_commands_is_filmed(tmp_path):
    renderer = next((one for one in ("egl", "osmesa") if backend._works(one)), None)
    if renderer is None:
        pytest.skip("MuJoCo cannot draw on this machine")
    (tmp_path / "wheel.xml").write_text(WHEEL.format(BENDS))
    (tmp_path / "h.csv").write_text(HISTORY)
    arguments = ["render", "wheel.xml", "-o", "o", "--width", "200"]
    done = render([*arguments, "--torque", "h.csv"], tmp_path, renderer)
    assert done.returncode == 0, done.stderr
    assert "simulated for 0.8 s from the pose of the file under commands of rw" in done.stdout
    assert (tmp_path / "o" / "wheel.gif").exists()
    (tmp_path / "brief.csv").write_text("time,rw\n0,1\n1e-6,0\n")
    brief = render([*arguments, "--torque", "brief.csv", "--force"], tmp_path, renderer)
    assert brief.returncode == 2
    assert "--torque ends at 1e-06 s; give times from 0.001 to 100000 s" in brief.stderr
    longer = [*arguments, "--torque", "h.csv", "--run", "3", "--pose", "pushed", "--force"]
    done = render(longer, tmp_path, renderer)
    assert "simulated for 3 s from keyframe 'pushed' under commands of rw" in done.stdout
    done = render([*arguments, "--torque", "none.csv", "--force"], tmp_path, renderer)
    assert done.returncode == 2
    assert "--torque 'none.csv' cannot be read" in done.stderr
