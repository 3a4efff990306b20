"""Polynomials, momentum and rigid inertia beside the turns of a hub or a hinge."""

import mujoco
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from beamchain import InputError
from beamchain.errors import EngineError
from formulas import (
    Drive,
    Slew,
    StatesOfRun,
    Turn,
    drive_in_hinge,
    drive_of,
    drive_on_hub,
    hinge_to_turn,
    impulse_of_halves,
    long_enough,
    run_of_drive,
    seen,
    simulate_slew,
    without_actuators,
)

CRAFT = """<mujoco><option gravity="0 0 0" timestep="{step}"/><worldbody>
<body name="bus" pos="1 2 3" {turned}><freejoint/>
<inertial pos="0 0 0" mass="20" diaginertia="4 5 6"/>{inside}</body></worldbody>{rest}</mujoco>"""
ARM = """<body name="link" pos=".5 0 0"><joint name="hinge" axis="0 0 1" damping=".7"
range="-60 100"/><inertial pos="2 0 0" mass="3" diaginertia=".3 .3 .4"/>
<site name="hand" pos="3 0 0"/></body>"""
FIXED = """<mujoco><option gravity="0 0 0" timestep=".002"/><worldbody><body name="arm">
<joint name="hinge" axis="0 0 1" damping=".7" stiffness="2"/>
<inertial pos="1 0 0" mass="3" diaginertia=".3 .3 .4"/></body></worldbody></mujoco>"""
FELT = 0.4 + 3.0 * 1.0**2  # by the hinge of the fixed one


def craft(inside="", rest="", turned="", step=0.002):
    return mujoco.MjModel.from_xml_string(
        CRAFT.format(inside=inside, rest=rest, turned=turned, step=step)
    )


# -- driven hinges ---------------------------------------------------------------------------------
def test_a_turn_is_the_integral_of_s_cubed_times_one_less_s_cubed():
    # theta' = 140 A / T s^3 (1 - s)^3, s = t / T
    made = Turn(-0.8, 5.0)
    shape = 140.0 * np.poly1d([1.0, 0, 0, 0]) * np.poly1d([-1.0, 1.0]) ** 3
    for time in (0.0, 0.7, 2.5, 3.9, 5.0):
        s = time / 5.0
        wanted = (shape.integ()(s), shape(s) / 5.0, shape.deriv()(s) / 25.0)
        assert made.at(time) == pytest.approx(-0.8 * np.array(wanted), rel=1e-12, abs=1e-14)
    assert made.at(-1.0) == pytest.approx((0.0, 0.0, 0.0))
    assert made.at(7.0) == pytest.approx((-0.8, 0.0, 0.0))
    assert made.rate == pytest.approx(0.8 * shape(0.5) / 5.0)


def test_means_over_steps_are_those_of_the_cubic_through_the_torques():
    times = np.linspace(0.0, 2.0, 9)
    cubics = [np.poly1d([1.0, -2.0, 0.5, 3.0]), np.poly1d([0.4, 1.0, -1.0])]
    torques = np.column_stack([p(times) for p in cubics])
    drive = Drive(Turn(1.0, 1.0), 1.0, 3, times, torques, times, times)
    found = drive.means(0.3, 7)  # beyond the end nothing is added
    for k in range(7):
        a, b = 0.3 * k, min(0.3 * (k + 1), 2.0)
        wanted = [(p.integ()(b) - p.integ()(a)) / 0.3 for p in cubics]
        assert found[k] == pytest.approx(wanted, rel=1e-12)


def test_torque_of_a_hinge_on_the_ground_is_that_of_its_equation():
    # J a'' + d a' + k a; rest at another place of the hinge
    model = mujoco.MjModel.from_xml_string(FIXED)
    joint, made = model.joint("hinge").id, Turn(0.8, 4.0)
    model.qpos0[0] = model.qpos_spring[0] = 0.3
    found = drive_of(model, joint, [joint], made, spacing=0.2, samples=3)
    assert found.times[-1] == pytest.approx(0.4)
    assert np.diff(found.times).max() <= 4.0 / 500.0 * (1.0 + 1e-9)
    for time, torque in zip(found.times[::7], found.torques[::7], strict=True):
        angle, rate, acceleration = made.at(time)
        wanted = FELT * acceleration + 0.7 * rate + 2.0 * angle
        assert torque[0] == pytest.approx(wanted, abs=1e-12)
    assert found.qpos[:, 0] == pytest.approx(
        [0.3 + made.at(t)[0] for t in (0.0, 0.2, 0.4)], rel=1e-12
    )
    assert found.qvel[1, 0] == pytest.approx(made.at(0.2)[1])


