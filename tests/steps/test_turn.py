"""What a step does to a spacecraft that turns about several axes: stated, warned of,
and decisive for "auto"."""

import mujoco
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import beamchain as bc
from appendages import close
from arrays import tube
from beamchain.steps.turn import turn_error

RATES = (0.1, -0.05, 0.08)
FAST = (0.5, -0.3, 0.4)
HUB = bc.Hub(mass=300.0, inertia=(60.0, 90.0, 120.0), offset=(0.5, 0.1, 0.0))


def euler_equations(inertia, rates, seconds):
    """Rates after a free turn, from Euler's equations by SciPy."""

    def slope(_, w):
        return np.linalg.solve(inertia, -np.cross(w, inertia @ w))

    return solve_ivp(slope, (0.0, seconds), np.array(rates), rtol=1e-11, atol=1e-13).y[:, -1]


def semi_implicit(inertia, rates, seconds, h):
    """The same by Euler's rule: the gyroscopic moment of the step before."""
    w = np.array(rates)
    for _ in range(round(seconds / h)):
        w = w - h * np.linalg.solve(inertia, np.cross(w, inertia @ w))
    return w


def central_inertia(mass):
    """`(3, 3)` inertia about the mass centre of a mass matrix `(6, 6)`:
    `J - m X X^T` with `X` the cross product by the arm."""
    arm = mass[3:, :3] / mass[0, 0]
    return mass[3:, 3:] - mass[0, 0] * arm @ arm.T


def whole_inertia(hub):
    """The same of a hub with the tube."""
    return central_inertia(hub.mass_matrix() + tube().rigid_mass())


def stated(hub, rates, timestep, integrator="Euler"):
    """The error that a fit states of its scene's step."""
    wanted = bc.Scene(timestep=timestep, integrator=integrator, rates=rates)
    return bc.fit(tube(), modes={"xy": 1}, root=bc.spec.Root(hub=hub), scene=wanted).turn_error


@pytest.mark.parametrize("step", [0.3, 0.9, 1.4])
def test_a_step_of_a_radian_or_more_is_judged_by_itself(step):
    """1 rad/s: up to the first instant at or beyond a radian, one step at least."""
    inertia, rates = np.diag([4.0, 6.0, 9.0]), np.array([0.6, -0.48, 0.64])
    seconds = np.ceil(1.0 / step) * step
    exact = euler_equations(inertia, rates, seconds)
    taken = semi_implicit(inertia, rates, seconds, step)
    found = turn_error(inertia, rates, step)
    assert found == pytest.approx(np.linalg.norm(taken - exact), rel=1e-4)


@pytest.mark.parametrize("seed", range(3))
def test_the_error_is_that_of_euler_s_rule(seed):
    axes = Rotation.random(random_state=seed).as_matrix()
    turned = axes @ np.diag(HUB.inertia) @ axes.T
    hub = bc.Hub(
        mass=HUB.mass,
        inertia=tuple(np.diag(turned)),
        offset=HUB.offset,
        products=(turned[0, 1], turned[0, 2], turned[1, 2]),
    )
    assert central_inertia(hub.mass_matrix()) == close(turned, abs=1e-10)
    inertia = whole_inertia(hub)
    size = float(np.linalg.norm(RATES))
    h = 0.05
    seconds = np.ceil(1.0 / (size * h)) * h
    exact = euler_equations(inertia, RATES, seconds)
    taken = semi_implicit(inertia, RATES, seconds, h)
    assert stated(hub, RATES, h) == close(np.linalg.norm(taken - exact) / size, rel=1e-3)


@pytest.mark.slow
def test_the_order_of_each_integrator():
    coarse, fine = (stated(HUB, RATES, h) for h in (0.2, 0.1))
    assert np.log2(coarse / fine) == close(1.0, abs=0.1)
    assert stated(HUB, RATES, 0.2, "RK4") < 1e-8
    assert stated(HUB, RATES, 0.1, "implicitfast") == close(fine, rel=0.1)


def test_a_turn_about_a_principal_axis_costs_nothing():
    straight = bc.Hub(mass=300.0, inertia=(60.0, 90.0, 120.0), offset=(0.5, 0.0, 0.0))
    assert stated(straight, (0.0, 0.3, 0.0), 0.1) < 1e-14
    assert stated(straight, (0.0, 0.0, 0.0), 0.1) == 0.0


def scene(**more):
    return bc.Scene(bandwidth=2.0, tolerance=1e-3, timestep=0.05, **more)


@pytest.mark.slow
def test_auto_takes_euler_for_slow_turns_and_rk4_for_fast_ones():
    slow, fast = (
        bc.fit(
            tube(),
            modes={"xy": 1},
            root=bc.spec.Root(hub=HUB),
            scene=scene(integrator="auto", rates=rates),
        )
        for rates in ((1e-4, 1e-4, 1e-4), FAST)
    )
    assert (slow.spec.integrator, fast.spec.integrator) == ("Euler", "RK4")
    assert slow.turn_error < 1e-3
    assert fast.turn_error < 1e-3
    assert (
        mujoco.MjModel.from_xml_string(fast.scene_mjcf()).opt.integrator
        == mujoco.mjtIntegrator.mjINT_RK4
    )
    assert fast.as_dict()["time"]["turn_error"] == fast.turn_error


