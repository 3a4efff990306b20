"""`beamchain plant`: the spacecraft as a control engineer's plant."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from beamchain.caution import warnings_record
from beamchain.cli.common import Force, Json, Quiet, console
from beamchain.cli.output import print_table, print_warnings, spinner, tell
from beamchain.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from beamchain.engine.library import mujoco
    from beamchain.engine.operating_point import At
    from beamchain.plants.margins import Margins
    from beamchain.plants.pointing import Pointing
    from beamchain.plants.realisation import Plant
    from beamchain.plants.scheduled import ScheduledPlant
    from beamchain.plants.uncertain_plant import WorstCase
    from beamchain.plants.verdicts import LoopVerdict


Inputs = Annotated[
    list[str] | None,
    typer.Option(
        "--input",
        metavar="NAME",
        help="An actuator, torque:BODY, force:BODY or wrench:SITE. Repeatable; default: the "
        "\\[allocation] tables of LOOPS.toml, else all actuators.",
    ),
]
Outputs = Annotated[
    list[str] | None,
    typer.Option(
        "--output",
        metavar="NAME",
        help="A sensor, attitude, rate or motion:SITE. Repeatable; default: the \\[alignment] "
        "tables of LOOPS.toml, else attitude and rate.",
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
Poses = Annotated[
    list[str] | None,
    typer.Option(
        "--pose",
        metavar="JOINT=45,...",
        help="Pose to linearise in: joints in degrees (slides in m), or the name of a keyframe; "
        "default: rest. Repeatable: a plant for each, modes followed in this order.",
    ),
]
Keyframe = Annotated[
    str | None, typer.Option(metavar="KEY", help="Keyframe to linearise at, as one --pose.")
]
Angle = Annotated[
    str | None,
    typer.Option(
        metavar="JOINT=0,45,90", help="Positions of one joint, as a --pose JOINT=... of each."
    ),
]
Loaded = Annotated[
    bool,
    typer.Option(
        "--loaded",
        help="Linearise under the load of the pose: gravity where the spacecraft is held, or the "
        "ctrl of the keyframe, such as a constant thrust. Liquids of tanks swing by it alone.",
    ),
]
Discrete = Annotated[float | None, typer.Option(metavar="STEP", help="Sampled at this step in s.")]
Loops = Annotated[
    Path | None,
    typer.Option(
        metavar="LOOPS.toml",
        help="Loops whose margins are computed, and signals that are combined for them "
        "(\\[allocation], \\[alignment]).",
    ),
]
DisturbanceFile = Annotated[
    Path | None,
    typer.Option(
        "--disturbances",
        metavar="DISTURBANCES.toml",
        help="What disturbs the pointing: the budget of the outputs is computed.",
    ),
]
Window = Annotated[
    float, typer.Option(metavar="TIME", help="Window of the relative pointing error in s.")
]
Report = Annotated[bool, typer.Option(help="Write OUT_report.html as well.")]


def plant(
    model: Model,
    output: Output,
    inputs: Inputs = None,
    outputs: Outputs = None,
    poses: Poses = None,
    at: Keyframe = None,
    angle: Angle = None,
    discrete: Discrete = None,
    loaded: Loaded = False,
    controller: Loops = None,
    uncertain: Uncertain = None,
    disturbance: Worst = None,
    disturbances: DisturbanceFile = None,
    window: Window = 1.0,
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

    Example: beamchain plant flexible.xml --pose north=45,south=-45 --pose north=0,south=90 -o
    plant.mat

    Example: beamchain plant flexible.xml --disturbances jitter.toml -o plant.npz
    """
    from beamchain.cli.poses import doubtful
    from beamchain.craft.source import compiled_model
    from beamchain.files import beside, check_outputs
    from beamchain.plants.controllers import read_controller, signals_with, takes_time
    from beamchain.plants.jitter_sources import read_disturbances
    from beamchain.plants.plant import plant as linearise
    from beamchain.plants.pointing import pointing
    from beamchain.plants.realisation import Plant
    from beamchain.plants.verdicts import loop_verdicts, margin_warnings
    from beamchain.report.pages.plant import plant_report

    _check_poses(poses or [], at, angle, single=disturbances is not None)
    _check_uncertain(uncertain, controller, bound=bound)
    source, target = _signals_between(disturbance, uncertain)
    page = beside(output, "_report.html")
    given = (controller, uncertain, disturbances)
    files_read = [model, *(place for place in given if place is not None)]
    check_outputs([output, *([page] if report else ())], force=force, inputs=files_read)
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
    sources = None if disturbances is None else read_disturbances(disturbances)
    silent = quiet or as_json
    with spinner("linearising", silent) as say:
        compiled = compiled_model(model)
        place = _place(compiled, poses or [], at, angle)
        result = linearise(compiled, driven, seen, place, discrete=discrete, loaded=loaded)
        plants = [result] if isinstance(result, Plant) else list(result.plants)
        say("margins")
        closed_loops = [] if loops is None else loop_verdicts(result, loops)
        margins_by_plant = [one.margins for one in closed_loops]
    # why a loop is unstable is asked once its margins are shown
    is_shown = not silent and not all(margins.stable for margins in margins_by_plant)
    if is_shown:
        _show_plants(result)
        _show_margins(margins_by_plant)
    with spinner("why the loop is unstable", silent) as say:
        margins_by_plant = [_explained(one, say) for one in closed_loops]
    with spinner("worst case and report", silent):
        cases: list[WorstCase] = []
        if loops is not None and uncertain is not None:
            if isinstance(result, Plant):
                one = result.uncertain(uncertain)
                cases = [one.worst_case(loops, source, target, bound=bound)]
            else:
                cases = [*result.worst_case(uncertain, loops, source, target, bound=bound)]
        budget = None
        if sources is not None:
            budget = pointing(compiled, sources, seen, place, window=window)
        pages: dict[Path, str] = {}
        if report:
            pages[page] = plant_report(result, margins_by_plant, model.name, cases, budget)
    files = [result.write(output, force=force, also=pages or None), *pages]
    warnings = margin_warnings(plants, margins_by_plant)
    warnings = [*doubtful(compiled, poses or [], angle), *warnings]
    tell(
        lambda: _record(result, plants[0], margins_by_plant, cases, warnings, budget),
        lambda: _show(result, margins_by_plant, cases, warnings, budget, is_shown=is_shown),
        files,
        as_json,
        quiet,
    )
    loops_stable = all(margins.stable for margins in margins_by_plant)
    if not loops_stable or not all(case.stable for case in cases):
        raise typer.Exit(3)


