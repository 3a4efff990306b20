"""The tables of a pointing budget: source by source, and the modes that errors come from."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from beamchain.report import Column, Table, digits
from beamchain.toolkit import Array

if TYPE_CHECKING:
    from beamchain.pointing.error_indices import ErrorIndex
    from beamchain.pointing.pointing import Pointing

SHOWN = 0.01  # least share of a mode that is shown
ROUNDING = 1e-9  # of a source's largest error in a unit: smaller ones come from no mode
LARGEST = 5  # modes per source and output
TOTAL = "all"


def pointing_table(pointing: "Pointing") -> Table:
    """What each source does to each output, and all together."""
    rows = [
        *(
            (source.name, source.ape, source.rpe, source.speed, source.shares)
            for source in pointing.sources
        ),
        (TOTAL, pointing.ape, pointing.rpe, None, None),
    ]
    outputs = range(len(pointing.outputs))
    cells = [(row, output) for row in rows for output in outputs]
    leading = [
        next(iter(row[4][n].items()), None)
        if row[4] is not None and _shows(pointing, row[1].peak, n)
        else None
        for row, n in cells
    ]
    columns = (
        Column("source", [row[0] for row, _ in cells], key="source"),
        Column("output", [pointing.outputs[n] for _, n in cells], key="output"),
        Column("unit", [pointing.units[n] for _, n in cells], key="unit"),
        *_index_columns("APE", [(row[1], n) for row, n in cells]),
        *_index_columns("RPE", [(row[2], n) for row, n in cells]),
        Column(
            "at speed",
            [None if row[3] is None else float(row[3][n]) for row, n in cells],
            "rad/s",
            digits(5),
            key="speed",
        ),
        Column("largest share", [_share(leader) for leader in leading]),
    )
    notes = (
        f"APE: the error itself; RPE: its deviation from the mean over {pointing.window:g} s.",
        "Peaks: reached by what is periodic or transient, 3 sigma (99.7 %) of what is random.",
        "All: root of the sum of squares; peaks added, 3 sigma of all random sources on top.",
    )
    return Table("Pointing budget", columns, notes)


def _index_columns(name: str, cells: "Sequence[tuple[ErrorIndex, int]]") -> tuple[Column, Column]:
    """Root mean square and peak of an index, of an output each."""
    text = digits(4)
    key = name.lower()
    rms = [_number(index.rms[n]) for index, n in cells]
    peak = [float(index.peak[n]) for index, n in cells]
    return (
        Column(f"{name} rms", rms, format=text, missing="-", key=f"{key}_rms"),
        Column(f"{name} peak", peak, format=text, key=f"{key}_peak"),
    )


def pointing_mode_table(pointing: "Pointing") -> Table:
    """The modes that an error comes from, largest first."""
    rows = [
        (source.name, name, mode, share)
        for source in pointing.sources
        for n, (name, shares) in enumerate(zip(pointing.outputs, source.shares, strict=True))
        if _shows(pointing, source.ape.peak, n)
        for mode, share in list(shares.items())[:LARGEST]
        if abs(share) >= SHOWN
    ]
    columns = (
        Column("source", [row[0] for row in rows], key="source"),
        Column("output", [row[1] for row in rows], key="output"),
        Column("mode", [row[2] for row in rows], key="mode"),
        Column("share", [row[3] for row in rows], format=_percent, key="share"),
    )
    return Table("Modes that the errors come from", columns)


def _shows(pointing: "Pointing", peaks: Array, output: int) -> bool:
    """Whether a source's error of an output is more than rounding."""
    alike = [n for n, unit in enumerate(pointing.units) if unit == pointing.units[output]]
    return bool(peaks[output] > ROUNDING * peaks[alike].max())


def _number(value: float) -> float | None:
    """A number; None where there is none."""
    return None if math.isnan(value) else float(value)


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"


def _share(leader: tuple[str, float] | None) -> str:
    return "" if leader is None else f"{leader[0]} {_percent(leader[1])}"
