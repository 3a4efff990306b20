"""State spaces as four arrays: feedback closed, states that take no part removed, responses."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, matrix_balance
from scipy.sparse.csgraph import connected_components

from beamchain.craft.modal_form import column_range
from beamchain.ports.motions import Array

System = tuple[Array, Array, Array, Array]
Complex = NDArray[np.complex128]
UNSEEN = 1e-11  # relative, below which a state takes no part
LINKED = 1e-14  # of the largest in its row, below which an element of A is rounding
CHUNK = 100  # frequencies that are solved together
GROWS = 1e-9  # negative damping ratio of a pole that is rounding
ROUNDED = 1e-12  # size of a pole relative to the fastest one, below which it is rounding
# size of an open pole relative to the plant's fastest one, below which it may be at zero: what
# rounding, 1e-16, makes of a double integrator
AT_REST = 1e-7
SLOWER = 0.01  # than the slowest pole of a closed loop: an open pole that it takes for one at zero


def side_by_side(systems: Iterable[System]) -> System:
    """Systems as one, with the signals of each behind those of the one before."""
    a, b, c, d = (
        np.asarray(block_diag(*same), dtype=np.float64) for same in zip(*systems, strict=True)
    )
    return a, b, c, d


def with_gains(behind: Array, system: System, before: Array) -> System:
    """`behind G before` of a system G."""
    a, b, c, d = system
    return a, b @ before, behind @ c, behind @ d @ before


def close_feedback(system: System, gain: Array) -> System:
    """A system with `input = gain output + further input`, `gain` `(inputs, outputs)`;
    all its signals stay."""
    a, b, c, d = system
    left = np.linalg.inv(np.eye(d.shape[0]) - d @ gain)
    back = b @ gain @ left
    return a + back @ c, b + back @ d, left @ c, left @ d


def with_deltas(system: System, deltas: Array) -> System:
    """A system with its first signals closed by `(channels,)` deltas,
    and the signals that are left."""
    n = deltas.size
    gain = np.zeros(system[3].T.shape)
    gain[:n, :n] = np.diag(deltas)
    a, b, c, d = close_feedback(system, gain)
    return a, b[:, n:], c[n:], d[n:, n:]


def close_loop(
    system: System, controller: System, rows: Sequence[int], columns: Sequence[int]
) -> System:
    """A system with a controller from its outputs `rows` to its inputs `columns`, negative
    feedback; all signals stay, the controller's behind its own."""
    both = side_by_side([system, controller])
    outputs, inputs = system[3].shape
    gain = np.zeros(both[3].T.shape)
    gain[inputs + np.arange(len(rows)), rows] = 1.0
    gain[columns, outputs + np.arange(len(columns))] = -1.0
    return close_feedback(both, gain)


def taking_part(
    a: NDArray[np.bool_], driven: NDArray[np.bool_], seen: NDArray[np.bool_]
) -> list[int]:
    """Which states are linked, by `a`, to one that is driven and to one that is seen."""
    for _ in range(a.shape[0]):
        driven, seen = driven | (a @ driven), seen | (a.T @ seen)
    return np.flatnonzero(driven & seen).tolist()


def linking(system: System) -> list[int]:
    """The states that link an input of a system to an output."""
    a, b, c, _ = system
    link = np.abs(a) > LINKED * np.abs(a).max(axis=1, initial=1e-300)[:, None]
    driven = (np.abs(b) > UNSEEN * np.abs(b).max(axis=0, initial=1e-300)).any(axis=1)
    seen = (np.abs(c) > UNSEEN * np.abs(c).max(axis=1, initial=1e-300)[:, None]).any(axis=0)
    return taking_part(link, driven, seen)


def subsystem(system: System, outputs: list[int], inputs: list[int]) -> System:
    """Some of the signals, and the states that link them."""
    a, b, c, d = system
    some = a, b[:, inputs], c[outputs], d[np.ix_(outputs, inputs)]
    return with_states(some, linking(some))


def with_states(system: System, keep: list[int]) -> System:
    """Only some of the states."""
    a, b, c, d = system
    return a[np.ix_(keep, keep)], b[keep], c[:, keep], d


