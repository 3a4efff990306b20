"""Tests internals of `engine` too: `constraints`, `door`, `hanging`, `jobs`, `library`.

Closed forms beside the formulas of what is read from a model."""

import mujoco
import numpy as np
import pytest
from lxml import etree
from scipy.spatial.transform import Rotation

from beamchain import InputError, Linear, PortModel
from beamchain.engine import constraints, jobs, library, model_checks
from beamchain.engine.gravity_stiffness import sprung_by_acceleration
from formulas import (
    Activations,
    Inputs,
    NormalModes,
    Outputs,
    PartialFractions,
    PortLoads,
    Signal,
    Turn,
    check_workers,
    drive_in_hinge,
    drive_of,
    fractions_of,
    linear_at,
    mount,
    named_output,
    normal_modes,
    offset_cautions,
    partial_fractions,
    port_motion,
    reach,
    rest_point,
    rigid_body,
    run_of_drive,
    seen,
    simulate_hub,
    skin_vertices,
    small_turn,
    spacecraft_body,
    turn,
    unit_of_control,
)

FREE = """<mujoco><compiler angle="radian"/><option gravity="0 0 0" timestep="0.01"/><worldbody>
<body name="bus" pos="1 2 3"><freejoint/>
<inertial pos="0 0 0" mass="20" diaginertia="4 5 6"/>
<site name="port" pos=".3 -.1 .2" euler=".4 .2 -.7"/>{inside}</body></worldbody>{rest}</mujoco>"""
ARM = """<body name="link" pos=".5 0 0"><joint name="hinge" axis="0 0 1" damping=".7"/>
<inertial pos="2 0 0" mass="3" diaginertia=".3 .3 .4"/><site name="hand" pos="3 0 0"/></body>"""


def craft(inside="", rest=""):
    return mujoco.MjModel.from_xml_string(FREE.format(inside=inside, rest=rest))


@pytest.mark.parametrize("axis", np.vstack([np.eye(3), [2 / 3, -1 / 3, 2 / 3]]))
def test_a_turn_is_its_axis_times_the_sine_in_the_axes_it_starts_from(axis):
    start = Rotation.from_rotvec([0.4, -0.2, 0.9])
    now = start * Rotation.from_rotvec(0.3 * axis)
    got = small_turn(start.as_matrix(), now.as_matrix())
    assert got == pytest.approx(np.sin(0.3) * axis, abs=1e-14)


def test_accelerance_of_poles_is_their_sum():
    # of what is sprung s^2 / (s p - 1), of what is not s / (s p - 1): of 1 / p, the poles of s
    sprung = np.array([[[2.0 + 1.0j]], [[0.5 + 0.0j]]])
    loose = np.array([[[0.0j]], [[0.3 - 0.2j]]])
    made = PartialFractions(np.array([0.2 + 0.1j, 0.4 + 0.0j]), sprung, loose, np.array([[7.0]]))
    s = 1j * np.array([0.3, 2.0])
    first = s**2 * (2.0 + 1.0j) / (0.2 * s + 0.1j * s - 1.0)
    second = (0.5 * s**2 + (0.3 - 0.2j) * s) / (0.4 * s - 1.0)
    assert made(s.imag)[0, 0] == pytest.approx(7.0 + first + second, rel=1e-13)
    assert made.poles == pytest.approx([1.0 / (0.2 + 0.1j), 2.5])


# -- places and motions ----------------------------------------------------------------------------
def test_a_port_moves_another_of_its_body_as_a_rigid_body_does():
    """v' = v + w x r, each in its own axes."""
    model = craft('<site name="other" pos="-.2 .5 .1" euler="0 .9 .3"/>')
    one, other = mount(model, "port", "site", "port"), mount(model, "other", "site", "other")
    v, w = np.array([0.3, -0.2, 0.5]), np.array([1.0, 2.0, -0.7])
    moved = other.axes.T @ (one.axes @ v + np.cross(one.axes @ w, other.origin - one.origin))
    found = one.from_port(other) @ np.concatenate([v, w])
    assert found == pytest.approx(np.concatenate([moved, other.axes.T @ one.axes @ w]), abs=1e-14)
    assert one.held() == []