def _check_poses(poses: list[str], at: str | None, angle: str | None, *, single: bool) -> None:
    """Refuse options for poses that do not go together; `single`: whether only one is taken."""
    given = {"--pose": bool(poses), "--at": at is not None, "--angle": angle is not None}
    if sum(given.values()) > 1:
        several = " and ".join(option for option, there in given.items() if there)
        raise InputError(
            f"plant: {several} are given together; leave one out, or give every pose as a --pose."
        )
    if single and (angle is not None or len(poses) > 1):
        raise InputError(
            "plant: --disturbances takes one pose; leave --angle out, and give one --pose."
        )


def _check_uncertain(uncertain: Path | None, controller: Path | None, *, bound: bool) -> None:
    """Refuse options for a worst case that do not go together."""
    if uncertain is not None and controller is None:
        raise InputError(
            "plant: --uncertain needs --controller, whose worst case it seeks; in Python: "
            "plant.uncertain."
        )
    if bound and uncertain is None:
        raise InputError("plant: --bound needs --uncertain, whose worst case it bounds.")


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


def _place(model: "mujoco.MjModel", poses: list[str], at: str | None, angle: str | None) -> "At":
    """What `at` of `bc.plant` takes for the options: one pose, or several."""
    from beamchain.cli.poses import grid_of, pose_of

    if angle is not None:
        return grid_of(model, angle)
    if at is not None:
        return at
    each = [pose_of(model, text) for text in poses]
    for i, (text, one) in enumerate(zip(poses, each, strict=True)):
        if one in each[:i]:
            raise InputError(f"--pose {text!r} is given twice; give each pose once.")
    return each if len(each) > 1 else each[0] if each else None


