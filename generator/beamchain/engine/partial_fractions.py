"""The accelerance of a linear model as a sum over its damped poles: one eigenvalue problem, then
any number of frequencies at next to no cost.

Motions that no spring holds are taken apart by mass: `q = (x, xi)` with `M = diag(T^2, 1)`,
`K = diag(1, 0)` and the damping `[[c, d], [d^T, g]]`. What is not damped either is rigid, and a
constant. In `mu = 1/s`, where slow poles keep their digits, the rest is first order in
`z = (x, s T x, s xi)` with

    (s A - 1) z = (d g^-1 f_xi - f_x, 0, -g^-1 f_xi)

    A = [[d g^-1 d^T - c, -T, d g^-1], [T, 0, 0], [-g^-1 d^T, 0, -g^-1]]
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cholesky, eigh, solve_triangular

from beamchain.engine.linear import Linear
from beamchain.ports.motions import Array

MOST = 400  # coordinates: more take over a second as an eigenvalue problem
SAME = 1e-8  # of the response: how well the sum must give it
TRIED = (0.01, 0.3, 1.0)  # of the band: where that is tried
UNDAMPED = 1e-13  # of the largest rate of unsprung motions, below which one is rigid

Accelerance = Callable[[Array], NDArray[np.complex128]]


@dataclass(frozen=True, eq=False)
class PartialFractions:
    """`constant + sum_k (s^2 sprung_k + s unsprung_k) / (s mu_k - 1)`.

    Args:
        slowness: `(n,)` mu, the inverse poles [s].
        sprung, unsprung: `(n, p, m)`.
        constant: `(p, m)` of rigid motion.
    """

    slowness: NDArray[np.complex128]
    sprung: NDArray[np.complex128]
    unsprung: NDArray[np.complex128]
    constant: Array

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Those of motion that is sprung or damped [1/s]."""
        return 1.0 / self.slowness[self.slowness != 0.0]

    def __call__(self, omega: Array) -> NDArray[np.complex128]:
        """The response `(p, m, k)` at `omega` `(k,)` [rad/s]."""
        s = 1j * np.asarray(omega, dtype=np.float64)[:, None]
        count = self.constant.size
        weight = s / (s * self.slowness - 1.0)
        elastic = (weight * s) @ self.sprung.reshape(-1, count)
        if np.any(self.unsprung):
            elastic = elastic + weight @ self.unsprung.reshape(-1, count)
        shape = s.shape[0], *self.constant.shape
        return np.moveaxis(self.constant + elastic.reshape(shape), 0, -1)


def partial_fractions(linear: Linear, band: float, plain: Accelerance) -> PartialFractions | None:
    """Of a model whose outputs are accelerations, good up to a band [rad/s]; None where it has
    another form, is too large, or where the sum is not `plain`, its response at each frequency."""
    fractions = _fractions(linear)
    if fractions is None:
        return None
    trial = band * np.array(TRIED)
    there = plain(trial)
    apart = np.abs(fractions(trial) - there).max(axis=(0, 1))
    return fractions if np.all(apart <= SAME * np.abs(there).max(axis=(0, 1))) else None


def _fractions(linear: Linear) -> PartialFractions | None:
    outputs = linear.outputs
    others = (outputs.position, outputs.rate, outputs.feedthrough)
    if linear.activations.names or any(np.any(part) for part in others):
        return None
    if linear.mass.shape[0] > MOST or not np.array_equal(linear.damping, linear.damping.T):
        return None
    try:
        return _by_poles(linear)
    except (LinAlgError, np.linalg.LinAlgError):  # a negative spring, or poles that coincide
        return None


def _by_poles(linear: Linear) -> PartialFractions:
    mass, damping, stiffness = linear.mass, linear.damping, linear.stiffness
    loose = ~np.any(stiffness, axis=1)
    unsprung, sprung = np.flatnonzero(loose), np.flatnonzero(~loose)
    # columns: unsprung motions of unit mass that do not move the sprung ones
    root = cholesky(mass[np.ix_(unsprung, unsprung)], lower=True)
    still = np.zeros((mass.shape[0], unsprung.size))
    still[unsprung] = solve_triangular(root, np.eye(unsprung.size), lower=True, trans=1)
    rates, turn = np.linalg.eigh(still.T @ damping @ still)
    still = still @ turn
    is_rigid = rates <= UNDAMPED * np.max(rates, initial=0.0)
    rigid, dragged = still[:, is_rigid], still[:, ~is_rigid]
    # columns: the sprung modes, with what moves along by inertia
    moving = np.zeros((mass.shape[0], sprung.size))
    moving[sprung] = np.eye(sprung.size)
    moving -= still @ (still.T @ mass[:, sprung])
    free = moving.T @ mass @ moving
    held = stiffness[np.ix_(sprung, sprung)]
    squares, modes = eigh((free + free.T) / 2.0, (held + held.T) / 2.0)
    moving = moving @ modes
    slowness = np.diag(np.sqrt(np.maximum(squares, 0.0)))

    n, count = sprung.size, rates.size - int(np.sum(is_rigid))
    damped = moving.T @ damping @ moving
    cross = moving.T @ damping @ dragged / rates[~is_rigid]
    states = np.block(
        [
            [cross @ (dragged.T @ damping @ moving) - damped, -slowness, cross],
            [slowness, np.zeros((n, n + count))],
            [-cross.T, np.zeros((count, n)), -np.diag(1.0 / rates[~is_rigid])],
        ]
    )
    inverse_poles, vectors = np.linalg.eig(states)
    vectors = vectors.astype(np.complex128)
    pushed, seen = linear.inputs.force, linear.outputs.acceleration
    drag = dragged.T @ pushed
    given = np.vstack(
        [
            cross @ drag - moving.T @ pushed,
            np.zeros((n, pushed.shape[1])),
            -drag / rates[~is_rigid, None],
        ]
    )
    given = np.asarray(np.linalg.solve(vectors, given), dtype=np.complex128)
    by_modes = seen @ moving @ vectors[:n]
    by_drag = seen @ dragged @ vectors[2 * n :]
    return PartialFractions(
        slowness=inverse_poles.astype(np.complex128),
        sprung=_products(by_modes, given),
        unsprung=_products(by_drag, given),
        constant=seen @ rigid @ rigid.T @ pushed,
    )


def _products(
    read: NDArray[np.complex128], given: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """`(n, p, m)` of what outputs `(p, n)` read of states `(n, m)`."""
    return read.T[:, :, None] * given[:, None, :]