def test_a_port_on_a_hinge_is_held_in_what_the_hinge_does_not_turn():
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body name="bus"><joint axis="0 0 1"/>
        <inertial pos="0 0 0" mass="20" diaginertia="4 5 6"/><site name="port" pos=".5 0 0"/>
        </body></worldbody></mujoco>"""
    )
    assert mount(model, "port", "site", "port").held() == ["xy", "xz", "torsion", "axial"]
    assert mount(model, "port", "site", "port").hub[5, 5] == pytest.approx(6.0 + 20.0 * 0.25)


@pytest.mark.parametrize("size", [1e-4, 1.0, 50.0])
def test_a_hinge_moves_what_lies_farthest_from_it_by_its_arm(size):
    model = craft(ARM)
    motion = np.zeros(model.nv)
    motion[6] = size
    rest = np.array(model.qpos0)
    assert reach(model, rest, motion) == pytest.approx(3.0 * size, rel=1e-8)
    assert turn(model, rest, motion) == pytest.approx(size, rel=1e-8)
    assert reach(model, rest, 0.0 * motion) == 0.0


def test_vertices_of_a_skin_are_the_weighted_places_of_its_bones():
    model = craft(
        """<geom size=".1"/><body name="tip" pos="2 0 0"><joint axis="0 1 0"/><geom size=".1"/>
        </body>""",
        """<deformable><skin vertex="1 .3 0 1.5 0 .2 2.5 .1 0" face="0 1 2">
        <bone body="bus" bindpos=".1 0 0" bindquat=".8 .6 0 0" vertid="0 1" vertweight="1 .25"/>
        <bone body="tip" bindpos="2 .1 0" bindquat=".6 0 .8 0" vertid="1 2" vertweight=".75 1"/>
        </skin></deformable>""",
    )
    data = mujoco.MjData(model)
    data.qpos[3:] = [0.5, 0.5, -0.5, 0.5, 0.4]
    mujoco.mj_kinematics(model, data)
    vertices = np.array([[1, 0.3, 0], [1.5, 0, 0.2], [2.5, 0.1, 0]])

    def carried(body, at, quaternion, p):
        inside = Rotation.from_quat(quaternion, scalar_first=True).inv().apply(p - np.array(at))
        return data.body(body).xpos + data.body(body).xmat.reshape(3, 3) @ inside

    first = [carried("bus", (0.1, 0, 0), (0.8, 0.6, 0, 0), p) for p in vertices]
    second = [carried("tip", (2, 0.1, 0), (0.6, 0, 0.8, 0), p) for p in vertices]
    wanted = [first[0], 0.25 * first[1] + 0.75 * second[1], second[2]]
    np.testing.assert_allclose(skin_vertices(model, data, 0), wanted, atol=1e-6)  # single precision


# -- signals ---------------------------------------------------------------------------------------
def test_motion_of_a_site_is_told_in_the_axes_it_starts_from():
    model = craft()
    point = rest_point(model)
    data = point.data()
    mujoco.mj_forward(model, data)
    _, output = named_output(point, data, "motion:port")
    place, axes = data.site("port").xpos.copy(), data.site("port").xmat.reshape(3, 3).copy()
    data.qpos[:3] += [0.2, -0.3, 0.4]
    mujoco.mj_forward(model, data)
    found = output.read(data)
    assert found[:3] == pytest.approx(axes.T @ [0.2, -0.3, 0.4], abs=1e-14)
    assert data.site("port").xpos - place == pytest.approx([0.2, -0.3, 0.4])
    assert found[3:] == pytest.approx(np.zeros(3), abs=1e-14)


def test_units_of_controls():
    actuators = {
        '<motor joint="hinge"/>': "N m",
        '<motor joint="hinge" gear="2"/>': "N m",
        '<general joint="hinge" gainprm="2"/>': "",
        '<motor joint="slide"/>': "N",
        '<position joint="hinge" kp="3"/>': "rad",
        '<position joint="slide" kp="3" kv="1"/>': "m",
        '<velocity joint="hinge" kv="3"/>': "rad/s",
        '<velocity joint="slide" kv="3"/>': "m/s",
        '<general joint="hinge" gainprm="3" biastype="affine" biasprm="0 -2 0"/>': "",
        '<intvelocity joint="hinge" kp="3" actrange="-1 1"/>': "",
        '<motor site="port" gear="0 0 1 0 0 0"/>': "N",
        '<motor site="port" gear="0 0 0 0 1 0"/>': "N m",
        '<motor site="port" gear="0 0 1 0 1 0"/>': "",
    }
    slide = '<body><joint name="slide" type="slide"/><geom size=".1"/></body>'
    model = craft(ARM + slide, f"<actuator>{''.join(actuators)}</actuator>")
    assert [unit_of_control(model, i) for i in range(model.nu)] == list(actuators.values())


def test_linear_system_of_a_hinge_with_a_lagging_motor_and_a_sensor():
    """J q'' = -k q - d q' + g a,  a' = (u - a) / tau; the sensors read q' and q."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option gravity="0 0 0"/><worldbody><body>
        <joint name="hinge" axis="0 1 0" stiffness="7" damping=".3"/>
        <inertial pos="0 0 0" mass="1" diaginertia="4 5 6"/></body></worldbody>
        <actuator><general name="lag" joint="hinge" dyntype="filter" dynprm=".5" gear="3"/>
        </actuator><sensor><jointvel name="spin" joint="hinge"/><jointpos name="angle"
        joint="hinge"/></sensor></mujoco>"""
    )
    point = rest_point(model)
    outputs = [named_output(point, point.data(), name)[1] for name in ("spin", "angle")]
    found = linear_at(point, outputs=outputs)
    assert (found.mass, found.damping, found.stiffness) == pytest.approx((5.0, 0.3, 7.0), rel=1e-9)
    assert found.activations.force == pytest.approx(3.0, rel=1e-9)
    assert found.activations.rate == pytest.approx(-2.0, rel=1e-9)
    assert found.outputs.position == pytest.approx(np.array([[0.0], [1.0]]), abs=1e-9)
    assert found.outputs.rate == pytest.approx(np.array([[1.0], [0.0]]), abs=1e-9)


# -- runs ------------------------------------------------------------------------------------------
def test_a_constant_force_and_torque_move_a_free_body_as_euler_does():
    """x_k = F h^2 / m k (k + 1) / 2, and the same of the angle about an axis of inertia."""
    wrench = np.zeros((50, 6))
    wrench[:, 1], wrench[:, 5] = 3.0, 0.6
    found = simulate_hub(craft(), "Euler", 0.02, wrench)
    k = np.arange(1, 51)
    grown = 0.02**2 * k * (k + 1) / 2.0
    np.testing.assert_allclose(found.motion[:, 1], 3.0 / 20.0 * grown, rtol=1e-9)
    np.testing.assert_allclose(found.motion[:, 5], 0.6 / 6.0 * grown, rtol=1e-9)
    np.testing.assert_allclose(found.motion[:, [0, 2, 3, 4]], 0.0, atol=1e-15)
    assert found.seconds >= 0.0


def test_a_run_that_breaks_off_is_not_a_number():
    wrench = np.full((20, 6), 1e14)
    assert not np.all(np.isfinite(simulate_hub(craft(), "Euler", 10.0, wrench).motion))


def test_a_driven_hinge_on_a_free_body_keeps_momentum_and_its_angle():
    model = craft(ARM)
    joint = model.joint("hinge").id
    found = drive_of(model, joint, [joint], Turn(0.8, 4.0), spacing=0.2, samples=21)
    turned = [Turn(0.8, 4.0).at(t)[0] for t in 0.2 * np.arange(21)]
    np.testing.assert_allclose(found.qpos[:, 7], turned, atol=1e-12)
    assert found.qpos[-1, 7] == pytest.approx(0.8)
    data = mujoco.MjData(model)
    for qpos, qvel in zip(found.qpos, found.qvel, strict=True):
        data.qpos[:], data.qvel[:] = qpos, qvel
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        assert np.abs(data.subtree_linvel[1]).max() < 1e-6
        assert np.abs(data.subtree_angmom[1]).max() < 1e-5
    # rigid bodies about their common centre: reduced mass, and the two inertias
    speed = found.qvel[10]
    inertia = 0.4 + 3.0 * 20.0 / 23.0 * 2.0**2
    assert abs(speed[5]) > 0.1 * speed[6] / inertia


@pytest.mark.parametrize(("integrator", "miss"), [("RK4", 1e-4), ("implicitfast", 2e-2)])
def test_a_craft_under_the_torques_of_its_drive_makes_the_turn(integrator, miss):
    model = craft(ARM)
    joint, made = model.joint("hinge").id, Turn(0.8, 4.0)
    drive = drive_of(model, joint, [joint], made, spacing=0.2, samples=26)
    found = run_of_drive(model, [joint], drive, integrator, 10)
    times = 0.2 * np.arange(26)
    assert np.max(np.abs(found.qpos[:, 7] - [made.at(t)[0] for t in times])) < miss
    assert np.max(np.abs(found.qvel[:, 6] - [made.at(t)[1] for t in times])) < miss
    assert found.qpos[-1, 7] == pytest.approx(0.8, abs=miss)


def test_a_turning_arm_seen_from_outside():
    """Two bodies with no momentum: each has the other's, reversed."""
    model = craft(ARM)
    joint, link = model.joint("hinge").id, model.body("link").id
    drive = drive_of(model, joint, [joint], Turn(0.8, 4.0), spacing=0.2, samples=21)
    run = run_of_drive(model, [joint], drive, "RK4", 10)
    found = seen(model, run, [link], [model.site("hand").id], link)
    centre = np.array([1.0, 2.0, 3.0]) + 3.0 / 23.0 * np.array([2.5, 0.0, 0.0])
    for k in range(21):
        at, rate = run.qpos[k, :3], run.qvel[k, 5]
        speed, whole = run.qvel[k, :3], rate + run.qvel[k, 6]
        momentum = 6.0 * rate + 20.0 * np.cross(at - centre, speed)[2]
        energy = 20.0 * speed @ speed * (1.0 + 20.0 / 3.0) + 6.0 * rate**2 + 0.4 * whole**2
        assert found.share[k] == pytest.approx(abs(momentum), abs=1e-6)
        assert found.energy[k] == pytest.approx(energy / 2.0, abs=1e-6)
        turned = Rotation.from_quat(run.qpos[k, 3:7], scalar_first=True)
        now = turned * Rotation.from_rotvec([0.0, 0.0, run.qpos[k, 7]])
        assert found.rotations[k, 0] == pytest.approx(now.as_matrix(), abs=1e-9)
        hinge = at + turned.apply([0.5, 0.0, 0.0])
        assert found.places[k, 0] == pytest.approx(hinge, abs=1e-9)
        assert found.places[k, 1] == pytest.approx(hinge + now.apply([3.0, 0, 0]), abs=1e-9)
    assert np.max(np.abs(found.momentum)) < 1e-5
    assert np.max(found.share) > 0.1


