"""`beamchain retime`: make a model with appendages exact in time for another step."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from beamchain.cli.common import Force, Json, Quiet
from beamchain.cli.output import print_table, tell
from beamchain.errors import InputError


def retime(
    model: Annotated[Path, typer.Argument(metavar="MODEL.xml", help="A MuJoCo model with appendages.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="OUT.xml", help="Output file.")],
    timestep: Annotated[float, typer.Option(metavar="H", help="Step in s; 0 undoes the timing.")],
    integrator: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Integrator, by MuJoCo's name; default: the model's own."),
    ] = None,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Make the appendages of a model exact in time for a step and integrator, and set both in its `<option>`.

    The discrete poles of the modes are then those of the exact motion.
    Appendage modes that are too fast for the step are slowed, so that only the spacecraft's own
    springs limit the step; a step beyond that limit is refused.
    Give actuators the mean of this and the previous input (`bc.HeldInput`).

    Example: beamchain retime flexible.xml --timestep 0.1 --integrator Euler -o flexible_0.1.xml
    """
    from beamchain.files import write_files
    from beamchain.steps.retime_file import retimed_file

    if not timestep >= 0.0 or timestep == float("inf"):
        raise InputError(f"--timestep {timestep!r} must be zero or a positive number of seconds.")
    text, rows = retimed_file(model, timestep, integrator, output.parent)
    write_files({output: text}, force=force)

    def show() -> None:
        modes = [
            (f"{r.frequency:.8g}", f"{r.achieved_frequency:.8g}", f"{r.ratio:.4g}", f"{r.achieved_ratio:.4g}",
             "yes" if r.slowed else "")
            for r in rows
        ]  # fmt: skip
        head = ("rad/s", "achieved rad/s", "damping ratio", "achieved", "slowed")
        print_table("modes of the whole model at this step", head, modes, left=())

    record = {"timestep": timestep, "integrator": integrator, "modes": [asdict(row) for row in rows]}
    tell(lambda: record, show, [output], as_json, quiet)