@pytest.mark.parametrize("mean_input", [False, True])
def test_a_run_is_pushed_by_the_means_of_its_steps(mean_input):
    # semi-implicit Euler without damping: v += h f / J, q += h v
    model = mujoco.MjModel.from_xml_string(FIXED.replace('damping=".7" stiffness="2"', ""))
    times = np.linspace(0.0, 0.6, 13)
    torques = (1.0 + 3.0 * times)[:, None]
    drive = Drive(Turn(1.0, 1.0), 0.2, 4, times, torques, times, times)
    found = run_of_drive(model, [0], drive, "Euler", 5, mean_input=mean_input)
    h = 0.04
    means = 1.0 + 3.0 * h * (np.arange(15) + 0.5)
    if mean_input:
        means = (means + np.append(0.0, means[:-1])) / 2.0
    rates = np.cumsum(means) * h / FELT
    assert model.opt.timestep == pytest.approx(h)
    assert found.qvel[:, 0] == pytest.approx(np.append(0.0, rates)[::5], rel=1e-10)
    assert found.qpos[:, 0] == pytest.approx(np.append(0.0, np.cumsum(h * rates))[::5], rel=1e-10)


# -- turns forwards and back -----------------------------------------------------------------------
def test_figures_of_a_slew():
    positions = np.array([[0.0, 0, 0, 0], [5.0, 0.3, 9.0, 0.4], [1.0, 0.6, 0.0, 0.1], [0, 0, 9, 0]])
    times = np.linspace(0.0, 3.0, 4)
    slew = Slew(times, positions, "bus", 2, -0.9, 3.0, 4.0, (1, 3))
    # bang-bang: half of the angle in half of the time
    acceleration = 0.45 * 2.0 / 1.5**2
    assert slew.acceleration == pytest.approx(acceleration)
    assert slew.rate == pytest.approx(acceleration * 1.5)
    assert slew.loudest == 2
    shown = slew.shown(3.0)
    assert shown[1] == pytest.approx([5.0, 0.9, 9.0, 1.2])
    assert positions[1, 1] == 0.3


def test_impulse_rises_for_half_of_the_duration_and_falls():
    for time in (-0.3, 0.0, 0.4, 1.5, 2.2, 3.0, 3.4):
        wanted = quad(lambda t: 1.0 if t < 1.5 else -1.0, 0.0, np.clip(time, 0, 3), points=[1.5])
        assert impulse_of_halves(time, 3.0) == pytest.approx(wanted[0], abs=1e-9)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_torque_on_the_hub_turns_it_about_its_axis(axis):
    # a bus of moments 4, 5, 6, turned in space; mean torque of a step over J
    model = craft(turned='euler="30 40 50"')
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    line = data.xmat[1].reshape(3, 3)[:, axis]
    push = drive_on_hub(model, 1, axis)(0.6, 2.0)
    most = 4.0 * 0.6 / 2.0**2 * (4.0, 5.0, 6.0)[axis]
    # the last: 0.75 of the step forwards, 0.25 of it back
    for before, after, share in ((0.1, 0.3, 1.0), (1.4, 1.6, -1.0), (0.7, 1.1, 0.5), (2.1, 2.3, 0)):
        push(data, before, after)
        assert data.xfrc_applied[1, 3:] == pytest.approx(share * most * line, abs=1e-12)
        assert not data.xfrc_applied[1, :3].any()


