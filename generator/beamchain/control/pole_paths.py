"""Single poles of a closed loop followed as its gain changes.

A pole moves at the rate `w* A' v / w* v`, with v and w its right and left eigenvectors and A' the
derivative of the matrix by the gain. From there inverse iteration finds it; a step is taken where
the rate at its new place says that it came from the old one. Where it does not, however small the
step, poles meet or pass each other: then all poles on both sides are assigned to each other by
distance and eigenvectors.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import zgetrf, zgetrs
from scipy.optimize import linear_sum_assignment

from beamchain.control.systems import Complex
from beamchain.ports.motions import Array

FIRST = 2.0**-20  # the smallest gain, from which a pole is assigned to one of the open loop
FINEST = 2.0**-12  # the least step, of the gain
WIDEST = 0.05  # the largest
SHARE = 0.25  # of the gain that a step may take away: poles leave a double one like its root
ALIKE = 0.7  # overlap of the eigenvectors before and after a step
CURVED = 0.1  # of a step of the pole: what the mean of both rules may miss
SPREAD = 0.5  # of it: what the two rules may differ by
SETTLED = 1e-11  # relative change of a pole at which inverse iteration ends
ITERATIONS = 8
ROUNDED = 1e-15  # of the norm of a matrix: rounding of a pole
WEIGHT = 3.0  # of an overlap beside a distance, where all poles are assigned
TOGETHER = 1e-6  # relative distance of poles that are not told apart
HALVINGS = 48  # of the interval in which a pole crosses
ENDLESS = 1e6  # a pole that grows by more as its interval is halved comes from infinity
BESIDE = 1.0 - 1e-9  # of a gain at which there is no closed loop

SLOPE = 1e-100  # of the gain beside the real axis, by which a matrix is differentiated

Closed = Callable[[complex], NDArray[Any]]  # the matrix of the closed loop at a factor of its gain
Eigen = tuple[Complex, Complex]  # poles `(n,)` and eigenvectors `(n, n)`


class Pole(NamedTuple):
    """A pole at a gain, its right and its left eigenvector `(n,)`."""

    gain: float
    value: complex
    right: Complex
    left: Complex


class Path(NamedTuple):
    """A pole on its way, `poles` in the order in which it was followed.

    `partner`: where the other one of its pair went on, if both met on the real axis.
    """

    poles: Sequence[Pole]
    partner: Pole | None


def pole_of(closed: Closed, gain: float, value: complex, right: Complex) -> Pole:
    """A pole whose value is known and its eigenvector nearly: of a badly scaled matrix a library's
    is far off where its pole is not."""
    factors = _factors(closed(gain), value)
    left = right
    for _ in range(3):
        right, left = _solved(factors, right), _solved(factors, left, adjoint=True)
    return Pole(gain, value, right, left)


def follow(closed: Closed, pole: Pole, end: float) -> Path:
    """A pole on its way to another gain; near 0 it ends at the smallest gain above it."""
    closed = lru_cache(maxsize=4)(closed)  # a step begins where the last one ended
    down = end < pole.gain
    end = max(end, FIRST) if down else end
    poles, partner = [pole], None
    step = WIDEST
    while pole.gain != end:
        least = max(FIRST, FINEST * pole.gain)
        step = max(min(step, SHARE * pole.gain if down else WIDEST, WIDEST), least)
        gain = max(end, pole.gain - step) if down else min(end, pole.gain + step)
        found = _moved(closed, pole, gain)
        if found is None and step > least:
            step = min(step, abs(gain - pole.gain)) / 2.0
            continue
        if found is None:
            found, other = _assigned(closed, pole, gain)
            partner = partner or other
        pole = found
        poles.append(pole)
        step *= 2.0
    return Path(poles, partner)


def open_pole(closed: Closed, pole: Pole, start: Eigen) -> int:
    """The number of the open pole from which one at the smallest gain comes."""
    found = _eigen(closed, pole.gain)
    if found is None:
        raise np.linalg.LinAlgError(f"no closed loop at {pole.gain} of the gains")
    order = _continued(*start, *found)
    return int(np.flatnonzero(order == _number(found, pole))[0])


def crossing(
    closed: Closed, poles: Sequence[Pole], growth: Callable[[Complex], Array]
) -> tuple[float, complex]:
    """The gain from which on a pole grows until the end, and the pole there, infinite where it
    comes back from infinity; the gain is 0 if it grows from the smallest gain on.

    Args:
        closed: the matrix at a gain.
        poles: one that grows at the end, from gain 0 upwards.
        growth: says of poles how fast they grow beside rounding, less one: -1 on the axis.
    """
    rates = growth(np.array([pole.value for pole in poles]))
    resting = np.flatnonzero(rates <= -1.0)
    last = int(resting[-1]) if resting.size else 0
    # that which begins on the axis, as rigid motion does, does not cross it there
    if np.all(rates[: last + 1] > -2.0):
        return 0.0, poles[0].value
    low, high = poles[last], poles[last + 1]
    for _ in range(HALVINGS):
        middle = (low.gain + high.gain) / 2.0
        found = _moved(closed, low, middle) or _moved(closed, high, middle)
        if found is None and _eigen(closed, middle) is None:
            return middle, complex("inf")
        found = found or _assigned(closed, high, middle)[0]
        if growth(np.array([found.value]))[0] > -1.0:
            high = found
        else:
            low = found
    sides = [_eigen(closed, side.gain) for side in (poles[last], poles[last + 1])]
    size = max(float(np.abs(side[0]).max()) for side in sides if side is not None)
    endless = min(abs(low.value), abs(high.value)) > ENDLESS * size
    return high.gain, complex("inf") if endless else high.value


def _moved(closed: Closed, pole: Pole, gain: float) -> Pole | None:
    """The pole at another gain; None where there is a doubt."""
    try:
        after = closed(gain)
        forward = (gain - pole.gain) * _rate(closed, pole.gain, pole.right, pole.left)
    except np.linalg.LinAlgError:
        return None
    found = _settled(after, pole.value + forward, pole.right, pole.left)
    if found is None:
        return None
    value, right, left = found
    if pole.value.imag == 0.0:
        value = complex(value.real)
    backward = (gain - pole.gain) * _rate(closed, gain, right, left)
    way = value - pole.value
    noise = ROUNDED * float(np.linalg.norm(after))
    most = max(abs(way), abs(forward), abs(backward)) + 1e3 * noise
    is_smooth = abs(forward - backward) <= SPREAD * most + noise
    is_mean = abs(way - (forward + backward) / 2.0) <= CURVED * most
    if not (is_smooth and is_mean and abs(np.vdot(pole.right, right)) > ALIKE):
        return None
    return Pole(gain, value, right, left)


def _rate(closed: Closed, gain: float, right: Complex, left: Complex) -> complex:
    """At which a pole moves with the gain, `w* A' v / w* v`; `A' = Im A(gain + i h) / h`."""
    slope = np.imag(closed(gain + 1j * SLOPE)) / SLOPE
    return complex(np.vdot(left, slope @ right) / np.vdot(left, right))


def _settled(
    matrix: Array, value: complex, right: Complex, left: Complex
) -> tuple[complex, Complex, Complex] | None:
    """The pole of a matrix next to a value, and its eigenvectors, by inverse iteration."""
    noise = ROUNDED * float(np.linalg.norm(matrix))
    for _ in range(ITERATIONS):
        if not np.isfinite(value):
            return None
        factors = _factors(matrix, value)
        right, left = _solved(factors, right), _solved(factors, left, adjoint=True)
        new = complex(np.vdot(left, matrix @ right) / np.vdot(left, right))
        if abs(new - value) <= SETTLED * abs(new) + noise:
            return new, right, left
        value = new
    return None


def _factors(matrix: Array, value: complex) -> tuple[Complex, NDArray[np.int32]]:
    """Of a matrix less a pole, which is kept just beside it."""
    noise = ROUNDED * max(float(np.linalg.norm(matrix)), 1e-100)
    lu, pivots, _ = zgetrf(matrix - (value + noise) * np.eye(matrix.shape[0]))
    # beside a pole that is off by as much the matrix is singular: its pivot is rounding, not zero
    diagonal = np.einsum("ii->i", lu)
    diagonal[diagonal == 0.0] = noise
    return np.asarray(lu, dtype=np.complex128), np.asarray(pivots, dtype=np.int32)


def _solved(
    factors: tuple[Complex, NDArray[np.int32]], vector: Complex, *, adjoint: bool = False
) -> Complex:
    """A step of inverse iteration: a unit vector, by the matrix or its adjoint."""
    solution, _ = zgetrs(*factors, vector, trans=2 if adjoint else 0)
    return np.asarray(solution / np.linalg.norm(solution), dtype=np.complex128)


def _assigned(closed: Closed, pole: Pole, gain: float) -> tuple[Pole, Pole | None]:
    """The pole at another gain as all poles are assigned to each other, and where the other one of
    its pair went, if both are real there."""
    before, after = _eigen(closed, pole.gain), _eigen(closed, gain)
    if after is None:
        gain *= BESIDE
        after = _eigen(closed, gain)
    if before is None or after is None:
        raise np.linalg.LinAlgError(f"no closed loop about {gain} of the gains")
    order = _continued(*before, *after)

    def at(number: int) -> Pole:
        value, right = complex(after[0][order[number]]), after[1][:, order[number]]
        return pole_of(closed, gain, value, right)

    found = at(_number(before, pole))
    if pole.value.imag == 0.0 or found.value.imag != 0.0:
        return found, None
    mirrored = Pole(pole.gain, pole.value.conjugate(), pole.right.conj(), pole.left.conj())
    return found, at(_number(before, mirrored))


def _number(found: Eigen, pole: Pole) -> int:
    """Which of all poles at a gain a known one is."""
    far = np.abs(found[0] - pole.value)
    near = far <= far.min() + TOGETHER * abs(pole.value)
    return int(np.argmax(np.where(near, 1.0 + np.abs(pole.right.conj() @ found[1]), 0.0)))


def _eigen(closed: Closed, gain: float) -> Eigen | None:
    """Poles and eigenvectors at a gain; None where there is no matrix."""
    try:
        values, vectors = np.linalg.eig(closed(gain))
    except np.linalg.LinAlgError:
        return None
    return values.astype(np.complex128), vectors.astype(np.complex128)


def _continued(
    poles: Complex, vectors: Complex, new: Complex, directions: Complex
) -> NDArray[np.intp]:
    """Which new pole continues each."""
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
    return columns[np.argsort(rows)].astype(np.intp)
