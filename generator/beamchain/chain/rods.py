"""A planar chain of rods as a smooth function of its numbers, complex ones included, for fits by least squares.

Complex steps need an analytic path: eigenvalues come from the general solver, products are not conjugated.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain.port import Array

Numbers = NDArray[Any]  # float64 or complex128


class RodModes(NamedTuple):
    """Cantilever modes of a chain of rods.

    Args:
        frequencies: `(n,)` [rad/s].
        participation: `(n, 2)`.
        tip: `(n,)` tip displacement in the mass-normalised modes.
    """

    frequencies: Numbers
    participation: Numbers
    tip: Numbers


class Rods(NamedTuple):
    """Rods 0..N-1 with hinges between them.

    Args:
        starts: `(N,)` x of each rod's inner end; rod 0 is welded to the root [m].
        masses: `(N,)` [kg].
        centres: `(N,)` x of the mass centres [m].
        inertias: `(N,)` about the centres [kg m^2].
        stiffness: `(N - 1,)` of the hinge at `starts[1:]` [N m/rad].
    """

    starts: Numbers
    masses: Numbers
    centres: Numbers
    inertias: Numbers
    stiffness: Numbers


class Payload(NamedTuple):
    """A rigid body at the tip."""

    mass: float
    inertia: float


def rod_modes(rods: Rods, tip: float, payload: Payload = Payload(0.0, 0.0)) -> RodModes:
    """Cantilever modes, participation and tip displacement.

    Args:
        rods: the chain; its arrays may be complex.
        tip: x of the tip [m].
        payload: carried at the tip.
    """
    hinges = rods.starts[1:]
    flexible = 1.0 / np.sqrt(rods.stiffness)
    outside = np.tri(rods.masses.size, hinges.size, -1)  # hinge j moves rods j+1 and on
    arms = (rods.centres[:, None] - hinges[None, :]) * outside * flexible
    turns = outside * flexible
    tip_arms = (tip - hinges) * flexible
    weighted = [
        rods.masses[:, None] * arms,
        rods.inertias[:, None] * turns,
        payload.mass * tip_arms[None, :],
        payload.inertia * flexible[None, :],
    ]
    plain = [arms, turns, tip_arms[None, :], flexible[None, :]]
    inertia = sum(a.T @ b for a, b in zip(plain, weighted, strict=True))
    n = rods.masses.size
    ones, nothing = np.ones(n), np.zeros(n)
    rigid = [
        np.column_stack([ones, rods.centres]),
        np.column_stack([nothing, ones]),
        np.array([[1.0, tip]]),
        np.array([[0.0, 1.0]]),
    ]
    across = sum(b.T @ a for a, b in zip(rigid, weighted, strict=True))
    values, vectors = np.linalg.eig(inertia)
    order = np.argsort(-values.real)
    values, vectors = values[order], vectors[:, order]
    if not np.iscomplexobj(inertia):
        values, vectors = values.real, vectors.real
    vectors = vectors / np.sqrt(np.sum(vectors * vectors, axis=0))
    frequencies = 1.0 / np.sqrt(values)
    participation = (vectors.T @ across) * frequencies[:, None]
    tips = (vectors.T @ tip_arms) * frequencies
    signs = np.where(participation[:, 0].real < 0.0, -1.0, 1.0)
    return RodModes(frequencies, participation * signs[:, None], tips * signs)


def nodes_to_rods(masses: Numbers, lengths: Numbers, excess: Numbers, stiffness: Numbers) -> Rods:
    """Rods from node masses `(N + 1,)`, rod lengths `(N,)` and rods' excess rotary inertia `(N,)`.

    Inner nodes are shared half and half: the port does not notice.
    """
    x = np.concatenate([np.zeros(1), np.cumsum(lengths)])
    half = np.concatenate([masses[:1], masses[1:-1] / 2.0, masses[-1:]])
    a = np.concatenate([half[:1], half[1:-1]])
    b = np.concatenate([half[1:-1], half[-1:]])
    total = a + b
    return Rods(x[:-1], total, x[:-1] + lengths * b / total, a * b / total * lengths**2 + excess, stiffness)


def jacobian(function: Callable[[Numbers], Numbers], at: Array, step: float = 1e-30) -> Array:
    """Complex-step Jacobian `(r, p)` of an analytic `function` at `at` `(p,)`: exact to rounding, no step to choose."""
    columns = []
    for i in range(at.size):
        moved = at.astype(np.complex128)
        moved[i] += 1j * step
        columns.append(np.imag(function(moved)) / step)
    return np.array(columns).T
