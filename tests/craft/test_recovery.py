"""What is recovered inside an appendage, against finite elements that share no code with the
package, and against Newton's and Euler's equations body by body."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import beamchain as bc
from hub_and_beam import HubAndBeam

KEPT = 1e-6  # of the largest value: kept modes against finite elements of the same modes
TIMED = 3e-6  # poles of a retimed file are exact, what each adds is so nearly (1e-6 here)
WHOLE = 1e-3  # with the static part, against all modes: what is left is their dynamics
LACKS = 0.03  # by more than this the kept modes alone are off
EXACT = 1e-9  # of the largest value: sums of the same forces, in another order
SMALL = 1e-4  # N m, so small a torque that second-order motion is below KEPT

DIAMETER, WALL, LENGTH = 0.1, 0.002, 8.0
YOUNG, DENSITY = 7e10, 2700.0
AREA = np.pi * WALL * (DIAMETER - WALL)
SECOND_MOMENT = np.pi / 64.0 * (DIAMETER**4 - (DIAMETER - 2.0 * WALL) ** 4)
OMEGA = 2.0  # rad/s of the torque
STEP = 1e-3  # s, of RK4
STATIONS = [0.0, 2.0, 4.0, 6.0]

TRUTH = HubAndBeam(
    length=LENGTH,
    bending_stiffness=YOUNG * SECOND_MOMENT,
    linear_mass=DENSITY * AREA,
    hub_mass=300.0,
    hub_inertia=1500.0,
    offset=0.5,
)
CRAFT = """<mujoco><option gravity="0 0 0" timestep="{step}" integrator="{integrator}"/>
<worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="300" diaginertia="1500 1500 1500"/><site name="centre"/>
<site name="mount" pos="0.5 0 0"/></body></worldbody>
<actuator><motor name="wz" site="centre" gear="0 0 0 0 0 1"/></actuator></mujoco>"""


def boom(**more):
    segment = bc.Segment(
        length=LENGTH,
        section=bc.Tube(outer_diameter=DIAMETER, wall=WALL),
        material=bc.Material(youngs_modulus=YOUNG, density=DENSITY),
    )
    return bc.Spec(segment=(segment,), modes=bc.Modes(xy=2, xz=0), **more)


def craft(spec, step=1e-3, integrator="RK4", **more):
    return bc.embed(CRAFT.format(step=step, integrator=integrator), {"mount": spec}, **more)


def off(values, wanted):
    """Largest difference over the largest value."""
    values, wanted = np.asarray(values), np.asarray(wanted)
    return float(np.max(np.abs(values - wanted)) / np.max(np.abs(wanted)))


def torque(time):
    return SMALL * np.sin(OMEGA * time) ** 3


def steer(model, data):
    """The torque within a step as well."""
    data.ctrl[0] = torque(data.time)


@pytest.fixture(scope="module")
def kept():
    """Frequencies and shapes of the two modes that are kept."""
    return TRUTH.cantilever(2)


@pytest.fixture(scope="module")
def slew():
    """A free run of the spacecraft, its springs on hinges, recorded."""
    flexible = craft(boom(fit=bc.spec.FitOptions(springs="hinges")), step=STEP)
    data = mujoco.MjData(flexible.model)
    record = flexible.recorder()
    mujoco.set_mjcb_control(steer)
    try:
        for step in range(1600):
            data.ctrl[0] = torque(data.time)
            if step % 10 == 0:
                record(data)
            mujoco.mj_step(flexible.model, data)
    finally:
        mujoco.set_mjcb_control(None)
    return flexible, record


def test_a_free_run_of_the_kept_modes(slew, kept):
    flexible, record = slew
    loads = flexible.recover(record, "mount", x=STATIONS, static=False)
    frequencies, shapes = kept
    basis = np.column_stack([TRUTH.rigid, shapes])
    moved, accelerated = TRUTH.motion(basis, SMALL, OMEGA, loads.time)
    mass = TRUTH.beam[1]
    root = -TRUTH.rigid.T @ mass @ accelerated
    misses = off(loads.root_force[:, 1], root[0]), off(loads.root_moment[:, 2], root[1])
    print(f"root force {misses[0]:.1e}, root moment {misses[1]:.1e}")
    assert max(misses) < KEPT
    relative = moved - TRUTH.rigid @ moved[:2]
    amplitudes = shapes.T @ mass @ relative
    assert off(loads.amplitudes, amplitudes.T) < KEPT
    for s, x in enumerate(STATIONS):
        force, moment = TRUTH.strain_load(x, frequencies, shapes) @ amplitudes
        misses = off(loads.force[:, s, 1], force), off(loads.moment[:, s, 2], moment)
        print(f"x = {x}: shear {misses[0]:.1e}, moment and stress {misses[1]:.1e}")
        assert max(misses) < KEPT
    fibre = -loads.moment[:, 2, 2] * DIAMETER / 2.0 / SECOND_MOMENT
    assert off(loads.stress_at(DIAMETER / 2.0, 0.0)[:, 2], fibre) < EXACT
    assert off(loads.displacement[:, 2, 1], relative[2 * TRUTH.node(4.0)]) < KEPT
    assert off(loads.rotation[:, 2, 2], relative[2 * TRUTH.node(4.0) + 1]) < KEPT
    assert off(loads.acceleration[:, 2, 1], accelerated[2 * TRUTH.node(4.0)]) < KEPT


def test_a_free_run_with_the_modes_left_out(slew):
    """The whole beam, of which the file holds two modes."""
    flexible, record = slew
    loads = flexible.recover(record, "mount", x=STATIONS)
    alone = flexible.recover(record, "mount", x=STATIONS, static=False)
    moved, accelerated = TRUTH.motion(TRUTH.whole, SMALL, OMEGA, loads.time)
    relative = moved - TRUTH.rigid @ moved[:2]
    force, moment = TRUTH.load(0.0, moved, accelerated)
    assert off(loads.root_force[:, 1], force) < WHOLE
    assert off(loads.root_moment[:, 2], moment) < WHOLE
    print(f"root moment {off(loads.root_moment[:, 2], moment):.1e}")
    assert off(alone.force[:, 0, 1], force) > LACKS
    for s, x in enumerate(STATIONS):
        force, moment = TRUTH.load(x, moved, accelerated)
        assert off(loads.force[:, s, 1], force) < WHOLE
        assert off(loads.moment[:, s, 2], moment) < WHOLE
        if x > 0.0:
            node = 2 * TRUTH.node(x)
            assert off(loads.displacement[:, s, 1], relative[node]) < WHOLE
            assert off(loads.acceleration[:, s, 1], accelerated[node]) < WHOLE
    stress = -force_to_stress(TRUTH.load(4.0, moved, accelerated)[1])
    found = loads.stress_at(DIAMETER / 2.0, 0.0)[:, 2]
    print(f"stress at mid-span {off(found, stress):.1e}")
    assert off(found, stress) < WHOLE
    assert off(loads.stress[:, 2, 0], np.abs(stress)) < WHOLE


def force_to_stress(moment):
    """Normal stress of the outermost fibre."""
    return moment * DIAMETER / 2.0 / SECOND_MOMENT


# -- at positions of the truth ---------------------------------------------------------------------
def tendon_rows(model, labels):
    """Coefficients of tendons over the joints, by MuJoCo's own numbers."""
    rows = np.zeros((len(labels), model.nv))
    for row, label in zip(rows, labels, strict=True):
        i = model.tendon(f"appendage_{label}").id
        for w in range(model.tendon_adr[i], model.tendon_adr[i] + model.tendon_num[i]):
            row[model.jnt_dofadr[model.wrap_objid[w]]] = model.wrap_prm[w]
    return rows