def test_the_torque_of_a_turn_in_a_hinge_makes_it():
    """Bang-bang over the duration: half of the angle in the middle, all at the end, at rest."""
    model = craft(ARM)
    model.opt.timestep = 4e-3
    joint, angle, duration = model.joint("hinge").id, 0.9, 2.0
    push = drive_in_hinge(model, joint, [], angle)(angle, duration)
    data = mujoco.MjData(model)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for k in range(500):
        push(data, k * 4e-3, (k + 1) * 4e-3)
        mujoco.mj_step(model, data)
        if k == 249:
            assert data.qpos[7] == pytest.approx(angle / 2.0, abs=8e-3)
    assert data.qpos[7] == pytest.approx(angle, abs=8e-3)
    assert data.qvel[6] == pytest.approx(0.0, abs=8e-3)


# -- loads -----------------------------------------------------------------------------------------
@pytest.mark.parametrize(("offset", "beside"), [(0.02, "20 mm"), (-0.02, "20 mm"), (1e-5, "")])
def test_a_thrust_beside_the_centre_of_mass_is_told_in_millimetres(offset, beside):
    thruster = f'<site name="thruster" pos="0 {offset} 0"/>'
    rest = """<actuator><motor site="thruster" gear="5 0 0 0 0 0"/></actuator>
    <keyframe><key name="burn" ctrl="2"/></keyframe>"""
    model = craft(thruster, rest)
    said = offset_cautions(model, 0, 1, np.array(model.qpos0), "burn")
    assert len(said) == bool(beside)
    if said:
        assert beside in said[0]
        assert "0.2 N m" in said[0]
    assert offset_cautions(model, None, 1, np.array(model.qpos0), "burn") == []


