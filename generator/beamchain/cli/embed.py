"""`beamchain embed`: appendages into an existing spacecraft."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.caution import warnings_record
from beamchain.cli.common import Force, Json, Quiet, console, print_json, print_written
from beamchain.cli.progress import spinner
from beamchain.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table

    from beamchain.craft.assembly import Mode
    from beamchain.craft.embedded import Embedded


def embed(
    craft: Annotated[Path, typer.Argument(metavar="CRAFT.xml", help="The spacecraft's MJCF file.", show_default=False)],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="OUT.xml", help="Output file.", show_default=False)],
    at: Annotated[
        list[str] | None,
        typer.Option(
            "--at",
            metavar="NAME=SPEC.toml",
            help="Site or body of the spacecraft (its x axis outwards) and the appendage to attach there. Repeatable. "
            "With --remove, NAME only.",
            show_default=False,
        ),
    ] = None,
    prefix: Annotated[
        list[str] | None,
        typer.Option(
            "--prefix",
            help="Prefix of the appendage's elements; default: its name and `_`. One per --at.",
            show_default=False,
        ),
    ] = None,
    form: Annotated[
        str, typer.Option("--form", help='"inline": one self-contained file; "attach": separate appendage files.')
    ] = "inline",
    remove: Annotated[bool, typer.Option("--remove", help="Remove appendages: those of --at NAME, or all.")] = False,
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot", metavar="FILE.svg", help="Plot the hub's accelerance, exact and from MuJoCo.", show_default=False
        ),
    ] = None,
    retime: Annotated[
        bool | None,
        typer.Option(
            "--retime/--no-retime",
            help="Make the appendages exact in time for the spacecraft's own step, or not. Default: only if the "
            "step's error exceeds a tenth of the tolerance.",
            show_default=False,
        ),
    ] = None,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write OUT_report.html as well.")] = True,
    max_modes: Annotated[
        int,
        typer.Option("--max-modes", help="Largest number of modes per appendage if modes are added."),
    ] = 12,
    rigid: Annotated[
        bool,
        typer.Option("--rigid", help="Write the rigid twin: the same model with rigid appendages."),
    ] = False,
    key: Annotated[
        str | None,
        typer.Option("--key", metavar="NAME", help="Print the modes at this keyframe as well.", show_default=False),
    ] = None,
    explain: Annotated[
        bool, typer.Option("--explain", help="Print which modes were added for the whole spacecraft.")
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
    from beamchain.files import check_free, write_files
    from beamchain.mjcf.craft import Craft, relocate

    named = [_split(word, remove) for word in at or []]
    at_key: dict[str, Sequence[Mode]] = {}
    if remove:
        result = take_out(craft, [name for name, _ in named])
        if isinstance(result, Craft):
            write_files({output: relocate(result, output.parent).to_bytes()}, force=force)
            if as_json:
                print_json({"appendages": [], "modes": [], **warnings_record(())})
            elif not quiet:
                console().print(f"wrote {output}, without appendages")
            return
    else:
        wanted = places(at or [])
        for place in (output, *([plot] if plot else ())):
            check_free(place, force=force)
        with spinner("fitting the appendages and proving the whole", quiet or as_json):
            result = embed_all(
                craft, wanted, form=form, prefixes=prefix, retime=retime, max_modes=max_modes, rigid=rigid
            )
            result.assembly  # noqa: B018  (computed here, shown below)
            result.promise  # noqa: B018
            at_key = {} if key is None else {key: result.modes_at(key)}
    also = {} if plot is None else {plot: result.picture()}
    if report and not rigid:
        also[output.with_name(f"{output.stem}_report.html")] = result.report(craft.name, output.name)
    files = result.write(output, force=force, also=also)
    if as_json:
        keyed = {k: [{"exact": m.exact, "mujoco": m.mujoco, "error": m.error} for m in v] for k, v in at_key.items()}
        print_json({**result.as_dict(), **({"modes_at": keyed} if keyed else {})})
    elif not quiet:
        _show(result, files)
        if key is not None:
            console().print(_key_table(key, at_key[key]))
        if explain:
            for line in result.steps or ("no mode was added for the craft as a whole",):
                console().print(line, markup=False)
    if rigid:
        return
    if result.met is False or not all(a.fit.status.ok for a in result.appendages):
        raise typer.Exit(3)


def places(at: "Sequence[str]") -> dict[str, str]:
    """The specification for each place that --at names.

    Raises:
        InputError: an entry is not NAME=SPEC.toml, or a place is named twice.
    """
    found = [_split(word, False) for word in at]
    named = [name for name, _ in found]
    if len(set(named)) < len(named):
        raise InputError(f"--at names {max(named, key=named.count)!r} twice; one place carries one appendage.")
    return dict(found)


def _split(word: str, remove: bool) -> tuple[str, str]:
    name, sign, spec = word.partition("=")
    if not name or (not remove and not spec):
        raise InputError(f"--at {word!r} is not NAME=SPEC.toml; for example --at panel_mount=array.toml.")
    if remove and sign:
        raise InputError(f"--at {word!r}: --remove takes the name only, --at {name}.")
    return name, spec


def _key_table(key: str, modes: "Sequence[Mode]") -> "Table":
    from rich.table import Table

    table = Table(title=f"coupled modes at keyframe {key}, rad/s", title_justify="left")
    for column in ("exact beams on the same hub", "MuJoCo", "difference"):
        table.add_column(column, justify="right")
    for mode in modes:
        ours = "left out" if mode.mujoco is None else f"{mode.mujoco:.8g}"
        table.add_row(f"{mode.exact:.8g}", ours, "" if mode.error is None else f"{mode.error:+.1e}")
    return table


def _show(result: "Embedded", files: list[Path]) -> None:
    from rich.markup import escape
    from rich.table import Table

    out, assembly = console(), result.assembly
    out.print(result.headline, markup=False)
    out.print(result.composite.sentence, markup=False)
    table = Table(title="appendages", title_justify="left")
    for column in ("at", "prefix", "rigidly behind it kg", "on", "target"):
        table.add_column(column, justify="left")
    for a in result.appendages:
        on = ", ".join(joint.words for joint in a.mount.joints)
        table.add_row(a.at, a.prefix, f"{a.hub.mass:.6g}", on, a.fit.kept_for)
    out.print(table)
    modes = Table(title="coupled modes of the whole spacecraft, rad/s", title_justify="left")
    for column in ("exact beams on the same hub", "MuJoCo (mjd_transitionFD)", "difference", "what moves"):
        modes.add_column(column, justify="left" if column == "what moves" else "right")
    for mode in assembly.modes:
        exact = "-" if mode.exact is None else f"{mode.exact:.8g}"
        ours = "left out" if mode.mujoco is None else f"{mode.mujoco:.8g}"
        error = "" if mode.error is None else f"{mode.error:+.1e}"
        beyond = "beyond the band" if mode.kept else "not among the kept"
        modes.add_row(exact, ours, error if mode in assembly.judged else f"{error} {beyond}".strip(), mode.words)
    out.print(modes)
    out.print(assembly.worst_told)
    for item in result.appendages:
        scene, promise = item.fit.spec.scene, item.fit.promise
        if scene is not None and scene.bandwidth is not None and promise is not None:
            out.print(
                f"{item.at}: what its scene asks for ({', '.join(scene.axes)} up to {scene.bandwidth:g} rad/s within "
                f"{scene.tolerance:g}) is kept to {promise:.2e} by this appendage alone on what carries it.",
                markup=False,
            )
    for warning in result.warnings:
        out.print(f"[bold]note[/bold]: {escape(warning)}")
    print_written(files)
