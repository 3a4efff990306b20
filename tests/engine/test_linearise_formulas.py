"""Closed forms beside A and B undone: ports of dense matrices, their couplings and their poles."""

import mujoco
import numpy as np
import pytest
from scipy.linalg import expm

import beamchain as bc
from beamchain.errors import EngineError
from beamchain.ports.motions import system_matrix
from formulas import (
    Held,
    check_freedoms,
    implicit_stiffness,
    mass_of_alone,
    motor_freedoms,
    rounding_of_differences,
    runge_kutta_change,
)

RANDOM = np.random.default_rng(5)
W = np.array([1.5, 2.5, 6.0])
RATIOS = np.array([0.01, 0.03, 0.02])
ROWS = np.array([[0.9, 0.4], [-0.5, 0.7], [0.3, 0.6]])
RIGID = np.array([[4.0, 1.0], [1.0, 3.0]])


def linearisation(stiffness, damping, inputs, driven, a=None, timestep=0.02):
    nothing = np.zeros((0, 0))
    size = len(stiffness)
    return bc.results.Linearisation(
        stiffness,
        damping,
        inputs,
        nothing if a is None else a,
        nothing,
        nothing,
        nothing,
        timestep,
        "Euler",
        tuple(f"j{k}" for k in range(size)),
        driven,
    )


def bench(turn=None):
    """Root motions, then modes in coordinates that mix them: M^-1 K and the rest."""
    mix = np.array([[1.0, 0.4, -0.2], [0.3, 1.2, 0.1], [-0.5, 0.2, 0.9]]) if turn is None else turn
    whole = np.block([[RIGID, ROWS.T @ mix], [mix.T @ ROWS, mix.T @ mix]])
    stiffness, damping = np.zeros((5, 5)), np.zeros((5, 5))
    stiffness[2:, 2:] = mix.T @ np.diag(W**2) @ mix
    damping[2:, 2:] = mix.T @ np.diag(2.0 * RATIOS * W) @ mix
    inverse = np.linalg.inv(whole)
    # a motor on the second root motion stands first, one that drives nothing between
    inputs = np.column_stack([inverse[:, 1], RANDOM.normal(size=5), inverse[:, 0]])
    return linearisation(inverse @ stiffness, inverse @ damping, inputs, (1, -1, 0))


def test_a_port_is_read_back_from_its_matrices():
    found = bench().port()
    assert found.frequencies == pytest.approx(W, rel=1e-10)
    assert found.damping == pytest.approx(RATIOS, rel=1e-9)
    # the motors stand in the order of the actuators
    order = [1, 0]
    assert found.rigid_mass == pytest.approx(RIGID[np.ix_(order, order)], rel=1e-9)
    signs = np.sign(found.participation[:, 0] * ROWS[:, 1])
    assert signs[:, None] * found.participation == pytest.approx(ROWS[:, order], rel=1e-8)
    ballast = np.diag([0.5, 0.25])
    less = bench().port(ballast=ballast)
    assert less.rigid_mass == pytest.approx(RIGID[np.ix_(order, order)] - ballast, rel=1e-9)
    with pytest.raises(EngineError, match="no joint of the port is driven"):
        bench().port((2, 3, 4))


def test_a_port_of_some_freedoms_holds_the_others():
    """The first root motion and the first two modes, as if the rest did not move."""
    found = bench(np.eye(3)).port((0, 2, 3, 4))
    # of M^-1 a part is taken, so that the second root motion follows as it likes: its mass is off
    whole = np.block([[RIGID, ROWS.T], [ROWS, np.eye(3)]])
    loose = whole[np.ix_([0, 2, 3, 4], [0, 2, 3, 4])]
    loose = loose - np.outer(whole[[0, 2, 3, 4], 1], whole[1, [0, 2, 3, 4]]) / RIGID[1, 1]
    squares = np.linalg.eigvals(np.linalg.solve(loose[1:, 1:], np.diag(W**2)))
    assert found.frequencies == pytest.approx(np.sqrt(np.sort(squares.real)), rel=1e-9)


def test_the_sign_of_a_root_motion_is_turned():
    turn = np.diag([-1.0, 1.0])
    held = bench().held([1, 0], [2, 3, 4], [0, 2], turn)
    plain = bench().held([1, 0], [2, 3, 4], [0, 2], np.eye(2))
    assert held.apparent == pytest.approx(turn @ plain.apparent @ turn)
    both = (held.reaction @ held.drive, turn @ plain.reaction @ plain.drive @ turn)
    assert both[0] == pytest.approx(both[1])
    assert held.squares == pytest.approx(W**2, rel=1e-9)
    assert held.ratios == pytest.approx(RATIOS, rel=1e-9)
    # the sum of W^2 L L^T
    wanted = ROWS[:, [1, 0]].T @ np.diag(W**2) @ ROWS[:, [1, 0]]
    assert plain.reaction @ plain.drive == pytest.approx(wanted, rel=1e-9)


