"""The motions of a root: the four ports in space, and what a rigid body weighs in them."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Quaternion = tuple[float, float, float, float]  # scalar first

UPRIGHT: Quaternion = (1.0, 0.0, 0.0, 0.0)  # not turned

PORTS = ("xy", "xz", "torsion", "axial")


def locked(values: ArrayLike) -> Array:
    """A read-only copy as float64, so that frozen objects really are."""
    result = np.array(values, dtype=np.float64)
    result.setflags(write=False)
    return result


#: Motion of the root in space (x, y, z, rotations about x, y, z) per unit of each port's
#: own motion. Plane xz uses the rotation about -y, so that a round beam has the same
#: numbers in both planes.
PORT_MOTION: dict[str, Array] = {
    "xy": locked(np.eye(6)[:, [1, 5]]),
    "xz": locked(np.eye(6)[:, [2, 4]] @ np.diag([1.0, -1.0]) + 0.0),
    "torsion": locked(np.eye(6)[:, [3]]),
    "axial": locked(np.eye(6)[:, [0]]),
}


def mean_mass(matrix: Array) -> float:
    """Mean over the three directions of the mass of a matrix `(6, 6)`."""
    return float(np.mean(np.diag(matrix)[:3]))


def square_root(matrix: Array, noise: float = 0.0) -> Array:
    """`R`, `R^T R = matrix`; eigenvalues below `noise` become zero."""
    values, vectors = np.linalg.eigh(matrix)
    kept = np.where(values > noise, values, 0.0)
    return np.sqrt(kept)[:, None] * vectors.T


def body_mass_matrix(mass: float, centre: Array, inertia: Array) -> Array:
    """`(6, 6)` about the origin; `inertia` `(3, 3)` is about the `centre` `(3,)`."""
    x, y, z = centre
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    moment = mass * cross
    second_moment = inertia - mass * cross @ cross
    return np.block([[mass * np.eye(3), -moment], [moment, second_moment]])


def first_moment(mass: Array) -> Array:
    """`(3,)` mass times mass centre, of a `(6, 6)` mass matrix about the origin."""
    return np.array([mass[1, 5], mass[2, 3], mass[0, 4]])


def system_matrix(stiffness: Array, damping: Array) -> Array:
    """`(2 n, 2 n)` of `q'' + D q' + K q = 0` in the states (q, q')."""
    n = stiffness.shape[0]
    return np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])


def offset_matrix(point: Array) -> Array:
    """`(6, 6)` motion of a body's point `(3,)` per motion of its origin."""
    x, y, z = point
    motion = np.eye(6)
    motion[:3, 3:] = [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]
    return motion