def touched(system: System, rest: float = 0.0) -> tuple[System, list[int]]:
    """A system without the motions at rest that its inputs do not drive, or its outputs do not
    see, however small the others are; and which of its states are left.

    `rest`: what poles at rest are, 0 of s and 1 of z.
    """
    a, b, c, d = system
    keep = list(range(a.shape[0]))
    a, b, c, keep = _without_unseen(a, b, c, keep, rest)
    # what is not driven is not seen by the transposed system
    a, c, b, keep = _without_unseen(a.T, c.T, b.T, keep, rest)
    return (a.T, b.T, c.T, d), keep


def _without_unseen(
    a: Array, b: Array, c: Array, keep: list[int], rest: float
) -> tuple[Array, Array, Array, list[int]]:
    """A, B and C without the motions at rest that C does not see, in coordinates of which each is
    one that was there; from displacements on to the rates that lead to them."""
    while keep:
        still = standing_still(a - rest * np.eye(len(keep)), c)
        if not still.size:
            break
        # x = y + V x_p with A V = rest V, C V = 0 and V_p = 1: y' = (A - V A_p) y + (B - V B_p) u
        still, pivots = column_range(still, 0.0)
        still = np.where(np.abs(still) > LINKED, still, 0.0)
        others = np.setdiff1d(np.arange(len(keep)), pivots)
        a = (a - still @ a[pivots])[np.ix_(others, others)]
        b = (b - still @ b[pivots])[others]
        c = c[:, others]
        keep = [keep[i] for i in others]
    return a, b, c, keep


def balancing(a: Array) -> Array:
    """`(n,)` factors, powers of two, by which states compare."""
    with np.errstate(invalid="ignore"):  # SciPy makes whole numbers of them, for a permutation
        _, (scale, _) = matrix_balance(a, permute=False, separate=True)
    return np.asarray(scale, dtype=np.float64)


def standing_still(a: Array, c: Array) -> Array:
    """`(n, k)` directions in which nothing moves of itself and C sees nothing, beside what each row
    of A and C sees elsewhere, states scaled so that they compare; never more than there are poles
    at zero."""
    size = np.abs(np.linalg.eigvals(a))
    count = int(np.sum(size <= AT_REST * size.max(initial=0.0)))
    scale = balancing(a)
    rows = np.vstack([a, c]) * scale
    rows = rows / np.maximum(np.abs(rows).max(axis=1, keepdims=True, initial=0.0), 1e-300)
    _, sizes, directions = np.linalg.svd(rows)
    count = min(count, int(np.sum(sizes <= UNSEEN * max(1.0, float(sizes.max(initial=0.0))))))
    return np.asarray(scale[:, None] * directions[size.size - count :].T, dtype=np.float64)


def size_at_rest(plant_poles: Complex, poles: Complex, top: float) -> float:
    """Size of an open pole s below which it is at rest [rad/s], for a closed loop with `poles`,
    whose fastest has the size `top`, around a plant that it touches in all that is at rest."""
    size = np.abs(poles)
    slowest = float(size[size > ROUNDED * top].min(initial=top))
    return min(AT_REST * min(float(np.abs(plant_poles).max(initial=0.0)), top), SLOWER * slowest)


def growth(poles: Complex, rest: float, top: float) -> Array:
    """`(k,)` growth of poles s beside what rounding makes of poles on the axis, less one: above
    zero they are unstable, at -1 they are on the axis. Those at rest do not grow.

    `top`: size of the fastest pole [rad/s].
    """
    size = np.abs(poles)
    rounding = GROWS * size + max(ROUNDED * top, 1e-300)
    return np.where(size < rest, 0.0, poles.real) / rounding - 1.0


def response(system: System, s: Complex) -> Complex:
    """`(k, outputs, inputs)` values at `s` `(k,)`; of many, part by part of what is coupled."""
    a, b, c, d = system
    if s.size <= CHUNK or not a.size:
        # C (s - A)^-1 B + D
        states = np.linalg.solve(s[:, None, None] * np.eye(a.shape[0]) - a, b[None])
        return (c @ states + d).astype(np.complex128)
    count, number = connected_components(a != 0.0)
    apart = (np.flatnonzero(number == k) for k in range(count))
    parts = [(a[np.ix_(at, at)], b[at], c[:, at], 0.0 * d) for at in apart]
    chunks = np.array_split(s, -(-s.size // CHUNK))
    return np.concatenate(
        [np.sum([response(part, some) for part in parts], axis=0) + d for some in chunks]
    )
