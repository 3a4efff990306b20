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
Bound = Annotated[
    bool,
    typer.Option("--bound", help="Prove what no value exceeds as well (the extra robust)."),
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


Model = Annotated[Path, typer.Argument(metavar="FILE.xml", help="The spacecraft's MJCF file.")]
Output = Annotated[
    Path, typer.Option("-o", "--file", metavar="OUT", help="Output file: .npz, .json or .mat.")
]
At = Annotated[
    str | None, typer.Option(metavar="KEY", help="Keyframe to linearise at; default: rest.")
]
Angle = Annotated[
    str | None,
    typer.Option(metavar="JOINT=0,45,90", help="Angles of a drive in degrees: a plant for each."),
]
Discrete = Annotated[float | None, typer.Option(metavar="STEP", help="Sampled at this step in s.")]
Loops = Annotated[
    Path | None, typer.Option(metavar="LOOPS.toml", help="Loops whose margins are computed.")
]
Report = Annotated[bool, typer.Option(help="Write OUT_report.html as well.")]


def plant(
    model: Model,
    output: Output,
    inputs: Inputs = None,
    outputs: Outputs = None,
    at: At = None,
    angle: Angle = None,
    discrete: Discrete = None,
    controller: Loops = None,
    uncertain: Uncertain = None,
    disturbance: Worst = None,
    bound: Bound = False,
    report: Report = True,
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
    from beamchain.plants.plant import plant as linearise
    from beamchain.plants.realisation import Plant
    from beamchain.report.pages.plant import plant_report

    _check_options(at, angle, controller, uncertain)
    source, target = _signals_between(disturbance, uncertain)
    if bound and uncertain is None:
        raise InputError("plant: --bound needs --uncertain, whose worst case it bounds.")
    page = beside(output, "_report.html")
    files_read = [model, *(place for place in (controller, uncertain) if place is not None)]
    check_outputs([output, *([page] if report else ())], force=force, inputs=files_read)
    loops = None if controller is None else read_controller(controller)
    with spinner("linearising", quiet or as_json):
        pose = _angles(angle) if angle else at
        result = linearise(model, inputs or None, outputs or None, pose, discrete=discrete)
        plants = [result] if isinstance(result, Plant) else list(result.plants)
        margins_by_plant = [[] if loops is None else margins(each, loops) for each in plants]
        cases: list[WorstCase] = []
        if loops is not None and uncertain is not None:
            if isinstance(result, Plant):
                one = result.uncertain(uncertain)
                cases = [one.worst_case(loops, source, target, bound=bound)]
            else:
                cases = [*result.worst_case(uncertain, loops, source, target, bound=bound)]
        pages: dict[Path, str] = {}
        if report:
            pages[page] = plant_report(result, margins_by_plant, model.name, cases)
    files = [result.write(output, force=force, also=pages or None), *pages]
    warnings = margin_warnings(plants, margins_by_plant)
    tell(
        lambda: _record(result, plants[0], margins_by_plant, cases, warnings),
        lambda: _show(plants[0], margins_by_plant, cases, warnings),
        files,
        as_json,
        quiet,
    )
    loops_stable = all(loop.stable for loops in margins_by_plant for loop in loops)
    if not loops_stable or not all(case.stable for case in cases):
        raise typer.Exit(3)


def _check_options(
    at: str | None, angle: str | None, controller: Path | None, uncertain: Path | None
) -> None:
    """Refuse options that do not go together."""
    if at is not None and angle is not None:
        raise InputError("plant: --at and --angle are both given; leave one out.")
    if uncertain is not None and controller is None:
        raise InputError(
            "plant: --uncertain needs --controller, whose worst case it seeks; in Python: "
            "plant.uncertain."
        )


def _signals_between(
    disturbance: str | None, uncertain: Path | None
) -> tuple[str | None, str | None]:
    """Input and output that --worst names."""
    if disturbance is None:
        return None, None
    source, _, target = disturbance.partition(":")
    if not (source and target and uncertain):
        raise InputError(
            f"--worst {disturbance!r} is INPUT:OUTPUT of the plant, for example "
            "torque_z:attitude_z, and needs --uncertain."
        )
    return source, target


def _angles(text: str) -> "dict[str, Any]":
    """The joint and the angles [rad] of --angle."""
    import numpy as np

    joint, _, words = text.partition("=")
    try:
        return {joint: np.radians([float(word) for word in words.split(",")])}
    except ValueError:
        raise InputError(
            f"--angle {text!r} is not JOINT=ANGLES; for example --angle drive=0,45,90 in degrees."
        ) from None


def _record(
    result: "Plant | ScheduledPlant",
    first: "Plant",
    margins_by_plant: "list[list[Margins]]",
    cases: "list[WorstCase]",
    warnings: list[str],
) -> dict[str, Any]:
    """What --json prints."""
    import numpy as np

    from beamchain.report.tables import plant as tables

    angles = None if result is first else np.degrees(result.angles)  # pyright: ignore[reportAttributeAccessIssue]
    inputs = tables.signal_table("Inputs", first.input_names, first.input_units)
    outputs = tables.signal_table("Outputs", first.output_names, first.output_units)
    return {
        "inputs": inputs.records(),
        "outputs": outputs.records(),
        "states": list(first.state_names),
        "modes": tables.mode_table(first).records(),
        "angles": angles,
        "margins": [[loop.as_dict() for loop in loops] for loops in margins_by_plant],
        "worst": [case.as_dict() for case in cases],
        **warnings_record(warnings),
    }


def _show(
    first: "Plant",
    margins_by_plant: "list[list[Margins]]",
    cases: "list[WorstCase]",
    warnings: list[str],
) -> None:
    """What the terminal shows before the names of the files."""
    from beamchain.report.tables import plant as tables

    console().print(
        f"{first.nstates} states, {first.ninputs} inputs ({', '.join(first.input_names)}), "
        f"{first.noutputs} outputs ({', '.join(first.output_names)})",
    )
    print_table(tables.mode_table(first))
    margins = tables.margin_table(margins_by_plant)
    if margins:
        print_table(margins)
    for case in cases:
        console().print(f"worst case, {case.sentence}")
    for case in cases:
        print_table(tables.worst_value_table(case))
    print_warnings(warnings, "note")
