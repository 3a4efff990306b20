"""Closed forms beside the budget of a model, held inputs, runs of a scene, and a turn's error."""

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import beamchain as bc
from beamchain.errors import EngineError
from beamchain.steps.budget import budget, linear_model, preload
from beamchain.steps.deployment import hinge_stages, simulate_run
from beamchain.steps.joint_time import joint_armature, take_out_joints, timed_joints, write_joints
from beamchain.steps.modal import TimingMark, modal_tendons
from beamchain.steps.turn import central_inertia, turn_error

# -- budgets ---------------------------------------------------------------------------------------
TWO = """<mujoco model="two"><option gravity="0 0 0" timestep="0.05"/><worldbody>
<body><joint name="slide" type="slide" axis="1 0 0" stiffness="18" damping="0.4"/>
<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>
<body pos="0 9 0"><joint name="hinge" axis="0 1 0" stiffness="{}" springref="{}"/>
<inertial pos="0 0 0" mass="1" diaginertia="3 4 3"/></body></worldbody></mujoco>"""


def two(stiffness=100.0, slack=0.0):
    return mujoco.MjModel.from_xml_string(TWO.format(stiffness, np.degrees(slack)))


def test_a_budget_of_two_oscillators():
    """3 rad/s with 0.2 of damping over 2 w, and 5 rad/s without."""
    found = budget(two())
    assert found.frequencies == pytest.approx([3.0, 5.0])
    assert found.ratios == pytest.approx([0.2 / 6.0, 0.0], abs=1e-12)
    assert found.ratios[1] == 0.0
    assert found.timestep == 0.05
    # Euler takes the damper at the end of the step: (M + h D) v' = M v - h K q
    poles = []
    for k, c in ((9.0, 0.2), (25.0, 0.0)):
        drag = 1.0 + 0.05 * c
        step = np.array([[1.0 - 0.0025 * k / drag, 0.05 / drag], [-0.05 * k / drag, 1.0 / drag]])
        poles.append(np.log(np.linalg.eigvals(step).astype(complex))[0] / 0.05)
    wanted = [[abs(s), -s.real / abs(s)] for s in poles]
    np.testing.assert_allclose(found.shown["Euler"], wanted, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(found.added("Euler"), np.array(wanted)[:, 1] - [0.2 / 6.0, 0.0],
                               atol=1e-9)  # fmt: skip
    assert found.largest_step["Euler"] == pytest.approx(2.0 / 5.0, rel=1e-6)
    assert found.largest_step["RK4"] == pytest.approx(2.0 * np.sqrt(2.0) / 5.0, rel=1e-3)
    record = found.as_dict()
    assert record["omega_max"] == pytest.approx(5.0)
    assert [one["frequency"] for one in record["modes"]] == pytest.approx([3.0, 5.0])
    assert record["modes"][1]["shown"]["Euler"]["frequency"] == pytest.approx(wanted[1][0])
    at_once = budget(two(), timestep=0.41)
    assert at_once.timestep == 0.41
    assert np.all(np.isnan(at_once.shown["Euler"]))
    assert np.all(np.isfinite(at_once.shown["RK4"]))
    for stiffness, damping in ((0.0, 0.4), (18.0, 50.0)):  # at rest, and overdamped
        rests = two(0.0)
        rests.jnt_stiffness[0], rests.dof_damping[0] = stiffness, damping
        with pytest.raises(EngineError, match="nothing oscillates"):
            budget(rests)


def test_euler_takes_a_joint_s_damper_at_the_start_of_the_step_where_that_is_switched_off():
    """h^2 w^2 + 2 h c = 4 at z = -1, of 5 rad/s with c = d / I = 2 1/s."""
    model = two()
    model.dof_damping[1] = 8.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    longest = (np.sqrt(4.0 + 4.0 * 25.0) - 2.0) / 25.0
    assert budget(model).largest_step["Euler"] == pytest.approx(longest, rel=1e-6)
    assert budget(model).largest_step["implicit"] > 0.4


def test_a_soft_spring_alone_is_no_rigid_motion():
    model = two(0.0)
    model.jnt_stiffness[0], model.dof_damping[0] = 0.05, 0.0
    assert linear_model(model).stiffness[0, 0] == pytest.approx(0.05 / 2.0, rel=1e-6)


def test_the_matrices_behind_a_budget():
    found = linear_model(two())
    np.testing.assert_allclose(np.diag(found.stiffness), [9.0, 25.0], rtol=1e-6)
    np.testing.assert_allclose(np.diag(found.damping), [0.2, 0.0], atol=1e-9)
    np.testing.assert_allclose(found.stiffness - np.diag(np.diag(found.stiffness)), 0.0, atol=1e-6)


FREE = """<mujoco><option gravity="0 0 0"/><worldbody>
<body pos="3 -2 5" euler="20 35 -50"><freejoint/>
<inertial pos="0.1 0.2 0.3" mass="2" diaginertia="1 2 2.5"/><body pos="1 0 0" euler="10 40 5">
<joint name="wheel" axis="0 0 1"/><inertial pos="0.3 0 0" mass="1" diaginertia="1 1 1"/>
</body></body></worldbody></mujoco>"""


def test_nothing_but_rigid_bodies_has_no_matrix_even_of_rounding():
    still = mujoco.MjModel.from_xml_string(FREE)
    assert not linear_model(still).stiffness.any()
    assert linear_model(still).damping.shape == (7, 7)
    damped = mujoco.MjModel.from_xml_string(FREE)
    damped.dof_damping[6] = 0.05
    assert linear_model(damped).damping.any()
    sprung = mujoco.MjModel.from_xml_string(FREE)
    sprung.jnt_stiffness[1] = 0.07
    assert linear_model(sprung).stiffness.any()


@pytest.mark.parametrize(
    ("name", "slide", "hinge", "says"),
    [
        ("slide", -0.5, 0.05, "9 N"),
        ("hinge", 0.1, 0.3, "30 N m"),
        ("", 0.0, 0.0, ""),
    ],
)
def test_the_spring_that_pulls_hardest_is_named(name, slide, hinge, says):
    """18 N/m and 100 N m/rad; what falls without a pull is no matter of springs."""
    model = two()
    model.opt.gravity[0] = 5.0
    model.qpos_spring[:] = slide, hinge
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    found = preload(model, data)
    assert bool(found) == bool(name)
    if name:
        assert f"'{name}'" in found
        assert found.endswith(f" {says}")


# -- inputs ----------------------------------------------------------------------------------------
def test_held_inputs_are_the_mean_of_this_and_the_last_one():
    held = bc.HeldInput()
    assert [float(held(value)) for value in (2.0, 6.0, -1.0)] == [1.0, 4.0, 2.5]
    held.reset()
    assert float(held(8.0)) == 4.0
    started = bc.HeldInput(before=[1.0, -3.0])
    assert started([2.0, 5.0]).tolist() == [1.5, 1.0]
    assert started([[0.0, 0.0], [4.0, 1.0]][0]).tolist() == [1.0, 2.5]
    started.reset()
    assert started([0.0, 0.0]).tolist() == [0.5, -1.5]
    with pytest.raises(bc.InputError, match="shape"):
        started([1.0, 2.0, 3.0])


def test_held_inputs_are_cut_to_the_range_before_the_mean():
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><body><joint name="a"/>
        <geom size="1"/></body></worldbody><actuator><motor joint="a" ctrllimited="true"
        ctrlrange="-1 3"/><motor joint="a"/></actuator></mujoco>""")
    held = bc.HeldInput(before=[-7.0, -7.0], model=model)
    assert held([9.0, 9.0]).tolist() == [1.0, 1.0]
    assert held([1.0, 1.0]).tolist() == [2.0, 5.0]
    worlds = bc.HeldInput(model=model)
    assert worlds([[0.0, 1.0], [9.0, 3.0]]).tolist() == [[0.0, 0.5], [1.5, 1.5]]
    with pytest.raises(bc.InputError, match="2 actuators"):
        held([1.0, 2.0, 3.0])


# -- runs of a scene -------------------------------------------------------------------------------
MOVES = """<mujoco><option gravity="0 0 0" timestep="0.01"/><worldbody>
<body><freejoint/><inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/>
<body><joint name="wheel_1" axis="0 0 1" damping="{}"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></body></worldbody>
<keyframe><key name="go" qpos="1 2 3 1 0 0 0 0.5" qvel="0.3 0 -0.2 0 0 0 0" time="7"/></keyframe>
</mujoco>"""


def test_frames_of_a_run_stand_at_even_times_and_a_base_takes_its_shape_along():
    model = mujoco.MjModel.from_xml_string(MOVES.format(0.0))
    found = simulate_run(model, "go", 0.9, 4)
    assert found.times.tolist() == pytest.approx([0.0, 0.3, 0.6, 0.9])
    for time, place, shape in zip(found.times, found.positions, found.start, strict=True):
        wanted = [1.0 + 0.3 * time, 2.0, 3.0 - 0.2 * time, 1.0, 0.0, 0.0, 0.0, 0.5]
        assert place == pytest.approx(wanted, abs=1e-12)
        assert shape == pytest.approx(wanted, abs=1e-12)
    assert found.latched == ()
    assert found.waiting == ()
    rest = simulate_run(model, None, 0.1, 2)
    assert rest.positions[1] == pytest.approx(model.qpos0)
    with pytest.raises(bc.InputError, match="--pose"):
        simulate_run(model, "gone", 0.1, 2)
    assert hinge_stages(model, ["wheel_*"]) == [["wheel_1"]]


def test_of_a_run_the_shape_alone_keeps_its_joints():
    model = mujoco.MjModel.from_xml_string(MOVES.format(0.0))
    model.key_qvel[0, 6] = 2.0
    found = simulate_run(model, "go", 0.5, 6)
    assert found.positions[:, 7] == pytest.approx(0.5 + 2.0 * found.times, abs=1e-9)
    assert found.start[:, 7].tolist() == [0.5] * 6
    np.testing.assert_array_equal(found.start[:, :7], found.positions[:, :7])


# -- joints ----------------------------------------------------------------------------------------
SERVO = TWO.replace(
    "</mujoco>",
    '<actuator><general joint="slide" biastype="affine" biasprm="0 -7 -6"/></actuator></mujoco>',
)


@pytest.mark.parametrize(
    ("integrator", "at_end"), [("Euler", 0.4), ("implicitfast", 6.4), ("implicit", 6.4)]
)
@pytest.mark.parametrize("damping", [0.0, 30.0])
def test_armature_of_sprung_joints(integrator, at_end, damping):
    """k h^2/12 + h (d_e - d_i)/2, and no less than what would make its own armature zero; a servo
    adds 7 N/m and 6 N s/m to the slide, which Euler takes at the start of the step."""
    model = mujoco.MjModel.from_xml_string(SERVO.format(100.0, 0.0))
    model.dof_damping[1] = damping
    model.dof_armature[1] = 0.5
    found = joint_armature(model, modal_tendons(model), integrator, 0.05, slowed=False)
    soft = joint_armature(two(0.09), modal_tendons(two(0.09)), integrator, 0.05, slowed=False)
    assert soft[1] == pytest.approx(0.09 * 0.0025 / 12.0)
    late = 0.05 * (6.4 - at_end - at_end) / 2.0
    first = max(25.0 * 0.0025 / 12.0 + late, 0.0)
    second = max(100.0 * 0.0025 / 12.0 - 0.05 * damping / 2.0, -0.5)
    assert found == pytest.approx([first, second], abs=1e-9)


@pytest.mark.parametrize(("step", "times"), [(0.282, 1.0), (0.284, 3.0)])
def test_a_joint_that_turns_far_in_a_step_is_slowed(step, times):
    """h^2 k / J = 2 at 5 rad/s from 0.2828 s on: k h^2/4 for k h^2/12."""
    for slowed in (False, True):
        found = joint_armature(two(), modal_tendons(two()), "Euler", step, slowed=slowed)
        wanted = 100.0 * step**2 / 12.0 * (times if slowed else 1.0)
        assert found[1] == pytest.approx(wanted)
        damped = two()
        damped.dof_damping[1] = 3.0
        rk4 = joint_armature(damped, modal_tendons(damped), "RK4", step, slowed=slowed)
        wanted = 100.0 * step**2 / 8.0 + 3.0 * step / 2.0
        assert rk4[1] == pytest.approx(wanted if slowed and times > 1.0 else 0.0)


@pytest.mark.parametrize(("size", "refused"), [(0.0, False), (0.05, True)])
def test_timing_of_joints_is_written_and_taken_out_where_there_is_no_friction(size, refused):
    model = two()
    model.dof_frictionloss[1] = size
    model.dof_armature[1] = 0.5
    before = np.array(model.dof_solimp)
    if refused:
        with pytest.raises(bc.InputError, match="'hinge'"):
            write_joints(model, np.array([0.0, 0.3]), TimingMark(0.05, "Euler", 5))
        return
    write_joints(model, np.array([0.0, 0.3]), TimingMark(0.05, "Euler", 5))
    assert model.dof_armature.tolist() == [0.0, 0.8]
    assert timed_joints(model) == [1]
    assert model.dof_solimp[1].tolist() == [0.05, 0.0, 5.0, 0.5, 0.0]
    take_out_joints(model)
    assert model.dof_armature.tolist() == [0.0, 0.5]
    np.testing.assert_array_equal(model.dof_solimp, before)
    assert timed_joints(model) == []


# -- turns -----------------------------------------------------------------------------------------
INERTIA = np.array([[4.0, 0.3, -0.2], [0.3, 6.0, 0.5], [-0.2, 0.5, 9.0]])


@pytest.mark.parametrize("size", [1.0, 0.1])
def test_error_of_a_turn_by_a_radian(size):
    """Of Euler's rule, whose gyroscopic moment is that of the step before."""
    rates = size * np.array([0.6, -0.48, 0.64])
    h = 0.07 / size
    count = int(np.ceil(1.0 / 0.07 / np.linalg.norm(rates / size)))
    taken = np.array(rates)
    for _ in range(count):
        taken = taken - h * np.linalg.solve(INERTIA, np.cross(taken, INERTIA @ taken))
    exact = solve_ivp(
        lambda _, w: np.linalg.solve(INERTIA, -np.cross(w, INERTIA @ w)),
        (0.0, count * h),
        rates,
        rtol=1e-11,
        atol=1e-13,
    ).y[:, -1]
    wanted = np.linalg.norm(taken - exact) / np.linalg.norm(rates)
    assert turn_error(INERTIA, rates, h) == pytest.approx(wanted, rel=1e-4)
    assert turn_error(INERTIA, rates, h, "RK4") < 1e-3 * wanted
    assert turn_error(INERTIA, (0.0, 0.0, 0.0), h) == 0.0


def test_inertia_about_the_mass_centre_of_a_mass_matrix():
    """J + m (c.c - c c^T) about the origin, m [c x] beside it."""
    mass, c = 7.0, np.array([0.4, -0.3, 0.2])
    cross = np.cross(np.eye(3), c).T  # [c x]
    whole = np.zeros((6, 6))
    whole[:3, :3], whole[3:, :3], whole[:3, 3:] = mass * np.eye(3), mass * cross, -mass * cross
    whole[3:, 3:] = INERTIA + mass * (c @ c * np.eye(3) - np.outer(c, c))
    np.testing.assert_allclose(central_inertia(whole), INERTIA, rtol=1e-12)


# -- made exact in time ----------------------------------------------------------------------------
BOOM = """<mujoco><option gravity="0 0 0" timestep="0.01"/><worldbody>
<body name="bus"><freejoint/><inertial pos="0 0 0" mass="8" diaginertia="5 6 7"/>
<body name="link" pos="1 0 0"><joint name="hinge" axis="0 0 1"/>
<inertial pos="0.5 0 0" mass="1.5" diaginertia="0.5 0.5 0.625"/></body></body></worldbody>
<tendon><fixed name="boom_mode1_xy" stiffness="20"><joint joint="hinge" coef="1"/>
</fixed></tendon><keyframe><key name="far" qpos="4 -1 2 0.5 0.5 -0.5 0.5 0"/></keyframe></mujoco>"""


@pytest.mark.parametrize("pose", [None, "far"])
@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
def test_the_mode_of_a_held_boom_is_exact_wherever_the_craft_is(integrator, pose):
    """1 + a = k h^2 / (4 sin^2(w h / 2)), without damping."""
    model = mujoco.MjModel.from_xml_string(BOOM)
    done = bc.retime(model, 0.05, integrator, pose=pose)
    wanted = 20.0 * 0.05**2 / (4.0 * np.sin(np.sqrt(20.0) * 0.05 / 2.0) ** 2) - 1.0
    assert done.model.tendon_armature[0] == pytest.approx(wanted, rel=1e-9)
    assert done.model.tendon_stiffness[0] == 20.0
    assert done.model.opt.timestep == 0.05
    (mode,) = done.modes
    assert (mode.name, mode.slowed) == ("boom_mode1_xy", False)
    assert mode.frequency == pytest.approx(np.sqrt(20.0))
