"""The largest stable step, measured: bisection on real simulations of a small perturbation."""

import numpy as np

from beamchain.engine.constraints import without_constraints
from beamchain.engine.library import mujoco, quiet
from beamchain.engine.linearise import INTEGRATORS
from beamchain.engine.operating_point import LIMITS
from beamchain.errors import EngineError
from beamchain.ports.motions import Array

STEPS = 1000  # per trial
GROWTH = 300.0  # of the velocity's norm: above what a stable step near its limit swings up to
SMALL = 1e-7  # of the fastest mode's angle: what is measured is the linear model
FARTHEST = 1e3  # times the first guess: what is stable there has no limit
CHECK = 10  # steps between two looks
ACCURACY = 5e-4  # relative, of the limit
MOVED = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
BLOWN_UP = tuple(
    int(w)
    for w in (
        mujoco.mjtWarning.mjWARN_BADQPOS,
        mujoco.mjtWarning.mjWARN_BADQVEL,
        mujoco.mjtWarning.mjWARN_BADQACC,
    )
)  # after any of them MuJoCo starts anew from rest


def stable(model: "mujoco.MjModel", timestep: float, velocity: Array) -> bool:
    """Whether a small perturbation stays small over `STEPS` steps of the model's own integrator;
    `model.opt` is changed."""
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


def measured_limit(model: "mujoco.MjModel", integrator: str, guess: float) -> float:
    """Largest stable step of a model [s], by bisection;
    infinity where a step of 1000 guesses is still stable.

    Gravity, constraints and ranges of forces, which would bound what grows, are switched off
    meanwhile. The search widens from `guess` [s] until it
    holds the limit, so that a wrong one costs time only.
    """
    model = without_constraints(model)
    model.opt.integrator = INTEGRATORS[integrator]
    model.opt.gravity[:] = 0.0
    for name in LIMITS:
        getattr(model, name)[:] = 0
    scale = np.zeros(model.nv)
    scale[model.jnt_dofadr[np.isin(model.jnt_type, MOVED)]] = 1.0
    velocity = SMALL / guess * scale * np.random.default_rng(0).standard_normal(model.nv)
    with quiet():  # what blows up is what is looked for
        return _bisect(model, integrator, guess, velocity)


def _bisect(model: "mujoco.MjModel", integrator: str, guess: float, velocity: Array) -> float:
    low, high = 0.7 * guess, 1.4 * guess
    while not stable(model, low, velocity):
        low, high = low / 4.0, low
        if low < 1e-9 * guess:
            raise EngineError(f"no step of {integrator} is stable; the model falls over by itself.")
    while stable(model, high, velocity):
        low, high = high, high * 4.0
        if high > FARTHEST * guess:
            return float("inf")
    while high / low > 1.0 + ACCURACY:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if stable(model, middle, velocity) else (low, middle)
    return float(np.sqrt(low * high))
