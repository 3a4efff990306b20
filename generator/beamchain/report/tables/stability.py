"""The tables of `inspect --steps`: step limits, damping, large motion."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from beamchain.report.formats import damping_ratio, number, relative, short
from beamchain.report.table import Column, Rows, Table

if TYPE_CHECKING:
    from beamchain.craft.stability import StabilityStudy
    from beamchain.steps.budget import Budget

Makes = Callable[..., Column]  # as `Rows.column`
LIFTED = (
    "`beamchain retime` lifts what the appendages limit: they are then exact at longer steps, up "
    "to what the spacecraft's own springs and servos allow."
)


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
    """What the file's own step is off in slews of hinges, of which there are some, per body."""
    slew, body, which = _per_body(study)
    columns = (
        *which,
        body("elastic part", "elastic_attitude", "rad", tiny),
        body("step off by", "step_attitude", "rad", tiny),
        body("of the elastic part", "step_share", format=relative),
        body("step off by", "step_place", "m", tiny),
        slew("momentum lost", "momentum", format=tiny, missing="held"),
        slew("energy off by", "energy", format=tiny, place="page"),
        slew("RK4 off by", "error_rk4", "rad", tiny),
        slew("RK4's momentum lost", "momentum_rk4", format=tiny, missing="held", place="page"),
    )
    own = study.slews[0]
    step = f"{own.integrator} at {short(own.timestep)} s"
    return Table(f"Slews of hinges: what {step} does", columns)


def chain_table(study: "StabilityStudy") -> Table:
    """What the chains are off in slews of hinges, per body."""
    _, body, which = _per_body(study)
    columns = (
        *which,
        body("elastic part", "elastic_attitude", "rad", tiny),
        body("elastic part", "elastic_place", "m", tiny),
        body("chains off by", "chain_attitude", "rad", tiny),
        body("chains off by", "chain_place", "m", tiny),
        body("of the elastic part", "chain_share", format=relative),
    )
    return Table("Slews of hinges: what the chains hold", columns)


def _per_body(study: "StabilityStudy") -> "tuple[Makes, Makes, tuple[Column, ...]]":
    """What makes columns of slews and of their bodies, a row per body; and those that say which."""
    rows = [(slew, body) for slew in study.slews for body in slew.bodies]
    slew, body = Rows(slew for slew, _ in rows).column, Rows(body for _, body in rows).column
    which = (
        slew("hinge", "joint"),
        slew("by", lambda row: math.degrees(row.angle), "deg", short),
        slew("in", "duration", "s", short),
        body("body", "name"),
    )
    return slew, body, which


def tiny(value: float) -> str:
    """Two digits, with a power of ten below 0.001."""
    return f"{value:.1e}" if 0.0 < abs(value) < 1e-3 else f"{value:.2g}"


def _limit_text(value: float) -> str:
    return short(value) if math.isfinite(value) else "beyond"


def large_motion_table(study: "StabilityStudy") -> Table:
    """How far the chain may be driven in each plane."""
    column = Rows(study.large.values()).column
    columns = (
        Column("plane", list(study.large)),
        column("spin", "spin", "rad/s", _limit_text),
        column("acceleration across", "acceleration", "m/s^2", _limit_text),
        column("acceleration along", "axial", "m/s^2", _limit_text),
        column("slew", "slew", "rad/s^2", _limit_text),
    )
    notes = (
        "Spin, acceleration across and slew: up to here the chain stays within 1 % of 60 links. "
        "Acceleration along, outwards, such as a thrust's: up to here it lowers the first "
        "frequency, the root held, by less than 1 %; at 50 times as much, or before, it buckles.",
    )
    return Table("Large motion, within 1 % up to", columns, notes=notes)
