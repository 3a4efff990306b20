"""Closed forms beside a hinge that is driven through an angle, and beside runs in one go."""

import mujoco
import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import beamchain.engine.driven_hinge as driven_module
import beamchain.engine.rollout as rollout_module
import beamchain.engine.runs as runs_module
from beamchain.errors import EngineError
from formulas import (
    DriveOfHinge,
    RunOfDrive,
    Turn,
    drive_of,
    rotation_vectors,
    run_of_drive,
    seconds_of,
    seen,
    simulate_hub,
)


@pytest.mark.parametrize("time", [-0.3, 0.0, 0.3, 1.0, 1.7, 2.0, 2.4])
def test_a_turn_is_the_polynomial_of_degree_seven_that_is_flat_at_both_ends(time):
    # a' = 140 s^3 (1 - s)^3
    rate = Polynomial([0.0, 0.0, 0.0, 140.0]) * Polynomial([1.0, -1.0]) ** 3
    share, s = rate.integ(), np.clip(time / 2.0, 0.0, 1.0)
    assert share(1.0) == pytest.approx(1.0)
    wanted = [0.9 * share(s), 0.9 * rate(s) / 2.0, 0.9 * rate.deriv()(s) / 4.0]
    assert Turn(0.9, 2.0).at(time) == pytest.approx(wanted, abs=1e-12)
    assert Turn(-0.9, 2.0).rate == pytest.approx(0.9 / 2.0 * rate(0.5))


def test_means_of_torques_are_those_of_their_spline():
    times = np.linspace(0.0, 1.0, 11)
    torques = np.column_stack([times**3, 2.0 - times])
    nothing = np.zeros((0, 0))
    drive = DriveOfHinge(Turn(1.0, 1.0), 0.5, 3, times, torques, nothing, nothing)
    found = drive.means(0.3, 4)
    edges = np.array([0.0, 0.3, 0.6, 0.9, 1.0])  # nothing is pushed beyond the end
    assert found[:, 0] == pytest.approx(np.diff(edges**4 / 4.0) / 0.3, rel=1e-12)
    assert found[:, 1] == pytest.approx(np.diff(2.0 * edges - edges**2 / 2.0) / 0.3, rel=1e-12)


# a body on the ground, with a hinge that is turned and a hinge that follows
PAIR = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="drive" axis="0 0 1"
ref="20"/><inertial pos="0 0 0" mass="2" diaginertia=".5 .5 .5"/><body pos="1 0 0">
<joint name="rail" type="slide" axis="1 0 0" stiffness="{spring}" damping=".3"/>
<inertial pos="0 0 0" mass="3" diaginertia=".2 .2 .2"/></body></body></worldbody></mujoco>"""


def test_a_held_joint_takes_the_force_that_keeps_its_body_on_its_circle(monkeypatch):
    """(J + m r^2) a'' about the hinge, and -m r a'^2 in a rail that is held at r = 1."""
    monkeypatch.setattr(driven_module, "GRID", 40)  # points of the turn at least
    model = mujoco.MjModel.from_xml_string(PAIR.format(spring=0.0))
    made = Turn(0.8, 3.0)
    joints = [model.joint("rail").id, model.joint("drive").id]
    found = drive_of(model, joints[1], joints, made, spacing=0.5, samples=9)
    assert found.times[1] == pytest.approx(0.5 / 7)
    assert len(found.times) == 8 * 7 + 1
    assert found.times[-1] == pytest.approx(4.0)
    for t, torque in list(zip(found.times, found.torques, strict=True))[::5]:
        _, rate, acceleration = made.at(t)
        assert torque == pytest.approx([-3.0 * rate**2, (0.7 + 3.0) * acceleration], abs=1e-9)
    at = [made.at(t) for t in 0.5 * np.arange(9)]
    assert found.qpos[:, 0] == pytest.approx([np.radians(20.0) + a for a, _, _ in at], abs=1e-12)
    assert found.qvel[:, 0] == pytest.approx([rate for _, rate, _ in at], abs=1e-12)
    assert np.abs(found.qpos[:, 1]).max() == 0.0