# -- what ports carry ------------------------------------------------------------------------------
def test_response_of_a_body_with_appendages_that_carry_is_that_of_all_coordinates():
    """Two appendages, the second on a port of the first: q and the modes in one mass matrix."""
    random = np.random.default_rng(3)

    def spread(size):
        rows = random.normal(size=(size, size))
        return rows @ rows.T + size * np.eye(size)

    counts, points = (2, 1), ((5.0, 2.0), (3.0,))
    ports = ((0, 5.0), (0, 2.0), (1, 3.0))
    models = [
        PortModel(
            spread(6),
            np.sort(random.uniform(1.0, 4.0, n)),
            random.normal(size=(n, 6)) / 3.0,
            np.full(n, 0.03),
            tip=random.normal(size=(n, 6 * len(places))),
            points=places,
        )
        for n, places in zip(counts, points, strict=True)
    ]
    roots = [random.normal(size=(6, 24)) for _ in models]
    roots[0][:, 6:] = 0.0
    roots[1][:, 12:] = 0.0
    carried = spread(24)
    bus = spread(6)
    carried[:6, :6] = 0.0
    shapes = np.zeros((18, 3))
    shapes[:6, :2], shapes[6:12, :2] = models[0].tip[:, :6].T, models[0].tip[:, 6:].T
    shapes[12:, 2:] = models[1].tip.T
    by_modes = np.block([[np.eye(6), np.zeros((6, 3))], [np.zeros((18, 6)), shapes]])
    mass = by_modes.T @ carried @ by_modes
    mass[:6, :6] += bus
    mass[6:, 6:] += np.eye(3)
    for model, root, at in zip(models, roots, (slice(6, 8), slice(8, 9)), strict=True):
        moved = root @ by_modes
        mass += moved.T @ model.rigid_mass @ moved
        coupled = np.zeros((9, 9))
        coupled[at] = model.participation @ moved
        mass += coupled + coupled.T
    w = np.concatenate([model.frequencies for model in models])
    omega = np.array([0.7, 2.5])
    carrying = PortLoads(tuple(roots), carried, ports)
    assert carrying.by_modes(models) == pytest.approx(by_modes)
    got = rigid_body(bus).response(omega, models, carrying=carrying)
    for k, s in enumerate(1j * omega):
        held = np.zeros(9, dtype=complex)
        held[6:] = 0.06 * w / s + (w / s) ** 2
        wanted = np.linalg.inv(mass + np.diag(held))[:6, :6]
        assert got[:, :, k] == pytest.approx(wanted, rel=1e-9, abs=1e-12)


