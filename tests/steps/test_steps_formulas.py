"""Closed forms beside the formulas of a time step."""

import itertools
import math

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from formulas import (
    Chain,
    Hinge,
    Link,
    PlanarChain,
    PoleRow,
    Tendon,
    apparent_pole,
    condensed_mass,
    continuous_poles,
    culprit,
    driven,
    hinge_armature,
    map_by_differences,
    map_modes,
    plane_of_chain,
    polynomial,
    round_down,
    run_of_turn,
    runge_kutta_limit,
    servos_that_chatter,
    stable_armature,
    start_rate,
    step_pole,
    time_modes,
    turn_error,
)

M, C, K, H = 1.3, 0.4, 50.0, 0.02
N = M + H * C  # with the damping taken at the end of the step


@pytest.mark.parametrize(
    ("integrator", "tendon", "sprung", "keep", "pull"),
    [
        # v' = keep v - pull q / h, q' = q + h v'
        ("Euler", True, True, 1.0 - H * C / M, H**2 * K / M),
        ("Euler", False, True, M / N, H**2 * K / N),
        ("implicitfast", True, True, M / N, H**2 * K / N),
        # m (v' - v) / h = -c v' - k (q + h v') for a spring of a joint
        ("discrete", False, False, M / (N + H**2 * K), H**2 * K / (N + H**2 * K)),
        # that of a tendon: the force of the position alone is divided by the larger mass
        ("discrete", True, True, M / N, H**2 * K / (N + H**2 * K)),
    ],
)
def test_pole_of_a_step_is_its_matrix_s(integrator, tendon, sprung, keep, pull):
    step = np.array([[1.0 - pull, H * keep], [-pull / H, keep]])
    pole = step_pole(integrator, M, C, K, H, tendon=tendon, sprung=sprung)
    wanted = np.linalg.eigvals(step)
    assert complex(pole) == pytest.approx(wanted[np.argmax(wanted.imag)], rel=1e-12)


STIFF, ARM, AT, WEIGHT = 20.0, 0.6, 0.4, 1.5  # one point mass beyond one hinge


def one_link():
    pair = np.array([0.0, WEIGHT])
    return PlanarChain(
        hinges=np.array([AT]),
        stiffness=np.array([[STIFF]]),
        armature=np.zeros((1, 1)),
        mass=pair,
        com=np.array([0.0, AT + ARM]),
        inertia=np.zeros(2),
        along=np.zeros(2),
    )


@pytest.mark.parametrize("flap", [True, False])
def test_a_spinning_point_on_a_hinge_is_stiffened_by_its_pull(flap):
    # w^2 = k / (m a^2) + W^2 (R + x) / a out of the plane of the spin, less W^2 in it
    spin, radius = 3.0, 0.25
    square = STIFF / (WEIGHT * ARM**2) + spin**2 * ((radius + AT + ARM) / ARM - (not flap))
    got = one_link().frequencies(spin, radius, flap=flap)
    assert got == pytest.approx([np.sqrt(square)], rel=1e-12)


def test_a_root_that_is_pushed_along_x_softens_a_point_on_a_hinge():
    # w^2 = (k - m a_x a) / (m a^2) falls to 0.99^2 of its value
    pushed = STIFF * (1.0 - 0.99**2) / (WEIGHT * ARM)
    assert one_link().axial() == pytest.approx(pushed, rel=1e-9)


