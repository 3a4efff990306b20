"""Rigid motions and normal modes of a craft, and their names: joints, and the appendages' cantilever modes."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, eigh, qr
from scipy.optimize import linear_sum_assignment

from beamchain.engine.library import mujoco
from beamchain.ports.motions import Array
from beamchain.steps.modal import FILLER, modal_tendons

SLACK = 1e-13  # relative: springs weaker than this hold nothing
HINGE = re.compile(r"(.+)_hinge\d+_(xy|xz|torsion|axial)$")


@dataclass(frozen=True, eq=False)
class NormalModes:
    """`q = rigid r + shapes eta`: `K rigid = 0`, modes of unit mass, free of the rigid motions.

    `rigid` `(nv, nr)` is 1 at its own degrees of freedom, `pivots`; `shapes` `(nv, nf)`, `frequency` ascending [rad/s].
    """

    rigid: Array
    pivots: tuple[int, ...]
    shapes: Array
    frequency: Array
    mass: Array

    def ordered(self, order: Sequence[int], signs: Array) -> "NormalModes":
        """The same with its modes in another order, with other signs."""
        pick = list(order)
        return NormalModes(self.rigid, self.pivots, self.shapes[:, pick] * signs, self.frequency[pick], self.mass)

    def transformation(self, activations: int) -> tuple[Array, Array]:
        """`(q, q', a)` of the coordinates `(r, w eta, r', eta', a)`, and back."""
        inertia = self.rigid.T @ self.mass @ self.rigid
        back = np.vstack([np.linalg.solve(inertia, self.rigid.T @ self.mass), self.shapes.T @ self.mass])
        there, w = np.hstack([self.rigid, self.shapes]), np.ones(back.shape[0])
        w[self.rigid.shape[1] :] = self.frequency
        eye = np.eye(activations)
        return block_diag(there / w, there, eye), block_diag(w[:, None] * back, back, eye)


def normal_modes(mass: Array, stiffness: Array) -> NormalModes:
    """The rigid motions and normal modes of `M q'' + K q = 0`."""
    diagonal = np.diag(stiffness)
    size = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    values, vectors = np.linalg.eigh(stiffness / np.outer(size, size))
    null = (vectors / size[:, None])[:, np.abs(values) <= SLACK * max(float(np.abs(values).max(initial=0.0)), 1e-300)]
    _, _, order = qr(null.T, pivoting=True, mode="economic")
    pivots = tuple(sorted(int(i) for i in order[: null.shape[1]]))
    rigid = null @ np.linalg.inv(null[list(pivots)]) if pivots else null
    rigid = np.where(np.abs(rigid) > 1e-12, rigid, 0.0)
    rest = [i for i in range(mass.shape[0]) if i not in pivots]
    free = np.eye(mass.shape[0])[:, rest]
    if pivots:
        free = free - rigid @ np.linalg.solve(rigid.T @ mass @ rigid, rigid.T @ mass[:, rest])
    if not rest:
        return NormalModes(rigid, pivots, free, np.zeros(0), mass)
    moving = free.T @ mass @ free
    springs = stiffness[np.ix_(rest, rest)]
    inverse, shapes = eigh((moving + moving.T) / 2.0, springs)  # inverse, so that low frequencies keep their digits
    inverse, shapes = inverse[::-1], shapes[:, ::-1]
    keep = inverse > 1e-15 * inverse[0]
    shapes = free @ (shapes[:, keep] / np.sqrt(inverse[keep]))
    leading = np.argmax(np.abs(shapes) * np.sqrt(np.diag(mass))[:, None], axis=0)
    signs = np.where(shapes[leading, np.arange(shapes.shape[1])] < 0.0, -1.0, 1.0)
    return NormalModes(rigid, pivots, shapes * signs, 1.0 / np.sqrt(inverse[keep]), mass)


def dof_names(model: "mujoco.MjModel") -> list[tuple[str, str]]:
    """Name and unit of every degree of freedom."""
    out: list[tuple[str, str]] = []
    free = int(np.sum(model.jnt_type == 0))
    for j in range(model.njnt):
        kind, name = int(model.jnt_type[j]), str(model.joint(j).name) or f"joint {j}"
        if kind == 0:
            own = f"{model.body(int(model.jnt_bodyid[j])).name}_" if free > 1 else ""
            parts = (("position", "m"), ("attitude", "rad"))
            out += [(f"{own}{part}_{axis}", unit) for part, unit in parts for axis in "xyz"]
        elif kind == 1:
            out += [(f"{name}_{axis}", "rad") for axis in "xyz"]
        else:
            out.append((name, "m" if kind == 2 else "rad"))
    return out


def cantilever_names(model: "mujoco.MjModel", mass: Array, stiffness: Array) -> tuple[list[str], Array]:
    """Names of the appendages' own modes (root held) and of other sprung joints, and `(c, nv)` what they take of a shape.

    What chiefly strains tendons that make up a chain's mass beyond its kept modes is named `filler`, not `mode`.
    The square of what a row takes of a shape is the strain energy in that mode or joint.
    """
    modal = modal_tendons(model)
    fillers = [i for i, name in enumerate(modal.names) if FILLER.search(name)]
    beyond = np.sqrt(modal.stiffness[fillers])[:, None] * modal.rows[fillers]
    parts: dict[str, list[tuple[int, str]]] = {}
    for i, j in enumerate(model.dof_jntid):
        if found := HINGE.fullmatch(str(model.joint(int(j)).name)):
            parts.setdefault(found[1], []).append((i, found[2]))
    names: list[str] = []
    rows: list[Array] = []
    for name, hinges in parts.items():
        dofs, ports = [dof for dof, _ in hinges], np.array([port for _, port in hinges])
        pick, counts = np.ix_(dofs, dofs), Counter[str]()
        _, shapes = eigh(mass[pick], stiffness[pick] + 1e-300 * np.eye(len(dofs)))
        for shape in shapes.T[::-1]:
            row = np.zeros(mass.shape[0])
            row[dofs] = stiffness[pick] @ shape  # shapes of unit strain energy
            share = np.abs(shape * row[dofs])
            port = max(dict.fromkeys(ports.tolist()), key=lambda port: float(share[ports == port].sum()))
            kind = "filler" if float(np.sum((beyond[:, dofs] @ shape) ** 2)) > 0.5 else "mode"
            counts[kind + port] += 1
            names.append(f"{name}_{kind}{counts[kind + port]}_{port}")
            rows.append(row)
    taken = {dof for hinges in parts.values() for dof, _ in hinges}
    for i, (name, _) in enumerate(dof_names(model)):
        if i not in taken and stiffness[i, i] > 0.0:
            names.append(name)
            rows.append(np.sqrt(stiffness[i, i]) * np.eye(mass.shape[0])[i])
    return names, np.array(rows).reshape(len(rows), mass.shape[0])


def mode_names(shapes: Array, names: Sequence[str], rows: Array) -> list[str]:
    """A name for every mode: that of the cantilever mode or joint which holds most of its strain energy, each once."""
    energy = (rows @ shapes) ** 2
    share = energy / np.maximum(energy.sum(axis=0), 1e-300)
    out = [f"mode{k + 1}" for k in range(shapes.shape[1])]
    for c, k in zip(*linear_sum_assignment(-share), strict=True):
        out[int(k)] = names[int(c)]
    return out
