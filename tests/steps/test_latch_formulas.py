"""Latches of one hinge, marks of tendons and poses on the way, by hand."""

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.errors import InputError
from beamchain.steps.latch import _stable_armature
from beamchain.steps.modal import TimingMark
from formulas import (
    PlaceOfHinge,
    appendages_alone,
    are_of_unit_mass,
    has_just_passed,
    is_stop,
    made_for,
    modal_tendons,
    retime_by,
    rounded_up,
    stiffness_before,
    stop_ahead,
    tuned_poses,
    write_values,
)

H = 0.02
HINGE = PlaceOfHinge("hinge", 0, 0, 0)


def panel(more="", inertia=0.3):
    """A hinge whose panel has the inertia 0.3 about it."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><compiler angle="radian"/>
        <option gravity="0 0 0" timestep="{H}" integrator="RK4"/><worldbody><body>
        <joint name="hinge" axis="0 0 1" {more}/><inertial pos="0 0 0" mass="1"
        diaginertia=".2 .2 {inertia}"/></body></worldbody></mujoco>"""
    )
    return model, mujoco.MjData(model)


def test_what_a_hinge_gives_and_takes_that_is_set_free_while_it_is_bent():
    model, data = panel('stiffness="2" springref="0.7" armature="0.4"')
    data.qpos[0], data.qvel[0] = 0.25, 0.6
    done = bc.latch(model, data, "hinge", angle=0.25, stiffness=50.0, armature=1.1)
    added = (1.1 - 0.4) * 0.6**2 / 2.0
    assert float(done) == pytest.approx(2.0 * 0.45**2 / 2.0 - added)
    data.qpos[0], data.qvel[0] = 0.28, -0.9
    brought = bc.unlatch(model, data, "hinge")
    spring = 2.0 * (0.7 - 0.28) ** 2 / 2.0 - 50.0 * 0.03**2 / 2.0
    assert brought == pytest.approx(spring + (0.4 - 1.1) * 0.9**2 / 2.0)


@pytest.mark.parametrize("impact", [True, False])
def test_a_hinge_that_coasts_latches_at_the_instant_of_its_angle(impact):
    model, data = panel('range="-0.5 0.1"')
    data.qpos[0], data.qvel[0] = 0.086, 0.8
    mujoco.mj_forward(model, data)
    done = bc.latch(model, data, "hinge", damping=0.2, impact=impact)
    assert done.time == pytest.approx(0.014 / 0.8, rel=1e-9)
    assert data.qpos[0] == pytest.approx(0.1, abs=1e-13)
    assert data.qvel[0] == pytest.approx(0.0 if impact else 0.8, abs=1e-12)
    assert done.impact == pytest.approx(0.3 * 0.8**2 / 2.0 * impact)
    assert float(done) == pytest.approx(done.impact, abs=1e-12)
    # swings by 0.2 rad in a step
    assert done.stiffness == pytest.approx((0.2 / H) ** 2 * 0.3)
    assert model.jnt_stiffness[0] == done.stiffness
    assert not model.jnt_limited[0]
    bc.unlatch(model, data, "hinge")
    assert model.jnt_limited[0]
    assert model.dof_damping[0] == 0.0


@pytest.mark.parametrize(("ahead", "reached"), [(1.12, True), (1.13, False)])
def test_a_step_goes_on_by_an_eighth_at_most(ahead, reached):
    model, data = panel()
    data.qvel[0] = 0.8
    done = bc.latch(model, data, "hinge", angle=ahead * 0.8 * H, stiffness=5.0)
    assert (done is not None) == reached
    assert data.time == pytest.approx(ahead * H if reached else 0.0)


@pytest.mark.parametrize(
    ("start", "rate", "passed"),
    [
        (0.0179, 0.8, True),
        (0.0181, 0.8, False),
        (-0.0179, -0.8, True),
        (0.0179, -0.8, False),
        (9e-7, 0.8, False),
        (2e-6, 0.8, True),
    ],
)
def test_a_hinge_has_just_passed_within_nine_eighths_of_a_step(start, rate, passed):
    model, data = panel()
    data.qvel[0] = rate
    assert has_just_passed(model, data, HINGE, start) == passed


