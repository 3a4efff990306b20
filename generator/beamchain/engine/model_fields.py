"""The fields of one compiled model that turn it into each of many draws of it."""

import copy
from collections.abc import Mapping, Sequence

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.ports.motions import Array

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
#: Those of them that the masses of bodies are made of.
OF_BODIES = ("body_mass", "body_inertia", "body_ipos", "body_iquat", "body_sameframe")


class DrawnFields(dict[str, Array]):
    """Fields `(k, ...)` of a compiled model in k draws, by MuJoCo's names; those that are not
    there yet are the model's own."""

    def __init__(self, model: "mujoco.MjModel", count: int) -> None:
        super().__init__()
        self.model = model
        self.count = count

    def __missing__(self, name: str) -> Array:
        own = np.asarray(getattr(self.model, name))
        self[name] = np.repeat(own[None], self.count, axis=0)
        return self[name]

    def of(self, draw: int) -> dict[str, Array]:
        """The fields of one draw."""
        return {name: values[draw] for name, values in self.items()}

    def of_draws(self, which: Sequence[int]) -> "DrawnFields":
        """The fields of some draws."""
        out = DrawnFields(self.model, len(which))
        out.update({name: values[list(which)] for name, values in self.items()})
        return out


def put_fields(model: "mujoco.MjModel", values: Mapping[str, Array]) -> None:
    """Write one draw's fields into a model."""
    for name, value in values.items():
        getattr(model, name)[:] = value


def with_fields(model: "mujoco.MjModel", values: Mapping[str, Array]) -> "mujoco.MjModel":
    """A copy of a model with one draw's fields."""
    out = copy.copy(model)
    put_fields(out, values)
    return out
