"""Rigid motions and normal modes of `M q'' + K q = 0`."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, eigh, qr

from beamchain.ports.motions import Array

SLACK = 1e-13  # relative: springs weaker than this hold nothing


@dataclass(frozen=True, eq=False)
class NormalModes:
    """`q = rigid r + shapes eta`: `K rigid = 0`, modes of unit mass, free of the rigid motions.

    `rigid` `(nv, nr)` is 1 at its own degrees of freedom, `pivots`; `shapes` `(nv, nf)`,
    `frequency` ascending [rad/s].
    """

    rigid: Array
    pivots: tuple[int, ...]
    shapes: Array
    frequency: Array
    mass: Array

    def ordered(self, order: Sequence[int], signs: Array) -> "NormalModes":
        """The same with its modes in another order, with other signs."""
        pick = list(order)
        return NormalModes(
            self.rigid, self.pivots, self.shapes[:, pick] * signs, self.frequency[pick], self.mass
        )

    def transformation(self, activations: int) -> tuple[Array, Array]:
        """`(q, q', a)` of the coordinates `(r, w eta, r', eta', a)`, and back."""
        inertia = self.rigid.T @ self.mass @ self.rigid
        back = np.vstack(
            [np.linalg.solve(inertia, self.rigid.T @ self.mass), self.shapes.T @ self.mass]
        )
        there = np.hstack([self.rigid, self.shapes])
        w = np.ones(back.shape[0])
        w[self.rigid.shape[1] :] = self.frequency
        eye = np.eye(activations)
        return block_diag(there / w, there, eye), block_diag(w[:, None] * back, back, eye)


def normal_modes(mass: Array, stiffness: Array) -> NormalModes:
    """The rigid motions and normal modes of `M q'' + K q = 0`."""
    diagonal = np.diag(stiffness)
    size = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    values, vectors = np.linalg.eigh(stiffness / np.outer(size, size))
    null = (vectors / size[:, None])[
        :, np.abs(values) <= SLACK * max(float(np.abs(values).max(initial=0.0)), 1e-300)
    ]
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
    # inverse, so that low frequencies keep their digits
    inverse, shapes = eigh((moving + moving.T) / 2.0, springs)
    inverse, shapes = inverse[::-1], shapes[:, ::-1]
    keep = inverse > 1e-15 * inverse[0]
    shapes = free @ (shapes[:, keep] / np.sqrt(inverse[keep]))
    leading = np.argmax(np.abs(shapes) * np.sqrt(np.diag(mass))[:, None], axis=0)
    signs = np.where(shapes[leading, np.arange(shapes.shape[1])] < 0.0, -1.0, 1.0)
    return NormalModes(rigid, pivots, shapes * signs, 1.0 / np.sqrt(inverse[keep]), mass)