def test_a_joint_without_a_spring_has_no_port():
    soft = linearisation(np.diag([0.0, 0.0]), np.zeros((2, 2)), np.eye(2)[:, :1], (0,))
    with pytest.raises(EngineError, match="no positive stiffness"):
        soft.port()
    slow = linearisation(np.diag([0.0, 0.04]), np.zeros((2, 2)), np.eye(2)[:, :1], (0,)).port()
    assert slow.frequencies == pytest.approx([0.2])
    assert not slow.damping.any()


def test_modes_of_equal_frequency_are_rows_of_their_common_sum():
    """Two modes of one frequency in any combination, one that is alone, three in two."""
    rows = np.array([[2.0, 0.0], [0.0, 0.5], [0.3, 0.4]])
    turn = np.array([[0.8, 0.6], [-0.6, 0.8]])
    mixed = np.array(rows)
    mixed[:2] = turn @ rows[:2]
    squares = np.array([4.0, 4.0, 9.0])
    held = Held(np.eye(2), squares, (squares[:, None] * mixed).T, mixed, np.zeros(3))
    found = held.rows([[0, 1], [2]])
    assert np.abs(found) == pytest.approx(np.abs(rows), abs=1e-12)
    assert found.T @ found == pytest.approx(rows.T @ rows)
    same = np.full(3, 4.0)
    held = Held(np.eye(2), same, (same[:, None] * mixed).T, mixed, np.zeros(3))
    found = held.rows([[0, 1, 2]])
    assert found.T @ found == pytest.approx(rows.T @ rows)
    assert np.abs(found[2]).max() == 0.0
    assert np.linalg.norm(found[0]) > np.linalg.norm(found[1])


def test_what_rounding_leaves_of_differences():
    """Of all forces over the masses, at most, and of each velocity over the step."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep=".02" gravity="0 0 -3"/><worldbody><body><joint name="a"
        type="slide" axis="0 0 1" damping=".3" stiffness="7"/><inertial pos="0 0 0" mass="2"
        diaginertia="1 1 1"/></body><body><joint name="b" type="slide" axis="0 0 1"/>
        <inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/></body></worldbody>
        <actuator><motor joint="a" gear="4"/></actuator></mujoco>"""
    )
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = [0.1, 0.2], [0.5, -0.6]
    data.ctrl[:], data.qfrc_applied[:] = -0.25, [0.7, -0.9]
    # weight, spring and damper, motor, what is applied
    forces = [2.0 * 3.0 + (7.0 * 0.1 + 0.3 * 0.5) + 4.0 * 0.25 + 0.7, 5.0 * 3.0 + 0.9]
    most = max(forces[0] / 2.0, forces[1] / 5.0)
    wanted = 4.0 * 2.0**-52 * (most + np.array([0.5, 0.6]) / 0.02) / 1e-6
    assert rounding_of_differences(model, data, 1e-6) == pytest.approx(wanted, rel=1e-12)
    assert data.qacc.tolist() == [0.0, 0.0]  # nothing has moved


def test_frequencies_above_zero():
    mass = RANDOM.normal(size=(4, 4))
    mass = mass @ mass.T + 3.0 * np.eye(4)
    sprung = np.diag([0.0, 9.0, 2.0, 50.0])
    found = linearisation(np.linalg.solve(mass, sprung), 0.0 * mass, mass[:, :0], ()).frequencies()
    wanted = np.linalg.eigvals(np.linalg.solve(mass, sprung)).real
    assert found == pytest.approx(np.sqrt(np.sort(wanted)[1:]), rel=1e-10)
    soft = np.diag([0.0, 1e-6, 0.04])
    found = linearisation(soft, 0.0 * soft, soft[:, :0], ()).frequencies()
    assert found == pytest.approx([1e-3, 0.2])
    # two joints with one spring between them move together without it
    between = 7.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    pair = np.linalg.solve(np.diag([2.0, 3.0]), between)
    found = linearisation(pair, 0.0 * pair, pair[:, :0], ()).frequencies()
    assert found == pytest.approx([np.sqrt(7.0 * (1 / 2.0 + 1 / 3.0))])


