"""What commands on a linear spacecraft share: its file, signals and poses."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.errors import InputError

if TYPE_CHECKING:
    from beamchain.engine.library import mujoco
    from beamchain.engine.operating_point import At

Model = Annotated[Path, typer.Argument(metavar="FILE.xml", help="The spacecraft's MJCF file.")]
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


def place_of(model: "mujoco.MjModel", poses: list[str], at: str | None, angle: str | None) -> "At":
    """What `at` of `bc.plant` takes for the options: one pose, or several.

    Raises:
        InputError: options that do not go together, or a pose that is given twice.
    """
    from beamchain.cli.poses import grid_of, pose_of

    given = {"--pose": bool(poses), "--at": at is not None, "--angle": angle is not None}
    if sum(given.values()) > 1:
        several = " and ".join(option for option, there in given.items() if there)
        raise InputError(
            f"{several} are given together; leave one out, or give every pose as a --pose."
        )
    if angle is not None:
        return grid_of(model, angle)
    if at is not None:
        return at
    each = [pose_of(model, text) for text in poses]
    for i, (text, one) in enumerate(zip(poses, each, strict=True)):
        if one in each[:i]:
            raise InputError(f"--pose {text!r} is given twice; give each pose once.")
    return each if len(each) > 1 else each[0] if each else None
