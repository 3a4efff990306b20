"""`beamchain stability`: the largest stable steps of a model."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.cli.common import Folder, Force, Json, Quiet, console
from beamchain.cli.output import print_table, print_warnings, spinner, tell

if TYPE_CHECKING:
    from beamchain.craft.stability import StabilityStudy


def stability(
    source: Annotated[
        Path,
        typer.Argument(metavar="SPEC.toml|MODEL.xml", help="A specification, or any MuJoCo model."),
    ],
    output: Folder,
    joint: Annotated[
        list[str] | None,
        typer.Option(
            "--joint", metavar="NAME", help="Slew this hinge only; may be repeated (default: all)."
        ),
    ] = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Find the largest stable steps, the steps for a given accuracy,
    numerical damping and large-motion limits; slew the hinges of a file that embed wrote.

    Writes report.html and stability.json into DIR.

    Example: beamchain stability boom.toml -o boom-stability
    """
    from beamchain.craft.stability import stability as measure
    from beamchain.files import check_free, to_json, write_files
    from beamchain.report.pages.stability import stability_report

    check_free(output / "stability.json", force=force)
    with spinner("reading", quiet or as_json, lines=True) as say:
        result = measure(source, say, joint or ())
        record = result.as_dict()
        files: dict[Path, str | bytes] = {output / "report.html": stability_report(result, source)}
        files[output / "stability.json"] = to_json(record)
        write_files(files, force=force)
    tell(lambda: record, lambda: _show(result), files, as_json, quiet)


def _show(result: "StabilityStudy") -> None:
    from beamchain.report.tables import stability as tables
    from beamchain.report.tables.steps import step_table

    console().print(result.own_step)
    print_table(tables.limit_table(result))
    for budget in result.budgets:
        print_table(step_table(budget, f"{budget.name}: largest time step"))
        print_table(tables.damping_table(budget))
    if result.large:
        print_table(tables.large_motion_table(result))
    if result.slews:
        print_table(tables.chain_table(result))
        print_table(tables.slew_table(result))
    print_warnings(result.warnings, "note")