@pytest.mark.parametrize("angle", [0.9, -0.5])
def test_a_torque_in_a_hinge_is_that_of_the_inertia_felt(angle):
    """Two bodies of one momentum: with the bus free, J of the hinge changes with the angle."""
    model = craft(ARM)
    duration = 2.0
    push = drive_in_hinge(model, model.joint("hinge").id, [], angle)(angle, duration)
    data = mujoco.MjData(model)
    reduced = 3.0 * 20.0 / 23.0

    def felt(turned):
        # plane, centre of mass at rest: |r'|^2 of the two centres, 0.5 and 2 m from the hinge
        both = reduced * np.cos(turned) * 0.5 * 2.0
        own = 0.4 + reduced * 2.0**2
        whole = 6.0 + reduced * 0.5**2 + own + 2.0 * both
        return own - (own + both) ** 2 / whole

    most = 4.0 * angle / duration**2
    for before, after in ((0.3, 0.4), (1.5, 1.7), (1.95, 2.05), (2.5, 2.6)):
        middle = min((before + after) / 2.0, duration)
        left = duration - middle
        turned = most * middle**2 / 2.0 if middle < 1.0 else angle - most * left**2 / 2.0
        rate = most * min(middle, left)
        overlap = max(min(after, duration) - before, 0.0) / (after - before)
        sign = 1.0 if after < 1.0 else -1.0
        slope = (felt(turned + 1e-4) - felt(turned - 1e-4)) / 2e-4
        wanted = felt(turned) * most * sign * overlap + slope * rate**2 / 2.0 + 0.7 * rate
        push(data, before, after)
        assert data.qfrc_applied[6] == pytest.approx(wanted, rel=1e-5, abs=1e-7)


@pytest.mark.parametrize(
    ("angle", "says"),
    [(99.0, None), (101.0, "turn to 101 degrees"), (-59.0, None), (-61.0, r"\[-60, 100\]")],
)
def test_a_hinge_turns_within_its_range(angle, says):
    model = craft(ARM)
    if says is None:
        assert hinge_to_turn(model, "hinge", [], np.radians(angle)) == 1
    else:
        with pytest.raises(InputError, match=says):
            hinge_to_turn(model, "hinge", [], np.radians(angle))
    with pytest.raises(InputError, match="Only hinges without springs"):
        hinge_to_turn(model, "hinge", [1], 0.1)


def test_no_actuator_of_the_joint_that_turns_acts():
    other = '<body><joint name="other"/><geom size=".1"/></body>'
    rest = """<actuator><position joint="hinge" kp="3"/><motor joint="other" gear="2"/>
    <position jointinparent="hinge" kp="4"/><motor site="hand" gear="1 0 0 0 0 0"/></actuator>"""
    model = craft(ARM + other, rest)
    quiet = without_actuators(model, model.joint("hinge").id)
    assert quiet.actuator_gainprm[:, 0] == pytest.approx([0.0, 1.0, 0.0, 1.0])
    assert not quiet.actuator_biasprm.any()
    assert model.actuator_gainprm[0, 0] == 3.0


@pytest.mark.parametrize(
    ("bent", "periods"),
    [
        # radians out of place per radian turned, in a turn of one period; it falls as 1 / T^2
        (0.39, 1.0),
        (0.4 * 1.19**2, 1.2),
        (0.4 * 1.59**2, 1.6),
        (0.4 * 2.9**2, 3.0),
        (0.4 * 3.1**2, 5.0),
    ],
)
def test_a_turn_is_long_enough_for_a_link_to_stay_in_its_place(bent, periods):
    """A link of no matter what is put where a turn of a duration would bend it."""
    model = mujoco.MjModel.from_xml_string(FIXED.replace('timestep=".002"', 'timestep=".05"'))
    period = 0.7

    def drive(angle, duration):
        def push(data, before, after):
            data.qpos[0] = angle * bent * (period / duration) ** 2
            data.qvel[0] = 0.0

        return push

    found = long_enough(model, drive, -1.0, period, 5, (0,))
    assert found == pytest.approx(periods * period)


