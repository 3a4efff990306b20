"""Names of a craft's normal modes: of joints, and of the appendages' cantilever modes."""

import re
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import linear_sum_assignment

from beamchain.engine.library import mujoco
from beamchain.engine.linear import coordinate_names
from beamchain.mjcf.write import HINGE
from beamchain.ports.motions import Array
from beamchain.steps.modal import FILLER, modal_tendons

OWN_MODE = re.compile(r"(.+)_(?:mode|filler)\d+_(xy|xz|torsion|axial)$")


def cantilever_names(
    model: "mujoco.MjModel", mass: Array, stiffness: Array
) -> tuple[list[str], Array]:
    """Names of the appendages' own modes (root held) and of other sprung joints,
    and `(c, nv)` what they take of a shape.

    What chiefly strains tendons that make up a chain's mass beyond its kept modes is named
    `filler`, not `mode`. The square of what a row takes of a shape is the strain energy in
    that mode or joint.
    """
    modal = modal_tendons(model)
    fillers = [i for i, name in enumerate(modal.names) if FILLER.search(name)]
    beyond = np.sqrt(modal.stiffness[fillers])[:, None] * modal.rows[fillers]
    parts: dict[str, list[tuple[int, str]]] = {}
    for i, j in enumerate(model.dof_jntid):
        if match := HINGE.fullmatch(str(model.joint(int(j)).name)):
            parts.setdefault(match[1], []).append((i, match[2]))
    names: list[str] = []
    rows: list[Array] = []
    for name, hinges in parts.items():
        dofs = [dof for dof, _ in hinges]
        ports = np.array([port for _, port in hinges])
        pick = np.ix_(dofs, dofs)
        counts = Counter[str]()
        _, shapes = eigh(mass[pick], stiffness[pick] + 1e-300 * np.eye(len(dofs)))
        for shape in shapes.T[::-1]:
            row = np.zeros(len(mass))
            row[dofs] = stiffness[pick] @ shape  # shapes of unit strain energy
            share = np.abs(shape * row[dofs])
            port = max(
                dict.fromkeys(ports.tolist()), key=lambda port: float(share[ports == port].sum())
            )
            kind = "filler" if float(np.sum((beyond[:, dofs] @ shape) ** 2)) > 0.5 else "mode"
            counts[kind + port] += 1
            names.append(f"{name}_{kind}{counts[kind + port]}_{port}")
            rows.append(row)
    of_appendages = {dof for hinges in parts.values() for dof, _ in hinges}
    for i, (name, _) in enumerate(coordinate_names(model)):
        if i not in of_appendages and stiffness[i, i] > 0.0:
            names.append(name)
            rows.append(np.sqrt(stiffness[i, i]) * np.eye(len(mass))[i])
    return names, np.array(rows).reshape(len(rows), len(mass))


def strain_shares(rows: Array, shapes: NDArray[Any]) -> Array:
    """`(c, n)` share of what each of `rows` `(c, nv)` takes in the strain energy of modes, whose
    shapes may be complex."""
    energy = np.abs(rows @ shapes) ** 2
    return energy / np.maximum(energy.sum(axis=0), 1e-300)


def strain_holders(names: Sequence[str], share: Array) -> dict[tuple[str, str], float]:
    """Share of the strain energy of a mode by appendage and the port in which it bends, and by
    joint and "spring"; `share` `(c,)`: of what `cantilever_names` names."""
    out: dict[tuple[str, str], float] = {}
    for name, value in zip(names, share.tolist(), strict=True):
        match = OWN_MODE.fullmatch(name)
        where = (match[1], match[2]) if match else (name, "spring")
        out[where] = out.get(where, 0.0) + value
    return out


def mode_names(shapes: Array, names: Sequence[str], rows: Array) -> list[str]:
    """A name for every mode: that of the cantilever mode or joint which holds most of its strain
    energy, each once."""
    share = strain_shares(rows, shapes)
    out = [f"mode{k + 1}" for k in range(shapes.shape[1])]
    for c, k in zip(*linear_sum_assignment(-share), strict=True):
        out[int(k)] = names[int(c)]
    return out
