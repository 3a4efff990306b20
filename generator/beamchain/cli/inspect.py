"""`beamchain inspect`: modes, masses and step limits of a MuJoCo model."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.cli.common import Json, Quiet, console
from beamchain.cli.output import print_headed, print_table, print_warnings, tell

if TYPE_CHECKING:
    from beamchain.craft.inspect import Inspection


def inspect(
    model: Annotated[Path, typer.Argument(metavar="MODEL.xml", help="Any MuJoCo model.")],
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Print modes, masses and step limits of any MuJoCo model with hinge chains.

    Example: beamchain inspect boom/scene.xml
    """
    from beamchain.craft.inspect import inspect_model

    found = inspect_model(model)
    tell(found.as_dict, lambda: _show(found), (), as_json, quiet)


def _show(found: "Inspection") -> None:
    from beamchain.report.tables import inspect as tables
    from beamchain.report.tables.steps import step_table

    out = console()
    print_headed(
        found.name,
        f"{found.bodies} bodies, {found.joints} joints, {found.dofs} degrees of freedom, mass "
        f"{found.mass:.6g} kg",
    )
    for whole in found.composite:
        out.print(whole.sentence)
    print_table(tables.mode_table(found))
    if found.springs:
        print_table(tables.spring_table(found))
    if found.tendons:
        print_table(tables.tendon_table(found))
    for made in found.made_for:
        out.print(
            f"appendages exact in time for {made.integrator} at {made.timestep:g} s; "
            "modes and steps in these tables are without that"
        )
    print_warnings(found.warnings, "note")
    title = f"Largest time steps (the model asks for {found.integrator}, {found.timestep:g} s)"
    print_table(step_table(found.limits, title))
