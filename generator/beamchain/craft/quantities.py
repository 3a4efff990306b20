"""The uncertain quantities of a compiled craft: which they are, and their nominal values."""

import re
from collections.abc import Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from beamchain.checks import unknown
from beamchain.craft.plant_load import liquid_prefixes
from beamchain.engine.library import mujoco, rotation_matrix
from beamchain.engine.mount import held_joints
from beamchain.engine.signals import AXES
from beamchain.errors import InputError
from beamchain.fitting.quantity import Quantity, names_to_places
from beamchain.fitting.uncertain import (
    CUT,
    Correlation,
    UncertainBody,
    UncertainCraft,
    UncertainJoint,
    UncertainModes,
    Uncertainty,
)
from beamchain.ports.motions import Array
from beamchain.steps.modal import modal_tendons

MODE = re.compile(r"(.*?)(mode\d+(?:_(?:xy|xz|torsion|axial)\d*)?)$")
UNITS = {"mass": "kg", "centre": "m", "inertia": "kg m^2"}


def quantities(
    model: "mujoco.MjModel",
    uncertain: UncertainCraft | None,
    modes: Mapping[str, UncertainModes],
    correlations: Sequence[Correlation],
) -> tuple[Quantity, ...]:
    """The uncertain quantities of a compiled craft, timed or not.

    What `uncertain` says of an appendage goes before `modes`, those of the appendages' own
    specifications by prefix; `correlations` are further ones than those of `uncertain`.
    """
    given = uncertain or UncertainCraft()
    of_modes = {**modes, **given.appendage}
    out = [*_modes(model, of_modes, set(given.appendage))]
    modal = {int(i) for i in np.flatnonzero(np.any(modal_tendons(model).rows != 0.0, axis=0))}
    for name, body in given.body.items():
        out += _body(model, name, body, {int(model.dof_bodyid[i]) for i in modal})
    for name, joint in given.joint.items():
        if name in {str(model.joint(int(model.dof_jntid[i])).name) for i in modal}:
            raise InputError(
                f"joint {name!r} is a hinge of an appendage, sprung by its modes; give their "
                "frequency under [appendage.PREFIX] instead."
            )
        out += _joint(model, name, joint)
    every_correlation = (*correlations, *given.correlation)
    _check_correlations(out, [name for each in every_correlation for name in each.of])
    return tuple(out)


def _check_correlations(uncertain: Sequence[Quantity], correlated: Sequence[str]) -> None:
    """Each correlated quantity is there, normal, and drawn by itself."""
    places = names_to_places(uncertain)
    for name in correlated:
        if name not in places:
            raise unknown("of in correlation", name, [q.name for q in uncertain])
        q = uncertain[places[name]]
        if q.uncertainty.distribution != "normal":
            raise InputError(
                f"correlation: {name} is uniform; only normal quantities can be correlated."
            )
        if correlated.count(name) > 1:
            raise InputError(
                f"correlation: {name} stands in two correlations; write one with all that goes "
                "together."
            )
        if other := [o.name for o in uncertain if o.key == q.key and o is not q]:
            raise InputError(
                f"correlation: {name} is drawn together with {other[0]}, fully correlated; give "
                "each = true and no group, so that the matrix can say how they go together."
            )


def inertia_matrix(model: "mujoco.MjModel", body: int) -> Array:
    """`(3, 3)` inertia of a body about its mass centre, in the body's axes [kg m^2]."""
    turn = rotation_matrix(model.body_iquat[body])
    return np.asarray(turn @ np.diag(model.body_inertia[body]) @ turn.T, dtype=np.float64)


class _Mode(NamedTuple):
    """A kept mode of an appendage: `mode1_xy` by its port, `mode3` by its number among all."""

    name: str
    numbered: str
    tendon: int
    frequency: float
    damping: float

    @property
    def names(self) -> set[str]:
        """The names under which a specification may speak of it."""
        return {self.name, self.numbered}


