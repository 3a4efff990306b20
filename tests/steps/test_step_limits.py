"""Step limits as stated, and as measured by bisection on simulations: the two must agree."""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from measured_limit import limits
from step_models import MODELS, written

APART = 0.01  # relative; 1e-3 is seen
HOST = "host RK4"  # a host that drives MuJoCo with its own explicit Runge-Kutta of order 4
STEPS = 1000  # per trial
GROWTH = 300.0  # of the velocity's norm: above what a stable step near its limit swings up to
SMALL = 1e-7  # of the fastest mode's angle: what is measured is the linear model


def rows_of(name, folder):
    path = written(name, folder)
    return limits(bc.stability(path), mujoco.MjModel.from_xml_path(str(path)))


def judged(name, rows):
    for integrator, stated, measured in rows:
        if np.inf in (stated, measured):
            assert stated == measured, (name, integrator)
        else:
            assert measured == pytest.approx(stated, rel=APART), (name, integrator)


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

    q = data.qpos.copy()
    v = velocity.copy()
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


@pytest.mark.slow
def test_stated_is_measured_for_all_models(tmp_path):
    rows = {}
    for i, name in enumerate(MODELS):
        (tmp_path / str(i)).mkdir()
        rows[name] = rows_of(name, tmp_path / str(i))
    for name, found in rows.items():
        judged(name, found)
    finite = [row for found in rows.values() for row in found if row[1] < np.inf]
    assert len(finite) >= 60


@pytest.mark.slow
@pytest.mark.parametrize("name", ["boom, 1 %", "bar in space, 1 %"])
def test_a_host_with_runge_kutta_has_the_limit_predicted_for_it(name, tmp_path):
    path = written(name, tmp_path)
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.gravity[:] = 0.0
    limit = bc.stability(path).budgets[0].largest_step[HOST]
    velocity = np.random.default_rng(0).standard_normal(model.nv)
    velocity[:6] = 0.0  # a free hub
    velocity *= SMALL / limit
    assert host_stable(model, limit * (1.0 - APART), velocity)
    assert not host_stable(model, limit * (1.0 + APART), velocity)
