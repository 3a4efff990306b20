"""`beamchain retime`: make a model with appendages exact in time for another step."""

from pathlib import Path
from typing import Annotated

import typer

from beamchain.cli.common import Force, Json
from beamchain.cli.output import print_all, print_warnings, tell
from beamchain.errors import InputError


def retime(
    model: Annotated[
        Path, typer.Argument(metavar="MODEL.xml", help="A MuJoCo model with appendages.")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="OUT.xml", help="Output file.")],
    timestep: Annotated[
        float,
        typer.Option(metavar="H", help="Step in s of the exact appendages; 0 undoes it."),
    ],
    integrator: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", help="Integrator, by MuJoCo's name; default: the model's own."
        ),
    ] = None,
    retime_joints: Annotated[
        bool,
        typer.Option(
            "--retime-joints",
            help="Put armature on the spacecraft's own sprung and servo-driven joints as well, so "
            "that their step error is of fourth order too.",
        ),
    ] = False,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Make the appendages of a model exact in time for a step and integrator,
    and set both in its `<option>`.

    The discrete poles of the modes are then those of the exact motion, as far as the step allows;
    what was reached is read back and printed, with the error of the response where the file says
    what its appendages are. Exit status 3: it is above the tolerance of their scenes.
    Appendage modes that are too fast for the step are slowed, so that only the spacecraft's own
    springs limit the step; a step beyond that limit is refused.
    Give actuators the mean of this and the previous input (`bc.HeldInput`), RK4 excepted.

    Example: beamchain retime flexible.xml --timestep 0.1 --integrator Euler -o flexible_0.1.xml
    """
    from beamchain.craft.retiming import retime_craft
    from beamchain.files import check_outputs, write_files
    from beamchain.report.headlines import retimed_headline
    from beamchain.report.tables.record import retime_record
    from beamchain.report.tables.retime import pole_table

    if not timestep >= 0.0 or timestep == float("inf"):
        raise InputError(f"--timestep {timestep!r} must be zero or a positive number of seconds.")
    check_outputs([output], force=force, inputs=[model], update=(model, output))
    done = retime_craft(model, timestep, integrator, output.parent, joints=retime_joints)
    write_files({output: done.file.text}, force=force, update=(model, output))

    def show() -> None:
        print_all(pole_table(done.file.rows), retimed_headline(done))
        print_warnings(done.warnings)

    record = {"timestep": timestep, "integrator": integrator, **retime_record(done)}
    tell(lambda: record, show, [output], as_json)
    if done.met is False:
        raise typer.Exit(3)
