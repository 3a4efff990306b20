"""Whether a mass matrix is that of a rigid body, and the rigid body that is nearest to it."""

import numpy as np

from beamchain.ports.motions import Array


def nearest_body(mass: Array) -> Array:
    """The mass matrix `(6, 6)` of a rigid body nearest to a symmetric one: one mass in all
    directions, and a first moment whose matrix is antisymmetric."""
    moment = (mass[3:, :3] - mass[3:, :3].T) / 2.0
    alike = float(np.trace(mass[:3, :3])) / 3.0 * np.eye(3)
    return np.block([[alike, moment.T], [moment, mass[3:, 3:]]])


def body_departure(mass: Array) -> float:
    """How far a mass matrix `(6, 6)` is from a rigid body's: the largest entry of the difference,
    relative to the diagonal; infinite without mass."""
    if np.trace(mass[:3, :3]) <= 0.0:
        return float("inf")
    scale = _scale(mass)
    return float(np.max(np.abs((mass - nearest_body(mass)) / np.outer(scale, scale))))


def body_above(mass: Array) -> Array:
    """The mass matrix `(6, 6)` of a rigid body near to a symmetric one, and nowhere below it, so
    that it leaves modes their effective masses.

    The nearest body takes away up to `e` of the diagonal somewhere; a body on the root that has
    `e` of the diagonal gives it back.
    """
    scale = _scale(mass)
    nearest = nearest_body(mass)
    change = (nearest - mass) / np.outer(scale, scale)
    lacking = max(0.0, -float(np.linalg.eigvalsh(change)[0]))
    return nearest + lacking * np.diag(np.diag(nearest))


def _scale(mass: Array) -> Array:
    """`(6,)` square roots of the masses that make motions comparable."""
    mean = float(np.trace(mass[:3, :3])) / 3.0
    turning = np.diag(mass)[3:]
    return np.sqrt(np.concatenate([[mean] * 3, np.where(turning > 0.0, turning, mean)]))