def placed(model, count, truth, time):
    """Positions and accelerations of the spacecraft for the truth, on its first modes."""
    moved, accelerated = truth.motion(truth.whole, SMALL, OMEGA, time)
    _, shapes = truth.cantilever(count)
    rows = tendon_rows(model, [f"mode{k + 1}_xy" for k in range(count)])[:, 6:]
    qpos = np.tile(model.qpos0, (time.size, 1))
    qacc = np.zeros((time.size, model.nv))
    mass = truth.beam[1]
    for motion, place, turn, rest in (
        (moved, qpos[:, 1], qpos[:, 6], qpos[:, 7:]),
        (accelerated, qacc[:, 1], qacc[:, 5], qacc[:, 6:]),
    ):
        place[:] = motion[0] - truth.offset * motion[1]
        turn[:] = motion[1]
        amplitudes = shapes.T @ mass @ (motion - truth.rigid @ motion[:2])
        rest[:] = (np.linalg.pinv(rows) @ amplitudes).T
    qpos[:, 6] /= 2.0  # of a quaternion of a small angle
    return {"qpos": qpos, "qacc": qacc, "time": time}, moved, accelerated


@pytest.mark.parametrize("count", [1, 2])
def test_loads_at_positions_of_the_truth(count):
    """Recovery alone: no run, so that no step and no mode left out has changed the motion."""
    spec = boom(fit=bc.spec.FitOptions(springs="modes")).replace(modes={"xy": count, "xz": 0})
    flexible = craft(spec)
    time = np.linspace(0.0, 1.6, 161)
    data, moved, accelerated = placed(flexible.model, count, TRUTH, time)
    frequencies, shapes = TRUTH.cantilever(count)
    amplitudes = shapes.T @ TRUTH.beam[1] @ (moved - TRUTH.rigid @ moved[:2])
    loads = flexible.recover(data, x=STATIONS)
    assert {len(history.units) for history in loads.histories.values()} == {3}
    alone = flexible.recover(data, x=STATIONS, static=False)
    for s, x in enumerate(STATIONS):
        strained = TRUTH.strain_load(x, frequencies, shapes) @ amplitudes
        whole = TRUTH.load(x, moved, accelerated)
        both = [(q.force[:, s, 1], q.moment[:, s, 2]) for q in (alone, loads)]
        force, moment = ([off(part[i], whole[i]) for part in both] for i in range(2))
        print(
            f"{count} kept, x = {x}: shear {force[0]:.2e} -> {force[1]:.2e}, "
            f"moment and stress {moment[0]:.2e} -> {moment[1]:.2e}"
        )
        assert force[1] < WHOLE
        assert moment[1] < WHOLE
        assert off(alone.moment[:, s, 2], strained[1]) < KEPT
        assert off(alone.force[:, s, 1], strained[0]) < KEPT
    # with one mode the stress at mid-span is off by 4.8 %, with two the shear at the root by 3.4 %
    part, s, x = (alone.moment[:, 2, 2], 1, 4.0) if count == 1 else (alone.force[:, 0, 1], 0, 0.0)
    assert off(part, TRUTH.load(x, moved, accelerated)[s]) > LACKS


