"""The exact sampled response of a modal model to a log, its sensitivities,
and the free response eliminated per piece.

A modal model in raw form: poles, residues of rate per torque, rigid residues. The input is held
between samples, so that a rate's sample depends on the torques before it; a delay moves every
torque later by the same time. Within a piece of log without gaps, the free response (one amplitude
and phase per mode) and the constants of the sensors are the linear unknowns that variable
projection eliminates.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from beamchain.toolkit import Array

Complex = NDArray[np.complex128]

DECAY = 5.0  # nepers that a block of unequal steps may decay before double precision suffers
SWITCH = 1e-6  # of a step, within which a delayed torque changes at a sample itself
RIDGE = 1e-13  # relative, added to the normal matrix of what is eliminated


class Raw(NamedTuple):
    """A modal model as the data see it.

    Args:
        poles: `(n,)` in the upper half plane [rad/s].
        residues: `(n, outputs, inputs)` of rate per torque, `2 Re(G / (s - pole))`.
        shapes: `(n, outputs)` relative motion of the outputs in each mode.
        rigid: `(outputs, inputs)` angular acceleration per torque of the frozen craft.
        delay: [s] by which torques act later than their samples say.
    """

    poles: Complex
    residues: Complex
    shapes: Complex
    rigid: Array
    delay: float = 0.0

    @classmethod
    def without_modes(cls, rigid: Array) -> "Raw":
        """A model without modes."""
        none = np.zeros((0, *rigid.shape), dtype=np.complex128)
        return cls(none[:, 0, 0], none, none[:, :, 0], rigid)

    def sorted(self) -> "Raw":
        """Its modes by frequency."""
        order = np.argsort(self.poles.imag)
        return self._replace(
            poles=self.poles[order], residues=self.residues[order], shapes=self.shapes[order]
        )

    def flat(self) -> Array:
        """All as real numbers, mode by mode, then the rigid part, the delay last."""
        rows = [
            np.concatenate([[p], g.ravel(), c]).view(np.float64)
            for p, g, c in zip(self.poles, self.residues, self.shapes, strict=True)
        ]
        return np.concatenate([*rows, self.rigid.ravel(), [self.delay]])

    def columns(self, output: int) -> NDArray[np.intp]:
        """Places in `flat` of what output `output` depends on, in the order of `Piece.parts`."""
        outputs, inputs = self.rigid.shape
        size = 2 * (1 + outputs * inputs + outputs)
        places = np.array(
            [0, 1, *(2 + 2 * output * inputs + np.arange(2 * inputs)), 0, 0], dtype=np.intp
        )
        places[-2:] = 2 * (1 + outputs * inputs + output) + np.arange(2)
        modes = [k * size + places for k in range(self.poles.size)]
        rigid = self.poles.size * size + output * inputs + np.arange(inputs)
        delay = [self.poles.size * size + outputs * inputs]
        return np.concatenate([*modes, rigid, delay]).astype(np.intp)


class Assessed(NamedTuple):
    """Sums of squares per output that a model leaves; normal matrix, gradient and its covariance,
    of the parameters."""

    squares: Array
    matrix: Array = np.zeros((0, 0))
    gradient: Array = np.zeros(0)
    meat: Array = np.zeros((0, 0))


class Held(NamedTuple):
    """The torque that acts at each sample once it is delayed, and the motion of a frozen craft.

    Args:
        sample: `(N,)` the one from which on it acts.
        since: `(N, 1)` or `(1, 1)` time [s] that it has acted.
        torque: `(N, m)`; zero before the first torque of the piece arrives.
        acting: `(N, m)` the same; where it changes just then, the mean of both.
        once, twice: `(N, m)` its integral over time, and that one's integral.
    """

    sample: NDArray[np.intp]
    since: Array
    torque: Array
    acting: Array
    once: Array
    twice: Array


class State(NamedTuple):
    """Of one mode, per unit of its drive, each `(N, m)`:
    its value, and the derivatives with respect to the pole and to time."""

    value: Complex
    by_pole: Complex
    rate: Complex


@dataclass(eq=False)
class Piece:
    """A stretch of a log without gaps.

    Args:
        time: `(N,)` [s].
        inputs: `(N, m)` torques [N m].
        outputs: `(N, p)` rates [rad/s] or attitudes [rad].
        use: `(N, p)` samples that count.
        kinds: per output: "rate", "attitude", or "mean_rate" since the sample before.
        even: the steps are equal.
        log: number of the log that it is of.
    """

    time: Array
    inputs: Array
    outputs: Array
    use: NDArray[np.bool_]
    kinds: tuple[str, ...]
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
        columns = {
            name: getattr(self, name)[start:end] for name in ("time", "inputs", "outputs", "use")
        }
        return replace(self, **columns)

    def trimmed(self, samples: int) -> "Piece":
        """The piece with so many samples at either end that do not count."""
        use = self.use.copy()
        use[:samples] = False
        use[self.time.size - samples :] = False
        return replace(self, use=use)

    def constants(self, output: int) -> Array:
        """What a sensor adds of its own: its bias, which grows in an attitude."""
        t = (self.time - self.time[0]) / max(self.time[-1] - self.time[0], 1e-300)
        drifts = self.kinds[output] == "attitude"
        return np.column_stack([np.ones_like(t), t] if drifts else [np.ones_like(t)])

    def held(self, delay: float) -> Held:
        """The torques, later by `delay` [s] than the log says."""
        n = self.time.size
        if self.even:
            step = float(self.steps[0])
            whole = int(np.ceil(delay / step))
            index = np.arange(n) - whole
            since = np.array([[whole * step - delay]])
        else:
            step = float(np.median(self.steps))
            at = self.time - delay
            index = np.searchsorted(self.time, at, side="right") - 1
            since = (at - self.time[np.clip(index, 0, n - 1)])[:, None]
        early = index < 0
        index = np.clip(index, 0, n - 1).astype(np.intp)
        torque = np.where(early[:, None], 0.0, self.inputs[index])
        before = self.inputs[np.maximum(index - 1, 0)]
        after = self.inputs[np.minimum(index + 1, n - 1)]
        left = np.append(self.steps, np.inf)[index][:, None] - since  # s until the next one acts
        acting = np.where(since < SWITCH * step, (before + torque) / 2.0, torque)
        acting = np.where(np.abs(left) < SWITCH * step, (torque + after) / 2.0, acting)
        acting[early] = 0.0
        if not self.even:
            since[early] = 0.0
        # integrals over a held torque: once + u t, and twice + once t + u t^2 / 2
        once = self.once[index] + since * torque
        twice = self.twice[index] + since * self.once[index] + since**2 / 2.0 * torque
        twice[early] = 0.0
        return Held(index, since, torque, acting, once, twice)

    def state(self, pole: complex, held: Held, *, slopes: bool = True) -> State:
        """The state of a mode under held torques; its derivatives are empty without `slopes`."""
        h = self.steps[:1] if self.even else self.steps
        decay = np.exp(pole * h)
        gain = np.expm1(pole * h) / pole
        u = self.inputs[:-1]
        value = self._recur(pole, decay, gain[:, None] * u)
        # from its sample on, a state moves as x(t) = e^(p t) x + (e^(p t) - 1) / p u
        t = held.since
        later = np.exp(pole * t)
        driven = np.expm1(pole * t) / pole
        start = value[held.sample]
        moved = later * start + driven * held.torque
        if not slopes:
            return State(moved, moved[:0], moved[:0])
        tilt = h * decay / pole - gain / pole
        by_pole = self._recur(pole, decay, (h * decay)[:, None] * value[:-1] + tilt[:, None] * u)
        by_pole = (
            later * by_pole[held.sample]
            + t * later * start
            + (t * later / pole - driven / pole) * held.torque
        )
        return State(moved, by_pole, pole * moved + held.acting)

    def _recur(self, pole: complex, e: Complex, v: Complex) -> Complex:
        """`x[j + 1] = e[j] x[j] + v[j]` from zero."""
        if self.even:
            full = np.vstack([v, np.zeros_like(v[:1])])
            return np.asarray(lfilter([0.0, 1.0], [1.0, -e[0]], full, axis=0), dtype=np.complex128)
        out = np.zeros((self.time.size, v.shape[1]), dtype=np.complex128)
        most = DECAY / max(abs(pole.real), 1e-300)
        start = 0
        while start < v.shape[0]:
            end = min(
                max(int(np.searchsorted(self.time, self.time[start] + most)), start + 1), v.shape[0]
            )
            t = pole * (self.time[start : end + 1] - self.time[start])
            grown = np.cumsum(np.exp(-t[1:])[:, None] * v[start:end], axis=0)
            out[start + 1 : end + 1] = np.exp(t[1:])[:, None] * (out[start] + grown)
            start = end
        return out

    def _as_kind(self, values: Any, output: int) -> Any:
        """Of rates or angles `(N, ...)`, as `_integrated` says, what the output reads:
        of angles, a mean rate is the difference over the step."""
        if self.kinds[output] != "mean_rate":
            return values
        out = np.zeros_like(values)
        steps = self.steps.reshape(-1, *(1,) * (values.ndim - 1))
        out[1:] = np.diff(values, axis=0) / steps
        return out

    def _integrated(self, output: int) -> bool:
        """Whether an output follows from angles, not from rates."""
        return self.kinds[output] != "rate"

    def rigid_motion(self, output: int, held: Held) -> Array:
        """`(N, m)` motion of an output per unit of acceleration by each torque
        of a frozen craft."""
        return self._as_kind(held.twice if self._integrated(output) else held.once, output)

    def modal_motion(self, state: State, held: Held, pole: complex, output: int) -> Complex:
        """`(N, m)` what an output sees of the states of a mode."""
        value = (state.value - held.once) / pole if self._integrated(output) else state.value
        return self._as_kind(value, output)

    def free_motion(self, pole: complex, output: int) -> Complex:
        """`(N,)` what an output sees of a mode of unit amplitude that moves freely."""
        motion = np.exp(pole * (self.time - self.time[0]))
        return self._as_kind(motion / pole if self._integrated(output) else motion, output)

    def assess(
        self,
        raw: Raw,
        weights: Array,
        slopes: Array | None = None,
        lags: int = 0,
        *,
        whole: bool = False,
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
        outputs = range(self.outputs.shape[1])
        held = self.held(raw.delay)
        states = [self.state(complex(p), held, slopes=slopes is not None) for p in raw.poles]
        bases = self._bases(raw)
        count = bases[0].shape[1]
        used = [_counted_samples(self.use[:, i]) for i in outputs]
        shown = [basis[use] for basis, use in zip(bases, used, strict=True)]
        normal = np.sum([weights[i] ** 2 * shown[i].T @ shown[i] for i in outputs], axis=0)
        size = np.sqrt(np.diag(normal)) + 1e-300
        scaled = normal / np.outer(size, size) + RIDGE * np.eye(count)
        residual = self.outputs - self._forced(raw, held, states)
        amplitudes = np.zeros(count)
        for _ in range(3):  # the second and third time for the digits that the normal matrix loses
            right = np.sum(
                [weights[i] ** 2 * shown[i].T @ residual[used[i], i] for i in outputs], axis=0
            )
            change = np.linalg.solve(scaled, right / size) / size
            amplitudes += change
            residual -= np.column_stack([basis @ change for basis in bases])
        squares = np.array([np.sum(residual[used[i], i] ** 2) for i in outputs])
        if not whole:
            residual = np.where(self.use, residual, 0.0)
        if slopes is None:
            return Assessed(squares), residual
        n = raw.poles.size
        motion = amplitudes[: 2 * n : 2] + 1j * amplitudes[1 : 2 * n : 2]
        total = np.zeros((slopes.shape[1], slopes.shape[1]))
        cross = np.zeros((count, slopes.shape[1]))
        gradient = np.zeros(slopes.shape[1])
        rows = list[Array]()
        for i in outputs:
            table = self._by_raw(raw, held, states, motion, i)
            slope = weights[i] * (table[used[i]] @ slopes[raw.columns(i)])
            total += slope.T @ slope
            cross += weights[i] * shown[i].T @ slope
            gradient += slope.T @ (weights[i] * residual[used[i], i])
            rows.append(slope)
        solved = np.linalg.solve(scaled, cross / size[:, None]) / size[:, None]
        meat = np.zeros_like(total)
        for i in outputs if lags else ():
            left = weights[i] * residual[used[i], i]
            score = (rows[i] - weights[i] * shown[i] @ solved) * left[:, None]
            meat += _long_run(score, lags)
        return Assessed(squares, total - cross.T @ solved, gradient, meat), residual

    def _bases(self, raw: Raw) -> list[Array]:
        """Per output `(N, columns)`: real and imaginary amplitude of each mode's free motion,
        and the constants of every sensor, of which the others' are zero."""
        outputs = range(self.outputs.shape[1])
        constants = [self.constants(i) for i in outputs]
        ends = np.cumsum([2 * raw.poles.size, *(c.shape[1] for c in constants)])
        bases = [np.zeros((self.time.size, int(ends[-1])), order="F") for _ in outputs]
        for i, basis in enumerate(bases):
            for k, pole in enumerate(raw.poles):
                motion = raw.shapes[k, i] * self.free_motion(pole, i)
                basis[:, 2 * k] = motion.real
                basis[:, 2 * k + 1] = -motion.imag
            basis[:, ends[i] : ends[i + 1]] = constants[i]
        return bases

    def _forced(self, raw: Raw, held: Held, states: Sequence[State]) -> Array:
        out = np.column_stack(
            [self.rigid_motion(i, held) @ rigid for i, rigid in enumerate(raw.rigid)]
        )
        for pole, residue, state in zip(raw.poles, raw.residues, states, strict=True):
            for i, row in enumerate(residue):
                out[:, i] += 2.0 * (self.modal_motion(state, held, pole, i) @ row).real
        return out

    def _by_raw(
        self, raw: Raw, held: Held, states: Sequence[State], motion: Complex, i: int
    ) -> Array:
        """`(N, columns)` derivatives of an output with respect to its raw numbers;
        see `Raw.columns`. `motion` `(n,)`: amplitudes of the free motion."""
        out = np.empty((self.time.size, raw.columns(i).size), order="F")
        t = self.time - self.time[0]
        inputs = self.inputs.shape[1]
        width = 4 + 2 * inputs
        integrated = self._integrated(i)
        speed = (held.once if integrated else held.acting) @ raw.rigid[i]
        for k, state in enumerate(states):
            pole = raw.poles[k]
            residue = raw.residues[k, i]
            seen = state.value
            by_pole = state.by_pole
            swing = state.rate
            free = motion[k] * np.exp(pole * t) / 2.0  # halved: the bases do not double real parts
            free_by_pole = t * free
            if integrated:
                seen = (state.value - held.once) / pole
                by_pole = (state.by_pole - seen) / pole
                swing = state.value
                free = free / pole
                free_by_pole = (t - 1.0 / pole) * free
            speed = speed + 2.0 * (swing @ residue).real
            turned = by_pole @ residue + raw.shapes[k, i] * free_by_pole
            at = k * width
            for c, column in enumerate((turned, *seen.T, free)):
                np.multiply(column.real, 2.0, out=out[:, at + 2 * c])
                np.multiply(column.imag, -2.0, out=out[:, at + 2 * c + 1])
        out[:, width * len(states) : -1] = held.twice if integrated else held.once
        out[:, -1] = -speed
        return self._as_kind(out, i)


