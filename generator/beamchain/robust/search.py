"""The loop closed around an uncertain plant, its peaks, and a search for the worst sample.

`[z, e] = N [w, d]`, `w = Delta z`: a controller's loops closed around M,
d added to one of its inputs, e one of its outputs.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize, minimize_scalar

from beamchain.errors import InputError
from beamchain.spec import Controller
from beamchain.toolkit import (
    GROWS,
    UNSEEN,
    Array,
    Complex,
    System,
    close_loop,
    growth,
    loop_response,
    place,
    places,
    realise,
    response,
    spectral_split,
    standing_still,
    subsystem,
    touched,
    with_deltas,
)

IDLE = 1e-9  # of a response, relative: what poles on the axis add to it is rounding
STARTS = 4  # of the local search, from the worst samples
STILL = 1e-2  # of the lowest frequency looked at: a gain that is largest at rest is taken there
AROUND = np.sinh(np.linspace(-4.0, 4.0, 25))  # half widths of a resonance, at which it is looked at
# logarithm of the gain that stands for an unstable sample: that of the largest number
UNSTABLE = float(np.log(np.finfo(np.float64).max))


class Peak(NamedTuple):
    """Largest gain of a closed loop [unit of e per unit of d] and where [rad/s]; infinite:
    unstable, at its pole."""

    gain: float
    omega: float

    @property
    def stable(self) -> bool:
        """Whether the loop is stable."""
        return bool(np.isfinite(self.gain))


class Peaks(Protocol):
    """What a search makes large: a gain of samples at its peak."""

    def peak(self, deltas: Array) -> Peak:
        """Of a sample `(blocks,)`."""
        ...

    def slope(self, deltas: Array, omega: float) -> Array:
        """`(blocks,)` slope of its logarithm."""
        ...


class Resonances(NamedTuple):
    """A gain as partial fractions, `direct + sum of weights / (s - poles)`."""

    poles: Complex
    weights: Complex
    direct: float

    def size(self, omega: Array) -> Array:
        """`(k,)` magnitude at frequencies `(k,)` [rad/s]."""
        fractions = self.weights / (1j * omega[:, None] - self.poles)
        return np.abs(fractions.sum(axis=1) + self.direct)


class Loops:
    """The closed loop N of M and a controller: exact in the frequency domain,
    its state space with dead times by Pade.

    `blocks` `(channels,)` is the number of the delta of each channel;
    `ends` are the input where d acts and the output e. `rows` and `columns` are the signals of M
    that each loop measures and drives, `seen` and `driven` those of N. `offset` is added to the
    response from d to e. `poles` are those of the nominal sample that take part in it.

    Stability is judged as in `bc.margins`: motion that no loop touches (free rigid motion, the
    momentum of wheels, nutation) takes no part. `undamped` allows poles on the axis that do.
    """

    blocks: NDArray[np.intp]
    controller: Controller
    plant: System
    rows: list[int]
    columns: list[int]
    seen: list[int]
    driven: list[int]
    offset: float
    system: System
    poles: Complex

    def __init__(
        self,
        system: System,
        blocks: Sequence[int],
        inputs: list[str],
        outputs: list[str],
        controller: Controller,
        ends: tuple[str, str],
        offset: float = 0.0,
        undamped: bool = False,
    ) -> None:
        channels = len(blocks)
        rows, columns = places(controller, inputs, outputs)
        d = place(ends[0], inputs, "input", "")
        e = place(ends[1], outputs, "output", "")
        self.blocks = np.asarray(blocks, dtype=np.intp)
        self.controller = controller
        self.plant = system
        self.rows = [channels + i for i in rows]
        self.columns = [channels + i for i in columns]
        self.seen = [*range(channels), channels + e]
        self.driven = [*range(channels), channels + d]
        whole = close_loop(system, realise(controller), self.rows, self.columns)
        if not _reaches(whole, self.blocks, self.driven[-1], self.seen[-1]):
            raise InputError(
                f"input {ends[0]!r} does not move output {ends[1]!r} at any values of the "
                "uncertain quantities, so that there is no worst gain between them; ask for an "
                "output that it moves."
            )
        self.system = subsystem(whole, self.seen, self.driven)
        self.offset = offset
        self.system[3][-1, -1] += offset
        nominal = np.zeros(max(blocks, default=-1) + 1)
        self.poles = self._resonances(nominal).poles
        top = float(np.abs(self.poles).max(initial=1e-300))
        # beside rounding, from the axis to the left
        damped = -1.0 - growth(self.poles, 0.0, top)
        a, _, c, _ = self._from_end_to_end(nominal)
        drifts = standing_still(a, c[:0]).size
        if drifts or damped.min(initial=np.inf) < (-1.0 if undamped else 1.0):
            raise InputError(
                "the closed loop of the nominal plant is not stable, so that nothing can be "
                f"worse; close loops that hold all that {ends[1]!r} shows, stably (bc.plant's "
                "margins say how far they are from it)."
            )
        self._wide = np.geomspace(0.1 * np.abs(self.poles).min(), 2.0 * top, 300)

    def exact(self, omega: Array) -> Complex:
        """`(k, channels + 1, channels + 1)` N at frequencies `(k,)`, dead times exact."""
        s = (1j * omega).astype(np.complex128)
        m = response(self.plant, s)
        # `(k, loops, 1)`
        k = np.array([loop_response(loop, s) for loop in self.controller.loop]).T[:, :, None]
        to_end = m[:, self.seen]
        to_loops = m[:, self.rows]
        # N = M_ed - M_eu K (1 + M_yu K)^-1 M_yd
        open_loops = to_loops[:, :, self.columns] * np.swapaxes(k, 1, 2)
        measured = np.linalg.solve(np.eye(k.shape[1]) + open_loops, to_loops[:, :, self.driven])
        torque = k * measured
        n = to_end[:, :, self.driven] - to_end[:, :, self.columns] @ torque
        n[:, -1, -1] += self.offset
        return np.asarray(n, dtype=np.complex128)

    def gain(self, deltas: Array, omega: Array) -> Array:
        """`(k,)` gains of a sample `(blocks,)`, dead times exact."""
        return self.size(self.exact(omega), deltas)

    def size(self, n: Complex, deltas: Array) -> Array:
        """`(k,)` the same from N `(k, channels + 1, channels + 1)` at the frequencies."""
        return np.abs(self._response_and_slopes(n, deltas)[0])

    def _response_and_slopes(self, n: Complex, deltas: Array) -> tuple[Complex, Complex]:
        """`(k,)` response of a sample, and its slope by every channel's delta `(k, channels)`."""
        delta = deltas[self.blocks]
        eye = np.eye(self.blocks.size)
        zw = n[:, :-1, :-1]
        zd = n[:, :-1, -1:]
        ew = n[:, -1, :-1]
        # z = (1 - N_zw Delta)^-1 N_zd d, e = (N_ed + N_ew Delta (1 - N_zw Delta)^-1 N_zd) d
        z = np.linalg.solve(eye - zw * delta, zd)[:, :, 0]
        value = n[:, -1, -1] + np.einsum("ki,i,ki->k", ew, delta, z)
        # de/d(delta_i) = l_i z_i, l = N_ew (1 - Delta N_zw)^-1
        transposed = np.swapaxes(eye - delta[:, None] * zw, 1, 2)
        left = np.linalg.solve(transposed, ew[:, :, None])[:, :, 0]
        return value, left * z

    def _resonances(self, deltas: Array) -> Resonances:
        """The gain of a sample `(blocks,)` from d to e, dead times by Pade."""
        a, b, c, d = self._from_end_to_end(deltas)
        poles, vectors = (np.asarray(part, dtype=np.complex128) for part in np.linalg.eig(a))
        weights = (c[0] @ vectors) * np.linalg.solve(vectors, b[:, 0].astype(np.complex128))
        return Resonances(poles, weights, float(d[0, 0]))

    def _from_end_to_end(self, deltas: Array) -> System:
        """A sample from d to e without motion at rest that takes no part in it, and without its
        poles on the axis, where what they add to it is rounding."""
        a, b, c, d = with_deltas(self.system, deltas[self.blocks])
        system, _ = touched((a, b[:, -1:], c[-1:], d[-1:, -1:]))
        poles = np.linalg.eigvals(system[0]).astype(np.complex128)
        top = float(np.abs(poles).max(initial=1e-300))

        def on_axis(pole: complex) -> bool:
            return abs(pole.real) <= GROWS * top

        there = np.array([on_axis(complex(pole)) for pole in poles], dtype=np.bool_)
        if not there.any() or there.all():
            return system
        kept, idle = spectral_split(system, on_axis)
        # on the real axis, where no pole of a stable loop is near
        s = np.geomspace(np.abs(poles[~there]).min(), top, 30).astype(np.complex128)
        of_all = float(np.abs(response(system, s)).max())
        return kept if np.abs(response(idle, s)).max() <= IDLE * of_all else system

    def _growing(self, poles: Complex) -> Complex:
        """The unstable ones of a sample's poles."""
        top = float(np.abs(poles).max(initial=1e-300))
        return poles[growth(poles, 0.0, top) > 0.0]

    def peak(self, deltas: Array) -> Peak:
        """The largest gain of a sample over all frequencies, resonances resolved."""
        resonances = self._resonances(deltas)
        poles = resonances.poles
        growing = self._growing(poles)
        if growing.size:
            return Peak(np.inf, float(np.abs(growing[np.argmax(growing.real)].imag)))
        omega = self._grid(poles)
        at = int(np.argmax(resonances.size(omega)))
        low = float(omega[max(at - 1, 0)])
        high = float(omega[min(at + 1, omega.size - 1)])
        best = minimize_scalar(
            lambda w: -float(resonances.size(np.array([w]))[0]),
            bounds=(low, high),
            method="bounded",
            options={"xatol": 1e-9 * high},
        )
        top = float(best.x)
        return Peak(float(self.gain(deltas, np.array([top]))[0]), top)

    def frequencies(self, deltas: Array) -> Array:
        """`(k,)` frequencies that resolve the gain of a sample [rad/s]."""
        return self._grid(self._resonances(deltas).poles)

    def _grid(self, poles: Complex) -> Array:
        upper = poles[poles.imag > 0.0]
        near = (upper.imag[:, None] - upper.real[:, None] * AROUND).ravel()
        least = STILL * self._wide[0]
        return np.unique(np.concatenate([[least], self._wide, near[near > least]]))

    def slope(self, deltas: Array, omega: float) -> Array:
        """`(blocks,)` slope of the logarithm of the gain at a frequency;
        at the peak it is that of the peak."""
        value, slopes = self._response_and_slopes(self.exact(np.array([omega])), deltas)
        each = (slopes[0] / value[0]).real
        return np.asarray(np.bincount(self.blocks, each, minlength=deltas.size), dtype=np.float64)

    def settling(self, deltas: Array, omega: float, share: float) -> float:
        """How long a start of a stable sample is felt under a sine [s]: what is left of it is then
        below `share` of the gain; infinite where that never is.

        Starting from rest, the pole p with weight r leaves `r/(j omega - p) e^(p t)` in the output.
        """
        resonances = self._resonances(deltas)
        left = np.abs(resonances.weights / (1j * omega - resonances.poles))
        decay = -np.minimum(resonances.poles.real, 0.0)
        allowed = share * float(resonances.size(np.array([omega]))[0])

        def excess(time: float) -> float:
            return float(left @ np.exp(-decay * time)) - allowed

        if excess(0.0) <= 0.0:
            return 0.0
        long = 1.0 / float(np.abs(resonances.poles).max())
        while excess(long) > 0.0:
            if long * float(decay.max()) > 1e12:
                return float("inf")
            long *= 2.0
        return float(brentq(excess, 0.0, long))


