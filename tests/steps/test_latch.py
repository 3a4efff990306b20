"""Three rigid panels that unfold from a tumbling bus and latch one after the other: momentum and
energy by hand, the impact by its formula; what a hinge was before, and what is refused.

ACROSS: momentum before and after a latch, of its scale: rounding. DEPLOYED: over the whole
deployment, and GROWS: of the energy in a step, what RK4 leaves at 0.5 ms. HERE: a hinge at its
angle [rad]. STABLE: of |z| - 1, rounding of differences of `mj_step`. IMPACT: the loss
against its formula, relative.
"""

import copy
import pickle
import re

import mujoco
import numpy as np
import pytest

import beamchain as bc
from mechanics import after_a_step, kinetic_energy, mass_matrix, momentum, total_energy
from stepped import stepped, time_error

LATCHED = {"stiffness": 400.0, "damping": 2.0}
ACROSS = 1e-12
DEPLOYED = 1e-7
GROWS = 1e-9
HERE = 1e-12
STABLE = 1e-6
IMPACT = 1e-9
FIELDS = (
    "jnt_stiffness",
    "jnt_limited",
    "jnt_range",
    "jnt_solref",
    "jnt_solimp",
    "qpos_spring",
    "dof_damping",
    "dof_armature",
    "dof_frictionloss",
    "dof_solref",
    "dof_solimp",
)


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


def started(**settings):
    model = mujoco.MjModel.from_xml_string(wing(**settings))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.slow
@pytest.mark.parametrize("impact", [False, True])
def test_panels_latch_one_by_one_and_nothing_is_made_from_nothing(impact):
    model, data = started(step=0.0005)
    before = momentum(model, data)
    size = np.abs(before).max()
    waiting = [f"hinge{k}" for k in (1, 2, 3)]
    energy = total_energy(model, data)
    for _ in range(20000):
        for name in list(waiting):
            plain, here = copy.copy(model), copy.copy(data)
            done = bc.latch(model, data, name, angle=0.0, impact=impact, **LATCHED)
            if done is None:
                continue
            waiting.remove(name)
            assert abs(data.joint(name).qpos[0]) < HERE
            # the shortened step is MuJoCo's own; what follows it is the latch
            plain, here = after_a_step(plain, here, data.time - here.time)
            assert momentum(model, data) == pytest.approx(momentum(plain, here), abs=ACROSS * size)
            dropped = total_energy(plain, here) - total_energy(model, data)
            assert float(done) == pytest.approx(dropped, abs=1e-12 * energy)
            assert float(done) >= done.impact >= 0.0
            energy = total_energy(model, data)
        if not waiting:
            break
        mujoco.mj_step(model, data)
        now = total_energy(model, data)
        assert now <= energy + GROWS * abs(energy)
        energy = now
    assert not waiting
    assert momentum(model, data) == pytest.approx(before, abs=DEPLOYED * size)


@pytest.mark.parametrize("armature", [None, 0.3])
@pytest.mark.parametrize("name", ["hinge1", "hinge2", "hinge3"])
def test_the_impact_takes_what_the_formula_says_and_no_momentum(name, armature):
    model, data = started()
    target = float(data.joint(name).qpos[0])
    data.qvel[:] = np.random.default_rng(5).standard_normal(model.nv)
    at, energy = momentum(model, data), kinetic_energy(model, data)
    mass = mass_matrix(model, data.qpos)
    dof = model.joint(name).dofadr[0]
    wanted = data.qvel[dof] ** 2 / (2.0 * np.linalg.inv(mass)[dof, dof])
    drive = 0.5 * 0.8 * (target - np.radians(-60.0 if name[-1] in "13" else 60.0)) ** 2
    done = bc.latch(model, data, name, angle=target, impact=True, armature=armature, **LATCHED)
    assert done is not None
    assert done.impact == pytest.approx(wanted, rel=IMPACT)
    assert float(done) - done.impact == pytest.approx(drive, rel=IMPACT)
    assert energy - kinetic_energy(model, data) == pytest.approx(wanted, rel=IMPACT)
    assert momentum(model, data) == pytest.approx(at, abs=ACROSS * np.abs(at).max())
    assert data.joint(name).qvel[0] == 0.0
    assert done.warnings == ()


def test_an_armature_that_is_added_to_a_moving_hinge_is_in_the_books():
    model, data = started()
    data.qvel[:] = np.random.default_rng(5).standard_normal(model.nv)
    at, energy = momentum(model, data), total_energy(model, data)
    angle = float(data.joint("hinge1").qpos[0])
    done = bc.latch(model, data, "hinge1", angle=angle, armature=0.7, **LATCHED)
    assert float(done) == pytest.approx(energy - total_energy(model, data), rel=1e-10)
    assert momentum(model, data) == pytest.approx(at, abs=ACROSS * np.abs(at).max())
    energy = total_energy(model, data)
    brought = bc.unlatch(model, data, "hinge1")
    assert brought == pytest.approx(total_energy(model, data) - energy, rel=1e-10)