@pytest.mark.parametrize(("acceleration", "slew"), [(3.0, 0.0), (0.0, 2.0), (2.0, 1.5)])
def test_a_chain_bends_until_its_hinges_hold_the_moments_behind_them(acceleration, slew):
    """k (angle - angle before) = sum of (r - hinge) x f - slew I over the links behind a hinge,
    f = m (slew y, -acceleration - slew x) at each mass centre."""
    at, stiffness = np.array([0.2, 0.9, 1.5]), np.array([30.0, 22.0, 9.0])
    mass, com = np.array([1.0, 1.2, 0.8, 0.5]), np.array([0.1, 0.6, 1.1, 1.9])
    inertia = np.array([0.01, 0.02, 0.03, 0.02])

    def places(angles):
        joint, joints, centres = np.array([at[0], 0.0]), [], [np.array([com[0], 0.0])]
        for j, angle in enumerate(angles):
            along = np.array([np.cos(angle), np.sin(angle)])
            joints.append(joint)
            centres.append(joint + (com[j + 1] - at[j]) * along)
            joint = joint + (at[j + 1] - at[j] if j < 2 else 0.0) * along
        return np.array(joints), np.array(centres)

    def moments(centres, about, first):
        force = mass[:, None] * np.column_stack(
            [slew * centres[:, 1], -acceleration - slew * centres[:, 0]]
        )
        arm = centres - about
        each = arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0] - slew * inertia
        return each[first:].sum()

    def unbalance(angles):
        joints, centres = places(angles)
        held = stiffness * np.diff(angles, prepend=0.0)
        return held - [moments(centres, joint, j + 1) for j, joint in enumerate(joints)]

    angles = fsolve(unbalance, np.zeros(3), xtol=1e-13)
    _, centres = places(angles)
    assert np.abs(angles).max() > 0.1
    chain = PlanarChain(
        hinges=at,
        stiffness=np.diag(stiffness),
        armature=np.zeros((3, 3)),
        mass=mass,
        com=com,
        inertia=inertia,
        along=inertia,
    )
    displacement, moment = chain.bent(acceleration, slew)
    assert displacement == pytest.approx(mass @ centres[:, 1] / mass.sum(), rel=1e-8)
    assert moment == pytest.approx(moments(centres, np.zeros(2), 0), rel=1e-8)


def test_a_hub_that_turns_evenly_spins_its_root_and_pulls_it_inwards():
    spin, spacing, out = 0.7, 0.01, 0.5
    time = spacing * np.arange(5)
    motion = np.zeros((5, 6))
    motion[:, 5] = spin * time
    run = driven(motion, spacing, np.array([0.0, out, 0.0]))
    assert run.spin == pytest.approx(spin, rel=1e-9)
    assert run.acceleration["xy"] == pytest.approx(spin**2 * out, rel=1e-9)
    # a run that speeds up: the root at x is carried along y
    turned = run_of_turn(spin, 0.2, np.eye(3)[2], (out, 0.0, 0.0))
    assert turned.spin == pytest.approx(spin)
    assert turned.acceleration["xy"] == pytest.approx(0.2 * out, rel=1e-12)
    assert turned.slew["xy"] == pytest.approx(0.2, rel=1e-12)


def test_mass_seen_by_two_tendons_is_the_inverse_of_their_flexibility():
    # of masses 2 and 3, tendons along the sum and the second alone: M = B^T C B
    rows = np.array([[1.0, 1.0], [0.0, 1.0]])
    seen, motion = condensed_mass(np.diag([2.0, 3.0]), rows)
    assert rows.T @ seen @ rows == pytest.approx(np.diag([2.0, 3.0]), rel=1e-12, abs=1e-12)
    assert rows @ motion == pytest.approx(np.eye(2), abs=1e-12)


SAME = 1e-12
MASS, STIFFNESS, STEP = 3.0, 48.0, 0.13
ON_A_JOINT = (
    '<mujoco><option gravity="0 0 0" timestep="{h}"/><worldbody><body><joint name="j" type="slide" '
    'stiffness="{joint_k}" damping="{joint_c}"/><inertial pos="0 0 0" mass="{m}" '
    'diaginertia="1 1 1"/></body></worldbody><tendon><fixed stiffness="{tendon_k}" '
    'damping="{tendon_c}" springlength="0 0"><joint joint="j" coef="1"/></fixed></tendon></mujoco>'
)
BY_NAME = {
    name: getattr(mujoco.mjtIntegrator, f"mjINT_{name.upper()}", None)
    for name in ("Euler", "implicit", "implicitfast", "discrete", "RK4")
}


def stepped_pole(integrator, damping, *, tendon, sprung):
    """The pole of `mj_step`, from two steps of one slide joint."""
    text = ON_A_JOINT.format(
        h=STEP,
        m=MASS,
        joint_k=0.0 if sprung else STIFFNESS,
        tendon_k=STIFFNESS if sprung else 0.0,
        joint_c=0.0 if tendon else damping,
        tendon_c=damping if tendon else 0.0,
    )
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.integrator = BY_NAME[integrator]
    columns = []
    for q, v in ((1.0, 0.0), (0.0, 1.0)):
        data = mujoco.MjData(model)
        data.qpos[0], data.qvel[0] = q, v
        mujoco.mj_step(model, data)
        columns.append([data.qpos[0], data.qvel[0]])
    poles = np.linalg.eigvals(np.array(columns).T)
    return poles[np.argmax(poles.imag)]


