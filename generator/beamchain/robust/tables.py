"""The tables of worst cases and least margins."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from beamchain.report import Column, Table, margin_text, number, pose_columns, titled

if TYPE_CHECKING:
    from beamchain.robust.least_margins import WorstMargins
    from beamchain.robust.worst_gains import WorstCase


def _at_text(frequency: float) -> str:
    """Where a margin is; an open loop's limit may be at infinite frequency."""
    return "infinite" if math.isinf(frequency) else margin_text(frequency)


def _gain_text(value: float) -> str:
    return f"{value:.5g}" if math.isfinite(value) else "none"


def _sample_text(gain: float) -> str:
    return "unstable" if math.isinf(gain) else _gain_text(gain)


def worst_table(cases: "Sequence[WorstCase]") -> Table:
    """The worst sample of the gain from a disturbance to an output, pose by pose."""
    names = [f"{case.input} → {case.output}" for case in cases]
    if len(cases) > 1:
        names = [f"{case.pose}: {name}" for case, name in zip(cases, names, strict=True)]
    predicted = [case.gain if case.stable else math.inf for case in cases]
    drawn = [float(max(case.drawn, default=math.nan)) for case in cases]
    columns = [
        Column("disturbance → output", names),
        Column("worst sample, predicted", predicted, format=_sample_text),
        Column("worst sample, MuJoCo", [case.simulated for case in cases], format=_gain_text),
        Column("at", [case.frequency for case in cases], "rad/s", _gain_text),
        Column("worst of the draws", drawn, format=_gain_text),
        Column("unit", [case.unit for case in cases]),
    ]
    if any(case.bound for case in cases):
        bounds = [case.bound.gain if case.bound else math.inf for case in cases]
        columns.insert(-1, Column("no value exceeds", bounds, format=_gain_text))
    return Table("Worst case", tuple(columns))


def worst_value_table(case: "WorstCase") -> Table:
    """The worst values beside the nominal ones, and where they lie in their ranges."""
    names = list(case.values)
    percent = [case.percent[name] for name in names]
    columns = (
        Column("quantity", names, key="quantity"),
        Column("nominal", [case.nominal_values[n] for n in names], format=number, key="nominal"),
        Column("worst", [case.values[name] for name in names], format=number, key="worst"),
        Column("unit", [case.value_units[name] for name in names], key="unit"),
        Column("of its range", percent, "%", format=_percent, key="percent"),
    )
    where = f" at {case.pose}" if case.pose else ""
    return Table(f"Values of the worst sample{where}", columns)


def _percent(value: float) -> str:
    return f"{value:+.0f}" if abs(value) >= 0.5 else "0"


def worst_margin_table(several: "Sequence[WorstMargins]") -> Table:
    """The least margins over all samples beside the nominal ones, pose by pose."""
    poses = [margins.pose for margins in several for _ in margins]
    rows = [row for margins in several for row in margins]
    columns = (
        *pose_columns(poses),
        Column("broken", [row.at for row in rows], key="at"),
        Column("margin", [row.kind for row in rows], key="kind"),
        Column("nominal", [row.nominal for row in rows], format=margin_text, key="nominal"),
        Column("worst", [row.worst for row in rows], format=margin_text, key="worst"),
        Column("unit", [row.unit for row in rows], key="unit"),
        Column("at", [row.frequency for row in rows], "rad/s", _at_text, key="frequency"),
        Column("proved", [row.proved for row in rows], format=margin_text, key="proved"),
    )
    shown = columns if any(row.proved for row in rows) else columns[:-1]
    return Table(titled("Least margins over all samples", poses), shown)
