"""What a value of an uncertain quantity changes in a compiled model, in place.

A mode is its tendon: stiffness `w^2`, damping `2 zeta w`, and for a participation `p` times the nominal one coefficients
`b/p` and the armature `1 - p^2`, so that its modal mass stays 1 and its length stays the modal amplitude.
"""

from collections.abc import Sequence

import numpy as np

from beamchain.craft.variants.quantities import AXES, Quantity, inertia_matrix
from beamchain.engine.forces import wraps
from beamchain.engine.library import mujoco
from beamchain.errors import InputError
from beamchain.fitting.uncertain import OF_MODES
from beamchain.ports.motions import Array
from beamchain.steps.modal import made_for
from beamchain.steps.retime import retime


def changed(model: "mujoco.MjModel", found: Sequence[Quantity], values: Array) -> "mujoco.MjModel":
    """A copy of a compiled model with other values of its uncertain quantities, retimed if it was timed.

    Args:
        model: compiled; `found` is of it.
        found: the quantities.
        values: `(n,)` one per quantity.

    Raises:
        InputError: the values make a mass matrix that no craft has.
    """
    import copy

    out = copy.copy(model)
    timing = [mark for mark in made_for(out) if mark is not None]
    if timing:
        retime(out, 0.0)
    apply(out, found, values)
    if timing:
        retime(out, timing[0].timestep, timing[0].integrator, form=timing[0].form)
    return out


def apply(
    model: "mujoco.MjModel", found: Sequence[Quantity], values: Array, data: "mujoco.MjData | None" = None
) -> None:
    """Write values `(n,)` of quantities into a model that is not timed, in place; `data` is scratch, made where left out."""
    bodies: dict[int, list[tuple[Quantity, float]]] = {}
    modes: dict[int, dict[str, float]] = {}
    for q, value in zip(found, np.asarray(values, dtype=np.float64).tolist(), strict=True):
        if q.kind in OF_MODES and q.index < model.ntendon and model.tendon(q.index).name == q.owner:
            modes.setdefault(q.index, {})[q.kind] = value
        elif q.kind == "stiffness":
            model.jnt_stiffness[q.index] = value
        elif q.kind == "damping":
            model.dof_damping[model.jnt_dofadr[q.index]] = value
        else:
            bodies.setdefault(q.index, []).append((q, value))
    for body, those in bodies.items():
        _body(model, body, those)
    if bodies:
        mujoco.mj_setConst(model, data or mujoco.MjData(model))
    for tendon, new in modes.items():
        _mode(model, tendon, new)


def _mode(model: "mujoco.MjModel", tendon: int, new: dict[str, float]) -> None:
    w = float(np.sqrt(model.tendon_stiffness[tendon]))
    ratio = float(model.tendon_damping[tendon]) / (2.0 * w)
    w, ratio, p = new.get("frequency", w), new.get("damping", ratio), new.get("participation", 1.0)
    model.tendon_stiffness[tendon], model.tendon_damping[tendon] = w**2, 2.0 * ratio * w
    if p != 1.0:
        for wrap in wraps(model, tendon):
            model.wrap_prm[wrap] /= p
        model.tendon_length0[tendon] /= p
        model.tendon_lengthspring[tendon] /= p
        model.tendon_armature[tendon] = model.tendon_margin[tendon] = 1.0 - p**2


def _body(model: "mujoco.MjModel", body: int, those: Sequence[tuple[Quantity, float]]) -> None:
    inertia = inertia_matrix(model, body)
    for q, value in those:
        if q.kind == "mass":
            model.body_mass[body] = value
        elif q.kind.startswith("centre"):
            model.body_ipos[body, AXES.index(q.kind[-1])] = value
        else:
            i, j = (AXES.index(axis) for axis in q.kind[-2:])
            inertia[i, j] = inertia[j, i] = value
    if any(q.kind != "mass" for q, _ in those):
        model.body_sameframe[body] = 0  # MuJoCo would pass over the new centre and axes
    if not any(q.kind.startswith("inertia") for q, _ in those):
        return
    moments, axes = np.linalg.eigh(inertia)
    if moments[0] <= 0.0 or moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-9):
        raise InputError(f"body {model.body(body).name!r} has principal moments {moments} kg m^2, which no body has.")
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    mujoco.mju_mat2Quat(model.body_iquat[body], axes.ravel())
    model.body_inertia[body] = moments