@pytest.mark.parametrize(
    ("integrator", "damping", "tendon", "sprung"),
    [
        (name, damping, *where)
        for name, damping, where in itertools.product(
            [name for name, number in BY_NAME.items() if number is not None],
            [0.0, 2.5],
            [(True, True), (False, False)],
        )
    ],
)
def test_the_pole_of_a_step_is_mujocos(integrator, damping, tendon, sprung):
    found = step_pole(integrator, MASS, damping, STIFFNESS, STEP, tendon=tendon, sprung=sprung)
    assert abs(found - stepped_pole(integrator, damping, tendon=tendon, sprung=sprung)) < SAME


def test_continuous_poles_solve_the_equation_of_a_mode():
    for w, ratio in ((2.0, 0.1), (5.0, 1.5)):
        for s in continuous_poles(w, ratio):
            assert abs(s**2 + 2.0 * ratio * w * s + w**2) < 1e-13 * w**2


def test_an_apparent_pole_undoes_the_exponential():
    w, ratio = 3.0, 0.2
    s = w * complex(-ratio, math.sqrt(1.0 - ratio**2))
    shown = apparent_pole(np.exp(s * STEP), STEP)
    assert shown == pytest.approx((w, ratio), rel=1e-13)


def test_the_polynomial_of_rk4_is_the_series_of_the_exponential():
    x = 0.7 + 0.4j
    assert abs(polynomial(np.array(x)) - sum(x**k / math.factorial(k) for k in range(5))) < 1e-15


def test_limits_of_rk4_are_those_of_the_textbook():
    assert runge_kutta_limit(2j) == pytest.approx(math.sqrt(8.0) / 2.0, rel=1e-9)
    # 1 + x + x^2/2 + x^3/6 + x^4/24 = 1 with x < 0: x^3 + 4 x^2 + 12 x + 24 = 0
    real = -np.roots([1.0, 4.0, 12.0, 24.0])
    real = real[np.abs(real.imag) < 1e-9].real[0]
    assert runge_kutta_limit(-5.0 + 0j) == pytest.approx(real / 5.0, rel=1e-9)


@pytest.mark.parametrize(
    ("integrator", "tendon", "sign"),
    [("Euler", True, -1), ("Euler", False, 1), ("implicit", True, 1)],
)
def test_the_largest_angle_puts_a_pole_on_minus_one(integrator, tendon, sign):
    ratio = 0.15
    angle = map_modes(integrator, 1.0, 2.0 * ratio, 1.0, 1.0, tendon=tendon).largest_step()
    # z = -1: 4 m + 2 c h sign - k h^2 = 0 with c = 2 ratio w, k = w^2
    assert angle**2 - sign * 4.0 * ratio * angle - 4.0 == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
def test_a_timed_mode_has_the_exact_pole_and_its_own_static_response(integrator):
    w, ratio = 4.0, 0.03
    timed = time_modes(integrator, w, ratio, STEP)
    z = step_pole(integrator, timed.mass, timed.damping, w**2, STEP)
    exact = np.exp(w * complex(-ratio, math.sqrt(1.0 - ratio**2)) * STEP)
    assert abs(z - exact) < SAME
    assert not timed.slowed
    assert not timed.clamped


def test_an_undamped_timed_mode_has_the_mass_of_the_closed_form():
    w = 4.0
    x = w * STEP
    assert time_modes("Euler", w, 0.0, STEP).mass == pytest.approx(
        (x / 2.0 / math.sin(x / 2.0)) ** 2, rel=1e-12
    )


def test_a_mode_beyond_the_phase_limit_is_scaled_back_to_it():
    timed = time_modes("Euler", 40.0, 0.0, STEP, phase=2.0)
    assert timed.slowed
    z = step_pole("Euler", timed.mass, timed.damping, 1600.0, STEP)
    assert np.angle(z) == pytest.approx(2.0, rel=1e-10)


def test_the_armature_of_a_hinge_makes_its_step_of_fourth_order():
    errors = []
    for h in (0.1, 0.05):
        mass = MASS + hinge_armature(STIFFNESS, h)
        shown = apparent_pole(step_pole("Euler", mass, 0.0, STIFFNESS, h), h)[0]
        errors.append(abs(shown / math.sqrt(STIFFNESS / MASS) - 1.0))
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.05)


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
def test_with_its_stable_armature_a_bare_spring_is_at_the_limit(integrator):
    least = stable_armature(integrator, STEP, STIFFNESS, 0.0)
    z = step_pole(integrator, least, 0.0, STIFFNESS, STEP)
    assert z == pytest.approx(-1.0, abs=1e-6)


