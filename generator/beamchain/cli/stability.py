"""`beamchain stability`: the largest stable steps of a model, predicted and measured."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from beamchain.cli.common import Folder, Force, Json, Quiet, console, print_json, print_written
from beamchain.cli.progress import spinner

if TYPE_CHECKING:
    from beamchain.steps.budget import Budget
    from beamchain.studies.stability import StabilityStudy

NOISE = 1e-9  # damping ratio below which nothing is shown


def stability(
    source: Annotated[
        Path,
        typer.Argument(metavar="SPEC.toml|MODEL.xml", help="A specification, or any MuJoCo model.", show_default=False),
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
    from beamchain.report.stability_html import stability_report
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
    if as_json:
        print_json(record)
    elif not quiet:
        _show(result)
        print_written(files)
    if any(abs(r.difference) > 0.01 for r in result.rows):
        raise typer.Exit(3)


def _show(result: "StabilityStudy") -> None:
    from rich.markup import escape
    from rich.table import Table

    out = console()
    limits = Table(title="largest stable step, predicted and measured", title_justify="left")
    for column in ("model", "integrator", "predicted s", "measured s", "difference"):
        limits.add_column(column, justify="left" if column in ("model", "integrator") else "right")
    for row in result.rows:
        if row.predicted == row.measured:
            limits.add_row(row.name, row.integrator, "no limit", "no limit", "-")
        else:
            limits.add_row(
                row.name, row.integrator, f"{row.predicted:.5g}", f"{row.measured:.5g}", f"{row.difference:+.1e}"
            )
    out.print(limits)
    for budget in result.budgets:
        out.print(_budget_table(budget))
    for limit in result.large.values():
        spin, acceleration, slew = (
            "no limit found" if v == float("inf") else f"{v:.4g} {unit}"
            for v, unit in ((limit.spin, "rad/s"), (limit.acceleration, "m/s^2"), (limit.slew, "rad/s^2"))
        )
        out.print(
            f"large motion in {limit.port}, within 1 % of 60 links up to: spin {spin}, "
            f"acceleration {acceleration}, slew {slew}"
        )
    for warning in result.warnings:
        out.print(f"[yellow]note[/yellow]: {escape(warning)}")


def _budget_table(budget: "Budget") -> Any:
    from rich.table import Table

    table = Table(title=f"{budget.name}: damping ratio shown at {budget.timestep:g} s", title_justify="left")
    for column in ("rad/s", "structure", *budget.shown):
        table.add_column(column, justify="right")
    for i, (w, z) in enumerate(zip(budget.frequencies, budget.ratios, strict=True)):
        shown = [
            "unstable" if v[i, 0] != v[i, 0] else f"{v[i, 1] if abs(v[i, 1]) > NOISE else 0.0:.4g}"
            for v in budget.shown.values()
        ]
        table.add_row(f"{w:.6g}", f"{z:.4g}", *shown)
    steps = [f"{name} {one:.4g} / {tenth:.4g}" for name, (one, tenth) in budget.accuracy.items()]
    table.caption = f"steps for 1 % / 0.1 % of the first frequency, in seconds: {', '.join(steps)}"
    return table