def test_a_joint_that_is_not_held_follows_as_its_spring_and_the_turn_make_it(monkeypatch):
    """m x'' = m (1 + x) a'^2 - k x - c x', by an integrator of SciPy's; the torque is that of the
    whole momentum."""
    monkeypatch.setattr(driven_module, "GRID", 60)
    model = mujoco.MjModel.from_xml_string(PAIR.format(spring=40.0))
    made = Turn(1.4, 2.0)
    joint = model.joint("drive").id
    found = drive_of(model, joint, [joint], made, spacing=0.25, samples=9)

    def flow(t, y):
        return [y[1], (1.0 + y[0]) * made.at(t)[1] ** 2 - (40.0 * y[0] + 0.3 * y[1]) / 3.0]

    times = 0.25 * np.arange(9)
    truth = solve_ivp(flow, (0.0, 2.0), [0.0, 0.0], t_eval=times, rtol=1e-11, atol=1e-13).y
    assert np.abs(truth[0]).max() > 0.02
    assert found.qpos[:, 1] == pytest.approx(truth[0], abs=5e-6)
    assert found.qvel[:, 1] == pytest.approx(truth[1], abs=2e-5)
    fine = round(0.25 / found.times[1])
    for k, (x, v) in enumerate(truth.T):
        _, rate, acceleration = made.at(times[k])
        wanted = (0.7 + 3.0 * (1.0 + x) ** 2) * acceleration + 6.0 * (1.0 + x) * v * rate
        assert found.torques[k * fine, 0] == pytest.approx(wanted, abs=1e-4)


SLIDER = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint type="slide"/>
<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body><body><joint name="one" type="slide"/>
<inertial pos="0 0 0" mass="4" diaginertia="1 1 1"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("mean_input", [False, True])
@pytest.mark.parametrize("numbers", [1, 60, 4_000_000])
def test_a_run_under_the_means_of_its_torques(mean_input, numbers, monkeypatch):
    """v_k = v_(k-1) + h f_k / m, x_k = x_(k-1) + h v_k; in pieces of any length."""
    monkeypatch.setattr(runs_module, "LARGEST", numbers)
    model = mujoco.MjModel.from_xml_string(SLIDER)
    times = np.linspace(0.0, 1.0, 41)
    torques = np.sin(3.0 * times)[:, None]
    nothing = np.zeros((0, 0))
    drive = DriveOfHinge(Turn(1.0, 1.0), 0.2, 6, times, torques, nothing, nothing)
    found = run_of_drive(model, [model.joint("one").id], drive, "Euler", 4, mean_input=mean_input)
    edges = 0.05 * np.arange(21)
    spline = CubicSpline(times, torques[:, 0])
    force = (
        np.array([spline.integrate(a, b) for a, b in zip(edges, edges[1:], strict=False)]) / 0.05
    )
    if mean_input:
        force = (force + np.concatenate([[0.0], force[:-1]])) / 2.0
    v = np.cumsum(0.05 * force / 4.0)
    x = np.cumsum(0.05 * v)
    assert found.qvel[:, 1] == pytest.approx([0.0, *v[3::4]], abs=1e-12)
    assert found.qpos[:, 1] == pytest.approx([0.0, *x[3::4]], abs=1e-12)
    assert np.abs(found.qpos[:, 0]).max() == 0.0
    assert model.opt.timestep == pytest.approx(0.05)


def test_a_run_that_breaks_off_is_refused():
    model = mujoco.MjModel.from_xml_string(SLIDER)
    times = np.linspace(0.0, 1.0, 5)
    nothing = np.zeros((0, 0))
    drive = DriveOfHinge(Turn(1.0, 1.0), 0.5, 3, times, np.full((5, 1), 1e14), nothing, nothing)
    with pytest.raises(EngineError, match=r"slew cannot be simulated with RK4 at 0\.25 s"):
        run_of_drive(model, [1], drive, "RK4", 2)


