"""`beamchain identify`: modes of an appendage from logs of a test or a flight."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.cli.common import Force, Json, Quiet, console
from beamchain.cli.output import print_table, print_warnings, spinner, tell
from beamchain.errors import InputError

if TYPE_CHECKING:
    from beamchain.craft.identification.result import Identification


def identify(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Logs: .csv, .parquet, .npz, .mat, .uff.")],
    craft: Annotated[Path, typer.Option("--craft", metavar="CRAFT.xml", help="The bare spacecraft.")],
    at: Annotated[str, typer.Option("--at", metavar="NAME", help="Its site or body that carries the appendage.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="MODES.toml", help="File for the modes.")
    ] = None,
    prior: Annotated[
        Path | None,
        typer.Option(
            "--prior",
            metavar="SPEC.toml",
            help="What is believed of the appendage; \\[uncertain] gives its widths.",
        ),
    ] = None,
    modes: Annotated[int | None, typer.Option(min=1, help="Number of modes; default: as the criterion says.")] = None,
    axes: Annotated[
        str | None, typer.Option(metavar="XYZ", help="Axes of the hub that are used, for example z.")
    ] = None,
    names: Annotated[
        list[str] | None,
        typer.Option("--map", metavar="COLUMN=NAME", help="What a column of the log is. Repeatable."),
    ] = None,
    free_hub: Annotated[
        bool, typer.Option("--estimate-hub", help="Estimate the hub's inertia too; needs --prior.")
    ] = False,
    held_out: Annotated[float, typer.Option(help="Last part of each log that is predicted first.")] = 0.2,
    offset: Annotated[
        bool, typer.Option("--offset", help="The sensors lag behind the torques by an unknown time.")
    ] = False,
    plan: Annotated[
        float | None,
        typer.Option(
            "--plan",
            metavar="NOISE",
            help="LOG holds only time and the torques of a test to come: print what it would determine of the prior's modes "
            "with gyros of this standard deviation per sample, in rad/s. Nothing is written.",
        ),
    ] = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Identify an appendage's modes from logs of the spacecraft's motion, with their covariance.

    Writes MODES.toml, which \\[imported] of a specification reads, its report MODES_report.html and record MODES.json.

    Example: beamchain identify log.csv --craft craft.xml --at mount --prior array.toml -o modes.toml

    Example: beamchain identify torques.csv --craft craft.xml --at mount --prior array.toml --plan 1e-5
    """
    from beamchain.craft.identification.identify import identify as find
    from beamchain.files import check_free

    renamed = _renamed(names)
    if plan is not None:
        _plan(logs, craft, at, prior, plan, renamed, as_json, quiet)
        return
    if output is None:
        raise InputError("identify: -o is missing; give a file for the modes, for example -o modes.toml.")
    if output.suffix.lower() != ".toml":
        raise InputError(f"-o {str(output)!r} must end in .toml, for [imported] to read it.")
    for place in (output, output.with_name(f"{output.stem}_report.html"), output.with_name(f"{output.stem}.json")):
        check_free(place, force=force)
    with spinner("identifying", quiet or as_json):
        found = find(
            list(logs),
            craft,
            at,
            prior=prior,
            modes=modes,
            axes=axes,
            map=renamed,
            hub="estimate" if free_hub else None,
            held_out=held_out,
            offset=offset,
        )
        files = found.write(output, force=force)
    tell(found.as_dict, lambda: _show(found), files, as_json, quiet)


def _renamed(names: list[str] | None) -> dict[str, str]:
    renamed = dict[str, str]()
    for text in names or ():
        column, equal, name = text.rpartition("=")
        if not equal or not column or not name:
            raise InputError(f"--map {text!r} is not COLUMN=NAME; for example --map gyro3=rate_z.")
        renamed[column] = name
    return renamed


def _plan(
    logs: list[Path], craft: Path, at: str, prior: Path | None, noise: float, renamed: dict[str, str], as_json: bool,
    quiet: bool,
) -> None:  # fmt: skip
    from beamchain.craft.identification.planned import planned
    from beamchain.craft.identification.result import INTERVAL

    if prior is None or len(logs) != 1:
        raise InputError("identify: --plan needs --prior, whose modes are to be found, and one file of torques.")
    with spinner("planning", quiet or as_json):
        found = planned(logs[0], craft, at, prior=prior, noise=noise, map=renamed)
    columns = zip(found.frequency, found.damping, *INTERVAL * found.deviations.T, found.determined, strict=True)
    rows = [
        [
            *(str(i), f"{w:.5g}", f"{w * dw:.2g}", f"{z:.3g}", f"{z * dz:.2g}", f"{100.0 * row:.2g} %"),
            "yes" if ok else "no",
        ]
        for i, (w, z, dw, dz, row, ok) in enumerate(columns, 1)
    ]
    head = ("mode", "rad/s", "+- 95 %", "damping ratio", "+- 95 %", "participation +-", "determined")

    def show() -> None:
        print_table("modes of the prior that the torques move", head, rows, left=(0, 6))
        for sentence in found.advice:
            console().print(sentence, markup=False)

    tell(found.as_dict, show, [], as_json, quiet)


def _show(found: "Identification") -> None:
    from beamchain.craft.identification.result import INTERVAL
    from beamchain.report.identified_html import mode_rows

    head = ("mode", "rad/s", "+- 95 %", "damping ratio", "+- 95 %", "determined", "remark")
    print_table("modes with the root held", head, mode_rows(found), left=(0, 5, 6))
    said = [f"not determined: {sentence}" for sentence in found.undetermined]
    if (update := found.update) is not None:
        factors = {f"the prior's {name}": (value, update.std[name]) for name, value in update.factors.items()}
        factors["stiffness over mass"] = (update.ratio, update.ratio_std)
        said = [f"factor on {name}: {v:.5g} +- {INTERVAL * std:.2g}" for name, (v, std) in factors.items()] + said
    for sentence in said:
        console().print(sentence, markup=False)
    print_warnings(found.warnings)
