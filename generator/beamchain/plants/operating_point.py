"""The operating point of a plant: a model made ready to linearise, its pose, and the wheels that turn."""

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from beamchain.caution import Caution
from beamchain.checks import number
from beamchain.craft.assembly import quiet
from beamchain.craft.embedded import Embedded
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import compile_model, dense_mass
from beamchain.engine.mount import JOINT_KINDS
from beamchain.errors import EngineError, InputError
from beamchain.ports.motions import Array

TURNED = 1.0  # rad by which a wheel is turned to see whether the mass matrix depends on its angle
CYCLIC = 1e-6  # relative change of the mass matrix below which it does not

At = Any  # str | int | array of positions | Mapping[str, float | array]


@dataclass(frozen=True, eq=False)
class OperatingPoint:
    """A pose at which a model is linearised.

    Args:
        model: prepared for linearising (`prepared`).
        qpos: `(nq,)` pose.
        qvel: `(nv,)` rates of the wheels [rad/s], zero elsewhere.
    """

    model: "mujoco.MjModel"
    qpos: Array
    qvel: Array

    def data(self) -> "mujoco.MjData":
        """Data at the point, in balance (what drags on turning wheels is made up for), `mj_forward` done."""
        data = mujoco.MjData(self.model)
        data.qpos[:], data.qvel[:] = self.qpos, self.qvel
        mujoco.mj_forward(self.model, data)
        data.qfrc_applied[:] = -data.qfrc_smooth
        mujoco.mj_forward(self.model, data)
        return data


def unknown(field: str, value: object, names: Iterable[str], cure: str = "") -> InputError:
    """The answer to a name that is none."""
    known = [name for name in names if name]
    near = difflib.get_close_matches(str(value), known, n=1, cutoff=0.5)
    return InputError(
        f"{field} = {value!r} is unknown; {f'did you mean {near[0]!r}? ' if near else ''}"
        f"choose from {', '.join(known) or 'none, for the model has none'}.{f' {cure}' if cure else ''}"
    )


def compiled_model(source: "Embedded | mujoco.MjSpec | mujoco.MjModel | str | Path") -> "mujoco.MjModel":
    """A compiled model from any of the things that `plant` takes; none of them is changed.

    Raises:
        InputError: there is no such file, or it is none of these things.
        EngineError: MuJoCo refuses the model.
    """
    if isinstance(source, Embedded):
        return source.model
    if isinstance(source, mujoco.MjSpec):
        try:
            return source.copy().compile()
        except ValueError as error:
            raise EngineError(f"MuJoCo refuses the model: {error}") from None
    if not isinstance(source, mujoco.MjModel | str | Path):
        raise InputError(
            f"model = {source!r:.60} is a {type(source).__name__}; give the path of an MJCF file, an MjSpec, an MjModel "
            "or what bc.embed returns."
        )
    return compile_model(source)


def prepared(model: "mujoco.MjModel") -> "mujoco.MjModel":
    """A copy without gravity, medium, contacts and constraints, its springs slack at rest and no input clamped."""
    out = quiet(model)
    out.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    out.actuator_forcelimited[:] = out.actuator_actlimited[:] = out.jnt_actfrclimited[:] = 0
    out.tendon_actfrclimited[:] = 0
    return out


def left_out(model: "mujoco.MjModel") -> list[str]:
    """Sentences on what the linear plant leaves out of a model."""
    out: list[str] = []
    if np.any(np.asarray(model.opt.gravity) != 0.0):
        out.append(Caution("gravity", "the plant is one in free fall: the model's gravity is left out."))
    if float(model.opt.density) > 0.0 or float(model.opt.viscosity) > 0.0:
        out.append(Caution("medium", "the medium's density and viscosity are left out of the plant."))
    if model.neq:
        out.append(Caution("equality", f"{model.neq} equality constraint(s) are left out of the plant."))
    return out


def grid_of(at: At) -> tuple[str, Array] | None:
    """The joint and its angles where `at` is a grid; None where it is one point.

    Raises:
        InputError: several joints have several angles.
    """
    if not isinstance(at, Mapping):
        return None
    many = {str(name): np.asarray(values, dtype=np.float64) for name, values in at.items() if np.ndim(values) > 0}
    if not many:
        return None
    name, values = next(iter(many.items()))
    if len(many) > 1 or values.ndim != 1 or values.size == 0:
        raise InputError(
            f"at = {at!r:.80} gives {', '.join(many)} more than one angle; only one joint can have a list of angles, "
            f'at={{"{name}": [0.0, 0.5]}}.'
        )
    for value in values:
        number(f"at[{name!r}]", float(value), "rad")
    return name, values