def test_with_its_stable_armature_rk4_is_at_the_limit():
    least = stable_armature("RK4", STEP, STIFFNESS, 0.0)
    assert abs(step_pole("RK4", least, 0.0, STIFFNESS, STEP)) == pytest.approx(1.0, abs=1e-9)
    # a damper alone: its pole is 2 per step, within 2.785
    assert stable_armature("RK4", STEP, 0.0, 7.0) == pytest.approx(STEP * 7.0 / 2.0)


def test_a_mode_started_at_the_rate_keeps_the_exact_positions():
    w, ratio, q0, v0 = 3.0, 0.05, 0.4, -0.7
    timed = time_modes("Euler", w, ratio, STEP)
    m, c = float(timed.mass), float(timed.damping)
    q, v = q0, float(start_rate(q0, v0, w, ratio, STEP))
    damped = w * math.sqrt(1.0 - ratio**2)
    for k in range(1, 30):
        v += STEP * (-c * v - w**2 * q) / m
        q += STEP * v
        t = k * STEP
        exact = math.exp(-ratio * w * t) * (
            q0 * math.cos(damped * t) + (v0 + ratio * w * q0) / damped * math.sin(damped * t)
        )
        assert q == pytest.approx(exact, abs=1e-12)


def test_error_of_a_pole_is_of_frequency_and_damping_together():
    """Poles 2 exp(i 120 deg) and 2.2 exp(i 120 deg) lie a tenth apart; 60 degrees of turn are 1."""
    row = PoleRow(2.0, 0.5, 2.2, 0.5, slowed=False, step_error=0.0)
    assert row.error == pytest.approx(0.1, rel=1e-12)
    row = PoleRow(2.0, 0.5, 2.0, 0.0, slowed=False, step_error=0.0)
    assert row.error == pytest.approx(2.0 * math.sin(math.radians(15.0)), rel=1e-12)
    row = PoleRow(1.0, 1.2, 1.0, 0.9, slowed=False, step_error=0.0)  # on the real axis
    assert row.error == pytest.approx(abs(-0.9 + 0.43588989435j + 1.2) / 1.2, rel=1e-9)


@pytest.mark.parametrize(("step", "told"), [(0.0124, False), (0.0126, True)])
def test_a_servo_chatters_beyond_two_of_its_inertia_over_its_damping(step, told):
    """I = 5, gear 2, kv = 200: 800 N m s about the joint, 2 I / kv = 0.0125 s."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{step}" integrator="implicitfast"/><worldbody><body>
        <joint name="hinge" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="4 4 5"/>
        </body></worldbody><actuator><position name="servo" joint="hinge" gear="2" kp="10" kv="200"
        forcerange="-3 3"/></actuator></mujoco>"""
    )
    said = list(servos_that_chatter(model))
    assert len(said) == told
    if told:
        assert 'damping="800"' in said[0]
        assert "0.012 s" in said[0]
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    assert not list(servos_that_chatter(model))


