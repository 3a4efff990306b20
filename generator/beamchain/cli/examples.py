"""`beamchain examples`: the specs that come with the package."""

from pathlib import Path
from typing import Annotated

import typer

from beamchain.cli.common import Force, Json, Quiet, console, print_json
from beamchain.errors import InputError


def _names(incomplete: str) -> list[tuple[str, str]]:
    from beamchain.cli.shipped import examples as shipped

    return [(one.name, one.about) for one in shipped() if one.name.startswith(incomplete)]


def examples(
    run: Annotated[
        str | None,
        typer.Option("--run", metavar="NAME", help="Fit this example.", autocompletion=_names, show_default=False),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="DIR", help="Folder for the results.", show_default="NAME")
    ] = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """List the shipped examples, or fit one of them.

    Example: beamchain examples

    Example: beamchain examples --run seed_boom -o boom
    """
    from beamchain.cli.fit import fit
    from beamchain.cli.shipped import examples as shipped
    from beamchain.cli.shipped import pick

    if run is not None:
        one = pick(shipped(), run, "examples: the name")
        fit(one.path, output or Path(one.name), as_json=as_json, force=force, quiet=quiet)
        return
    if output is not None:
        raise InputError("examples: --output is given but no example to run; add --run NAME.")
    if as_json:
        print_json({"examples": [{"name": one.name, "about": one.about, "file": str(one.path)} for one in shipped()]})
    elif not quiet:
        from rich.table import Table

        table = Table(title="shipped examples", title_justify="left")
        for column in ("name", "what it is", "file"):
            table.add_column(column, overflow="fold")
        for one in shipped():
            table.add_row(one.name, one.about, str(one.path))
        console().print(table)
        console().print("run one: beamchain examples --run NAME -o DIR")
