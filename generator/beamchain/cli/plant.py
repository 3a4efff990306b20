"""`beamchain plant`: the spacecraft as a control engineer's plant."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.cli.common import Force, Full, Inputs, Json, Model, Outputs, Poses
from beamchain.cli.output import print_all, print_first, spinner, tell
from beamchain.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from beamchain.control.margins import Margins
    from beamchain.control.realisation import Plant
    from beamchain.control.scheduled import ScheduledPlant
    from beamchain.control.verdicts import LoopVerdict


Output = Annotated[
    Path, typer.Option("-o", "--output", metavar="OUT", help="Output file: .npz, .json or .mat.")
]
Loaded = Annotated[
    bool,
    typer.Option(
        "--loaded",
        help="Linearise under the load of the pose: gravity where the spacecraft is held, or the "
        "ctrl of the keyframe, such as a constant thrust. Liquids of tanks swing by it alone.",
    ),
]
Discrete = Annotated[
    float | None,
    typer.Option(
        metavar="STEP", help="As MuJoCo runs the file at its step in s; default: continuous."
    ),
]
Loops = Annotated[
    Path | None,
    typer.Option(
        metavar="LOOPS.toml",
        help="Loops whose margins are computed, and signals that are combined for them "
        "(\\[allocation], \\[alignment]).",
    ),
]


def plant(
    model: Model,
    output: Output,
    inputs: Inputs = None,
    outputs: Outputs = None,
    poses: Poses = None,
    discrete: Discrete = None,
    loaded: Loaded = False,
    controller: Loops = None,
    full: Full = False,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Linearise a spacecraft for control design: a state space with names and units,
    and the margins of a controller.

    Example: beamchain plant flexible.xml --from torque:bus -o plant.mat

    Example: beamchain plant flexible.xml --from torque:bus --controller loops.toml -o plant.npz

    Example: beamchain plant flexible.xml --pose north=45,south=-45 --pose north=0,south=90 -o
    plant.mat
    """
    from beamchain.cli.poses import doubtful, poses_given
    from beamchain.control.controllers import read_controller, signals_with, takes_time
    from beamchain.control.plant import plant as linearise
    from beamchain.control.realisation import Plant
    from beamchain.control.verdicts import loop_verdicts, margin_warnings
    from beamchain.craft.source import compiled_model
    from beamchain.files import beside, check_outputs
    from beamchain.report.pages.plant import plant_report
    from beamchain.report.tables.record import plant_record

    page = beside(output, "_report.html")
    files_read = [model, *([] if controller is None else [controller])]
    check_outputs([output, page], force=force, inputs=files_read)
    loops = None if controller is None else read_controller(controller)
    driven, seen = inputs or None, outputs or None
    if loops is not None:
        driven, seen = signals_with(loops, driven, seen)
        if discrete is not None and takes_time(loops):
            raise InputError(
                "plant: --controller gives continuous loops, --discrete a sampled plant; leave "
                "--discrete out, or use bc.margins in Python with a controller sampled by "
                "control.c2d."
            )
    with spinner("linearising") as say:
        compiled = compiled_model(model)
        pose = poses_given(compiled, poses or [])
        result = linearise(compiled, driven, seen, pose, discrete=discrete, loaded=loaded)
        plants = [result] if isinstance(result, Plant) else list(result.plants)
        say("margins")
        closed_loops = [] if loops is None else loop_verdicts(result, loops)
        margins_by_plant = [_explained(one, say) for one in closed_loops]
        say("report")
        pages = {page: plant_report(result, margins_by_plant, model.name)}
    files = [result.write(output, force=force, also=pages), page]
    warnings = margin_warnings(plants, margins_by_plant)
    warnings = [*doubtful(compiled, poses or []), *warnings]
    tell(
        lambda: plant_record(result, margins_by_plant, warnings),
        lambda: _show(result, margins_by_plant, warnings, full=full),
        files,
        as_json,
    )
    if not all(margins.stable for margins in margins_by_plant):
        raise typer.Exit(3)


def _explained(one: "LoopVerdict", say: "Callable[[str], None]") -> "Margins":
    """Margins that say why their loop is unstable, the progress on the terminal."""
    pose = f" at {one.margins.pose}" if one.margins.pose else ""
    return one.explained(
        lambda done, count: say(f"why the loop is unstable{pose}: pole {done + 1} of {count}")
    )


def _show(
    found: "Plant | ScheduledPlant",
    margins_by_plant: "list[Margins]",
    warnings: list[str],
    *,
    full: bool,
) -> None:
    """What the terminal shows before the names of the files."""
    from beamchain.control.realisation import Plant
    from beamchain.report.tables import plant as tables
    from beamchain.report.tables.first_screen import margin_lines, plant_lines

    first, scheduled = (found, None) if isinstance(found, Plant) else (found[0], found)
    print_all(*plant_lines(first), *margin_lines(margins_by_plant))
    if full:
        poses = None if scheduled is None else tables.pose_table(scheduled)
        print_all(tables.mode_table(first), poses)
    if full and margins_by_plant:
        print_all(
            tables.margin_table(margins_by_plant),
            tables.limiting_table(margins_by_plant) or None,
            tables.closed_loop_table(margins_by_plant),
        )
    _show_reasons(margins_by_plant)
    print_first((), warnings, full=full)


def _show_reasons(margins_by_plant: "list[Margins]") -> None:
    """Why loops are unstable, and which of them are so by others."""
    for margins in margins_by_plant:
        pose = f"{margins.pose}: " if margins.pose else ""
        print_all(*(f"{pose}{said}" for said in margins.reasons))
        others = [loop.name for loop in margins.loops if not (loop.stable or loop.causes)]
        if others:
            print_all(f"{pose}unstable because of other loops: {', '.join(others)}")