def test_differences_of_a_step_of_two_springs_are_those_of_semi_implicit_euler():
    # v' = v + h (f - k x) / m, x' = x + h v'; in y = sqrt(m) x and h y'
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option gravity="0 0 0" timestep=".1"/><worldbody>
        <body><joint type="slide" axis="1 0 0" stiffness="8"/>
        <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>
        <body><joint type="slide" axis="0 1 0" stiffness="3"/>
        <inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/></body></worldbody></mujoco>"""
    )
    roots = np.sqrt([2.0, 5.0])
    change, drive = map_by_differences(model, np.zeros(2), np.diag(1.0 / roots))
    pull = np.diag(0.1**2 * np.array([4.0, 0.6]))
    wanted = np.block([[-pull, np.eye(2)], [-pull, np.zeros((2, 2))]])
    assert change == pytest.approx(wanted, abs=1e-9)
    assert drive == pytest.approx(0.1**2 * np.vstack([np.eye(2), np.eye(2)]), abs=1e-9)


@pytest.mark.parametrize(
    ("spring", "damper", "named", "share"),
    # per joint a stiffness and a damping that Euler takes before the step; mass 2 and 5
    [((9000.0, 10.0), (0.0, 0.0), "fast", 1.0), ((10.0, 10.0), (0.0, 300.0), "slow", 1.0)],
)
def test_what_makes_a_step_grow_is_the_spring_or_damper_that_is_too_stiff(
    spring, damper, named, share
):
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 0" timestep=".05"><flag eulerdamp="disable"/></option>
        <worldbody>
        <body><joint name="fast" type="slide" axis="1 0 0" stiffness="{spring[0]}"
        damping="{damper[0]}"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>
        <body><joint name="slow" type="slide" axis="0 1 0" stiffness="{spring[1]}"
        damping="{damper[1]}"/><inertial pos="0 0 0" mass="5" diaginertia="1 1 1"/></body>
        </worldbody></mujoco>"""
    )
    found = culprit(model, np.zeros(2))
    number = ("fast", "slow").index(named)
    mass, h = (2.0, 5.0)[number], 0.05
    # z^2 - (2 - c h / m - k h^2 / m) z + 1 - c h / m
    pull, lost = spring[number] * h**2 / mass, damper[number] * h / mass
    grows = np.max(np.abs(np.roots([1.0, lost + pull - 2.0, 1.0 - lost])))
    assert grows > 1.0
    assert found.name == named
    assert found.growth == pytest.approx(grows)
    assert found.share == pytest.approx(share)
    assert found.frequency == pytest.approx(np.sqrt(spring[number] / mass))
    assert found.damps == (damper[number] > 0.0)


def test_links_without_a_hinge_in_a_plane_are_one_body_in_it():
    links = (
        Link(0.0, 1.0, 2.0, 0.5, (0.1, 0.3, 0.4)),
        Link(1.0, 1.0, 4.0, 1.8, (0.2, 0.5, 0.6)),
        Link(2.0, 1.0, 3.0, 2.4, (0.1, 0.2, 0.3)),
    )
    hinges = (Hinge(1.0, {"torsion": 7.0}), Hinge(2.0, {"xz": 5.0, "xy": 9.0}))
    for port, stiffness, of in (("xy", 9.0, (0.4, 0.6, 0.3)), ("xz", 5.0, (0.3, 0.5, 0.2))):
        inert = Tendon("armature1", ((1, port), (0, "torsion")), np.array([1.5, 9.0]), armature=0.4)
        found = plane_of_chain(Chain(links, hinges, 3.0, (inert,)), port)
        assert found.armature[0, 0] == pytest.approx(0.4 * 1.5**2)
        centre = (2.0 * 0.5 + 4.0 * 1.8) / 6.0
        spread = 2.0 * (centre - 0.5) ** 2 + 4.0 * (1.8 - centre) ** 2
        assert found.hinges.tolist() == [2.0]
        assert found.stiffness[0, 0] == pytest.approx(stiffness)
        assert found.mass.tolist() == [6.0, 3.0]
        assert found.com == pytest.approx([centre, 2.4])
        assert found.inertia == pytest.approx([spread + of[0] + of[1], of[2]])
        # x^2 alone: half of what two of a body's moments have above the third
        own = [(0.3 + 0.4 - 0.1) / 2.0, (0.5 + 0.6 - 0.2) / 2.0, (0.2 + 0.3 - 0.1) / 2.0]
        assert found.along == pytest.approx([spread + own[0] + own[1], own[2]])


def test_steps_are_rounded_down_to_two_digits():
    given = (0.01968, 0.3, 7.99, 0.29999999999999999)
    assert [round_down(step) for step in given] == [0.019, 0.3, 7.9, 0.3]


def test_a_flat_body_turns_though_rounding_makes_it_flatter_than_flat():
    """Of a plate, the third moment is the sum of the others: Euler's rule and equations."""
    moments, rates, h, count = np.array([1.0, 2.0, 3.0]), np.array([0.4, -0.3, 0.5]), 0.1, 15
    ours = rates.copy()
    for _ in range(count):
        ours -= h * np.cross(ours, moments * ours) / moments
    exact = solve_ivp(
        lambda _, w: -np.cross(w, moments * w) / moments, (0.0, count * h), rates, rtol=1e-9
    ).y[:, -1]
    wanted = np.linalg.norm(ours - exact) / np.linalg.norm(rates)
    found = turn_error(np.diag([1.0, 2.0, 3.0 + 1e-7]), rates, h)
    assert count == np.ceil(1.0 / (np.linalg.norm(rates) * h))
    assert found == pytest.approx(wanted, rel=1e-3)
