"""The exact sampled response of a modal model to a log, its sensitivities,
and the free response eliminated per piece.

A modal model in raw form: poles, residues of rate per torque, rigid residues. A mode's rate x and
the angle a that integrates it are the states of

    x' = p x + u,    a' = x,

with p = 0 for the frozen craft, and every log is a row over them: a rate reads x, an attitude a, a
mean rate the difference of a over the step. The input is held between samples, so that a rate's
sample depends on the torques before it; a delay moves every torque later by the same time. Within a
piece of log without gaps, the free response (one amplitude and phase per mode) and the constants of
the sensors are the linear unknowns that variable projection eliminates.
"""

from collections.abc import Callable, Sequence
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


class Motion(NamedTuple):
    """The two states that sensors read, each `(N,)` or `(N, m)`: a rate, and the angle that
    integrates it, which is worked out where it is read."""

    rate: Any
    angle: Callable[[], Any]


class Held(NamedTuple):
    """The torque that acts at each sample once it is delayed, and the motion of a frozen craft.

    Args:
        sample: `(N,)` the one from which on it acts.
        since: `(N, 1)` or `(1, 1)` time [s] that it has acted.
        torque: `(N, m)`; zero before the first torque of the piece arrives.
        rigid: `(N, m)` its integral over time, and that one's integral.
        by_time: `(N, m)` their derivatives; where the torque changes just then, the mean of both.
    """

    sample: NDArray[np.intp]
    since: Array
    torque: Array
    rigid: Motion
    by_time: Motion


class State(NamedTuple):
    """Of one mode, per unit of its drive: its motion, and the derivatives with respect to the pole
    and to time."""

    value: Motion
    by_pole: Motion
    by_time: Motion


