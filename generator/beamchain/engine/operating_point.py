"""The operating point of a linear model: a model made ready to linearise, its pose,
and the wheels that turn."""

import copy
from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from beamchain.checks import as_array, finite_array, number, of_type, unknown
from beamchain.engine.constraints import touching
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import mass_matrix
from beamchain.errors import InputError
from beamchain.mjcf.write import HINGE
from beamchain.ports.motions import Array

TURNED = 1.0  # rad by which a wheel is turned to see whether the mass matrix depends on its angle
CYCLIC = 1e-6  # relative change of the mass matrix below which it does not
ROUNDED = 9  # decimals of a joint's position as it is read, in degrees or metres
LIMITS = (
    "actuator_forcelimited",
    "actuator_actlimited",
    "jnt_actfrclimited",
    "tendon_actfrclimited",
)

Pose = Any  # str | int | array of positions | Mapping[str, float | array]
Positions = Callable[[Any], dict[str, Array]]  # of a model by pose
Rates = Mapping[str, float] | None  # of wheels, by joint [rad/s]


class OperatingPoint(NamedTuple):
    """A model made ready to linearise, its pose `(nq,)`, and the rates `(nv,)` of its
    wheels [rad/s]."""

    model: "mujoco.MjModel"
    qpos: Array
    qvel: Array

    def data(self) -> "mujoco.MjData":
        """Data at the point, in balance (what drags on turning wheels is made up for),
        `mj_forward` done."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = self.qpos
        data.qvel[:] = self.qvel
        mujoco.mj_forward(self.model, data)
        data.qfrc_applied[:] = -data.qfrc_smooth
        mujoco.mj_forward(self.model, data)
        return data


def rest_point(model: "mujoco.MjModel", qpos: Array | None = None) -> OperatingPoint:
    """A model at rest in a pose, the initial one where left out."""
    pose = np.array(model.qpos0 if qpos is None else qpos, dtype=np.float64)
    return OperatingPoint(model, pose, np.zeros(model.nv))


def poses(model: "mujoco.MjModel") -> dict[str, Array]:
    """Positions by pose: "rest", then keyframes by name or number."""
    out = {"rest": np.array(model.qpos0)}
    for k in range(model.nkey):
        out[model.key(k).name or f"number {k}"] = np.array(model.key_qpos[k])
    return out


def pose_words(pose: str) -> str:
    """What sentences call a pose of `poses`."""
    return "the rest pose" if pose == "rest" else f"the pose {pose!r}"


def poses_between(model: "mujoco.MjModel", share: float) -> dict[str, Array]:
    """Positions on the way from each pose to the next, at a share of it."""
    out: dict[str, Array] = {}
    for (before, start), (after, end) in pairwise(poses(model).items()):
        motion = np.zeros(model.nv)
        between = start.copy()
        mujoco.mj_differentiatePos(model, motion, 1.0, start, end)
        mujoco.mj_integratePos(model, between, motion, share)
        out[f"{share:.0%} of the way from {before} to {after}"] = between
    return out


def base_body(model: "mujoco.MjModel", body: int) -> int:
    """The body that carries everything: the farthest out from `body` towards the
    world that still moves."""
    top = int(model.body_weldid[body])
    while (parent := int(model.body_weldid[int(model.body_parentid[top])])) != 0:
        top = parent
    return top


def still_copy(model: "mujoco.MjModel") -> "mujoco.MjModel":
    """A copy in which nothing acts but springs, dampers and actuators without limits:
    no gravity, no medium, no contacts, no constraints."""
    out = copy.copy(model)
    flags = mujoco.mjtDisableBit
    out.opt.gravity[:] = 0.0
    out.opt.density = 0.0
    out.opt.viscosity = 0.0
    out.opt.disableflags |= int(flags.mjDSBL_CONTACT) | int(flags.mjDSBL_CONSTRAINT)
    # a force at its limit has no slope
    out.opt.disableflags |= int(flags.mjDSBL_CLAMPCTRL)
    for name in LIMITS:
        getattr(out, name)[:] = 0
    if hasattr(mujoco.mjtEnableBit, "mjENBL_SLEEP"):
        out.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    return out


def quiet_copy(model: "mujoco.MjModel") -> "mujoco.MjModel":
    """A still copy whose springs are slack in the pose of rest."""
    out = still_copy(model)
    out.qpos_spring[:] = out.qpos0
    out.tendon_lengthspring[:] = out.tendon_length0[:, None]
    return out


def operating_point(
    model: "mujoco.MjModel", pose: Pose = None, rates: Rates = None
) -> OperatingPoint:
    """The point that `pose` and `rates` of `plant` name, in a copy of the model without gravity,
    medium and constraints."""
    qpos, qvel = state_at(model, pose)
    if rates is not None:
        of_type("rates", rates, Mapping, 'speeds by joint: {"wheel": 300.0} in rad/s')
    for name, value in (rates or {}).items():
        rate = number(f"rates[{name!r}]", value, "rad/s")
        joint = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, str(name)))
        joint = joint if rate == 0.0 and joint >= 0 else _joint(model, "rates", str(name))
        qvel[model.dof_jntid == joint] = rate
    check_pose(model, qpos)
    ready = quiet_copy(model)
    free = np.flatnonzero(ready.jnt_type == 0)
    for joint in free:
        # a craft that drifts is the same craft
        qvel[int(ready.jnt_dofadr[joint]) + np.arange(3)] = 0.0
    if free.size == 1:  # where in space makes no difference, but a far place costs digits
        qpos[int(ready.jnt_qposadr[free[0]]) + np.arange(3)] = 0.0
    _check_rates(ready, qpos, qvel)
    return OperatingPoint(ready, qpos, qvel)


def state_at(model: "mujoco.MjModel", pose: Pose, field: str = "pose") -> tuple[Array, Array]:
    """Positions `(nq,)` and rates `(nv,)` that `pose` of `plant`, here called `field`, names."""
    qpos = np.array(model.qpos0)
    qvel = np.zeros(model.nv)
    if isinstance(pose, str | int | np.integer):
        key = _keyframe(model, pose, field)
        qpos = np.array(model.key_qpos[key])
        qvel = np.array(model.key_qvel[key])
    elif isinstance(pose, Mapping):
        for name, value in pose.items():
            joint = _joint(model, field, str(name))
            unit = "m" if is_slide(model, joint) else "rad"
            qpos[model.jnt_qposadr[joint]] = number(f"{field}[{name!r}]", value, unit)
    elif pose is not None:
        wanted = f"qpos with shape ({model.nq},), finite, a keyframe's name, or angles by joint"
        given = as_array(field, pose, wanted)
        if given.shape != (model.nq,):
            raise InputError(f"{field} has the shape {given.shape}; give {wanted}.")
        qpos = finite_array(field, given)
    return qpos, qvel


def keyframe_names(model: "mujoco.MjModel") -> list[str]:
    """Names of the keyframes, empty where they have none."""
    return [str(model.key(k).name) for k in range(model.nkey)]


def _keyframe(model: "mujoco.MjModel", pose: "str | int | np.integer[Any]", field: str) -> int:
    names = keyframe_names(model)
    if isinstance(pose, str):
        if pose not in names:
            joint = pose if pose in single_joints(model) else "joint"
            raise unknown(field, pose, names, f"Or give angles by joint, {{{joint!r}: 0.5}}.")
        return names.index(pose)
    if isinstance(pose, bool) or not 0 <= int(pose) < model.nkey:
        raise InputError(
            f"{field} = {pose!r} is no keyframe; the model has {model.nkey}, numbered from 0."
        )
    return int(pose)


def single_joints(model: "mujoco.MjModel") -> dict[str, int]:
    """Numbers of the hinges and slides that have a name, by name."""
    singles = [j for j in range(model.njnt) if int(model.jnt_type[j]) >= 2]
    return {str(model.joint(j).name): j for j in singles if model.joint(j).name}


def is_slide(model: "mujoco.MjModel", joint: int) -> bool:
    """Whether a joint is a slide."""
    return int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_SLIDE)


def is_cyclic(model: "mujoco.MjModel", qpos: Array, joint: int) -> bool:
    """Whether a joint is the hinge of a balanced wheel: the mass matrix does not depend on its
    angle."""
    if int(model.jnt_type[joint]) != int(mujoco.mjtJoint.mjJNT_HINGE):
        return False
    turned = qpos.copy()
    turned[model.jnt_qposadr[joint]] += TURNED
    before = mass_matrix(model, qpos)
    size = np.sqrt(np.outer(np.diag(before), np.diag(before)))
    return bool(np.max(np.abs(mass_matrix(model, turned) - before) / size) < CYCLIC)


def _joint(model: "mujoco.MjModel", field: str, name: str) -> int:
    singles = single_joints(model)
    if name not in singles:
        own = [known for known in singles if not HINGE.fullmatch(known)]  # not those of chains
        actuators = [str(model.actuator(i).name) for i in range(model.nu)]
        cure = "It is an actuator; joints are meant." if name in actuators else ""
        raise unknown(f"joint of {field}", name, own, cure)
    return singles[name]


def value_text(model: "mujoco.MjModel", joint: int, value: float) -> str:
    """A joint's position as it is read: degrees of a hinge, metres of a slide."""
    if is_slide(model, joint):
        return f"{round(value, ROUNDED) + 0.0:.6g} m"
    return f"{round(float(np.degrees(value)), ROUNDED) + 0.0:.6g}°"