def test_samples_of_a_run_that_is_exact_in_time(kept):
    """Steps of 0.02 s, 1.2 rad of the second mode: positions at the samples are exact, and so is
    what is recovered from them."""
    flexible = craft(boom(), step=0.02, integrator="Euler", retime=True)
    data = mujoco.MjData(flexible.model)
    held = bc.HeldInput()
    record = flexible.recorder()
    inputs = torque(0.02 * np.arange(60))
    for value in inputs:
        data.ctrl[0] = held(value)
        record(data)
        mujoco.mj_step(flexible.model, data)
    loads = flexible.recover(record, x=[4.0], static=False)
    frequencies, shapes = kept
    basis = np.column_stack([TRUTH.rigid, shapes])
    moved, before, behind = TRUTH.held(basis, inputs, 0.02)
    mass = TRUTH.beam[1]
    relative = moved - TRUTH.rigid @ moved[:2]
    moment = (TRUTH.strain_load(4.0, frequencies, shapes) @ (shapes.T @ mass @ relative))[1]
    print(f"moment at mid-span {off(loads.moment[:, 0, 2], moment):.1e}")
    assert off(loads.moment[:, 0, 2], moment) < TIMED
    # where the torque jumps the load on the root does: the mean of both sides, as the input is
    root = -TRUTH.rigid.T @ mass @ (before + behind) / 2.0
    print(f"root moment {off(loads.root_moment[:, 2], root[1]):.1e}")
    assert off(loads.root_moment[:, 2], root[1]) < TIMED


# -- closed forms ----------------------------------------------------------------------------------
def test_a_rigid_file_bends_as_its_own_weight_bends_a_cantilever():
    """Without any kept mode all is static: uniform and triangular loads, twist and pull."""
    spec = boom().replace(modes={"xy": 2, "xz": 2})
    flexible = craft(spec, rigid=True)
    mass, polar = DENSITY * AREA, DENSITY * 2.0 * SECOND_MOMENT
    bending = YOUNG * SECOND_MOMENT
    shear_modulus = YOUNG / 2.6
    qacc = np.array([3.0, 5.0, -7.0, 0.3, 0.11, -0.13])
    x = np.array([0.0, 1.0, 4.0, 6.5, 8.0])
    found = flexible.recover({"qpos": flexible.model.qpos0[None], "qacc": qacc[None]}, x=x)
    rest = LENGTH - x
    root = qacc[:3] + np.cross(qacc[3:], [0.5, 0.0, 0.0])
    first, second = (LENGTH**2 - x**2) / 2.0, LENGTH**3 / 3.0 - LENGTH**2 * x / 2.0 + x**3 / 6.0
    close = {"rel": 1e-9, "abs": 1e-12}
    for axis, turn in ((1, qacc[5]), (2, -qacc[4])):
        shear = -mass * (root[axis] * rest + turn * first)
        assert found.force[0, :, axis] == pytest.approx(shear, **close)
        bend = -mass * (root[axis] * rest**2 / 2.0 + turn * second)
        sign = 1.0 if axis == 1 else -1.0
        moment = found.moment[0, :, 3 - axis]
        assert moment == pytest.approx(sign * bend, **close)
        # EI w'' = M of a load q(x) = -mu (a + b x)
        uniform = x**2 * (6.0 * LENGTH**2 - 4.0 * LENGTH * x + x**2) / 24.0
        growing = x**2 * (20.0 * LENGTH**3 - 10.0 * LENGTH**2 * x + x**3) / 120.0
        sag = -mass / bending * (root[axis] * uniform + turn * growing)
        assert found.displacement[0, :, axis] == pytest.approx(sag, rel=1e-8, abs=1e-12)
    assert found.force[0, :, 0] == pytest.approx(-mass * root[0] * rest, **close)
    pull = -mass * root[0] * (LENGTH * x - x**2 / 2.0) / (YOUNG * AREA)
    assert found.displacement[0, :, 0] == pytest.approx(pull, rel=1e-8, abs=1e-15)
    assert found.moment[0, :, 0] == pytest.approx(-polar * qacc[3] * rest, **close)
    twist = -polar * qacc[3] * (LENGTH * x - x**2 / 2.0) / (shear_modulus * 2.0 * SECOND_MOMENT)
    assert found.rotation[0, :, 0] == pytest.approx(twist, rel=1e-8, abs=1e-15)
    moments = np.hypot(found.moment[0, :, 1], found.moment[0, :, 2])
    most = found.force[0, :, 0] / AREA + moments * DIAMETER / 2.0 / SECOND_MOMENT
    assert found.stress[0, :, 0] == pytest.approx(most, **close)


