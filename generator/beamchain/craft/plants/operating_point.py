"""The operating point of a plant: a model made ready to linearise, its pose, and the wheels that turn."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from beamchain.caution import Caution
from beamchain.checks import number, unknown
from beamchain.craft.assembly import quiet
from beamchain.craft.embedded import Embedded
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import compile_model, mass_matrix
from beamchain.errors import EngineError, InputError
from beamchain.ports.motions import Array

TURNED = 1.0  # rad by which a wheel is turned to see whether the mass matrix depends on its angle
CYCLIC = 1e-6  # relative change of the mass matrix below which it does not

At = Any  # str | int | array of positions | Mapping[str, float | array]
Rates = Mapping[str, float] | None  # of wheels, by joint [rad/s]


class OperatingPoint(NamedTuple):
    """A model prepared for linearising, its pose `(nq,)`, and the rates `(nv,)` of its wheels [rad/s]."""

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


def compiled_model(source: "Embedded | mujoco.MjSpec | mujoco.MjModel | str | Path") -> "mujoco.MjModel":
    """A compiled model from any of the things that `plant` takes; none of them is changed."""
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


def left_out(model: "mujoco.MjModel") -> list[str]:
    """Sentences on what the linear plant leaves out of a model."""
    gravity = bool(np.any(np.asarray(model.opt.gravity) != 0.0))
    medium = float(model.opt.density) > 0.0 or float(model.opt.viscosity) > 0.0
    found = (
        (gravity, "gravity", "the plant is one in free fall: the model's gravity is left out."),
        (medium, "medium", "the medium's density and viscosity are left out of the plant."),
        (model.neq, "equality", f"{model.neq} equality constraint(s) are left out of the plant."),
    )
    return [Caution(code, text) for there, code, text in found if there]


def grid_of(at: At) -> tuple[str, Array] | None:
    """The joint and its angles where `at` is a grid; None where it is one point."""
    given = at.items() if isinstance(at, Mapping) else ()
    many = {str(name): np.asarray(values, dtype=np.float64) for name, values in given if np.ndim(values) > 0}
    if not many:
        return None
    name, values = next(iter(many.items()))
    if len(many) > 1 or values.ndim != 1 or values.size == 0:
        raise InputError(
            f"at = {at!r:.80} gives {', '.join(many)} more than one angle; only one joint can have a list of angles, "
            f'at={{"{name}": [0.0, 0.5]}}.'
        )
    return name, np.array([number(f"at[{name!r}]", float(value), "rad") for value in values])


def operating_point(model: "mujoco.MjModel", at: At = None, rates: Rates = None) -> OperatingPoint:
    """The point that `at` and `rates` of `plant` name, in a copy of the model without gravity, medium and constraints."""
    qpos, qvel = np.array(model.qpos0), np.zeros(model.nv)
    if isinstance(at, str | int | np.integer):
        key = _keyframe(model, at)
        qpos, qvel = np.array(model.key_qpos[key]), np.array(model.key_qvel[key])
    elif isinstance(at, Mapping):
        for name, value in at.items():
            qpos[model.jnt_qposadr[_joint(model, "at", str(name))]] = number(f"at[{name!r}]", value, "rad")
    elif at is not None:
        qpos = np.array(at, dtype=np.float64)
        if qpos.shape != (model.nq,) or not np.all(np.isfinite(qpos)):
            raise InputError(
                f"at has the shape {qpos.shape}; give qpos with shape ({model.nq},), finite, a keyframe's name, or angles "
                "by joint."
            )
    for name, value in (rates or {}).items():
        rate = number(f"rates[{name!r}]", value, "rad/s")
        joint = int(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, str(name)))
        joint = joint if rate == 0.0 and joint >= 0 else _joint(model, "rates", str(name))
        qvel[model.dof_jntid == joint] = rate
    _check_pose(model, qpos)
    ready = quiet(model)
    ready.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
    for name in ("actuator_forcelimited", "actuator_actlimited", "jnt_actfrclimited", "tendon_actfrclimited"):
        getattr(ready, name)[:] = 0
    free = np.flatnonzero(ready.jnt_type == 0)
    for joint in free:
        qvel[int(ready.jnt_dofadr[joint]) + np.arange(3)] = 0.0  # a craft that drifts is the same craft
    if free.size == 1:  # where in space makes no difference, but a far place costs digits
        qpos[int(ready.jnt_qposadr[free[0]]) + np.arange(3)] = 0.0
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


def _joint(model: "mujoco.MjModel", field: str, name: str) -> int:
    singles = {str(model.joint(j).name): j for j in range(model.njnt) if int(model.jnt_type[j]) >= 2}
    if name not in singles:
        raise unknown(f"joint of {field}", name, singles)
    return singles[name]


def _check_pose(model: "mujoco.MjModel", qpos: Array) -> None:
    for j in np.flatnonzero(np.asarray(model.jnt_limited, dtype=bool) & (np.asarray(model.jnt_type) >= 2)):
        value, (low, high) = float(qpos[model.jnt_qposadr[j]]), model.jnt_range[j]
        if not low <= value <= high:
            raise InputError(
                f"at: joint {model.joint(int(j)).name!r} = {value:g} is outside its range [{low:g}, {high:g}]; angles are "
                "in rad; give one within it."
            )
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    for contact in (data.contact[i] for i in range(data.ncon)):
        if contact.dist <= 0.0:
            one, two = (model.geom(int(g)).name or model.body(int(model.geom_bodyid[g])).name for g in contact.geom)
            raise InputError(
                f"at: {one!r} touches {two!r} in this pose, and a contact has no linear part; give another pose, or exclude "
                "the pair (<contact><exclude/>)."
            )


def _check_rates(model: "mujoco.MjModel", qpos: Array, qvel: Array) -> None:
    """Only what leaves the mass matrix as it is may turn."""
    for dof in np.flatnonzero(qvel):
        joint = int(model.dof_jntid[dof])
        if int(model.jnt_type[joint]) == 3:
            turned = qpos.copy()
            turned[model.jnt_qposadr[joint]] += TURNED
            before = mass_matrix(model, qpos)
            size = np.sqrt(np.outer(np.diag(before), np.diag(before)))
            if np.max(np.abs(mass_matrix(model, turned) - before) / size) < CYCLIC:
                continue
        name = model.joint(joint).name or f"joint {joint}"
        raise InputError(
            f"at: joint {name!r} moves at {qvel[dof]:g} in this state, and the plant would change as it moves; only balanced "
            f"wheels may turn; give rates={{{name!r}: 0.0}} to linearise at rest."
        )
