"""Random trees of flexible bodies: what is promised against finite elements of the whole craft, and
the stability of their timing at any step, pose and payload.

`BEAMCHAIN_TREES=60 BEAMCHAIN_SEED=2000 pytest tests/craft/test_random_trees.py -m ''` tries sixty.
"""

import copy
import os
import sys

import mujoco
import numpy as np
import pytest
from scipy.linalg import eigh

import beamchain as bc
from craft_truth import Pair, compiled
from seeds import seed
from trees import Whole, random_scene, random_tree, written

SEED = seed()
TREES = int(os.environ.get("BEAMCHAIN_TREES", "2"))  # the number by hand
STEPS = int(os.environ.get("BEAMCHAIN_STEPS", "0"))  # 20000 by hand
AGREE = 0.05  # stated and found error of the craft, relative; measured: 1e-3
FACTORS = (0.3, 1.0, 10.0, 100.0)  # of the largest stable step of the file as it is
POSES = 3  # of the joints, at random
# The step map is found by differences, and rigid motions are a double eigenvalue 1 of it, which
# an error of 1e-11 parts by its root.
GROWTH = 1e-6
RIGID = 1e-3  # from 1: eigenvalues of rigid motions, and of what is as slow


@pytest.mark.slow
@pytest.mark.parametrize("number", range(SEED, SEED + TREES))
def test_the_promise_of_random_trees_is_what_finite_elements_find(tmp_path, number):
    tree = random_tree(number)
    band, tolerance = random_scene(number, tree)
    flexible = bc.embed(*written(tmp_path, tree, band, tolerance), retime=False)
    model = flexible.model
    leaves = sum(not part.is_beam for part in tree.parts)
    for name, stated in flexible.promise.poses.items():
        truth = Whole(tree, tree.keys.get(name), band)
        qpos = model.qpos0 if name == "rest" else model.key(name).qpos
        found, place = Pair(truth, compiled(model, qpos), list(range(6)), band).search()
        sys.stdout.write(
            f"tree {number}, {len(tree.parts)} bodies, {leaves} of them leaves, {name}: stated "
            f"{stated:.3e}, found {found:.3e} at {place:.4g} of {band:.4g} rad/s, tolerance "
            f"{tolerance:.2e}, {flexible.met}\n"
        )
        assert stated == pytest.approx(found, rel=AGREE, abs=1e-6)
        assert found <= 1.02 * tolerance or not flexible.met


def hung_alone(model, tree):
    """The same without the springs and dampers of the craft's own hinges: no appendage's timing
    answers for those."""
    alone = copy.copy(model)
    for name in tree.hinges:
        joint = alone.joint(f"hinge_{name}")
        joint.stiffness[:] = 0.0
        joint.damping[:] = 0.0
    return alone


def largest_step(model):
    """Of semi-implicit steps of the file as it is, undamped, at rest [s]."""
    side = compiled(model, model.qpos0)
    return 2.0 / np.sqrt(eigh(side.stiffness, side.mass, eigvals_only=True)[-1])


def at_random(model, tree, rng):
    """The model's data at a pose of its hinges, with a payload one or a hundred times its hand."""
    loaded = copy.copy(model)
    if any(body.name == "hand" for body in tree.bodies):
        factor = rng.choice([1.0, 100.0])
        hand = loaded.body("hand")
        hand.mass[:] *= factor
        hand.inertia[:] *= factor
        mujoco.mj_setConst(loaded, mujoco.MjData(loaded))
    data = mujoco.MjData(loaded)
    for name in tree.hinges:
        data.joint(f"hinge_{name}").qpos[:] = rng.uniform(-np.pi, np.pi)
    mujoco.mj_forward(loaded, data)
    return loaded, data


def step_multipliers(model, qpos):
    """Eigenvalues of a step of the model from rest at a pose, by differences of `mj_step`."""
    nv = model.nv
    data = mujoco.MjData(model)

    def stepped(change):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = qpos
        mujoco.mj_integratePos(model, data.qpos, change[:nv], 1.0)
        data.qvel[:] = change[nv:]
        mujoco.mj_step(model, data)
        moved = np.zeros(nv)
        mujoco.mj_differentiatePos(model, moved, 1.0, qpos, data.qpos)
        return np.concatenate([moved, data.qvel])

    # rates in units of a step: both halves are of one size
    unit = np.concatenate([np.ones(nv), np.full(nv, 1.0 / model.opt.timestep)])
    size = 1e-5 * unit
    columns = [
        (stepped(size[i] * row) - stepped(-size[i] * row)) / 2e-5 / unit
        for i, row in enumerate(np.eye(2 * nv))
    ]
    return np.linalg.eigvals(np.array(columns).T)


def largest_multiplier(model, qpos):
    """Largest modulus but for rigid motions, and the largest of all."""
    multipliers = step_multipliers(model, qpos)
    elastic = np.abs(multipliers[np.abs(multipliers - 1.0) > RIGID])
    return elastic.max(initial=0.0), np.abs(multipliers).max()


def growth(model, data, steps, rng):
    """The tendons' largest rate at the end of a run over that at its beginning, after a small
    random velocity."""
    data.qvel[:] = 1e-5 * rng.standard_normal(model.nv)
    early = late = 0.0
    for k in range(steps):
        mujoco.mj_step(model, data)
        if k < steps // 10:
            early = max(early, np.abs(data.ten_velocity).max())
        elif k >= steps - steps // 10:
            late = max(late, np.abs(data.ten_velocity).max())
    return late / early


@pytest.mark.slow
@pytest.mark.parametrize("number", range(SEED, SEED + TREES))
def test_the_timing_of_random_trees_is_stable_at_any_step_pose_and_payload(tmp_path, number):
    tree = random_tree(number)
    band, tolerance = random_scene(number, tree)
    flexible = bc.embed(*written(tmp_path, tree, band, tolerance), retime=False, max_modes=1)
    plain = hung_alone(flexible.model, tree)
    limit = largest_step(plain)
    rng = np.random.default_rng([number, 2])
    integrators = ["Euler", *(["implicitfast", "RK4"] if number % 3 == 0 else [])]
    for integrator in integrators:
        for factor in FACTORS:
            model = copy.copy(plain)
            model.opt.timestep = factor * limit
            model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
            bc.retime(model, model.opt.timestep, integrator)
            elastic = total = grown = 0.0
            for _ in range(POSES):
                loaded, data = at_random(model, tree, rng)
                found = largest_multiplier(loaded, data.qpos.copy())
                elastic, total = np.maximum([elastic, total], found)
                if STEPS:
                    grown = max(grown, growth(loaded, data, STEPS, rng))
            sys.stdout.write(
                f"tree {number}, {integrator}, {factor:g} x {limit:.3g} s: |z| - 1 elastic "
                f"{elastic - 1.0:.1e}, all {total - 1.0:.1e}, grown {grown:.3g}\n"
            )
            assert elastic <= 1.0 + GROWTH
            assert total <= 1.0 + RIGID
            assert grown <= 1.5
