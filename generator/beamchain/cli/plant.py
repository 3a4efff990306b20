"""`beamchain plant`: the spacecraft as a control engineer's plant."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from beamchain.caution import warnings_record
from beamchain.cli.common import Force, Json, Quiet, console
from beamchain.cli.output import print_table, print_warnings, spinner, tell
from beamchain.errors import InputError

if TYPE_CHECKING:
    from beamchain.craft.plants.loops import Margins
    from beamchain.craft.plants.realisation import Plant
    from beamchain.craft.plants.scheduled import ScheduledPlant
    from beamchain.craft.robust.uncertain_plant import WorstCase


Inputs = Annotated[
    list[str] | None,
    typer.Option(
        "--input",
        metavar="NAME",
        help="An actuator, torque:BODY, force:BODY or wrench:SITE. Repeatable; default: all actuators.",
    ),
]
Outputs = Annotated[
    list[str] | None,
    typer.Option(
        "--output",
        metavar="NAME",
        help="A sensor, attitude, rate or motion:SITE. Repeatable; default: attitude and rate.",
    ),
]
Uncertain = Annotated[
    Path | None,
    typer.Option(
        metavar="CRAFT.toml", help="What is uncertain: the worst that the controller meets, confirmed in MuJoCo."
    ),
]
Worst = Annotated[
    str | None,
    typer.Option(
        "--worst",
        metavar="INPUT:OUTPUT",
        help="Signals of the plant between which the worst gain is sought; default: those of the first loop.",
    ),
]


def plant(
    model: Annotated[Path, typer.Argument(metavar="FILE.xml", help="The spacecraft's MJCF file.")],
    output: Annotated[Path, typer.Option("-o", "--file", metavar="OUT", help="Output file: .npz, .json or .mat.")],
    inputs: Inputs = None,
    outputs: Outputs = None,
    at: Annotated[str | None, typer.Option(metavar="KEY", help="Keyframe to linearise at; default: rest.")] = None,
    angle: Annotated[
        str | None, typer.Option(metavar="JOINT=0,45,90", help="Angles of a drive in degrees: a plant for each.")
    ] = None,
    discrete: Annotated[float | None, typer.Option(metavar="STEP", help="Sampled at this step in s.")] = None,
    controller: Annotated[
        Path | None, typer.Option(metavar="LOOPS.toml", help="Loops whose margins are computed.")
    ] = None,
    uncertain: Uncertain = None,
    disturbance: Worst = None,
    report: Annotated[bool, typer.Option(help="Write OUT_report.html as well.")] = True,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Linearise a spacecraft for control design: a state space with names and units, and the margins of a controller.

    Example: beamchain plant flexible.xml --input torque:bus -o plant.mat

    Example: beamchain plant flexible.xml --input torque:bus --controller loops.toml -o plant.npz

    Example: beamchain plant flexible.xml --input torque:bus --controller loops.toml --uncertain craft.toml -o plant.npz
    """
    from beamchain.craft.plants.controllers import read_controller
    from beamchain.craft.plants.loops import margins, told
    from beamchain.craft.plants.plant import plant as linear
    from beamchain.craft.plants.realisation import Plant
    from beamchain.files import check_free, write_files
    from beamchain.report.plant_html import plant_report

    if at is not None and angle is not None:
        raise InputError("plant: --at and --angle are both given; leave one out.")
    if uncertain is not None and controller is None:
        raise InputError(
            "plant: --uncertain needs --controller, whose worst case it seeks; in Python: plant.uncertain."
        )
    first, _, last = (disturbance or "").partition(":")
    if disturbance is not None and not (first and last and uncertain):
        raise InputError(
            f"--worst {disturbance!r} is INPUT:OUTPUT of the plant, for example torque_z:attitude_z, and needs --uncertain."
        )
    loops = None if controller is None else read_controller(controller)
    page = output.with_name(f"{output.stem}_report.html")
    for place in (output, *([page] if report else ())):
        check_free(place, force=force)
    with spinner("linearising", quiet or as_json):
        found = linear(model, inputs or None, outputs or None, _angles(angle) if angle else at, discrete=discrete)
        plants = [found] if isinstance(found, Plant) else list(found.plants)
        of_loops = [[] if loops is None else margins(one, loops) for one in plants]
        pulled = [] if uncertain is None else [one.uncertain(uncertain) for one in plants]
        worst = [one.worst_case(loops, first or None, last or None) for one in pulled if loops is not None]
        text = plant_report(found, of_loops, model.name, worst) if report else ""
    files = [found.write(output, force=force)]
    if report:
        write_files({page: text}, force=force)
        files.append(page)
    results = plants[0], of_loops, worst, told(plants, of_loops)
    tell(lambda: _record(found, *results), lambda: _show(*results), files, as_json, quiet)
    if not all(one.stable for several in (*of_loops, worst) for one in several):
        raise typer.Exit(3)


