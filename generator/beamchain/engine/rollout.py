"""A hub under a wrench: its motion, and the time that it takes to simulate it."""

import time
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from beamchain.engine.library import mujoco, quiet
from beamchain.engine.linearise import INTEGRATORS
from beamchain.engine.runs import roll
from beamchain.ports.motions import Array

SHORTEST_STRETCH = 5  # steps per wrench from which one call per wrench is quicker
ROUNDING = 1e-9  # relative to the largest: a wrench that changes by less has not changed


@dataclass(frozen=True, eq=False)
class Course:
    """Motion `(t, 6)` of the hub [m, rotation vector in rad], and run time [s]."""

    motion: Array
    seconds: float


def simulate(model: "mujoco.MjModel", integrator: str, timestep: float, wrench: Array) -> Course:
    """Simulate from rest with a wrench `(t, 6)` on the hub, constant over a step."""
    model.opt.integrator, model.opt.timestep = INTEGRATORS[integrator], timestep
    rest = np.array(model.qpos0[:3])
    steps = wrench.shape[0]
    motion = np.full((steps, 6), np.nan)

    def forces(first: int, end: int) -> Array:
        return np.hstack([wrench[first:end], np.zeros((end - first, model.nv - 6))])

    seconds, done = 0.0, 0
    for states, took in roll(model, steps, forces):
        piece = slice(done, done + len(states))
        motion[piece, :3] = states[:, 1:4] - rest
        motion[piece, 3:] = _rotation(states[:, 4:8])
        seconds, done = seconds + took, done + len(states)
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
