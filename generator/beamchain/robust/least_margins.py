"""The least margins of a controller over the values of a plant's uncertain quantities.

All figures that are stated are those of `bc.margins` at the values that are stated; where they are
the least is searched for at once.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain import report, robust
from beamchain.checks import unknown
from beamchain.results import Margins
from beamchain.robust.bounds import GainBound
from beamchain.robust.search import Loops, Peak, ascent
from beamchain.spec import Controller
from beamchain.toolkit import (
    AT_ZERO,
    REAL,
    Array,
    ClosedLoop,
    Complex,
    Extremum,
    Names,
    Signals,
    System,
    balanced_bounds,
    closed_around,
    counted,
    feedback,
    margins_of,
    response,
    with_deltas,
)

READ = "total of "  # before the name of an input: an output that reads it, controller included
DISK, GAIN, LESS, PHASE = "disk", "gain up, factor", "gain down, factor", "phase"
ALL = "all loops at once"
FIGURES = (DISK, GAIN, LESS, PHASE)  # of every input
# least reach of each that is a limit: that of an open loop which is zero, or infinite
LIMITED = (0.0, 0.5, 0.5, 0.0)
# frequencies per decade, and half widths beside a resonance, at which a sample is looked at
SPARSE = 40, np.sinh(np.linspace(-4.0, 4.0, 13))
FINER = 17  # points about what reaches farthest, between its neighbours
ROUNDS = 2  # of these
TURNS = 6  # of the slopes at a frequency, to a corner
AGAIN = 1e-3  # relative, by which what was tried for others is worse, to search from there
BESIDE = 1e-6  # relative, of what a slope is taken over
FAR = 1e3  # of the fastest pole: a slope at infinite frequency is taken there
LEAST = 1e-9  # of a reach, which has a logarithm


class LeastMargin(NamedTuple):
    """The least of a margin over all samples.

    Args:
        at: the input that is broken, or all loops at once.
        kind, unit: disk, gain up or down as a factor, or phase [degrees], signed as in
            `LoopMargins`.
        nominal, worst: of the nominal plant and of the worst sample; infinite where nothing limits
            it, 0 of an unstable sample (1 of a factor).
        frequency: of the worst one [rad/s]; NaN where nothing limits it.
        values: of the quantities in that sample.
        proved: what no value of the quantities goes below, 0 where one is unstable; None where it
            was not asked for.
        deltas: of the blocks in that sample, -1 and 1 at the ends of their ranges: one each where
            many quantities move together.
    """

    at: str
    kind: str
    unit: str
    nominal: float
    worst: float
    frequency: float
    values: Mapping[str, float]
    proved: float | None
    deltas: Mapping[str, float]


@dataclass(frozen=True, eq=False, repr=False)
class WorstMargins:
    """The least margins of a controller on an uncertain plant.

    Args:
        margins: at every input broken, others closed: disk, gain, phase; of the disk also all at
            once.
        stable: whether no sample was found unstable.
        bounds: by input, of `|(S - T)/2|`; empty where they were not asked for, or a sample is
            unstable.
        pose: of the craft, one of several; empty where there is one.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import robust
        >>> from beamchain.robust.least_margins import LeastMargin
        >>> disk = LeastMargin("torque_z", "disk", "", 0.9, 0.7, 1.3, {"bus.mass": 280.0}, 0.69, {})
        >>> robust.WorstMargins((disk,), True, {}).least().worst
        0.7
    """

    margins: tuple[LeastMargin, ...]
    stable: bool
    bounds: Mapping[str, GainBound]
    pose: str = ""

    def __repr__(self) -> str:
        return f"<WorstMargins, {self.sentence}>"

    def __len__(self) -> int:
        return len(self.margins)

    def __getitem__(self, number: int) -> LeastMargin:
        return self.margins[number]

    def __iter__(self) -> Iterator[LeastMargin]:
        return iter(self.margins)

    def least(self, kind: str = DISK) -> LeastMargin:
        """The least of one kind, over the inputs broken one at a time.

        Args:
            kind: `"disk"`, `"gain up, factor"`, `"gain down, factor"` or `"phase"`.

        Raises:
            InputError: there is no such kind.
        """
        several = [row for row in self.margins if row.kind == kind and row.at != ALL]
        if not several:
            kinds = dict.fromkeys(row.kind for row in self.margins if row.at != ALL)
            raise unknown("kind", kind, kinds)
        return min(several, key=lambda row: smallness(kind, row.worst))

    @property
    def all_at_once(self) -> LeastMargin:
        """The disk margin of simultaneous changes of all loops."""
        return next(row for row in self.margins if row.at == ALL)

    @property
    def sentence(self) -> str:
        """The finding in a sentence."""
        where = f"{self.pose}: " if self.pose else ""
        if not self.stable:
            return f"{where}unstable for some values of the uncertain quantities"
        disk = self.least()
        return (
            f"{where}least disk margin {disk.worst:.3g} at {disk.at}, {disk.frequency:.4g} rad/s "
            f"(nominal {disk.nominal:.3g}), all loops at once {self.all_at_once.worst:.3g}"
        )

    @property
    def table(self) -> "report.Table":
        """All margins."""
        return robust.tables.worst_margin_table([self])

    def as_dict(self) -> dict[str, Any]:
        """For JSON; None where a number is not finite."""
        rows = [
            {
                key: None if isinstance(value, float) and not np.isfinite(value) else value
                for key, value in row._asdict().items()
            }
            for row in self.margins
        ]
        return {"stable": self.stable, "pose": self.pose, "margins": rows}

    def _repr_html_(self) -> str:
        return report.table_html(self.table, [self.sentence])


@dataclass(frozen=True, eq=False, repr=False)
class WorstMarginsOfPoses:
    """The least margins at every pose of a craft.

    Args:
        each: one per pose.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import robust
        >>> from beamchain.robust.least_margins import LeastMargin
        >>> of_poses = [
        ...     robust.WorstMargins(
        ...         (LeastMargin("torque_z", "disk", "", 0.9, disk, 1.3, {}, None, {}),),
        ...         True,
        ...         {},
        ...         pose,
        ...     )
        ...     for pose, disk in (("drive 0°", 0.8), ("drive 90°", 0.7))
        ... ]
        >>> robust.WorstMarginsOfPoses(tuple(of_poses)).worst.pose
        'drive 90°'
    """

    each: tuple[WorstMargins, ...]

    def __repr__(self) -> str:
        return f"<WorstMarginsOfPoses, {len(self)} poses; {self.worst.sentence}>"

    def __len__(self) -> int:
        return len(self.each)

    def __getitem__(self, number: int) -> WorstMargins:
        return self.each[number]

    def __iter__(self) -> Iterator[WorstMargins]:
        return iter(self.each)

    @property
    def labels(self) -> tuple[str, ...]:
        """The poses."""
        return tuple(margins.pose for margins in self.each)

    @property
    def worst(self) -> WorstMargins:
        """Those of the least disk margin, with their pose."""
        return min(self.each, key=lambda margins: margins.least().worst)

    @property
    def stable(self) -> bool:
        """Whether no sample was found unstable at any pose."""
        return all(margins.stable for margins in self.each)

    @property
    def table(self) -> "report.Table":
        """All margins, pose by pose."""
        return robust.tables.worst_margin_table(self.each)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"worst": self.worst.pose, "poses": [each.as_dict() for each in self.each]}

    def _repr_html_(self) -> str:
        return report.table_html(self.table, [self.worst.sentence])


def figure(found: Margins, at: str, kind: str) -> Extremum:
    """One of the figures of a sample; of an unstable one nothing is left."""
    if not found.stable:
        return Extremum(1.0 if kind in (GAIN, LESS) else 0.0, np.nan)
    if at == ALL:
        return found.all_at_once
    loop = next(loop for loop in found.loops if loop.input == at)
    value, frequency = {
        DISK: (loop.disk, loop.disk_frequency),
        GAIN: (loop.gain, loop.gain_frequency),
        LESS: (loop.lowest_gain, loop.lowest_gain_frequency),
        PHASE: (loop.phase, loop.phase_frequency),
    }[kind]
    limited = np.isfinite(value) and value != 0.0
    return Extremum(value, frequency if limited else np.nan)


def smallness(kind: str, value: float) -> float:
    """What is the less, the less of a margin is left."""
    return -value if kind == LESS else abs(value)


def _beside(deltas: Array) -> Iterator[Array]:
    """The same with one of them after the other at either end of its range."""
    for k in range(deltas.size):
        for end in (-1.0, 1.0):
            moved = deltas.copy()
            moved[k] = end
            yield moved


class Reach(NamedTuple):
    """How far E of a sample reaches where each figure looks.

    Args:
        sizes: `(figures,)`, infinite of an unstable sample.
        omega: `(figures,)` where [rad/s].
    """

    sizes: Array
    omega: Array


class SampleLoops:
    """The closed loops of an uncertain plant at the inputs that a controller drives, and one search
    for the samples of all their least margins.

    At an input, the open loop is `L = 1/S - 1`, and every margin is a point on the locus of
    `E = S - 1/2`: the disk margin is `1/max |E|`; `L = -1/g` where `E = (g + 1)/(2 (g - 1))`, so
    that the gain may rise the least where E reaches farthest along the positive real axis, and fall
    the least where it does along the negative one; `L = -exp(j phi)` where
    `E = j/(2 tan(phi/2))`, the phase. Of all inputs at once it is mu of the matrix E.

    Args:
        system, blocks, inputs, outputs: M, the number of the delta of every channel, the signals.
        controller: the loops.
    """

    def __init__(
        self,
        system: System,
        blocks: Sequence[int],
        inputs: list[str],
        outputs: list[str],
        controller: Controller,
    ) -> None:
        self._m = system
        self._controller = controller
        self._of = np.asarray(blocks, dtype=np.intp)
        self._count = max(blocks, default=-1) + 1
        signals = Signals(inputs, outputs, inputs, outputs)
        self._labels = Names(signals, ("",) * system[0].shape[0], ())
        self._fed = feedback(controller, signals)
        self._rows = [len(blocks) + row for row in self._fed.rows]
        self._columns = [len(blocks) + column for column in self._fed.columns]
        self.names = [inputs[column] for column in self._fed.columns]
        single = [(name, kind) for name in self.names for kind in FIGURES]
        self.figures = (*single, (ALL, DISK)) if len(self.names) > 1 else tuple(single)
        self._reaches: dict[bytes, Reach] = {}
        self.tried: list[Array] = []

    @property
    def rows(self) -> list[tuple[str, str]]:
        """Where and what is stated: the disk margins, the others, all loops at once."""
        single = sorted(
            ((at, kind) for at, kind in self.figures if at != ALL), key=lambda each: each[1] != DISK
        )
        return [*single, (ALL, DISK)]

    def disk(self, name: str) -> Loops:
        """The loop from a disturbance d at an input to E d there."""
        a, b, c, d = self._m
        inputs, outputs = self._labels.signals.inputs, self._labels.signals.outputs
        # one more output per input reads its total, which is S d
        reading = np.hstack([np.zeros((len(inputs), self._of.size)), np.eye(len(inputs))])
        system = a, b, np.vstack([c, np.zeros((len(inputs), len(a)))]), np.vstack([d, reading])
        return Loops(
            system,
            self._of.tolist(),
            inputs,
            [*outputs, *(READ + each for each in inputs)],
            self._controller,
            (name, READ + name),
            offset=-0.5,
            undamped=True,
        )

    def closed(self, deltas: Array) -> ClosedLoop:
        """The closed loop of a sample `(blocks,)`, its poles counted with Pade approximations."""
        return closed_around(with_deltas(self._m, deltas[self._of]), self._fed, self._labels)

    def margins(self, deltas: Array) -> Margins:
        """What `bc.margins` says of a sample `(blocks,)`."""
        return margins_of(counted(self.closed(deltas)))

    def search(self, starts: Sequence[Array]) -> list[Array]:
        """The deltas of the worst samples that were found, each once.

        Tried are `starts`, the corners to which slopes point, and for every figure a local search
        from the worst of all that was tried for any of them, with the ends of every range, one at a
        time, where that ends; again where others have found a worse one.
        """
        if not self._all_stable([*starts, *self._corners()]):
            return self._worst()[0][:1]
        known = np.resize(LIMITED, len(self.figures))
        while True:
            worst, sizes = self._worst()
            again = np.flatnonzero(sizes > known * (1.0 + AGAIN))
            if not again.size:
                return list({deltas.tobytes(): deltas for deltas in worst}.values())
            figure = int(again[0])
            ascent(FigureOfSamples(self, figure), worst[figure])
            worst, sizes = self._worst()
            known[figure] = sizes[figure]
            if not np.isfinite(known[figure]) or not self._all_stable(_beside(worst[figure])):
                return self._worst()[0][:1]

    def _all_stable(self, samples: Iterable[Array]) -> bool:
        """Whether all samples are stable; none is tried after one that is not."""
        return all(np.isfinite(self.reach(deltas).sizes[0]) for deltas in samples)

    def _worst(self) -> tuple[list[Array], Array]:
        """Of every figure the worst sample that was tried, and how far it reaches."""
        sizes = np.array([self._reaches[deltas.tobytes()].sizes for deltas in self.tried])
        at = np.argmax(sizes, axis=0)
        return [self.tried[int(k)] for k in at], sizes.max(axis=0)

    def _corners(self) -> list[Array]:
        """Corners of the ranges to which the slopes of E point, turn by turn, at the frequencies
        of the nominal loop, in every direction in which a figure looks: where they reach farther
        than at neighbouring frequencies."""
        omega = self.closed(np.zeros(self._count)).frequencies(*SPARSE)
        m, law = self._responses(omega)
        member = np.equal.outer(self._of, np.arange(self._count)).astype(np.float64)
        found: dict[bytes, Array] = {}
        for i in range(len(self.names)):
            for ray in (None, 1.0, -1.0, 1j, -1j):
                deltas = np.zeros((omega.size, self._count))
                best, farthest = deltas, np.full(omega.size, -np.inf)
                for _ in range(TURNS):
                    e, left, right = self._middles(m, law, deltas)
                    here = e[:, i, i]
                    turned = np.conj(here / np.abs(here) if ray is None else ray)
                    size = (here * turned).real
                    better = size > farthest
                    best = np.where(better[:, None], deltas, best)
                    farthest = np.where(better, size, farthest)
                    each = (left[:, i] * right[:, :, i] * np.reshape(turned, (-1, 1))).real
                    deltas = np.where(each @ member < 0.0, -1.0, 1.0)
                ends = np.concatenate([[-np.inf], farthest, [-np.inf]])
                tops = (farthest >= ends[:-2]) & (farthest >= ends[2:]) & (farthest > 0.5)
                found |= {row.tobytes(): row for row in best[tops]}
        return list(found.values())

    def reach(self, deltas: Array) -> Reach:
        """How far a sample `(blocks,)` reaches."""
        key = deltas.tobytes()
        if key not in self._reaches:
            self.tried.append(deltas.copy())
            self._reaches[key] = self._reach(self.closed(deltas))
        return self._reaches[key]

    def _reach(self, closed: ClosedLoop) -> Reach:
        if closed.growing.size and not counted(closed).stable:
            nowhere = np.full(len(self.figures), np.inf)
            return Reach(nowhere, np.full(len(self.figures), np.nan))
        half = np.eye(len(self.names)) / 2.0

        def middle(omega: Array) -> Complex:
            loop = closed.open_loop(omega)
            return np.asarray(np.linalg.inv(2.0 * half + loop) - half, dtype=np.complex128)

        omega = closed.frequencies(*SPARSE)
        omega = np.append(AT_ZERO * omega[0], omega)
        e = middle(omega)
        # at rest E is real, of an integrator but for rounding
        e[0] = np.where(np.abs(e[0].imag) < REAL * np.abs(e[0]), e[0].real, e[0])
        at = self._farthest(e)[1]
        for _ in range(ROUNDS):
            low, high = omega[np.maximum(at - 1, 0)], omega[np.minimum(at + 1, omega.size - 1)]
            more = np.setdiff1d(np.linspace(low, high, FINER), omega)
            order = np.argsort(np.append(omega, more))
            omega = np.append(omega, more)[order]
            e = np.concatenate([e, middle(more)])[order]
            at = self._farthest(e)[1]
        sizes, at = self._farthest(e)
        where = omega[at]
        if closed.limit is not None:
            end = np.linalg.inv(2.0 * half + closed.limit) - half
            last = self._farthest(np.array([end, end], dtype=np.complex128))[0]
            where = np.where(last > sizes, np.inf, where)
            sizes = np.maximum(last, sizes)
        return Reach(sizes, where)

    def _farthest(self, e: Complex) -> tuple[Array, NDArray[np.intp]]:
        """Of E `(k, inputs, inputs)` over frequency, `(figures,)` how far it reaches for every
        figure, and the number of the frequency there or before."""
        found: list[tuple[float, int]] = []
        for i in range(len(self.names)):
            here = e[:, i, i]
            size = np.abs(here)
            found.append((float(size.max()), int(np.argmax(size))))
            for turned, sides in ((here, 1), (-here, 1), (here / 1j, 2)):
                low, high = turned[:-1], turned[1:]
                k = np.flatnonzero(low.imag * high.imag <= 0.0)
                of = low.imag[k] - high.imag[k]
                share = low.imag[k] / np.where(of == 0.0, 1.0, of)
                axis = low.real[k] + share * (high.real - low.real)[k]
                axis = np.maximum(np.abs(axis) if sides == 2 else axis, LEAST)
                top = int(np.argmax(axis)) if k.size else -1
                found.append((float(axis[top]), int(k[top])) if k.size else (LEAST, 0))
        if len(self.names) > 1:
            # mu is between the largest element of the diagonal and the norm
            top = max(size for size, _ in found[:: len(FIGURES)])
            k = np.flatnonzero(np.linalg.norm(e, axis=(1, 2)) >= top)
            mu = balanced_bounds(e[k])
            found.append((float(mu.max()), int(k[np.argmax(mu)])))
        sizes, at = zip(*found, strict=True)
        return np.array(sizes), np.array(at, dtype=np.intp)

    def slope(self, figure: int, deltas: Array, omega: float) -> Array:
        """`(blocks,)` slope of the logarithm of a reach, which is at a frequency."""
        omega = min(omega, FAR * self.closed(deltas).top)
        m, law = self._responses(omega * (1.0 + BESIDE * np.array([-1.0, 0.0, 1.0])))
        e, left, right = self._middles(m, law, np.broadcast_to(deltas, (3, self._count)))
        # dE/d(delta_c) is the column of channel c in `left` times its row in `right`
        slopes = np.zeros((self._count, *e.shape[1:]), dtype=np.complex128)
        np.add.at(slopes, self._of, left[1].T[:, :, None] * right[1][:, None, :])
        if self.figures[figure][0] == ALL:
            mu = balanced_bounds(np.concatenate([e[1:2], e[1] + BESIDE * slopes]))
            return (mu[1:] / mu[0] - 1.0) / BESIDE
        i, kind = divmod(figure, len(FIGURES))
        here = complex(e[1, i, i])
        up = 1j if here.imag > 0.0 else -1j
        ray = np.conj((here / abs(here), 1.0, -1.0, up)[kind])
        each = slopes[:, i, i] * ray
        along = (e[2, i, i] - e[0, i, i]) * ray
        # the crossing of the ray moves by d(omega) = -Im(dE/d(delta))/Im(dE/d(omega))
        moving = 0.0 if kind == 0 or along.imag == 0.0 else along.real / along.imag
        return np.asarray(each.real - moving * each.imag, dtype=np.float64) / abs(here)

    def _responses(self, omega: Array) -> tuple[Complex, Complex]:
        """M and K at frequencies `(k,)`."""
        s = (1j * omega).astype(np.complex128)
        return response(self._m, s), self._fed.response(s)

    def _middles(self, m: Complex, law: Complex, deltas: Array) -> tuple[Complex, Complex, Complex]:
        """E `(k, inputs, inputs)` at frequencies with a sample each, `(k, blocks)`, and the factors
        `(k, inputs, channels)` and `(k, channels, inputs)` of its slopes."""
        delta = deltas[:, self._of]
        n = self._of.size
        eye, ones = np.eye(n), np.eye(len(self.names))
        zw, yw = m[:, :n, :n], m[:, self._rows, :n]
        # z = Z u, Z = (1 - M_zw Delta)^-1 M_zu;  G = M_yu + M_yw Delta Z
        z = np.linalg.solve(eye - zw * delta[:, None, :], m[:, :n, self._columns])
        g = m[:, self._rows][:, :, self._columns] + (yw * delta[:, None, :]) @ z
        s = np.asarray(np.linalg.inv(ones + law @ g), dtype=np.complex128)
        # dG/d(delta_c) = l_c z_c, l = M_yw (1 - Delta M_zw)^-1, and dS = -S K dG S
        transposed = np.swapaxes(eye - delta[:, :, None] * zw, 1, 2)
        out = np.swapaxes(np.linalg.solve(transposed, np.swapaxes(yw, 1, 2)), 1, 2)
        e = np.asarray(s - ones / 2.0, dtype=np.complex128)
        return e, np.asarray(-(s @ law) @ out, dtype=np.complex128), z @ s


class FigureOfSamples(NamedTuple):
    """How far samples reach for one figure, as a gain that a search makes large."""

    loops: SampleLoops
    figure: int

    def peak(self, deltas: Array) -> Peak:
        """How far a sample reaches."""
        sizes, omega = self.loops.reach(deltas)
        return Peak(float(sizes[self.figure]), float(omega[self.figure]))

    def slope(self, deltas: Array, omega: float) -> Array:
        """The slope of its logarithm."""
        return self.loops.slope(self.figure, deltas, omega)