def test_a_spin_pulls_at_the_beam():
    """Centrifugal force, and what a spin about a tilted axis adds across the beam."""
    flexible = craft(boom(), rigid=True)
    spin = np.array([0.2, -0.3, 0.5])
    data = {"qpos": flexible.model.qpos0[None], "qvel": np.zeros((1, 6)), "qacc": np.zeros((1, 6))}
    data["qvel"][0, 3:] = spin
    x = np.array([0.0, 3.0, 7.0])
    found = flexible.recover(data, x=x)
    # by many points on the axis
    points, weights = np.polynomial.legendre.leggauss(8)
    for s, start in enumerate(x):
        half = (LENGTH - start) / 2.0
        places = start + half * (1.0 + points)
        centre = np.stack([0.5 + places, 0.0 * places, 0.0 * places], axis=1)
        force = -np.cross(spin, np.cross(spin, centre)) * (DENSITY * AREA * half * weights)[:, None]
        arm = np.stack([places - start, 0.0 * places, 0.0 * places], axis=1)
        moment = np.sum(np.cross(arm, force), axis=0)
        # of the sections' polar inertia J, -w x (J w_x e_x)
        polar = DENSITY * 2.0 * SECOND_MOMENT * (LENGTH - start)
        moment -= np.cross(spin, [polar * spin[0], 0.0, 0.0])
        assert found.force[0, s] == pytest.approx(np.sum(force, axis=0), rel=1e-9, abs=1e-12)
        assert found.moment[0, s] == pytest.approx(moment, rel=1e-9, abs=1e-12)
    away = np.array([np.cross(spin, np.cross(spin, [0.5 + place, 0.0, 0.0])) for place in x])
    assert found.acceleration[0] == pytest.approx(away, rel=1e-9, abs=1e-12)
    stretched = DENSITY * (spin[1] ** 2 + spin[2] ** 2) / YOUNG
    wanted = stretched * (0.5 * (LENGTH * x - x**2 / 2.0) + LENGTH**2 * x / 2.0 - x**3 / 6.0)
    assert found.displacement[0, :, 0] == pytest.approx(wanted, rel=1e-7, abs=1e-15)


# -- roots -----------------------------------------------------------------------------------------
def newton_euler(model, data, top, point, axes):
    """Wrench of the tree below a body on what carries it, by the rates of change of momentum."""
    out = np.zeros(6)
    for body in range(top, model.nbody):
        above = body
        while above not in (0, top):
            above = model.body_parentid[above]
        if above != top:
            continue
        jacobian, rate = np.zeros((2, 3, model.nv)), np.zeros((2, 3, model.nv))
        centre = data.xipos[body].copy()
        mujoco.mj_jac(model, data, jacobian[0], jacobian[1], centre, body)
        mujoco.mj_jacDot(model, data, rate[0], rate[1], centre, body)
        acceleration = jacobian @ data.qacc + rate @ data.qvel
        spin = jacobian[1] @ data.qvel
        frame = data.ximat[body].reshape(3, 3)
        inertia = frame @ np.diag(model.body_inertia[body]) @ frame.T
        force = model.body_mass[body] * (acceleration[0] - model.opt.gravity)
        force = force - data.xfrc_applied[body, :3]
        moment = inertia @ acceleration[1] + np.cross(spin, inertia @ spin)
        moment = moment - data.xfrc_applied[body, 3:] + np.cross(centre - point, force)
        out[:3] -= axes.T @ force
        out[3:] -= axes.T @ moment
    return out


TREE = """<mujoco><option gravity="0.3 -1.2 -2.1" timestep="1e-3"/><worldbody>
<body name="bus" euler="10 20 30"><freejoint/>
<inertial pos="0.1 0 0.05" mass="80" diaginertia="30 40 50"/>
<site name="mount" pos="0.5 0.1 0" euler="5 -7 11"/>
<site name="other" pos="-0.5 0 0" euler="0 0 180"/>
<body name="hand" pos="4.5 0.2 0.1"><joint name="wrist" axis="0 1 0" stiffness="40"/>
<inertial pos="0.1 0.02 0" mass="3" diaginertia="0.1 0.2 0.2"/></body>
</body></worldbody></mujoco>"""


ARM = """name = "arm"
[[segment]]
length = 4.0
section = { shape = "equivalent", bending_stiffness_xy = 400.0, linear_mass = 1.2 }
[[port]]
name = "end"
x = 4.0
[modes]
xy = 1
xz = 1
[damping]
ratio = 0.01
"""
ROD = """name = "rod"
[[segment]]
length = 3.0
section = { shape = "rectangle", width_y = 0.02, width_z = 0.03 }
material = { youngs_modulus = 7e10, density = 2700.0 }
[modes]
xy = 2
xz = 1
torsion = 1
"""


@pytest.fixture
def specs(tmp_path):
    """Files of two appendages."""
    for name, text in (("arm", ARM), ("rod", ROD)):
        (tmp_path / f"{name}.toml").write_text(text)
    return {"mount": tmp_path / "arm.toml", "other": tmp_path / "rod.toml"}


def any_state(flexible, size):
    """Some motion of all that moves, with forces and torques on the bus and the hand."""
    rng = np.random.default_rng(3)
    model = flexible.model
    data = mujoco.MjData(model)
    data.qpos[:3] = rng.standard_normal(3)
    data.qpos[3:7] = rng.standard_normal(4)
    data.qpos[7:] = size * rng.standard_normal(model.nq - 7)
    data.qvel[:] = size * rng.standard_normal(model.nv)
    for name in ("bus", "hand"):
        data.xfrc_applied[model.body(name).id] = size * rng.standard_normal(6)
    return data


