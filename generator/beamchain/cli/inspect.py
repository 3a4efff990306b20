"""`beamchain inspect`: modes, masses and step limits of a MuJoCo model."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.cli.common import Json, Quiet, console
from beamchain.cli.output import print_table, print_warnings, tell

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
    from rich.markup import escape

    out = console()
    out.print(
        f"[bold]{found.name}[/bold]: {found.bodies} bodies, {found.joints} joints, "
        f"{found.dofs} degrees of freedom, mass {found.mass:.6g} kg"
    )
    for whole in found.composite:
        out.print(escape(whole.sentence))
    modes = [
        (str(i), f"{w:.6g}", f"{w / math.tau:.6g}", f"{z:.3g}")
        for i, (w, z) in enumerate(zip(found.frequencies, found.damping, strict=True), 1)
    ]
    print_table("modes about the rest pose", ("mode", "rad/s", "Hz", "damping ratio"), modes, left=())
    sprung, tendons = (
        [(name, *(f"{value:.6g}" for value in values)) for name, *values in rows]
        for rows in (found.springs, found.tendons)
    )
    print_table("sprung joints", ("joint", "stiffness", "damping"), sprung)
    if tendons:
        print_table("sprung tendons", ("tendon", "stiffness", "damping", "armature"), tendons)
    for made in found.made_for:
        out.print(
            f"appendages exact in time for {made.integrator} at {made.timestep:g} s; "
            "modes and steps in these tables are without that"
        )
    print_warnings(found.warnings, "note")
    never = float("inf"), float("inf")
    steps = [
        (
            name,
            f"{step:.5g}" if step < 1e9 else "no limit",
            *(f"{h:.4g}" for h in found.limits.accuracy.get(name, never)),
        )
        for name, step in found.limits.largest_step.items()
    ]
    title = f"steps (the model asks for {found.integrator}, {found.timestep:g} s)"
    print_table(title, ("integrator", "largest stable s", "1 % frequency s", "0.1 % frequency s"), steps)
