"""An upper bound of the gain of a closed loop over all values of its uncertain quantities: steps
over frequency, each of which holds between its ends.

Intervals are halved where a bound is far above what samples reach: in frequency, or, where the
program itself cannot tell a delta's values apart, the range of that delta; each half is a linear
fractional transformation of its own.
"""

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain.robust.interval_loop import LocalLoop, in_box, local_loop
from beamchain.robust.lft import Block
from beamchain.robust.multipliers import (
    BEYOND,
    ComplexSystem,
    Delta,
    Multipliers,
    balanced,
    cvxpy,
    prove,
    solve_program,
)
from beamchain.robust.uncertain_loop import UncertainLoop
from beamchain.toolkit import Array, locked

MOST = 200  # intervals
LOOKED = 600  # frequencies at which samples are looked at, beside those about peaks
MANY = 10  # channels, above which programs are large
FIRST, FEWER = 40, 24  # intervals at first, and with large programs
CLOSE = 1.02  # of the largest gain found, to which the largest step is brought
NEAR = 1.25  # of what samples reach in an interval, to which its step is brought
NARROW = 1.001  # ratio of the ends of an interval that is not halved further
WIDE = 1.1  # ratio of the ends, down to which an interval without a bound is halved first
BOXES = 32  # most parts of the ranges in an interval
MORE = 3  # frequencies that a program is given after the first
ENOUGH = 1.01  # of a program's own gain, to which its proof is brought
MENTIONED = 3  # deltas that a sentence names
NOTHING = 1e-3  # relative, of the error of a dead time that a program need not know