@pytest.mark.slow
def test_root_loads_are_those_of_newton_and_euler(specs):
    """In a tree in large motion, under gravity and forces on its bodies."""
    flexible = bc.embed(TREE, specs, carry={"mount:end": ["hand"]}, retime=False)
    data = any_state(flexible, 0.3)
    found = {place: flexible.recover(data, place) for place in specs}
    mujoco.mj_forward(flexible.model, data)
    for place, name in (("mount", "arm"), ("other", "rod")):
        root = flexible.model.body(f"{name}_link1").id
        axes = data.xmat[root].reshape(3, 3)
        wanted = newton_euler(flexible.model, data, root, data.xpos[root], axes)
        assert found[place].root_force[0] == pytest.approx(wanted[:3], rel=1e-9, abs=1e-9)
        assert found[place].root_moment[0] == pytest.approx(wanted[3:], rel=1e-9, abs=1e-9)


def test_loads_at_the_root_are_those_of_its_beam(tmp_path):
    """The modes and the static part together are what MuJoCo's bodies put on the root, to second
    order of the motion, in space, under gravity. (Fillers, which this file has none of, would add
    what they ring, and dampers what strain does not hold.)"""
    (tmp_path / "rod.toml").write_text(ROD.replace("xz = 1\ntorsion = 1", "xz = 2"))
    flexible = bc.embed(TREE, {"mount": tmp_path / "rod.toml"}, retime=False)
    misses = []
    for size in (1e-3, 1e-4):
        found = flexible.recover(any_state(flexible, size), x=[0.0])
        force = off(found.force[0, 0], found.root_force[0])
        moment = off(found.moment[0, 0], found.root_moment[0])
        misses.append(max(force, moment))
    assert misses[1] < 1e-3
    assert misses[1] < 0.2 * misses[0]


@pytest.mark.slow
def test_straight_in_a_tree_the_root_has_all_that_lies_beyond(specs):
    """At rest no mode moves: the static part alone is what MuJoCo's bodies put on the root, of
    bodies and of another appendage on a port as well."""
    specs["other"].write_text(ROD.replace("xz = 1\ntorsion = 1", "xz = 2"))
    arm = bc.read_spec(specs["mount"])
    places = {"mount": arm, "other": arm.replace(name="arm2"), "other:end": specs["other"]}
    hung = bc.embed(TREE, places, retime=False)
    carrying = bc.embed(TREE, specs, carry={"mount:end": ["hand"]}, retime=False)
    for flexible in (hung, carrying):
        data = mujoco.MjData(flexible.model)
        data.xfrc_applied[1] = [3.0, -5.0, 7.0, 2.0, -1.0, 4.0]
        for appendage in flexible.appendages:
            found = flexible.recover(data, appendage.at, x=[0.0])
            # fillers of the arm are 2 % of a motion and yield at once; the rod has none
            most = EXACT if appendage.spec.name == "rod" else WHOLE
            assert off(found.force[0, 0], found.root_force[0]) < most
            assert off(found.moment[0, 0], found.root_moment[0]) < most


TIP = replace(TRUTH, tip_mass=4.0, tip_inertia=0.7)


@pytest.mark.slow
def test_what_a_port_carries_loads_the_beam(tmp_path):
    """A body on the end, against finite elements with the body on the last node."""
    (tmp_path / "boom.toml").write_text(
        f"""name = "appendage"
[[segment]]
length = {LENGTH}
section = {{ shape = "tube", outer_diameter = {DIAMETER}, wall = {WALL} }}
material = {{ youngs_modulus = {YOUNG}, density = {DENSITY} }}
[[port]]
name = "end"
x = {LENGTH}
[modes]
xy = 1
xz = 0
[fit]
springs = "modes"
"""
    )
    inertial = '<inertial pos="0 0 0" mass="4" diaginertia="0.7 0.7 0.7"/>'
    body = f'<body name="load" pos="8.5 0 0">{inertial}</body>'
    text = CRAFT.format(step=STEP, integrator="RK4").replace(
        "</body></worldbody>", f"{body}</body></worldbody>"
    )
    flexible = bc.embed(text, {"mount": tmp_path / "boom.toml"}, carry={"mount:end": ["load"]})
    model = flexible.model
    data = mujoco.MjData(model)
    record = flexible.recorder()
    mujoco.set_mjcb_control(steer)
    try:
        for step in range(1600):
            data.ctrl[0] = torque(data.time)
            if step % 10 == 0:
                record(data)
            mujoco.mj_step(model, data)
    finally:
        mujoco.set_mjcb_control(None)
    loads = flexible.recover(record, x=STATIONS)
    moved, accelerated = TIP.motion(TIP.whole, SMALL, OMEGA, loads.time)
    for s, x in enumerate(STATIONS):
        force, moment = TIP.load(x, moved, accelerated)
        assert off(loads.force[:, s, 1], force) < WHOLE
        assert off(loads.moment[:, s, 2], moment) < WHOLE
        if x > 0.0:
            relative = (moved - TIP.rigid @ moved[:2])[2 * TIP.node(x)]
            assert off(loads.displacement[:, s, 1], relative) < WHOLE


# -- imported modes --------------------------------------------------------------------------------
COUNT = 5  # modes of each plane in the file


