"""Step limits, predicted from the linearised model and measured by bisection on simulations: the two must agree."""

import mujoco
import numpy as np
import pytest

from beamchain.engine.linearise import compile_model
from beamchain.steps.budget import HOST, budget
from beamchain.steps.measured_limit import GROWTH, SMALL, STEPS
from beamchain.studies.stability import step_rows
from step_models import MODELS

APART = 0.01  # relative; 1e-3 is seen
QUICK = ("boom, 30 %", "bar with shear, in space")


def rows_of(name):
    model = compile_model(MODELS[name][1]())
    return step_rows(model, budget(model, name=name))


def judged(name, rows):
    for row in rows:
        if row.predicted == np.inf or row.measured == np.inf:
            assert row.predicted == row.measured, (name, row)
        else:
            assert abs(row.difference) < APART, (name, row)


def host_stable(model, step, velocity):
    """Whether a host's own Runge-Kutta of order 4 keeps a small perturbation small."""
    data = mujoco.MjData(model)
    size = float(np.linalg.norm(velocity))

    def rates(q, v):
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        return data.qacc.copy()

    def moved(q, v, h):
        out = q.copy()
        mujoco.mj_integratePos(model, out, v, h)
        return out

    q, v = data.qpos.copy(), velocity.copy()
    for _ in range(STEPS):
        a1 = rates(q, v)
        v2 = v + step / 2.0 * a1
        a2 = rates(moved(q, v, step / 2.0), v2)
        v3 = v + step / 2.0 * a2
        a3 = rates(moved(q, v2, step / 2.0), v3)
        v4 = v + step * a3
        a4 = rates(moved(q, v3, step), v4)
        q = moved(q, (v + 2.0 * v2 + 2.0 * v3 + v4) / 6.0, step)
        v = v + step / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        if not np.linalg.norm(v) < GROWTH * size:
            return False
    return True


@pytest.mark.parametrize("name", QUICK)
def test_predicted_is_measured(name):
    judged(name, rows_of(name))


@pytest.mark.slow
def test_predicted_is_measured_for_all_models():
    rows = {name: rows_of(name) for name in MODELS}
    for name, found in rows.items():
        judged(name, found)
    finite = [row for found in rows.values() for row in found if row.predicted < np.inf]
    assert len(finite) >= 60


@pytest.mark.slow
@pytest.mark.parametrize("name", ["boom, 3 modes", "boom, 1 %", "bar in space, 1 %"])
def test_a_host_with_runge_kutta_has_the_limit_predicted_for_it(name):
    model = compile_model(MODELS[name][1]())
    model.opt.gravity[:] = 0.0
    limit = budget(model).largest_step[HOST]
    velocity = np.random.default_rng(0).standard_normal(model.nv)
    velocity[:6] = 0.0  # a free hub
    velocity *= SMALL / limit
    assert host_stable(model, limit * (1.0 - APART), velocity)
    assert not host_stable(model, limit * (1.0 + APART), velocity)
