"""The table of a recovery: extremes of what happened inside an appendage."""

from typing import TYPE_CHECKING, Any

from beamchain.report.formats import digits, number, short
from beamchain.report.table import Rows, Table

if TYPE_CHECKING:
    from beamchain.craft.histories import Extreme, Recovery

NOTHING = 1e-9  # of the largest value with the same unit: a component below it is rounding


def recovery_table(recovery: "Recovery") -> Table:
    """Each component where it is largest along the appendage; what is nowhere is left out."""
    column = Rows(worst_stations(recovery)).column
    columns = (
        column("quantity", "quantity", key="quantity"),
        column("unit", "unit", key="unit"),
        column("at x", "x", "m", short, key="x"),
        column("smallest", "smallest", format=digits(5), key="smallest"),
        column("at", "smallest_at", "s", number, key="smallest_at"),
        column("from", "smallest_from", key="smallest_from"),
        column("largest", "largest", format=digits(5), key="largest"),
        column("at", "largest_at", "s", number, key="largest_at"),
        column("from", "largest_from", key="largest_from"),
    )
    notes = [
        "with the static part of the modes left out"
        if recovery.static
        else "the kept modes alone; the root's load and accelerations are those of the spacecraft"
    ]
    if recovery.in_file:
        named = zip(recovery.modes, recovery.in_file, strict=True)
        notes.append(f"modes of the file: {', '.join(f'{k} ({name})' for name, k in named)}")
    return Table(f"Extremes inside the appendage at {recovery.place}", columns, tuple(notes))


def worst_stations(recovery: "Recovery") -> "list[Extreme]":
    """Per component the station where it is largest, in the order of the components."""
    largest: dict[str, float] = {}
    worst: dict[str, Extreme] = {}
    for row in recovery.extremes:
        largest[row.unit] = max(largest.get(row.unit, 0.0), _size(row))
        worst[row.quantity] = max(worst.get(row.quantity, row), row, key=_size)
    return [row for row in worst.values() if _size(row) > NOTHING * largest[row.unit]]


def _size(row: "Extreme") -> float:
    return max(abs(row.smallest), abs(row.largest))


def recovery_record(recovery: "Recovery") -> dict[str, Any]:
    """Place, stations, modes and all extremes."""
    return {
        "place": recovery.place,
        "instants": int(recovery.time.size),
        "time": [float(recovery.time[0]), float(recovery.time[-1])],
        "x": recovery.x.tolist(),
        "modes": list(recovery.modes),
        **({"modes_of_the_file": list(recovery.in_file)} if recovery.in_file else {}),
        "static": recovery.static,
        "extremes": [row._asdict() for row in recovery.extremes],
    }