def _reaches(whole: System, blocks: NDArray[np.intp], driven: int, seen: int) -> bool:
    """Whether an input of a closed loop reaches an output, beside what its other inputs do there:
    at deltas without symmetry, about its poles and beside the axis, where undamped modes stand."""
    deltas = np.random.default_rng(0).uniform(-1.0, 1.0, int(blocks.max(initial=-1)) + 1)
    system = with_deltas(whole, deltas[blocks])
    poles = np.abs(np.linalg.eigvals(system[0]))
    s = (0.1 + 1j) * np.geomspace(max(1e-3 * poles.max(), poles.min()), poles.max(), 30)
    row = np.abs(response(system, s.astype(np.complex128))[:, seen - blocks.size])
    return bool(row[:, driven - blocks.size].max() > UNSEEN * row.max())


class Tried(NamedTuple):
    """Deltas `(blocks,)` and the peak of their sample."""

    deltas: Array
    peak: Peak


def search(loops: Loops, samples: Array, seed: int = 0) -> tuple[Array, Peak, list[Peak]]:
    """The worst deltas found, their peak, and the peaks of the samples `(n, blocks)`.

    Tried are the samples, random corners, corners that slopes point to,
    and local ascent from the worst. Of an unstable sample, the peak is where stability ends on the
    way to it from the nominal one.
    """
    count = samples.shape[1]
    corners = np.random.default_rng(seed).choice(
        [-1.0, 1.0], size=(min(2**count, 8 * STARTS), count)
    )
    peaks = [loops.peak(row) for row in samples]
    tried = [Tried(row, peak) for row, peak in zip(samples, peaks, strict=True)]
    tried += [Tried(row, loops.peak(row)) for row in (*corners, np.zeros(count))]
    starts = sorted(tried, key=lambda sample: -sample.peak.gain)[:STARTS]
    for start in (each for each in starts if each.peak.gain > 0.0):
        if any(not sample.peak.stable for sample in tried):
            break  # nothing is worse
        tried += ascent(loops, start.deltas)
    worst = max(tried, key=lambda sample: sample.peak.gain)
    if worst.peak.stable:
        return worst.deltas, worst.peak, peaks
    return worst.deltas, _stability_limit(loops, worst), peaks