def _angles(text: str) -> "dict[str, Any]":
    import numpy as np

    joint, _, words = text.partition("=")
    try:
        return {joint: np.radians([float(word) for word in words.split(",")])}
    except ValueError:
        raise InputError(
            f"--angle {text!r} is not JOINT=ANGLES; for example --angle drive=0,45,90 in degrees."
        ) from None


def _record(
    found: "Plant | ScheduledPlant",
    first: "Plant",
    of_loops: "list[list[Margins]]",
    worst: "list[WorstCase]",
    warnings: list[str],
) -> dict[str, Any]:
    import numpy as np

    def rows(head: str, *columns: Any) -> list[dict[str, Any]]:
        return [dict(zip(head.split(), row, strict=True)) for row in zip(*columns, strict=True)]

    angles = None if found is first else np.degrees(found.angles)  # pyright: ignore[reportAttributeAccessIssue]
    return {
        "inputs": rows("name unit", first.input_labels, first.input_units),
        "outputs": rows("name unit", first.output_labels, first.output_units),
        "states": list(first.state_labels),
        "modes": rows("name frequency damping", first.modes, first.frequency.tolist(), first.damping_ratio.tolist()),
        "angles": angles,
        "margins": [[one.as_dict() for one in several] for several in of_loops],
        "worst": [one.as_dict() for one in worst],
        **warnings_record(warnings),
    }


def _show(first: "Plant", of_loops: "list[list[Margins]]", worst: "list[WorstCase]", warnings: list[str]) -> None:
    from beamchain.craft.plants.loops import HEAD

    console().print(
        f"{first.nstates} states, {first.ninputs} inputs ({', '.join(first.input_labels)}), "
        f"{first.noutputs} outputs ({', '.join(first.output_labels)})", markup=False,
    )  # fmt: skip
    pairs = [f"{output} per {given}" for output in first.output_labels for given in first.input_labels]
    rows = [
        [name, f"{w:.6g}", f"{w / math.tau:.5g}", f"{z:.3g}", f"{gain.max():.3g}", pairs[int(gain.argmax())]]
        for name, w, z, gain in zip(first.modes, first.frequency, first.damping_ratio, first.gain, strict=True)
    ]
    head = ("mode", "rad/s", "Hz", "damping ratio", "largest gain", "of")
    print_table("flexible modes", head, rows, left=(0, 5))
    for i, several in enumerate(of_loops, 1):
        title = "margins, the other loops closed" + (f", plant {i}" if len(of_loops) > 1 else "")
        if several:
            print_table(title, HEAD, [row for one in several for row in one.rows()], left=(0, 1, 2))
    for one in worst:
        console().print(f"worst case, {one.sentence}", markup=False)
        values = [[name, f"{value:.6g}"] for name, value in one.values.items()]
        print_table("values of the worst sample", ("quantity", "value"), values)
    print_warnings(warnings, "note")
