"""Variants of a compiled craft: their mass matrices, and their timing, which is that of a model of
their own."""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.engine.model_fields import with_fields
from beamchain.steps.retime import retime_by
from beamchain.steps.step_map import motion_for
from formulas import (
    DrawTiming,
    Quantity,
    drawn_fields,
    drawn_masses,
    is_positive,
    modal_tendons,
    participation_of,
    with_participation,
)

# of the arm with its root held; two modes of unit mass, turned into each other
HELD = np.array([[0.2 + 0.1 + 0.3 + 0.3 * 1.69, 0.3 + 0.3 * 0.39], [0.3 + 0.3 * 0.39, 0.327]])
TURN = np.array([[0.8, 0.6], [-0.6, 0.8]])
ROWS = TURN @ np.linalg.cholesky(HELD).T
MODEL = f"""<mujoco><worldbody><body name="rail"><joint name="rail" type="slide" axis="0 1 0"/>
<inertial pos="0 0 0" mass="60" diaginertia="9 9 9"/><body><joint name="drive" axis="0 0 1"/>
<inertial pos="0.2 0 0" mass="40" diaginertia="9 9 9"/>
<body pos="1 0 0"><joint name="h1" axis="0 0 1"/><inertial pos="0.5 0 0" mass="0.4"
diaginertia=".2 .2 .2"/><body pos="1 0 0"><joint name="h2" axis="0 0 1"/>
<inertial pos="0.3 0 0" mass="0.3" diaginertia=".3 .3 .3"/></body></body></body></body></worldbody>
<tendon>
<fixed name="arm_mode1_xy" stiffness="16" damping="0.4"><joint joint="h1" coef="{ROWS[0, 0]}"/>
<joint joint="h2" coef="{ROWS[0, 1]}"/></fixed>
<fixed name="arm_mode2_xy" stiffness="100" damping="3"><joint joint="h1" coef="{ROWS[1, 0]}"/>
<joint joint="h2" coef="{ROWS[1, 1]}"/></fixed></tendon></mujoco>"""


def model():
    return mujoco.MjModel.from_xml_string(MODEL)


def quantity(name, index):
    return Quantity(name, "", 1.0, bc.spec.Uncertainty(relative=0.1), index, name)


NAMES = (
    ("arm_mode1_xy.participation", 0),
    ("arm_mode2_xy.frequency", 1),
    ("arm_mode2_xy.participation", 1),
    ("rail.mass", 1),
)


def varied(*values):
    """Draws of the participations of two modes, a frequency and a mass."""
    return drawn_fields(model(), [quantity(*name) for name in NAMES], np.array(values))


def full_mass(model, qpos):
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    out = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, out)
    return out


@pytest.mark.parametrize("p", [0.7, 1.1])
def test_mass_of_a_variant_has_what_its_modes_take(p):
    """`M + (1 - p^2) b^T b / p^2`, at rest and elsewhere, also where that takes mass away."""
    moved = "0.3 -0.4 0.5 0.7"
    text = MODEL.replace("</mujoco>", f'<keyframe><key qpos="{moved}"/></keyframe></mujoco>')
    nominal = mujoco.MjModel.from_xml_string(text)
    uncertain = [quantity(*name) for name in NAMES]
    fields = drawn_fields(nominal, uncertain, np.array([[p, 12.0, 0.9, 6.5], [1, 9, 1, 60.0]]))
    modal = modal_tendons(nominal)
    factors = participation_of(fields, modal)
    assert factors == pytest.approx(np.array([[p, 0.9], [1.0, 1.0]]))
    masses = drawn_masses(fields)
    row, other = np.zeros(nominal.nv), np.zeros(nominal.nv)
    row[-2:], other[-2:] = ROWS
    for draw, mass in ((0, 6.5), (1, 60.0)):
        bare = model()
        bare.body_mass[1] = mass
        mujoco.mj_setConst(bare, mujoco.MjData(bare))
        taken, too = factors[draw]
        for place, qpos in enumerate((bare.qpos0, np.array(moved.split(), dtype=float))):
            wanted = full_mass(bare, qpos) + (1.0 / taken**2 - 1.0) * np.outer(row, row)
            wanted += (1.0 / too**2 - 1.0) * np.outer(other, other)
            found = with_participation(masses[place, draw], modal.rows, factors[draw])
            np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)
            assert is_positive(found)
    assert fields["tendon_armature"][0, 0] == pytest.approx(1.0 - p**2)
    for share in (0.1, 0.17) if p > 1.0 else ():  # in both hinges, and in their motion together
        light = model()
        light.body_inertia[-2:] *= share
        light.body_mass[-2:] *= share
        one = drawn_fields(light, [quantity("arm_mode1_xy.participation", 0)], np.array([[p]]))
        (factor,) = participation_of(one, modal)
        assert not is_positive(with_participation(drawn_masses(one)[0, 0], modal.rows, factor))


TENDONS = ("tendon_stiffness", "tendon_damping", "tendon_armature", "tendon_solimp_lim")
DRAWS = ((0.8, 12.0, 0.9, 6.5), (1.05, 8.0, 1.0, 40.0))


@pytest.mark.parametrize(("by", "step"), [("implicitfast", 0.05), ("Euler", 0.02), ("Euler", 0.4)])
@pytest.mark.parametrize("form", [0, 2, 4])
def test_variants_are_timed_as_models_of_their_own_are(by, step, form):
    """Whatever the nominal model has; at 0.4 s their own masses limit how far."""
    nominal = model()
    if form:
        retime_by(form, nominal, step, by)
    fields = varied(*DRAWS)
    before = {name: fields[name].copy() for name in TENDONS}
    timing = DrawTiming.of(nominal, step, by)
    assert timing.mark == (step, by, 2)
    timing.write(fields, drawn_masses(fields))
    for draw in range(len(DRAWS)):
        alone = with_fields(model(), varied(*DRAWS).of(draw))
        retime_by(2, alone, step, by)
        for name in TENDONS:
            np.testing.assert_allclose(
                fields[name][draw], getattr(alone, name), rtol=1e-8, atol=1e-12, err_msg=name
            )
    changed = [np.abs(fields[name] - before[name]) for name in TENDONS[1:3]]
    assert np.all(np.max(changed, axis=0) > 1e-6)


def test_variants_of_a_tree_are_timed_as_it_is():
    """The nominal draw is the nominal model, and every draw is stable with every payload."""
    nominal = model()
    retime_by(5, nominal, 0.4, "Euler")
    timing = DrawTiming.of(nominal, 0.4, "Euler")
    assert timing.mark == (0.4, "Euler", 5)
    fields = varied((1.0, 10.0, 1.0, 60.0), *DRAWS, (1.12, 14.0, 0.9, 6.5))
    timing.write(fields)
    for name in TENDONS:
        np.testing.assert_allclose(fields[name][0], getattr(nominal, name), rtol=1e-9, atol=1e-12)
    for draw in range(4):
        timed = with_fields(model(), fields.of(draw))
        timed.opt.timestep = 0.4
        for load in (1e-6, 1.0, 1e6):
            timed.body_mass[1:3] = load
            timed.body_inertia[1:3] = load
            mujoco.mj_setConst(timed, mujoco.MjData(timed))
            assert motion_for(timed, 0.4, "Euler", timed.qpos0).growth < 1.0 + 1e-9