def _record(
    result: "Plant | ScheduledPlant",
    first: "Plant",
    margins_by_plant: "list[Margins]",
    cases: "list[WorstCase]",
    warnings: list[str],
    budget: "Pointing | None",
) -> dict[str, Any]:
    """What --json prints."""
    from beamchain.plants.realisation import Plant
    from beamchain.report.tables import plant as tables

    scheduled = None if isinstance(result, Plant) else result
    grid = None if scheduled is None else scheduled.grid
    inputs = tables.signal_table("Inputs", first.input_names, first.input_units)
    outputs = tables.signal_table("Outputs", first.output_names, first.output_units)
    return {
        "inputs": inputs.records(),
        "outputs": outputs.records(),
        "states": list(first.state_names),
        "modes": tables.mode_table(first).records(),
        "allocations": {name: each.as_dict() for name, each in first.allocations.items()},
        "angles": None if grid is None else grid[0],
        "poses": None if scheduled is None else list(scheduled.labels),
        "pose_modes": None if scheduled is None else list(scheduled.modes),
        "frequencies": None if scheduled is None else scheduled.frequency,
        "margins": [_loop_records(margins) for margins in margins_by_plant] or [[]],
        "closed_loops": [
            {key: value for key, value in margins.as_dict().items() if key != "loops"}
            for margins in margins_by_plant
        ],
        "worst": [case.as_dict() for case in cases],
        "pointing": None if budget is None else budget.as_dict(),
        **warnings_record(warnings),
    }


def _loop_records(margins: "Margins") -> list[dict[str, Any]]:
    """The margins at every input, and the instabilities that its loop is to blame for."""
    return [
        loop.as_dict()
        | {
            "instabilities": [
                one.as_dict()
                for one in margins.instabilities
                if loop.input in one.causes or not one.causes
            ]
        }
        for loop in margins.loops
    ]


def _explained(one: "LoopVerdict", say: "Callable[[str], None]") -> "Margins":
    """Margins that say why their loop is unstable, the progress on the terminal."""
    pose = f" at {one.margins.pose}" if one.margins.pose else ""
    return one.explained(
        lambda done, count: say(f"why the loop is unstable{pose}: pole {done + 1} of {count}")
    )


def _show_plants(found: "Plant | ScheduledPlant") -> None:
    from beamchain.plants.realisation import Plant
    from beamchain.report.tables import plant as tables

    first = found if isinstance(found, Plant) else found[0]
    console().print(
        f"{first.nstates} states, {first.ninputs} inputs ({', '.join(first.input_names)}), "
        f"{first.noutputs} outputs ({', '.join(first.output_names)})",
    )
    print_table(tables.mode_table(first))
    if not isinstance(found, Plant):
        print_table(tables.pose_table(found))


def _show_margins(margins_by_plant: "list[Margins]") -> None:
    from beamchain.report.tables import plant as tables

    if margins_by_plant:
        print_table(tables.margin_table(margins_by_plant))
        if near := tables.limiting_table(margins_by_plant):
            print_table(near)
        print_table(tables.closed_loop_table(margins_by_plant))


def _show_reasons(margins_by_plant: "list[Margins]") -> None:
    """Why loops are unstable, and which of them are so by others."""
    for margins in margins_by_plant:
        pose = f"{margins.pose}: " if margins.pose else ""
        for said in margins.reasons:
            console().print(f"{pose}{said}")
        others = [loop.name for loop in margins.loops if not (loop.stable or loop.causes)]
        if others:
            console().print(f"{pose}unstable because of other loops: {', '.join(others)}")


def _show(
    found: "Plant | ScheduledPlant",
    margins_by_plant: "list[Margins]",
    cases: "list[WorstCase]",
    warnings: list[str],
    budget: "Pointing | None",
    *,
    is_shown: bool,
) -> None:
    """What the terminal shows before the names of the files; `is_shown`: the plants and the margins
    have been, so that only the reasons of unstable loops are left."""
    from beamchain.report.tables import plant as tables

    if is_shown:
        _show_reasons(margins_by_plant)
    else:
        _show_plants(found)
        _show_margins(margins_by_plant)
    for case in cases:
        where = f" ({case.pose})" if case.pose else ""
        console().print(f"worst case{where}, {case.sentence}")
    for case in cases:
        print_table(tables.worst_value_table(case))
    if budget is not None:
        print_table(budget.table)
        print_table(budget.mode_table)
        warnings = [*warnings, *(text for text in budget.warnings if text not in warnings)]
    print_warnings(warnings, "note")
