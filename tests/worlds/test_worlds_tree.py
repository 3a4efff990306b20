"""Many worlds of an arm of two flexible links: each is what MuJoCo steps by itself, its modes are
as right as those of a model that `bc.retime` is given alone, and nothing grows whatever is drawn
and carried.

SAME: MuJoCo's batch computes what a loop computes. NOMINAL: the draw that changes nothing, against
`bc.retime`, rounding of the tendons' numbers. WORSE: times the largest pole error in the band that
`bc.retime` of the drawn model alone has; a draw keeps the factors of the nominal model, which are
not the best for it; and FLOOR, below which that counts for nothing.
"""

import copy
import sys

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain import worlds
from examples import shipped_arm
from stepped import grows, time_error

SAME = 1e-9
NOMINAL = 1e-12
NEAR = 1e-3  # of |z - 1|, up to the band; plain Euler is unstable
# the largest deflection of 20,000 steps over that of the first twenty: the hand swings on; what
# grows is infinite by then
GROWN = 100.0
STEP = 0.01
BAND = 20.0
RANGES = {"frequency": 0.1, "damping": 0.5}
WIDE = {"frequency": 0.5, "damping": 0.9}


@pytest.fixture(scope="module")
def arm():
    return shipped_arm()


def modal(model):
    return [i for i in range(model.ntendon) if model.tendon_stiffness[i] > 0.0]


def plain(world):
    """The model of a world without timing."""
    out = copy.copy(world)
    bc.retime(out, 0.0)
    at = modal(world)
    out.tendon_stiffness[at] = world.tendon_solimp_lim[at, 4]
    out.tendon_damping[at] = world.tendon_solimp_lim[at, 3]
    return out


@pytest.mark.slow
def test_drawn_worlds_of_a_tree_are_those_of_mujoco(arm):
    many = worlds.make(arm, RANGES, count=4, timestep=STEP, seed=3)
    given = 0.1 * np.random.default_rng(1).normal(size=(300, 4, 1))
    for now in given:
        many.step(now)
    qpos = many.qpos
    for i in range(4):
        model = many.model_of(i)
        data = mujoco.MjData(model)
        before = 0.0
        for now in given[:, i]:
            data.ctrl[:] = (now + before) / 2.0
            before = now
            mujoco.mj_step(model, data)
        np.testing.assert_allclose(qpos[i], data.qpos, atol=SAME * np.abs(data.qpos).max())
    assert np.ptp(qpos[:, 7]) > 1e-6  # they differ


@pytest.mark.slow
@pytest.mark.parametrize("step", [0.0005, 0.05])
def test_a_draw_that_changes_nothing_is_the_model_retimed(arm, step):
    many = worlds.make(arm, {"frequency": 0.0}, count=1, timestep=step)
    alone = copy.copy(arm.model)
    bc.retime(alone, step, band=BAND)  # of the scenes
    for name in ("tendon_armature", "tendon_damping", "tendon_stiffness", "tendon_solimp_lim"):
        ours, theirs = getattr(many.model_of(0), name), getattr(alone, name)
        np.testing.assert_allclose(ours, theirs, atol=NOMINAL * np.abs(theirs).max())


@pytest.mark.slow
def test_poles_of_draws_stay_near_exact_motion(arm):
    """Retimed alone a draw is ten times nearer."""
    many = worlds.make(arm, RANGES, count=3, timestep=STEP, seed=5)
    for i in range(3):
        world = many.model_of(i)
        nominal = plain(world)
        alone = copy.copy(nominal)
        bc.retime(alone, STEP)
        ours, theirs = (time_error(model, nominal, BAND)[0] for model in (world, alone))
        sys.stdout.write(f"world {i}: {ours:.1e}, alone {theirs:.1e}\n")
        assert ours < NEAR


@pytest.mark.slow
@pytest.mark.parametrize(("step", "integrator"), [(0.02, "Euler"), (0.2, "implicitfast")])
def test_nothing_grows_in_any_draw_with_any_payload(arm, step, integrator):
    model = copy.copy(arm.model)
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    many = worlds.make(model, WIDE, count=3, timestep=step, seed=7)
    for i, mass in enumerate((1e-3, 20.0, 2000.0)):
        world = many.model_of(i)
        hand = world.body("hand").id
        world.body_mass[hand] = mass
        world.body_inertia[hand] = 0.04 * mass
        mujoco.mj_setConst(world, mujoco.MjData(world))
        largest = grows(world)
        sys.stdout.write(f"{mass:g} kg: {largest:.3g}\n")
        assert largest < GROWN


@pytest.mark.slow
def test_a_table_of_payloads_is_timed_variant_by_variant(arm):
    masses = np.tile(arm.model.body_mass, (3, 1))
    masses[:, arm.model.body("hand").id] = (1.0, 20.0, 400.0)
    many = worlds.make(arm, {"body_mass": masses}, timestep=STEP)
    for i in range(3):
        alone = copy.copy(arm.model)
        alone.body_mass[:] = masses[i]
        mujoco.mj_setConst(alone, mujoco.MjData(alone))
        bc.retime(alone, STEP, band=BAND)
        ours = many.model_of(i).tendon_armature
        np.testing.assert_allclose(ours, alone.tendon_armature, rtol=1e-9, atol=1e-12)
