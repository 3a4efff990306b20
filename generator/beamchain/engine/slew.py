"""A spacecraft turned from rest to rest by its hub, so that its appendages ring."""

from dataclasses import dataclass

import numpy as np

from beamchain.engine.bench import rigid_mass
from beamchain.engine.forces import sprung
from beamchain.engine.library import mujoco
from beamchain.engine.linear import linear_at
from beamchain.engine.operating_point import quiet_copy, rest_point
from beamchain.errors import EngineError, InputError
from beamchain.ports.motions import Array, locked

_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)

RINGING = 3.5  # periods of the first mode shown after the turn
TRIAL = 0.01  # rad: a turn so small that what bends is proportional to it
MOST_BENT = 0.22  # rad in one hinge: small enough to be believed, large enough to be seen
FELT = 1e-7  # of a mode's largest motion: less rotation of the hub is rounding


@dataclass(frozen=True, eq=False)
class Slew:
    """A simulated turn."""

    times: Array  # (k,) [s]
    positions: Array  # (k, nq) of MuJoCo
    body: str
    axis: int  # 0, 1, 2: about x, y or z of the body
    angle: float  # [rad]
    duration: float  # of the turn [s]
    omega: float  # of the mode that rings [rad/s]
    elastic: tuple[int, ...]  # addresses of the sprung joints in the positions

    def shown(self, exaggerate: float) -> Array:
        """`(k, nq)` positions with the sprung joints' motion multiplied by `exaggerate`."""
        out = self.positions.copy()
        out[:, list(self.elastic)] *= exaggerate
        return out

    @property
    def rate(self) -> float:
        """Largest rate of the rigid turn [rad/s]."""
        return 2.0 * abs(self.angle) / self.duration

    @property
    def acceleration(self) -> float:
        """Its angular acceleration [rad/s^2]."""
        return 4.0 * abs(self.angle) / self.duration**2

    @property
    def loudest(self) -> int:
        """The frame in which the sprung joints are furthest from rest."""
        return int(np.argmax(np.linalg.norm(self.positions[:, list(self.elastic)], axis=1)))


def simulate(model: "mujoco.MjModel", *, angle: float, frames: int) -> Slew:
    """Turn the spacecraft by `angle` [rad] with a torque forwards and back on its hub,
    and let it ring.

    The turn takes an odd number of periods of the mode excited,
    so that what the two halves leave behind adds up.
    """
    free = [
        j for j in range(model.njnt) if int(model.jnt_type[j]) == int(mujoco.mjtJoint.mjJNT_FREE)
    ]
    if not free:
        raise InputError(
            "the scene has no freely flying body to turn; give one whose spacecraft has a "
            "<freejoint/>."
        )
    held = sprung(model)
    if not held:
        raise InputError(
            "no joint of the scene has a spring, so that nothing can ring; attach an appendage "
            "first."
        )
    hub = int(model.jnt_bodyid[free[0]])
    name = model.body(hub).name
    axis, omega = _lowest_turning_mode(model, int(model.jnt_dofadr[free[0]]))
    elastic = tuple(int(model.jnt_qposadr[j]) for j in held)
    hinged = [a for j, a in zip(held, elastic, strict=True) if int(model.jnt_type[j]) == _HINGE]
    period = 2.0 * np.pi / omega
    about = np.zeros(3)
    about[axis] = 1.0 / np.linalg.inv(rigid_mass(model, name))[3 + axis, 3 + axis]
    trial = _run(
        model, hub, 4.0 * TRIAL / period**2 * about, period, (1.0 + RINGING) * period, frames
    )
    bent = float(np.abs(trial[:, hinged]).max(initial=0.0)) * abs(angle) / TRIAL
    halves = max(int(np.ceil(np.sqrt(bent / MOST_BENT))), 1)
    duration = (halves + 1 - halves % 2) * period
    times = np.linspace(0.0, duration + RINGING * period, frames)
    positions = _run(
        model, hub, 4.0 * angle / duration**2 * about, duration, float(times[-1]), frames
    )
    return Slew(
        locked(times), locked(positions), name, axis, angle, float(duration), omega, elastic
    )


def _run(
    model: "mujoco.MjModel", hub: int, torque: Array, duration: float, end: float, frames: int
) -> Array:
    """`(frames, nq)` positions; `torque` forwards and back in the hub's axes."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    torque = data.xmat[hub].reshape(3, 3) @ torque
    step = float(model.opt.timestep)
    positions = np.empty((frames, model.nq))
    for k, time in enumerate(np.linspace(0.0, end, frames)):
        while data.time < time - step / 2.0:
            before = data.time
            data.xfrc_applied[hub, 3:] = (
                torque * (_impulse(before + step, duration) - _impulse(before, duration)) / step
            )
            mujoco.mj_step(model, data)
            if data.time < before:  # MuJoCo starts anew where a state is not finite
                raise EngineError(
                    f"the simulation is unstable at the scene's step of {step:g} s; see beamchain "
                    "inspect for the largest one."
                )
        positions[k] = data.qpos
    return positions


def _impulse(time: float, duration: float) -> float:
    """Integral of 1 for the first half of `duration`, -1 for the second."""
    return max(min(time, duration - time), 0.0)


def _lowest_turning_mode(model: "mujoco.MjModel", start: int) -> tuple[int, float]:
    """Axis and frequency [rad/s] of the lowest mode in which the hub turns."""
    modes = linear_at(rest_point(quiet_copy(model))).modes()
    for omega, shape in zip(modes.frequency, np.abs(modes.shapes).T, strict=True):
        turn = shape[start + 3 : start + 6]
        rest = np.delete(shape, np.s_[start : start + 6])
        if turn.max() > FELT * rest.max():
            return int(np.argmax(turn)), float(omega)
    raise InputError(
        "no elastic mode of the scene turns its hub; there is nothing that a turn would show."
    )
