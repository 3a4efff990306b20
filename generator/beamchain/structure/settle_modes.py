"""Imported modes put in order.

Modes of equal frequency are turned into the planes, and rounding of printed digits is cleared away.
"""

from collections.abc import Sequence

import numpy as np

from beamchain.errors import InputError
from beamchain.ports.motions import PORT_MOTION, Array

# unequal, so that ports do not mix by accident
WEIGHTS = {"xy": 1.0, "xz": 0.618, "torsion": 0.382, "axial": 0.236}
GAIN = 1e-12  # least improvement of the largest port share for which a group is turned
MOTIONS = ("x", "y", "z", "rotation x", "rotation y", "rotation z")
ROUNDING = 20.0  # precision of a residual over that of its numbers
PRINTED = 1e-5  # most that counts as rounding, however few digits were printed
WRONG = 0.1  # a residual this far below zero is no rounding, however few digits were printed
NOISE = 1e-9  # a residual may be this far below zero whatever the print


def near_groups(frequencies: Array, tolerance: float) -> list[list[int]]:
    """Runs of two or more ascending frequencies within a relative `tolerance`."""
    apart = np.diff(frequencies) > tolerance * frequencies[1:]
    runs = np.split(np.arange(frequencies.size), np.flatnonzero(apart) + 1)
    return [run.tolist() for run in runs if run.size > 1]


def turn_into_planes(
    participation: Array, scale: Array, groups: Sequence[Sequence[int]]
) -> tuple[Array, list[list[int]]]:
    """Modes `(n, n)` in terms of the old that diagonalise the ports' effective masses in each group
    of equal frequency.

    `participation` `(n, 6)`; `scale` `(6,)` makes the motions comparable.
    Also the groups that were turned.
    """
    turn = np.eye(len(participation))
    changed: list[list[int]] = []
    for group in groups:
        rows = participation[list(group)] / scale
        weighted = np.zeros((len(group), len(group)))
        for port, weight in WEIGHTS.items():
            inside = rows @ PORT_MOTION[port]
            weighted += weight * inside @ inside.T
        vectors = np.linalg.eigh(weighted)[1].T[::-1]
        before = np.sum(_largest_port_shares(rows))
        after = np.sum(_largest_port_shares(vectors @ rows))
        if after > before * (1.0 + GAIN):
            turn[np.ix_(list(group), list(group))] = vectors
            changed.append(list(group))
    return turn, changed


def _largest_port_shares(rows: Array) -> Array:
    """`(g,)` participation squared of each row in its largest port."""
    shares = [np.sum((rows @ motion) ** 2, axis=1) for motion in PORT_MOTION.values()]
    return np.max(shares, axis=0)


def settle_rigid_mass(
    rigid_mass: Array, participation: Array, precision: float
) -> tuple[Array, float]:
    """The rigid mass `(m, m)` whose residual is nowhere negative,
    and how far it was moved, relative.

    Entries that the last printed digits decide become zero;
    eigenvalues negative by rounding are clipped.
    """
    diagonal = np.diag(rigid_mass)
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scales = np.outer(scale, scale)
    effective = participation.T @ participation
    residual = (rigid_mass - effective) / scales
    least = min(ROUNDING * precision, PRINTED)
    rounding = rounding_of_residual(rigid_mass, participation, precision) / scales
    kept = np.where(np.abs(residual) <= np.maximum(rounding, least), 0.0, residual)
    values, vectors = np.linalg.eigh(kept)
    if values[0] < -max(min(ROUNDING * precision, WRONG), NOISE):
        worst = int(np.argmax(np.abs(vectors[:, 0])))
        names = MOTIONS if scale.size == 6 else ("displacement", "rotation")
        raise InputError(
            "the residual mass (rigid mass minus the effective masses of all modes) has the "
            f"eigenvalue {values[0]:.3g} relative to the rigid mass, mainly in {names[worst]}; it "
            "must not be negative. Likely causes: participation and mass about different reference "
            "points, different units, modes that are not mass-normalised, or a rigid mass without "
            "that of the clamped nodes."
        )
    clipped = np.where(values > least, values, 0.0)
    if np.any(clipped != values):
        kept = (vectors * clipped) @ vectors.T
    # a motion without inertia has none afterwards
    inert = diagonal > 0.0
    kept_scale = np.where(inert, scale, 0.0)
    mass = effective * np.outer(inert, inert) + kept * np.outer(kept_scale, kept_scale)
    return mass, float(np.max(np.abs(kept - residual)))


def rounding_of_residual(rigid_mass: Array, participation: Array, precision: float) -> Array:
    """`(m, m)` most by which half a last printed digit changes the residual mass.

    To first order `d(M - L^T L) = dM + |L|^T dL + dL^T |L|`.
    """

    def half_digit(values: Array) -> Array:
        size = np.abs(values)
        decade = 10.0 ** np.floor(np.log10(np.where(size > 0.0, size, 1.0)))
        return precision * decade * (size > 0.0)

    products = np.abs(participation).T @ half_digit(participation)
    return half_digit(rigid_mass) + products + products.T
