"""A controller closed around an uncertain plant, and how far its samples reach.

`[z, e] = N [w, d]`, `w = Delta z`: d is added to inputs of the plant, e are signals of it. A figure
asks how far the response E from d to e reaches over all frequencies, in size or along a ray of the
plane; the worst gain and every margin are such figures.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from beamchain.errors import InputError
from beamchain.results import Margins
from beamchain.toolkit import (
    AT_ZERO,
    GROWS,
    REAL,
    UNSEEN,
    Array,
    ClosedLoop,
    Complex,
    Feedback,
    Given,
    Names,
    Signals,
    System,
    balanced_bounds,
    close_loop,
    closed_around,
    control_names,
    counted,
    feedback,
    growth,
    margins_of,
    place,
    response,
    standing_still,
    with_deltas,
    with_gains,
)

TOTAL = "total of "  # before the name of an input: an output that reads it, controller included
IDLE = 1e-9  # of a response, relative: what poles on the axis add to it is rounding
# frequencies per decade, and half widths beside a resonance, at which a sample is looked at
SPARSE = 40, np.sinh(np.linspace(-4.0, 4.0, 13))
# the same where samples are chosen frequency by frequency: what they reach hardly changes there
SMOOTH = 30, np.zeros(1)
STILL = 1e-2  # of the lowest frequency looked at: a gain that is largest at rest is taken there
FINER = 17  # points about what reaches farthest, between its neighbours
ROUNDS = 3  # of these
MANY = 64  # matrices whose mu is bounded together
TURNS = 6  # of the slopes at a frequency, to a corner
BESIDE = 1e-6  # relative, of what a slope is taken over
FAR = 1e3  # of the fastest pole: a slope at infinite frequency is taken there
LEAST = 1e-9  # of a reach, which has a logarithm
# multiples of the sampling frequency, on either side, that a slope takes in, and the choice of a
# corner
ALIASES, FEW = 20, 3


class Figure(NamedTuple):
    """What a search makes large.

    Args:
        port: the end at which E is looked at; None: mu of all of E.
        ray: along which it reaches, `1j` in either sense; None: its size.
    """

    port: int | None
    ray: complex | None = None

    @property
    def directions(self) -> tuple[complex | None, ...]:
        """The rays, one by one."""
        return (1j, -1j) if self.ray == 1j else (self.ray,)


class Reach(NamedTuple):
    """How far a sample reaches.

    Args:
        sizes: `(figures,)`; infinite of an unstable sample.
        omega: `(figures,)` where [rad/s]; of an unstable sample, its pole.
    """

    sizes: Array
    omega: Array

    @property
    def stable(self) -> bool:
        """Whether the sample is."""
        return bool(np.isfinite(self.sizes).all())


@dataclass(frozen=True, eq=False)
class Sample:
    """The closed loop of a sample, `y = (sum of weights / (s - poles) + direct) d`, or of z.

    Dead times are Pade approximations in that, and exact in `outputs`.

    Args:
        closed: the loop.
        poles, weights, direct: `(n,)`, `(n, outputs, inputs)`, `(outputs, inputs)`.
        totals: which outputs are the totals of the inputs.
    """

    closed: ClosedLoop
    poles: Complex
    weights: Complex
    direct: Array
    totals: list[int]

    def fractions(self, point: Complex) -> Complex:
        """`(k, outputs, inputs)` response at s, or z."""
        parts = (1.0 / (point[:, None] - self.poles)) @ self.weights.reshape(self.poles.size, -1)
        return parts.reshape(-1, *self.direct.shape) + self.direct

    def outputs(self, omega: Array) -> Complex:
        """`(k, outputs, inputs)` response at frequencies [rad/s], dead times exact."""
        point = self.closed.to_point(omega)
        y = self.fractions(point)
        if not self.closed.fed.delayed:
            return y
        # y = G t, t = d - K y: with T = 1 - K_pade Y the totals, G = Y T^-1, and
        # G (1 + K G)^-1 = Y (T + K Y)^-1
        return y @ np.linalg.inv(y[:, self.totals] + self.closed.fed.response(point) @ y)


def closed_sample(closed: ClosedLoop, totals: list[int]) -> Sample:
    """A closed loop as partial fractions, without poles on the axis that add nothing but
    rounding."""
    outputs, inputs = closed.plant[3].shape
    a, b, c, d = close_loop(closed.plant, closed.controller, range(outputs), range(inputs))
    b, c, d = b[:, :inputs], c[:outputs], d[:outputs, :inputs]
    poles, vectors = (np.asarray(part, dtype=np.complex128) for part in np.linalg.eig(a))
    driven = np.linalg.solve(vectors, b.astype(np.complex128))
    weights = np.einsum("ip,pj->pij", c @ vectors, driven)
    sample = Sample(closed, poles, weights, d, totals)
    s = closed.to_s(poles)
    on_axis = np.abs(s.real) <= GROWS * float(np.abs(s).max(initial=1e-300))
    if not on_axis.any() or on_axis.all():
        return sample
    # on the real axis, where no pole of a stable loop is near
    s = np.geomspace(np.abs(s[~on_axis]).min(), np.abs(s).max(), 30).astype(np.complex128)
    point = np.exp(s * closed.step) if closed.step else s
    added = np.abs(weights / (point[:, None] - poles)[:, :, None, None]).max(axis=0)
    idle = on_axis & np.all(
        added <= IDLE * np.abs(sample.fractions(point)).max(axis=0), axis=(1, 2)
    )
    return replace(sample, poles=poles[~idle], weights=weights[~idle])


def upper(m: Complex, delta: Array) -> tuple[Complex, Complex, Complex]:
    """`F_u(M, Delta)` of matrices `(k, ., .)`, Delta `(k, channels)` or `(channels,)`, and the
    factors of its slopes, `dF/d(delta_c) = l_c z_c`: a column of l, a row of z."""
    n = delta.shape[-1]
    delta = np.broadcast_to(delta, (m.shape[0], n))
    # Z = (1 - M_zw Delta)^-1 M_zu,  L = M_yw (1 - Delta M_zw)^-1
    inverse = np.linalg.inv(np.eye(n) - m[:, :n, :n] * delta[:, None, :])
    by_delta = m[:, n:, :n] * delta[:, None, :]
    z = inverse @ m[:, :n, n:]
    left = m[:, n:, :n] + by_delta @ inverse @ m[:, :n, :n]
    value = m[:, n:, n:] + by_delta @ z
    return value.astype(np.complex128), left.astype(np.complex128), z.astype(np.complex128)


class UncertainLoop:
    """The closed loops of an uncertain plant's samples, judged as by `bc.margins`: motion that no
    loop touches (free rigid motion, the momentum of wheels, nutation) takes no part.

    At the inputs that a controller drives, S maps d to their totals, and every margin is a point on
    the locus of `E = S - 1/2` at an input, the other loops closed: the disk margin is
    `1/max |E|`; `L = -1/g` where `E = (g + 1)/(2 (g - 1))`, so that the gain may rise the least
    where E reaches farthest along the positive real axis, and fall the least where it does along
    the negative one; `L = -exp(j phi)` where `E = j/(2 tan(phi/2))`, the phase.

    Args:
        system, blocks: M, and the number of the delta of every channel.
        inputs, outputs: the plant's signals.
        controller: the loops.
        ends: the input where d acts and the output e; None: all inputs that are driven, and E.
        offset: of E beside the response from d to e.
    """

    def __init__(
        self,
        system: System,
        blocks: Sequence[int],
        inputs: list[str],
        outputs: list[str],
        controller: Given,
        ends: tuple[str, str] | None = None,
        offset: float = 0.0,
    ) -> None:
        self.controller = controller
        self.blocks = np.asarray(blocks, dtype=np.intp)
        self.count = int(self.blocks.max(initial=-1)) + 1
        own = Signals(inputs, outputs, control_names(inputs), control_names(outputs))
        fed = feedback(controller, own)
        self.names = [inputs[column] for column in fed.columns]
        self.measured = [outputs[row] for row in fed.rows]
        every = [*outputs, *(TOTAL + name for name in inputs)]
        self._whole = _with_totals(system, len(inputs))
        driven = fed.columns if ends is None else [place(ends[0], inputs, "input", "")]
        seen = (
            [len(outputs) + column for column in fed.columns]
            if ends is None
            else [place(ends[1], every, "output", "")]
        )
        self.ends = ends or (self.names[0], TOTAL + self.names[0])
        self._of_gain = ends is not None and not offset
        self._every = inputs, every
        self.offset = -0.5 if ends is None else offset
        columns = list(dict.fromkeys([*fed.columns, *driven]))
        totals = [len(outputs) + column for column in columns]
        rows = list(dict.fromkeys([*fed.rows, *totals, *seen]))
        n = self.blocks.size
        a, b, c, d = self._whole
        at_rows = [*range(n), *(n + row for row in rows)]
        at_columns = [*range(n), *(n + column for column in columns)]
        self.plant = a, b[:, at_columns], c[at_rows], d[np.ix_(at_rows, at_columns)]
        self.inputs, self.outputs = [inputs[i] for i in columns], [every[i] for i in rows]
        self._law = fed
        self._fed = _widened(fed, len(rows), len(columns))
        self._totals = [rows.index(row) for row in totals]
        self._seen = [rows.index(row) for row in seen]
        self._driven = [columns.index(column) for column in driven]
        signals = Signals(self.inputs, self.outputs, self.inputs, self.outputs)
        self._labels = Names(signals, ("",) * a.shape[0], ())
        rays = (None,) if ends else (None, 1.0, -1.0, 1j)
        single = [Figure(port, ray) for port in range(len(driven)) for ray in rays]
        self.figures = (*single, Figure(None)) if len(driven) > 1 else tuple(single)

    @property
    def channels(self) -> tuple[list[int], list[int]]:
        """Numbers of `[z, e]` and of `[w, d]` among the plant's outputs and inputs."""
        n = self.blocks.size
        seen, driven = ([n + i for i in some] for some in (self._seen, self._driven))
        return [*range(n), *seen], [*range(n), *driven]

    @cached_property
    def poles(self) -> Complex:
        """Those of the nominal sample that are no rounding."""
        return self.sample(np.zeros(self.count)).poles

    def closed(self, deltas: Array) -> ClosedLoop:
        """The closed loop of a sample `(blocks,)`, its poles counted where dead times matter."""
        plant = with_deltas(self.plant, deltas[self.blocks])
        closed = closed_around(plant, self._fed, self._labels)
        return counted(closed) if closed.growing.size else closed

    def margins(self, plant: System) -> Margins:
        """What `bc.margins` says of a plant with the signals of this one."""
        inputs, outputs = self._every
        names = Names(Signals(inputs, outputs, inputs, outputs), ("",) * len(plant[0]), ())
        return margins_of(counted(closed_around(plant, self._law, names)))

    def sample(self, deltas: Array) -> Sample:
        """A sample `(blocks,)` as partial fractions."""
        return closed_sample(self.closed(deltas), self._totals)

    def check_gain(self) -> None:
        """Refuse ends between which there is no worst gain."""
        driven, seen = self.ends
        if not self._reaches():
            raise InputError(
                f"input {driven!r} does not move output {seen!r} at any values of the "
                "uncertain quantities, so that there is no worst gain between them; ask for an "
                "output that it moves."
            )
        nominal = self.sample(np.zeros(self.count))
        closed = nominal.closed
        poles = closed.to_s(nominal.poles)
        top = float(np.abs(poles).max(initial=1e-300))
        # beside rounding, from the axis to the left
        damped = -1.0 - growth(poles, 0.0, top)
        a = closed.closed(1.0, np.ones(len(self.inputs)))
        a -= bool(closed.step) * np.eye(len(a))
        drifts = standing_still(a, a[:0]).size
        if not closed.stable or drifts or damped.min(initial=np.inf) < 1.0:
            raise InputError(
                "the closed loop of the nominal plant is not stable, so that nothing can be "
                f"worse; close loops that hold all that {seen!r} shows, stably (bc.plant's "
                "margins say how far they are from it)."
            )

    def _reaches(self) -> bool:
        """Whether d moves e beside what other inputs do there: at deltas without symmetry, about
        poles and beside the axis, where undamped modes stand."""
        deltas = np.random.default_rng(0).uniform(-1.0, 1.0, self.count)
        closed = self.closed(deltas)
        sizes = np.abs(closed.to_s(closed.eigenvalues))
        s = (0.1 + 1j) * np.geomspace(max(1e-3 * sizes.max(), sizes.min()), sizes.max(), 30)
        m = response(with_deltas(self._whole, deltas[self.blocks]), s.astype(np.complex128))
        law = closed.fed.response(np.exp(s * closed.step) if closed.step else s)
        rows, columns = (
            [every.index(i) for i in some]
            for every, some in ((self._every[1], self.outputs), (self._every[0], self.inputs))
        )
        # e = M_ed - M_eu K (1 + M_yu K)^-1 M_yd, d any input
        open_loop = np.eye(len(rows)) + m[:, rows][:, :, columns] @ law
        end = [rows[self._seen[0]]]
        across = m[:, end][:, :, columns] @ law @ np.linalg.solve(open_loop, m[:, rows])
        row = np.abs(m[:, end] - across)[:, 0]
        return bool(row[:, columns[self._driven[0]]].max() > UNSEEN * row.max())

    def reach(self, deltas: Array) -> Reach:
        """How far a sample `(blocks,)` reaches."""
        closed = self.closed(deltas)
        if not closed.stable:
            s = closed.to_s(closed.growing)
            omega = abs(float(s[np.argmax(s.real)].imag)) if s.size else np.nan
            return Reach(*(np.full(len(self.figures), value) for value in (np.inf, omega)))
        sample = closed_sample(closed, self._totals)
        omega = closed.frequencies(*SPARSE)
        omega = np.append((STILL if self._of_gain else AT_ZERO) * omega[0], omega)
        e = self._ends_of(sample.outputs(omega))
        # at rest E is real, of an integrator but for rounding; at pi/T as well
        real = [0, -1] if closed.step else [0]
        e[real] = np.where(np.abs(e[real].imag) < REAL * np.abs(e[real]), e[real].real, e[real])
        sizes, at = self._farthest(e)
        for _ in range(ROUNDS):
            low, high = omega[np.maximum(at - 1, 0)], omega[np.minimum(at + 1, omega.size - 1)]
            more = np.setdiff1d(np.linspace(low, high, FINER), omega)
            order = np.argsort(np.append(omega, more))
            omega = np.append(omega, more)[order]
            e = np.concatenate([e, self._ends_of(sample.outputs(more))])[order]
            sizes, at = self._farthest(e)
        where = omega[at]
        if closed.limit is not None:
            end = self._ends_of(sample.direct[None].astype(np.complex128))
            last = self._farthest(np.concatenate([end, end]))[0]
            where = np.where(last > sizes, np.inf, where)
            sizes = np.maximum(last, sizes)
        return Reach(sizes, where)

    def _ends_of(self, outputs: Complex) -> Complex:
        """E `(k, ends, ends)` of responses `(k, outputs, inputs)`."""
        e = outputs[:, self._seen][:, :, self._driven]
        return e + self.offset * np.eye(len(self._driven))

    def _farthest(self, e: Complex) -> tuple[Array, NDArray[np.intp]]:
        """Of E `(k, ends, ends)` over frequency, `(figures,)` how far it reaches for every figure,
        and the number of the frequency there or before."""
        found = [
            _mu(e) if figure.port is None else _along(e[:, figure.port, figure.port], figure.ray)
            for figure in self.figures
        ]
        sizes, at = zip(*found, strict=True)
        return np.array(sizes), np.array(at, dtype=np.intp)

    def slope(self, figure: int, deltas: Array, omega: float) -> Array:
        """`(blocks,)` slope of the logarithm of a reach, which is at a frequency."""
        of = self.figures[figure]
        if not np.isfinite(omega):
            omega = FAR * self.closed(deltas).top
        near = self._factors_at(omega * (1.0 + BESIDE * np.array([-1.0, 0.0, 1.0])))
        e, left, right = self._middles(near, np.broadcast_to(deltas, (3, self.count)))
        # dE/d(delta_c) is the column of channel c in `left` times its row in `right`
        slopes = np.zeros((self.count, *e.shape[1:]), dtype=np.complex128)
        each = left[1].T[:, :, None] * right[1][:, None, :]
        np.add.at(slopes, np.tile(self.blocks, len(each) // max(self.blocks.size, 1)), each)
        if of.port is None:
            mu = balanced_bounds(np.concatenate([e[1:2], e[1] + BESIDE * slopes]))
            return (mu[1:] / mu[0] - 1.0) / BESIDE
        here = complex(e[1, of.port, of.port])
        ray = here / abs(here) if of.ray is None else of.ray
        if of.ray == 1j and here.imag < 0.0:
            ray = -1j
        along = slopes[:, of.port, of.port] * np.conj(ray)
        moved = complex(e[2, of.port, of.port] - e[0, of.port, of.port]) * np.conj(ray)
        # the crossing of the ray moves by d(omega) = -Im(dE/d(delta))/Im(dE/d(omega))
        moving = 0.0 if of.ray is None or moved.imag == 0.0 else moved.real / moved.imag
        return np.asarray(along.real - moving * along.imag, dtype=np.float64) / abs(here)

    def corners(self) -> list[Array]:
        """Corners of the ranges to which the slopes of E point, turn by turn, at the frequencies
        of the nominal loop, in every direction in which a figure looks: where they reach farther
        than at neighbouring frequencies."""
        omega = self.closed(np.zeros(self.count)).frequencies(*SMOOTH)
        responses = self._factors_at(omega, FEW)
        nominal = self._middles(responses, np.zeros((omega.size, self.count)))
        found: dict[bytes, Array] = {}
        for port, ray in ((f.port, ray) for f in self.figures for ray in f.directions):
            if port is None:
                continue
            best, farthest = self._farthest_corners(responses, nominal, port, ray)
            ends = np.concatenate([[-np.inf], farthest, [-np.inf]])
            tops = (farthest >= ends[:-2]) & (farthest >= ends[2:]) & (farthest > abs(self.offset))
            found |= {row.tobytes(): row for row in best[tops]}
        return list(found.values())

    def _farthest_corners(
        self, responses: "Responses", nominal: "Middles", port: int, ray: complex | None
    ) -> tuple[Array, Array]:
        """`(k, blocks)` the corner that reaches farthest in a direction at every frequency, or the
        middle, and `(k,)` how far it does."""
        e, left, right = nominal
        count = e.shape[0]
        member = np.equal.outer(np.tile(self.blocks, responses.shifts), np.arange(self.count))
        deltas = np.zeros((count, self.count))
        best, farthest = deltas.copy(), np.full(count, -np.inf)
        at = np.arange(count)  # where the corner changed in the last turn
        for _ in range(TURNS):
            here = e[:, port, port]
            turned = np.conj(here / np.abs(here)) if ray is None else np.full(at.size, np.conj(ray))
            size = (here * turned).real
            better = size > farthest[at]
            best[at[better]] = deltas[at[better]]
            farthest[at[better]] = size[better]
            each = (left[:, port] * right[:, :, port] * turned[:, None]).real
            corner = np.where(each @ member < 0.0, -1.0, 1.0)
            changed = np.any(corner != deltas[at], axis=1)
            at = at[changed]
            if not at.size:
                break
            deltas[at] = corner[changed]
            e, left, right = self._middles(responses.some(at), deltas[at])
        return best, farthest

    def _factors_at(self, omega: Array, aliases: int = ALIASES) -> "Responses":
        """M and K at frequencies `(k,)`.

        Samples see M at all the frequencies that they cannot tell apart, each as the hold passes
        it: `G(e^(j omega T)) = D + sum of (G(s) - D) (1 - e^(-s T))/(s T)`,
        `s = j (omega + 2 pi n/T)`.
        """
        step = self._fed.step or 0.0
        turns = 2.0 * np.pi / step * np.arange(-aliases, aliases + 1) if step else np.zeros(1)
        s = (1j * (omega + turns[:, None])).astype(np.complex128)
        m = response(self.plant, s.ravel()).reshape(*s.shape, *self.plant[3].shape)
        law = self._fed.response(np.exp(1j * omega * step) if step else s[0])
        if not step:
            return Responses(m, np.ones_like(s), law)
        hold = -np.expm1(-s * step) / (s * step)
        direct = np.broadcast_to(self.plant[3], (1, *m.shape[1:])).astype(np.complex128)
        return Responses(
            np.concatenate([m, direct]), np.vstack([hold, 1.0 - hold.sum(axis=0)]), law
        )

    def _middles(self, responses: "Responses", deltas: Array) -> "Middles":
        """E `(k, ends, ends)` at frequencies with a sample each, `(k, blocks)`, and the factors of
        its slopes `(k, ends, channels)` and `(k, channels, ends)`, the channels once for every
        frequency that samples cannot tell apart."""
        delta = deltas[:, self.blocks]
        parts = [upper(m, delta) for m in responses.m]
        hold = responses.hold[:, :, None, None]
        g = sum(h * part[0] for h, part in zip(hold, parts, strict=True))
        out = np.concatenate([part[1] for part in parts], axis=2)
        passed = [h * part[2] for h, part in zip(hold, parts, strict=True)]
        into = np.concatenate(passed, axis=1)
        # Y = G (1 + K G)^-1,  dY = (1 - Y K) dG (1 + K G)^-1
        totals = np.linalg.inv(np.eye(len(self.inputs)) + responses.law @ g)
        y = g @ totals
        before = np.eye(len(self.outputs)) - y @ responses.law
        return Middles(
            self._ends_of(np.asarray(y, dtype=np.complex128)),
            np.asarray(before[:, self._seen] @ out, dtype=np.complex128),
            np.asarray(into @ totals[:, :, self._driven], dtype=np.complex128),
        )

    def exact(self, omega: Array) -> Complex:
        """`(k, channels + 1, channels + 1)` N at frequencies `(k,)` of a continuous loop with one
        end, dead times exact."""
        s = (1j * omega).astype(np.complex128)
        m = response(self.plant, s)
        law = self._fed.response(s)
        n = self.blocks.size
        rows, columns = self.channels
        measured, driven = m[:, n:], m[:, :, n:]
        # N = M_ed - M_eu K (1 + M_yu K)^-1 M_yd
        across = np.linalg.solve(np.eye(len(self.outputs)) + m[:, n:, n:] @ law, measured)
        whole = (m - driven @ law @ across)[:, rows][:, :, columns]
        whole[:, -1, -1] += self.offset
        return np.asarray(whole, dtype=np.complex128)

    def size(self, whole: Complex, deltas: Array) -> Array:
        """`(k,)` gains of a sample from N `(k, channels + 1, channels + 1)`."""
        return np.abs(upper(whole, deltas[self.blocks])[0][:, 0, 0])

    def gain(self, deltas: Array, omega: Array) -> Array:
        """`(k,)` gains of a sample `(blocks,)` at frequencies `(k,)`, dead times exact."""
        return np.abs(self._ends_of(self.sample(deltas).outputs(omega))[:, 0, 0])

    def settling(self, deltas: Array, omega: float, share: float) -> float:
        """How long a start of a stable sample is felt under a sine [s]: what is left of it is then
        below `share` of the gain; infinite where that never is.

        Starting from rest, the pole p with weight r leaves `r/(j omega - p) e^(p t)` in the output.
        """
        sample = self.sample(deltas)
        weights = sample.weights[:, self._seen[0], self._driven[0]]
        left = np.abs(weights / (1j * omega - sample.poles))
        decay = -np.minimum(sample.poles.real, 0.0)
        gain = self._ends_of(sample.fractions(np.array([1j * omega])))[0, 0, 0]
        allowed = share * float(np.abs(gain))

        def excess(time: float) -> float:
            return float(left @ np.exp(-decay * time)) - allowed

        if excess(0.0) <= 0.0:
            return 0.0
        long = 1.0 / float(np.abs(sample.poles).max())
        while excess(long) > 0.0:
            if long * float(decay.max()) > 1e12:
                return float("inf")
            long *= 2.0
        return float(brentq(excess, 0.0, long))


class Responses(NamedTuple):
    """M `(shifts, k, outputs, inputs)`, what a hold passes `(shifts, k)`, and K
    `(k, inputs, outputs)`."""

    m: Complex
    hold: Complex
    law: Complex

    @property
    def shifts(self) -> int:
        """Number of frequencies that samples cannot tell apart."""
        return self.hold.shape[0]

    def some(self, at: NDArray[np.intp]) -> "Responses":
        """Those at some of the frequencies."""
        return Responses(self.m[:, at], self.hold[:, at], self.law[at])


class Middles(NamedTuple):
    """E `(k, ends, ends)` and the factors of its slopes `(k, ends, channels)`,
    `(k, channels, ends)`."""

    e: Complex
    left: Complex
    right: Complex


def _with_totals(system: System, inputs: int) -> System:
    """A system with one more output for each of its last inputs, which reads its total."""
    a, b, c, d = system
    reading = np.hstack([np.zeros((inputs, d.shape[1] - inputs)), np.eye(inputs)])
    return a, b, np.vstack([c, np.zeros((inputs, len(a)))]), np.vstack([d, reading])


def _widened(fed: Feedback, rows: int, columns: int) -> Feedback:
    """A controller between so many outputs and inputs, those of its own first."""
    drive, measure = np.eye(columns, len(fed.columns)), np.eye(len(fed.rows), rows)
    return Feedback(
        rows=list(range(rows)),
        columns=list(range(columns)),
        realise=lambda order: with_gains(drive, fed.realise(order), measure),
        response=lambda s: (drive @ fed.response(s) @ measure).astype(np.complex128),
        step=fed.step,
        delays=(*fed.delays, *(0.0,) * (columns - len(fed.columns))),
    )


def _along(e: Complex, ray: complex | None) -> tuple[float, int]:
    """How far `(k,)` values over frequency reach, in size or along a ray, and the number of the
    frequency there or before."""
    if ray is None:
        size = np.abs(e)
        return float(size.max()), int(np.argmax(size))
    turned = e * np.conj(ray)
    low, high = turned[:-1], turned[1:]
    k = np.flatnonzero(low.imag * high.imag <= 0.0)
    if not k.size:
        return LEAST, 0
    of = low.imag[k] - high.imag[k]
    share = low.imag[k] / np.where(of == 0.0, 1.0, of)
    axis = low.real[k] + share * (high.real - low.real)[k]
    axis = np.maximum(np.abs(axis) if ray == 1j else axis, LEAST)
    top = int(np.argmax(axis))
    return float(axis[top]), int(k[top])


def _mu(e: Complex) -> tuple[float, int]:
    """The largest mu of matrices `(k, n, n)`, and its number."""
    size = np.abs(e)
    # mu is at least the largest of the diagonal, and at most the norm, which squared is at most the
    # largest sum of a row times that of a column
    least = np.einsum("kii->ki", size).max(axis=1)
    norms = np.sqrt(size.sum(axis=1).max(axis=1) * size.sum(axis=2).max(axis=1))
    at = int(np.argmax(least))
    largest = float(least[at])
    order = np.argsort(-norms)
    for some in (order[k : k + MANY] for k in range(0, order.size, MANY)):
        if norms[some[0]] <= largest:
            break
        mu = balanced_bounds(e[some])
        k = int(np.argmax(mu))
        if mu[k] > largest:
            largest, at = float(mu[k]), int(some[k])
    return largest, at
