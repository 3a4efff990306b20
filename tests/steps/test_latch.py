"""Three rigid panels that unfold from a tumbling bus and latch one after the other: momentum and
energy by hand, the impact by its formula."""

import mujoco
import numpy as np
import pytest

import beamchain as bc

LATCHED = {"stiffness": 400.0, "damping": 2.0}


def wing(integrator="RK4", step=0.001):
    """A bus with three folded panels on hinges with drive springs."""
    body = ""
    for k in (3, 2, 1):
        side = "0.4 0.3 0.02"
        start = "0.5 0 0" if k == 1 else "0.8 0 0"
        body = f"""<body name="panel{k}" pos="{start}">
<joint name="hinge{k}" axis="0 1 0" stiffness="0.8" springref="{-60 if k % 2 else 60}"
 damping="0.05" range="-200 200"/>
<inertial pos="0.4 0 0" mass="3" diaginertia="0.09 0.16 0.25"/>
<geom type="box" size="{side}" pos="0.4 0 0" mass="0" contype="0" conaffinity="0"/>{body}</body>"""
    return f"""<mujoco><option timestep="{step}" gravity="0 0 0" integrator="{integrator}"/>
<worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="60" diaginertia="9 10 11"/>{body}</body></worldbody>
<keyframe><key name="folded" qpos="0 0 0 1 0 0 0 1.5707963 -3.0 3.0"
 qvel="0 0 0 0.02 0.05 -0.03 0 0 0"/></keyframe></mujoco>"""


def momentum(model, data):
    """Linear and angular momentum about the origin of the world."""
    mujoco.mj_forward(model, data)
    total = np.zeros(6)
    for body in range(1, model.nbody):
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
        axes = data.ximat[body].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
        linear = model.body_mass[body] * velocity[3:]
        total[:3] += linear
        total[3:] += inertia @ velocity[:3] + np.cross(data.xipos[body], linear)
    return total


def kinetic(model, data):
    """Kinetic energy by MuJoCo's mass matrix."""
    column = np.zeros(model.nv)
    mujoco.mj_forward(model, data)
    mujoco.mj_mulM(model, data, column, data.qvel)
    return 0.5 * float(data.qvel @ column)


def potential(model, data):
    stretch = data.qpos[7:] - model.qpos_spring[7:]
    return 0.5 * float(np.ravel(model.jnt_stiffness)[1:] @ stretch**2)


def started(**settings):
    model = mujoco.MjModel.from_xml_string(wing(**settings))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.parametrize("impact", [False, True])
def test_panels_latch_one_by_one_and_nothing_is_made_from_nothing(impact):
    model, data = started(step=0.0005)
    before = momentum(model, data)
    size = np.abs(before).max()
    waiting = {f"hinge{k}": 0.0 for k in (1, 2, 3)}
    energy = kinetic(model, data) + potential(model, data)
    reports = []
    for _ in range(20000):
        for name in list(waiting):
            at = momentum(model, data)
            done = bc.latch(model, data, name, waiting[name], impact=impact, **LATCHED)
            if done is not None:
                del waiting[name]
                reports.append(done)
                assert abs(data.joint(name).qpos[0]) < 1e-12
                assert momentum(model, data) == pytest.approx(at, abs=2e-8 * size)
                energy = kinetic(model, data) + potential(model, data)
        if not waiting:
            break
        mujoco.mj_step(model, data)
        now = kinetic(model, data) + potential(model, data)
        assert now <= energy + 1e-9 * abs(energy)
        energy = now
    assert not waiting
    assert len(reports) == 3
    assert momentum(model, data) == pytest.approx(before, abs=1e-7 * size)
    assert all(one.energy >= one.impact >= 0.0 for one in reports)


