"""The largest stable step, measured: bisection on real simulations of a small perturbation."""

import numpy as np

from beamchain.engine.library import mujoco, quiet
from beamchain.engine.linearise import INTEGRATORS
from beamchain.errors import EngineError
from beamchain.ports.motions import Array

STEPS = 1000  # per trial
GROWTH = 300.0  # of the velocity's norm: above what a stable step near its limit swings up to
SMALL = 1e-7  # of the fastest mode's angle: what is measured is the linear model
CHECK = 10  # steps between two looks
BLOWN_UP = tuple(
    int(w)
    for w in (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
)  # after any of them MuJoCo starts anew from rest


def stable(model: "mujoco.MjModel", timestep: float, velocity: Array) -> bool:
    """Whether a small perturbation stays small over `STEPS` steps of the model's own integrator."""
    before = float(model.opt.timestep)
    model.opt.timestep = timestep
    try:
        data = mujoco.MjData(model)
        mujoco.mj_resetData(model, data)
        data.qvel[:] = velocity
        start = float(np.linalg.norm(velocity))
        for _ in range(STEPS // CHECK):
            for _ in range(CHECK):
                mujoco.mj_step(model, data)
            now = float(np.linalg.norm(data.qvel))
            if not now < GROWTH * start or any(data.warning[i].number for i in BLOWN_UP):
                return False
        return True
    finally:
        model.opt.timestep = before


def measured_limit(
    model: "mujoco.MjModel", integrator: str, guess: float, *, accuracy: float = 5e-4, seed: int = 0
) -> float:
    """Largest stable step of a model [s], by bisection; infinity where a step of 1000 guesses is still stable.

    Gravity and contacts are switched off meanwhile. The search widens from `guess` [s] until it holds the limit, so that a
    wrong one costs time only.
    """
    kept = int(model.opt.integrator), model.opt.gravity.copy(), int(model.opt.disableflags)
    model.opt.integrator = INTEGRATORS[integrator]
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    velocity = _perturbation(model, guess, seed)
    try:
        with quiet():  # what blows up is what is looked for
            return _bisect(model, integrator, guess, velocity, accuracy)
    finally:
        model.opt.integrator, model.opt.disableflags = kept[0], kept[2]
        model.opt.gravity[:] = kept[1]


def _bisect(model: "mujoco.MjModel", integrator: str, guess: float, velocity: Array, accuracy: float) -> float:
    low, high = 0.7 * guess, 1.4 * guess
    while not stable(model, low, velocity):
        low, high = low / 4.0, low
        if low < 1e-9 * guess:
            raise EngineError(f"no step of {integrator} is stable; the model falls over by itself.")
    while stable(model, high, velocity):
        low, high = high, high * 4.0
        if high > 1e3 * guess:
            return float("inf")
    while high / low > 1.0 + accuracy:
        middle = float(np.sqrt(low * high))
        if stable(model, middle, velocity):
            low = middle
        else:
            high = middle
    return float(np.sqrt(low * high))


def _perturbation(model: "mujoco.MjModel", guess: float, seed: int) -> Array:
    """Velocities that move all hinges and slides by some `SMALL` per step."""
    scale = np.zeros(model.nv)
    for j in range(model.njnt):
        if int(model.jnt_type[j]) in (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)):
            scale[int(model.jnt_dofadr[j])] = 1.0
    return SMALL / guess * scale * np.random.default_rng(seed).standard_normal(model.nv)
