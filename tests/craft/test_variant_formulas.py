"""Variants of a compiled craft: their mass matrices, and their timing, which is that of a model of
their own."""

import copy

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain.steps.retime import retime_by
from formulas import Quantity, VariantMaker, apply_draw

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


def varied(maker, p):
    """A variant of the nominal model with participations of two modes, and a mass."""
    out = copy.copy(maker.model)
    changes = (
        ("arm_mode1_xy.participation", 0, p),
        ("arm_mode2_xy.frequency", 1, 12.0),
        ("arm_mode2_xy.participation", 1, 0.9),
        ("rail.mass", 1, 6.5),
    )
    uncertain = [quantity(name, index) for name, index, _ in changes]
    apply_draw(out, uncertain, np.array([value for *_, value in changes]))
    return out


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
    maker = VariantMaker(model(), refitted=False)
    variant = varied(maker, p)
    bare = model()
    bare.body_mass[1] = 6.5
    mujoco.mj_setConst(bare, mujoco.MjData(bare))
    row, other = np.zeros(bare.nv), np.zeros(bare.nv)
    row[-2:], other[-2:] = ROWS
    moved = np.array(bare.qpos0)
    moved[-4:] = [0.3, -0.4, 0.5, 0.7]
    for qpos in (None, moved):
        at = np.array(bare.qpos0) if qpos is None else qpos
        wanted = full_mass(bare, at) + (1.0 / p**2 - 1.0) * np.outer(row, row)
        wanted += (1.0 / 0.81 - 1.0) * np.outer(other, other)
        np.testing.assert_allclose(maker.mass(variant, qpos), wanted, rtol=1e-9, atol=1e-9)
    assert variant.tendon_armature[0] == pytest.approx(1.0 - p**2)
    for share in (0.1, 0.17) if p > 1.0 else ():  # in both hinges, and in their motion together
        light = copy.copy(maker.model)
        light.body_inertia[-2:] *= share
        light.body_mass[-2:] *= share
        apply_draw(light, [quantity("arm_mode1_xy.participation", 0)], np.array([p]))
        with pytest.raises(bc.BeamchainError, match="takes more mass than the appendage has"):
            maker.mass(light)


@pytest.mark.parametrize(
    ("by", "step", "form"),
    [("implicitfast", 0.05, 2), ("Euler", 0.02, 2), ("Euler", 0.05, 4)],
)
def test_a_variant_is_timed_as_a_model_of_its_own_is(by, step, form):
    timed_alike(by, step, form)


def test_a_variant_is_timed_as_a_tree_of_its_own_is():
    timed_alike("implicitfast", 0.05, 5)


def timed_alike(by, step, form):
    nominal = model()
    retime_by(form, nominal, step, by)
    maker = VariantMaker(nominal, refitted=False)
    assert (maker.mark.timestep, maker.mark.form) == (step, form)
    untimed = model()
    assert maker.model.tendon_damping == pytest.approx(untimed.tendon_damping)
    assert maker.model.tendon_armature == pytest.approx(untimed.tendon_armature)
    variant = varied(maker, 0.8)
    alone = varied(maker, 0.8)
    maker.time(variant, maker.mass(variant))
    retime_by(form, alone, step, by)
    for name in ("tendon_stiffness", "tendon_damping", "tendon_armature", "tendon_solimp_lim"):
        found, wanted = getattr(variant, name), getattr(alone, name)
        np.testing.assert_allclose(found, wanted, rtol=1e-8, atol=1e-12, err_msg=name)
    before = varied(maker, 0.8)
    changed = [
        np.abs(getattr(variant, name) - getattr(before, name))
        for name in ("tendon_damping", "tendon_armature", "tendon_stiffness")
    ]
    assert np.all(np.max(changed, axis=0) > 1e-6)