def test_a_latch_at_a_stop():
    model, data = panel('range="-0.5 0.7"')
    low, high = -0.5, 0.7
    for target, at in ((high, True), (high - 2e-6, False), (low, True), (low + 2e-6, False)):
        assert is_stop(model, data, HINGE, 0.0, target) == at
    for target, beyond in ((high, 2e-6), (low, -2e-6)):
        assert is_stop(model, data, HINGE, -beyond, target)
        assert is_stop(model, data, HINGE, beyond / 4.0, target)
        with pytest.raises(InputError, match="beyond its stop"):
            is_stop(model, data, HINGE, beyond, target)
        data.qvel[0] = np.sign(beyond)
        assert is_stop(model, data, HINGE, beyond, target)
        data.qvel[0] = 0.0
        with pytest.raises(InputError, match="beyond the stops"):
            is_stop(model, data, HINGE, 0.0, target + beyond)
    model, data = panel('range="-0.5 0.7" margin="0.1"')
    for target, acts in ((0.59, False), (0.61, True), (-0.39, False), (-0.41, True)):
        if acts:
            with pytest.raises(InputError, match="margin=0.1"):
                is_stop(model, data, HINGE, 0.0, target)
        else:
            assert not is_stop(model, data, HINGE, 0.0, target)
    model, data = panel()
    assert not is_stop(model, data, HINGE, 1.0, 9.0)


def test_the_stop_ahead_is_where_the_drive_or_the_rate_leads():
    for reference, stop in ((0.2, 0.7), (0.05, -0.5)):
        model, data = panel(f'range="-0.5 0.7" stiffness="0.02" springref="{reference}"')
        assert stop_ahead(model, data, HINGE) == pytest.approx(stop)
    model, data = panel('range="-0.5 0.7" springref="0.2"')
    for rate, stop in ((0.05, 0.7), (-0.05, -0.5)):
        data.qvel[0] = rate
        assert stop_ahead(model, data, HINGE) == pytest.approx(stop)
    data.qvel[0] = 0.0
    with pytest.raises(InputError, match="angle is missing"):
        stop_ahead(model, data, HINGE)
    model, data = panel()
    data.qpos[0] = 0.33
    assert stop_ahead(model, data, HINGE) == 0.33


def test_an_armature_is_rounded_up_to_three_digits():
    assert [rounded_up(v) for v in (0.012341, 5.0, 98765.0)] == pytest.approx([0.0124, 5.0, 98800])


# -- marks -----------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("values", "known"),
    [
        ((0.05, 0, 2, 0.4, 50.0), (0.05, "Euler", 2)),
        ((0.05, 1, 4, 0.4, 50.0), (0.05, "RK4", 4)),
        ((0.05, 0, 5.24, 0.4, 50.0), (0.05, "Euler", 5)),
        ((0.05, 0, 4.76, 0.4, 50.0), (0.05, "Euler", 5)),
        ((0.05, 0, 5.26, 0.4, 50.0), None),
        ((0.05, 0, 4.01, 0.4, 50.0), None),
        ((0.05, 0, 3, 0.4, 50.0), None),
        ((0.05, 99, 2, 0.4, 50.0), None),
        ((0.0, 0, 2, 0.4, 50.0), None),
        ((0.05, 0, np.nan, 0.4, 50.0), None),
    ],
)
def test_what_five_numbers_say_of_a_tendon(values, known):
    assert made_for(np.array(values, dtype=float)) == known


@pytest.mark.parametrize("form", [2, 5])
def test_a_timed_tendon_remembers_its_form_and_what_it_was(form):
    """Form 5 makes it stiffer too, here by a tenth."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><worldbody><body><joint name="h1"/><geom size="1"/></body></worldbody>
        <tendon><fixed name="other"><joint joint="h1" coef="1"/></fixed>
        <fixed name="arm_mode1" stiffness="35" damping="0.4"><joint joint="h1" coef="1"/></fixed>
        </tendon></mujoco>"""
    )
    stiffness = np.array([38.5]) if form == 5 else None
    plan = SimpleNamespace(armature=np.array([0.03]), damping=np.array([0.7]), stiffness=stiffness)
    write_values(model, modal_tendons(model), plan, TimingMark(0.05, "RK4", form))
    assert model.tendon_armature.tolist() == [0.0, 0.03]
    assert model.tendon_damping.tolist() == [0.0, 0.7]
    assert model.tendon_stiffness.tolist() == [0.0, 38.5 if form == 5 else 35.0]
    mark = [0.05, 1.0, 5.1 if form == 5 else 2.0, 0.4, 35.0]
    assert model.tendon_solimp_lim[1] == pytest.approx(mark)
    before = modal_tendons(model)
    assert (before.damping.tolist(), before.stiffness.tolist()) == ([0.4], [35.0])
    assert before.made_for == (TimingMark(0.05, "RK4", form),)


def test_stiffness_before_form_5_changed_it():
    marks = np.array([[0, 0, 5.1, 0, 40.0], [0, 0, 4.8, 0, 70.0], [0, 0, 2.0, 0, 30.0]])
    changed = np.array([True, True, False])
    # the second was changed since, by the factor 1.5
    found = stiffness_before(np.array([44.0, 84.0, 33.0]), marks, changed)
    assert found == pytest.approx([40.0, 105.0, 33.0])
    assert found[0] == 40.0
    near = stiffness_before(np.array([44.0 * (1.0 + 1e-11)]), marks[:1], changed[:1])
    assert near[0] != 40.0


