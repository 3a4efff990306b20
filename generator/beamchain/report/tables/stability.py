"""The tables of `stability`: step limits predicted and measured, damping, large motion."""

import math
from typing import TYPE_CHECKING

from beamchain.report.formats import damping_ratio, number, relative, short, step_text
from beamchain.report.table import Column, Table

if TYPE_CHECKING:
    from beamchain.steps.budget import Budget
    from beamchain.studies.stability import StabilityStudy


def limit_table(study: "StabilityStudy") -> Table:
    """The largest stable steps, predicted and measured."""
    rows = study.rows
    differences = [row.difference if math.isfinite(row.predicted) else None for row in rows]
    columns = (
        Column("model", [row.name for row in rows]),
        Column("integrator", [row.integrator for row in rows]),
        Column("predicted", [row.predicted for row in rows], "s", step_text),
        Column("measured", [row.measured for row in rows], "s", step_text),
        Column("difference", differences, format=relative, missing="-"),
    )
    return Table("Largest stable step, predicted and measured", columns)


def damping_table(budget: "Budget") -> Table:
    """Damping ratios of the modes, the structure's own and as each integrator shows them."""
    columns = [
        Column("mode", list(budget.frequencies), "rad/s", number),
        Column("the structure's own", list(budget.ratios), format=damping_ratio),
    ]
    for integrator, shown in budget.shown.items():
        columns.append(Column(integrator, list(shown[:, 1]), format=damping_ratio))
    title = f"{budget.name}: damping ratio shown at a step of {short(budget.timestep)} s"
    return Table(title, tuple(columns))


def _limit_text(value: float) -> str:
    return short(value) if math.isfinite(value) else "beyond"


def large_motion_table(study: "StabilityStudy") -> Table:
    """How far the chain may be driven in each plane."""
    limits = study.large.values()
    accelerations = [limit.acceleration for limit in limits]
    columns = (
        Column("plane", list(study.large)),
        Column("spin", [limit.spin for limit in limits], "rad/s", _limit_text),
        Column("root acceleration", accelerations, "m/s^2", _limit_text),
        Column("slew", [limit.slew for limit in limits], "rad/s^2", _limit_text),
    )
    return Table("Large motion, within 1 % of 60 links up to", columns)
