"""The exact sampled response of a modal model to a log, its sensitivities, and the free response eliminated per piece.

A modal model in raw form: poles, residues of rate per torque, rigid residues. The input is held between samples, so that a
rate's sample depends on the torques before it. Within a piece of log without gaps, the free response (one amplitude and phase
per mode) and the constants of the sensors are the linear unknowns that variable projection eliminates.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from beamchain.ports.motions import Array

Complex = NDArray[np.complex128]

DECAY = 5.0  # nepers that a block of unequal steps may decay before double precision suffers
RIDGE = 1e-13  # relative, added to the normal matrix of what is eliminated


class Raw(NamedTuple):
    """A modal model as the data see it.

    Args:
        poles: `(n,)` in the upper half plane [rad/s].
        residues: `(n, outputs, inputs)` of rate per torque, `2 Re(G / (s - pole))`.
        shapes: `(n, outputs)` relative motion of the outputs in each mode.
        rigid: `(outputs, inputs)` angular acceleration per torque of the frozen craft.
    """

    poles: Complex
    residues: Complex
    shapes: Complex
    rigid: Array

    @classmethod
    def frozen(cls, rigid: Array) -> "Raw":
        """A model without modes."""
        none = np.zeros((0, *rigid.shape), dtype=np.complex128)
        return cls(none[:, 0, 0], none, none[:, :, 0], rigid)

    def sorted(self) -> "Raw":
        """Its modes by frequency."""
        order = np.argsort(self.poles.imag)
        return Raw(self.poles[order], self.residues[order], self.shapes[order], self.rigid)

    def flat(self) -> Array:
        """All as real numbers, mode by mode, the rigid part last."""
        rows = [
            np.concatenate([[p], g.ravel(), c]).view(np.float64)
            for p, g, c in zip(self.poles, self.residues, self.shapes, strict=True)
        ]
        return np.concatenate([*rows, self.rigid.ravel()])

    def columns(self, output: int) -> NDArray[np.intp]:
        """Places in `flat` of what output `output` depends on, in the order of `Piece.parts`."""
        outputs, inputs = self.rigid.shape
        size = 2 * (1 + outputs * inputs + outputs)
        own = np.array([0, 1, *(2 + 2 * output * inputs + np.arange(2 * inputs)), 0, 0], dtype=np.intp)
        own[-2:] = 2 * (1 + outputs * inputs + output) + np.arange(2)
        modes = [k * size + own for k in range(self.poles.size)]
        return np.concatenate([*modes, self.poles.size * size + output * inputs + np.arange(inputs)]).astype(np.intp)


class Assessed(NamedTuple):
    """Sums of squares per output that a model leaves; normal matrix, gradient and its covariance, of the parameters."""

    squares: Array
    matrix: Array = np.zeros((0, 0))
    gradient: Array = np.zeros(0)
    meat: Array = np.zeros((0, 0))


@dataclass(eq=False)
class Piece:
    """A stretch of a log without gaps.

    Args:
        time: `(N,)` [s].
        inputs: `(N, m)` torques [N m].
        outputs: `(N, p)` rates [rad/s] or attitudes [rad].
        use: `(N, p)` samples that count.
        angles: per output, whether it is an attitude.
        even: the steps are equal.
        log: number of the log that it is of.
    """

    time: Array
    inputs: Array
    outputs: Array
    use: NDArray[np.bool_]
    angles: tuple[bool, ...]
    even: bool
    log: int = 0
    once: Array = field(init=False, repr=False)
    twice: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        h = np.diff(self.time)[:, None]
        u = self.inputs[:-1]
        self.once = np.vstack([np.zeros_like(u[:1]), np.cumsum(h * u, axis=0)])
        turns = h * self.once[:-1] + h**2 / 2.0 * u
        self.twice = np.vstack([np.zeros_like(u[:1]), np.cumsum(turns, axis=0)])

    @property
    def steps(self) -> Array:
        """`(N - 1,)` [s]."""
        if not self.even:
            return np.diff(self.time)
        n = self.time.size
        return np.full(n - 1, (self.time[-1] - self.time[0]) / (n - 1))

    def part(self, start: int, end: int) -> "Piece":
        """The samples from `start` to `end`."""
        columns = {name: getattr(self, name)[start:end] for name in ("time", "inputs", "outputs", "use")}
        return replace(self, **columns)

    def constants(self, output: int) -> Array:
        """What a sensor adds of its own: its bias, which grows in an attitude."""
        t = (self.time - self.time[0]) / max(self.time[-1] - self.time[0], 1e-300)
        return np.column_stack([np.ones_like(t), t] if self.angles[output] else [np.ones_like(t)])

    def states(self, pole: complex, *, slope: bool = True) -> tuple[Complex, Complex]:
        """`(N, m)` modal state per unit of input, and its derivative with respect to the pole (empty without `slope`)."""
        h = self.steps[:1] if self.even else self.steps
        e = np.exp(pole * h)
        held = np.expm1(pole * h) / pole
        u = self.inputs[:-1]
        state = self._recur(pole, e, held[:, None] * u)
        if not slope:
            return state, state[:0]
        tilt = h * e / pole - held / pole
        return state, self._recur(pole, e, (h * e)[:, None] * state[:-1] + tilt[:, None] * u)

    def _recur(self, pole: complex, e: Complex, v: Complex) -> Complex:
        """`x[j + 1] = e[j] x[j] + v[j]` from zero."""
        if self.even:
            full = np.vstack([v, np.zeros_like(v[:1])])
            return np.asarray(lfilter([0.0, 1.0], [1.0, -e[0]], full, axis=0), dtype=np.complex128)
        out = np.zeros((self.time.size, v.shape[1]), dtype=np.complex128)
        most = DECAY / max(abs(pole.real), 1e-300)
        start = 0
        while start < v.shape[0]:
            end = min(max(int(np.searchsorted(self.time, self.time[start] + most)), start + 1), v.shape[0])
            t = pole * (self.time[start : end + 1] - self.time[start])
            grown = np.cumsum(np.exp(-t[1:])[:, None] * v[start:end], axis=0)
            out[start + 1 : end + 1] = np.exp(t[1:])[:, None] * (out[start] + grown)
            start = end
        return out

    def forced(self, raw: Raw) -> Array:
        """`(N, p)` motion that the inputs make of a model at rest."""
        return self._forced(raw, [self.states(complex(pole), slope=False) for pole in raw.poles])

    def assess(
        self, raw: Raw, weights: Array, slopes: Array | None = None, lags: int = 0, *, whole: bool = False
    ) -> tuple[Assessed, Array]:
        """Residuals of a model, its free response chosen best, and what they say of the parameters.

        Args:
            raw: the model.
            weights: `(p,)` inverse standard deviations of the outputs.
            slopes: `(raw, parameters)` derivatives of `raw.flat()`; left out: residuals only.
            lags: how far residuals may be correlated, for the covariance of the gradient.
            whole: residuals of samples that do not count too.

        Returns:
            Sums, and residuals `(N, p)`.
        """
        n, p = self.outputs.shape
        parts = [self.states(complex(pole), slope=slopes is not None) for pole in raw.poles]
        t = self.time - self.time[0]
        free = [np.exp(pole * t) for pole in raw.poles]
        own = [self.constants(i) for i in range(p)]
        ends = np.cumsum([2 * raw.poles.size, *(c.shape[1] for c in own)])
        count = int(ends[-1])
        bases = [np.zeros((n, count), order="F") for _ in range(p)]
        for i, basis in enumerate(bases):
            for k, pole in enumerate(raw.poles):
                one = raw.shapes[k, i] / (pole if self.angles[i] else 1.0) * free[k]
                basis[:, 2 * k], basis[:, 2 * k + 1] = one.real, -one.imag
            basis[:, ends[i] : ends[i + 1]] = own[i]
        used = [_used(self.use[:, i]) for i in range(p)]
        shown = [basis[use] for basis, use in zip(bases, used, strict=True)]
        normal = np.sum([weights[i] ** 2 * shown[i].T @ shown[i] for i in range(p)], axis=0)
        size = np.sqrt(np.diag(normal)) + 1e-300
        scaled = normal / np.outer(size, size) + RIDGE * np.eye(count)
        residual, held = self.outputs - self._forced(raw, parts), np.zeros(count)
        for _ in range(3):  # the second and third time for the digits that the normal matrix loses
            right = np.sum([weights[i] ** 2 * shown[i].T @ residual[used[i], i] for i in range(p)], axis=0)
            change = np.linalg.solve(scaled, right / size) / size
            held += change
            residual -= np.column_stack([basis @ change for basis in bases])
        squares = np.array([np.sum(residual[used[i], i] ** 2) for i in range(p)])
        if not whole:
            residual = np.where(self.use, residual, 0.0)
        if slopes is None:
            return Assessed(squares), residual
        amplitudes = held[: 2 * raw.poles.size : 2] + 1j * held[1 : 2 * raw.poles.size : 2]
        m = slopes.shape[1]
        total, cross = np.zeros((m, m)), np.zeros((count, m))
        gradient, meat = np.zeros(m), np.zeros((m, m))
        rows = list[Array]()
        for i in range(p):
            parted = self._parts(raw, parts, free, amplitudes, i)[used[i]] @ slopes[raw.columns(i)]
            parted *= weights[i]
            total += parted.T @ parted
            cross += weights[i] * shown[i].T @ parted
            gradient += parted.T @ (weights[i] * residual[used[i], i])
            if lags:
                rows.append(parted)
        solved = np.linalg.solve(scaled, cross / size[:, None]) / size[:, None]
        for i, parted in enumerate(rows):
            score = (parted - weights[i] * shown[i] @ solved) * (weights[i] * residual[used[i], i])[:, None]
            meat += score.T @ score
            for lag in range(1, min(lags, score.shape[0])):
                one = (1.0 - lag / lags) * score[:-lag].T @ score[lag:]
                meat += one + one.T
        return Assessed(squares, total - cross.T @ solved, gradient, meat), residual

    def driven(self, output: int) -> Array:
        """`(N, m)` motion of an output per unit of acceleration by each torque of a frozen craft."""
        return self.twice if self.angles[output] else self.once

    def seen(self, state: Complex, pole: complex, output: int) -> Complex:
        """`(N, m)` what an output sees of the states of a mode."""
        return (state - self.once) / pole if self.angles[output] else state

    def _forced(self, raw: Raw, parts: list[tuple[Complex, Complex]]) -> Array:
        out = np.column_stack([self.driven(i) @ rigid for i, rigid in enumerate(raw.rigid)])
        for pole, residue, (state, _) in zip(raw.poles, raw.residues, parts, strict=True):
            for i, own in enumerate(residue):
                out[:, i] += 2.0 * (self.seen(state, pole, i) @ own).real
        return out

    def _parts(
        self, raw: Raw, parts: list[tuple[Complex, Complex]], free: list[Complex], amplitudes: Complex, i: int
    ) -> Array:
        """`(N, columns)` derivatives of an output with respect to its raw numbers; see `Raw.columns`."""
        out = np.empty((self.time.size, raw.columns(i).size), order="F")
        t = self.time - self.time[0]
        inputs = self.inputs.shape[1]
        width = 4 + 2 * inputs
        for k, (state, slope) in enumerate(parts):
            pole = raw.poles[k]
            seen = self.seen(state, pole, i)
            held = amplitudes[k] * free[k] / 2.0  # halved: real parts are not doubled in the bases
            if self.angles[i]:
                held = held / pole
                slope = (slope - seen) / pole
            turned = slope @ raw.residues[k, i] + raw.shapes[k, i] * held * (t - 1.0 / pole if self.angles[i] else t)
            at = k * width
            for c, one in enumerate((turned, *seen.T, held)):
                np.multiply(one.real, 2.0, out=out[:, at + 2 * c])
                np.multiply(one.imag, -2.0, out=out[:, at + 2 * c + 1])
        out[:, width * len(parts) :] = self.driven(i)
        return out


def _used(use: NDArray[np.bool_]) -> slice | NDArray[np.intp]:
    """Samples that count, as a slice where they are one stretch."""
    at = np.flatnonzero(use)
    if at.size and at[-1] - at[0] + 1 == at.size:
        return slice(int(at[0]), int(at[-1]) + 1)
    return at


@dataclass(eq=False)
class Spectrum:
    """A measured frequency response of one pair.

    Args:
        omega: `(N,)` [rad/s].
        value: `(N,)` response per torque.
        output, input: which pair.
        order: 1: acceleration, 0: rate, -1: attitude.
        accuracy: `(N,)` relative standard deviation, up to a common factor.
    """

    omega: Array
    value: Complex
    output: int
    input: int
    order: int
    accuracy: Array

    @property
    def weight(self) -> Complex:
        """`(N,)` what a rate per torque is multiplied with to be relative."""
        return np.asarray((1j * self.omega) ** self.order / (self.accuracy * np.abs(self.value)), dtype=np.complex128)

    def assess(
        self, raw: Raw, weights: Array, slopes: Array | None = None, lags: int = 0, *, whole: bool = False
    ) -> tuple[Assessed, Complex]:
        """As for `Piece`; residuals `(N,)` are complex and relative."""
        del lags, whole
        s = 1j * self.omega
        scale = self.weight
        i, m = self.output, self.input
        one, other = 1.0 / (s[:, None] - raw.poles), 1.0 / (s[:, None] - raw.poles.conj())
        g = raw.residues[:, i, m]
        residual = scale * (self.value / s**self.order - one @ g - other @ g.conj() - raw.rigid[i, m] / s)
        squares = np.zeros(raw.rigid.shape[0])
        squares[i] = float(np.sum(np.abs(residual) ** 2))
        if slopes is None:
            return Assessed(squares), residual
        table = np.zeros((s.size, slopes.shape[0]), dtype=np.complex128)
        outputs, inputs = raw.rigid.shape
        size = 2 * (1 + outputs * inputs + outputs)
        for k in range(raw.poles.size):
            a, b = one[:, k], other[:, k]
            da, db = g[k] * a**2, g[k].conj() * b**2
            at = k * size + 2 + 2 * (i * inputs + m)
            table[:, k * size], table[:, k * size + 1] = da + db, 1j * (da - db)
            table[:, at], table[:, at + 1] = a + b, 1j * (a - b)
        table[:, raw.poles.size * size + i * inputs + m] = 1.0 / s
        parted = (weights[i] * scale)[:, None] * (table @ slopes)
        both, left = np.vstack([parted.real, parted.imag]), weights[i] * np.concatenate([residual.real, residual.imag])
        meat = both.T @ (left[:, None] ** 2 * both)
        return Assessed(squares, both.T @ both, both.T @ left, meat), residual


Data = Piece | Spectrum