# two bodies that move by themselves, each with something on it
SEEN = """<mujoco><option gravity="0 0 -3"/><worldbody><body name="bus" pos="1 2 3"><freejoint/>
<inertial pos=".1 .2 -.1" mass="5" diaginertia="2 3 4"/><body name="link" pos=".5 0 0"><joint
axis="0 0 1" stiffness="7"/><inertial pos="1 0 .2" mass="2" diaginertia=".3 .4 .5"/><site
name="hand" pos="2 0 0" euler="10 20 30"/></body></body></worldbody></mujoco>"""


def test_a_run_seen_from_outside():
    model = mujoco.MjModel.from_xml_string(SEEN)
    random = np.random.default_rng(4)
    qpos, qvel = random.normal(size=(3, 8)), random.normal(size=(3, 7))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1)[:, None]
    found = seen(model, RunOfDrive(qpos, qvel), [1, 2], [0], 2)
    for k in range(3):
        turn = Rotation.from_quat(qpos[k, 3:7], scalar_first=True)
        outer = turn * Rotation.from_rotvec([0.0, 0.0, qpos[k, 7]])
        hinge = qpos[k, :3] + turn.apply([0.5, 0.0, 0.0])
        hand = outer * Rotation.from_euler("XYZ", [10.0, 20.0, 30.0], degrees=True)
        rotations = [turn.as_matrix(), outer.as_matrix(), hand.as_matrix()]
        assert found.rotations[k] == pytest.approx(np.array(rotations), abs=1e-12)
        places = [qpos[k, :3], hinge, hinge + outer.apply([2.0, 0.0, 0.0])]
        assert found.places[k] == pytest.approx(np.array(places), abs=1e-12)
        # by momentum and energy of the two bodies
        rate = turn.apply(qvel[k, 3:6])
        spin = rate + turn.apply([0.0, 0.0, qvel[k, 6]])
        centres = qpos[k, :3] + turn.apply([0.1, 0.2, -0.1]), hinge + outer.apply([1.0, 0.0, 0.2])
        speeds = [
            qvel[k, :3] + np.cross(rate, centres[0] - qpos[k, :3]),
            qvel[k, :3] + np.cross(rate, hinge - qpos[k, :3]) + np.cross(spin, centres[1] - hinge),
        ]
        own = [
            turn.apply(np.array([2.0, 3.0, 4.0]) * turn.inv().apply(rate)),
            outer.apply(np.array([0.3, 0.4, 0.5]) * outer.inv().apply(spin)),
        ]
        masses = 5.0, 2.0
        centre = (5.0 * centres[0] + 2.0 * centres[1]) / 7.0
        mean = (5.0 * speeds[0] + 2.0 * speeds[1]) / 7.0
        parts = [
            h + m * np.cross(c - centre, v - mean)
            for h, m, c, v in zip(own, masses, centres, speeds, strict=True)
        ]
        assert found.momentum[k] == pytest.approx(parts[0] + parts[1], abs=1e-11)
        assert found.share[k] == pytest.approx(np.linalg.norm(parts[1]), abs=1e-11)
        energy = 3.5 * qpos[k, 7] ** 2
        for m, c, v, h, w in zip(masses, centres, speeds, own, (rate, spin), strict=True):
            energy += m * v @ v / 2.0 + h @ w / 2.0 + 3.0 * m * c[2]
        assert found.energy[k] == pytest.approx(energy, abs=1e-10)


# -- runs in one go --------------------------------------------------------------------------------
def test_rotation_vectors_of_quaternions():
    vectors = np.array([[0.3, -0.2, 0.9], [0.0, 0.0, 0.0], [0.0, 3.0, 0.0], [1e-9, 2e-9, 0.0]])
    quaternions = Rotation.from_rotvec(vectors).as_quat(scalar_first=True)
    assert rotation_vectors(quaternions) == pytest.approx(vectors, rel=1e-12, abs=1e-24)
    tiny = np.array([[1.0, 1e-200, 0.0, 0.0]])  # of which the sine is nothing
    assert rotation_vectors(tiny)[0, 0] == pytest.approx(2e-200)


