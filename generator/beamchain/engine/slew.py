"""A spacecraft turned from rest to rest by its hub or one of its hinges,
so that its appendages ring."""

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from beamchain.checks import unknown
from beamchain.engine.allocation import largest_torque
from beamchain.engine.bench import rigid_mass
from beamchain.engine.displacement import reach
from beamchain.engine.library import mujoco, rest
from beamchain.engine.linear import linear_at
from beamchain.engine.linearise import mass_matrix
from beamchain.engine.model_rows import sprung
from beamchain.engine.operating_point import quiet_copy, rest_point
from beamchain.engine.runs import film
from beamchain.errors import EngineError, InputError
from beamchain.ports.motions import Array, locked

_HINGE = int(mujoco.mjtJoint.mjJNT_HINGE)

PERIODS = (1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.6)  # of a turn: the shortest that does not bend too far
SAMPLES = 54  # of a turn whose angle is chosen, the same for every picture of it
RINGING = 3.5  # periods of the first mode shown after the turn
TRIAL = 0.01  # rad: a turn so small that what bends is proportional to it
FINE, MOST_FRAMES = 12, 480  # frames a period, if that is not too many
MOST_BENT = 0.4  # rad that a link turns out of its place: to be believed, and to be seen
# of a turn that is chosen here: its bending, its angle at most, and that which is enough [rad];
# the periods that it takes if fewer are not enough
GENTLY, LARGEST, ENOUGH, LONGER = 0.1, np.pi / 9.0, np.pi / 36.0, (1.0, 3.0, 5.0)
FELT = 1e-7  # of a mode's largest motion: less rotation of the hub is rounding
SEEN = 0.05  # of the spacecraft's size, per radian turned: bending of a mode that a turn shows
ANGLES = 61  # of a hinge, at which its inertia is computed


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
    joint: str = ""  # hinge that turned in place of the hub
    torque: float = 0.0  # of the actuators about the axis [N m], where it sets the angle

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


