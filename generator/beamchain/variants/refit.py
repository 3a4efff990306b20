"""An appendage of a compiled craft fitted again with its structure drawn, on the nominal cut,
and put into the model."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from msgspec import structs

from beamchain.craft.appendage import compiled_alone
from beamchain.craft.timing import fit_on_tendons
from beamchain.engine.library import mujoco
from beamchain.engine.model_rows import wraps
from beamchain.errors import RealisationError
from beamchain.fitting.options import Modes
from beamchain.fitting.quantity import Quantity
from beamchain.fitting.result import Fit
from beamchain.fitting.varied import structural_quantities, varied_fit
from beamchain.ports.motions import Array

KINDS = {"body": "nbody", "joint": "njnt", "site": "nsite", "tendon": "ntendon"}
#: Fields that a fit decides, per kind of element.
FITTED = {
    "body": ("body_mass", "body_inertia", "body_ipos", "body_iquat", "body_sameframe", "body_pos"),
    "joint": ("jnt_stiffness",),
    "site": ("site_pos",),
    "tendon": (
        "tendon_stiffness",
        "tendon_damping",
        "tendon_armature",
        "tendon_length0",
        "tendon_lengthspring",
    ),
}


@dataclass(frozen=True, eq=False)
class Refit:
    """An appendage whose structure is uncertain: the prefix of its elements in the craft, its
    nominal fit, in whose specification modes and target are stated, and what tells its draws from
    those of other appendages.
    """

    prefix: str
    fit: Fit
    owner: str

    @classmethod
    def of(cls, prefix: str, fit: Fit, owner: str) -> "Refit":
        """The refit of a nominal fit: its modes are no longer chosen."""
        root = structs.replace(fit.spec.root, target=fit.kept_for)
        return cls(
            prefix,
            replace(fit, spec=structs.replace(fit.spec, modes=Modes(**fit.kept.counts), root=root)),
            owner,
        )

    def into(self, model: "mujoco.MjModel", draw: Sequence[float]) -> Mapping[str, Array]:
        """Put a draw into an untimed model of the craft, in place;
        the participation of its modes per port."""
        sample = varied_fit(self.fit, draw)
        if any(tendon.stiffness > 0.0 for tendon in self.fit.chain.tendons):
            sample = fit_on_tendons(sample)
        alone = compiled_alone(sample)
        if _topology(alone) != self._nominal_topology:
            raise RealisationError(
                "its hinges or bodies come in another order than the nominal model's"
            )
        start = f"{self.fit.spec.name}_"
        for kind, fields in FITTED.items():
            for i, name in enumerate(_names(alone, kind)):
                if not name.startswith(start):
                    continue
                j = int(getattr(model, kind)(self.prefix + name.removeprefix(start)).id)
                for field in fields:
                    if field != "body_pos" or name != f"{start}link1":  # where the craft carries it
                        getattr(model, field)[j] = getattr(alone, field)[i]
                if kind == "joint":
                    damping = alone.dof_damping[alone.jnt_dofadr[i]]
                    model.dof_damping[model.jnt_dofadr[j]] = damping
                elif kind == "tendon":
                    for there, here in zip(wraps(model, j), wraps(alone, i), strict=True):
                        model.wrap_prm[there] = alone.wrap_prm[here]
        return {
            port: sample.chain.port(port).participation[: target.modes]
            for port, target in self.fit.target.items()
        }

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """The numbers of the structure that are drawn."""
        return structural_quantities(self.fit.spec, self.prefix, self.owner)

    @cached_property
    def _nominal_topology(self) -> dict[str, list[str]]:
        return _topology(compiled_alone(self.fit))


def _topology(model: "mujoco.MjModel") -> dict[str, list[str]]:
    """Names of all elements, per kind."""
    return {kind: _names(model, kind) for kind in KINDS}


def _names(model: "mujoco.MjModel", kind: str) -> list[str]:
    return [str(getattr(model, kind)(i).name) for i in range(int(getattr(model, KINDS[kind])))]
