"""What makes the tendons of many draws of one model exact in time, in one array operation."""

import copy
from dataclasses import dataclass

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.engine.linearise import INTEGRATORS, mass_matrix
from beamchain.engine.model_fields import OF_BODIES, DrawnFields, put_fields
from beamchain.engine.operating_point import poses
from beamchain.ports.motions import Array
from beamchain.steps.forms import form2_many
from beamchain.steps.modal import (
    TREE,
    Modal,
    TimingMark,
    condensed_mass,
    modal_tendons,
    participating,
)
from beamchain.steps.retime import carries_bodies, coupled_mass, retime_by, without_timing
from beamchain.steps.tree_draws import DrawnTendons, TreeDraws


@dataclass(frozen=True, eq=False)
class DrawTiming:
    """Timing of draws of a model: every mode of the held appendages exact (form 2), or, where
    appendages carry bodies, the model's own timing carried over to the draws (form 5).

    Args:
        mark: step, integrator and form.
        modal: tendons of the model without timing.
        mass: `(p, 1, n, n)` their condensed mass at rest and every keyframe.
        tree: of form 5.
    """

    mark: TimingMark
    modal: Modal
    mass: Array
    tree: TreeDraws | None

    @classmethod
    def of(cls, model: "mujoco.MjModel", timestep: float, integrator: str) -> "DrawTiming":
        """For draws of a model, timed or not."""
        untimed = without_timing(model)
        modal = modal_tendons(untimed)
        mark = TimingMark(timestep, integrator, TREE)
        timed = model
        if mark not in modal_tendons(model).made_for:
            if not carries_bodies(untimed, modal, None):
                mass = coupled_mass(untimed, modal, None)[:, None]
                return cls(mark._replace(form=2), modal, mass, None)
            timed = copy.copy(untimed)
            retime_by(TREE, timed, timestep, integrator)
        return cls(mark, modal, np.zeros(0), TreeDraws.of(untimed, modal, timed, mark))

    def write(self, fields: DrawnFields, masses: Array | None = None) -> None:
        """Into the fields of draws without timing, marked as `retime` marks it; `masses`
        `(p, k, nv, nv)` of their bodies, where those are not the model's."""
        at = self.modal.index
        stiffness, damping = (fields[f"tendon_{name}"][:, at] for name in ("stiffness", "damping"))
        plan = self._plan(fields, stiffness, damping, masses)
        marks = fields["tendon_solimp_lim"]
        marks[:, at, 0] = self.mark.timestep
        marks[:, at, 1] = INTEGRATORS[self.mark.integrator]
        marks[:, at, 2] = self.mark.form + (plan.stiffness / stiffness - 1.0)
        marks[:, at, 3] = damping
        marks[:, at, 4] = stiffness
        fields["tendon_armature"][:, at] += plan.armature
        fields["tendon_stiffness"][:, at] = plan.stiffness
        fields["tendon_damping"][:, at] = plan.damping

    def _plan(
        self, fields: DrawnFields, stiffness: Array, damping: Array, masses: Array | None
    ) -> DrawnTendons:
        p = participation_of(fields, self.modal)
        if self.tree is not None:
            return self.tree.drawn(stiffness, damping, p)
        mass = self.mass if masses is None else condensed_mass(masses, self.modal.rows)[0]
        if np.any(p != 1.0):
            mass = np.array([participating(pose, p) for pose in mass])
        _, integrator, _ = self.mark
        plan = form2_many(integrator, mass, stiffness, damping, self.mark.timestep)
        return DrawnTendons(plan.mass - 1.0, stiffness, plan.damping)


def participation_of(fields: DrawnFields, modal: Modal) -> Array:
    """`(k, n)` of the modes over the nominal one; the margin of a tendon is `1 - p^2`."""
    if "tendon_margin" not in fields:
        return np.ones((fields.count, modal.index.size))
    nominal = np.asarray(fields.model.tendon_margin)
    drawn = fields["tendon_margin"]
    return np.sqrt((1.0 - drawn) / (1.0 - nominal))[:, modal.index]


def drawn_masses(fields: DrawnFields) -> Array:
    """`(p, k, nv, nv)` mass matrices of draws without timing and with the nominal participation,
    at rest and in every keyframe; `(p, 1, nv, nv)` where no body is drawn."""
    model = copy.copy(fields.model)
    places = poses(model).values()
    if fields.keys().isdisjoint(OF_BODIES):
        return np.array([mass_matrix(model, qpos) for qpos in places])[:, None]
    data = mujoco.MjData(model)
    masses: list[list[Array]] = []
    for i in range(fields.count):
        put_fields(model, {name: fields[name][i] for name in OF_BODIES if name in fields})
        mujoco.mj_setConst(model, data)
        masses.append([mass_matrix(model, qpos) for qpos in places])
    return np.swapaxes(np.array(masses), 0, 1)


def with_participation(mass: Array, rows: Array, participation: Array) -> Array:
    """`(nv, nv)` mass matrix of one draw whose modes, `rows` `(n, nv)`, take part by `(n,)` times
    as much as in `mass`:

        M + (P^-1 B)^T (1 - P^2) P^-1 B = M + B^T (P^-2 - 1) B
    """
    return mass + (rows.T * (1.0 / participation**2 - 1.0)) @ rows