def test_poles_of_a_step_are_frequencies_and_ratios():
    poles = np.array([-0.3 + 4.0j, -0.1 + 1.5j])
    blocks = [np.exp(0.02 * p) for p in poles]
    a = np.zeros((5, 5))
    for k, z in enumerate(blocks):
        a[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[z.real, z.imag], [-z.imag, z.real]]
    a[4, 4] = 0.7
    frequencies, ratios = linearisation(a, a, a, (), a).discrete_frequencies()
    assert frequencies == pytest.approx(np.sort(np.abs(poles)))
    assert ratios == pytest.approx([0.1 / np.abs(poles[1]), 0.3 / np.abs(poles[0])])


# -- coupling --------------------------------------------------------------------------------------
def test_coupling_is_what_two_groups_share():
    stiffness, damping = np.diag([4.0, 9.0, 16.0, 25.0]), np.diag([0.1, 0.2, 0.3, 0.4])
    plain = linearisation(stiffness, damping, np.zeros((4, 0)), ())
    groups = [(0, 1), (2,), (3,)]
    assert plain.coupling(groups) == 0.0
    stiffness[0, 1] = stiffness[1, 0] = 3.0  # within a group
    stiffness[1, 3], stiffness[3, 1] = 0.5, -0.2
    damping[0, 2], damping[2, 0] = 2e-3, 3e-3
    found = linearisation(stiffness, damping, np.zeros((4, 0)), ()).coupling(groups)
    assert found == pytest.approx(np.sqrt(0.5 * 0.2 / (9.0 * 25.0)))
    damping[0, 2], damping[2, 0] = 2e-2, 3e-2
    found = linearisation(stiffness, damping, np.zeros((4, 0)), ()).coupling(groups)
    assert found == pytest.approx(np.sqrt(2e-2 * 3e-2 / (0.1 * 0.3)))


def test_crosstalk_is_the_largest_on_nine_frequencies_beside_the_axis():
    """s = w (0.05 + i), from 0.3 of the first frequency to 3 times the last."""
    stiffness = np.array([[4.0, 0.3], [0.3, 30.0]])
    inputs = np.array([[1.0, 0.02], [0.05, 2.0]])
    damping = np.array([[0.9, 0.02], [0.01, 4.0]])
    made = linearisation(stiffness, damping, inputs, (0, 1))
    w = np.sqrt(np.sort(np.linalg.eigvals(stiffness)))
    worst = 0.0
    for omega in np.geomspace(0.3 * w[0], 3.0 * w[1], 9):
        s = omega * (0.05 + 1j)
        x = np.linalg.solve(s**2 * np.eye(2) + s * damping + stiffness, inputs)
        size = np.sqrt(np.abs(x[0, 0] * x[1, 1]))
        worst = max(worst, abs(x[0, 1]) / size, abs(x[1, 0]) / size)
    assert made.coupling([(0,), (1,)]) == pytest.approx(worst, rel=1e-9)
    # rigid ones at one frequency, where x = M^-1 B / s^2
    loose = linearisation(np.zeros((2, 2)), np.zeros((2, 2)), inputs, (0, 1))
    assert loose.coupling([(0,), (1,)]) == pytest.approx(0.05 / np.sqrt(2.0))
    assert loose.coupling([(0, 1)]) == 0.0


# -- models ----------------------------------------------------------------------------------------
def test_a_runge_kutta_step_is_the_exponential_to_fourth_order():
    f = 0.1 * RANDOM.normal(size=(3, 3))
    found = np.eye(len(f)) + runge_kutta_change(f)
    powers = [np.linalg.matrix_power(f, k) / d for k, d in enumerate((1, 1, 2, 6, 24, 120))]
    assert found == pytest.approx(sum(powers[:5]), rel=1e-13)
    assert np.abs(expm(f) - found - powers[5]).max() < 0.1 * np.abs(powers[5]).max()


ARM = """<mujoco><option timestep="{step}" integrator="{integrator}" gravity="0 0 0"/><worldbody>
<body name="a"><joint name="x" type="slide" stiffness="30" damping=".9"/>
<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><body name="b" pos="1 0 0"><joint name="turn"
axis="0 1 0" stiffness="5" damping=".2" armature=".3"/><inertial pos="0 0 .5" mass="3"
diaginertia=".1 .2 .3"/></body></body></worldbody><actuator><motor name="push" joint="x"/>
<motor name="strong" joint="turn" gear="2"/><motor name="turn" joint="turn"/>
<motor site="s" name="site"/></actuator></mujoco>""".replace('<motor site="s" name="site"/>', "")


def arm(step=0.01, integrator="implicitfast"):
    return mujoco.MjModel.from_xml_string(ARM.format(step=step, integrator=integrator))


