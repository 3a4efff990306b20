"""Response of a craft in modal form, mode by mode: what each mode contributes to an output."""

from collections.abc import Sequence
from math import factorial

import numpy as np
from scipy.linalg import expm
from scipy.sparse.csgraph import connected_components

from beamchain.toolkit import Array, Complex, ModalForm

SKEW = 1e8  # condition of eigenvectors beyond which they are not used
REST = "rigid motion"  # all that belongs to no flexible mode: rigid motion, servos, nutation


class ModalResponse:
    """A modal form's outputs as sums of contributions of its flexible modes and of the rest.

    Args:
        form: the craft's.
        modes: names of its flexible modes; those that the form has lost do not contribute.

    Attributes:
        names: of what contributes; the last is the rest.
    """

    names: tuple[str, ...]

    def __init__(self, form: ModalForm, modes: Sequence[str]) -> None:
        kept = form.oscillators(modes)
        self.form = form
        self.names = (*kept, REST)
        self._owner = np.full(len(form.names), len(kept), dtype=np.intp)
        for number, name in enumerate(kept):
            for state in (name, f"{name}_rate"):
                self._owner[form.names.index(state)] = number
        _, group_of = connected_components(form.a != 0.0, directed=False)
        self._blocks = [np.flatnonzero(group_of == k) for k in np.unique(group_of)]

    @property
    def poles(self) -> Complex:
        """Of all blocks."""
        of_blocks = [np.linalg.eigvals(self.form.a[np.ix_(b, b)]) for b in self._blocks]
        return np.concatenate([np.zeros(0), *of_blocks]).astype(np.complex128)

    def parts(self, omega: Array, drive: Array | Complex) -> Complex:
        """`(names, k, outputs)` contributions at frequencies `(k,)` [rad/s] of inputs
        `(inputs,)`.

        They add up to the response.
        """
        form = self.form
        s = np.asarray(1j * omega, dtype=np.complex128)
        out = np.zeros((len(self.names), s.size, form.c.shape[0]), dtype=np.complex128)
        driven = form.b @ drive
        for block in self._blocks:
            matrix = s[:, None, None] * np.eye(block.size) - form.a[np.ix_(block, block)]
            rhs = np.broadcast_to(driven[block], (s.size, block.size)).astype(np.complex128)
            states = np.linalg.solve(matrix, rhs[:, :, None])[:, :, 0]
            for number in np.unique(self._owner[block]):
                those = self._owner[block] == number
                out[number] += states[:, those] @ form.c[:, block[those]].T
        out[-1] += form.d @ drive
        return out

    def exponential_parts(self, times: Array, drive: Array, time_constant: float) -> Array:
        """`(names, k, outputs)` contributions at times `(k,)` [s], from rest, of inputs
        `(inputs,)` times `1 - exp(-t / time_constant)`.
        """
        form = self.form
        out = np.zeros((len(self.names), times.size, form.c.shape[0]))
        driven = form.b @ drive
        for block in self._blocks:
            matrix = form.a[np.ix_(block, block)]
            states = _exponential_states(matrix, driven[block], times, time_constant)
            for number in np.unique(self._owner[block]):
                those = self._owner[block] == number
                out[number] += states[:, those] @ form.c[:, block[those]].T
        out[-1] += np.outer(-np.expm1(-times / time_constant), form.d @ drive)
        return out


def _exponential_states(matrix: Array, drive: Array, times: Array, time_constant: float) -> Array:
    """`(k, n)` states of `x' = A x + b (1 - exp(-t / time_constant))`, from rest, at times."""
    n = drive.size
    poles, vectors = np.linalg.eig(matrix)
    if not np.any(np.linalg.matrix_power(matrix, n)):  # a chain of integrators
        load = -np.expm1(-times / time_constant)
        out = np.zeros((times.size, n))
        integral = load
        for k in range(n):
            # (k + 1)-fold integral of the load: t^(k+1)/(k+1)! less tau times the k-fold one
            integral = times ** (k + 1) / factorial(k + 1) - time_constant * integral
            out += np.outer(integral, np.linalg.matrix_power(matrix, k) @ drive)
        return out
    if np.linalg.cond(vectors) > SKEW:  # over (x, 1, exp(-t/tau))
        both = np.zeros((n + 2, n + 2))
        both[:n, :n] = matrix
        both[:n, n] = drive
        both[:n, n + 1] = -drive
        both[n + 1, n + 1] = -1.0 / time_constant
        start = np.append(np.zeros(n), [1.0, 1.0])
        return np.asarray(expm(times[:, None, None] * both) @ start, dtype=np.float64)[:, :n]
    weights = np.linalg.solve(vectors, drive.astype(np.complex128))
    # z' = p z + w (1 - exp(q t)), q = -1/tau:
    # z = w [(exp(p t) - 1)/p - (exp(p t) - exp(q t))/(p - q)]
    constant = _difference_of_exponentials(times, poles.astype(np.complex128), 0.0)
    decaying = _difference_of_exponentials(times, poles.astype(np.complex128), -1.0 / time_constant)
    return np.asarray(np.real(((constant - decaying) * weights) @ vectors.T), dtype=np.float64)


def _difference_of_exponentials(times: Array, p: Complex, q: float) -> Complex:
    """`(k, n)` values of `(exp(p t) - exp(q t)) / (p - q)`."""
    t = times[:, None]
    z = t * (p - q)
    near = np.abs(z) < 1.0
    beside = np.where(z == 0.0, 1.0, z)
    small = np.where(near, beside, 0.5)
    mean = np.where(z == 0.0, 1.0, np.expm1(small) / small)
    apart = np.where(p == q, 1.0, p - q)
    far = (np.exp(t * p) - np.exp(t * q)) / apart
    return np.where(near, t * np.exp(t * q) * mean, far)