def climb(loops: Loops, start: Array) -> Tried:
    """The worst of what a local search from a stable sample tries."""
    return max(ascent(loops, start), key=lambda sample: sample.peak.gain)


def ascent(loops: Peaks, start: Array) -> list[Tried]:
    """What a local search from a stable sample tries, and the corner to which the slopes point
    where it ends."""
    tried: list[Tried] = []

    def cost(deltas: Array) -> tuple[float, Array]:
        """Minus the logarithm of the gain, and its slopes; an unstable sample is the least there
        is, where the search ends."""
        peak = loops.peak(deltas)
        tried.append(Tried(deltas.copy(), peak))
        if not peak.stable:
            return -UNSTABLE, np.zeros_like(deltas)
        return -float(np.log(peak.gain)), -loops.slope(deltas, peak.omega)

    bounds = [(-1.0, 1.0)] * start.size
    end = minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds)
    _, slopes = cost(np.asarray(end.x))
    if all(sample.peak.stable for sample in tried):
        corner = np.where(slopes < 0.0, 1.0, -1.0)
        tried.append(Tried(corner, loops.peak(corner)))
    return tried


def _stability_limit(loops: Loops, unstable: Tried) -> Peak:
    """Where on the way from the nominal values to unstable ones stability ends, by bisection:
    an infinite gain at the frequency at which the loop begins to ring, 0 where it drifts away."""
    limit = unstable.peak
    low = 0.0
    high = 1.0
    while high - low > 1e-9:
        middle = (low + high) / 2.0
        peak = loops.peak(middle * unstable.deltas)
        if peak.stable:
            low = middle
        else:
            high = middle
            limit = peak
    return limit