def test_a_craft_without_a_free_body_is_its_first_body():
    arm = '<body name="{}">{}<geom size=".1"/></body>'
    for joint, wanted in (("", 1), ("<freejoint/>", 2)):
        both = arm.format("one", "") + arm.format("two", joint)
        model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{both}</worldbody></mujoco>")
        assert spacecraft_body(model) == wanted


def test_one_worker_is_a_number_of_workers():
    check_workers(None)
    check_workers(1)
    for wrong in (0, -1):
        with pytest.raises(InputError):
            check_workers(wrong)


@pytest.mark.parametrize("drag", [0.0, 0.4])
@pytest.mark.parametrize("stiffness", [0.5, 50.0, 5e4])
def test_the_accelerance_as_a_sum_of_poles_of_a_damped_oscillator(stiffness, drag):
    """A spring and a damper on q, beside a body x that it pulls along, free or on a damper of its
    own; both pushed and seen."""
    names = (Signal("u", "N"),)
    mass = np.array([[3.0, 1.0], [1.0, 2.0]])
    damping, spring = np.diag([0.7, drag]), np.diag([stiffness, 0.0])
    none = np.zeros((1, 2))
    made = Linear(
        mass,
        damping,
        spring,
        (Signal("q", "m"), Signal("x", "m")),
        Inputs(names, np.array([[1.0], [0.4]])),
        Outputs(names, none, none, np.array([[1.0, 0.7]]), np.zeros((1, 1))),
        Activations((), np.zeros((2, 0)), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))),
    )
    omega = np.array([0.3, 4.0, 90.0])
    found = fractions_of(made)(omega)[0, 0]
    moved = [np.linalg.solve(spring + 1j * w * damping - w**2 * mass, [1.0, 0.4]) for w in omega]
    wanted = -(omega**2) * (np.array(moved) @ [1.0, 0.7])
    assert found == pytest.approx(wanted, rel=1e-9)
    # it must give the response that is told, to 1e-8 of it, at the end of the band too
    for off, taken in ((0.9e-8, True), (1.1e-8, False)):
        for at in (0.02, 2.0):

            def told(omega, at=at, off=off):
                near = np.where(np.isclose(omega, at), off, 0.0)
                return fractions_of(made)(omega) * (1.0 + near)

            assert (partial_fractions(made, 2.0, told) is not None) == taken


