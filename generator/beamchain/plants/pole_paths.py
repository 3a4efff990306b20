"""Poles of a closed loop followed as its gain grows from 0 to 1."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from beamchain.plants.systems import Complex
from beamchain.ports.motions import Array

FIRST = 2.0**-20  # the first step of the gain: poles leave a double one like its root
FINEST = 2.0**-12  # the least step, of the gain
WIDEST = 0.05  # the largest
ALIKE = 0.9  # overlap of two eigenvectors, from which they are of one pole
AKIN = 0.7  # the same, of poles that are far from all others
WEIGHT = 3.0  # of an overlap beside a distance
FAR = 0.4  # of the distance to the next pole: a pole that moves less is the same one
TOGETHER = 1e-6  # relative distance of poles that are not told apart
HALVINGS = 48  # of the interval in which a pole crosses
ENDLESS = 1e6  # a pole that grows by more as its interval is halved comes from infinity
BESIDE = 1.0 - 1e-9  # of a gain at which there is no closed loop

Closed = Callable[[float], Array]  # the matrix of the closed loop at a factor of its gain


@dataclass(frozen=True, eq=False)
class Paths:
    """Poles on their way.

    Args:
        closed: the matrix at a gain.
        gains: `(k,)` from 0 to 1.
        poles: `(k, n)`, a column per pole.
        vectors: `(k, n, n)` their eigenvectors.
    """

    closed: Closed
    gains: Array
    poles: Complex
    vectors: Complex

    def crossing(
        self, number: int, growth: Callable[[Complex], Array], rounding: float
    ) -> tuple[float, complex]:
        """The gain from which on a pole grows until the end, and the pole there, infinite where it
        comes back from infinity; the gain is 0 if it grows from the smallest gain on.

        Args:
            number: of the pole, one that grows at the end.
            growth: says of poles how fast they grow; not above zero: they do not.
            rounding: growth of a pole on the axis, with the minus.
        """
        rates = growth(self.poles[:, number])
        resting = np.flatnonzero(rates <= -rounding)
        last = int(resting[-1]) if resting.size else 0
        # that which begins on the axis, as rigid motion does, does not cross it there
        if np.all(rates[: last + 1] > -2.0 * rounding):
            return 0.0, complex(self.poles[0, number])
        low, high = float(self.gains[last]), float(self.gains[last + 1])
        sides = [(self.poles[k], self.vectors[k]) for k in (last, last + 1)]
        for _ in range(HALVINGS):
            middle = (low + high) / 2.0
            found = _eigen(self.closed, middle)
            if found is None:
                return middle, complex("inf")
            matched = [_continued(*side, *found) for side in sides]
            order = matched[0][0] if matched[0][1] or not matched[1][1] else matched[1][0]
            here = found[0][order], found[1][:, order]
            if growth(here[0][[number]])[0] > -rounding:
                high, sides[1] = middle, here
            else:
                low, sides[0] = middle, here
        ends = [complex(side[0][number]) for side in sides]
        size = float(np.abs(self.poles[[last, last + 1]]).max())
        endless = min(map(abs, ends)) > ENDLESS * size
        return high, complex("inf") if endless else ends[1]


def follow(closed: Closed, start: tuple[Complex, Complex]) -> Paths:
    """The poles from gain 0 to 1, each the nearest with the most similar eigenvector.

    Args:
        closed: the matrix at a gain; it may have none where a loop that no time passes in has no
            solution, at single gains below 1.
        start: poles `(n,)` and their eigenvectors `(n, n)` at gain 0.
    """
    gains = [0.0]
    poles, vectors = start
    path, directions = [poles], [vectors]
    step = FIRST
    while gains[-1] < 1.0:
        gain = min(1.0, gains[-1] + step)
        found = _eigen(closed, gain) or _eigen(closed, gain * BESIDE)
        if found is None:
            raise np.linalg.LinAlgError(f"no closed loop about {gain} of the gains")
        order, sure = _continued(poles, vectors, *found)
        if not sure and step > max(FIRST, FINEST * gain):
            step /= 2.0
            continue
        poles, vectors = found[0][order], found[1][:, order]
        gains.append(gain)
        path.append(poles)
        directions.append(vectors)
        step = min(2.0 * step if sure else step, WIDEST)
    return Paths(closed, np.array(gains), np.array(path), np.array(directions))


def _eigen(closed: Closed, gain: float) -> tuple[Complex, Complex] | None:
    """Poles and eigenvectors at a gain; None where there is no matrix."""
    try:
        values, vectors = np.linalg.eig(closed(gain))
    except np.linalg.LinAlgError:
        return None
    return values.astype(np.complex128), vectors.astype(np.complex128)


def _continued(
    poles: Complex, vectors: Complex, new: Complex, directions: Complex
) -> tuple[NDArray[np.intp], bool]:
    """Which new pole continues each, and whether there is no doubt."""
    overlap = np.abs(vectors.conj().T @ directions)
    distance = np.abs(poles[:, None] - new)
    size = float(np.abs(new).max(initial=1e-300))
    apart = np.abs(new[:, None] - new)
    same = apart <= TOGETHER * (np.abs(new) + 1e-3 * size)
    apart[same] = np.inf
    alone = apart.min(axis=0, initial=np.inf)  # distance of a new pole to the next one
    alone = np.minimum(alone, np.abs(new) + 1e-3 * size)
    # poles that are one share a plane, in which their eigenvectors are any
    overlap = np.minimum(np.sqrt(overlap**2 @ same), 1.0)
    # poles that pass each other are told apart by their eigenvectors, at any distance
    cost = distance / (distance + alone) + WEIGHT * (1.0 - overlap)
    rows, columns = linear_sum_assignment(cost)
    order = columns[np.argsort(rows)].astype(np.intp)
    n = np.arange(poles.size)
    moved, like = distance[n, order], overlap[n, order]
    near = moved < FAR * (np.abs(poles) + 1e-3 * size)
    sure = (near & (like > ALIKE)) | ((moved < FAR * alone[order]) & (like > AKIN))
    return order, bool(np.all(sure))
