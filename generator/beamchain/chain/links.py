"""Rigid links between the hinges of a cut, with the mass that lies there."""

from itertools import pairwise

import numpy as np

from beamchain.chain.chain import Link
from beamchain.ports.motions import Array
from beamchain.structure.mass_line import MassLine

ROUNDED = 1e-13  # of the whole inertia: what differences of its parts lose


FLAT = 1e-12  # of the largest second moment: thickness of a lamina


def _rounded(about: Array, noise: float) -> Array:
    """`(3, 3)` inertia about the centre, no second moment below zero by rounding: a lamina's is nothing across it."""
    moments = np.trace(about) / 2.0 * np.eye(3) - about
    values, axes = np.linalg.eigh(moments)
    if not -noise < values[0] < FLAT * values[2]:
        return about
    values = np.maximum(values, FLAT * values[2])
    return float(np.sum(values)) * np.eye(3) - (axes * values) @ axes.T


def bodies(line: MassLine, x: Array) -> list[Link]:
    """The appendage's own rigid pieces between the hinges, as they are; see `polar.settled` for thin ones."""
    behind = line.behind(np.concatenate([[-line.length], x]))
    pieces = [*(a - b for a, b in pairwise(behind)), behind[-1]]
    edges = [0.0, *x.tolist(), line.length]
    out: list[Link] = []
    for a, b, matrix in zip(edges[:-1], edges[1:], pieces, strict=True):
        mass = float(np.trace(matrix[:3, :3])) / 3.0
        if mass <= 0.0:
            out.append(Link(a, b - a, 0.0, a, (0.0, 0.0, 0.0)))
            continue
        centre = np.array([matrix[1, 5] - matrix[2, 4], 2.0 * matrix[2, 3], -2.0 * matrix[1, 3]]) / 2.0 / mass
        about = matrix[3:, 3:] - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        about = _rounded(about, ROUNDED * float(np.trace(behind[0][3:, 3:])))
        if np.max(np.abs(about - np.diag(np.diag(about)))) < ROUNDED * float(np.trace(behind[0][3:, 3:])):
            about = np.diag(np.diag(about))
        centre[1:] = np.where(np.abs(centre[1:]) < ROUNDED * line.length, 0.0, centre[1:])
        inertia = (float(about[0, 0]), float(about[1, 1]), float(about[2, 2]))
        products = (float(about[0, 1]), float(about[0, 2]), float(about[1, 2]))
        out.append(Link(a, b - a, mass, float(centre[0]), inertia, (float(centre[1]), float(centre[2])), products))
    return out
