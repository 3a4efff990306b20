"""`beamchain inspect`: modes, masses and step limits of a MuJoCo model."""

from pathlib import Path
from typing import Annotated

import typer

from beamchain.cli.common import Json, Quiet, console, print_json


def inspect(
    model: Annotated[Path, typer.Argument(metavar="MODEL.xml", help="Any MuJoCo model.", show_default=False)],
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Print modes, masses and step limits of any MuJoCo model with hinge chains.

    Example: beamchain inspect boom/scene.xml
    """
    from beamchain.craft.inspect import inspect_model

    found = inspect_model(model)
    if as_json:
        print_json(found.as_dict())
        return
    if quiet:
        return
    from rich.markup import escape
    from rich.table import Table

    out = console()
    out.print(
        f"[bold]{found.name}[/bold]: {found.bodies} bodies, {found.joints} joints, "
        f"{found.dofs} degrees of freedom, mass {found.mass:.6g} kg"
    )
    for whole in found.composite:
        out.print(escape(whole.sentence))
    modes = Table(title="modes about the rest pose", title_justify="left")
    for column in ("mode", "rad/s", "Hz", "damping ratio"):
        modes.add_column(column, justify="right")
    for i, (w, z) in enumerate(zip(found.frequencies, found.damping, strict=True), 1):
        modes.add_row(str(i), f"{w:.6g}", f"{w / 6.283185307179586:.6g}", f"{z:.3g}")
    out.print(modes)
    hinges = Table(title="sprung joints", title_justify="left")
    for column in ("joint", "stiffness", "damping"):
        hinges.add_column(column, justify="left" if column == "joint" else "right")
    for name, stiffness, damping in found.springs:
        hinges.add_row(name, f"{stiffness:.6g}", f"{damping:.6g}")
    out.print(hinges)
    if found.tendons:
        tendons = Table(title="sprung tendons", title_justify="left")
        for column in ("tendon", "stiffness", "damping", "armature"):
            tendons.add_column(column, justify="left" if column == "tendon" else "right")
        for name, *values in found.tendons:
            tendons.add_row(name, *(f"{value:.6g}" for value in values))
        out.print(tendons)
    for made in found.made_for:
        out.print(
            f"appendages exact in time for {made.integrator} at {made.timestep:g} s; the modes above are without that"
        )
    for warning in found.warnings:
        out.print(f"[bold]note[/bold]: {escape(warning)}")
    limits = Table(title=f"steps (the model asks for {found.integrator}, {found.timestep:g} s)", title_justify="left")
    for column in ("integrator", "largest stable s", "1 % frequency s", "0.1 % frequency s"):
        limits.add_column(column, justify="left" if column == "integrator" else "right")
    for name, step in found.limits.largest_step.items():
        one, tenth = found.limits.accuracy.get(name, (float("inf"), float("inf")))
        limits.add_row(name, f"{step:.5g}" if step < 1e9 else "no limit", f"{one:.4g}", f"{tenth:.4g}")
    out.print(limits)