def check_pose(model: "mujoco.MjModel", qpos: Array, field: str = "pose") -> None:
    """Refuse a pose, here called `field`, that is out of a joint's range or in contact."""
    for j in np.flatnonzero(
        np.asarray(model.jnt_limited, dtype=bool) & (np.asarray(model.jnt_type) >= 2)
    ):
        value, (low, high) = float(qpos[model.jnt_qposadr[j]]), model.jnt_range[j]
        if not low <= value <= high:
            unit = "" if is_slide(model, int(j)) else " angles are in rad;"
            raise InputError(
                f"{field}: joint {model.joint(int(j)).name!r} = {value:g} is outside its range "
                f"[{low:g}, {high:g}];{unit} give one within it."
            )
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    for one, two in touching(model, data):
        raise InputError(
            f"{field}: {one!r} touches {two!r} in this pose, and a contact has no linear part; "
            "give another pose, or exclude the pair (<contact><exclude/>)."
        )


def _check_rates(model: "mujoco.MjModel", qpos: Array, qvel: Array) -> None:
    """Only what leaves the mass matrix as it is may turn."""
    for dof in np.flatnonzero(qvel):
        joint = int(model.dof_jntid[dof])
        if is_cyclic(model, qpos, joint):
            continue
        name = model.joint(joint).name or f"joint {joint}"
        raise InputError(
            f"pose: joint {name!r} moves at {qvel[dof]:g} in this state, and the plant would "
            f"change as it moves; only balanced wheels may turn; give rates={{{name!r}: 0.0}} to "
            "linearise at rest."
        )
