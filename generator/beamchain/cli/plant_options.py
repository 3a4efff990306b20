"""What commands on a linear spacecraft share: its file, signals and poses."""

from pathlib import Path
from typing import Annotated

import typer

Model = Annotated[Path, typer.Argument(metavar="FILE.xml", help="The spacecraft's MJCF file.")]
Inputs = Annotated[
    list[str] | None,
    typer.Option(
        "--from",
        metavar="NAME",
        help="An actuator, torque:BODY, force:BODY or wrench:SITE. Repeatable; default: the "
        "\\[allocation] tables of LOOPS.toml, else all actuators.",
    ),
]
Outputs = Annotated[
    list[str] | None,
    typer.Option(
        "--to",
        metavar="NAME",
        help="A sensor, attitude, rate or motion:SITE. Repeatable; default: the \\[alignment] "
        "tables of LOOPS.toml, else attitude and rate.",
    ),
]
Poses = Annotated[
    list[str] | None,
    typer.Option(
        "--pose",
        metavar="JOINT=45,...",
        help="Pose to linearise in: joints in degrees (slides in m), or the name of a keyframe; "
        "default: rest. Repeatable, or JOINT=0,45,90: a plant for each, modes followed in this "
        "order.",
    ),
]
