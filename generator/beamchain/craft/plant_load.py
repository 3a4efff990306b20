"""A linear craft under its own load: gravity where its base is held, or the `ctrl` of a keyframe
that accelerates it. Its motion is expressed in axes that accelerate with a free base."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from beamchain.craft.linear_craft import LinearCraft, internal_stiffness
from beamchain.craft.mode_names import cantilever_names
from beamchain.engine.library import mujoco
from beamchain.engine.loaded import (
    Loading,
    key_number,
    load_at,
    loaded_linear,
    offset_cautions,
)
from beamchain.engine.model_rows import sprung
from beamchain.engine.operating_point import Pose, base_body, keyframe_names
from beamchain.errors import InputError
from beamchain.fitting.slosh import weightless
from beamchain.mjcf.write import HINGE
from beamchain.ports.motions import Array

TOPPLES = 1e-9  # of the stiffness of one coordinate: less is rounding


def hinge_dofs(model: "mujoco.MjModel") -> list[int]:
    """Degrees of freedom of the appendages' hinges, by their names."""
    names = (str(model.joint(int(j)).name) for j in model.dof_jntid)
    return [i for i, name in enumerate(names) if HINGE.fullmatch(name)]


def limp_hinges(model: "mujoco.MjModel") -> list[str]:
    """Names of the appendages' hinges that no spring holds: those of liquids."""
    held = set(sprung(model))
    joints = (int(model.dof_jntid[i]) for i in hinge_dofs(model))
    return [str(model.joint(j).name) for j in joints if j not in held]


def liquid_prefixes(model: "mujoco.MjModel") -> list[str]:
    """Prefixes of the liquids of a model."""
    return sorted({name.rpartition("hinge")[0] for name in limp_hinges(model)})


def limp_cautions(model: "mujoco.MjModel", why: str) -> list[str]:
    """That the liquids of a model hang limp, and `why`; empty where there are none."""
    tanks = [prefix.removesuffix("_") for prefix in liquid_prefixes(model)]
    return [weightless(f"{', '.join(tanks)}: {why}")] if tanks else []


def under_load(
    craft: LinearCraft, model: "mujoco.MjModel", pose: Pose
) -> tuple[LinearCraft, Loading]:
    """A craft of a compiled `model` at a pose under its own load, and that load."""
    dofs = hinge_dofs(model)
    base = _base(model, dofs)
    load = load_at(model, pose, base, float(model.body_subtreemass[base]))
    linear = loaded_linear(craft.linear, craft.point.model, craft.point.qpos, dofs, load)
    internal = internal_stiffness(linear.stiffness, load)
    check_standing(internal, load)
    names, rows = cantilever_names(craft.point.model, linear.mass, internal)
    changed = replace(craft, linear=linear, names=tuple(names), rows=rows, internal=internal)
    return changed, load


def thrust_cautions(model: "mujoco.MjModel", pose: Pose) -> list[str]:
    """That the thrust of a compiled `model` at a pose passes beside its centre of mass."""
    key = key_number(model, pose)
    if key is None:
        return []
    base = _base(model, hinge_dofs(model))
    return offset_cautions(model, key, base, model.key_qpos[key], keyframe_names(model)[key])


def _base(model: "mujoco.MjModel", dofs: Sequence[int]) -> int:
    """The body that carries the appendages, of which these are degrees of freedom."""
    bases = {base_body(model, int(model.dof_bodyid[i])) for i in dofs}
    if len(bases) != 1:
        raise InputError(
            f"loaded: the model has {len(bases) or 'no'} bases that carry appendages; a load is "
            "known on one: put appendages on one body with bc.embed."
        )
    return bases.pop()


def check_standing(stiffness: Array, load: Loading) -> None:
    """Refuse a load under which something topples."""
    size = np.sqrt(np.maximum(np.abs(np.diag(stiffness)), 1e-300))
    lowest = float(np.linalg.eigvalsh(stiffness / np.outer(size, size))[0])
    if lowest < -TOPPLES:
        raise InputError(
            f"loaded: {load.words} something of the spacecraft topples (its stiffness is "
            "negative): a liquid pressed away from its tank's bottom, or a loose joint that hangs "
            "upside down; turn the thrust, or hold that joint by a spring or a servo."
        )
