"""`beamchain embed`: appendages into an existing spacecraft."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.cli.common import Force, Full, Json, Torque, read_commands
from beamchain.cli.output import print_all, print_first, spinner, tell
from beamchain.errors import InputError
from beamchain.warning_codes import warnings_record

if TYPE_CHECKING:
    from collections.abc import Sequence

    from beamchain.craft.embedded import Embedded
    from beamchain.steps.deployment import Commands


CraftFile = Annotated[Path, typer.Argument(metavar="CRAFT.xml", help="The spacecraft's MJCF file.")]
Output = Annotated[Path, typer.Option("-o", "--output", metavar="OUT.xml", help="Output file.")]
Mounts = Annotated[
    list[str] | None,
    typer.Option(
        "--mount",
        metavar="NAME=SPEC.toml",
        help="Site or body of the spacecraft (its x axis outwards) and the appendage to attach "
        "there. Repeatable. With --remove, NAME only.",
    ),
]
Carry = Annotated[
    list[str] | None,
    typer.Option(
        metavar="PLACE:PORT=BODY",
        help="A body of the spacecraft that hangs on a port of the appendage at PLACE; it stands "
        "in the file where it is at rest, inside the body that holds PLACE. Repeatable. Default: "
        "what \\[\\[port]] of SPEC.toml carries.",
    ),
]
Remove = Annotated[
    bool, typer.Option("--remove", help="Remove appendages: those of --mount NAME, or all.")
]
Retime = Annotated[
    bool | None,
    typer.Option(
        help="Make the appendages exact in time for the spacecraft's own step, or not. Default: "
        "only if the step's error exceeds a tenth of the tolerance, and timing lowers what is "
        "stated by a third or to within the tolerance."
    ),
]
Report = Annotated[bool, typer.Option(help="Write OUT_report.html as well.")]
Rigid = Annotated[
    bool,
    typer.Option("--rigid", help="Write the rigid twin: the same model with rigid appendages."),
]
Loaded = Annotated[
    bool,
    typer.Option(
        "--loaded",
        help="Prove the spacecraft under its own load: its gravity where it is held, and the ctrl "
        "of its keyframes, such as a constant thrust.",
    ),
]


def embed(
    craft: CraftFile,
    output: Output,
    mount: Mounts = None,
    carry: Carry = None,
    remove: Remove = False,
    retime: Retime = None,
    report: Report = True,
    torque: Torque = None,
    rigid: Rigid = False,
    loaded: Loaded = False,
    full: Full = False,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Attach appendages to an existing spacecraft and verify the assembled model.

    The hub is read from the spacecraft; the spacecraft's own elements and comments are not changed.
    Running the command again replaces an appendage; --remove restores the original.
    OUT_report.html compares the assembled model with exact appendages, and films a turn or, with
    --torque, a run under commands of your own.

    Example: beamchain embed craft.xml --mount panel_mount=array.toml -o flexible.xml
    """
    from beamchain.craft.embedding import embed as attach
    from beamchain.files import beside, check_outputs

    names = [_split(word, remove)[0] for word in mount or []]
    page = beside(output, "_report.html") if report and not rigid else None
    if torque is not None and (page is None or remove):
        without = "--remove" if remove else "--rigid" if rigid else "--no-report"
        raise InputError(f"--torque is filmed on the page of a new file; leave {without} out.")
    given = None if torque is None else _commands(craft, torque)
    if remove:
        result = _take_out(craft, names, output, force=force, as_json=as_json)
        if result is None:
            return
    else:
        appendages = places(mount or [])
        outputs = [output, *([] if page is None else [page])]
        inputs = [craft, *map(Path, appendages.values()), *([] if torque is None else [torque])]
        check_outputs(outputs, force=force, inputs=inputs, update=(craft, output))
        with spinner("fitting the appendages and proving the whole"):
            result = attach(
                craft,
                appendages,
                retime=retime,
                rigid=rigid,
                carry=_carried(carry or []),
                loaded=loaded,
            )
            _ = result.cure, result.assembly  # kept: the proof, and what mends it
    drawings: dict[Path, str] = {}
    if page is not None:
        from beamchain.report import embed_report

        drawings[page] = embed_report(result, craft.name, output.name, given)
    files = result.write(output, force=force, also=drawings)
    tell(result.as_dict, lambda: _show(result, full=full), files, as_json)
    if not rigid and not _is_good(result):
        raise typer.Exit(3)


