"""`beamchain pointing`: the jitter budget of a spacecraft."""

from pathlib import Path
from typing import Annotated

import typer

from beamchain.commands import Force, Model, print_all, print_files, print_warnings, spinner

Output = Annotated[Path, typer.Option("-o", "--output", metavar="OUT.html", help="Its page.")]
Sources = Annotated[
    Path,
    typer.Option("--disturbances", metavar="DISTURBANCES.toml", help="What disturbs the pointing."),
]
Outputs = Annotated[
    list[str] | None,
    typer.Option(
        "--to",
        metavar="NAME",
        help="A sensor, attitude, rate or motion:SITE. Repeatable; default: attitude.",
    ),
]
Poses = Annotated[
    list[str] | None,
    typer.Option(
        "--pose",
        metavar="JOINT=45,...",
        help="Pose to linearise in: joints in degrees (slides in m), or the name of a keyframe; "
        "default: rest.",
    ),
]
Window = Annotated[
    float, typer.Option(metavar="TIME", help="Window of the relative pointing error in s.")
]


def pointing(
    model: Model,
    output: Output,
    disturbances: Sources,
    outputs: Outputs = None,
    pose: Poses = None,
    window: Window = 1.0,
    force: Force = False,
) -> None:
    """Compute the pointing errors that disturbances make, source by source.

    Writes its page.

    Example: beamchain pointing flexible.xml --disturbances jitter.toml -o jitter.html
    """
    from beamchain.commands import poses_given
    from beamchain.files import check_outputs, write_files
    from beamchain.pointing.jitter_sources import read_disturbances
    from beamchain.pointing.page import pointing_page
    from beamchain.pointing.pointing import budget
    from beamchain.toolkit import compiled_model

    check_outputs([output], force=force, inputs=[model, disturbances])
    sources = read_disturbances(disturbances)
    with spinner("pointing"):
        compiled = compiled_model(model)
        place = poses_given(compiled, pose or [])
        found = budget(compiled, sources, outputs or None, place, window=window)
        page = pointing_page(found, model.name)
        write_files({output: page}, force=force, inputs=[model, disturbances])
    print_all(found.table, found.mode_table)
    print_warnings(found.warnings, "note")
    print_files([output])
