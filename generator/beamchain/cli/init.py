"""`beamchain init`: a commented specification to start from, a shipped example,
or a spacecraft to embed into."""

import re
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from beamchain.cli import shipped
from beamchain.cli.common import Force, console
from beamchain.cli.output import print_all, print_files, print_json
from beamchain.errors import InputError

_TABLE = re.compile(r"(?:# )?\[+([\w.]+)\]+")
_KEY = re.compile(r"(?:# )?(\w+) = [^#]*")
COLUMN = 38  # of the comments in a template


def _kinds(incomplete: str = "") -> list[tuple[str, str]]:
    """Names of what is written that begin so, and what each is."""
    shown = [(one.name, one.about) for one in shipped.everything()]
    shown.append(("schema", "The JSON schema of SPEC.toml, for editors; printed without -o."))
    return [(name, about) for name, about in shown if name.startswith(incomplete)]


def init(
    kind: Annotated[
        str | None,
        typer.Argument(
            metavar="[boom|array|mast|craft|schema|EXAMPLE]",
            help="What to write: a specification, a spacecraft (craft), the keys of a "
            "specification (schema), or an example. Left out: they are listed.",
            autocompletion=_kinds,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="Output file.",
            show_default="KIND.toml or craft.xml",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Write a commented SPEC.toml to start from, a shipped example,
    or a small spacecraft (MJCF) to attach it to.

    Without a kind, list what can be written.
    Existing files are overwritten only with --force.

    Example: beamchain init

    Example: beamchain init boom

    Example: beamchain init array -o my_array.toml

    Example: beamchain init craft

    Example: beamchain init schema -o spec.schema.json
    """
    if kind is None:
        if output is not None:
            raise InputError("init: the kind is missing; see `beamchain init` for what there is.")
        _list()
        return
    from beamchain.files import to_json, write_files
    from beamchain.fitting.spec import schema

    if kind == "schema":
        if output is None:
            print_json(schema())
        else:
            write_files({output: to_json(schema())}, force=force)
            print_files([output])
        return
    start = shipped.pick(shipped.everything(), kind, "init: the kind")
    place = output or Path(f"{kind}{start.path.suffix}")
    text = start.path.read_text(encoding="utf-8")
    files = {place.parent / one.name: one.read_text(encoding="utf-8") for one in start.beside}
    files[place] = add_comments(text) if place.suffix == ".toml" else text
    write_files(files, force=force)
    following = f"beamchain fit {place} -o {place.stem}"
    if start in shipped.spacecraft():
        following = f"beamchain embed {place} {_PLACES[kind]} -o flexible.xml"
    print_files(files)
    console().print(f"next: {following}", soft_wrap=True)


#: of the shipped spacecraft, with what is shipped for them
_PLACES = {
    "craft": "--mount mount=array.toml",
    "arm": "--mount shoulder=upper.toml --mount forearm=fore.toml",
    "wing_unfolds": " ".join(
        [f"--mount panel{k}_{side}=panel.toml" for side in ("right", "left") for k in (1, 2, 3)]
        + [
            f"--carry panel{k}_{side}:end=hinge{k + 1}_{side}"
            for side in ("right", "left")
            for k in (1, 2)
        ]
    ),
    "manipulator": "--mount mount=manipulator_link.toml",
    "two_panels": "--mount panel1=hinged_panel.toml --mount panel2=hinged_panel.toml",
    "spinner": " ".join(f"--mount boom{k}=spin_boom.toml" for k in (1, 2, 3, 4)),
}


def add_comments(template: str) -> str:
    """The template, with the schema's text after every key that has no comment of its own."""
    from beamchain.checks import descriptions
    from beamchain.fitting.sentences import structs_of
    from beamchain.fitting.spec import Spec

    structs = [Spec]
    lines = list[str]()
    for line in template.splitlines():
        if table := _TABLE.match(line):
            place: Any = Spec
            for key in table[1].split("."):
                place = get_type_hints(structs_of(place)[0])[key]
            structs = structs_of(place)
        elif key := _KEY.fullmatch(line):
            texts = [found for one in structs if (found := descriptions(one).get(key[1]))]
            line = f"{line:<{COLUMN}} # {texts[0]}" if texts else line
        lines.append(line)
    return "\n".join(lines) + "\n"


def _list() -> None:
    from beamchain.report.table import Column, Table

    names, abouts = zip(*_kinds(), strict=True)
    columns = (
        Column("name", names, key="name"),
        Column("what it is", abouts, key="about"),
    )
    print_all(Table("What `beamchain init` writes", columns))
