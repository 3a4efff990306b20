"""Response of a craft in modal form, mode by mode: what each mode contributes to an output."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.sparse.csgraph import connected_components

from beamchain.toolkit import Array, Complex, ModalForm

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
            self._owner[form.states_of(name)] = number
        _, group_of = connected_components(form.a != 0.0, directed=False)
        blocks = [np.flatnonzero(group_of == k) for k in np.unique(group_of)]
        self._matrices = [(block, form.a[np.ix_(block, block)]) for block in blocks]

    @property
    def poles(self) -> Complex:
        """Of all blocks."""
        of_blocks = [np.linalg.eigvals(a) for _, a in self._matrices]
        return np.concatenate([np.zeros(0), *of_blocks]).astype(np.complex128)

    def oscillator_near(self, frequency: float) -> str:
        """Name of the oscillator nearest to a frequency [rad/s]."""
        names = self.form.oscillators([n for n in self.form.names if not n.startswith("rigid_")])
        return min(names, key=lambda name: abs(self.frequency(name) - frequency), default="a mode")

    def frequency(self, oscillator: str) -> float:
        """[rad/s]."""
        return float(np.abs(self.form.poles_of(oscillator)).max())

    def parts(self, omega: Array, drive: Array | Complex) -> Complex:
        """`(names, k, outputs)` contributions at frequencies `(k,)` [rad/s] of inputs
        `(inputs,)`.

        They add up to the response.
        """
        driven = self.form.b @ drive
        s = np.asarray(1j * omega, dtype=np.complex128)[:, None, None]
        states = [
            np.linalg.solve(s * np.eye(len(a)) - a, driven[block][None, :, None])[:, :, 0]
            for block, a in self._matrices
        ]
        through = np.tile(self.form.d @ drive, (s.size, 1)).astype(np.complex128)
        return self._by_name(states, through)

    def rising_parts(self, times: Array, rise: float) -> Array:
        """`(names, k, outputs)` contributions at equally spaced times `(k,)` [s], from rest, of the
        first input times `1 - exp(-t / rise)`.

        They add up to the error.
        """
        drive = self.form.b[:, 0]
        states = [rising_states(a, drive[block], times, rise) for block, a in self._matrices]
        through = np.outer(-np.expm1(-times / rise), self.form.d[:, 0])
        return self._by_name(states, through)

    def _by_name(self, states: Sequence[Any], through: Any) -> Any:
        """`(names, k, outputs)` what is seen of the states `(k, n)` of every block; what passes
        `through` `(k, outputs)` is of the rest."""
        out = np.zeros((len(self.names), *through.shape), dtype=through.dtype)
        for (block, _), of_block in zip(self._matrices, states, strict=True):
            for number in np.unique(self._owner[block]):
                those = self._owner[block] == number
                out[number] += of_block[:, those] @ self.form.c[:, block[those]].T
        out[-1] += through
        return out


def rising_states(matrix: Array, drive: Array, times: Array, rise: float) -> Array:
    """`(k, n)` states of `x' = A x + b (1 - exp(-t / rise))`, from rest, at equally spaced times.

    With `z = (x, 1, exp(-t / rise))` that is `z' = Z z`: `z(t) = exp(Z t) z(0)`, and what holds for
    k samples gives the next k, `k h` later, `z(t + k h) = exp(Z k h) z(t)`.
    """
    n = drive.size
    whole = np.zeros((n + 2, n + 2))
    whole[:n, :n] = matrix
    whole[:n, n] = drive
    whole[:n, n + 1] = -drive
    whole[n + 1, n + 1] = -1.0 / rise
    states = (expm(times[0] * whole) @ np.append(np.zeros(n), [1.0, 1.0]))[None]
    while len(states) < times.size:
        later = times[len(states)] - times[0]
        states = np.concatenate([states, states @ expm(later * whole).T])
    return np.asarray(states[: times.size, :n], dtype=np.float64)
