"""The largest stable step, measured: bisection on MuJoCo's own steps of a small perturbation."""

import copy

import mujoco
import numpy as np

STEPS = 1000  # per trial
GROWTH = 300.0  # of the velocity's norm: above what a stable step near its limit swings up to
SMALL = 1e-7  # of the fastest mode's angle: what is measured is the linear model
FARTHEST = 1e3  # times the first guess: what is stable there has no limit
CHECK = 10  # steps between two looks
ACCURACY = 5e-4  # relative, of the limit
LONGEST = 10.0  # slowest periods: where the search starts where no limit is stated
MOVED = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
BOUNDED = ("jnt_limited", "tendon_limited", "actuator_forcelimited", "jnt_actfrclimited")
# after any of them MuJoCo starts anew from rest
BLOWN_UP = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)


def stable(model, timestep, velocity):
    """Whether a small perturbation stays small over `STEPS` steps; changes `model.opt`."""
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    data.qvel[:] = velocity
    start = float(np.linalg.norm(velocity))
    for _ in range(STEPS // CHECK):
        mujoco.mj_step(model, data, CHECK)
        now = float(np.linalg.norm(data.qvel))
        if not now < GROWTH * start or any(data.warning[i].number for i in BLOWN_UP):
            return False
    return True


def measured_limit(model, integrator, guess):
    """Largest stable step of a model [s]; infinity where 1000 guesses are still stable.

    Gravity, constraints and ranges of forces, which would bound what grows, are switched off. The
    search widens from `guess` [s], so that a wrong one costs time only.
    """
    model = copy.copy(model)
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    for name in BOUNDED:
        getattr(model, name)[:] = 0
    scale = np.zeros(model.nv)
    scale[model.jnt_dofadr[np.isin(model.jnt_type, MOVED)]] = 1.0
    velocity = SMALL / guess * scale * np.random.default_rng(0).standard_normal(model.nv)
    low, high = 0.7 * guess, 1.4 * guess
    while not stable(model, low, velocity):
        low, high = low / 4.0, low
        assert low > 1e-9 * guess, f"no step of {integrator} is stable"
    while stable(model, high, velocity):
        low, high = high, high * 4.0
        if high > FARTHEST * guess:
            return np.inf
    while high / low > 1.0 + ACCURACY:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if stable(model, middle, velocity) else (low, middle)
    return float(np.sqrt(low * high))


def limits(study, model):
    """`(integrator, stated, measured)` of a `StabilityStudy` of one model."""
    slowest = LONGEST / float(study.budgets[0].frequencies[0])
    out = []
    for row in study.rows:
        guess = min(row.largest, slowest)
        measured = measured_limit(model, row.integrator, guess)
        beyond = np.isinf(measured) and row.largest > FARTHEST * guess
        out.append((row.integrator, np.inf if beyond else row.largest, measured))
    return out