def test_a_step_that_does_not_reach_the_angle_changes_nothing():
    model, data = started()
    state = data.qpos.copy(), data.qvel.copy(), data.time
    assert bc.latch(model, data, "hinge1", angle=0.0, **LATCHED) is None
    assert np.array_equal(data.qpos, state[0])
    assert np.array_equal(data.qvel, state[1])
    assert data.time == state[2]
    assert model.opt.timestep == 0.001


def test_unlatching_gives_every_number_back_in_copies_and_files_too(tmp_path):
    text = wing().replace('range="-200 200"', 'range="-200 200" frictionloss="0.01" armature="0.1"')
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    angle = float(data.joint("hinge2").qpos[0])
    bc.latch(model, data, "hinge2", angle=angle, armature=0.5, **LATCHED)
    bc.latch(model, data, "hinge3", angle=float(data.joint("hinge3").qpos[0]), **LATCHED)
    assert model.jnt_stiffness[2] == 400.0
    assert model.dof_frictionloss[7] == 0.0
    mujoco.mj_saveModel(model, str(tmp_path / "latched.mjb"))
    read = mujoco.MjModel.from_binary_path(str(tmp_path / "latched.mjb"))
    fresh = mujoco.MjModel.from_xml_string(text)
    for latched in (model, copy.copy(model), read):
        bc.unlatch(latched, data, "hinge2")
        assert latched.jnt_stiffness[3] == 400.0
        bc.unlatch(latched, data, "hinge3")
        for name in FIELDS:
            assert np.array_equal(getattr(latched, name), getattr(fresh, name)), name


def test_what_latch_returns_is_a_number_that_travels():
    model, data = started()
    done = bc.latch(model, data, "hinge2", angle=-3.0, **LATCHED)
    for same in (pickle.loads(pickle.dumps(done)), copy.deepcopy(done)):
        assert same == done
        assert vars(same) == vars(done)
    assert (done.joint, done.angle, done.stiffness, done.time) == ("hinge2", -3.0, 400.0, 0.0)
    assert done + 1.0 == pytest.approx(1.0 + 0.4 * (-3.0 - np.pi / 3.0) ** 2, rel=1e-12)


# -- a latched hinge and the step ------------------------------------------------------------------
def boom_on_hinge(**held):
    """A boom on a hinge that stands at its angle and turns, latched there."""
    text = """<mujoco><option timestep="0.001" gravity="0 0 0" integrator="RK4"/><worldbody>
<body name="bus"><freejoint/><inertial pos="0 0 0" mass="60" diaginertia="9 14 11"/>
<body name="root" pos="0.6 0 0"><joint name="hinge" axis="0 1 0" stiffness="0.8" damping="0.02"/>
<inertial pos="0 0 0" mass="0.4" diaginertia="0.01 0.02 0.01"/><site name="mount"/></body></body>
</worldbody></mujoco>"""
    section = bc.Equivalent(bending_stiffness_xy=4e4, bending_stiffness_xz=150.0, linear_mass=2.5)
    part = bc.Segment(length=3.0, section=section)
    boom = bc.Spec(segment=(part,), damping=bc.Damping(ratio=0.004), modes=bc.Modes(xy=1, xz=2))
    model = bc.embed(text, {"mount": boom}, retime=False).model
    data = mujoco.MjData(model)
    data.qvel[model.joint("hinge").dofadr[0]] = 0.3
    mujoco.mj_forward(model, data)
    return model, bc.latch(model, data, "hinge", **held)


def growth(model):
    return np.max(np.abs(np.linalg.eigvals(stepped(model)[0]))) - 1.0