def _commands(craft: Path, torque: Path) -> "Commands":
    """The commands of --torque, of actuators that the bare spacecraft has."""
    from beamchain.craft.documents import read_bare
    from beamchain.engine.linearise import compile_model
    from beamchain.mjcf.relocate import relocate

    bare, _ = read_bare(craft)
    return read_commands(compile_model(relocate(bare, None).text), torque)


def _take_out(
    craft: Path, names: list[str], output: Path, *, force: bool, as_json: bool
) -> "Embedded | None":
    """The spacecraft with the appendages that stay.

    None if it has none left: its original document is written.
    """
    from beamchain.craft.embedding import take_out
    from beamchain.files import write_files
    from beamchain.mjcf.craft import Craft
    from beamchain.mjcf.relocate import relocate

    result = take_out(craft, names)
    if not isinstance(result, Craft):
        return result
    original = relocate(result, output.parent).content
    write_files({output: original}, force=force, update=(craft, output))
    record = {"appendages": [], "modes": [], "warnings": warnings_record(())}
    tell(lambda: record, lambda: print_all(f"wrote {output}, without appendages"), (), as_json)
    return None


def _is_good(result: "Embedded") -> bool:
    """Whether the whole keeps its tolerance or, without one, every appendage is as asked."""
    if result.met is not None:
        return result.met
    return not result.ruined and all(a.fit.status.ok for a in result.appendages)


def places(mounts: "Sequence[str]") -> dict[str, str]:
    """The specification for each place that --mount names, each once."""
    pairs = [_split(word, False) for word in mounts]
    names = [name for name, _ in pairs]
    if len(set(names)) < len(names):
        raise InputError(
            f"--mount names {max(names, key=names.count)!r} twice; one place carries one appendage."
        )
    return dict(pairs)


def _carried(carry: "Sequence[str]") -> dict[str, list[str]]:
    """Bodies by port of every --carry."""
    out: dict[str, list[str]] = {}
    for word in carry:
        port, _, body = word.partition("=")
        if not port.rpartition(":")[0] or not body:
            raise InputError(
                f"--carry {word!r} is not PLACE:PORT=BODY; for example --carry shoulder:end=elbow."
            )
        out.setdefault(port, []).append(body)
    return out


def _split(word: str, remove: bool) -> tuple[str, str]:
    """Place and specification of one --mount."""
    name, sign, spec = word.partition("=")
    if not name or (not remove and not spec):
        raise InputError(
            f"--mount {word!r} is not NAME=SPEC.toml; for example --mount panel_mount=array.toml."
        )
    if remove and sign:
        raise InputError(f"--mount {word!r}: --remove takes the name only, --mount {name}.")
    return name, spec


def _show(result: "Embedded", *, full: bool) -> None:
    """What the terminal shows before the names of the files."""
    from beamchain.report.tables.first_screen import embedded_lines

    print_first(embedded_lines(result), result.warnings, full=full)
    if full:
        _show_tables(result)


def _show_tables(result: "Embedded") -> None:
    from beamchain.report.tables import embed as tables
    from beamchain.report.tables.steps import timing_sentences
    from beamchain.steps.modal import timing_marks

    made = [mark for mark in timing_marks(result.model) if mark is not None]
    by_pose = result.loaded or (result.by_step and len(result.promise.poses) > 1)
    print_all(
        result.composite.sentence,
        tables.appendage_table(result),
        tables.coupled_table(result.assembly),
        *timing_sentences(made, "the modes in this table are without it"),
        tables.pose_table(result) if by_pose else None,
    )
    for item in result.appendages:
        scene = item.fit.spec.scene
        promise = item.fit.promise
        if scene is not None and scene.bandwidth is not None and promise is not None:
            print_all(
                f"{item.at}: this appendage alone, on the body that carries it, is within "
                f"{promise:.2e} of what its scene asks for ({', '.join(scene.axes)} up to "
                f"{scene.bandwidth:g} rad/s within {scene.tolerance:g})."
            )
    print_all(*(result.steps or ("no mode was added for the craft as a whole",)))