CART = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="free" type="slide"
stiffness="9" damping="1.5"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/><body>
<joint name="driven" type="slide"/><inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/></body>
</body></worldbody><actuator><general joint="driven" biastype="affine" biasprm=".5 0 0"/>
</actuator></mujoco>"""


def test_what_is_not_held_moves_as_its_equation_says():
    # 5 x'' + 1.5 x' + 9 x = -3 s''; the drive gives 3 (x'' + s'') less what its motor does
    model = mujoco.MjModel.from_xml_string(CART)
    made = Turn(0.8, 1.5)

    def rates(time, state):
        x, v = state
        return [v, (-3.0 * made.at(time)[2] - 1.5 * v - 9.0 * x) / 5.0]

    times = np.array([0.0, 0.1, 0.2])
    wanted = solve_ivp(rates, (0.0, 0.2), [0.0, 0.0], "DOP853", times, rtol=1e-12, atol=1e-14).y
    found = drive_of(model, 1, [1], made, spacing=0.1, samples=3)
    assert found.qpos[:, 0] == pytest.approx(wanted[0], rel=1e-6, abs=1e-12)
    assert found.qvel[:, 0] == pytest.approx(wanted[1], rel=1e-6, abs=1e-12)
    last = rates(0.2, wanted[:, -1])[1] + made.at(0.2)[2]
    assert found.torques[-1, 0] == pytest.approx(3.0 * last - 0.5, rel=1e-6)


def test_a_run_seen_from_outside_at_one_state():
    model = craft(ARM)
    random = np.random.default_rng(2)
    data = mujoco.MjData(model)
    data.qpos[:3], data.qpos[7] = random.normal(size=3), 0.7
    turn = random.normal(size=4)
    data.qpos[3:7] = turn / np.linalg.norm(turn)
    data.qvel[:] = random.normal(size=7)
    mujoco.mj_forward(model, data)
    # every body: rate and speed of its mass centre
    speeds, rates = [], []
    for body in (1, 2):
        both = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, both, 0)
        rates.append(both[:3])
        speeds.append(both[3:])
    masses, places = np.array([20.0, 3.0]), data.xipos[1:3]
    centre, drift = masses @ places / 23.0, masses @ np.array(speeds) / 23.0
    momenta, energy = [], 0.0
    for k, body in enumerate((1, 2)):
        axes = data.ximat[body].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
        own = inertia @ rates[k]
        momenta.append(own + masses[k] * np.cross(places[k] - centre, speeds[k] - drift))
        energy += (rates[k] @ own + masses[k] * speeds[k] @ speeds[k]) / 2.0
    states = StatesOfRun(data.qpos[None].copy(), data.qvel[None].copy())
    found = seen(model, states, [2, 1], [model.site("hand").id], 2)
    assert found.momentum[0] == pytest.approx(sum(momenta), rel=1e-10)
    assert found.share[0] == pytest.approx(np.linalg.norm(momenta[1]), rel=1e-10)
    assert found.energy[0] == pytest.approx(energy, rel=1e-10)
    assert found.places[0] == pytest.approx(
        np.array([data.body("link").xpos, data.body("bus").xpos, data.site("hand").xpos])
    )
    assert found.rotations[0, 1] == pytest.approx(data.body("bus").xmat.reshape(3, 3))


def sprung(step):
    spring = ARM.replace('damping=".7"\nrange="-60 100"', 'stiffness="60"')
    return craft(spring, step=step)


def test_a_hub_s_turn_excites_its_one_mode():
    # plane: k q = J q'' with J = own - (own + both)^2 / whole
    model = sprung(0.01)
    reduced = 60.0 / 23.0
    both, own = reduced * 0.5 * 2.0, 0.4 + reduced * 4.0
    whole = 6.0 + reduced * 0.25 + own + 2.0 * both
    omega = np.sqrt(60.0 / (own - (own + both) ** 2 / whole))
    found = simulate_slew(model, angle=0.05, frames=30)
    period = 2.0 * np.pi / omega
    assert (found.body, found.axis, found.joint, found.elastic) == ("bus", 2, "", (7,))
    assert found.omega == pytest.approx(omega, rel=1e-9)
    assert found.duration == pytest.approx(period, rel=1e-9)
    assert found.times[-1] == pytest.approx(4.5 * period, rel=1e-9)
    assert len(found.times) == 12 * 4.5
    # what the mode leaves alone has turned by the angle
    hub = 2.0 * np.arctan2(found.positions[-1, 6], found.positions[-1, 3])
    turned = hub + (own + both) / whole * found.positions[-1, 7]
    assert turned == pytest.approx(0.05, rel=0.01)
    steps = 4.5 * period / 0.01
    with pytest.raises(EngineError, match="larger step"):
        simulate_slew(model, angle=0.05, frames=30, most=0.99 * steps)
    assert simulate_slew(model, angle=0.05, frames=70, most=1.01 * steps).times.size == 70


def jets(most, out=2):
    """The hub's turn about z, where jets have so much torque and the arm is so far out."""
    spring = ARM.replace("2 0 0", f"{out} 0 0").replace(
        'damping=".7"\nrange="-60 100"', 'stiffness="60"'
    )
    motor = f'<motor site="jet" gear="0 0 0 0 0 1" ctrlrange="-{most} {most}"/>'
    model = craft(f'<site name="jet"/>{spring}', f"<actuator>{motor}</actuator>", step=0.01)
    return simulate_slew(model, angle=None, frames=30)