def simulate(
    model: "mujoco.MjModel",
    *,
    angle: float | None,
    frames: int,
    joint: str | None = None,
    most: float = np.inf,
    untimed: "mujoco.MjModel | None" = None,
) -> Slew:
    """Turn the spacecraft by `angle` [rad] with a torque forwards and back on its hub,
    or one of its hinges with the torque that turns the rigid spacecraft so, and let it ring.

    The turn takes about a period of the mode excited, or an odd number of them: then what its two
    halves leave behind adds up. Without an angle the hub turns by 20 degrees at most, as far as
    its appendages bend but gently and its actuators about the axis, if any, have the torque; a
    hinge by 20 degrees. `most`: the largest number of steps; `untimed`: the model whose modes ring,
    without the armature that makes it exact in time.
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
    name = model.body(hub).name or f"body {hub}"
    start = int(model.jnt_dofadr[free[0]])
    axis = 0
    ringing = model if untimed is None else untimed
    if joint is None:
        axis, omega = _mode_to_ring(ringing, np.arange(start + 3, start + 6), start, held)
        drive = _on_hub(model, hub, axis)
    else:
        angle = LARGEST if angle is None else angle
        number = _hinge(model, joint, held, angle)
        model = _without_actuators(model, number)
        turned = np.array([int(model.jnt_dofadr[number])])
        omega = _mode_to_ring(_without_actuators(ringing, number), turned, start, held)[1]
        drive = _in_hinge(model, number, held, angle)
    elastic = tuple(int(model.jnt_qposadr[j]) for j in held)
    period = 2.0 * np.pi / omega
    _check_steps(model, (1.0 + RINGING) * period, most)
    torque = 0.0
    if angle is None:
        bent = _bending(model, drive, 1.0, period, SAMPLES, elastic)
        angle, duration, torque = _chosen(model, hub, axis, period, bent)
    else:
        duration = _long_enough(model, drive, angle, period, frames, elastic)
    _check_steps(model, duration + RINGING * period, most)
    frames = max(frames, min(math.ceil(FINE * (duration / period + RINGING)), MOST_FRAMES))
    times = np.linspace(0.0, duration + RINGING * period, frames)
    positions = _run(model, drive(angle, duration), float(times[-1]), frames)
    return Slew(
        locked(times),
        locked(positions),
        name,
        axis,
        angle,
        float(duration),
        omega,
        elastic,
        joint or "",
        torque,
    )


def _chosen(
    model: "mujoco.MjModel", hub: int, axis: int, period: float, bent: float
) -> tuple[float, float, float]:
    """Angle [rad] and duration [s] of a turn about an axis of the hub, in a period of which links
    turn by `bent` per radian, and the torque of the actuators where it is that which limits it."""
    torque = largest_torque(model, rest(model), hub, axis)
    mobility = np.linalg.inv(rigid_mass(model, hub))[3 + axis, 3 + axis]
    by_torque = torque * float(mobility) * period**2 / 4.0
    most = min(GENTLY / bent, by_torque)  # in one period
    periods = next((n for n in LONGER if most * n**2 >= ENOUGH), LONGER[-1])
    angle = min(most * periods**2, LARGEST)
    limited = most == by_torque and angle < LARGEST
    return angle, periods * period, torque if limited else 0.0


Push = Callable[
    ["mujoco.MjData", float, float], None
]  # forces over a step from one time to another
Drive = Callable[[float, float], Push]  # of an angle [rad] and a duration [s]


def _long_enough(
    model: "mujoco.MjModel",
    drive: Drive,
    angle: float,
    period: float,
    frames: int,
    elastic: tuple[int, ...],
) -> float:
    """The duration of a turn [s] in which no link turns further than `MOST_BENT` out of its place
    on a rigid appendage."""

    def bent(periods: float) -> float:
        return abs(angle) * _bending(model, drive, periods, period, frames, elastic)

    for periods in PERIODS:
        if bent(periods) <= MOST_BENT:
            return periods * period
    halves = math.ceil(np.sqrt(bent(1.0) / MOST_BENT))
    return float(halves + 1 - halves % 2) * period


def _bending(
    model: "mujoco.MjModel",
    drive: Drive,
    periods: float,
    period: float,
    frames: int,
    elastic: tuple[int, ...],
) -> float:
    """By how much a link turns out of its place on a rigid appendage, per angle of a small turn
    that takes so many periods."""
    data = mujoco.MjData(model)

    def rotations(qpos: Array) -> Array:
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        return data.xmat.copy()

    shown = _run(model, drive(TRIAL, periods * period), (periods + RINGING) * period, frames)
    rigid = shown.copy()
    rigid[:, list(elastic)] = 0.0
    turned = [
        np.linalg.norm(rotations(a) - rotations(b), axis=1).max() / np.sqrt(2.0)
        for a, b in zip(shown, rigid, strict=True)
    ]  # |R - 1| = sqrt(2) times the angle
    return float(np.max(turned)) / TRIAL


def _on_hub(model: "mujoco.MjModel", hub: int, axis: int) -> Drive:
    """A torque on the hub, in the axes that it has at the start."""
    inertia = rigid_mass(model, hub)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    line = data.xmat[hub].reshape(3, 3)[:, axis] / np.linalg.inv(inertia)[3 + axis, 3 + axis]

    def drive(angle: float, duration: float) -> Push:
        def push(data: "mujoco.MjData", before: float, after: float) -> None:
            impulse = _impulse(after, duration) - _impulse(before, duration)
            torque = 4.0 * angle / duration**2 * impulse / (after - before)
            data.xfrc_applied[hub, 3:] = torque * line

        return push

    return drive


def _in_hinge(model: "mujoco.MjModel", joint: int, held: "list[int]", angle: float) -> Drive:
    """The torque in a hinge that turns the spacecraft with rigid appendages, at first at rest:
    with J the inertia that the hinge feels, `J a'' + J' a'^2 / 2 + damping a'`."""
    address = int(model.jnt_qposadr[joint])
    dof = int(model.jnt_dofadr[joint])
    loose = np.setdiff1d(np.arange(model.nv), model.jnt_dofadr[held])
    at = int(np.flatnonzero(loose == dof)[0])
    qpos = np.array(model.qpos0)
    angles = np.linspace(min(0.0, angle), max(0.0, angle), ANGLES)
    felt: list[float] = []
    for turned in angles:
        qpos[address] = model.qpos0[address] + turned
        rigid = mass_matrix(model, qpos)[np.ix_(loose, loose)]
        felt.append(1.0 / float(np.linalg.inv(rigid)[at, at]))
    inertia = CubicSpline(angles, felt)
    damping = float(model.dof_damping[dof])

    def drive(angle: float, duration: float) -> Push:
        most = 4.0 * angle / duration**2

        def push(data: "mujoco.MjData", before: float, after: float) -> None:
            middle = min((before + after) / 2.0, duration)
            left = duration - middle
            turned = most * middle**2 / 2.0 if middle < left else angle - most * left**2 / 2.0
            rate = most * _impulse(middle, duration)
            impulse = _impulse(after, duration) - _impulse(before, duration)
            data.qfrc_applied[dof] = (
                float(inertia(turned)) * most * impulse / (after - before)
                + float(inertia(turned, 1)) * rate**2 / 2.0
                + damping * rate
            )

        return push

    return drive


def _hinge(model: "mujoco.MjModel", name: str, held: "list[int]", angle: float) -> int:
    """The number of a hinge of the spacecraft itself that may turn by an angle."""
    hinges = {
        str(model.joint(j).name): j
        for j in range(model.njnt)
        if int(model.jnt_type[j]) == _HINGE and j not in held
    }
    if name not in hinges:
        raise unknown("joint", name, hinges, "Only hinges without springs can be turned.")
    joint = hinges[name]
    low, high = model.jnt_range[joint]
    end = float(model.qpos0[model.jnt_qposadr[joint]]) + angle
    if bool(model.jnt_limited[joint]) and not low <= end <= high:
        raise InputError(
            f"joint {name!r} would turn to {np.degrees(end):g} degrees, outside its range "
            f"[{np.degrees(low):g}, {np.degrees(high):g}]; give an angle within it."
        )
    return joint


def _without_actuators(model: "mujoco.MjModel", joint: int) -> "mujoco.MjModel":
    """A copy in which no actuator of a joint acts: a servo would hold it."""
    out = copy.copy(model)
    kinds = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    of_joint = np.isin(out.actuator_trntype, kinds) & (out.actuator_trnid[:, 0] == joint)
    out.actuator_gainprm[of_joint] = 0.0
    out.actuator_biasprm[of_joint] = 0.0
    return out


def _run(model: "mujoco.MjModel", push: Push, end: float, frames: int) -> Array:
    """`(frames, nq)` positions under a drive."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    step = float(model.opt.timestep)

    def advance() -> None:
        push(data, data.time, data.time + step)
        mujoco.mj_step(model, data)

    return film(model, data, np.linspace(0.0, end, frames), advance)


