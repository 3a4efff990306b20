"""Closed forms beside a turn from rest to rest: its torques, its length, the mode that rings."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import beamchain as bc
from beamchain.errors import EngineError
from formulas import (
    Slew,
    check_steps,
    drive_in_hinge,
    drive_on_hub,
    hinge_to_turn,
    impulse,
    long_enough,
    mode_to_ring,
    run_of_push,
    simulate_slew,
    without_actuators,
)

# two bodies on hinges, of which the outer one is off its axis: the inertia depends on its angle
ARM = """<mujoco><worldbody><body name="bus" pos="1 2 3" euler=".3 -.4 .8"><freejoint/>
<inertial pos=".2 -.1 .3" quat=".9 .1 -.3 .2" mass="20" diaginertia="4 5 6"/>
<body name="link" pos=".5 .1 0"><joint name="hinge" axis="0 0 1" damping=".7" ref="10"
range="-120 150"/><inertial pos="1 .4 .2" mass="3" diaginertia=".3 .3 .4"/>
<body name="tip" pos="2 0 0"><joint name="soft" axis="0 1 0" stiffness="5"/>
<inertial pos=".5 0 0" mass="1" diaginertia=".1 .1 .1"/></body></body>
<body name="other"><joint name="slide" type="slide"/><joint name="bare"/><inertial pos="0 0 0"
mass="1" diaginertia=".1 .1 .1"/></body></body></worldbody><actuator>
<position name="servo" joint="hinge" kp="30"/><motor name="motor" joint="bare"/>
<motor name="in" jointinparent="hinge"/></actuator></mujoco>"""
ANGLE, DURATION = 0.9, 2.0


def arm():
    return mujoco.MjModel.from_xml_string(ARM)


def mass_at(model, angle):
    data = mujoco.MjData(model)
    data.qpos[model.joint("hinge").qposadr] += angle
    mujoco.mj_forward(model, data)
    out = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, out)
    return out


def sign_mean(before, after):
    """Mean over a step of 1 in the first half of the turn, -1 in the second, 0 beyond."""

    def inside(start, end):
        return max(min(after, end) - max(before, start), 0.0)

    return (inside(0.0, DURATION / 2.0) - inside(DURATION / 2.0, DURATION)) / (after - before)


STEPS = [(0.2, 0.3), (0.95, 1.15), (1.4, 1.5), (1.9, 2.3), (2.5, 2.6)]


@pytest.mark.parametrize("time", [0.0, 0.3, 1.0, 1.7, 2.0, 2.4])
def test_the_integral_of_forwards_and_back(time):
    wanted = time if time < 1.0 else max(2.0 - time, 0.0)
    assert impulse(time, 2.0) == pytest.approx(wanted)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(("before", "after"), STEPS)
def test_the_torque_on_a_hub_is_that_of_its_inertia_with_all_that_it_carries(axis, before, after):
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body name="bus" pos="1 2 3" euler=".3 -.4 .8"><freejoint/><inertial
        pos=".2 -.1 .3" quat=".9 .1 -.3 .2" mass="20" diaginertia="4 5 6"/></body></worldbody>
        </mujoco>"""
    )
    data = mujoco.MjData(model)
    drive_on_hub(model, 1, axis)(ANGLE, DURATION)(data, before, after)
    turn = Rotation.from_quat([0.9, 0.1, -0.3, 0.2], scalar_first=True).as_matrix()
    # the torque about an axis that makes an acceleration of one about it, all others as they come
    inverse = turn @ np.diag([1 / 4.0, 1 / 5.0, 1 / 6.0]) @ turn.T
    size = 4.0 * ANGLE / DURATION**2 / inverse[axis, axis] * sign_mean(before, after)
    mujoco.mj_forward(model, data)
    line = data.body("bus").xmat.reshape(3, 3)[:, axis]
    assert data.xfrc_applied[1] == pytest.approx([0, 0, 0, *(size * line)], abs=1e-12)
    assert data.qacc[3 + axis] == pytest.approx(
        4.0 * ANGLE / DURATION**2 * sign_mean(before, after), abs=1e-12
    )


