"""`beamchain init`: a commented spec to start from, or a spacecraft to put it on."""

from pathlib import Path
from typing import Annotated

import typer

from beamchain.cli.common import Force, Json, Quiet, console, print_json


def _kinds(incomplete: str) -> list[tuple[str, str]]:
    from beamchain.cli.shipped import spacecraft, starts

    return [(one.name, one.about) for one in [*starts(), spacecraft()] if one.name.startswith(incomplete)]


def init(
    kind: Annotated[
        str,
        typer.Argument(
            metavar="boom|array|mast|craft",
            help="What to write: a specification, or (craft) a spacecraft.",
            autocompletion=_kinds,
            show_default=False,
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Output file.", show_default="KIND.toml or craft.xml"),
    ] = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Write a commented SPEC.toml to start from, or a small spacecraft (MJCF) to attach it to.

    Existing files are overwritten only with --force.

    Example: beamchain init boom

    Example: beamchain init array -o my_array.toml

    Example: beamchain init craft
    """
    from beamchain.cli.shipped import pick, spacecraft, starts
    from beamchain.files import write_files

    start = pick([*starts(), spacecraft()], kind, "init: the kind")
    place = output or Path(f"{kind}{start.path.suffix}")
    write_files({place: start.path.read_text(encoding="utf-8")}, force=force)
    if as_json:
        print_json({"kind": kind, "file": str(place)})
    elif not quiet:
        out = console()
        out.print(f"wrote {place}", soft_wrap=True, markup=False)
        following = f"beamchain fit {place} -o {place.stem}"
        if start == spacecraft():
            following = f"beamchain embed {place} --at mount=array.toml -o flexible.xml"
        out.print(f"next: {following}", soft_wrap=True, markup=False)
