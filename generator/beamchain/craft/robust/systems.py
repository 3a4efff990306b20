"""State spaces as four arrays: feedback closed, states that take no part removed, responses."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from beamchain.ports.motions import Array

System = tuple[Array, Array, Array, Array]
Complex = NDArray[np.complex128]
UNSEEN = 1e-11  # relative, below which a state takes no part
LINKED = 1e-14  # of the largest in its row, below which an element of A is rounding
CHUNK = 100  # frequencies that are solved together


def closed(system: System, gain: Array) -> System:
    """A system with `input = gain output + further input`; all its signals stay.

    Args:
        system: A, B, C, D.
        gain: `(inputs, outputs)`.
    """
    a, b, c, d = system
    left = np.linalg.inv(np.eye(d.shape[0]) - d @ gain)
    back = b @ gain @ left
    return a + back @ c, b + back @ d, left @ c, left @ d


def with_deltas(system: System, deltas: Array) -> System:
    """A system with its first signals closed by `(channels,)` deltas."""
    gain = np.zeros((system[3].shape[1], system[3].shape[0]))
    gain[np.arange(deltas.size), np.arange(deltas.size)] = deltas
    return closed(system, gain)


def beside(one: System, two: System) -> System:
    """Two systems side by side."""
    a, b, c, d = (np.asarray(block_diag(p, q), dtype=np.float64) for p, q in zip(one, two, strict=True))
    return a, b, c, d


def picked(system: System, outputs: list[int], inputs: list[int]) -> System:
    """Some of the signals, and the states that link them."""
    a, b, c, d = system
    b, c, d = b[:, inputs], c[outputs], d[np.ix_(outputs, inputs)]
    link = np.abs(a) > LINKED * np.abs(a).max(axis=1, initial=1e-300)[:, None]
    driven = (np.abs(b) > UNSEEN * np.abs(b).max(axis=0, initial=1e-300)).any(axis=1)
    seen = (np.abs(c) > UNSEEN * np.abs(c).max(axis=1, initial=1e-300)[:, None]).any(axis=0)
    for _ in range(a.shape[0]):
        driven, seen = driven | (link @ driven), seen | (link.T @ seen)
    keep = driven & seen
    return a[np.ix_(keep, keep)], b[keep], c[:, keep], d


def response(system: System, s: Complex) -> Complex:
    """`(k, outputs, inputs)` values at `s` `(k,)`."""
    a, b, c, d = system
    parts = [
        c @ np.linalg.solve(some[:, None, None] * np.eye(a.shape[0]) - a, np.broadcast_to(b, (some.size, *b.shape))) + d
        for some in np.array_split(s, max(1, -(-s.size // CHUNK)))
    ]
    return np.concatenate(parts).astype(np.complex128)
