"""A hinge of a spacecraft driven through an angle: the torques that this takes on the rigid craft,
and the motion of any model of the same craft under these torques."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from beamchain.engine.library import mujoco
from beamchain.engine.linearise import INTEGRATORS, dense_mass
from beamchain.engine.runs import roll, state_of
from beamchain.errors import EngineError
from beamchain.ports.motions import Array, locked

GRID = 500  # points of a turn at which the torques are computed, at least


class Turn(NamedTuple):
    """A turn by `angle` [rad] in `duration` [s] from rest to rest, along the polynomial of
    degree 7 whose rate, acceleration and jerk vanish at both ends."""

    angle: float
    duration: float

    def at(self, time: float) -> tuple[float, float, float]:
        """Angle [rad], rate [rad/s] and acceleration [rad/s^2] at a time [s]."""
        s = min(max(time / self.duration, 0.0), 1.0)
        share = s**4 * (35.0 - 84.0 * s + 70.0 * s**2 - 20.0 * s**3)
        rate = 140.0 * (s * (1.0 - s)) ** 3
        acceleration = 420.0 * (s * (1.0 - s)) ** 2 * (1.0 - 2.0 * s)
        size = self.angle / self.duration
        return self.angle * share, size * rate, size / self.duration * acceleration

    @property
    def rate(self) -> float:
        """Largest rate, in the middle of the turn [rad/s]."""
        return 140.0 / 64.0 * abs(self.angle) / self.duration


@dataclass(frozen=True, eq=False)
class Drive:
    """The rigid craft turned at a hinge.

    Args:
        turn: of the hinge.
        spacing: of the samples [s].
        samples: their number, the start included.
        times: `(k,)` [s], of `torques`.
        torques: `(k, m)` [N m or N] on the joints that are driven or held.
        qpos: `(samples, nq)` positions of the rigid craft.
        qvel: `(samples, nv)` its velocities.
    """

    turn: Turn
    spacing: float
    samples: int
    times: Array
    torques: Array
    qpos: Array
    qvel: Array

    def means(self, timestep: float, steps: int) -> Array:
        """`(steps, m)` means of the torques over steps."""
        edges = np.minimum(timestep * np.arange(steps + 1), self.times[-1])
        return np.asarray(np.diff(self._impulse(edges), axis=0) / timestep, dtype=np.float64)

    @cached_property
    def _impulse(self) -> CubicSpline:
        return CubicSpline(self.times, self.torques).antiderivative()


def drive_of(
    model: "mujoco.MjModel",
    joint: int,
    held: "list[int]",
    turn: Turn,
    *,
    spacing: float,
    samples: int,
) -> Drive:
    """Turn a hinge of the rigid craft from the rest pose, by inverse dynamics.

    The joints `held`, of one degree of freedom each, stay where they are but for `joint`, which is
    one of them; nothing acts on the others. With `p` the prescribed and `f` the other degrees of
    freedom, and `c` what Coriolis forces, springs, dampers and actuators make, each step solves

        M_ff a_f = -c_f - M_fp a_p

    and `mj_inverse` gives the torques. What actuators do by themselves counts as theirs.
    """
    fine = max(int(np.ceil(spacing / (turn.duration / GRID))), 1)
    h = spacing / fine
    count = (samples - 1) * fine
    data = mujoco.MjData(model)
    places = np.asarray(model.jnt_qposadr)[held]
    prescribed = np.asarray(model.jnt_dofadr)[held]
    others = np.setdiff1d(np.arange(model.nv), prescribed)
    own = held.index(joint)
    rest = np.array(model.qpos0)[places]

    def accelerate(time: float, qpos: Array, qvel: Array) -> tuple[Array, Array]:
        """Velocities and accelerations at a state, the prescribed ones in their places."""
        angle, rate, acceleration = turn.at(time)
        qpos[places] = rest
        qpos[places[own]] += angle
        qvel[prescribed] = 0.0
        qvel[prescribed[own]] = rate
        data.qpos[:] = qpos
        data.qvel[:] = qvel
        mujoco.mj_forward(model, data)
        qacc = np.zeros(model.nv)
        qacc[prescribed[own]] = acceleration
        mass = dense_mass(model, data)
        left = (data.qfrc_smooth - mass @ qacc)[others]
        qacc[others] = np.linalg.solve(mass[np.ix_(others, others)], left)
        return qvel, qacc

    def torque(qacc: Array) -> Array:
        data.qacc[:] = qacc
        mujoco.mj_inverse(model, data)
        return (data.qfrc_inverse - data.qfrc_actuator)[prescribed]

    def moved(qpos: Array, qvel: Array, time: float) -> Array:
        out = qpos.copy()
        mujoco.mj_integratePos(model, out, qvel, time)
        return out

    qpos = np.array(model.qpos0)
    qvel = np.zeros(model.nv)
    torques = np.empty((count + 1, len(held)))
    positions = np.empty((samples, model.nq))
    velocities = np.empty((samples, model.nv))
    for k in range(count + 1):
        t = k * h
        v1, a1 = accelerate(t, qpos, qvel.copy())
        torques[k] = torque(a1)
        if k % fine == 0:
            positions[k // fine] = data.qpos
            velocities[k // fine] = data.qvel
        v2, a2 = accelerate(t + h / 2.0, moved(qpos, v1, h / 2.0), v1 + h / 2.0 * a1)
        v3, a3 = accelerate(t + h / 2.0, moved(qpos, v2, h / 2.0), v1 + h / 2.0 * a2)
        v4, a4 = accelerate(t + h, moved(qpos, v3, h), v1 + h * a3)
        qpos = moved(qpos, (v1 + 2.0 * v2 + 2.0 * v3 + v4) / 6.0, h)
        qvel = v1 + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    times = h * np.arange(count + 1)
    return Drive(
        turn,
        spacing,
        samples,
        locked(times),
        locked(torques),
        locked(positions),
        locked(velocities),
    )


class Run(NamedTuple):
    """States of a model at the samples of a drive: `(samples, nq)` and `(samples, nv)`."""

    qpos: Array
    qvel: Array


def run(
    model: "mujoco.MjModel",
    held: "list[int]",
    drive: Drive,
    integrator: str,
    per_sample: int,
    *,
    mean_input: bool = False,
) -> Run:
    """Simulate a model of the craft from rest under the torques of a drive.

    Args:
        model: its step and integrator change.
        held: joints on which the torques act, in the drive's order.
        drive: the torques.
        integrator: MuJoCo's name.
        per_sample: steps from one sample to the next.
        mean_input: give every step the mean of its torque and of the one before (`HeldInput`).

    Raises:
        EngineError: the simulation is unstable.
    """
    timestep = drive.spacing / per_sample
    model.opt.integrator, model.opt.timestep = INTEGRATORS[integrator], timestep
    steps = (drive.samples - 1) * per_sample
    torques = drive.means(timestep, steps)
    if mean_input:
        torques = (torques + np.vstack([np.zeros((1, torques.shape[1])), torques[:-1]])) / 2.0
    dofs = np.asarray(model.jnt_dofadr)[held]

    def forces(first: int, end: int) -> Array:
        given = np.zeros((end - first, model.nv))
        given[:, dofs] = torques[first:end]
        return given

    states = state_of(mujoco.MjData(model))[None]
    for piece, _ in roll(model, steps, forces, per_sample):
        states = np.vstack([states, piece[per_sample - 1 :: per_sample]])
    if len(states) < drive.samples:
        raise EngineError(
            f"the slew cannot be simulated with {integrator} at {timestep:.4g} s: the simulation "
            "is unstable."
        )
    return Run(
        locked(states[:, 1 : 1 + model.nq].copy()),
        locked(states[:, 1 + model.nq : 1 + model.nq + model.nv].copy()),
    )


class Seen(NamedTuple):
    """What a run looks like from outside, at each of its samples.

    `rotations` `(k, b, 3, 3)` and `places` `(k, b, 3)` [m] of bodies, then of sites; `momentum`
    `(k, 3)` [N m s]: angular, about the centre of mass; `share` `(k,)`: size of the part of it
    behind a body; `energy` `(k,)` [J].
    """

    rotations: Array
    places: Array
    momentum: Array
    share: Array
    energy: Array


def seen(
    model: "mujoco.MjModel", states: Run, bodies: "list[int]", sites: "list[int]", behind: int
) -> Seen:
    """A run seen from outside; `behind`: the body whose subtree's momentum is looked at."""
    data = mujoco.MjData(model)
    count = len(states.qpos)
    rotations = np.empty((count, len(bodies) + len(sites), 3, 3))
    places = np.empty((count, len(bodies) + len(sites), 3))
    momentum = np.empty((count, 3))
    share = np.empty(count)
    energy = np.empty(count)
    base = int(model.body_rootid[behind])
    mass = float(model.body_subtreemass[behind])
    for k, (qpos, qvel) in enumerate(zip(states.qpos, states.qvel, strict=True)):
        data.qpos[:] = qpos
        data.qvel[:] = qvel
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_subtreeVel(model, data)
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        rotations[k] = np.vstack([data.xmat[bodies], data.site_xmat[sites]]).reshape(-1, 3, 3)
        places[k] = np.vstack([data.xpos[bodies], data.site_xpos[sites]])
        momentum[k] = data.subtree_angmom[base]
        arm = data.subtree_com[behind] - data.subtree_com[base]
        moving = data.subtree_linvel[behind] - data.subtree_linvel[base]
        share[k] = np.linalg.norm(data.subtree_angmom[behind] + mass * np.cross(arm, moving))
        energy[k] = np.sum(data.energy)
    return Seen(rotations, places, momentum, share, energy)