def _kept_modes(model: "mujoco.MjModel") -> dict[str, list[_Mode]]:
    """The kept modes on tendons by the prefix of their appendage, numbered by frequency, as a file
    of modes numbers them, in the order of the tendons."""
    modal = modal_tendons(model)
    rows: dict[str, dict[str, int]] = {}
    for row, tendon in enumerate(modal.names):
        if match := MODE.fullmatch(tendon):
            prefix, name = match.groups()
            rows.setdefault(prefix, {})[name] = row
    out: dict[str, list[_Mode]] = {}
    for prefix, row_of in rows.items():
        by_frequency = sorted(row_of, key=lambda name: (modal.frequency[row_of[name]], name))
        numbered = {name: f"mode{k + 1}" for k, name in enumerate(by_frequency)}
        out[prefix] = []
        for name, row in row_of.items():
            omega = float(modal.frequency[row])
            ratio = float(modal.damping[row]) / (2.0 * omega)
            # where another mode has that name, the number means the other
            number = name if numbered[name] in row_of else numbered[name]
            out[prefix].append(_Mode(name, number, int(modal.index[row]), omega, ratio))
    return out


def _modes(
    model: "mujoco.MjModel", given: Mapping[str, UncertainModes], named: set[str]
) -> list[Quantity]:
    """The uncertain quantities of the modes of appendages; `given`: by prefix; `named`: prefixes
    that the craft's own table gives."""
    kept = _kept_modes(model)
    out: list[Quantity] = []
    for prefix, uncertain in given.items():
        if prefix not in kept and prefix in liquid_prefixes(model):
            raise InputError(
                f"{prefix!r} is the liquid of a tank, which is not varied; vary the thrust "
                "(+-20 % is +-10 % in frequency)."
            )
        if prefix not in kept:
            cure = (
                "Appendages are named by their prefix, and must have springs on modal tendons "
                '(springs = "modes" under [fit], or bc.embed with retime=True).'
            )
            raise unknown("appendage", prefix, kept, cure if prefix in named else "")
        _check_mode_names(prefix, uncertain, kept[prefix])
        for mode in kept[prefix]:
            out += _of_mode(prefix, mode, uncertain)
    return out


def _check_mode_names(prefix: str, uncertain: UncertainModes, kept: Sequence[_Mode]) -> None:
    """Every mode that is named there is a kept one; a number may be that of any."""
    numbers = {f"mode{k + 1}" for k in range(len(kept))}
    names = [mode.name for mode in kept]
    for table in uncertain.mode:
        if table.name not in numbers.union(names):
            raise unknown("mode", table.name, names, f"They are the kept modes of {prefix!r}.")


def _of_mode(prefix: str, mode: _Mode, uncertain: UncertainModes) -> list[Quantity]:
    """The uncertain quantities of one mode; its own table goes before what is said of all."""
    nominal = {"frequency": mode.frequency, "damping": mode.damping, "participation": 1.0}
    out: list[Quantity] = []
    for kind, value in nominal.items():
        own = _own_uncertainty(mode, uncertain, kind)
        uncertainty: Uncertainty | None = own or getattr(uncertain, kind)
        if uncertainty is None:
            continue
        name = f"{prefix}{mode.name}.{kind}"
        by_itself = own is not None or uncertainty.each
        quantity = Quantity(
            name=name,
            unit="rad/s" if kind == "frequency" else "",
            nominal=value,
            uncertainty=uncertainty,
            index=mode.tendon,
            key=uncertainty.group or (name if by_itself else f"{prefix}.{kind}"),
            alias=f"{prefix}{mode.numbered}.{kind}",
        )
        out.append(_in_range(quantity))
    return out


def _own_uncertainty(mode: _Mode, uncertain: UncertainModes, kind: str) -> Uncertainty | None:
    """What the table of this mode says of a quantity of it."""
    for table in uncertain.mode:
        uncertainty: Uncertainty | None = getattr(table, kind)
        if table.name in mode.names and uncertainty is not None:
            return uncertainty
    return None


def _in_range(q: Quantity, *, above_zero: bool = True) -> Quantity:
    """A quantity whose range does not lead through zero,
    as that of a damping ratio may reach it."""
    low = q.nominal - q.reach
    if q.uncertainty.relative is not None and q.nominal == 0.0:
        raise InputError(
            f"{q.name} is 0, of which a relative uncertainty leaves nothing; give absolute."
        )
    if above_zero and (low < 0.0 or (low == 0.0 and q.kind != "damping")):
        far = (
            f"{CUT:g} standard deviations"
            if q.uncertainty.distribution == "normal"
            else "half the width"
        )
        value = f"{q.name} = {q.nominal:.6g} {q.unit}".rstrip()
        raise InputError(
            f"{value} may fall to {low:.4g} ({far} below); give a smaller uncertainty, so that it "
            "stays above zero."
        )
    return q