@pytest.mark.slow
def test_a_step_that_turns_the_spacecraft_badly_is_said():
    wanted = scene(integrator="Euler", rates=FAST)
    result = bc.fit(tube(), modes={"xy": 1}, root=bc.spec.Root(hub=HUB), scene=wanted)
    assert result.turn_error == close(stated(HUB, FAST, 0.05), rel=1e-9)
    [said] = [w for w in result.warnings if "turns the rigid spacecraft" in w]
    assert said.endswith("whatever the appendages do.")
    assert "rates of (0.5, -0.3, 0.4) rad/s" in said


@pytest.mark.slow
def test_embed_says_it_of_the_whole_craft():
    craft = (
        '<mujoco><option timestep="0.05" gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>'
        '<inertial pos="0 0 0" mass="300" diaginertia="60 90 120"/><site name="mount" pos="0.5 0 '
        '0"/></body>'
        "</worldbody></mujoco>"
    )
    for rates, said in ((FAST, True), ((1e-5, 1e-5, 0.0), False)):
        modes = bc.Modes(xy=1, xz=0)
        spec = bc.Spec(segment=tube().segments, modes=modes, scene=scene(rates=rates))
        warnings = bc.embed(craft, {"mount": spec}, retime=False).warnings
        assert any("turns the rigid spacecraft" in w for w in warnings) is said


@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
def test_the_spring_of_the_craft_that_sets_the_limit_is_named(integrator):
    """Every step is stable for appendages that are exact in time;
    the spring of a drive is the spacecraft's own."""
    craft = (
        '<mujoco><option timestep="0.05" gravity="0 0 0" '
        f'integrator="{integrator}"/><worldbody><body name="bus"><freejoint/><inertial pos="0 0 0" '
        'mass="300" diaginertia="60 90 120"/><body name="yoke" pos="0.5 0 0"><joint name="drive" '
        'type="hinge" axis="1 0 0" stiffness="80000"/><inertial pos="0 0 0" mass="2" '
        'diaginertia="0.05 0.05 0.05"/><site name="mount"/></body></body></worldbody></mujoco>'
    )
    spec = bc.Spec(segment=tube().segments, modes=bc.Modes(xy=0, xz=2))
    [said] = [w for w in bc.embed(craft, {"mount": spec}).warnings if "becomes unstable" in w]
    assert "held mostly by the spring of joint 'drive'" in said


SERVO = (
    '<mujoco><option timestep="0.002" gravity="0 0 0" integrator="{integrator}"/><worldbody>'
    '<body name="bus"><freejoint/><inertial pos="0 0 0" mass="300" diaginertia="60 90 120"/>'
    '<body name="drum" pos="0.5 0 0"><joint name="elbow" type="hinge" axis="0 1 0"{joint}/>'
    '<inertial pos="0 0 0" mass="2" diaginertia="0.05 0.05 0.05"/><site name="mount"/></body>'
    '</body></worldbody><actuator><position name="s_elbow" joint="elbow" kp="4000"{servo}/>'
    "</actuator></mujoco>"
)


@pytest.mark.parametrize(("integrator", "most"), [("Euler", 2.0), ("RK4", 2.785)])
def test_the_kv_of_a_servo_that_sets_the_limit_is_named_with_the_inertia(integrator, most):
    """Euler and RK4 take kv at the start of the step, which is stable to 2 I/kv and 2.785 I/kv; I
    is that of the drum and of what the appendage cannot withhold."""
    spec = bc.Spec(segment=tube().segments, modes=bc.Modes(xy=0, xz=2))
    text = SERVO.format(integrator=integrator, joint="", servo=' kv="2000"')
    craft = bc.embed(text, {"mount": spec})
    [said] = [w for w in craft.warnings if "becomes unstable" in w]
    assert said.code == "unstable-step"
    assert "kv of the servo 's_elbow'" in said
    assert "armature" in said
    assert "implicitfast" in said
    data = mujoco.MjData(craft.model)
    mujoco.mj_forward(craft.model, data)
    dof = craft.model.joint("elbow").dofadr[0]
    moved = np.zeros((1, craft.model.nv))
    mujoco.mj_solveM(craft.model, data, moved, np.eye(craft.model.nv)[[dof]])
    inertia = 1.0 / moved[0, dof]
    assert f"on {inertia:.3g} kg m^2" in said
    limit = float(said.split("above the ")[1].split(" s")[0])
    assert limit == pytest.approx(most * inertia / 2000.0, rel=0.1)


@pytest.mark.parametrize(
    ("integrator", "joint", "servo"),
    [
        ("implicitfast", "", ' kv="2000"'),
        ("Euler", ' damping="2000"', ""),
        ("RK4", ' armature="50"', ' kv="2000"'),
    ],
)
def test_the_cures_that_are_named_are_stable(integrator, joint, servo):
    spec = bc.Spec(segment=tube().segments, modes=bc.Modes(xy=0, xz=2))
    text = SERVO.format(integrator=integrator, joint=joint, servo=servo)
    model = bc.embed(text, {"mount": spec}).model
    data = mujoco.MjData(model)
    data.ctrl[0] = 0.1
    for _ in range(3000):
        mujoco.mj_step(model, data)
    assert not np.any(data.warning.number)
    assert float(np.max(np.abs(data.qvel))) < 1.0
