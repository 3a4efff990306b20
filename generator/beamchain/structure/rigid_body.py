"""Whether a mass matrix is that of a rigid body, and the rigid body that is nearest to it."""

import numpy as np
from scipy.optimize import nnls
from scipy.sparse.csgraph import connected_components

from beamchain.ports.motions import PORT_MOTION, PORTS, Array, mean_mass

ROUNDING = 1e-14  # relative: what is left of no inertia


def nearest_body(mass: Array) -> Array:
    """The mass matrix `(6, 6)` of a rigid body nearest to a symmetric one: one mass in all
    directions, and a first moment whose matrix is antisymmetric."""
    moment = (mass[3:, :3] - mass[3:, :3].T) / 2.0
    alike = mean_mass(mass) * np.eye(3)
    return np.block([[alike, moment.T], [moment, mass[3:, 3:]]])


def body_departure(mass: Array) -> float:
    """How far a mass matrix `(6, 6)` is from a rigid body's: the largest entry of the difference,
    relative to the diagonal; infinite without mass."""
    if mean_mass(mass) <= 0.0:
        return float("inf")
    scale = _scale(mass)
    return float(np.max(np.abs((mass - nearest_body(mass)) / np.outer(scale, scale))))


def realisable_body(mass: Array) -> Array:
    """The mass matrix `(6, 6)` of a rigid body nearest to a symmetric one, which a body can have:
    no principal inertia about its centre exceeds the sum of the other two, as rounding leaves that
    of a lamina or of a rod."""
    nearest = nearest_body(mass)
    own = mean_mass(mass)
    cross = nearest[3:, :3] / own
    values, axes = np.linalg.eigh(nearest[3:, 3:] + own * cross @ cross)
    if 2.0 * values[2] > np.sum(values):
        # principal inertias I = (1 - E) e of second moments e >= 0
        of_moments = 1.0 - np.eye(3)
        moments, _ = nnls(of_moments, values)
        nearest[3:, 3:] += (axes * (of_moments @ moments - values)) @ axes.T
    return nearest


def within_body(participation: Array, mass: Array, room: float) -> Array:
    """The participation `(n, 6)` nearest to a given one of whose effective masses a rigid mass
    `(6, 6)` leaves a share: `L^T L <= (1 - room) M`."""
    scale = _scale(mass)
    values, axes = np.linalg.eigh(mass / np.outer(scale, scale))
    values, axes = values[values > ROUNDING], axes[:, values > ROUNDING]
    root = scale[:, None] * axes * np.sqrt(values)  # M = root root^T
    back = axes / np.sqrt(values) / scale[:, None]
    left, shares, right = np.linalg.svd(participation @ back, full_matrices=False)
    most = np.sqrt(1.0 - room)
    if np.all(shares <= most):
        return participation
    return (left * np.minimum(shares, most)) @ right @ root.T


def noise_of_motions(mass: Array) -> Array:
    """`(6,)` sizes s of the noise of a mass matrix, s_i s_j in its entry ij, by what is not a rigid
    body's in it."""
    change = np.abs(mass - nearest_body(mass))
    scale = _scale(mass)
    across = float(np.max(change[3:, :3]))
    moving = max(float(np.max(change[:3, :3])), across * float(scale[0] / scale[3]))
    return np.sqrt(np.array([moving] * 3 + [across**2 / moving] * 3))


def independent_parts(mass: Array, stiffness: Array, noise: Array) -> Array:
    """Mass matrix `(6 + n, 6 + n)` of rigid motions and inner freedoms without what lies below
    `noise` `(6 + n,)`, s_i s_j in ij: between ports, and between parts of which nothing is coupled
    by more; `stiffness` `(n, n)`: of the inner freedoms."""
    moves = np.array([np.any(PORT_MOTION[port], axis=1) for port in PORTS])
    linked = np.abs(mass) > np.outer(noise, noise)
    linked[:6, :6] |= moves.T @ moves
    size = np.sqrt(np.diag(stiffness))
    linked[6:, 6:] |= np.abs(stiffness) > ROUNDING * np.outer(size, size)
    _, part = connected_components(linked, directed=False)
    kept = part[:, None] == part
    kept[:6, :6] &= linked[:6, :6]  # a first moment stands in two places
    return mass * kept


def _scale(mass: Array) -> Array:
    """`(6,)` square roots of the masses that make motions comparable: the mean mass, and the
    largest inertia for all rotations, since noise does not know of a small one."""
    mean = mean_mass(mass)
    turning = float(np.max(np.diag(mass)[3:]))
    return np.sqrt(np.array([mean] * 3 + [turning if turning > 0.0 else mean] * 3))
