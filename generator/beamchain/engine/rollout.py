"""Simulation in one go, without Python between the steps: `mujoco.rollout` on the calling thread,
and its time."""

import time
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from beamchain.engine.library import mujoco, quiet, rollout_engine
from beamchain.engine.linearise import INTEGRATORS
from beamchain.ports.motions import Array

STATE = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)
FORCES = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)
SHORTEST_STRETCH = 5  # steps per wrench from which one call per wrench is quicker
ROUNDING = 1e-9  # relative to the largest: a wrench that changes by less has not changed
LARGEST = 4_000_000  # numbers held at once; longer simulations go in pieces


@dataclass(frozen=True, eq=False)
class Course:
    """Motion `(t, 6)` of the hub [m, rotation vector in rad], and run time [s]."""

    motion: Array
    seconds: float


def simulate(model: "mujoco.MjModel", integrator: str, timestep: float, wrench: Array) -> Course:
    """Simulate from rest with a wrench `(t, 6)` on the hub, constant over a step."""
    model.opt.integrator, model.opt.timestep = INTEGRATORS[integrator], timestep
    data = mujoco.MjData(model)
    size = mujoco.mj_stateSize(model, STATE)
    steps = wrench.shape[0]
    state = np.zeros((1, size))
    mujoco.mj_getState(model, data, state[0], STATE)
    rest = data.qpos[:3].copy()
    piece = max(min(steps, LARGEST // (size + model.nv)), 1)
    motion = np.full((steps, 6), np.nan)
    seconds, done = 0.0, 0
    with quiet(), rollout_engine() as engine:
        while done < steps:
            count = min(piece, steps - done)
            forces = np.zeros((1, count, model.nv))
            forces[0, :, :6] = wrench[done : done + count]
            out = np.empty((1, count, size))
            start = time.thread_time()
            engine.rollout(
                [model],
                [data],
                state,
                forces,
                control_spec=FORCES,
                skip_checks=True,
                nstep=count,
                state=out,
            )
            seconds += time.thread_time() - start
            if int(np.sum(data.warning.number)) > 0 or not np.all(np.isfinite(out[0, -1])):
                return Course(motion, seconds)
            motion[done : done + count, :3] = out[0, :, 1:4] - rest
            motion[done : done + count, 3:] = _rotation(out[0, :, 4:8])
            state, done = out[:, -1].copy(), done + count
    return Course(motion, seconds)


def seconds_of(model: "mujoco.MjModel", integrator: str, timestep: float, wrench: Array) -> float:
    """Time to simulate as `simulate` does, nothing recorded [s]."""
    moved = np.abs(np.diff(wrench, axis=0)) > ROUNDING * float(np.max(np.abs(wrench)))
    changes = np.flatnonzero(np.any(moved, axis=1)) + 1
    if changes.size * SHORTEST_STRETCH > wrench.shape[0]:
        return simulate(model, integrator, timestep, wrench).seconds
    model.opt.integrator, model.opt.timestep = INTEGRATORS[integrator], timestep
    data = mujoco.MjData(model)
    edges = [0, *changes.tolist(), wrench.shape[0]]
    with quiet():
        start = time.thread_time()
        for first, end in pairwise(edges):
            data.qfrc_applied[:6] = wrench[first]
            mujoco.mj_step(model, data, nstep=end - first)
        return time.thread_time() - start


def _rotation(quaternions: Array) -> Array:
    """Rotation vectors `(t, 3)` of unit quaternions `(t, 4)`, scalar first."""
    sine = np.linalg.norm(quaternions[:, 1:], axis=1)
    angle = 2.0 * np.arctan2(sine, quaternions[:, 0])
    share = np.divide(angle, sine, out=np.full(sine.size, 2.0), where=sine > 0.0)
    return quaternions[:, 1:] * share[:, None]
