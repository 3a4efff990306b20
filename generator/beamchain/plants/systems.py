"""State spaces as four arrays: feedback closed, states that take no part removed, responses."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from beamchain.ports.motions import Array

System = tuple[Array, Array, Array, Array]
Complex = NDArray[np.complex128]
UNSEEN = 1e-11  # relative, below which a state takes no part
LINKED = 1e-14  # of the largest in its row, below which an element of A is rounding
CHUNK = 100  # frequencies that are solved together


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
    a, b, c, d = (
        np.asarray(block_diag(p, q), dtype=np.float64)
        for p, q in zip(system, controller, strict=True)
    )
    outputs, inputs = system[3].shape
    gain = np.zeros(d.T.shape)
    gain[inputs + np.arange(len(rows)), rows] = 1.0
    gain[columns, outputs + np.arange(len(columns))] = -1.0
    return close_feedback((a, b, c, d), gain)


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


def picked(system: System, outputs: list[int], inputs: list[int]) -> System:
    """Some of the signals, and the states that link them."""
    a, b, c, d = system
    some = a, b[:, inputs], c[outputs], d[np.ix_(outputs, inputs)]
    return with_states(some, linking(some))


def with_states(system: System, keep: list[int]) -> System:
    """Only some of the states."""
    a, b, c, d = system
    return a[np.ix_(keep, keep)], b[keep], c[:, keep], d


def response(system: System, s: Complex) -> Complex:
    """`(k, outputs, inputs)` values at `s` `(k,)`."""
    a, b, c, d = system
    eye = np.eye(a.shape[0])
    parts: list[Complex] = []
    for chunk in np.array_split(s, max(1, -(-s.size // CHUNK))):
        # C (s - A)^-1 B + D
        states = np.linalg.solve(
            chunk[:, None, None] * eye - a, np.broadcast_to(b, (chunk.size, *b.shape))
        )
        parts.append((c @ states + d).astype(np.complex128))
    return np.concatenate(parts)
