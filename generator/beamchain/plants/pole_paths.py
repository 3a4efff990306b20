"""Poles of a closed loop followed as its gain grows from 0 to 1."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from beamchain.plants.systems import Complex
from beamchain.ports.motions import Array

FIRST = 1e-3  # the first step of the gain
FINEST = 2.0**-12  # the least
WIDEST = 0.05  # the largest
ALIKE = 0.9  # overlap of two eigenvectors, from which they are of one pole
FAR = 0.4  # of the distance to the next pole: a pole that moves less is the same one
TOGETHER = 1e-6  # relative distance of poles that are not told apart
HALVINGS = 48  # of the interval in which a pole crosses

Closed = Callable[[float], Array]  # the matrix of the closed loop at a factor of its gain


@dataclass(frozen=True, eq=False)
class Paths:
    """Poles on their way.

    Args:
        closed: the matrix at a gain.
        gains: `(k,)` from 0 to 1.
        poles: `(k, n)`, a column per pole.
    """

    closed: Closed
    gains: Array
    poles: Complex

    def crossing(self, number: int, growth: Callable[[Complex], Array]) -> tuple[float, complex]:
        """The gain from which on a pole grows until the end, and the pole there; the gain is 0 if
        it grows from the smallest gain on.

        Args:
            number: of the pole, one that grows at the end.
            growth: says of poles how fast they grow; not above zero: they do not.
        """
        grows = growth(self.poles[:, number]) > 0.0
        resting = np.flatnonzero(~grows)
        last = int(resting[-1]) if resting.size else 0
        # that which begins on the axis, as rigid motion does, does not cross it there
        if last == 0:
            return 0.0, complex(self.poles[0, number])
        low, high = float(self.gains[last]), float(self.gains[last + 1])
        pole = complex(self.poles[last + 1, number])
        for _ in range(HALVINGS):
            middle = (low + high) / 2.0
            poles = np.linalg.eigvals(self.closed(middle)).astype(np.complex128)
            nearest = complex(poles[np.argmin(np.abs(poles - pole))])
            if growth(np.array([nearest]))[0] > 0.0:
                high, pole = middle, nearest
            else:
                low = middle
        return high, pole


def follow(closed: Closed, start: tuple[Complex, Complex]) -> Paths:
    """The poles from gain 0 to 1, each the nearest with the most similar eigenvector.

    Args:
        closed: the matrix at a gain.
        start: poles `(n,)` and their eigenvectors `(n, n)` at gain 0.
    """
    gains = [0.0]
    poles, vectors = start
    path = [poles]
    step = FIRST
    while gains[-1] < 1.0:
        gain = min(1.0, gains[-1] + step)
        values, others = np.linalg.eig(closed(gain))
        new, directions = values.astype(np.complex128), others.astype(np.complex128)
        order, sure = _continued(poles, vectors, new, directions)
        if not sure and step > FINEST:
            step /= 2.0
            continue
        poles, vectors = new[order], directions[:, order]
        gains.append(gain)
        path.append(poles)
        step = min(2.0 * step if sure else step, WIDEST)
    return Paths(closed, np.array(gains), np.array(path))


def _continued(
    poles: Complex, vectors: Complex, new: Complex, directions: Complex
) -> tuple[NDArray[np.intp], bool]:
    """Which new pole continues each, and whether there is no doubt."""
    overlap = np.abs(vectors.conj().T @ directions)
    distance = np.abs(poles[:, None] - new)
    size = float(np.abs(new).max(initial=1e-300))
    apart = np.abs(new[:, None] - new)
    apart[apart <= TOGETHER * (np.abs(new) + 1e-3 * size)] = np.inf
    alone = apart.min(axis=0, initial=np.inf)  # distance of a new pole to the next one
    alone = np.minimum(alone, np.abs(new) + 1e-3 * size)
    cost = distance / alone + (1.0 - np.minimum(overlap, 1.0))
    rows, columns = linear_sum_assignment(cost)
    order = columns[np.argsort(rows)].astype(np.intp)
    n = np.arange(poles.size)
    moved = distance[n, order]
    near = moved < FAR * (np.abs(poles) + 1e-3 * size)
    sure = (moved < FAR * alone[order]) | (near & (overlap[n, order] > ALIKE))
    return order, bool(np.all(sure))