def imported(folder, turn, units, kind):
    """The beam as modes of both planes, turned into each other by an angle where they are equal,
    in some units; rows of both bending moments at mid-span and of accelerations of the tip."""
    frequencies, shapes = TRUTH.cantilever(COUNT)
    mass = TRUTH.beam[1]
    lengths, masses = units
    plane = shapes.T @ mass @ TRUTH.rigid
    moment = TRUTH.strain_load(4.0, frequencies, shapes)[1]
    tip = shapes[-2]
    participation = np.zeros((2 * COUNT, 6))
    rows = np.zeros((4, 2 * COUNT))
    root = np.zeros((4, 6))
    root[2, [1, 5]], root[3, [2, 4]] = (1.0, LENGTH), (1.0, -LENGTH)
    c, s = np.cos(turn), np.sin(turn)
    for k in range(COUNT):
        both = np.zeros((2, 6))
        both[0, [1, 5]] = plane[k]
        both[1, [2, 4]] = plane[k] * [1.0, -1.0]
        own = np.zeros((4, 2))
        own[0, 0], own[1, 1] = moment[k], -moment[k]
        own[2, 0], own[3, 1] = tip[k], tip[k]
        mixed = np.array([[c, s], [-s, c]])
        participation[2 * k : 2 * k + 2] = mixed @ both
        rows[:, 2 * k : 2 * k + 2] = own @ mixed.T
    total = DENSITY * AREA * LENGTH
    body = np.diag([total, total, total, DENSITY * 2.0 * SECOND_MOMENT * LENGTH, 0.0, 0.0])
    body[4, 4] = body[5, 5] = total * LENGTH**2 / 3.0
    body[1, 5] = body[5, 1] = total * LENGTH / 2.0
    body[2, 4] = body[4, 2] = -total * LENGTH / 2.0
    size = np.repeat([1.0, lengths], 3)
    text = {
        "frequencies": np.repeat(frequencies, 2).tolist(),
        "participation": (participation / size / np.sqrt(masses)).T.tolist(),
        "mass": (body / np.outer(size, size) / masses).tolist(),
        "length": LENGTH / lengths,
    }
    (folder / "modes.toml").write_text("\n".join(f"{k} = {v}" for k, v in text.items()))
    if kind == "matrices":
        # inner freedoms z that mix the modes, eta = T z: what is mixed has no sign or order
        mix = np.random.default_rng(1).standard_normal((2 * COUNT, 2 * COUNT))
        stiffness = np.zeros((6 + 2 * COUNT, 6 + 2 * COUNT))
        stiffness[6:, 6:] = mix.T @ np.diag(np.repeat(frequencies, 2) ** 2) @ mix
        beside = mix.T @ participation
        whole = np.block([[body, beside.T], [beside, mix.T @ mix]])
        np.savez(folder / "m.npz", mass=whole, stiffness=stiffness, boundary=np.arange(6))
        rows = rows @ mix
    rows = rows * lengths * np.sqrt(masses)
    names, unit = ["My", "Mz", "ay", "az"], ["N m", "N m", "m/s^2", "m/s^2"]
    rows[[0, 1]] = rows[[1, 0]]
    if kind != "toml":
        moving = np.array([False, False, True, True])[:, None]
        np.savez(
            folder / "rows.npz",
            names=names,
            units=unit,
            modes=np.where(moving, 0.0, rows),
            accelerations=np.where(moving, rows, 0.0),
            root=root,
        )
    else:
        parts = [
            f'[[row]]\nname = "{names[r]}"\nunit = "{unit[r]}"\n'
            f"{'modes' if r < 2 else 'accelerations'} = {rows[r].tolist()}\n"
            f"root = {root[r].tolist()}\n"
            for r in range(4)
        ]
        (folder / "rows.toml").write_text("".join(parts))
    (folder / "panel.toml").write_text(
        f"""name = "appendage"
[imported]
file = "{"m.npz" if kind == "matrices" else "modes.toml"}"
recovery = "rows.{"toml" if kind == "toml" else "npz"}"
modes = [1, 2]
units = {{ length = {lengths}, mass = {masses} }}
[fit]
springs = "modes"
"""
    )
    return folder / "panel.toml"


@pytest.mark.parametrize(
    ("turn", "units", "kind"),
    [
        (0.5, (1e-3, 1e3), "toml"),
        pytest.param(0.0, (1.0, 1.0), "matrices", marks=pytest.mark.slow),
    ],
)
def test_rows_over_imported_modes(tmp_path, turn, units, kind):
    """One mode of each plane is kept; those that are not give the static part."""
    spec = imported(tmp_path, turn, units, kind)
    text = CRAFT.format(step=STEP, integrator="RK4")
    flexible = bc.embed(text, {"mount": spec}, retime=False)
    time = np.linspace(0.0, 1.6, 161)
    data, moved, accelerated = placed(flexible.model, 1, TRUTH, time)
    found = flexible.recover(data)
    alone = flexible.recover(data, static=False)
    moment = TRUTH.load(4.0, moved, accelerated)[1]
    frequencies, shapes = TRUTH.cantilever(1)
    amplitudes = shapes.T @ TRUTH.beam[1] @ (moved - TRUTH.rigid @ moved[:2])
    strained = (TRUTH.strain_load(4.0, frequencies, shapes) @ amplitudes)[1]
    assert found.names == ("My", "Mz", "ay", "az")
    assert off(found.rows[:, 1], moment) < WHOLE
    assert off(alone.rows[:, 1], strained) < KEPT
    assert off(alone.rows[:, 1], moment) > LACKS
    assert np.max(np.abs(found.rows[:, 0])) < KEPT * np.max(np.abs(moment))
    assert off(found.rows[:, 2], accelerated[-2]) < 2.0 * WHOLE
    force, moment = TRUTH.load(0.0, moved, accelerated)
    assert off(found.root_force[:, 1], force) < 2.0 * WHOLE
    assert off(found.root_moment[:, 2], moment) < 2.0 * WHOLE
    if kind == "matrices":  # from the file that is written, which names the rows
        flexible.write(tmp_path / "flexible.xml")
        proof = bc.prove(tmp_path / "flexible.xml")
        assert proof.recover(data).rows == pytest.approx(found.rows, rel=EXACT, abs=1e-18)
    extreme = next(e for e in found.extremes if e.quantity == "Mz")
    assert extreme.unit == "N m"
    assert extreme.x is None
    assert extreme.largest == np.max(found.rows[:, 1])
    assert all(history.x.size == 0 for history in found.histories.values())
    assert extreme.largest_from == "mode1_xy"
    # on the root as well, over whatever freedoms the file has its modes: its motion is in a plane
    at_root = next(e for e in found.extremes if e.quantity == "root moment z")
    assert at_root.largest_from == "mode1_xy"


