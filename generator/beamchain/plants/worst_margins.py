"""The least margins of a controller over the values of a plant's uncertain quantities.

At every input that loops drive, the loops of the others closed, with S and T there: the disk margin
is `1 / max |(S - T)/2|`, all inputs at once `1 / max mu((S - T)/2)` for diagonal complex changes,
mu by its upper bound with diagonal scaling. All from exact frequency responses.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from beamchain import report
from beamchain.checks import unknown
from beamchain.plants.bounds import GainBound
from beamchain.plants.controllers import Controller, Response, places
from beamchain.plants.controllers import response as loop_response
from beamchain.plants.crossings import crossing
from beamchain.plants.structured import balanced_bounds, bound
from beamchain.plants.systems import Complex, System, response
from beamchain.plants.worst_case import Loops
from beamchain.ports.motions import Array

READ = "total of "  # before the name of an input: an output that reads it, controller included
DISK, GAIN, LESS, PHASE = "disk", "gain up, factor", "gain down, factor", "phase"
ALL = "all loops at once"
PATTERN = (1.0, 0.5, 0.25)  # steps of the local search for gain and phase, from the least
PLACED = 1e-7  # relative, of the frequency of the largest mu


class LeastMargin(NamedTuple):
    """The least of a margin over all samples.

    Args:
        at: the input that is broken, or all loops at once.
        kind, unit: disk, gain up or down as a factor, or phase [degrees].
        nominal, worst: of the nominal plant and of the worst sample; infinite where nothing limits
            it, 0 of an unstable sample (1 of a factor).
        frequency: of the worst one [rad/s].
        values: of the quantities in that sample.
        proved: what no value of the quantities goes below; None where it was not asked for.
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
        bounds: by input, of `|(S - T)/2|`; empty where they were not asked for.
        pose: of the craft, one of several; empty where there is one.

    Example:
        >>> import beamchain as bc
        >>> from beamchain.plants.worst_margins import LeastMargin
        >>> disk = LeastMargin("torque_z", "disk", "", 0.9, 0.7, 1.3, {"bus.mass": 280.0}, 0.69, {})
        >>> bc.WorstMargins((disk,), True, {}).least().worst
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
        return (max if kind == LESS else min)(several, key=lambda row: row.worst)

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
        return report.worst_margin_table([self])

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
        >>> from beamchain.plants.worst_margins import LeastMargin
        >>> of_poses = [
        ...     bc.WorstMargins(
        ...         (LeastMargin("torque_z", "disk", "", 0.9, disk, 1.3, {}, None, {}),),
        ...         True,
        ...         {},
        ...         pose,
        ...     )
        ...     for pose, disk in (("drive 0°", 0.8), ("drive 90°", 0.7))
        ... ]
        >>> bc.WorstMarginsOfPoses(tuple(of_poses)).worst.pose
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
        return report.worst_margin_table(self.each)

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {"worst": self.worst.pose, "poses": [each.as_dict() for each in self.each]}

    def _repr_html_(self) -> str:
        return report.table_html(self.table, [self.worst.sentence])


class Limits(NamedTuple):
    """Margins of an open loop, each a value and its frequency [rad/s]."""

    gain: tuple[float, float]
    less: tuple[float, float]
    phase: tuple[float, float]


NOTHING_LIMITS = Limits((np.inf, np.nan), (0.0, np.nan), (np.inf, np.nan))
UNSTABLE = Limits((1.0, np.nan), (1.0, np.nan), (0.0, np.nan))


