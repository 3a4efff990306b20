"""`beamchain worst-case`: the worst gain of a controlled spacecraft with uncertain properties."""

from pathlib import Path
from typing import Annotated

import typer

from beamchain.commands import (
    Force,
    Inputs,
    Model,
    Outputs,
    Poses,
    print_all,
    print_files,
    print_warnings,
    spinner,
)
from beamchain.errors import InputError

Loops = Annotated[
    Path,
    typer.Option("--controller", metavar="LOOPS.toml", help="The loops that are closed."),
]
Uncertain = Annotated[
    Path, typer.Option("--uncertain", metavar="CRAFT.toml", help="What is uncertain.")
]
Output = Annotated[Path, typer.Option("-o", "--output", metavar="OUT.html", help="Its page.")]
Between = Annotated[
    str | None,
    typer.Option(
        "--between",
        metavar="INPUT:OUTPUT",
        help="Signals of the plant between which the worst gain is sought; default: those of the "
        "first loop.",
    ),
]
Bound = Annotated[
    bool,
    typer.Option("--bound", help="Prove what no value exceeds as well (the extra robust)."),
]


def worst_case(
    model: Model,
    output: Output,
    controller: Loops,
    uncertain: Uncertain,
    inputs: Inputs = None,
    outputs: Outputs = None,
    poses: Poses = None,
    between: Between = None,
    bound: Bound = False,
    force: Force = False,
) -> None:
    """Search the worst that a controller meets in a spacecraft with uncertain properties, and run
    it in MuJoCo.

    Writes its page. Exit status 3: the loop is unstable for some values.

    Example: beamchain worst-case flexible.xml --from torque:bus --controller loops.toml
    --uncertain craft.toml -o worst.html
    """
    from beamchain import Plant, robust
    from beamchain import plant as linearise
    from beamchain.commands import doubtful, poses_given
    from beamchain.files import check_outputs, write_files
    from beamchain.robust.page import worst_case_page
    from beamchain.toolkit import compiled_model, read_controller, signals_with

    ends = _ends(between)
    check_outputs([output], force=force, inputs=[model, controller, uncertain])
    loops = read_controller(controller)
    driven, seen = signals_with(loops, inputs or None, outputs or None)
    with spinner("linearising") as say:
        compiled = compiled_model(model)
        pose = poses_given(compiled, poses or [])
        plant = linearise(compiled, driven, seen, pose)
        say("worst case")

        def tell_of(text: str) -> None:
            say(f"worst case: {text}")

        if isinstance(plant, Plant):
            made = robust.uncertain(plant, uncertain)
            cases = [made.worst_case(loops, *ends, bound=bound, progress=tell_of)]
        else:
            found = robust.worst_case(plant, uncertain, loops, *ends, bound=bound, progress=tell_of)
            cases = [*found]
        plants = [plant] if isinstance(plant, Plant) else plant.plants
        told = dict.fromkeys(text for each in plants for text in each.warnings)
        warnings = [*doubtful(compiled, poses or []), *told]
        page = worst_case_page(cases, model.name, warnings)
        write_files({output: page}, force=force, inputs=[model, controller, uncertain])
    print_all(*(f"worst case, {case.sentence}" for case in cases))
    print_all(*(case.table for case in cases))
    print_warnings(warnings, "note")
    print_files([output])
    if not all(case.stable for case in cases):
        raise typer.Exit(3)


def _ends(between: str | None) -> tuple[str | None, str | None]:
    """Input and output that --between names."""
    if between is None:
        return None, None
    source, _, target = between.partition(":")
    if not (source and target):
        raise InputError(
            f"--between {between!r} is INPUT:OUTPUT of the plant, for example torque_z:attitude_z."
        )
    return source, target
