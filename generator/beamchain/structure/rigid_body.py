"""Whether a mass matrix is that of a rigid body, and the rigid body that is nearest to it."""

import numpy as np
from scipy.sparse.csgraph import connected_components

from beamchain.ports.motions import PORT_MOTION, PORTS, Array

ROUNDING = 1e-14  # relative: what is left of no inertia


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


def realisable_body(mass: Array) -> Array:
    """The mass matrix `(6, 6)` of a rigid body nearest to a symmetric one, which a body can have:
    no principal inertia about its centre exceeds the sum of the other two, as rounding leaves that
    of a lamina."""
    nearest = nearest_body(mass)
    own = float(np.trace(mass[:3, :3])) / 3.0
    cross = nearest[3:, :3] / own
    values, axes = np.linalg.eigh(nearest[3:, 3:] + own * cross @ cross)
    lacking = max(values[2] - values[1] - values[0], 0.0) / 3.0
    nearest[3:, 3:] += lacking * (axes * [1.0, 1.0, -1.0]) @ axes.T
    return nearest


def within_body(participation: Array, mass: Array) -> Array:
    """The participation `(n, 6)` nearest to a given one whose effective masses a rigid mass
    `(6, 6)` holds: `L^T L <= M`."""
    scale = _scale(mass)
    values, axes = np.linalg.eigh(mass / np.outer(scale, scale))
    values, axes = values[values > ROUNDING], axes[:, values > ROUNDING]
    root = scale[:, None] * axes * np.sqrt(values)  # M = root root^T
    back = axes / np.sqrt(values) / scale[:, None]
    left, shares, right = np.linalg.svd(participation @ back, full_matrices=False)
    if np.all(shares <= 1.0):
        return participation
    return (left * np.minimum(shares, 1.0)) @ right @ root.T


def independent_ports(mass: Array, participation: Array, noise: float) -> tuple[Array, Array]:
    """Rigid mass `(6, 6)` and participation `(n, 6)` without what couples ports, where all of it
    lies below `noise`, relative to the rigid mass."""
    scale = _scale(mass)
    moves = np.array([np.sum(PORT_MOTION[port] ** 2, axis=1) for port in PORTS])
    strong = np.sqrt((participation / scale) ** 2 @ moves.T)
    felt = strong > noise
    coupled = moves @ (np.abs(mass / np.outer(scale, scale)) > noise) @ moves.T
    linked = (felt.T.astype(float) @ felt + coupled) > 0.0
    _, block = connected_components(linked, directed=False)
    of_motion = block[np.argmax(moves, axis=0)]
    of_mode = block[np.argmax(strong, axis=1)]
    together = of_motion[:, None] == of_motion
    return mass * together, participation * (of_mode[:, None] == of_motion)


def _scale(mass: Array) -> Array:
    """`(6,)` square roots of the masses that make motions comparable."""
    mean = float(np.trace(mass[:3, :3])) / 3.0
    turning = np.diag(mass)[3:]
    return np.sqrt(np.concatenate([[mean] * 3, np.where(turning > 0.0, turning, mean)]))
