"""`beamchain identify`: modes of an appendage from logs of a test or a flight."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.commands import (
    Force,
    print_all,
    print_files,
    print_warnings,
    spinner,
)
from beamchain.errors import InputError

if TYPE_CHECKING:
    from beamchain.identification.result import Identification


def identify(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Logs: .csv, .npz.")],
    craft: Annotated[
        Path, typer.Option("--craft", metavar="CRAFT.xml", help="The bare spacecraft.")
    ],
    mount: Annotated[
        str,
        typer.Option(
            "--mount", metavar="NAME", help="Its site or body that carries the appendage."
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="MODES.toml", help="File for the modes.")
    ],
    prior: Annotated[
        Path | None,
        typer.Option(
            "--prior",
            metavar="SPEC.toml",
            help="What is believed of the appendage; \\[uncertain] gives its widths.",
        ),
    ] = None,
    modes: Annotated[
        int | None, typer.Option(min=1, help="Number of modes; default: as the criterion says.")
    ] = None,
    names: Annotated[
        list[str] | None,
        typer.Option(
            "--map", metavar="COLUMN=NAME", help="What a column of the log is. Repeatable."
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Identify an appendage's modes from logs of the spacecraft's motion, with their covariance.

    Writes MODES.toml, which \\[imported] of a specification reads,
    its report MODES_report.html and record MODES.json. Exit status 3: the files were written, but
    \\[imported] refuses the modes.

    Example: beamchain identify log.csv --craft craft.xml --mount mount --prior
    array.toml -o modes.toml
    """
    from beamchain.files import beside, check_outputs
    from beamchain.identification.request import identify as find

    renamed = _column_names(names)
    if output.suffix.lower() != ".toml":
        raise InputError(f"-o {str(output)!r} must end in .toml, for [imported] to read it.")
    outputs = [output, beside(output, "_report.html"), beside(output, ".json")]
    inputs = [*logs, craft, *([] if prior is None else [prior])]
    check_outputs(outputs, force=force, inputs=inputs)
    with spinner("identifying"):
        found = find(
            list(logs),
            craft,
            mount,
            prior=prior,
            modes=modes,
            map=renamed,
        )
        files = found.write(output, force=force)
    _show(found)
    print_files(files)
    if found.refused:
        raise typer.Exit(3)


def _column_names(names: list[str] | None) -> dict[str, str]:
    renamed = dict[str, str]()
    for text in names or ():
        column, equal, name = text.rpartition("=")
        if not equal or not column or not name:
            raise InputError(f"--map {text!r} is not COLUMN=NAME; for example --map gyro3=rate_z.")
        renamed[column] = name
    return renamed


def _show(found: "Identification") -> None:
    from beamchain.identification.tables import mode_table

    undetermined = (f"not determined: {sentence}" for sentence in found.undetermined)
    print_all(mode_table(found), found.timing, *undetermined)
    print_warnings(found.warnings)
