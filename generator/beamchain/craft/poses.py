"""Poses of a craft: what `pose` of `plant` may be, what each pose is called, and the way from one
to the next."""

from collections.abc import Mapping
from numbers import Integral, Real
from typing import NamedTuple

import numpy as np

from beamchain.checks import finite_array, number
from beamchain.engine.library import mujoco
from beamchain.engine.operating_point import (
    Pose,
    check_pose,
    is_cyclic,
    is_slide,
    single_joints,
    state_at,
    value_text,
)
from beamchain.errors import InputError
from beamchain.ports.motions import Array, locked

MOVED = 1e-9  # [rad, m] below which a joint has not moved
NAMED = 4  # joints that the label of bare positions may name


class LabelledPose(NamedTuple):
    """A pose: its label, what `operating_point` takes for it, and its positions `(nq,)`."""

    label: str
    given: Pose
    qpos: Array


class Poses(NamedTuple):
    """Several poses, in their order.

    Args:
        each: the poses.
        joints: names of the joints that the poses name or that move between them.
        units: of their positions, `rad` or `m`.
        values: `(k, joints)` [rad, m] in every pose.
        joint: the one joint that a grid of its angles moves; None of a list of poses.
    """

    each: tuple[LabelledPose, ...]
    joints: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    joint: str | None = None

    @property
    def labels(self) -> tuple[str, ...]:
        """What the poses are called."""
        return tuple(pose.label for pose in self.each)

    @property
    def angles(self) -> Array | None:
        """`(k,)` [rad] of a grid's joint."""
        return None if self.joint is None else self.values[:, self.joints.index(self.joint)]


class Way(NamedTuple):
    """The way between two positions, on which all joints move together.

    Args:
        model: whose joints move.
        start: `(nq,)`.
        motion: `(nv,)` from the start to the end.
        length: the largest motion of a joint [rad, m]; wheels, on whose angles nothing depends,
            left out.
    """

    model: "mujoco.MjModel"
    start: Array
    motion: Array
    length: float

    @classmethod
    def between(cls, model: "mujoco.MjModel", start: Array, end: Array) -> "Way":
        """The way from one pose `(nq,)` to another."""
        motion = np.zeros(model.nv)
        mujoco.mj_differentiatePos(model, motion, 1.0, start, end)
        moved = [
            abs(float(motion[dof]))
            for dof in np.flatnonzero(np.abs(motion) > MOVED)
            if not is_cyclic(model, start, int(model.dof_jntid[dof]))
        ]
        return cls(model, start, motion, max(moved, default=0.0))

    def at(self, share: float) -> Array:
        """Positions `(nq,)` after a share of the way."""
        out = self.start.copy()
        mujoco.mj_integratePos(self.model, out, self.motion, share)
        return out


def poses_of(model: "mujoco.MjModel", pose: Pose) -> Poses | None:
    """The poses that `pose` lists, or a grid of one joint's angles; None where it is one pose."""
    grid = _angle_grid(pose)
    if grid is not None:
        joint, angles = grid
        each = [{**pose, joint: float(angle)} for angle in angles]
        return _made(model, each, ["pose"] * len(each), joint)
    if isinstance(pose, list | tuple) and not pose:
        raise InputError(
            "pose is an empty list; give at least one pose, or leave pose out for the one that the "
            "model has."
        )
    if not _is_list_of_poses(pose):
        return None
    each = [{} if one is None else one for one in pose]
    return _made(model, each, [f"pose[{i}]" for i in range(len(each))])


def pose_label(model: "mujoco.MjModel", pose: Pose) -> str:
    """What one pose is called; empty where none is asked for."""
    return "" if pose is None else _label(model, pose, state_at(model, pose)[0], 1)


def _is_list_of_poses(pose: Pose) -> bool:
    """Whether something in a list is no number: numbers alone are one pose's positions."""
    listed = isinstance(pose, list | tuple) or (isinstance(pose, np.ndarray) and pose.ndim > 0)
    return listed and any(not isinstance(one, Real) for one in pose)


def _angle_grid(pose: Pose) -> tuple[str, Array] | None:
    """The joint and its angles where `pose` is a grid; None where it is not."""
    given = pose.items() if isinstance(pose, Mapping) else ()
    many = {
        str(name): finite_array(f"pose[{name!r}]", values, unit="rad")
        for name, values in given
        if np.ndim(values) > 0
    }
    if not many:
        return None
    name, values = next(iter(many.items()))
    if len(many) > 1 or values.ndim != 1 or values.size == 0:
        raise InputError(
            f"pose = {pose!r:.80} gives {', '.join(many)} more than one angle; only one joint "
            f'can have a list of angles, pose={{"{name}": [0.0, 0.5]}}; for several joints give '
            f'a list of poses, pose=[{{"{name}": 0.0, ...}}, ...].'
        )
    return name, np.array([number(f"pose[{name!r}]", float(value), "rad") for value in values])


def _made(
    model: "mujoco.MjModel", each: list[Pose], fields: list[str], joint: str | None = None
) -> Poses:
    singles = single_joints(model)
    states = [state_at(model, pose, field)[0] for pose, field in zip(each, fields, strict=True)]
    for qpos, field in zip(states, fields, strict=True):
        check_pose(model, qpos, field)
    named = {str(name) for pose in each if isinstance(pose, Mapping) for name in pose}
    moved = [
        name
        for name, number_of_joint in singles.items()
        if name in named or _moves(model, states, number_of_joint)
    ]
    values = np.array(
        [[qpos[model.jnt_qposadr[singles[name]]] for name in moved] for qpos in states]
    ).reshape(len(each), len(moved))
    labels = [
        _label(model, pose, qpos, i)
        for i, (pose, qpos) in enumerate(zip(each, states, strict=True), 1)
    ]
    made = tuple(LabelledPose(*row) for row in zip(labels, each, states, strict=True))
    units = tuple("m" if is_slide(model, singles[name]) else "rad" for name in moved)
    return Poses(made, tuple(moved), units, locked(values), joint)


def _moves(model: "mujoco.MjModel", states: list[Array], joint: int) -> bool:
    """Whether a joint moves between some of the poses, and is no wheel."""
    place = model.jnt_qposadr[joint]
    values = [float(qpos[place]) for qpos in states]
    return max(values) - min(values) > MOVED and not is_cyclic(model, states[0], joint)


def _label(model: "mujoco.MjModel", pose: Pose, qpos: Array, place: int) -> str:
    """What a pose is called: joints with their values, or the keyframe's name."""
    if isinstance(pose, str):
        return pose
    if isinstance(pose, Integral):
        return str(model.key(int(pose)).name) or f"keyframe {pose}"
    singles = single_joints(model)
    if isinstance(pose, Mapping):
        joints = [str(name) for name in pose]
    else:
        changed = np.abs(qpos - np.asarray(model.qpos0)) > MOVED
        joints = [
            name
            for name, j in singles.items()
            if changed[model.jnt_qposadr[j]] and not is_cyclic(model, qpos, j)
        ]
        if len(joints) > NAMED:
            return f"pose {place}"
    values = (
        f"{name} {value_text(model, singles[name], float(qpos[model.jnt_qposadr[singles[name]]]))}"
        for name in joints
    )
    return ", ".join(values) or "rest"