def _long_run(score: Array, lags: int) -> Array:
    """Covariance of the sum of correlated rows, by Bartlett's weights (Newey and West)."""
    out = score.T @ score
    for lag in range(1, min(lags, score.shape[0])):
        product = (1.0 - lag / lags) * score[:-lag].T @ score[lag:]
        out += product + product.T
    return out


def _counted_samples(use: NDArray[np.bool_]) -> slice | NDArray[np.intp]:
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
        return np.asarray(
            (1j * self.omega) ** self.order / (self.accuracy * np.abs(self.value)),
            dtype=np.complex128,
        )

    def assess(
        self,
        raw: Raw,
        weights: Array,
        slopes: Array | None = None,
        lags: int = 0,
        *,
        whole: bool = False,
    ) -> tuple[Assessed, Complex]:
        """As for `Piece`; residuals `(N,)` are complex and relative."""
        del lags, whole
        s = 1j * self.omega
        scale = self.weight
        i, m = self.output, self.input
        late = np.exp(-s * raw.delay)
        up = late[:, None] / (s[:, None] - raw.poles)
        down = late[:, None] / (s[:, None] - raw.poles.conj())
        g = raw.residues[:, i, m]
        modelled = up @ g + down @ g.conj() + late * raw.rigid[i, m] / s
        residual = scale * (self.value / s**self.order - modelled)
        squares = np.zeros(raw.rigid.shape[0])
        squares[i] = float(np.sum(np.abs(residual) ** 2))
        if slopes is None:
            return Assessed(squares), residual
        table = np.zeros((s.size, slopes.shape[0]), dtype=np.complex128)
        outputs, inputs = raw.rigid.shape
        size = 2 * (1 + outputs * inputs + outputs)
        for k in range(raw.poles.size):
            a, b = up[:, k], down[:, k]
            da = g[k] * a / (s - raw.poles[k])
            db = g[k].conj() * b / (s - raw.poles[k].conj())
            at = k * size + 2 + 2 * (i * inputs + m)
            table[:, k * size] = da + db
            table[:, k * size + 1] = 1j * (da - db)
            table[:, at] = a + b
            table[:, at + 1] = 1j * (a - b)
        table[:, raw.poles.size * size + i * inputs + m] = late / s
        table[:, -1] = -s * modelled
        slope = (weights[i] * scale)[:, None] * (table @ slopes)
        both = np.vstack([slope.real, slope.imag])
        left = weights[i] * np.concatenate([residual.real, residual.imag])
        meat = both.T @ (left[:, None] ** 2 * both)
        return Assessed(squares, both.T @ both, both.T @ left, meat), residual


Data = Piece | Spectrum
