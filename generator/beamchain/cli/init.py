"""`beamchain init`: a commented specification to start from, a shipped example,
or a spacecraft to embed into."""

import re
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from beamchain.cli import shipped
from beamchain.cli.common import Force, Json, console
from beamchain.cli.output import print_all, print_json, tell
from beamchain.errors import InputError

_TABLE = re.compile(r"(?:# )?\[+([\w.]+)\]+")
_KEY = re.compile(r"(?:# )?(\w+) = [^#]*")
COLUMN = 38  # of the comments in a template


def _kinds(incomplete: str) -> list[tuple[str, str]]:
    return [
        (one.name, one.about) for one in shipped.everything() if one.name.startswith(incomplete)
    ]


def init(
    kind: Annotated[
        str | None,
        typer.Argument(
            metavar="[boom|array|mast|craft|EXAMPLE]",
            help="What to write: a specification, a spacecraft (craft), or an example shown by "
            "--list.",
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
    listed: Annotated[bool, typer.Option("--list", help="List what can be written.")] = False,
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON schema of SPEC.toml, for editors.")
    ] = False,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Write a commented SPEC.toml to start from, a shipped example,
    or a small spacecraft (MJCF) to attach it to.

    Existing files are overwritten only with --force.

    Example: beamchain init boom

    Example: beamchain init array -o my_array.toml

    Example: beamchain init craft

    Example: beamchain init --list

    Example: beamchain init --schema > spec.schema.json
    """
    from beamchain.files import write_files

    if listed or schema:
        if kind is not None or output is not None or (listed and schema):
            raise InputError(
                f"init: --{'list' if listed else 'schema'} writes no file; leave KIND, --output "
                "and the other out."
            )
        if listed:
            _list(as_json=as_json)
        else:
            from beamchain.fitting.spec import schema as spec_schema

            print_json(spec_schema())
        return
    if kind is None:
        raise InputError(
            "init: the kind is missing; choose boom, array, mast or craft, or see `beamchain init "
            "--list`."
        )
    start = shipped.pick(shipped.everything(), kind, "init: the kind")
    place = output or Path(f"{kind}{start.path.suffix}")
    text = start.path.read_text(encoding="utf-8")
    files = {place.parent / one.name: one.read_text(encoding="utf-8") for one in start.beside}
    files[place] = add_comments(text) if place.suffix == ".toml" else text
    write_files(files, force=force)
    if as_json:
        print_json({"kind": kind, "file": str(place)})
    else:
        out = console()
        for written in files:
            out.print(f"wrote {written}", soft_wrap=True)
        following = f"beamchain fit {place} -o {place.stem}"
        if start in shipped.spacecraft():
            following = f"beamchain embed {place} {_PLACES[kind]} -o flexible.xml"
        out.print(f"next: {following}", soft_wrap=True)


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


def _list(*, as_json: bool) -> None:
    from beamchain.report.table import Column, Table

    examples = shipped.everything()
    columns = (
        Column("name", [example.name for example in examples], key="name"),
        Column("what it is", [example.about for example in examples], key="about"),
    )
    table = Table("What `beamchain init` writes", columns)
    record = {"examples": table.records()}
    tell(lambda: record, lambda: print_all(table), (), as_json)
