"""`beamchain stability`: the largest stable steps of a model, predicted and measured."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.cli.common import Folder, Force, Json, Quiet, console
from beamchain.cli.output import print_table, print_warnings, spinner, tell

if TYPE_CHECKING:
    from beamchain.steps.budget import Budget
    from beamchain.studies.stability import StabilityStudy

NOISE = 1e-9  # damping ratio below which nothing is shown


def stability(
    source: Annotated[
        Path,
        typer.Argument(metavar="SPEC.toml|MODEL.xml", help="A specification, or any MuJoCo model."),
    ],
    output: Folder,
    extremes_map: Annotated[bool, typer.Option("--map", hidden=True)] = False,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Find the largest stable steps, the steps for a given accuracy, numerical damping and large-motion limits.

    Writes report.html and stability.json into DIR.

    Example: beamchain stability boom.toml -o boom-stability
    """
    from beamchain.errors import InputError
    from beamchain.files import check_free, to_json, write_files
    from beamchain.report.study_html import stability_report
    from beamchain.studies.stability import stability as measure

    if extremes_map:
        raise InputError(
            "--map was the extremes suite, a test of beamchain itself; run `make extremes` in its checkout."
        )
    check_free(output / "stability.json", force=force)
    with spinner("reading", quiet or as_json) as say:
        result = measure(source, say)
        record = result.as_dict()
        files: dict[Path, str | bytes] = {output / "report.html": stability_report(result, source)}
        files[output / "stability.json"] = to_json(record)
        write_files(files, force=force)
    tell(lambda: record, lambda: _show(result), files, as_json, quiet)
    if any(abs(r.difference) > 0.01 for r in result.rows):
        raise typer.Exit(3)


def _show(result: "StabilityStudy") -> None:
    console().print(result.own_step, markup=False)
    limits = [
        (row.name, row.integrator, "no limit", "no limit", "-")
        if row.predicted == row.measured
        else (row.name, row.integrator, f"{row.predicted:.5g}", f"{row.measured:.5g}", f"{row.difference:+.1e}")
        for row in result.rows
    ]
    head = ("model", "integrator", "predicted s", "measured s", "difference")
    print_table("largest stable step, predicted and measured", head, limits, left=(0, 1))
    for budget in result.budgets:
        _show_budget(budget)
    for limit in result.large.values():
        spin, acceleration, slew = (
            "no limit found" if v == float("inf") else f"{v:.4g} {unit}"
            for v, unit in ((limit.spin, "rad/s"), (limit.acceleration, "m/s^2"), (limit.slew, "rad/s^2"))
        )
        console().print(
            f"large motion in {limit.port}, within 1 % of 60 links up to: spin {spin}, "
            f"acceleration {acceleration}, slew {slew}"
        )
    print_warnings(result.warnings, "note")


def _show_budget(budget: "Budget") -> None:
    rows: list[list[str]] = []
    for i, (w, z) in enumerate(zip(budget.frequencies, budget.ratios, strict=True)):
        shown = [(v[i, 0] == v[i, 0], float(v[i, 1])) for v in budget.shown.values()]
        ratios = [f"{v if abs(v) > NOISE else 0.0:.4g}" if stable else "unstable" for stable, v in shown]
        rows.append([f"{w:.6g}", f"{z:.4g}", *ratios])
    steps = [f"{name} {one:.4g} / {tenth:.4g}" for name, (one, tenth) in budget.accuracy.items()]
    caption = f"steps for 1 % / 0.1 % of the first frequency, in seconds: {', '.join(steps)}"
    if any("unstable" in row for row in rows):
        caption += f"; unstable: the integrator's largest step is below {budget.timestep:g} s"
    title = f"{budget.name}: damping ratio shown at {budget.timestep:g} s"
    print_table(title, ("rad/s", "structure", *budget.shown), rows, left=(), caption=caption)
