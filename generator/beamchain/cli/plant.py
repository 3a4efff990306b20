"""`beamchain plant`: the spacecraft as a control engineer's plant."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from beamchain.caution import warnings_record
from beamchain.cli.common import Force, Json, Quiet, console
from beamchain.cli.output import print_table, print_warnings, spinner, tell
from beamchain.errors import InputError

if TYPE_CHECKING:
    from beamchain.plants.loops import Margins
    from beamchain.plants.realisation import Plant
    from beamchain.plants.scheduled import ScheduledPlant
    from beamchain.plants.uncertain_plant import WorstCase


Inputs = Annotated[
    list[str] | None,
    typer.Option(
        "--input",
        metavar="NAME",
        help="An actuator, torque:BODY, force:BODY or wrench:SITE. Repeatable; default: all "
        "actuators.",
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
        metavar="CRAFT.toml",
        help="What is uncertain: the worst for the controller is searched for and run in MuJoCo.",
    ),
]
Worst = Annotated[
    str | None,
    typer.Option(
        "--worst",
        metavar="INPUT:OUTPUT",
        help="Signals of the plant between which the worst gain is sought; default: those of the "
        "first loop.",
    ),
]


def plant(
    model: Annotated[Path, typer.Argument(metavar="FILE.xml", help="The spacecraft's MJCF file.")],
    output: Annotated[
        Path, typer.Option("-o", "--file", metavar="OUT", help="Output file: .npz, .json or .mat.")
    ],
    inputs: Inputs = None,
    outputs: Outputs = None,
    at: Annotated[
        str | None, typer.Option(metavar="KEY", help="Keyframe to linearise at; default: rest.")
    ] = None,
    angle: Annotated[
        str | None,
        typer.Option(
            metavar="JOINT=0,45,90", help="Angles of a drive in degrees: a plant for each."
        ),
    ] = None,
    discrete: Annotated[
        float | None, typer.Option(metavar="STEP", help="Sampled at this step in s.")
    ] = None,
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
    """Linearise a spacecraft for control design: a state space with names and units,
    and the margins of a controller.

    Example: beamchain plant flexible.xml --input torque:bus -o plant.mat

    Example: beamchain plant flexible.xml --input torque:bus --controller loops.toml -o plant.npz

    Example: beamchain plant flexible.xml --input torque:bus --controller loops.toml --uncertain
    craft.toml -o plant.npz
    """
    from beamchain.files import beside, check_outputs
    from beamchain.plants.controllers import read_controller
    from beamchain.plants.loops import margin_warnings, margins
    from beamchain.plants.plant import plant as linear
    from beamchain.plants.realisation import Plant
    from beamchain.report.pages.plant import plant_report

    if at is not None and angle is not None:
        raise InputError("plant: --at and --angle are both given; leave one out.")
    if uncertain is not None and controller is None:
        raise InputError(
            "plant: --uncertain needs --controller, whose worst case it seeks; in Python: "
            "plant.uncertain."
        )
    first, _, last = (disturbance or "").partition(":")
    if disturbance is not None and not (first and last and uncertain):
        raise InputError(
            f"--worst {disturbance!r} is INPUT:OUTPUT of the plant, for example "
            "torque_z:attitude_z, and needs --uncertain."
        )
    page = beside(output, "_report.html")
    files_read = [model, *(place for place in (controller, uncertain) if place is not None)]
    check_outputs([output, *([page] if report else ())], force=force, inputs=files_read)
    loops = None if controller is None else read_controller(controller)
    with spinner("linearising", quiet or as_json):
        found = linear(
            model,
            inputs or None,
            outputs or None,
            _angles(angle) if angle else at,
            discrete=discrete,
        )
        plants = [found] if isinstance(found, Plant) else list(found.plants)
        of_loops = [[] if loops is None else margins(one, loops) for one in plants]
        pulled = [] if uncertain is None else [one.uncertain(uncertain) for one in plants]
        worst = [
            one.worst_case(loops, first or None, last or None)
            for one in pulled
            if loops is not None
        ]
        text = plant_report(found, of_loops, model.name, worst) if report else ""
    files = [found.write(output, force=force, also={page: text} if report else None)]
    files += [page] if report else []
    results = plants[0], of_loops, worst, margin_warnings(plants, of_loops)
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

    from beamchain.report.tables import plant as tables

    angles = None if found is first else np.degrees(found.angles)  # pyright: ignore[reportAttributeAccessIssue]
    inputs = tables.signal_table("Inputs", first.input_names, first.input_units)
    outputs = tables.signal_table("Outputs", first.output_names, first.output_units)
    return {
        "inputs": inputs.records(),
        "outputs": outputs.records(),
        "states": list(first.state_names),
        "modes": tables.mode_table(first).records(),
        "angles": angles,
        "margins": [[one.as_dict() for one in several] for several in of_loops],
        "worst": [one.as_dict() for one in worst],
        **warnings_record(warnings),
    }


def _show(
    first: "Plant", of_loops: "list[list[Margins]]", worst: "list[WorstCase]", warnings: list[str]
) -> None:
    from beamchain.report.tables import plant as tables

    console().print(
        f"{first.nstates} states, {first.ninputs} inputs ({', '.join(first.input_names)}), "
        f"{first.noutputs} outputs ({', '.join(first.output_names)})",
    )
    print_table(tables.mode_table(first))
    margins = tables.margin_table(of_loops)
    if margins:
        print_table(margins)
    for case in worst:
        console().print(f"worst case, {case.sentence}")
    if worst:
        print_table(tables.worst_value_table(worst))
    print_warnings(warnings, "note")
