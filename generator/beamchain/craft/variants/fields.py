"""The fields of one compiled model that turn it into each of its variants, and how quickly they are made."""

import copy
from dataclasses import replace

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.engine.linearise import dense_mass
from beamchain.errors import RealisationError
from beamchain.ports.motions import Array
from beamchain.steps.forms import form2, form4
from beamchain.steps.modal import MadeFor, Modal, condensed, modal_tendons
from beamchain.steps.retime import retime, write_values

#: What `mj_setConst` derives from masses, places and lengths.
DERIVED = (
    "body_subtreemass", "body_invweight0", "dof_invweight0", "dof_M0", "tendon_length0", "tendon_lengthspring",
    "tendon_invweight0", "actuator_acc0",
)  # fmt: skip
#: What a draw changes itself, and what follows from it.
FIELDS = (
    "jnt_stiffness", "dof_damping", "body_mass", "body_inertia", "body_ipos", "body_iquat", "body_sameframe", "body_pos",
    "site_pos", "wrap_prm", "tendon_stiffness", "tendon_damping", "tendon_armature", "tendon_solimp_lim", "tendon_margin",
    *DERIVED,
)  # fmt: skip

SINGULAR = 1e-10  # relative: a mass matrix nearer to singular is none


class Maker:
    """Makes variants of a compiled model, timed as it is.

    Args:
        model: compiled, timed or not.
    """

    model: "mujoco.MjModel"
    data: "mujoco.MjData"

    def __init__(self, model: "mujoco.MjModel") -> None:
        self.model = copy.copy(model)
        self.mark: MadeFor | None = next((m for m in modal_tendons(model).made_for if m is not None), None)
        if self.mark is not None:
            retime(self.model, 0.0)
        self.data = mujoco.MjData(self.model)  # scratch: to allocate it takes longer than to use it
        mujoco.mj_setConst(self.model, self.data)
        self._modal = modal_tendons(self.model)
        self._margin = np.array(self.model.tendon_margin)

    def copy(self) -> "mujoco.MjModel":
        """The nominal model, not timed, for a draw."""
        return copy.copy(self.model)

    def mass(self, model: "mujoco.MjModel", *, refitted: bool = False) -> Array:
        """`(nv, nv)` mass matrix of a variant at rest, armature included.

        Args:
            model: the variant, not timed.
            refitted: it has other chains than the nominal one.

        Raises:
            RealisationError: a participation takes more mass than there is.
        """
        modal = modal_tendons(model) if refitted else self._drawn(model)
        margin = np.array(model.tendon_margin)[modal.index]
        model.tendon_armature[modal.index] -= margin  # so that MuJoCo never sees a mass matrix that is not positive
        mujoco.mj_resetData(model, self.data)
        mujoco.mj_forward(model, self.data)
        model.tendon_armature[modal.index] += margin
        mass = dense_mass(model, self.data) + (modal.rows.T * margin) @ modal.rows
        size = np.sqrt(np.diag(mass).clip(1e-300))
        if float(np.linalg.eigvalsh(mass / np.outer(size, size))[0]) < SINGULAR:
            raise RealisationError(
                "its participation takes more mass than the appendage has beside its modes; give a smaller uncertainty."
            )
        return mass

    def time(self, model: "mujoco.MjModel", mass: Array, *, refitted: bool = False) -> None:
        """Make an untimed variant exact in time as the nominal model is, in place, and derive what follows.

        Args:
            model: the variant.
            mass: `(nv, nv)` its mass matrix at rest.
            refitted: it has other chains than the nominal one.
        """
        if self.mark is not None and self.mark.form == 3:
            retime(model, self.mark.timestep, self.mark.integrator, form=3)
        elif self.mark is not None:  # what `retime` does, without reading the model anew
            modal = modal_tendons(model) if refitted else self._drawn(model)
            c, name, h = condensed(mass, modal.rows)[0], self.mark.integrator, self.mark.timestep
            plan = form2(modal, c, name, h)
            write_values(model, modal, form4(modal, c, name, h, plan) if self.mark.form == 4 else plan, self.mark)
        mujoco.mj_setConst(model, self.data)

    def _drawn(self, model: "mujoco.MjModel") -> Modal:
        """The modal tendons of a variant with the nominal chains, by the numbers that a draw changes."""
        modal, at = self._modal, self._modal.index
        scale = np.sqrt((1.0 - self._margin[at]) / (1.0 - np.asarray(model.tendon_margin)[at]))  # 1/p
        stiffness, damping = (np.array(field)[at] for field in (model.tendon_stiffness, model.tendon_damping))
        return replace(modal, rows=modal.rows * scale[:, None], stiffness=stiffness, damping=damping)