@pytest.mark.slow
def test_retime_takes_back_what_it_gives_a_latched_hinge_and_says_what_that_brings():
    model, _ = boom_on_hinge(stiffness=400.0, damping=3.0)
    latched = copy.copy(model)
    dof = model.joint("hinge").dofadr[0]
    for step in (0.2, 0.01, 0.02):
        done = bc.retime(model, step, "Euler")
        model.opt.timestep, model.opt.integrator = step, mujoco.mjtIntegrator.mjINT_EULER
        assert growth(model) < STABLE
        more = model.dof_armature[dof] - latched.dof_armature[dof]
        assert 0.0 < more <= step**2 * 400.0 / 4.0  # h^2 k/4 suffices on any neighbour
        (said,) = (note for note in done.slowed if "latched hinge 'hinge'" in note)
        brought = float(re.search(r"brings ([\d.e-]+) w\^2 J", said)[1])
        assert brought == pytest.approx(more / 2.0, rel=1e-2)
    error, frequency = time_error(model, latched, 1.001 * done.time_error.frequency)
    assert done.time_error.error == pytest.approx(error, rel=1e-3)
    assert done.time_error.frequency == pytest.approx(frequency, rel=1e-3)

    bc.retime(model, 0.001, "RK4")  # the step that it was latched at
    assert model.dof_armature[dof] == latched.dof_armature[dof]
    bc.retime(model, 0.1, "Euler")
    free = copy.copy(model)
    bc.unlatch(free, mujoco.MjData(free), "hinge")
    bc.retime(model, 0.0)
    bc.unlatch(latched, mujoco.MjData(latched), "hinge")
    for name in FIELDS:
        assert np.array_equal(getattr(free, name), getattr(latched, name)), name
    bc.unlatch(model, mujoco.MjData(model), "hinge")
    for name in FIELDS:
        assert np.array_equal(getattr(model, name), getattr(latched, name)), name


@pytest.mark.parametrize("stiffness", [1e6, 4e6])
@pytest.mark.slow
def test_an_armature_with_which_the_step_is_unstable_is_warned_of(stiffness):
    model, done = boom_on_hinge(stiffness=stiffness, armature=0.0)
    assert growth(model) > 1e-3
    (said,) = done.warnings
    assert said.code == "unstable-step"
    needed = float(re.search(r"give armature=([\d.e+-]+),", said)[1])
    model, done = boom_on_hinge(stiffness=stiffness, armature=needed)
    assert growth(model) < STABLE
    assert done.warnings == ()
    model, done = boom_on_hinge(stiffness=stiffness)
    assert growth(model) < STABLE
    assert done.warnings == ()


def test_a_step_that_bears_the_latched_hinge_is_not_warned_of():
    model, done = boom_on_hinge(stiffness=400.0, armature=0.0)
    assert growth(model) < STABLE
    assert done.warnings == ()


# -- the angle, if none is given -------------------------------------------------------------------
def panel(joint, integrator="RK4", step=0.01):
    return mujoco.MjModel.from_xml_string(f"""<mujoco>
<option timestep="{step}" gravity="0 0 0" integrator="{integrator}"/><worldbody>
<body><freejoint/><inertial pos="0 0 0" mass="50" diaginertia="9 9 9"/>
<body><joint name="hinge" axis="0 0 1" {joint}/>
<inertial pos="1 0 0" mass="2" diaginertia=".1 .2 .2"/></body></body></worldbody></mujoco>""")


def until_latched(model, data, steps=2000, **given):
    for _ in range(steps):
        done = bc.latch(model, data, "hinge", stiffness=500.0, **given)
        if done is not None:
            return done
        mujoco.mj_step(model, data)
    raise AssertionError("never latched")