@pytest.mark.parametrize("angle", [0.9, -0.7])
def test_the_torque_in_a_hinge_is_that_of_the_inertia_it_feels(angle):
    """J a'' + J' a'^2 / 2 + c a', with 1 / J the mobility of the hinge, sprung joints held."""
    model = arm()
    joint, held = model.joint("hinge").id, [model.joint("soft").id]
    dof = int(model.jnt_dofadr[joint])
    loose = np.delete(np.arange(model.nv), model.joint("soft").dofadr)

    def felt(turned):
        inside = np.linalg.inv(mass_at(model, turned)[np.ix_(loose, loose)])
        return 1.0 / inside[dof, dof]

    data = mujoco.MjData(model)
    push = drive_in_hinge(model, joint, held, angle)(angle, DURATION)
    most = 4.0 * angle / DURATION**2
    for before, after in STEPS:
        push(data, before, after)
        middle = min((before + after) / 2.0, DURATION)
        turned = most * middle**2 / 2.0
        if middle > DURATION / 2.0:
            turned = angle - most * (DURATION - middle) ** 2 / 2.0
        rate = most * (middle if middle < DURATION / 2.0 else DURATION - middle)
        slope = (felt(turned + 1e-4) - felt(turned - 1e-4)) / 2e-4
        wanted = felt(turned) * most * sign_mean(before, after)
        wanted += slope * rate**2 / 2.0 + 0.7 * rate
        assert abs(slope) > 0.02
        assert data.qfrc_applied[dof] == pytest.approx(wanted, abs=1e-5)
    assert np.count_nonzero(np.delete(data.qfrc_applied, dof)) == 0


@pytest.mark.parametrize(
    ("angle", "fits"), [(139.0, True), (141.0, False), (-129.0, True), (-131.0, False)]
)
def test_a_hinge_turns_within_its_range(angle, fits):
    """From 10 degrees, where it stands, to -120 or 150."""
    model = arm()
    held = [model.joint("soft").id]
    if fits:
        assert hinge_to_turn(model, "hinge", held, np.radians(angle)) == model.joint("hinge").id
    else:
        with pytest.raises(bc.InputError, match=f"turn to {angle + 10.0:g} degrees"):
            hinge_to_turn(model, "hinge", held, np.radians(angle))


def test_only_hinges_without_springs_turn():
    model = arm()
    held = [model.joint("soft").id]
    assert hinge_to_turn(model, "bare", held, 9.0) == model.joint("bare").id
    for name in ("soft", "slide"):
        with pytest.raises(bc.InputError, match="Only hinges without springs"):
            hinge_to_turn(model, name, held, 0.1)


def test_actuators_of_the_hinge_do_nothing():
    model = arm()
    free = without_actuators(model, model.joint("hinge").id)
    for name, gain in (("servo", 0.0), ("in", 0.0), ("motor", 1.0)):
        assert free.actuator(name).gainprm[0] == gain
        assert model.actuator(name).gainprm[0] != 0.0
    assert not free.actuator("servo").biasprm.any()


def test_a_turn_has_a_rate_an_acceleration_and_a_loudest_frame():
    positions = np.arange(20.0).reshape(4, 5) % 7.0
    made = Slew(np.zeros(4), positions, "bus", 2, -0.9, 4.0, 3.0, (1, 3))
    # bang-bang: the middle rate is twice the mean, reached in half the time
    assert made.rate == pytest.approx(2.0 * 0.9 / 4.0)
    assert made.acceleration == pytest.approx(made.rate / 2.0)
    shown = made.shown(2.5)
    wanted = np.array(positions)
    wanted[:, [1, 3]] *= 2.5
    assert np.array_equal(shown, wanted)
    assert made.loudest == int(np.argmax(np.hypot(positions[:, 1], positions[:, 3])))


