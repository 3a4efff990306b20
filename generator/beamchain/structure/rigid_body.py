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
    relative to the diagonal."""
    mean = float(np.trace(mass[:3, :3])) / 3.0
    turning = np.diag(mass)[3:]
    scale = np.sqrt(np.concatenate([[mean] * 3, np.where(turning > 0.0, turning, mean)]))
    return float(np.max(np.abs((mass - nearest_body(mass)) / np.outer(scale, scale))))