class SampleLoops:
    """The closed loops of an uncertain plant at the inputs that a controller drives.

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
        channels = len(blocks)
        self._m = system
        self._blocks = np.asarray(blocks, dtype=np.intp)
        self._controller = controller
        rows, columns = places(controller, inputs, outputs)
        driven = list(dict.fromkeys(columns))
        self.names = [inputs[column] for column in driven]
        self._rows = [channels + row for row in rows]
        self._columns = [channels + column for column in driven]
        # `(inputs, loops)` which loop drives which
        self._drives = np.equal.outer(driven, columns).astype(np.float64)
        extended, labels = _with_totals(system, channels, inputs, outputs)
        self._known: dict[bytes, list[Limits]] = {}
        # from d at an input to its total, which is S d; S - 1/2 is (S - T)/2
        self.disks = [
            Loops(
                extended,
                blocks,
                inputs,
                labels,
                controller,
                (name, READ + name),
                offset=-0.5,
                undamped=True,
            )
            for name in self.names
        ]

    def sensitivity(self, deltas: Array, omega: Array) -> Complex:
        """`(k, inputs, inputs)` S of a sample `(blocks,)` at frequencies `(k,)`, dead times
        exact."""
        s = (1j * omega).astype(np.complex128)
        m = response(self._m, s)
        n = self._blocks.size
        delta = deltas[self._blocks]
        inside = np.linalg.solve(np.eye(n) - m[:, :n, :n] * delta, m[:, :n, self._columns])
        # G = M_yu + M_yw Delta (1 - M_zw Delta)^-1 M_zu
        through = (m[:, self._rows, :n] * delta) @ inside
        g = m[:, self._rows][:, :, self._columns] + through
        k = np.array([loop_response(loop, s) for loop in self._controller.loop]).T
        back = (self._drives * k[:, None, :]) @ g
        return np.asarray(np.linalg.inv(np.eye(len(self._columns)) + back), dtype=np.complex128)

    def limits(self, deltas: Array) -> list[Limits]:
        """Gain and phase margins of a sample at every input; of an unstable one none is left."""
        key = deltas.tobytes()
        if key not in self._known:
            self._known[key] = self._limits(deltas)
        return self._known[key]

    def _limits(self, deltas: Array) -> list[Limits]:
        if not self.disks[0].peak(deltas).stable:
            return [UNSTABLE] * len(self.names)
        omega = self.disks[0].frequencies(deltas)
        s = self.sensitivity(deltas, omega)

        def open_loop(i: int) -> Callable[[float], complex]:
            return lambda w: 1.0 / self.sensitivity(deltas, np.array([w]))[0, i, i] - 1.0

        return [
            limits_of(omega, 1.0 / s[:, i, i] - 1.0, open_loop(i)) for i in range(len(self.names))
        ]

    def at_once(self, deltas: Array) -> tuple[float, float]:
        """Disk margin of simultaneous changes at all inputs, and its frequency [rad/s]."""
        single = [disk.peak(deltas) for disk in self.disks]
        if not single[0].stable:
            return 0.0, float("nan")
        half = np.eye(len(self.names)) / 2.0
        omega = self.disks[0].frequencies(deltas)
        rough = balanced_bounds(self.sensitivity(deltas, omega) - half)

        def size(w: float) -> float:
            return bound(self.sensitivity(deltas, np.array([w]))[0] - half)

        starts = [float(omega[np.argmax(rough)]), *(peak.omega for peak in single)]
        start = max(starts, key=size)
        k = int(np.searchsorted(omega, start))
        low, high = float(omega[max(k - 1, 0)]), float(omega[min(k + 1, omega.size - 1)])
        best = minimize_scalar(
            lambda w: -size(float(w)),
            bounds=(low, high),
            method="bounded",
            options={"xatol": PLACED * high},
        )
        # mu is at least every element of the diagonal, which is the size of a single loop's
        found = [(-float(best.fun), float(best.x)), (size(start), start)]
        found += [(peak.gain, peak.omega) for peak in single]
        largest, at = max(found)
        return 1.0 / largest, at


def _with_totals(
    system: System, channels: int, inputs: list[str], outputs: list[str]
) -> tuple[System, list[str]]:
    """M with an output more per input, which reads it."""
    a, b, c, d = system
    count = len(inputs)
    reading = np.hstack([np.zeros((count, channels)), np.eye(count)])
    more = np.vstack([c, np.zeros((count, a.shape[0]))]), np.vstack([d, reading])
    return (a, b, *more), [*outputs, *(READ + name for name in inputs)]


def limits_of(omega: Array, values: Response, open_loop: Callable[[float], complex]) -> Limits:
    """Gain and phase margins from the open loop at a grid `(k,)` that resolves it, and at any
    frequency."""

    def crossings(of: Array) -> tuple[NDArray[np.intp], Response]:
        """Where a quantity changes its sign, and the open loop there, by interpolation."""
        at = np.flatnonzero(of[1:] * of[:-1] <= 0.0)
        share = of[at] / np.where(of[at] == of[at + 1], 1.0, of[at] - of[at + 1])
        return at, values[at] + share * (values[at + 1] - values[at])

    at, there = crossings(values.imag)
    factor = np.where(there.real < 0.0, -1.0 / np.minimum(there.real, -1e-300), np.nan)
    limits = [NOTHING_LIMITS.gain, NOTHING_LIMITS.less, NOTHING_LIMITS.phase]
    for which, found in enumerate((np.where(factor > 1.0, factor, np.nan), 1.0 / factor)):
        if np.any(found > 1.0):
            k = int(at[np.nanargmin(np.where(found > 1.0, found, np.nan))])
            w = crossing(lambda w: open_loop(w).imag, omega[k], omega[k + 1])
            limits[which] = -1.0 / open_loop(w).real, w
    at, there = crossings(np.abs(values) - 1.0)
    if at.size:
        k = int(at[np.argmin(np.abs(np.angle(-there)))])
        w = crossing(lambda w: abs(open_loop(w)) - 1.0, omega[k], omega[k + 1])
        limits[2] = float(np.degrees(abs(np.angle(-open_loop(w))))), w
    return Limits(*limits)


def least(cost: Callable[[Array], float], tried: Sequence[Array]) -> Array:
    """Deltas of the least cost over those tried, and a pattern search from the least: one delta
    after the other is moved by a step, which is halved."""
    deltas = min(tried, key=cost)
    best = cost(deltas)
    for step in PATTERN:
        for k in range(deltas.size):
            for sign in (-1.0, 1.0):
                moved = deltas.copy()
                moved[k] = np.clip(moved[k] + sign * step, -1.0, 1.0)
                if (there := cost(moved)) < best:
                    best, deltas = there, moved
    return deltas