BENDING = """<mujoco><option timestep=".05" gravity="0 0 0"/><worldbody><body><freejoint/>
<geom size=".1"/><body><joint axis="0 0 1"/><geom size=".1"/></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("angle", "periods"),
    [
        (0.39, 1.0),
        (-0.47, 1.1),  # 0.4 times 1.1^2 = 0.484
        (0.49, 1.2),
        (1.02, 1.6),  # 1.024 at most
        (1.03, 3.0),  # sqrt(1.03 / 0.4) = 1.6: two halves are even
        (3.59, 3.0),
        (3.61, 5.0),
        (9.9, 5.0),
        (10.1, 7.0),
    ],
)
def test_a_turn_takes_as_long_as_the_bending_asks_for(angle, periods):
    """A link that stands at the angle of the turn over the square of the periods."""
    model = mujoco.MjModel.from_xml_string(BENDING)

    def drive(turn, duration):
        def push(data, before, after):
            del before, after
            data.qpos[7] = turn * (0.7 / duration) ** 2
            data.qvel[:] = 0.0

        return push

    found = long_enough(model, drive, angle, 0.7, 3, (7,))
    assert found == pytest.approx(periods * 0.7)


def test_frames_of_a_run_stand_at_equal_times():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep=".1" gravity="0 0 0"/><worldbody><body><joint type="slide"/>
        <geom size=".1"/></body></worldbody></mujoco>"""
    )
    seen = []

    def push(data, before, after):
        seen.append((before, after))
        data.qvel[0] = 2.0

    found = run_of_push(model, push, 1.2, 4)
    assert found[:, 0] == pytest.approx([0.0, 0.8, 1.6, 2.4])
    assert np.array(seen) == pytest.approx(
        np.column_stack([0.1 * np.arange(12), 0.1 * np.arange(1, 13)])
    )
    check_steps(model, 1.2, 12.1)
    with pytest.raises(EngineError, match=r"12 steps of 0\.1 s"):
        check_steps(model, 1.2, 11.9)


ARMS = """<body pos="0 .5 0"><joint axis="0 0 1" stiffness="400"/><inertial pos="0 2 0" mass="1.5"
diaginertia=".1 .1 .1"/><geom pos="0 2 0" size=".01" mass="0"/></body>
<body pos="0 -.5 0"><joint axis="0 0 1" stiffness="400"/><inertial pos="0 -2 0" mass="1.5"
diaginertia=".1 .1 .1"/><geom pos="0 -2 0" size=".01" mass="0"/></body>"""
RINGING = """<mujoco><option gravity="0 0 0"/><statistic extent="{extent}"/><worldbody>
<body name="bus"><freejoint/><inertial pos="0 0 0" mass="50" diaginertia="20 30 40"/>
<geom size=".1" mass="0"/>
<body pos="0 0 .5"><joint axis="1 0 0" stiffness="2"/><inertial pos="0 0 1" mass=".2"
diaginertia=".01 .01 .01"/><geom pos="0 0 1" size=".01" mass="0"/></body>
{arms}</body></worldbody>
</mujoco>"""


@pytest.mark.parametrize("share", [0.1, 0.97, 1.05, 1e3])
def test_the_lowest_mode_that_bends_enough_is_turned(share):
    """Bending of a unit turn is 4 phi_turned J / pi^2 times what a unit of the mode moves: by the
    whole matrices of MuJoCo."""
    model = mujoco.MjModel.from_xml_string(RINGING.format(extent=1.0, arms=ARMS))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.zeros((9, 9))
    mujoco.mj_fullM(model, data, mass)
    root = np.linalg.inv(np.linalg.cholesky(mass))
    squares, vectors = np.linalg.eigh(root @ np.diag([0.0] * 6 + [2.0, 400.0, 400.0]) @ root.T)
    shapes = root.T @ vectors[:, 6:]
    inertia = 1.0 / np.diag(np.linalg.inv(mass[:6, :6]))[3:]
    arms = np.array([1.0, 2.0, 2.0])
    bent = np.array(
        [4.0 * np.abs(s[3:6]) * inertia / np.pi**2 * np.max(np.abs(s[6:]) * arms) for s in shapes.T]
    )
    bent[bent < 1e-9] = 0.0
    model.stat.extent = share * bent[0].max() / 0.05
    enough = bent.max(axis=1) >= min(0.05 * model.stat.extent, bent.max())
    k = int(np.argmax(enough))
    axis, omega = mode_to_ring(model, np.arange(3, 6), 0, [1, 2, 3])
    assert omega == pytest.approx(np.sqrt(squares[6 + k]), rel=1e-6)
    assert axis == int(np.argmax(bent[k]))
    # about x the first alone, which bends less than the others do about z
    assert bent[0, 0] < bent.max()
    assert mode_to_ring(model, np.array([3]), 0, [1, 2, 3])[1] == pytest.approx(
        np.sqrt(squares[6]), rel=1e-6
    )


