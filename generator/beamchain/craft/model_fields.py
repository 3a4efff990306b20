"""The fields of one compiled model that turn it into each of its variants,
and what a draw writes into them.

A mode is its tendon: stiffness `w^2`, damping `2 zeta w`, and for a participation `p` times the
nominal one coefficients `b/p` and the armature `1 - p^2`, so that its modal mass stays 1 and its
length stays the modal amplitude.
"""

import copy
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from beamchain.craft.quantities import Quantity, inertia_matrix
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import dense_mass
from beamchain.engine.model_rows import wraps
from beamchain.engine.operating_point import poses
from beamchain.engine.signals import AXES
from beamchain.errors import InputError, RealisationError
from beamchain.ports.motions import Array
from beamchain.steps.forms import form2, form4
from beamchain.steps.modal import Modal, TimingMark, condensed_mass, modal_tendons
from beamchain.steps.retime import retime, retime_by, write_values
from beamchain.steps.step_map import motion_for

#: What `mj_setConst` derives from masses, places and lengths.
DERIVED = (
    "body_subtreemass",
    "body_invweight0",
    "dof_invweight0",
    "dof_M0",
    "tendon_length0",
    "tendon_lengthspring",
    "tendon_invweight0",
    "actuator_acc0",
)
#: What a draw changes itself, and what follows from it.
FIELDS = (
    "jnt_stiffness",
    "dof_damping",
    "body_mass",
    "body_inertia",
    "body_ipos",
    "body_iquat",
    "body_sameframe",
    "body_pos",
    "site_pos",
    "wrap_prm",
    "tendon_stiffness",
    "tendon_damping",
    "tendon_armature",
    "tendon_solimp_lim",
    "tendon_margin",
    *DERIVED,
)

SINGULAR = 1e-10  # relative: a mass matrix nearer to singular is none


class Maker:
    """Makes variants of a compiled model, timed as it is; `model` is the nominal one, not timed.

    `refitted`: variants have other chains than the nominal model.
    """

    def __init__(self, model: "mujoco.MjModel", *, refitted: bool) -> None:
        self.model: Any = copy.copy(model)
        self._refitted = refitted
        self.mark: TimingMark | None = next(
            (mark for mark in modal_tendons(model).made_for if mark is not None), None
        )
        if self.mark is not None:
            retime(self.model, 0.0)
        # scratch: to allocate it takes longer than to use it
        self.data: Any = mujoco.MjData(self.model)
        mujoco.mj_setConst(self.model, self.data)
        self._modal = modal_tendons(self.model)
        self._margin = np.array(self.model.tendon_margin)

    def mass(self, model: "mujoco.MjModel", qpos: Array | None = None) -> Array:
        """`(nv, nv)` mass matrix of an untimed variant in a pose, at rest where left out; armature
        included."""
        modal = self._drawn(model)
        margin = np.array(model.tendon_margin)[modal.index]
        # so that MuJoCo never sees a mass matrix that is not positive
        model.tendon_armature[modal.index] -= margin
        mujoco.mj_resetData(model, self.data)
        if qpos is not None:
            self.data.qpos[:] = qpos
        mujoco.mj_forward(model, self.data)
        model.tendon_armature[modal.index] += margin
        mass = dense_mass(model, self.data) + (modal.rows.T * margin) @ modal.rows
        size = np.sqrt(np.diag(mass).clip(1e-300))
        if float(np.linalg.eigvalsh(mass / np.outer(size, size))[0]) < SINGULAR:
            raise RealisationError(
                "its participation takes more mass than the appendage has beside its modes; give a "
                "smaller uncertainty."
            )
        return mass

    def time(self, model: "mujoco.MjModel", mass: Array) -> None:
        """Make an untimed variant of that mass matrix at rest exact in time as the nominal
        model is, in place."""
        if self.mark is not None and self.mark.form == 5:
            retime_by(5, model, self.mark.timestep, self.mark.integrator)
        elif self.mark is not None:  # what `retime` does, without reading the model anew
            modal = self._drawn(model)
            places = list(poses(model).values())
            masses = [mass, *(self.mass(model, qpos) for qpos in places[1:])]
            c = np.array([condensed_mass(each, modal.rows)[0] for each in masses])
            name = self.mark.integrator
            h = self.mark.timestep
            plan = form2(modal, c, name, h)
            if self.mark.form == 4:
                motions = [motion_for(model, h, name, qpos) for qpos in places]
                plan = form4(modal, c, name, h, plan, motions)
            write_values(model, modal, plan, self.mark)
        mujoco.mj_setConst(model, self.data)

    def _drawn(self, model: "mujoco.MjModel") -> Modal:
        """The modal tendons of a variant; with the nominal chains by the numbers
        that a draw changes."""
        if self._refitted:
            return modal_tendons(model)
        modal = self._modal
        at = modal.index
        # rows are b/p and the margin is 1 - p^2: the nominal p over that of the variant
        scale = np.sqrt((1.0 - self._margin[at]) / (1.0 - np.asarray(model.tendon_margin)[at]))
        return replace(
            modal,
            rows=modal.rows * scale[:, None],
            stiffness=np.array(model.tendon_stiffness)[at],
            damping=np.array(model.tendon_damping)[at],
        )


