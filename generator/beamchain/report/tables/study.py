"""The table of a study: what it takes to reach an error."""

from operator import itemgetter
from typing import TYPE_CHECKING

from beamchain.report.formats import STUDY_TITLE, short
from beamchain.report.table import Rows, Table
from beamchain.studies.pareto import TARGETS, Reach, power

if TYPE_CHECKING:
    from beamchain.studies.study import Study

as_written = "{}".format  #: numbers that words may stand for


def _setting(reach: Reach, best: float) -> tuple[str, ...]:
    """What a row says of a setting; `best`: our time [s]."""
    point = reach.point
    ratio = reach.seconds / best
    slower = "" if ratio == 1.0 else f" ({short(ratio)} x)"
    return (
        point.model,
        str(point.n),
        point.integrator,
        f"{point.timestep:.4g}",
        f"{1e3 * reach.seconds:.4g}{slower}",
        f"{point.over_rigid_hub:.2f}",
    )


def reach_table(study: "Study") -> Table:
    """What it takes to reach each target: our best setting, then those of the rivals."""
    rows: list[tuple[str, ...]] = []
    for target in TARGETS:
        best = study.best(target, "error")
        rivals = sorted(study.rivals(target, "error").values(), key=lambda rival: rival.seconds)
        if best is None:
            rows.append((power(target), "none of ours within the budget", *[""] * 5))
            rows += [("", *_setting(rival, rival.seconds)) for rival in rivals]
            continue
        rows.append((power(target), *_setting(best, best.seconds)))
        rows += [("", *_setting(rival, best.seconds)) for rival in rivals]
        for model, floor in study.short_of(target, "error").items():
            rows.append(("", model, *["any"] * 3, f"not reached: {floor:.2g} at best", "-"))
    column = Rows(rows).column
    columns = (
        column("to reach", itemgetter(0)),
        column("model", itemgetter(1)),
        column("n", itemgetter(2), format=as_written),
        column("integrator", itemgetter(3)),
        column("step", itemgetter(4), "s", as_written),
        column("time", itemgetter(5), "ms", as_written),
        column("per step over the rigid hub", itemgetter(6), format=as_written),
    )
    return Table(STUDY_TITLE, columns)
