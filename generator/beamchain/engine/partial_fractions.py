"""The accelerance of a linear model as a sum over its damped poles: one eigenvalue problem, then
any number of frequencies at next to no cost.

Rigid motions, which nothing springs or damps, split off. What is left has undamped modes of
frequencies W and damping C over them. In coordinates `W q` and in `mu = 1/s`, where slow poles
keep their digits,

    s^2 y (s^2 + s C + W^2)^-1 f = y' (mu^2 + mu C' + W^-2)^-1 f',   y' = y W^-1, C' = W^-1 C W^-1

which is first order in `(W^-1 x, mu x)` with the matrix `[[0, W^-1], [-W^-1, -C']]`.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, eigh

from beamchain.engine.linear import Linear
from beamchain.ports.motions import Array

MOST = 400  # coordinates: more take over a second as an eigenvalue problem
SAME = 1e-8  # of the response: how well the sum must give it
TRIED = (0.01, 0.3, 1.0)  # of the band: where that is tried

Accelerance = Callable[[Array], NDArray[np.complex128]]


def accelerance_of(linear: Linear, band: float, plain: Accelerance) -> Accelerance:
    """The response `(p, m, k)` of a model whose outputs are accelerations, as a function of
    frequencies `(k,)` up to a band [rad/s]; `plain` is the same frequency by frequency, and comes
    back where the sum is no use."""
    fractions = _fractions(linear)
    if fractions is None:
        return plain
    trial = band * np.array(TRIED)
    there = plain(trial)
    apart = np.abs(fractions(trial) - there).max(axis=(0, 1))
    return fractions if np.all(apart <= SAME * np.abs(there).max(axis=(0, 1))) else plain


def _fractions(linear: Linear) -> Accelerance | None:
    """The sum; None for a model that has not the form it takes."""
    outputs = linear.outputs
    others = (outputs.position, outputs.rate, outputs.feedthrough)
    if linear.activations.names or any(np.any(part) for part in others):
        return None
    mass, damping, stiffness = linear.mass, linear.damping, linear.stiffness
    if mass.shape[0] > MOST or not np.array_equal(damping, damping.T):
        return None
    is_still = ~np.any(stiffness, axis=1) & ~np.any(damping, axis=1)
    still, moving = np.flatnonzero(is_still), np.flatnonzero(~is_still)
    pushed = linear.inputs.force
    seen = outputs.acceleration
    rigid = mass[np.ix_(still, still)]
    follow = np.linalg.solve(rigid, np.hstack([mass[np.ix_(still, moving)], pushed[still]]))
    by_moving, by_force = follow[:, : moving.size], follow[:, moving.size :]
    constant = seen[:, still] @ by_force
    free = mass[np.ix_(moving, moving)] - mass[np.ix_(moving, still)] @ by_moving
    try:
        squares, shapes = eigh((free + free.T) / 2.0, stiffness[np.ix_(moving, moving)])
    except LinAlgError:  # a damper without a spring
        return None
    slowness = np.diag(np.sqrt(np.maximum(squares, 0.0)))
    damped = shapes.T @ damping[np.ix_(moving, moving)] @ shapes
    states = np.block([[np.zeros_like(slowness), slowness], [-slowness, -damped]])
    poles, vectors = np.linalg.eig(states)
    force = shapes.T @ (pushed[moving] - by_moving.T @ pushed[still])
    try:
        given = np.linalg.solve(vectors, np.vstack([np.zeros_like(force), force]))
    except np.linalg.LinAlgError:  # poles that coincide
        return None
    read = (seen[:, moving] - seen[:, still] @ by_moving) @ shapes @ vectors[moving.size :]
    products = read.T[:, :, None] * given[:, None, :]

    return partial(_accelerance, poles, products.astype(np.complex128), constant)


def _accelerance(
    poles: NDArray[np.complex128],
    products: NDArray[np.complex128],
    constant: Array,
    omega: Array,
) -> NDArray[np.complex128]:
    """The sum at frequencies `(k,)` [rad/s]."""
    s = 1j * np.asarray(omega, dtype=np.float64)
    weight = s[:, None] ** 2 / (1.0 - s[:, None] * poles)
    size = products.shape[1:]
    table = products.reshape(poles.size, size[0] * size[1])  # a rigid craft has no poles
    elastic = (weight @ table).reshape(s.size, *size)
    return np.moveaxis(constant + elastic, 0, -1)