# -- small ones ------------------------------------------------------------------------------------
@pytest.mark.parametrize("own", [0.0, 1.3])
@pytest.mark.parametrize("quat", ["1 0 0 0", ".8 0 .36 .48"])
def test_a_pendulum_is_sprung_by_its_weight_against_the_axis_of_its_root(quat, own):
    """m a l, 2 kg half a metre down, however the root is turned, on top of the spring that it has;
    what has none gets none."""
    element = etree.fromstring(
        f"""<mujoco><worldbody><body name="root" quat="{quat}"><inertial pos="0 0 0" mass="1"
        diaginertia="1 1 1"/><body name="free"><joint name="free" axis="1 0 0"/><inertial
        pos="0 0 0" mass="1" diaginertia="1 1 1"/><body name="ball" pos=".2 0 0"><joint name="swing"
        axis="0 1 0" stiffness="{own:g}"/><inertial pos="-.5 0 0" mass="2" diaginertia="1 1 1"/>
        </body></body></body></worldbody></mujoco>"""
    )
    free, swing = sprung_by_acceleration(element, 3.0).iter("joint")
    assert float(swing.get("stiffness")) == pytest.approx(own + 2.0 * 3.0 * 0.5, rel=1e-6)
    assert free.get("stiffness") is None
    assert [joint.get("stiffness") for joint in element.iter("joint")] == [None, f"{own:g}"]


def test_jobs_in_this_process_come_back_in_their_order():
    told = []
    found = jobs.run_jobs(pow, [(2, 3), (3, 2)], progress=lambda *done: told.append(done))
    assert found == [8, 9]
    assert told == [(0, 2), (1, 2), (2, 2)]
    assert jobs.run_jobs(pow, [(2, 5)]) == [32]


@pytest.mark.parametrize(("stiffness", "well"), [(1e2, True), (1e9, False)])
def test_a_model_that_its_step_tears_apart_steps_badly(stiffness, well):
    spring = f'<joint name="j" type="slide" stiffness="{stiffness}"/>'
    link = f'<body>{spring}<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    assert model_checks.steps_well(craft(link)) is well


def test_ports_of_one_appendage_have_each_six_columns_of_its_tip():
    tip = np.arange(36.0).reshape(2, 18)
    places = (5.0, 2.0, 3.0)
    model = PortModel(np.eye(6), np.array([1.0, 2.0]), np.zeros((2, 6)), tip=tip, points=places)
    rigid = PortModel(np.eye(6), np.zeros(0), np.zeros((0, 6)))
    assert np.array_equal(port_motion(model, (2.0,)), tip[:, 6:12])
    assert np.array_equal(port_motion(model, (3.0, 5.0)), tip[:, [*range(12, 18), *range(6)]])
    assert port_motion(model, ()).shape == (2, 0)
    assert port_motion(rigid, (5.0, 2.0)).shape == (0, 12)


