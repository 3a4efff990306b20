"""The tables of a study: what it takes to reach an error, and every setting measured."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from beamchain.report.formats import STUDY_TITLES, digits, relative, short
from beamchain.report.table import Column, Table
from beamchain.studies.pareto import TARGETS, Metric, Reach, power

if TYPE_CHECKING:
    from beamchain.studies.study import Study

as_written = "{}".format  #: numbers that words may stand for


@dataclass(frozen=True)
class Setting:
    """A row: how a model reaches a target, or that it does not."""

    target: str
    model: str
    n: int | str = ""
    integrator: str = ""
    step: str = ""
    time: str = ""
    over_rigid_hub: str = ""


def _setting(reach: Reach, target: str, best: float) -> Setting:
    """A setting as a row; `best`: our time [s]."""
    point = reach.point
    ratio = reach.seconds / best
    slower = "" if ratio == 1.0 else f" ({short(ratio)} x)"
    milliseconds = 1e3 * reach.seconds
    return Setting(
        target,
        point.model,
        point.n,
        point.integrator,
        step=f"{point.timestep:.4g}",
        time=f"{milliseconds:.4g}{slower}",
        over_rigid_hub=f"{point.over_rigid_hub:.2f}",
    )


def _settings(study: "Study", metric: Metric) -> list[Setting]:
    """For each target our best, then the rivals."""
    settings: list[Setting] = []
    for target in TARGETS:
        best = study.best(target, metric)
        rivals = sorted(study.rivals(target, metric).values(), key=lambda r: r.seconds)
        if best is None:
            settings.append(Setting(power(target), "none of ours within the budget"))
            settings += [_setting(r, "", r.seconds) for r in rivals]
            continue
        settings.append(_setting(best, power(target), best.seconds))
        settings += [_setting(rival, "", best.seconds) for rival in rivals]
        for model, floor in study.short_of(target, metric).items():
            missed = f"not reached: {floor:.2g} at best"
            settings.append(Setting("", model, "any", "any", "any", missed, "-"))
    return settings


def reach_table(study: "Study", metric: Metric) -> Table:
    """What it takes to reach each target."""
    settings = _settings(study, metric)
    over_rigid_hub = [setting.over_rigid_hub for setting in settings]
    columns = (
        Column("to reach", [setting.target for setting in settings]),
        Column("model", [setting.model for setting in settings]),
        Column("n", [setting.n for setting in settings], format=as_written),
        Column("integrator", [setting.integrator for setting in settings]),
        Column("step", [setting.step for setting in settings], "s", as_written),
        Column("time", [setting.time for setting in settings], "ms", as_written),
        Column("per step over the rigid hub", over_rigid_hub, format=as_written),
    )
    return Table(STUDY_TITLES[metric], columns)


def point_table(study: "Study") -> Table:
    """All settings measured."""
    points = study.points
    milliseconds = [1e3 * point.seconds for point in points]
    microseconds = [1e6 * point.seconds_per_step for point in points]
    columns = (
        Column("model", [point.model for point in points]),
        Column("n", [point.n for point in points], format=as_written),
        Column("integrator", [point.integrator for point in points]),
        Column("step", [point.timestep for point in points], "s", digits(4)),
        Column("error", [point.error for point in points], format="{:.2e}".format),
        Column("time", milliseconds, "ms", digits(4)),
        Column("time per step", microseconds, "µs", digits(3)),
        Column("spread", [point.spread for point in points], format=relative),
    )
    return Table("Every point", columns)