@pytest.mark.parametrize("name", ["hinge1", "hinge2", "hinge3"])
def test_the_impact_takes_what_the_formula_says_and_no_momentum(name):
    model, data = started()
    target = float(data.joint(name).qpos[0])
    data.qvel[:] = np.random.default_rng(5).standard_normal(model.nv)
    at, energy = momentum(model, data), kinetic(model, data)
    mass = np.zeros((model.nv, model.nv))
    for i, unit in enumerate(np.eye(model.nv)):
        column = np.zeros(model.nv)
        mujoco.mj_mulM(model, data, column, unit)
        mass[:, i] = column
    dof = model.joint(name).dofadr[0]
    wanted = data.qvel[dof] ** 2 / (2.0 * np.linalg.inv(mass)[dof, dof])
    drive = 0.5 * 0.8 * (target - np.radians(-60.0 if name[-1] in "13" else 60.0)) ** 2
    done = bc.latch(model, data, name, target, impact=True, **LATCHED)
    assert done is not None
    assert done.impact == pytest.approx(wanted, rel=1e-9)
    assert done.energy - done.impact == pytest.approx(drive, rel=1e-9)
    assert energy - kinetic(model, data) == pytest.approx(wanted, rel=1e-9)
    assert momentum(model, data) == pytest.approx(at, abs=1e-12 * np.abs(at).max())
    assert data.joint(name).qvel[0] == 0.0
    assert done.warnings == ()


def test_a_step_that_does_not_reach_the_angle_changes_nothing():
    model, data = started()
    state = data.qpos.copy(), data.qvel.copy(), data.time
    assert bc.latch(model, data, "hinge1", 0.0, **LATCHED) is None
    assert np.array_equal(data.qpos, state[0])
    assert np.array_equal(data.qvel, state[1])
    assert data.time == state[2]
    assert model.opt.timestep == 0.001


def test_unlatching_gives_every_number_back():
    model, data = started()
    fresh = mujoco.MjModel.from_xml_string(wing())
    done = bc.latch(model, data, "hinge2", float(data.joint("hinge2").qpos[0]), **LATCHED)
    assert float(np.ravel(model.jnt_stiffness[2])[0]) == 400.0
    bc.unlatch(model, done)
    for name in ("jnt_stiffness", "jnt_limited", "qpos_spring", "dof_damping", "dof_armature"):
        assert np.array_equal(getattr(model, name), getattr(fresh, name)), name


def test_an_impact_beside_a_flexible_body_is_warned_of():
    section = bc.Equivalent(bending_stiffness_xy=200.0, linear_mass=1.0)
    spec = bc.Spec(
        name="panel",
        segment=(bc.Segment(length=3.0, section=section),),
        fit=bc.FitOptions(springs="modes"),
    )
    craft = """<mujoco><option gravity="0 0 0" integrator="RK4" timestep="0.001"/><worldbody>
<body name="bus"><freejoint/><inertial pos="0 0 0" mass="60" diaginertia="9 10 11"/>
<body name="yoke" pos="0.5 0 0"><joint name="hinge" axis="0 0 1" stiffness="2"/>
<inertial pos="0 0 0" mass="0.5" diaginertia="0.01 0.01 0.01"/><site name="mount"/></body>
</body></worldbody></mujoco>"""
    model = bc.embed(craft, {"mount": spec}).model
    data = mujoco.MjData(model)
    done = bc.latch(model, data, "hinge", 0.0, impact=True, **LATCHED)
    assert [warning.code for warning in done.warnings] == ["impact-on-flexible"]


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"joint": "nobody"}, "hinge"),
        ({"angle": float("nan")}, "angle"),
        ({"stiffness": 0.0}, "stiffness"),
        ({"damping": -1.0}, "damping"),
        ({"impact": 2}, "impact"),
    ],
)
def test_bad_input_is_refused_in_a_sentence(changed, sentence):
    model, data = started()
    given = {"joint": "hinge1", "angle": 0.0, **LATCHED, **changed}
    with pytest.raises(bc.InputError, match=sentence):
        bc.latch(model, data, **given)
