"""The table of a recovery: extremes of what happened inside an appendage."""

from typing import TYPE_CHECKING, Any

from beamchain.report.formats import digits, number, short
from beamchain.report.table import Column, Table

if TYPE_CHECKING:
    from beamchain.craft.histories import Extreme, Recovery

NOTHING = 1e-9  # of the largest value with the same unit: a component below it is rounding


def recovery_table(recovery: "Recovery") -> Table:
    """Each component where it is largest along the appendage; what is nowhere is left out."""
    rows = worst_stations(recovery)
    places = [row.x for row in rows]
    columns = (
        Column("quantity", [row.quantity for row in rows], key="quantity"),
        Column("unit", [row.unit for row in rows], key="unit"),
        Column("at x", places, "m", short, key="x"),
        Column("smallest", [row.smallest for row in rows], format=digits(5), key="smallest"),
        Column("at", [row.smallest_at for row in rows], "s", number, key="smallest_at"),
        Column("from", [row.smallest_from for row in rows], key="smallest_from"),
        Column("largest", [row.largest for row in rows], format=digits(5), key="largest"),
        Column("at", [row.largest_at for row in rows], "s", number, key="largest_at"),
        Column("from", [row.largest_from for row in rows], key="largest_from"),
    )
    note = (
        "with the static part of the modes left out"
        if recovery.static
        else "the kept modes alone; the root's load and accelerations are those of the spacecraft"
    )
    notes = (note,)
    if recovery.in_file:
        numbers = ", ".join(
            f"{k} ({name})" for name, k in zip(recovery.modes, recovery.in_file, strict=True)
        )
        notes = (note, f"modes of the file: {numbers}")
    return Table(f"Extremes inside the appendage at {recovery.place}", columns, notes)


def worst_stations(recovery: "Recovery") -> "list[Extreme]":
    """Per component the station where it is largest, in the order of the components."""
    every = recovery.extremes
    largest: dict[str, float] = {}
    worst: dict[str, Extreme] = {}
    for row in every:
        largest[row.unit] = max(largest.get(row.unit, 0.0), _size(row))
        known = worst.get(row.quantity)
        if known is None or _size(row) > _size(known):
            worst[row.quantity] = row
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