@pytest.mark.parametrize("integrator", ["RK4", "Euler", "implicitfast"])
@pytest.mark.parametrize("step", [0.01, 0.037])
def test_a_stop_does_not_act_before_the_hinge_latches_at_it(integrator, step):
    drive = 'stiffness="2" springref="100"'
    model = panel(f'range="-9 60" {drive}', integrator, step)
    free = panel(drive, integrator, step)
    data, twin = mujoco.MjData(model), mujoco.MjData(free)
    done = until_latched(model, data)
    same = until_latched(free, twin, angle=float(np.radians(60.0)))
    assert done.angle == float(model.jnt_range[1, 1])
    assert abs(data.qpos[7] - done.angle) < HERE
    assert done.time == pytest.approx(same.time, rel=1e-13)
    assert data.qvel == pytest.approx(twin.qvel, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("step", [0.01, 0.0100001, 0.0103])
def test_a_step_that_ends_just_before_the_angle_goes_on_to_it(step):
    model = panel('range="-9 60" stiffness="2" springref="100"', step=step)
    data = mujoco.MjData(model)
    for _ in range(100):
        mujoco.mj_step(model, data)
    angle = float(data.qpos[7])
    mujoco.mj_resetData(model, data)
    for _ in range(99):
        assert bc.latch(model, data, "hinge", angle=angle * (1.0 + 1e-12)) is None
        mujoco.mj_step(model, data)
    done = bc.latch(model, data, "hinge", angle=angle * (1.0 + 1e-12))
    assert done.time == pytest.approx(100 * step, rel=1e-9)


def test_the_default_angle_is_the_stop_that_the_drive_spring_pulls_to():
    for springref, angle in ((100, 60.0), (-30, -9.0)):
        model = panel(f'range="-9 60" stiffness="2" springref="{springref}"')
        assert until_latched(model, mujoco.MjData(model)).angle == pytest.approx(np.radians(angle))
    model = panel('range="-9 60"')
    for rate, angle in ((0.3, 60.0), (-0.3, -9.0)):
        data = mujoco.MjData(model)
        data.qvel[6] = rate
        done = until_latched(copy.copy(model), data)
        assert done.angle == pytest.approx(np.radians(angle))
    model = panel("")
    data = mujoco.MjData(model)
    data.qpos[7] = 0.7
    assert bc.latch(model, data, "hinge").angle == 0.7


def test_the_default_stiffness_is_what_the_step_resolves():
    model = panel('stiffness="2" springref="100"')
    data = mujoco.MjData(model)
    done = bc.latch(model, data, "hinge")
    # the panel about its own centre, with the reduced mass of both bodies 1 m away; and the bus
    turning = 0.2 + 2.0 * 50.0 / 52.0
    inertia = 1.0 / (1.0 / turning + 1.0 / 9.0)
    assert done.stiffness == pytest.approx(inertia * (0.2 / 0.01) ** 2, rel=1e-9)
    assert model.jnt_stiffness[1] == done.stiffness


def test_a_hinge_at_rest_at_its_angle_latches_without_a_step():
    model = panel('range="0 90" stiffness="2" springref="-30"')
    for angle in (0.0, 1e-8, -1e-8):
        latched = copy.copy(model)
        data = mujoco.MjData(latched)
        data.qpos[7] = angle
        mujoco.mj_forward(latched, data)
        assert bc.latch(latched, data, "hinge", stiffness=500.0) is not None
        assert data.time < 0.002


def test_an_impact_beside_a_flexible_body_is_warned_of():
    section = bc.Equivalent(bending_stiffness_xy=200.0, linear_mass=1.0)
    spec = bc.Spec(
        name="panel",
        segment=(bc.Segment(length=3.0, section=section),),
        fit=bc.spec.FitOptions(springs="modes"),
    )
    craft = """<mujoco><option gravity="0 0 0" integrator="RK4" timestep="0.001"/><worldbody>
<body name="bus"><freejoint/><inertial pos="0 0 0" mass="60" diaginertia="9 10 11"/>
<body name="yoke" pos="0.5 0 0"><joint name="hinge" axis="0 0 1" stiffness="2"/>
<inertial pos="0 0 0" mass="0.5" diaginertia="0.01 0.01 0.01"/><site name="mount"/></body>
</body></worldbody></mujoco>"""
    model = bc.embed(craft, {"mount": spec}).model
    data = mujoco.MjData(model)
    done = bc.latch(model, data, "hinge", angle=0.0, impact=True, **LATCHED)
    assert [warning.code for warning in done.warnings] == ["impact-on-flexible"]


# -- refused ---------------------------------------------------------------------------------------

EMPTY = mujoco.MjData(mujoco.MjModel.from_xml_string("<mujoco/>"))


@pytest.mark.parametrize(
    ("joint", "state", "sentence"),
    [
        ('range="-9 60" stiffness="2" springref="99"', 1.1, "0.0528 rad beyond"),
        ('range="-9 60"', 0.1, "angle is missing"),
        ('range="-9 60" stiffness="2" springref="99" margin="0.1"', 0.1, "has margin=0.1"),
        ('stiffness="2" solimplimit="0.8 0.9 0.01"', 0.1, "solreffriction or solimplimit"),
        ('stiffness="2" solreffriction="0.1 1"', 0.1, "solreffriction or solimplimit"),
    ],
)
def test_a_hinge_that_cannot_latch_is_refused_in_a_sentence(joint, state, sentence):
    model = panel(joint)
    data = mujoco.MjData(model)
    data.qpos[7] = state
    before = {name: getattr(model, name).copy() for name in FIELDS}
    with pytest.raises(bc.InputError, match=sentence):
        bc.latch(model, data, "hinge")
    assert all(np.array_equal(getattr(model, name), before[name]) for name in FIELDS)


@pytest.mark.skipif(
    not hasattr(mujoco.MjModel, "jnt_stiffnesspoly"), reason="this MuJoCo has linear springs only"
)
def test_a_spring_that_is_not_linear_is_refused():
    model = panel('stiffness="2"')
    model.jnt_stiffnesspoly[1, 0] = 0.1
    with pytest.raises(bc.InputError, match="jnt_stiffnesspoly"):
        bc.latch(model, mujoco.MjData(model), "hinge")