def test_a_mode_that_does_not_turn_the_hub_is_not_rung():
    model = mujoco.MjModel.from_xml_string(RINGING.format(extent=4.0, arms=""))
    with pytest.raises(bc.InputError, match="no elastic mode of the scene turns"):
        mode_to_ring(model, np.array([4]), 0, [1])
    assert mode_to_ring(model, np.array([3, 4]), 0, [1])[0] == 0


@pytest.mark.parametrize(("frames", "shown"), [(30, 54), (70, 70)])
def test_a_turn_of_the_hub_and_what_it_leaves_ringing(frames, shown):
    """One period of the mode, and 3.5 of ringing, in 12 frames each."""
    model = mujoco.MjModel.from_xml_string(RINGING.format(extent=4.0, arms=""))
    model.opt.timestep = 0.01
    found = simulate_slew(model, angle=-0.02, frames=frames)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.zeros((7, 7))
    mujoco.mj_fullM(model, data, mass)
    omega = np.sqrt(2.0 * np.linalg.inv(mass)[6, 6])
    period = 2.0 * np.pi / omega
    assert (found.axis, found.body, found.joint, found.elastic) == (0, "bus", "", (7,))
    assert found.omega == pytest.approx(omega, rel=1e-8)
    assert found.duration == pytest.approx(period, rel=1e-8)
    assert found.times == pytest.approx(np.linspace(0.0, 4.5 * period, shown), rel=1e-8)
    # the hub makes the turn but for what the pendulum leaves it
    after = Rotation.from_quat(found.positions[found.times > period, 3:7], scalar_first=True)
    assert np.mean(after.as_rotvec()[:, 0]) == pytest.approx(-0.02, rel=0.02)
    steps = 4.5 * period / 0.01
    assert simulate_slew(model, angle=-0.02, frames=3, most=steps + 1.0).angle == -0.02
    # more periods take more steps, which is known before they are taken
    for angle, most in ((-0.02, steps - 1.0), (60.0, steps + 1.0)):
        with pytest.raises(EngineError, match="give a larger step"):
            simulate_slew(model, angle=angle, frames=3, most=most)


def test_a_turn_of_a_hinge_is_made_without_its_servo():
    model = arm()
    model.opt.timestep, model.opt.gravity[:] = 0.01, 0.0
    found = simulate_slew(model, angle=0.02, frames=20, joint="hinge")
    assert (found.joint, found.axis, found.elastic) == ("hinge", 0, (8,))
    at = model.joint("hinge").qposadr[0]
    assert found.positions[-1, at] - found.positions[0, at] == pytest.approx(0.02, abs=1e-3)


def test_a_scene_that_nothing_turns_is_refused():
    model = arm()
    model.jnt_stiffness[:] = 0.0
    with pytest.raises(bc.InputError, match="nothing can ring"):
        simulate_slew(model, angle=0.1, frames=3)
    with pytest.raises(bc.InputError, match="no freely flying body"):
        simulate_slew(mujoco.MjModel.from_xml_string("<mujoco/>"), angle=0.1, frames=3)
