"""One uncertain number: how it is drawn, and what its draws write into the fields of a compiled
model.

A mode is its tendon: stiffness `w^2`, damping `2 zeta w`, and for a participation `p` times the
nominal one coefficients `b/p` and the armature `1 - p^2`, so that its modal mass stays 1 and its
length stays the modal amplitude.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from beamchain.engine.library import mujoco
from beamchain.engine.model_fields import OF_BODIES, DrawnFields, put_fields
from beamchain.engine.model_rows import wraps
from beamchain.engine.signals import AXES
from beamchain.errors import InputError
from beamchain.fitting.uncertain import OF_MODES, Correlation, Uncertainty, correlate, score
from beamchain.ports.motions import Array


@dataclass(frozen=True)
class Quantity:
    """One uncertain number of a craft.

    Args:
        name: `array_mode1_xy.frequency`, `bus.mass`, `bus.inertia_xy`, `drive.stiffness`,
            `array_segment1.stiffness`, `array_joint1.stiffness_xz`.
        unit: of its value; a participation is a factor, and so are stiffness and density of a
            segment.
        nominal: value in the model as it is.
        uncertainty: how it varies.
        index: number of the tendon, body or joint in the model; -1: of a structure,
            which is fitted again.
        key: quantities with the same one are drawn together.
        alias: another name, of a mode by its number among all that are kept,
            `array_mode3.frequency`.
    """

    name: str
    unit: str
    nominal: float
    uncertainty: Uncertainty
    index: int
    key: str
    alias: str = ""

    @property
    def owner(self) -> str:
        """Name of the tendon, body or joint."""
        return self.name.rpartition(".")[0]

    @property
    def kind(self) -> str:
        """`frequency`, `damping`, `participation`, `mass`, `centre_x`, `inertia_xy`,
        `stiffness`, ..."""
        return self.name.rpartition(".")[2]

    def of_mode(self, model: "mujoco.MjModel") -> bool:
        """Whether it is one of a mode, whose tendon has its owner's name."""
        return (
            self.kind in OF_MODES
            and self.index < model.ntendon
            and model.tendon(self.index).name == self.owner
        )

    @property
    def reach(self) -> float:
        """How far from the nominal value it may come."""
        return self.uncertainty.reach(self.nominal)

    def write(self, fields: DrawnFields, values: Array) -> None:
        """Write its value in every draw, `(k,)`, into the fields of a model that is not timed."""
        if self.of_mode(fields.model):
            _write_mode(fields, self.index, self.kind, values)
        elif self.kind == "stiffness":
            fields["jnt_stiffness"][:, self.index] = values
        elif self.kind == "damping":
            fields["dof_damping"][:, fields.model.jnt_dofadr[self.index]] = values
        elif self.kind == "mass":
            fields["body_mass"][:, self.index] = values
        elif self.kind.startswith("centre"):
            fields["body_ipos"][:, self.index, AXES.index(self.kind[-1])] = values
            fields["body_sameframe"][:, self.index] = 0  # MuJoCo would pass over the new centre
        else:
            i, j = (AXES.index(axis) for axis in self.kind[-2:])
            _write_inertia(fields, self.index, (i, j), values)


def _write_mode(fields: DrawnFields, tendon: int, kind: str, values: Array) -> None:
    stiffness, damping = (fields[f"tendon_{name}"] for name in ("stiffness", "damping"))
    w = np.sqrt(stiffness[:, tendon])
    if kind == "frequency":
        stiffness[:, tendon] = values**2
        damping[:, tendon] *= values / w
    elif kind == "damping":
        damping[:, tendon] = 2.0 * values * w
    else:
        fields["wrap_prm"][:, list(wraps(fields.model, tendon))] /= values[:, None]
        fields["tendon_length0"][:, tendon] /= values
        fields["tendon_lengthspring"][:, tendon] /= values[:, None]
        for name in ("tendon_armature", "tendon_margin"):
            fields[name][:, tendon] = 1.0 - values**2


def _write_inertia(fields: DrawnFields, body: int, at: tuple[int, int], values: Array) -> None:
    """One element of the inertia about the mass centre, in the body's axes."""
    turn = Rotation.from_quat(fields["body_iquat"][:, body], scalar_first=True).as_matrix()
    inertia = (turn * fields["body_inertia"][:, body, None, :]) @ np.swapaxes(turn, 1, 2)
    inertia[:, at[0], at[1]] = inertia[:, at[1], at[0]] = values
    moments, axes = np.linalg.eigh(inertia)
    axes[:, :, 2] *= np.sign(np.linalg.det(axes))[:, None]
    fields["body_inertia"][:, body] = moments
    fields["body_iquat"][:, body] = Rotation.from_matrix(axes).as_quat(scalar_first=True)
    fields["body_sameframe"][:, body] = 0  # MuJoCo would pass over the new axes


def drawn_fields(
    model: "mujoco.MjModel", uncertain: Sequence[Quantity], values: Array
) -> DrawnFields:
    """The fields of a model that is not timed with values `(k, n)` of quantities."""
    fields = DrawnFields(model, len(values))
    for quantity, column in zip(uncertain, np.transpose(values), strict=True):
        quantity.write(fields, column)
    for body in {q.index for q in uncertain if q.kind.startswith("inertia")}:
        a, b, c = fields["body_inertia"][:, body].T
        if wrong := np.flatnonzero((a <= 0.0) | (c > (a + b) * (1.0 + 1e-9))).tolist():
            raise InputError(
                f"body {model.body(body).name!r} has principal moments "
                f"{fields['body_inertia'][wrong[0], body]} kg m^2, which no body has."
            )
    return fields


def apply(model: "mujoco.MjModel", uncertain: Sequence[Quantity], values: Array) -> None:
    """Write values `(n,)` of quantities into a model that is not timed, in place."""
    fields = drawn_fields(model, uncertain, np.asarray(values, dtype=np.float64)[None])
    put_fields(model, {name: rows[0] for name, rows in fields.items()})
    if not fields.keys().isdisjoint(OF_BODIES):
        mujoco.mj_setConst(model, mujoco.MjData(model))


def names_to_places(uncertain: Sequence[Quantity]) -> dict[str, int]:
    """Numbers of the quantities by their names, and by their other names."""
    names = {q.name: i for i, q in enumerate(uncertain)}
    aliases = {q.alias: i for i, q in enumerate(uncertain)}
    return aliases | names


def draws(
    uncertain: Sequence[Quantity],
    indices: Sequence[int],
    seed: int,
    correlations: Sequence[Correlation],
) -> Array:
    """`(k, n)` values of the quantities in the samples `indices`;
    a sample depends on nothing but seed and index."""
    keys = dict.fromkeys(q.key for q in uncertain)
    scores: Mapping[str, Array] = {
        key: np.array([score(seed, index, key) for index in indices]) for key in keys
    }
    table = np.array([scores[q.key] for q in uncertain]).reshape(len(uncertain), len(indices)).T
    table = correlate(table, names_to_places(uncertain), tuple(correlations))
    values = [q.uncertainty.value(q.nominal, z) for q, z in zip(uncertain, table.T, strict=True)]
    return np.array(values).reshape(len(uncertain), len(indices)).T
