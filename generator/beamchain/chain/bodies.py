"""Rigid bodies in space: what a body's mass, centre and inertia can be, and how one is taken out of another.

A body is physical if and only if its pseudo-inertia `[[integral x x^T dm, m c], [m c^T, m]]` is positive semidefinite;
the triangle inequality of the principal inertias is the same statement. P. M. Wensing, S. Kim, J.-J. E. Slotine, Linear
matrix inequalities for physically consistent inertial parameter identification, IEEE RA-L 3 (2018) 60-67,
doi:10.1109/LRA.2017.2729659.
"""

from dataclasses import dataclass

import numpy as np

from beamchain.motion import Array, body_mass_matrix, locked


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid body.

    Args:
        mass: [kg].
        centre: `(3,)` about the port [m].
        spread: `(3, 3)` second moments of its mass about its centre, `integral x x^T dm` [kg m^2].
    """

    mass: float
    centre: Array
    spread: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", locked(self.centre))
        object.__setattr__(self, "spread", locked(self.spread))

    @property
    def inertia(self) -> Array:
        """`(3, 3)` about its centre [kg m^2]."""
        return np.trace(self.spread) * np.eye(3) - self.spread

    def mass_matrix(self) -> Array:
        """`(6, 6)` about the port."""
        return body_mass_matrix(self.mass, self.centre, self.inertia)

    def pseudo(self) -> Array:
        """`(4, 4)` pseudo-inertia about the port."""
        c = np.append(self.centre, 1.0)
        out = self.mass * np.outer(c, c)
        out[:3, :3] += self.spread
        return out

    def principal(self) -> tuple[Array, Array]:
        """Principal inertias `(3,)` that meet the triangle inequality in floating point, and their axes in columns."""
        values, axes = np.linalg.eigh(self.spread)
        values = np.maximum(values, FLAT * max(float(values[-1]), 0.0))
        if np.linalg.det(axes) < 0.0:
            axes[:, 0] = -axes[:, 0]
        a, b, c = values
        return np.array([b + c, a + c, a + b]), axes


FLAT = 1e-14  # of the largest second moment: thickness of a lamina, so that rounding cannot break the inequality


def from_mass_matrix(matrix: Array) -> tuple[Body, float]:
    """The body with a `(6, 6)` mass matrix, and how far the matrix is from a body's, relative."""
    mass = float(np.trace(matrix[:3, :3])) / 3.0
    coupling = (matrix[3:, :3] + matrix[:3, 3:].T) / 2.0 / mass
    centre = np.array(
        [coupling[2, 1] - coupling[1, 2], coupling[0, 2] - coupling[2, 0], coupling[1, 0] - coupling[0, 1]]
    )
    centre = centre / 2.0
    about = (matrix[3:, 3:] + matrix[3:, 3:].T) / 2.0
    spread = np.trace(about) / 2.0 * np.eye(3) - about - mass * np.outer(centre, centre)
    body = Body(mass, centre, spread)
    diagonal = np.diag(matrix)
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    return body, float(np.max(np.abs((matrix - body.mass_matrix()) / np.outer(scale, scale))))


def remainder(pseudo: Array, centre: Array, size: float, mass: float) -> tuple[Body, float, float]:
    """The body with a `(4, 4)` pseudo-inertia about the port, negative eigenvalues clipped.

    Args:
        pseudo: what is left of a body of the given mass.
        centre: `(3,)` of that body [m].
        size: its radius [m].
        mass: [kg].

    Returns:
        the body; its smallest eigenvalue before clipping, relative; how far clipping moved an entry, relative.
    """
    shift = np.eye(4)
    shift[:3, 3] = -centre
    scale = np.append(np.full(3, 1.0 / size), 1.0) / np.sqrt(mass)
    unit = (shift @ pseudo @ shift.T) * np.outer(scale, scale)
    values, vectors = np.linalg.eigh(unit)
    clipped = (vectors * np.clip(values, 0.0, None)) @ vectors.T
    back = clipped / np.outer(scale, scale)
    left = float(back[3, 3])
    own = back[:3, 3] / left if left > 1e-15 * mass else np.zeros(3)
    spread = back[:3, :3] - left * np.outer(own, own)
    return Body(max(left, 0.0), centre + own, spread), float(values[0]), float(np.max(np.abs(clipped - unit)))