# -- what a result shows ---------------------------------------------------------------------------
def test_extremes_table_record_and_picture(slew):
    flexible, record = slew
    found = flexible.recover(record, "mount", x=STATIONS)
    rows = {(row.quantity, row.x): row for row in found.extremes}
    row = rows["moment z", 4.0]
    values = found.moment[:, 2, 2]
    assert row.smallest == np.min(values)
    assert row.largest == np.max(values)
    assert row.largest_at == found.time[np.argmax(values)]
    assert row.largest_from == "mode1_xy"
    # the axis bends in a plane: the part of each mode in the moment is its own, M_k W_k^2 eta_k
    frequencies, shapes = TRUTH.cantilever(2)
    parts = TRUTH.strain_load(6.0, frequencies, shapes)[1] * found.amplitudes
    top = int(np.argmax(found.moment[:, 3, 2]))
    rest = found.moment[top, 3, 2] - parts[top].sum()
    names = ("mode1_xy", "mode2_xy", "modes left out")
    largest = names[int(np.argmax(np.abs([*parts[top], rest])))]
    assert rows["moment z", 6.0].largest_from == largest
    assert rows["stress", 4.0].largest == np.max(found.stress[:, 2, 0])
    assert rows["acceleration y", 0.0].largest_from == "motion of the root"
    shown = [row["quantity"] for row in found.table.records()]
    assert "root moment z" in shown
    assert "moment y" not in shown  # nothing but rounding
    assert found.as_dict()["extremes"][0]["quantity"] == "root force x"
    assert "moment z" in found._repr_html_()
    ax = found.plot("moment")
    assert ax.get_ylabel() == "moment z, N m"
    assert len(ax.get_lines()) == len(STATIONS)
    assert np.array_equal(ax.get_lines()[2].get_ydata(), values)
    assert found.plot("stress", part="smallest").get_ylabel() == "stress smallest, N/m^2"
    assert repr(found) == "<Recovery at 'mount', 160 instants, 4 stations, 2 modes>"


def test_a_recorder_is_a_run_of_data(slew):
    """One state at a time, and arrays of them, give the same."""
    flexible, _ = slew
    data = mujoco.MjData(flexible.model)
    record = flexible.recorder()
    single, rows = [], []
    for value in (3.0, -2.0, 1.0):
        data.ctrl[0] = value
        data.qfrc_applied[6:] = 1e-3 * value
        record(data)
        single.append(flexible.recover(data, x=4.0))
        rows.append([data.time, *data.qpos, *data.qvel])
        mujoco.mj_step(flexible.model, data)
    assert len(record) == 3
    every = flexible.recover(record, x=4.0)
    table = np.array(rows)
    arrays = {
        "time": table[:, 0],
        "qpos": table[:, 1 : 1 + flexible.model.nq],
        "qvel": table[:, 1 + flexible.model.nq :],
        "ctrl": np.array([[3.0], [-2.0], [1.0]]),
        "qfrc_applied": np.zeros((3, flexible.model.nv)),
    }
    arrays["qfrc_applied"][:, 6:] = 1e-3 * arrays["ctrl"]
    again = flexible.recover(arrays, x=4.0)
    for t, found in enumerate(single):
        assert found.moment[0] == pytest.approx(every.moment[t], rel=EXACT, abs=1e-15)
        assert found.root_moment[0] == pytest.approx(again.root_moment[t], rel=EXACT, abs=1e-15)
        assert found.time[0] == every.time[t] == again.time[t]
    record.clear()
    assert len(record) == 0