# -- threads ---------------------------------------------------------------------------------------
def test_within_one_thread_openblas_has_one_and_then_as_many_as_before():
    switches = library._switches()
    before = [get() for get, _ in switches]
    try:
        for _, put in switches:
            put(2)
        with library.one_thread():
            with library.one_thread():
                assert [get() for get, _ in switches] == [1] * len(switches)
            assert [get() for get, _ in switches] == [1] * len(switches)
        assert [get() for get, _ in switches] == [2] * len(switches)
    finally:
        for (_, put), count in zip(switches, before, strict=True):
            put(count)


def test_a_setting_is_made_by_the_first_that_enters_and_undone_by_the_last_that_leaves():
    told = []
    setting = library._WhileAny(lambda: told.append("made") or (lambda: told.append("undone")))
    for _ in range(2):
        told.clear()
        with setting():
            with setting():
                assert told == ["made"]
            assert told == ["made"]
        assert told == ["made", "undone"]


# -- constraints -----------------------------------------------------------------------------------
TIED = """<mujoco><option>{flag}</option><worldbody><geom name="floor" type="plane" size="9 9 1"/>
<body name="a" pos="0 0 {height}"><joint name="up" type="slide" axis="0 0 1" limited="true"
range="-.5 .5"/><geom size="1"/><site name="s"/></body>
<body name="b" pos="5 0 0"><joint axis="0 0 1" frictionloss=".1"/><geom size=".1" pos="0 0 3"/>
<site name="t"/></body><body name="c" pos="9 0 9"><joint name="j" frictionloss=".2"/>
<joint name="k" axis="0 1 0"/><geom size=".1"/></body></worldbody>
<tendon><fixed name="rope" frictionloss="1" limited="true" range="-.2 .2">
<joint joint="up" coef="1"/></fixed></tendon><equality><joint joint1="j" joint2="k"/>
<joint joint1="up"/><weld name="glue" body1="a" body2="b"/><connect site1="s" site2="t"/>
<weld body1="b" body2="c" active="false"/></equality></mujoco>"""


def tied(height=1.0, flag=""):
    return mujoco.MjModel.from_xml_string(TIED.format(height=height, flag=flag))


def test_constraints_are_named_by_themselves_or_by_what_they_tie():
    assert constraints.equalities(tied()) == [
        "joint of 'j' and 'k'",
        "joint of 'up'",
        "weld 'glue'",
        "connect of 's' and 't'",
        "weld of 'b' and 'c', inactive at the start",
    ]
    assert constraints.with_dry_friction(tied()) == ["joint 1", "joint 'j'", "tendon 'rope'"]
    for flag in ("equality", "constraint"):
        assert constraints.equalities(tied(flag=f'<flag {flag}="disable"/>')) == []
    for flag in ("frictionloss", "constraint"):
        assert constraints.with_dry_friction(tied(flag=f'<flag {flag}="disable"/>')) == []
    assert not constraints.equalities(constraints.without_constraints(tied()))
    assert constraints.listed(["a", "b", "c"]) == "a, b, c"
    assert constraints.listed(["a", "b", "c", "d"]) == "a, b, c and 1 more"
    assert constraints.listed(["a, x", "b", "c", "d", "e"]) == "a, x; b; c and 2 more"


@pytest.mark.parametrize(
    ("moved", "beyond"),
    [(0.1, []), (0.3, ["tendon 'rope'"]), (0.6, ["joint 'up'", "tendon 'rope'"])],
)
def test_what_is_beyond_its_limit_or_touches_is_named(moved, beyond):
    """The ball stands 0.2 m above its floor, and 0.1 m below its rest it does not touch."""
    for sign in (1.0, -1.0):
        model = tied(height=1.2)
        data = mujoco.MjData(model)
        data.qpos[0] = sign * moved
        mujoco.mj_forward(model, data)
        assert sorted(constraints.beyond_limits(model, data)) == beyond
        touches = sign * moved < -0.2
        assert constraints.touching(model, data) == [("floor", "a")] * touches


@pytest.mark.parametrize("length", [0.1, 1.0, 30.0])
def test_a_quaternion_of_any_length_is_its_turn(length):
    quaternion = np.array([0.4, -0.2, 0.8, 0.1])
    wanted = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    found = library.rotation_matrix(length * quaternion)
    assert found == pytest.approx(wanted, abs=1e-12)


