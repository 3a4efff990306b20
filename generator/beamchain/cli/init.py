"""`beamchain init`: a commented spec to start from."""

from pathlib import Path
from typing import Annotated

import typer

from beamchain.cli.common import Force, Json, Quiet, console, print_json


def _kinds(incomplete: str) -> list[tuple[str, str]]:
    from beamchain.shipped import starts

    return [(one.name, one.about) for one in starts() if one.name.startswith(incomplete)]


def init(
    kind: Annotated[
        str,
        typer.Argument(metavar="boom|array|mast", help="What it is like.", autocompletion=_kinds, show_default=False),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="SPEC.toml", help="File to write.", show_default="KIND.toml"),
    ] = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a commented SPEC.toml to start from.

    Never replaces a file without --force.

    Example: beamchain init boom

    Example: beamchain init array -o my_array.toml
    """
    from beamchain.files import write_files
    from beamchain.shipped import pick, starts

    start = pick(starts(), kind, "init: the kind")
    place = output or Path(f"{kind}.toml")
    write_files({place: start.path.read_text(encoding="utf-8")}, force=force)
    if as_json:
        print_json({"kind": kind, "file": str(place)})
    elif not quiet:
        out = console()
        out.print(f"wrote {place}", soft_wrap=True, markup=False)
        out.print(f"next: beamchain fit {place} -o {place.stem}", soft_wrap=True, markup=False)