def _body(
    model: "mujoco.MjModel", name: str, given: UncertainBody, modal: set[int]
) -> list[Quantity]:
    names = [str(model.body(b).name) for b in range(1, model.nbody)]
    if name not in names:
        raise unknown("body", name, names)
    body = names.index(name) + 1
    if body in modal:
        raise InputError(
            f"body {name!r} is a link of an appendage, whose modes would change with it; give "
            "density, lump or payload under [uncertain] of its specification instead."
        )
    inertia = inertia_matrix(model, body)
    centre = model.body_ipos[body]
    nominal = {"mass": float(model.body_mass[body])}
    nominal |= {f"centre_{a}": float(centre[i]) for i, a in enumerate(AXES)}
    nominal |= {
        f"inertia_{AXES[i]}{AXES[j]}": float(inertia[i, j]) for i in range(3) for j in range(i, 3)
    }
    out: list[Quantity] = []
    for kind, value in nominal.items():
        how: Uncertainty | None = getattr(given, kind)
        if how is None:
            continue
        if kind != "mass" and model.body_simple[body]:
            raise InputError(
                f"{kind} of body {name!r} cannot vary: the body floats alone, and its compiled "
                "model has no room for more than a diagonal mass matrix; give it a small child "
                "body, or leave it out."
            )
        signed = kind.startswith("centre") or kind in ("inertia_xy", "inertia_xz", "inertia_yz")
        if signed and how.relative is not None:
            raise InputError(
                f"{kind} of body {name!r} takes absolute only, for it may be zero; write absolute "
                "= 0.01."
            )
        full = f"{name}.{kind}"
        unit = UNITS[kind.partition("_")[0]]
        quantity = Quantity(full, unit, value, how, body, how.group or full)
        out.append(_in_range(quantity, above_zero=not signed))
    _check_inertia(name, inertia, out)
    return out


def _check_inertia(name: str, inertia: Array, uncertain: Sequence[Quantity]) -> None:
    """Whether a body stays one at every corner of the ranges of its inertia."""
    ranges = [
        (q, *(AXES.index(c) for c in q.kind[-2:]))
        for q in reversed(uncertain)
        if q.kind.startswith("inertia")
    ]
    for corner in product((-1.0, 1.0), repeat=len(ranges)):
        changed = inertia.copy()
        for side, (q, i, j) in zip(corner, ranges, strict=True):
            changed[i, j] = changed[j, i] = q.nominal + side * q.reach
        a, b, c = (float(v) for v in np.linalg.eigvalsh(changed))
        if a <= 0.0 or c > (a + b) * (1.0 + 1e-9):
            raise InputError(
                f"inertia of body {name!r}: at an end of the ranges its principal moments are "
                f"{a:.4g}, {b:.4g}, {c:.4g} kg m^2, which no body has (each at most the sum of the "
                "others); give smaller uncertainties."
            )


def _joint(model: "mujoco.MjModel", name: str, given: UncertainJoint) -> list[Quantity]:
    names = [str(model.joint(j).name) for j in range(model.njnt) if int(model.jnt_type[j]) >= 2]
    if name not in names:
        raise unknown("joint", name, names)
    joint = int(model.joint(name).id)
    units = ("N/m", "N s/m") if int(model.jnt_type[joint]) == 2 else ("N m/rad", "N m s/rad")
    values = float(model.jnt_stiffness[joint]), float(model.dof_damping[model.jnt_dofadr[joint]])
    out: list[Quantity] = []
    for kind, unit, value in zip(("stiffness", "damping"), units, values, strict=True):
        how: Uncertainty | None = getattr(given, kind)
        if how is not None and value == 0.0 and held_joints(model).get(joint) == "servo":
            raise InputError(
                f"joint {name!r} has no {kind} of its own, and what its servo has is not drawn "
                "here: leave it out, or give worlds.make the arrays actuator_gainprm and "
                "actuator_biasprm."
            )
        if how is not None:
            full = f"{name}.{kind}"
            out.append(_in_range(Quantity(full, unit, value, how, joint, how.group or full)))
    return out