def real_columns(values: Complex) -> Array:
    """`(N, 2 k)` columns for `(N, k)` complex ones: `2 Re(g x)` is their sum with the weights
    `Re(g), Im(g)`."""
    return np.stack([2.0 * values.real, -2.0 * values.imag], axis=2).reshape(len(values), -1)


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
        rigid = Motion(once, lambda: twice)
        return Held(index, since, torque, rigid, Motion(acting, lambda: once))

    def state(self, pole: complex, held: Held, *, slopes: bool = True) -> State:
        """The state of a mode under held torques; without `slopes` its derivatives are not worked
        out."""
        h = self.steps[:1] if self.even else self.steps
        decay = np.exp(pole * h)
        gain = np.expm1(pole * h) / pole
        u = self.inputs[:-1]
        punctual = self._recur(pole, decay, gain[:, None] * u)
        # from its sample on, a state moves as x(t) = e^(p t) x + (e^(p t) - 1) / p u
        t = held.since
        later = np.exp(pole * t)
        driven = np.expm1(pole * t) / pole
        start = punctual[held.sample]
        rate = later * start + driven * held.torque
        value = Motion(rate, lambda: (rate - held.rigid.rate) / pole)  # x' = p x + u over time
        if not slopes:
            return State(value, value, value)
        tilt = h * decay / pole - gain / pole
        by_pole = self._recur(pole, decay, (h * decay)[:, None] * punctual[:-1] + tilt[:, None] * u)
        by_pole = (
            later * by_pole[held.sample]
            + t * later * start
            + (t * later / pole - driven / pole) * held.torque
        )
        return State(
            value,
            Motion(by_pole, lambda: (by_pole - value.angle()) / pole),
            Motion(pole * rate + held.by_time.rate, lambda: rate),
        )

    def free(self, pole: complex) -> Motion:
        """`(N,)` of a mode of unit amplitude that moves freely."""
        rate = np.exp(pole * (self.time - self.time[0]))
        return Motion(rate, lambda: rate / pole)

    def free_by_pole(self, pole: complex, free: Motion) -> Motion:
        """Derivative of a free motion with respect to its pole."""
        t = self.time - self.time[0]
        return Motion(t * free.rate, lambda: (t - 1.0 / pole) * free.angle())

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

    def read(self, motion: Motion, output: int) -> Any:
        """What an output shows of a motion."""
        if self.kinds[output] == "rate":
            return motion.rate
        if self.kinds[output] == "attitude":
            return motion.angle()
        steps = np.diff(motion.angle(), axis=0)
        mean = steps / self.steps.reshape(-1, *(1,) * (steps.ndim - 1))
        return np.concatenate([np.zeros_like(mean[:1]), mean])

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
        free = [self.free(complex(p)) for p in raw.poles]
        bases = self._bases(raw, free)
        weight = weights * self.use  # nothing of samples that do not count
        shown = [weight[:, i, None] * bases[i] for i in outputs]
        normal = _product(shown, shown)
        size = np.sqrt(np.diag(normal)) + 1e-300
        normal = normal / np.outer(size, size) + RIDGE * np.eye(size.size)
        residual = self.outputs - self._forced(raw, held, states)
        amplitudes = np.zeros(size.size)
        for _ in range(3):  # the second and third time for the digits that the normal matrix loses
            right = _product(shown, (weight * residual).T)
            change = np.linalg.solve(normal, right / size) / size
            amplitudes += change
            residual -= np.column_stack([columns @ change for columns in bases])
        squares = np.sum(np.where(self.use, residual, 0.0) ** 2, axis=0)
        if not whole:
            residual = np.where(self.use, residual, 0.0)
        if slopes is None:
            return Assessed(squares), residual
        n = raw.poles.size
        sizes = amplitudes[: 2 * n : 2] + 1j * amplitudes[1 : 2 * n : 2]
        left = (weight * residual).T
        slope = [
            weight[:, i, None]
            * (self._by_raw(raw, held, states, free, sizes, i) @ slopes[raw.columns(i)])
            for i in outputs
        ]
        cross = _product(shown, slope)
        solved = np.linalg.solve(normal, cross / size[:, None]) / size[:, None]
        meat = np.zeros((slopes.shape[1],) * 2)
        for i in outputs if lags else ():
            score = (slope[i] - shown[i] @ solved) * left[i][:, None]
            meat += _long_run(score[self.use[:, i]], lags)
        matrix = _product(slope, slope) - cross.T @ solved
        return Assessed(squares, matrix, _product(slope, left), meat), residual

    def _bases(self, raw: Raw, free: Sequence[Motion]) -> list[Array]:
        """Per output `(N, columns)`: real and imaginary amplitude of each mode's free motion,
        and the constants of every sensor, of which the others' are zero."""
        outputs = range(self.outputs.shape[1])
        constants = [self.constants(i) for i in outputs]
        ends = np.cumsum([2 * raw.poles.size, *(c.shape[1] for c in constants)])
        bases = [np.zeros((self.time.size, int(ends[-1])), order="F") for _ in outputs]
        for k, motion in enumerate(free):
            for i, basis in enumerate(bases):
                shown = raw.shapes[k, i] * self.read(motion, i)
                basis[:, 2 * k : 2 * k + 2] = real_columns(shown[:, None])
        for i, basis in enumerate(bases):
            basis[:, ends[i] : ends[i + 1]] = constants[i]
        return bases

    def _forced(self, raw: Raw, held: Held, states: Sequence[State]) -> Array:
        out = np.column_stack([self.read(held.rigid, i) @ row for i, row in enumerate(raw.rigid)])
        for residue, state in zip(raw.residues, states, strict=True):
            for i, row in enumerate(residue):
                out[:, i] += 2.0 * (self.read(state.value, i) @ row).real
        return out

    def _by_raw(
        self,
        raw: Raw,
        held: Held,
        states: Sequence[State],
        free: Sequence[Motion],
        sizes: Complex,
        i: int,
    ) -> Array:
        """`(N, columns)` derivatives of an output with respect to its raw numbers;
        see `Raw.columns`. `sizes` `(n,)` are the amplitudes of the free motion."""
        out = np.empty((self.time.size, raw.columns(i).size), order="F")
        inputs = self.inputs.shape[1]
        width = 4 + 2 * inputs
        speed = self.read(held.by_time, i) @ raw.rigid[i]
        for k, (state, motion) in enumerate(zip(states, free, strict=True)):
            residue = raw.residues[k, i]
            moves = sizes[k] * self.read(motion, i)
            turned = self.read(state.by_pole, i) @ residue
            free_by_pole = self.free_by_pole(complex(raw.poles[k]), motion)
            turned += raw.shapes[k, i] * sizes[k] * self.read(free_by_pole, i)
            for c, column in enumerate((turned, *self.read(state.value, i).T, moves)):
                at = k * width + 2 * c
                out[:, at : at + 2] = real_columns(column[:, None])
            speed = speed + 2.0 * (self.read(state.by_time, i) @ residue).real
        out[:, width * len(states) : -1] = self.read(held.rigid, i)
        out[:, -1] = -speed
        return out


def _product(left: Sequence[Array], right: Sequence[Array] | Array) -> Array:
    """Sum of `A^T B` over the outputs."""
    return np.sum([a.T @ b for a, b in zip(left, right, strict=True)], axis=0)


def _long_run(score: Array, lags: int) -> Array:
    """Covariance of the sum of correlated rows, by Bartlett's weights (Newey and West)."""
    out = score.T @ score
    for lag in range(1, min(lags, score.shape[0])):
        product = (1.0 - lag / lags) * score[:-lag].T @ score[lag:]
        out += product + product.T
    return out


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