def test_a_fibre_turns_with_the_moment():
    """Rectangles have corners, tubes do not; equivalent sections have no outline."""
    segments = [
        bc.Segment(
            length=2.0,
            section=bc.Rectangle(width_y=0.04, width_z=0.02),
            material=bc.Material(youngs_modulus=YOUNG, density=DENSITY),
        ),
        bc.Segment(
            length=2.0,
            section=bc.Custom(
                area=8e-4, second_moment_z=1e-7, second_moment_y=3e-8, torsion_constant=5e-8
            ),
            material=bc.Material(youngs_modulus=YOUNG, density=DENSITY),
        ),
        bc.Segment(length=2.0, section=bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=1.0)),
    ]
    flexible = craft(bc.Spec(segment=segments, modes=bc.Modes(xy=1, xz=1)), rigid=True)
    qacc = np.array([[0.5, 2.0, 3.0, 0.1, 0.2, -0.3]])
    found = flexible.recover({"qpos": flexible.model.qpos0[None], "qacc": qacc}, x=[1.0, 3.0, 5.0])
    force, moment = found.force[0], found.moment[0]
    corners = [
        force[0, 0] / 8e-4
        - moment[0, 2] * y / (0.02 * 0.04**3 / 12.0)
        + moment[0, 1] * z / (0.04 * 0.02**3 / 12.0)
        for y in (0.02, -0.02)
        for z in (0.01, -0.01)
    ]
    assert found.stress[0, 0] == pytest.approx([max(corners), min(corners)], rel=1e-9)
    fibre = force[1, 0] / 8e-4 - moment[1, 2] * 0.03 / 1e-7 + moment[1, 1] * 0.01 / 3e-8
    assert found.stress_at(0.03, 0.01)[0, 1] == pytest.approx(fibre, rel=1e-9)
    assert np.all(np.isnan(found.stress[0, 1:]))
    assert np.isnan(found.stress_at(0.03, 0.01)[0, 2])
    stressed = [row for row in found.extremes if row.quantity == "stress"]
    assert [row.x for row in stressed] == [1.0]


def test_imported_modes_know_no_sections(tmp_path):
    spec = imported(tmp_path, 0.0, (1.0, 1.0), "npz")
    flexible = craft(spec, retime=False)
    data = mujoco.MjData(flexible.model)
    with pytest.raises(bc.InputError, match="imported"):
        flexible.recover(data, x=1.0)
    with pytest.raises(bc.InputError, match="no moment"):
        _ = flexible.recover(data).moment
    rows = bc.spec.RecoveryRows(names=["a"], modes=[[1.0, 2.0]])
    with pytest.raises(bc.InputError, match="2 columns"):
        flexible.recover(data, rows=rows)


# -- beside a servo --------------------------------------------------------------------------------
SERVO_ARM = """<mujoco><option gravity="0 0 0" timestep="0.002" integrator="implicitfast"/>
<worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="60" diaginertia="20 25 30"/><site name="mount" pos="0.5 0 0"/>
<body name="elbow" pos="4.5 0 0"><joint name="elbow" axis="0 0 1"/>
<inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
<body name="hand" pos="2 0 0"><inertial pos="0 0 0" mass="9" diaginertia="0.3 0.3 0.3"/></body>
</body></body></worldbody>
<actuator><position joint="elbow" kp="3000" kv="500"/></actuator></mujoco>"""
SECOND_DIFFERENCE = 1e-7  # of the largest load: digits lost in second differences of 0.2 ms
STRAIN = 0.05  # of the largest moment: what one mode and its fillers miss of a ramp with a jerk


@pytest.mark.slow
@pytest.mark.parametrize(
    ("retime", "integrator"),
    [(True, "implicitfast"), (False, "Euler")],
)
def test_a_slew_by_a_servo_loads_the_root_with_what_moves_the_bus(tmp_path, integrator, retime):
    """The force on the bus is its mass times the second difference of its places, whatever the
    file was retimed for. The damping of the drive is 100 times the inertia of the drum per step:
    the equations of motion in a state have that much more acceleration than its step."""
    text = SERVO_ARM.replace("implicitfast", integrator)
    if integrator == "Euler":  # which takes kv at the start of the step
        text = text.replace(' axis="0 0 1"/>', ' axis="0 0 1" damping="500"/>').replace(
            'kv="500"', ""
        )
    if not retime:
        text = text.replace("0.002", "0.0002")
    spec = ARM + "[scene]\nbandwidth = 15.0\ntolerance = 0.05\n"
    spec = spec.replace("[modes]\nxy = 1\nxz = 1\n", "").replace(
        "x = 4.0\n", 'x = 4.0\ncarries = ["elbow"]\n'
    )
    (tmp_path / "arm.toml").write_text(spec)
    flexible = bc.embed(text, {"mount": tmp_path / "arm.toml"}, retime=retime)
    assert retime == any(a.timed is not None for a in flexible.appendages)
    model, data = flexible.model, mujoco.MjData(flexible.model)
    h = model.opt.timestep
    record, places, turned = flexible.recorder(), [], []
    for _ in range(round(2.2 / h)):
        part = min(data.time / 2.0, 1.0)
        data.ctrl[0] = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
        record(data)
        places.append(data.qpos[:3].copy())
        turned.append(2.0 * np.arctan2(data.qpos[6], data.qpos[3]))
        mujoco.mj_step(model, data)
    loads = flexible.recover(record, x=[0.0, 4.0])
    force = 60.0 * np.diff(places, 2, axis=0) / h**2
    angle = np.array(turned)[1:-1]
    along = np.cos(angle) * force[:, 0] + np.sin(angle) * force[:, 1]
    across = np.cos(angle) * force[:, 1] - np.sin(angle) * force[:, 0]
    spun = np.diff(turned, 2) / h**2
    missed = [
        off(loads.root_force[1:-1, 0], along),
        off(loads.root_force[1:-1, 1], across),
        off(loads.angular_acceleration[1:-1, 0, 2], spun),
    ]
    strain = off(loads.moment[:, 0, 2], loads.root_moment[:, 2])
    print(integrator, retime, [f"{value:.1e}" for value in missed], f"{strain:.1e}")
    assert max(missed) < SECOND_DIFFERENCE
    assert strain < STRAIN