# -- poses -----------------------------------------------------------------------------------------
def arm(keys="", limits=""):
    """An appendage's hinge, and two hinges of the craft on it."""
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><compiler angle="radian"/><worldbody><body>
        <joint name="link" axis="0 0 1"/><inertial pos="1 0 0" mass="1" diaginertia="1 1 1"/>
        <body><joint name="wrist" axis="0 0 1"/><inertial pos="1 0 0" mass="1" diaginertia="1 1 1"/>
        <body><joint name="hand" axis="0 1 0" {limits}/><joint name="slide" type="slide"/>
        <inertial pos="1 0 0" mass="1" diaginertia="1 1 1"/></body></body></body></worldbody>
        <keyframe>{keys}</keyframe></mujoco>"""
    )


TREE = SimpleNamespace(rows=np.array([[1.0, 0.0, 0.0, 0.0]]))


def test_without_keyframes_each_hinge_of_the_craft_is_turned_within_its_range():
    found = np.array(tuned_poses(arm(limits='range="-1 1.6"'), TREE))
    quarter = np.pi / 4.0
    wanted = np.zeros((6, 4))
    wanted[1:4, 1] = quarter * np.arange(1, 4)
    wanted[4:, 2] = quarter * np.arange(1, 3)
    assert found == pytest.approx(wanted)


def test_between_keyframes_no_joint_turns_by_more_than_thirty_degrees():
    keys = '<key qpos="0 1.6 0 0"/><key qpos="3 1.1 0 0"/><key qpos="0 9.1 0.4 0"/>'
    found = np.array(tuned_poses(arm(keys), TREE))
    # 1.6 rad: four parts; half a radian: one; eight: no more than twelve
    wanted = [np.zeros(4)]
    wanted += [np.array([0.0, 0.4 * k, 0.0, 0.0]) for k in range(1, 5)]
    wanted += [np.array([3.0, 1.1, 0.0, 0.0])]
    start, end = np.array([3.0, 1.1, 0.0, 0.0]), np.array([0.0, 9.1, 0.4, 0.0])
    wanted += [start + (end - start) * k / 12.0 for k in range(1, 13)]
    assert found == pytest.approx(np.array(wanted))


# -- appendages alone ------------------------------------------------------------------------------
LINKS = """<inertial pos=".1 .2 0" mass="2" diaginertia=".3 .2 .1"/>
    <body pos=".5 0 .1"><joint name="{0}1" axis="0 0 1"/>
    <inertial pos=".4 .1 0" mass="1.5" diaginertia=".2 .1 .3" euler="20 0 10"/>
    <body pos=".8 0 0"><joint name="{0}2" axis="0 1 .5"/>
    <inertial pos=".3 0 .1" mass="1.1" diaginertia=".1 .15 .2"/>{1}</body></body>"""


def test_an_appendage_alone_is_one_without_its_craft_and_its_load():
    def tendon(name, **coefs):
        joints = "".join(f'<joint joint="{j}" coef="{c}"/>' for j, c in coefs.items())
        return f'<fixed name="{name}" stiffness="9" springlength="0 0">{joints}</fixed>'

    load = """<body pos="1 0 0"><joint name="wrist" axis="0 0 1"/>
        <inertial pos="1 0 0" mass="7" diaginertia="1 1 1"/></body>"""
    craft = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><body><freejoint/>
        <inertial pos="0 0 0" mass="50" diaginertia="9 9 9"/>
        <body pos="1 2 3" euler="40 20 70">{LINKS.format("a", load)}</body>
        <body pos="-1 0 2" euler="0 0 30">{LINKS.format("b", "")}</body></body></worldbody>
        <tendon>{tendon("a_mode1_xy", a1=1.1, a2=0.4)}{tendon("b_mode1_xy", b1=0.7, b2=-0.3)}
        {tendon("a_mode2_xz", a1=-0.2, a2=0.9)}</tendon></mujoco>"""
    )
    alone = mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody><body><freejoint/>{LINKS.format('a', '')}</body></worldbody></mujoco>"
    )
    data, mass = mujoco.MjData(alone), np.zeros((8, 8))
    mujoco.mj_forward(alone, data)
    for i in range(8):
        mujoco.mj_mulM(alone, data, mass[i], np.eye(8)[i])
    both, single = appendages_alone(craft, modal_tendons(craft))
    for found, rows, at in (
        (both, np.array([[1.1, 0.4], [-0.2, 0.9]]), [0, 2]),
        (single, np.array([[0.7, -0.3]]), [1]),
    ):
        assert found.tendons.tolist() == at
        free = np.linalg.inv(mass)[6:, 6:]
        held = np.linalg.inv(mass[6:, 6:])
        assert found.free == pytest.approx(np.linalg.inv(rows @ free @ rows.T))
        assert found.held == pytest.approx(np.linalg.inv(rows @ held @ rows.T))