@dataclass(frozen=True, eq=False, repr=False)
class GainBound:
    """An upper bound of a gain for all values of the uncertain quantities, as steps.

    Args:
        edges: `(k + 1,)` of the intervals, from 0 to infinity [rad/s].
        gains: `(k,)` what no value exceeds at any frequency of the interval; infinite where no
            bound was found.
        sampled: `(k,)` the most that samples reach there.
        boxes: number of parts of the ranges, interval by interval.
        doubtful: names of the deltas whose ranges were too wide where no bound was found.
        late: whether time was up before all steps were as close as they are wanted.
        programs, seconds: number of semidefinite programs, and time [s].

    Example:
        >>> import beamchain as bc
        >>> from beamchain import robust
        >>> import numpy as np
        >>> ends = np.array([0.0, 1.0, np.inf])
        >>> bound = robust.GainBound(
        ...     ends, np.array([2.0, 0.5]), np.array([1.9, 0.4]), (1, 1), (), False, 2, 1.0
        ... )
        >>> bound.gain, bound.stable, bound.at([0.5, 3.0]).tolist()
        (2.0, True, [2.0, 0.5])
    """

    edges: Array
    gains: Array
    sampled: Array
    boxes: tuple[int, ...]
    doubtful: tuple[str, ...]
    late: bool
    programs: int
    seconds: float

    def __repr__(self) -> str:
        return f"<GainBound, {self.sentence}>"

    @property
    def gain(self) -> float:
        """The largest step."""
        return float(self.gains.max())

    @property
    def stable(self) -> bool:
        """Whether the loop is proved stable for all values: no pole reaches the imaginary axis."""
        return bool(np.isfinite(self.gains).all())

    @property
    def frequency(self) -> tuple[float, float]:
        """Ends of the interval of the largest step [rad/s]."""
        at = int(np.argmax(self.gains))
        return float(self.edges[at]), float(self.edges[at + 1])

    def at(self, omega: Any) -> Array:
        """`(k,)` the steps at frequencies; between two steps the higher.

        Args:
            omega: `(k,)` [rad/s].
        """
        asked = np.atleast_1d(np.asarray(omega, dtype=np.float64))
        last = self.gains.size - 1
        right = np.clip(np.searchsorted(self.edges, asked, side="right") - 1, 0, last)
        left = np.clip(np.searchsorted(self.edges, asked, side="left") - 1, 0, last)
        return np.maximum(self.gains[left], self.gains[right])

    @property
    def sentence(self) -> str:
        """The bound in a sentence."""
        effort = f"{self.programs} programs in {self.gains.size} intervals, {self.seconds:.0f} s"
        if self.stable:
            return f"at most {self.gain:.4g} for all values ({effort})"
        none = np.flatnonzero(~np.isfinite(self.gains))
        low, high = float(self.edges[none[0]]), float(self.edges[none[-1] + 1])
        place = f"between {low:.4g} and {high:.4g} rad/s" if np.isfinite(high) else "at its end"
        parts = max(self.boxes[int(at)] for at in none)
        if self.late and parts == 1:
            return (
                f"no bound in {none.size} of {self.gains.size} intervals, {place} ({effort}): time "
                "was up before parts of the ranges were tried there; give more seconds, or fewer "
                "uncertain quantities, for programs grow with their number"
            )
        more = ", or more seconds, for time was up" if self.late else ""
        return (
            f"no bound in {none.size} of {self.gains.size} intervals, {place} ({effort}): the "
            f"ranges of {', '.join(self.doubtful[:MENTIONED])} are too wide for the program there, "
            f"even in {parts} parts, or hold values that make the loop unstable; give smaller "
            f"ranges, or each = true where modes share a number but need not{more}"
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON; None where there is no bound, and at the infinite end."""
        return {
            "gain": self.gain if self.stable else None,
            "edges": [float(w) if np.isfinite(w) else None for w in self.edges],
            "gains": [float(g) if np.isfinite(g) else None for g in self.gains],
            "doubtful": list(self.doubtful),
            "programs": self.programs,
            "seconds": self.seconds,
        }


class Box(NamedTuple):
    """A part of the ranges, deltas `centre + half d`, and the gain in it over an interval.

    `floor` is what the interval's own program gives at its frequencies, which only smaller boxes
    can lower, `split` the delta that it is least sure of, and `likely` the deltas that it takes for
    the worst.
    """

    centre: Array
    half: Array
    gain: float
    floor: float
    split: int
    likely: Array


class Interval(NamedTuple):
    """From `low` to `high` [rad/s], and the parts of the ranges there."""

    low: float
    high: float
    boxes: tuple[Box, ...]

    @property
    def gain(self) -> float:
        """What no value exceeds."""
        return max(box.gain for box in self.boxes)


def frequencies(loops: UncertainLoop, omega: Array) -> Array:
    """Frequencies at which samples are looked at: those given, and others from a tenth of the
    closed loop's slowest pole to twice the highest mode."""
    modes = np.abs(np.linalg.eigvals(loops.plant[0]))
    low = min(float(omega[0]), 0.1 * float(np.abs(loops.poles).min()))
    high = max(float(omega[-1]), 2.0 * float(modes.max(initial=0.0)))
    return np.unique(np.concatenate([omega, np.geomspace(low, high, LOOKED)]))


class Bounder:
    """Finds the bound of a loop.

    Args:
        loops: the closed loop.
        blocks: the deltas.
        samples: `(n, blocks)` deltas whose gains say where to look.
        omega: `(k,)` frequencies at which they are looked at, from the lowest to the highest of
            interest [rad/s].
        seconds: after which nothing is refined further.

    `best` are the deltas of the largest gain at one of the frequencies, and that gain.
    """

    best: tuple[Array, float]
    programs: int

    def __init__(
        self,
        loops: UncertainLoop,
        blocks: Sequence[Block],
        samples: Array,
        omega: Array,
        seconds: float,
    ) -> None:
        cvxpy()  # missing: said before any work
        self._loops = loops
        self._blocks = list(blocks)
        self._repetitions = [block.repetitions for block in blocks]
        self._omega = omega
        self._n = loops.exact(omega)
        self._sampled = np.zeros(omega.size)
        self.best = samples[0], -np.inf
        for deltas in samples:
            self._try(deltas, np.arange(omega.size))
        self._start = time.perf_counter()
        self._end = self._start + seconds
        self.programs = 0

    @property
    def _late(self) -> bool:
        return time.perf_counter() > self._end

    def _try(self, deltas: Array, at: NDArray[np.intp]) -> None:
        """Take the gains of a sample at some of the frequencies into account."""
        gains = self._loops.size(self._n[at], deltas)
        self._sampled[at] = np.maximum(self._sampled[at], gains)
        if gains.max() > self.best[1]:
            self.best = deltas, float(gains.max())

    def bound(self) -> GainBound:
        """Intervals halved until their steps are close to what samples reach, or time is up."""
        low, high = float(self._omega[0]), float(self._omega[-1])
        count = FIRST if sum(self._repetitions) <= MANY else FEWER
        edges = [0.0, *np.geomspace(low, high, count - 1).tolist(), float("inf")]
        blocks = len(self._repetitions)
        whole = [(np.zeros(blocks), np.ones(blocks))]
        pairs = list(pairwise(edges))
        # the highest first: what is not reached in time has no bound
        order = sorted(pairs, key=lambda ends: -self._peak(*ends)[1])
        found = {ends: self._interval(*ends, whole) for ends in order}
        intervals = [found[ends] for ends in pairs]
        while not self._late:
            at = self._next(intervals)
            if at is None:
                break
            intervals[at : at + 1] = self._refined(intervals[at], len(intervals) < MOST)
        return GainBound(
            edges=locked([*(interval.low for interval in intervals), float("inf")]),
            gains=locked([interval.gain for interval in intervals]),
            sampled=locked([self._peak(each.low, each.high)[1] for each in intervals]),
            boxes=tuple(len(interval.boxes) for interval in intervals),
            doubtful=tuple(self._doubtful_names(intervals)),
            late=self._late,
            programs=self.programs,
            seconds=time.perf_counter() - self._start,
        )

    def _doubtful_names(self, intervals: Sequence[Interval]) -> list[str]:
        """The deltas that failed programs are least sure of, the most frequent first."""
        splits = [
            box.split
            for interval in intervals
            for box in interval.boxes
            if not np.isfinite(box.gain)
        ]
        return [self._blocks[delta].name for delta, _ in Counter(splits).most_common()]

    def _peak(self, low: float, high: float) -> tuple[float, float]:
        """Where samples reach the most between two frequencies, and how much; that beside them
        where none of the frequencies is between."""
        inside = self._inside(low, high)
        at = int(inside[np.argmax(self._sampled[inside])])
        return float(self._omega[at]), float(self._sampled[at])

    def _inside(self, low: float, high: float) -> NDArray[np.intp]:
        inside = np.flatnonzero((self._omega >= low) & (self._omega <= high))
        if inside.size:
            return inside
        near = low if low > 0.0 else high
        return np.array([int(np.argmin(np.abs(self._omega - near)))])

    def _next(self, intervals: Sequence[Interval]) -> int | None:
        """The interval to refine: the highest that is above the largest gain found, else that
        farthest above its samples; None where all are close, or nothing can be refined."""
        top = self.best[1]
        ranks: dict[int, tuple[float, float]] = {}
        for number, interval in enumerate(intervals):
            ratio = interval.gain / self._peak(interval.low, interval.high)[1]
            over = interval.gain if interval.gain > CLOSE * top else 0.0
            spent = len(interval.boxes) >= BOXES and _narrow(interval)
            if (over or ratio > NEAR) and not spent:
                ranks[number] = over, ratio
        return max(ranks, key=lambda number: ranks[number], default=None)

    def _refined(self, interval: Interval, may_halve: bool) -> list[Interval]:
        """An interval, halved in frequency, or in the range of a delta of its highest box."""
        boxes = interval.boxes
        at = max(range(len(boxes)), key=lambda i: boxes[i].gain)
        sampled = self._peak(interval.low, interval.high)[1]
        # half of what is missing is missing at the program's own frequencies
        weak = boxes[at].floor > (boxes[at].gain + sampled) / 2.0
        if not np.isfinite(boxes[at].floor):
            weak = interval.high < WIDE * interval.low
        if (weak or _narrow(interval) or not may_halve) and len(boxes) < BOXES:
            parts = _halves(boxes[at])
            low, high = interval.low, interval.high
            new = self._interval(low, high, parts).boxes
            return [Interval(low, high, (*boxes[:at], *new, *boxes[at + 1 :]))]
        middle = _middle(interval.low, interval.high)
        parts = [(box.centre, box.half) for box in boxes]
        return [
            self._interval(interval.low, middle, parts),
            self._interval(middle, interval.high, parts),
        ]

    def _interval(self, low: float, high: float, parts: Sequence[tuple[Array, Array]]) -> Interval:
        """The bound over an interval in parts (centre, half) of the ranges."""
        loop = local_loop(self._loops, low, high)
        boxes: list[Box] = []
        for part in parts:
            boxes.append(self._box(loop, low, high, *part))
            self._try(boxes[-1].likely, self._inside(low, high))
        return Interval(low, high, tuple(boxes))

    def _box(self, loop: LocalLoop, low: float, high: float, centre: Array, half: Array) -> Box:
        """The bound in a part of the ranges: a program at a few frequencies, its proof, and again
        with the frequency at which the proof needs the most."""
        top = high if np.isfinite(high) else BEYOND * low
        at, sampled = self._peak(low, high)
        ends = [max(low, 1e-3 * top), top]
        omega = [min(max(at, low), top)]
        if len(loop.blocks) <= MANY:
            omega += ends
        known = loop.errors > NOTHING
        deltas = [Delta(count, real=True) for count in self._repetitions]
        deltas += [Delta(1, real=False)] * int(known.sum())
        channels = sum(delta.repetitions for delta in deltas)
        system = _without_unknown(in_box(loop, centre, half), len(loop.blocks), known)
        unknown = int((~known).sum())
        system = balanced(system, np.array([*omega, *ends]), sampled, unknown)
        all_channels = system.d.shape[0] - 1
        asked = [*range(channels), all_channels]
        box = Box(centre, half, np.inf, np.inf, self._doubtful(system, np.array(omega)), centre)
        for _ in range(MORE):
            if self._late:
                break
            self.programs += 1
            n = system.at(np.unique(omega))[:, asked][:, :, asked]
            program = solve_program(n, deltas)
            if program is None:
                break
            proof = prove(system, _extended(program.multipliers, all_channels), low, high)
            floor = sampled * float(np.sqrt(max(program.g, 0.0)))
            of_reals = np.s_[: len(self._repetitions)]
            # the program's variance is of d, from -1 to 1 in the box
            split = int(np.argmax(program.unsure[of_reals]))
            likely = centre + half * np.clip(program.likely[of_reals], -1.0, 1.0)
            gain = min(box.gain, sampled * float(np.sqrt(proof.g)))
            box = Box(centre, half, gain, floor, split, likely)
            if gain < ENOUGH * floor:
                break
            omega.append(proof.omega if np.isfinite(proof.omega) else top)
        return box

    def _doubtful(self, system: ComplexSystem, omega: Array) -> int:
        """The delta whose own feedback is the strongest."""
        n = system.at(omega)
        ends = np.cumsum([0, *self._repetitions])
        own = [
            float(np.abs(np.linalg.eigvals(n[:, a:b, a:b])).max())
            for a, b in zip(ends[:-1], ends[1:], strict=True)
        ]
        return int(np.argmax(own))


def _narrow(interval: Interval) -> bool:
    return interval.high < NARROW * interval.low


def _halves(box: Box) -> list[tuple[Array, Array]]:
    """A box in two, across the delta that its program is least sure of: centres, half widths."""
    half = box.half.copy()
    half[box.split] /= 2.0
    shift = np.where(np.arange(half.size) == box.split, half, 0.0)
    return [(box.centre - shift, half), (box.centre + shift, half)]


def _middle(low: float, high: float) -> float:
    if not np.isfinite(high):
        return 2.0 * low
    return float(np.sqrt(low * high)) if low > 0.0 else high / 2.0


def _without_unknown(system: ComplexSystem, start: int, known: Any) -> ComplexSystem:
    """The channels of errors that programs know before those that they need not."""
    count = known.size
    behind = [*np.flatnonzero(known).tolist(), *np.flatnonzero(~known).tolist()]
    order = [*range(start), *(start + error for error in behind), start + count]
    a, b, c, d = system
    return ComplexSystem(a, b[:, order], c[order], d[np.ix_(order, order)])


def _extended(multipliers: Multipliers, size: int) -> Multipliers:
    """With 1 for the channels of small errors, which are in balance."""
    pad = size - multipliers.d.shape[0]
    ones = np.diag(np.append(np.zeros(size - pad), np.ones(pad)))
    around = ((0, pad), (0, pad))
    return Multipliers(np.pad(multipliers.d, around) + ones, np.pad(multipliers.g, around))