def operating_point(model: "mujoco.MjModel", at: At = None, rates: Mapping[str, float] | None = None) -> OperatingPoint:
    """The point that `at` and `rates` name in a model, prepared for linearising.

    Args:
        model: compiled.
        at: name or number of a keyframe, `(nq,)` positions, angles by joint, or None: the pose of rest.
        rates: of wheels, by joint [rad/s]; those of the keyframe where left out.

    Raises:
        InputError: there is no such keyframe or joint, a joint is outside its range, shapes touch, or something turns
            that would change the plant while it turns.
    """
    qpos, qvel = np.array(model.qpos0), np.zeros(model.nv)
    if isinstance(at, str | int | np.integer):
        key = _keyframe(model, at)
        qpos, qvel = np.array(model.key_qpos[key]), np.array(model.key_qvel[key])
    elif isinstance(at, Mapping):
        for name, value in at.items():
            joint = single_joint(model, "at", str(name))
            qpos[model.jnt_qposadr[joint]] = number(f"at[{name!r}]", value, "rad")
    elif at is not None:
        given = np.asarray(at, dtype=np.float64)
        if given.shape != (model.nq,) or not np.all(np.isfinite(given)):
            raise InputError(
                f"at has the shape {given.shape}; give qpos with shape ({model.nq},), finite, a keyframe's name, or angles "
                "by joint."
            )
        qpos = given.copy()
    for name, value in (rates or {}).items():
        rate = number(f"rates[{name!r}]", value, "rad/s")
        if rate == 0.0 and mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, str(name)) >= 0:
            qvel[np.flatnonzero(model.dof_jntid == model.joint(str(name)).id)] = 0.0
        else:
            qvel[model.jnt_dofadr[single_joint(model, "rates", str(name))]] = rate
    _check_pose(model, qpos)
    ready = prepared(model)
    free = np.flatnonzero(ready.jnt_type == 0)
    if free.size == 1:  # where in space makes no difference, but a far place costs digits
        qpos[int(ready.jnt_qposadr[free[0]]) : int(ready.jnt_qposadr[free[0]]) + 3] = 0.0
    for joint in free:
        qvel[int(ready.jnt_dofadr[joint]) : int(ready.jnt_dofadr[joint]) + 3] = 0.0
    _check_rates(ready, qpos, qvel)
    return OperatingPoint(ready, qpos, qvel)


def _keyframe(model: "mujoco.MjModel", at: "str | int | np.integer[Any]") -> int:
    names = [str(model.key(k).name) for k in range(model.nkey)]
    if isinstance(at, str):
        if at not in names:
            raise unknown("at", at, names, "Or give angles by joint.")
        return names.index(at)
    if isinstance(at, bool) or not 0 <= int(at) < model.nkey:
        raise InputError(f"at = {at!r} is no keyframe; the model has {model.nkey}, numbered from 0.")
    return int(at)


def single_joint(model: "mujoco.MjModel", field: str, name: str) -> int:
    """Number of a hinge or slide by its name."""
    joint = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name))
    if joint < 0 or int(model.jnt_type[joint]) < 2:
        singles = [str(model.joint(j).name) for j in range(model.njnt) if int(model.jnt_type[j]) >= 2]
        raise unknown(f"joint of {field}", name, singles)
    return joint


def _check_pose(model: "mujoco.MjModel", qpos: Array) -> None:
    for j in range(model.njnt):
        kind = JOINT_KINDS[int(model.jnt_type[j])]
        if bool(model.jnt_limited[j]) and kind in ("slide", "hinge"):
            value, (low, high) = float(qpos[model.jnt_qposadr[j]]), model.jnt_range[j]
            if not low <= value <= high:
                raise InputError(
                    f"at: joint {model.joint(j).name!r} = {value:g} is outside its range [{low:g}, {high:g}]; angles are "
                    "in rad; give one within it."
                )
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    for i in range(data.ncon):
        if data.contact[i].dist <= 0.0:
            one, two = (
                model.geom(int(g)).name or model.body(int(model.geom_bodyid[g])).name for g in data.contact[i].geom
            )
            raise InputError(
                f"at: {one!r} touches {two!r} in this pose, and a contact has no linear part; give another pose, or exclude "
                "the pair (<contact><exclude/>)."
            )


def _check_rates(model: "mujoco.MjModel", qpos: Array, qvel: Array) -> None:
    """Only what leaves the mass matrix as it is may turn."""
    data = mujoco.MjData(model)

    def mass(position: Array) -> Array:
        data.qpos[:] = position
        mujoco.mj_forward(model, data)
        return dense_mass(model, data)

    before = mass(qpos)
    for dof in np.flatnonzero(qvel):
        joint = int(model.dof_jntid[dof])
        name, turned = model.joint(joint).name or f"joint {joint}", qpos.copy()
        if int(model.jnt_type[joint]) == 3:
            turned[model.jnt_qposadr[joint]] += TURNED
            size = np.sqrt(np.outer(np.diag(before), np.diag(before)))
            if np.max(np.abs(mass(turned) - before) / size) < CYCLIC:
                continue
        raise InputError(
            f"at: joint {name!r} moves at {qvel[dof]:g} in this state, and the plant would change as it moves; only balanced "
            f"wheels may turn; give rates={{{name!r}: 0.0}} to linearise at rest."
        )