def _check_steps(model: "mujoco.MjModel", end: float, most: float) -> None:
    steps = end / float(model.opt.timestep)
    if steps > most:
        raise EngineError(
            f"the turn takes {steps:.3g} steps of {float(model.opt.timestep):g} s, more than the "
            f"{most:.3g} wanted; give a larger step."
        )


def _impulse(time: float, duration: float) -> float:
    """Integral of 1 for the first half of `duration`, -1 for the second."""
    return max(min(time, duration - time), 0.0)


def _mode_to_ring(
    model: "mujoco.MjModel", turning: "NDArray[np.intp]", start: int, held: "list[int]"
) -> tuple[int, float]:
    """Which of some degrees of freedom is turned, and the frequency [rad/s] of the mode that
    rings: the lowest that bends enough to be seen, or the one that bends most.

    A turn by `theta` within a period of a mode with frequency `w` and shape `phi` of unit mass
    takes a torque of `J theta w^2/pi^2`, with J the inertia that it feels, and leaves the mode
    ringing with an amplitude of `4 phi_turned J theta/pi^2`, whatever its frequency. The hub's
    degrees of freedom begin at `start`.
    """
    point = rest_point(quiet_copy(model))
    modes = linear_at(point).modes()
    springs = np.isin(model.dof_jntid, held)
    loose = np.flatnonzero(~springs)
    rigid = np.linalg.inv(mass_matrix(model, point.qpos)[np.ix_(loose, loose)])
    inertia = 1.0 / np.diag(rigid)[np.searchsorted(loose, turning)]
    bent = np.zeros((modes.frequency.size, turning.size))
    for k, shape in enumerate(modes.shapes.T):
        turned = np.abs(shape[turning])
        rest = np.abs(np.delete(shape, np.s_[start : start + 6]))
        if turned.max() > FELT * rest.max():
            bends = reach(model, point.qpos, np.where(springs, shape, 0.0))  # per unit of the mode
            bent[k] = 4.0 * turned * inertia / np.pi**2 * bends
    most = bent.max(axis=1, initial=0.0)
    if most.max(initial=0.0) == 0.0:
        raise InputError(
            "no elastic mode of the scene turns its hub or that joint; there is nothing that a "
            "turn would show."
        )
    k = int(np.argmax(most >= min(SEEN * float(model.stat.extent), most.max())))
    return int(np.argmax(bent[k])), float(modes.frequency[k])