HUB = """<mujoco><option gravity="0 0 0"/><worldbody><body pos="1 2 3"><freejoint/>
<inertial pos="0 0 0" mass="20" diaginertia="4 5 6"/></body><body><joint/><geom size=".1"/></body>
</worldbody></mujoco>"""


@pytest.mark.parametrize("numbers", [1, 180, 4_000_000])
def test_a_hub_under_a_wrench_that_changes(numbers, monkeypatch):
    monkeypatch.setattr(runs_module, "LARGEST", numbers)
    steps, h = 30, 0.02
    wrench = np.zeros((steps, 6))
    wrench[:, 2], wrench[:, 4] = np.cos(np.arange(steps)), 0.4 * np.arange(steps)
    model = mujoco.MjModel.from_xml_string(HUB)
    found = simulate_hub(model, "Euler", h, wrench)
    for column, inertia in ((2, 20.0), (4, 5.0)):
        moved = np.cumsum(np.cumsum(h**2 * wrench[:, column] / inertia))
        assert found.motion[:, column] == pytest.approx(moved, abs=1e-9)
    assert np.abs(found.motion[:, [0, 1, 3, 5]]).max() < 1e-12
    assert (model.opt.timestep, model.opt.integrator) == (h, 0)
    broken = np.zeros((steps, 6))
    broken[20:, 0] = 1e14
    motion = simulate_hub(mujoco.MjModel.from_xml_string(HUB), "Euler", 10.0, broken).motion
    assert not np.all(np.isfinite(motion))
    assert np.all(np.isfinite(motion[:10])) == (numbers < 1000)  # pieces before it stand


def test_a_wrench_that_changes_seldom_is_called_for_as_seldom(monkeypatch):
    """As many steps as there are, under each of its values; in one go where it changes at every
    fifth step or oftener."""
    called = []
    step = mujoco.mj_step

    def counted(model, data, nstep):
        called.append((nstep, float(data.qfrc_applied[0])))
        step(model, data, nstep=nstep)

    monkeypatch.setattr(rollout_module.mujoco, "mj_step", counted)
    model = mujoco.MjModel.from_xml_string(HUB)
    wrench = np.zeros((30, 6))
    wrench[7:20, 0], wrench[20:, 0] = 500.0, 500.0 + 1e-6  # 2e-9 of it
    assert seconds_of(model, "RK4", 0.03, wrench) >= 0.0
    assert called == [(7, 0.0), (13, 500.0), (10, 500.0 + 1e-6)]
    assert (model.opt.timestep, model.opt.integrator) == (0.03, 1)
    # by rounding no change
    wrench[20:, 0] = 500.0 + 1e-7
    called.clear()
    seconds_of(model, "Euler", 0.03, wrench)
    assert called == [(7, 0.0), (23, 500.0)]
    # 6 changes in 30 steps are every fifth, 7 are more often
    for changes, calls in ((6, 7), (7, 0)):
        wrench[:, 0] = np.sum(np.arange(30)[:, None] >= 4 * np.arange(1, changes + 1), axis=1)
        called.clear()
        seconds_of(model, "Euler", 0.03, wrench)
        assert len(called) == calls


def test_the_time_of_a_run_is_that_of_its_calls(monkeypatch):
    clock = iter([10.0, 10.25, 20.0, 20.5, 30.0, 30.125])
    monkeypatch.setattr(runs_module.time, "thread_time", lambda: next(clock))
    monkeypatch.setattr(runs_module, "LARGEST", 1)
    model = mujoco.MjModel.from_xml_string(HUB)
    assert simulate_hub(model, "Euler", 0.03, np.zeros((2, 6))).seconds == 0.75
    assert seconds_of(model, "Euler", 0.03, np.zeros((9, 6))) == 0.125
