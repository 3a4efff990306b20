"""The least margins of a controller over the values of a plant's uncertain quantities: results.

All figures that are stated are those of `bc.margins` at the values that are stated.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from beamchain import report, robust
from beamchain.checks import unknown
from beamchain.results import Margins
from beamchain.robust.bounds import GainBound
from beamchain.toolkit import Extremum

DISK, GAIN, LESS, PHASE = "disk", "gain up, factor", "gain down, factor", "phase"
ALL = "all loops at once"


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