MASS = np.array([[5.0, 0.0], [0.0, 0.2 + 3.0 * 0.25 + 0.3]])  # x is along z by default
SPRINGS, DAMPERS = np.diag([30.0, 5.0]), np.diag([0.9, 0.2])


@pytest.mark.parametrize("step", [0.01, 0.3])
def test_matrices_are_those_of_the_model_at_any_step(step):
    """The turning arm's mass centre is above its hinge, so that it moves across the slide."""
    found = bc.linearise(arm(step))
    inverse = np.linalg.inv(MASS)
    assert found.stiffness == pytest.approx(inverse @ SPRINGS, rel=1e-7, abs=1e-7)
    assert found.damping == pytest.approx(inverse @ DAMPERS, rel=1e-7, abs=1e-7)
    force = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 1.0]])
    assert found.inputs == pytest.approx(inverse @ force, rel=1e-7, abs=1e-7)
    assert found.driven == motor_freedoms(arm()) == (0, -1, 1)
    assert found.joints == ("x", "turn")
    system = found.continuous
    assert pytest.approx(np.vstack([np.zeros((2, 3)), found.inputs])) == system.B
    assert system.A[2:, :2] == pytest.approx(-found.stiffness)
    assert found.timestep == step
    # v+ = v + h (-M^-1 (K q + D v+)), and the position with the new rate
    inside = np.linalg.inv(MASS + step * DAMPERS)
    assert found.a[2:, :2] == pytest.approx(-step * inside @ SPRINGS, rel=1e-7, abs=1e-7)
    assert found.a[:2, 2:] == pytest.approx(step * inside @ MASS, rel=1e-7, abs=1e-7)


def test_states_of_actuators_and_rigid_motions_are_no_stiffness():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option gravity="0 0 0" timestep=".05"/><worldbody><body><joint name="x"
        type="slide"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body><body><joint
        name="y" stiffness="7"/><inertial pos="0 0 0" mass="1" diaginertia="3 3 4"/></body>
        </worldbody><actuator><general joint="y" dyntype="filter" dynprm=".5" gear="3"/><motor
        joint="y"/></actuator></mujoco>"""
    )
    found = bc.linearise(model)
    assert found.stiffness == pytest.approx(np.diag([0.0, 7.0 / 4.0]), rel=1e-7, abs=1e-7)
    assert not found.stiffness[:, 0].any()
    assert found.inputs[:, 1] == pytest.approx([0.0, 0.25], abs=1e-7)
    assert found.inputs.shape == (2, 2)
    with pytest.raises(EngineError, match="actuators with 1 states.*first_order"):
        _ = found.continuous
    assert found.discrete.A.shape == (5, 5)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    with pytest.raises(EngineError, match="actuators with 1 states"):
        _ = bc.linearise(model).discrete
    discrete = implicit_stiffness(model, mujoco.MjData(model), np.zeros((2, 2)))
    assert discrete == pytest.approx(np.diag([0.0, 7.0 / 4.0]), rel=1e-6, abs=1e-6)


def test_a_step_of_runge_kutta_is_that_of_states_and_held_inputs():
    step = 0.02
    found = bc.linearise(arm(step, "RK4"))
    whole = np.zeros((7, 7))
    inverse = np.linalg.inv(MASS)
    whole[:4, :4] = system_matrix(inverse @ SPRINGS, inverse @ DAMPERS)
    whole[2:4, 4:] = inverse @ np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 1.0]])
    exact = expm(step * whole)
    assert found.integrator == "RK4"
    assert found.a == pytest.approx(exact[:4, :4], abs=1e-8)
    assert found.b == pytest.approx(exact[:4, 4:], abs=1e-8)


def test_some_bodies_alone_have_their_own_mass():
    model = arm()
    alone = mass_of_alone(model, [model.body("b").id])
    assert alone == pytest.approx(np.diag([3.0, MASS[1, 1]]), abs=1e-8)
    alone = mass_of_alone(model, [model.body("a").id])
    assert alone == pytest.approx(np.diag([2.0, 0.3]), abs=1e-8)  # and the armature


def test_springs_of_joints_are_implicit_in_discrete():
    model = arm(0.05)
    data = mujoco.MjData(model)
    found = implicit_stiffness(model, data, np.linalg.inv(MASS) @ DAMPERS)
    assert found == pytest.approx(np.linalg.inv(MASS) @ SPRINGS, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize(("count", "kept"), [(0, False), (1, True), (2000, True), (2001, False)])
def test_up_to_2000_freedoms_are_linearised(count, kept):
    class Model:
        nv = count

    if kept:
        check_freedoms(Model())
    else:
        with pytest.raises(EngineError, match="freedom"):
            check_freedoms(Model())
