"""A planar chain of rods as a smooth function of its numbers, complex ones included, for fits by least squares.

Complex steps need an analytic path: eigenvalues come from the general solver, products are not conjugated.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain.ports.motions import Array

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


NO_PAYLOAD = Payload(0.0, 0.0)


def rod_modes(rods: Rods, tip: float, payload: Payload = NO_PAYLOAD) -> RodModes:
    """Cantilever modes, participation and tip displacement.

    Args:
        rods: the chain; its arrays may be complex.
        tip: x of the tip [m].
        payload: carried at the tip.
    """
    return RodModes(*(values[0] for values in loaded_modes(rods, tip, (payload,))))


def loaded_modes(rods: Rods, tip: float, payloads: Sequence[Payload]) -> RodModes:
    """`rod_modes` with each of `k` payloads: frequencies `(k, n)`, participation `(k, n, 2)`, tip `(k, n)`.

    All at once: a fit calls this some ten thousand times.
    """
    hinges = rods.starts[1:]
    flexible = 1.0 / np.sqrt(rods.stiffness)
    outside = np.tri(rods.masses.size, hinges.size, -1)  # hinge j moves rods j+1 and on
    arms = (rods.centres[:, None] - hinges[None, :]) * outside * flexible
    turns = outside * flexible
    tip_arms = (tip - hinges) * flexible
    pulled, turned = rods.masses[:, None] * arms, rods.inertias[:, None] * turns
    total = np.sum(turned, axis=0)
    mass = np.array([p.mass for p in payloads])[:, None, None]
    rotary = np.array([p.inertia for p in payloads])[:, None, None]
    inertia = arms.T @ pulled + turns.T @ turned
    inertia = inertia + mass * np.outer(tip_arms, tip_arms) + rotary * np.outer(flexible, flexible)
    across = np.column_stack([np.sum(pulled, axis=0), rods.centres @ pulled + total])
    across = across + mass * np.outer(tip_arms, [1.0, tip]) + rotary * np.outer(flexible, [0.0, 1.0])
    values, vectors = np.linalg.eig(inertia)
    order = np.argsort(-np.real(values), axis=1)
    values = np.take_along_axis(values, order, axis=1)
    vectors = np.take_along_axis(vectors, order[:, None, :], axis=2)
    if not np.iscomplexobj(inertia):
        values, vectors = np.real(values), np.real(vectors)
    shapes = np.swapaxes(vectors / np.sqrt(np.sum(vectors * vectors, axis=1))[:, None, :], 1, 2)
    frequencies = 1.0 / np.sqrt(values)
    participation = (shapes @ across) * frequencies[:, :, None]
    tips = (shapes @ tip_arms) * frequencies
    signs = np.where(np.real(participation[:, :, 0]) < 0.0, -1.0, 1.0)
    return RodModes(frequencies, participation * signs[:, :, None], tips * signs)


def nodes_to_rods(masses: Numbers, lengths: Numbers, stiffness: Numbers) -> Rods:
    """Rods from node masses `(N + 1,)` and rod lengths `(N,)`.

    Inner nodes are shared half and half: the port does not notice.
    """
    x = np.concatenate([np.zeros(1), np.cumsum(lengths)])
    half = np.concatenate([masses[:1], masses[1:-1] / 2.0, masses[-1:]])
    a = np.concatenate([half[:1], half[1:-1]])
    b = np.concatenate([half[1:-1], half[-1:]])
    total = a + b
    return Rods(x[:-1], total, x[:-1] + lengths * b / total, a * b / total * lengths**2, stiffness)


def jacobian(function: Callable[[Numbers], Numbers], at: Array, step: float = 1e-30) -> Array:
    """Complex-step Jacobian `(r, p)` of an analytic `function` at `at` `(p,)`: exact to rounding, no step to choose."""
    columns = []
    for i in range(at.size):
        moved = at.astype(np.complex128)
        moved[i] += 1j * step
        columns.append(np.imag(function(moved)) / step)
    return np.array(columns).T
