"""Modes of equal frequency, turned so that each moves in one port where that is possible."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from beamchain.ports.motions import PORT_MOTION, Array

WEIGHTS = {"xy": 1.0, "xz": 0.618, "torsion": 0.382, "axial": 0.236}  # unequal, so that ports do not mix by accident
GAIN = 1e-12  # least improvement of the largest port share for which a group is turned


class Turned(NamedTuple):
    """Modes after `into_planes`; `turn` `(n, n)`: new modes in terms of old, `changed`: groups that were turned."""

    frequencies: Array
    participation: Array
    turn: Array
    changed: list[list[int]]


def near_groups(frequencies: Array, tolerance: float) -> list[list[int]]:
    """Runs of ascending frequencies in which each follows the last within `tolerance`, relative; two modes or more."""
    groups: list[list[int]] = [[0]] if frequencies.size else []
    for k in range(1, frequencies.size):
        if frequencies[k] - frequencies[k - 1] <= tolerance * frequencies[k]:
            groups[-1].append(k)
        else:
            groups.append([k])
    return [group for group in groups if len(group) > 1]


def into_planes(frequencies: Array, participation: Array, scale: Array, groups: Sequence[Sequence[int]]) -> Turned:
    """Turn each group of equal frequency so that its modes diagonalise the ports' effective masses.

    `participation` `(n, 6)`; `scale` `(6,)` makes the motions comparable.
    """
    turn = np.eye(frequencies.size)
    changed: list[list[int]] = []
    for group in groups:
        rows = participation[list(group)] / scale
        weighted = np.zeros((len(group), len(group)))
        for port, weight in WEIGHTS.items():
            inside = rows @ np.abs(PORT_MOTION[port])
            weighted += weight * inside @ inside.T
        vectors = np.linalg.eigh(weighted)[1].T[::-1]
        if np.sum(_best(vectors @ rows)) > np.sum(_best(rows)) * (1.0 + GAIN):
            turn[np.ix_(list(group), list(group))] = vectors
            changed.append(list(group))
    squares = (turn**2) @ frequencies**2
    return Turned(np.sqrt(squares), turn @ participation, turn, changed)


def _best(rows: Array) -> Array:
    """`(g,)` participation squared of each row in its largest port."""
    return np.max([np.sum((rows @ np.abs(m)) ** 2, axis=1) for m in PORT_MOTION.values()], axis=0)