def test_a_turn_that_is_chosen_bends_gently_and_has_no_more_torque_than_the_actuators():
    # frozen, the craft's inertia about z through its mass centre
    inertia = 6.0 + 0.4 + 20.0 * 3.0 / 23.0 * 2.5**2
    strong = jets(1e6)
    assert strong.torque == 0.0
    assert strong.angle == pytest.approx(np.pi / 9.0)
    assert np.abs(strong.positions[:, 7]).max() < 0.1
    far = jets(1e6, out=9)
    assert far.angle < strong.angle
    assert np.abs(far.positions[:, 7]).max() == pytest.approx(0.1, rel=0.02)
    weak = jets(0.3)
    assert weak.torque == 0.3
    assert weak.angle < strong.angle
    assert inertia * weak.acceleration == pytest.approx(0.3, rel=1e-9)
    assert weak.duration * weak.omega == pytest.approx(5.0 * 2.0 * np.pi)


def test_a_chosen_turn_is_the_same_in_every_picture(monkeypatch):
    largest = simulate_slew(sprung(0.01), angle=None, frames=20)
    assert largest.angle == pytest.approx(np.radians(20.0))
    monkeypatch.setattr("beamchain.engine.slew.LARGEST", 10.0)
    found = [simulate_slew(sprung(0.01), angle=None, frames=frames) for frames in (20, 90)]
    assert found[0].angle == found[1].angle > largest.angle
    assert found[0].duration == found[1].duration


def test_a_turn_without_a_free_body_or_a_spring_is_refused():
    with pytest.raises(InputError, match="freely flying"):
        simulate_slew(mujoco.MjModel.from_xml_string(FIXED), angle=0.1, frames=5)
    with pytest.raises(InputError, match="no joint of the scene has a spring"):
        simulate_slew(craft(ARM), angle=0.1, frames=5)


@pytest.mark.parametrize("angle", [0.9, -0.5])
def test_the_inertia_that_a_hinge_feels_is_that_of_the_way_it_turns(angle):
    """From 30 degrees on, two bodies close in or stretch out."""
    bent = craft(ARM.replace('pos=".5 0 0">', 'pos=".5 0 0" euler="0 0 30">'))
    push = drive_in_hinge(bent, bent.joint("hinge").id, [], angle)(angle, 2.0)
    data = mujoco.MjData(bent)
    push(data, 0.9, 1.0)  # in the first half
    turned, rate = 0.5 * angle * 0.95**2, angle * 0.95
    reduced = 60.0 / 23.0

    def felt(at):
        both, own = reduced * np.cos(np.pi / 6.0 + at), 0.4 + reduced * 4.0
        return own - (own + both) ** 2 / (6.0 + reduced * 0.25 + own + 2.0 * both)

    slope = (felt(turned + 1e-4) - felt(turned - 1e-4)) / 2e-4
    wanted = felt(turned) * angle + slope * rate**2 / 2.0 + 0.7 * rate
    assert data.qfrc_applied[6] == pytest.approx(wanted, rel=1e-5)
