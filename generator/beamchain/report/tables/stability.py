"""The tables of `inspect --steps`: step limits, damping, large motion."""

import math
from typing import TYPE_CHECKING

from beamchain.report.formats import damping_ratio, number, relative, short, step_text
from beamchain.report.table import Column, Table

if TYPE_CHECKING:
    from beamchain.craft.slews import SlewBody, SlewRow
    from beamchain.craft.stability import StabilityStudy
    from beamchain.steps.budget import Budget

LIFTED = (
    "`beamchain retime` lifts what the appendages limit: they are then exact at longer steps, up "
    "to what the spacecraft's own springs and servos allow."
)


def limit_table(study: "StabilityStudy") -> Table:
    """The largest stable steps."""
    rows = study.rows
    columns = (
        Column("model", [row.name for row in rows]),
        Column("integrator", [row.integrator for row in rows]),
        Column("largest stable step", [row.largest for row in rows], "s", step_text),
    )
    return Table("Largest stable step", columns)


def damping_table(budget: "Budget") -> Table:
    """Damping ratios of the modes, the structure's own and as each integrator shows them."""
    columns = [
        Column("mode", list(budget.frequencies), "rad/s", number),
        Column("the structure's own", list(budget.ratios), format=damping_ratio),
    ]
    for integrator, shown in budget.shown.items():  # implicit is near implicitfast
        place = "page" if integrator == "implicit" else "everywhere"
        columns.append(Column(integrator, list(shown[:, 1]), format=damping_ratio, place=place))
    title = f"{budget.name}: damping ratio shown at a step of {short(budget.timestep)} s"
    return Table(title, tuple(columns))


def slew_table(study: "StabilityStudy") -> Table:
    """What the file's own step is off in slews of hinges, per body."""
    rows = [(slew, body) for slew in study.slews for body in slew.bodies]
    columns = (
        *_slew_columns(rows),
        Column("elastic part", [b.elastic_attitude for _, b in rows], "rad", tiny),
        Column("step off by", [b.step_attitude for _, b in rows], "rad", tiny),
        Column("of the elastic part", [b.step_share for _, b in rows], format=relative),
        Column("step off by", [b.step_place for _, b in rows], "m", tiny),
        Column("momentum lost", [s.momentum for s, _ in rows], format=tiny, missing="held"),
        Column("energy off by", [s.energy for s, _ in rows], format=tiny, place="page"),
        Column("RK4 off by", [s.error_rk4 for s, _ in rows], "rad", tiny),
        Column(
            "RK4's momentum lost",
            [s.momentum_rk4 for s, _ in rows],
            format=tiny,
            missing="held",
            place="page",
        ),
    )
    return Table(f"Slews of hinges: what {_own_step(study)} does", columns)


def chain_table(study: "StabilityStudy") -> Table:
    """What the chains are off in slews of hinges, per body."""
    rows = [(slew, body) for slew in study.slews for body in slew.bodies]
    columns = (
        *_slew_columns(rows),
        Column("elastic part", [b.elastic_attitude for _, b in rows], "rad", tiny),
        Column("elastic part", [b.elastic_place for _, b in rows], "m", tiny),
        Column("chains off by", [b.chain_attitude for _, b in rows], "rad", tiny),
        Column("chains off by", [b.chain_place for _, b in rows], "m", tiny),
        Column("of the elastic part", [b.chain_share for _, b in rows], format=relative),
    )
    return Table("Slews of hinges: what the chains hold", columns)


def _slew_columns(rows: "list[tuple[SlewRow, SlewBody]]") -> tuple[Column, ...]:
    """Which slew, and which body."""
    return (
        Column("hinge", [slew.joint for slew, _ in rows]),
        Column("by", [math.degrees(slew.angle) for slew, _ in rows], "deg", short),
        Column("in", [slew.duration for slew, _ in rows], "s", short),
        Column("body", [body.name for _, body in rows]),
    )


def _own_step(study: "StabilityStudy") -> str:
    own = study.slews[0] if study.slews else None
    return "" if own is None else f"{own.integrator} at {short(own.timestep)} s"


def tiny(value: float) -> str:
    """Two digits, with a power of ten below 0.001."""
    return f"{value:.1e}" if 0.0 < abs(value) < 1e-3 else f"{value:.2g}"


def _limit_text(value: float) -> str:
    return short(value) if math.isfinite(value) else "beyond"


def large_motion_table(study: "StabilityStudy") -> Table:
    """How far the chain may be driven in each plane."""
    limits = study.large.values()
    accelerations = [limit.acceleration for limit in limits]
    columns = (
        Column("plane", list(study.large)),
        Column("spin", [limit.spin for limit in limits], "rad/s", _limit_text),
        Column("acceleration across", accelerations, "m/s^2", _limit_text),
        Column("acceleration along", [limit.axial for limit in limits], "m/s^2", _limit_text),
        Column("slew", [limit.slew for limit in limits], "rad/s^2", _limit_text),
    )
    notes = (
        "Spin, acceleration across and slew: up to here the chain stays within 1 % of 60 links. "
        "Acceleration along, outwards, such as a thrust's: up to here it lowers the first "
        "frequency, the root held, by less than 1 %; at 50 times as much, or before, it buckles.",
    )
    return Table("Large motion, within 1 % up to", columns, notes=notes)