def test_what_accelerates_is_not_known_before_the_first_step():
    """A torque of 60 N m on 0.3 kg m^2 turns by 200 h^2 within a step, from data in which nothing
    has been worked out."""
    model, data = panel()
    data.qfrc_applied[0] = 60.0
    assert data.qacc[0] == data.qvel[0] == 0.0
    done = bc.latch(model, data, "hinge", angle=0.05, stiffness=5.0)
    assert done is not None
    assert done.time == pytest.approx(np.sqrt(2.0 * 0.05 / 200.0), rel=1e-9)
    assert data.qpos[0] == pytest.approx(0.05, abs=1e-13)


@pytest.mark.parametrize(
    ("integrator", "added"),
    [("Euler", 0.02**2 * 50.0 / 4.0), ("RK4", 0.02**2 * 50.0 / 8.0 + 0.02 * 3.0 / 2.0)],
)
def test_a_latched_hinge_is_stable_with_what_its_spring_needs_beside_its_own(integrator, added):
    model, data = panel('stiffness="2" damping="0.1" armature="0.4"')
    bc.latch(model, data, "hinge", angle=0.0, stiffness=50.0, damping=3.0)
    assert _stable_armature(model, 0, integrator, 0.02) == pytest.approx(0.4 + added)


@pytest.mark.parametrize(
    ("stiffness", "drive"), [(250.0, 0.03**2 * 250.0 / 12.0), (5000.0, 0.03**2 * 5000.0 / 4.0)]
)
def test_timing_gives_sprung_and_latched_joints_of_a_craft_their_armature(stiffness, drive):
    """At another step than they latched at: h^2 k / 4 of a latched hinge beside an appendage, none
    of one that stands farther; h^2 k / 12 of a drive, and h^2 k / 4 where 5000 N m/rad on
    0.1 kg m^2 would grow."""
    hinge = """<body pos="{at} 0 0"><joint name="{name}" axis="0 1 0" armature=".2"/>
        <inertial pos="-.5 0 0" mass="1" diaginertia=".1 .1 .1"/>{inside}</body>"""
    far = hinge.format(at=-1, name="far", inside="")
    middle = f'<body><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>{far}</body>'
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option gravity="0 0 0" timestep="{H}"/><worldbody><body><freejoint/>
        <inertial pos="0 0 0" mass="40" diaginertia="9 9 9"/>
        <body pos="1 0 0"><joint name="h1" axis="0 0 1"/>
        <inertial pos="1 0 0" mass="1" diaginertia=".1 .1 .1"/></body>
        <body pos="0 1 0"><joint name="drive" axis="0 0 1" stiffness="{stiffness}"/>
        <inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/></body>
        {hinge.format(at=-1, name="near", inside="")}{middle}</body></worldbody>
        <tendon><fixed name="arm_mode1" stiffness="35">
        <joint joint="h1" coef="{1.1**0.5}"/></fixed></tendon></mujoco>"""
    )
    for name in ("near", "far"):
        bc.latch(model, mujoco.MjData(model), name, angle=0.0, stiffness=60.0)
    done = retime_by(2, model, 0.03, joints=True)
    added = {name: model.dof_armature[model.joint(name).dofadr[0]] for name in ("drive", "h1")}
    assert added == pytest.approx({"drive": drive, "h1": 0.0})
    assert model.dof_armature[-2:] == pytest.approx([0.2 + 0.03**2 * 60.0 / 4.0, 0.2])
    (words,) = done.slowed  # 0.0135 here, of which 0.006 were there at the other step
    assert "'near' has 0.0075 kg m^2 more" in words
    assert "brings 0.00375 w^2 J" in words


@pytest.mark.parametrize(
    ("share", "unit"), [(0.9e-4, True), (-0.9e-4, True), (1.1e-4, False), (-1.1e-4, False)]
)
def test_a_mode_of_an_appendage_alone_has_one_unit_of_mass(share, unit):
    """1.25 kg m^2 of a link about its hinge, over the square of its lever."""
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><worldbody><body><freejoint/>
        <inertial pos="0 0 0" mass="40" diaginertia="9 9 9"/><body pos="1 0 0">
        <joint name="h1" axis="0 0 1"/><inertial pos=".5 0 0" mass="1" diaginertia="1 1 1"/></body>
        </body></worldbody><tendon><fixed name="arm_mode1" stiffness="35">
        <joint joint="h1" coef="{(1.25 / (1.0 + share)) ** 0.5}"/></fixed></tendon></mujoco>"""
    )
    assert are_of_unit_mass(model, modal_tendons(model)) is unit