def apply(
    model: "mujoco.MjModel",
    uncertain: Sequence[Quantity],
    values: Array,
    data: "mujoco.MjData | None" = None,
) -> None:
    """Write values `(n,)` of quantities into a model that is not timed, in place; `data` is
    scratch, made where left out."""
    bodies: dict[int, list[tuple[Quantity, float]]] = {}
    modes: dict[int, dict[str, float]] = {}
    for q, value in zip(uncertain, np.asarray(values, dtype=np.float64).tolist(), strict=True):
        if q.of_mode(model):
            modes.setdefault(q.index, {})[q.kind] = value
        elif q.kind == "stiffness":
            model.jnt_stiffness[q.index] = value
        elif q.kind == "damping":
            model.dof_damping[model.jnt_dofadr[q.index]] = value
        else:
            bodies.setdefault(q.index, []).append((q, value))
    for body, changes in bodies.items():
        _set_body(model, body, changes)
    if bodies:
        mujoco.mj_setConst(model, data or mujoco.MjData(model))
    for tendon, new in modes.items():
        _set_mode(model, tendon, new)


def _set_mode(model: "mujoco.MjModel", tendon: int, new: dict[str, float]) -> None:
    w = float(np.sqrt(model.tendon_stiffness[tendon]))
    ratio = float(model.tendon_damping[tendon]) / (2.0 * w)
    w = new.get("frequency", w)
    ratio = new.get("damping", ratio)
    p = new.get("participation", 1.0)
    model.tendon_stiffness[tendon] = w**2
    model.tendon_damping[tendon] = 2.0 * ratio * w
    if p != 1.0:
        for wrap in wraps(model, tendon):
            model.wrap_prm[wrap] /= p
        model.tendon_length0[tendon] /= p
        model.tendon_lengthspring[tendon] /= p
        model.tendon_armature[tendon] = model.tendon_margin[tendon] = 1.0 - p**2


def _set_body(
    model: "mujoco.MjModel", body: int, changes: Sequence[tuple[Quantity, float]]
) -> None:
    inertia = inertia_matrix(model, body)
    for q, value in changes:
        if q.kind == "mass":
            model.body_mass[body] = value
        elif q.kind.startswith("centre"):
            model.body_ipos[body, AXES.index(q.kind[-1])] = value
        else:
            i, j = (AXES.index(axis) for axis in q.kind[-2:])
            inertia[i, j] = inertia[j, i] = value
    if any(q.kind != "mass" for q, _ in changes):
        model.body_sameframe[body] = 0  # MuJoCo would pass over the new centre and axes
    if not any(q.kind.startswith("inertia") for q, _ in changes):
        return
    moments, axes = np.linalg.eigh(inertia)
    if moments[0] <= 0.0 or moments[2] > (moments[0] + moments[1]) * (1.0 + 1e-9):
        raise InputError(
            f"body {model.body(body).name!r} has principal moments {moments} kg m^2, which no body "
            "has."
        )
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    mujoco.mju_mat2Quat(model.body_iquat[body], axes.ravel())
    model.body_inertia[body] = moments
