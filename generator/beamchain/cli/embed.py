"""`beamchain embed`: appendages into an existing spacecraft."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from beamchain.caution import warnings_record
from beamchain.cli.common import Force, Json, Quiet, console
from beamchain.cli.output import print_json, print_table, print_warnings, spinner, tell
from beamchain.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from beamchain.craft.coupled_modes import Mode
    from beamchain.craft.embedded import Embedded


At = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=SPEC.toml",
        help="Site or body of the spacecraft (its x axis outwards) and the appendage to attach "
        "there. Repeatable. With --remove, NAME only.",
    ),
]
Retime = Annotated[
    bool | None,
    typer.Option(
        help="Make the appendages exact in time for the spacecraft's own step, or not. Default: "
        "only if the step's error exceeds a tenth of the tolerance."
    ),
]


def embed(
    craft: Annotated[Path, typer.Argument(metavar="CRAFT.xml", help="The spacecraft's MJCF file.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="OUT.xml", help="Output file.")],
    at: At = None,
    prefix: Annotated[
        list[str] | None,
        typer.Option(
            help="Prefix of the appendage's elements; default: its name and `_`. One per --at."
        ),
    ] = None,
    form: Annotated[
        str,
        typer.Option(help='"inline": one self-contained file; "attach": separate appendage files.'),
    ] = "inline",
    remove: Annotated[
        bool, typer.Option("--remove", help="Remove appendages: those of --at NAME, or all.")
    ] = False,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE.svg", help="Plot the hub's accelerance, exact and from MuJoCo."),
    ] = None,
    retime: Retime = None,
    report: Annotated[bool, typer.Option(help="Write OUT_report.html as well.")] = True,
    max_modes: Annotated[
        int, typer.Option(help="Largest number of modes per appendage if modes are added.")
    ] = 12,
    rigid: Annotated[
        bool,
        typer.Option("--rigid", help="Write the rigid twin: the same model with rigid appendages."),
    ] = False,
    key: Annotated[
        str | None, typer.Option(metavar="NAME", help="Print the modes at this keyframe as well.")
    ] = None,
    explain: Annotated[
        bool,
        typer.Option("--explain", help="Print which modes were added for the whole spacecraft."),
    ] = False,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Attach appendages to an existing spacecraft and verify the assembled model.

    The hub is read from the spacecraft; the spacecraft's own elements and comments are not changed.
    Running the command again replaces an appendage; --remove restores the original.
    OUT_report.html compares the assembled model with exact beams.

    Example: beamchain embed craft.xml --at panel_mount=array.toml -o flexible.xml
    """
    from beamchain.craft.embedding import embed as embed_all
    from beamchain.craft.embedding import take_out
    from beamchain.files import beside, check_outputs, write_files
    from beamchain.mjcf.craft import Craft
    from beamchain.mjcf.relocate import relocate
    from beamchain.report.tables.embed import keyframe_table

    named = [_split(word, remove) for word in at or []]
    page = beside(output, "_report.html") if report and not rigid else None
    outputs = [output, *(place for place in (plot, page) if place is not None)]
    at_key: Sequence[Mode] = ()
    if remove:
        result = take_out(craft, [name for name, _ in named])
        if isinstance(result, Craft):
            write_files(
                {output: relocate(result, output.parent).content},
                force=force,
                update=(craft, output),
            )
            if as_json:
                print_json({"appendages": [], "modes": [], **warnings_record(())})
            elif not quiet:
                console().print(f"wrote {output}, without appendages")
            return
    else:
        wanted = places(at or [])
        inputs = [craft, *map(Path, wanted.values())]
        check_outputs(outputs, force=force, inputs=inputs, update=(craft, output))
        with spinner("fitting the appendages and proving the whole", quiet or as_json):
            result = embed_all(
                craft,
                wanted,
                form=form,
                prefixes=prefix,
                retime=retime,
                max_modes=max_modes,
                rigid=rigid,
            )
            result.assembly  # noqa: B018  (computed here, shown below)
            result.promise  # noqa: B018
            at_key = () if key is None else result.modes_at(key)
    also = {} if plot is None else {plot: result.picture()}
    if page is not None:
        also[page] = result.report(craft.name, output.name)
    files = result.write(output, force=force, also=also)

    def record() -> dict[str, Any]:
        modes = [{"exact": m.exact, "mujoco": m.mujoco, "error": m.error} for m in at_key]
        return {**result.as_dict(), **({} if key is None or remove else {"modes_at": {key: modes}})}

    tell(record, lambda: _show(result), files, as_json, quiet)
    if not as_json and not quiet:
        if key is not None and not remove:
            print_table(keyframe_table(at_key, key))
        if explain:
            for line in result.steps or ("no mode was added for the craft as a whole",):
                console().print(line, markup=False)
    good = result.met if result.met is not None else all(a.fit.status.ok for a in result.appendages)
    if not rigid and not good:
        raise typer.Exit(3)


def places(at: "Sequence[str]") -> dict[str, str]:
    """The specification for each place that --at names, each once."""
    found = [_split(word, False) for word in at]
    named = [name for name, _ in found]
    if len(set(named)) < len(named):
        raise InputError(
            f"--at names {max(named, key=named.count)!r} twice; one place carries one appendage."
        )
    return dict(found)


def _split(word: str, remove: bool) -> tuple[str, str]:
    name, sign, spec = word.partition("=")
    if not name or (not remove and not spec):
        raise InputError(
            f"--at {word!r} is not NAME=SPEC.toml; for example --at panel_mount=array.toml."
        )
    if remove and sign:
        raise InputError(f"--at {word!r}: --remove takes the name only, --at {name}.")
    return name, spec


def _show(result: "Embedded") -> None:
    from beamchain.report.tables.embed import appendage_table, coupled_table

    out = console()
    assembly = result.assembly
    out.print(result.headline, markup=False)
    out.print(result.composite.sentence, markup=False)
    print_table(appendage_table(result))
    print_table(coupled_table(assembly))
    out.print(assembly.worst_told)
    for item in result.appendages:
        scene = item.fit.spec.scene
        promise = item.fit.promise
        if scene is not None and scene.bandwidth is not None and promise is not None:
            out.print(
                f"{item.at}: what its scene asks for ({', '.join(scene.axes)} up to "
                f"{scene.bandwidth:g} rad/s within {scene.tolerance:g}) is kept to {promise:.2e} "
                "by this appendage alone on what carries it.",
                markup=False,
            )
    print_warnings(result.warnings, "note")