def test_modes_in_another_order_with_other_signs():
    shapes, mass = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]), np.eye(3)
    modes = NormalModes(np.ones((3, 1)), (0,), shapes, np.array([7.0, 8.0]), mass)
    found = modes.ordered([1, 0], np.array([1.0, -1.0]))
    assert found.shapes.tolist() == [[2.0, -1.0], [4.0, -3.0], [6.0, -5.0]]
    assert found.frequency.tolist() == [8.0, 7.0]
    assert (found.pivots, found.mass) == ((0,), mass)


@pytest.mark.parametrize("field", ["body_mass", "jnt_axis", "site_pos"])
def test_one_number_that_is_not_finite_is_named(field):
    model = mujoco.MjModel.from_xml_string(FREE.format(inside=ARM, rest=""))
    model_checks.check_model(model, "a.xml")
    getattr(model, field)[-1] = np.nan
    with pytest.raises(InputError, match="a.xml: .* is nan"):
        model_checks.check_model(model, "a.xml")


def test_a_mode_points_along_the_part_that_carries_most_of_its_energy():
    """(20, 1) and (5, -1) of 1 and 100 kg: the second part has four fifths of the second mode."""
    mass = np.diag([1.0, 100.0])
    shapes = np.array([[20.0, 1.0], [5.0, -1.0]]).T / np.sqrt([500.0, 125.0])
    stiffness = mass @ shapes @ np.diag([4.0, 9.0]) @ shapes.T @ mass
    found = normal_modes(mass, stiffness)
    assert found.frequency == pytest.approx([2.0, 3.0])
    assert found.shapes == pytest.approx(shapes * [1.0, -1.0])


def test_a_soft_spring_beside_a_stiff_one_is_no_rigid_motion():
    """Two bodies on a spring between them drift; a third hangs on a spring of 1e-10 of it."""
    stiffness = np.zeros((3, 3))
    stiffness[:2, :2] = 4e5 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    stiffness[2, 2] = 4e-5
    found = normal_modes(np.diag([2.0, 3.0, 5.0]), stiffness)
    between = 4e5 * (1.0 / 2.0 + 1.0 / 3.0)
    assert found.frequency == pytest.approx(np.sqrt([4e-5 / 5.0, between]), rel=1e-9)
    assert np.abs(found.rigid[:, 0]) == pytest.approx([1.0, 1.0, 0.0])
    assert found.rigid.shape == (3, 1)


def test_coordinates_of_modes_are_rigid_motions_and_flexible_ones_times_their_frequency():
    """(r, w eta, r', eta', a) of q = R r + S eta, and back."""
    random = np.random.default_rng(6)
    root = random.normal(size=(3, 3))
    mass = root @ root.T + np.eye(3)
    turn = np.linalg.cholesky(np.linalg.inv(mass))  # of unit mass
    modes = NormalModes(3.0 * turn[:, :1], (0,), turn[:, 1:], np.array([0.4, 7.0]), mass)
    there, back = modes.transformation(2)
    r, eta, r_rate, eta_rate, a = 0.3, [1.5, -0.8], -0.6, [0.9, 2.1], [4.0, 5.0]
    q = modes.rigid @ [r] + modes.shapes @ eta
    q_rate = modes.rigid @ [r_rate] + modes.shapes @ eta_rate
    state, modal = [*q, *q_rate, *a], [r, 0.4 * 1.5, 7.0 * -0.8, r_rate, *eta_rate, *a]
    assert there @ modal == pytest.approx(np.array(state))
    assert back @ state == pytest.approx(np.array(modal))


def test_heavy_modes_are_of_unit_mass_and_point_along_their_largest_part():
    """400 and 900 kg on springs of 36 N/m to each other, 100 N/m to the ground."""
    mass = np.diag([400.0, 900.0])
    stiffness = np.array([[136.0, -36.0], [-36.0, 36.0]])
    found = normal_modes(mass, stiffness)
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(mass, stiffness)))
    assert found.frequency == pytest.approx(np.sqrt(squares))
    assert found.shapes.T @ mass @ found.shapes == pytest.approx(np.eye(2), abs=1e-12)
    assert (found.shapes[1, 0] > 0.0, found.shapes[0, 1] > 0.0) == (True, True)
    assert found.rigid.shape == (2, 0)
