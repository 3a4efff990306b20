"""`beamchain inspect`: modes, masses and step limits of a MuJoCo model."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.cli.common import Json, Quiet, console
from beamchain.cli.embed import Loaded
from beamchain.cli.output import print_headed, print_table, print_warnings, spinner, tell
from beamchain.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from beamchain.craft.embedded import Embedded
    from beamchain.craft.inspect import Inspection

Prove = Annotated[
    bool,
    typer.Option(
        "--prove",
        help="Prove a file of `embed` as it stands, after it was edited: against the exact "
        "appendages that its marks name. Exit status 3: above the tolerance of their scenes.",
    ),
]


def inspect(
    model: Annotated[Path, typer.Argument(metavar="MODEL.xml", help="Any MuJoCo model.")],
    prove: Prove = False,
    loaded: Loaded = False,
    as_json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Print modes, masses and step limits of any MuJoCo model with hinge chains.

    Example: beamchain inspect boom/scene.xml
    """
    from beamchain.craft.inspect import inspect_model

    if loaded and not prove:
        raise InputError("--loaded proves under a load; give --prove with it.")
    found = inspect_model(model)
    if not prove:
        tell(found.as_dict, lambda: _show(found), (), as_json, quiet)
        return
    from beamchain.craft.proof import prove as prove_file

    with spinner("proving the file", quiet or as_json):
        proof = prove_file(model, loaded=loaded)
        record = {**found.as_dict(), "proof": proof.as_dict()}

    def show() -> None:
        _show(found)
        _show_proof(proof, said=found.warnings)

    tell(lambda: record, show, (), as_json, quiet)
    if proof.met is False:
        raise typer.Exit(3)


def _show(found: "Inspection") -> None:
    from beamchain.report.tables import inspect as tables
    from beamchain.report.tables.steps import step_table, timing_sentences

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
    without = "modes and steps in these tables are without it, and --prove says what it keeps"
    for line in timing_sentences(found.made_for, without):
        out.print(line)
    print_warnings(found.warnings, "note")
    title = f"Largest time steps (the model asks for {found.integrator}, {found.timestep:g} s)"
    print_table(step_table(found.limits, title))


def _show_proof(proof: "Embedded", said: "Sequence[str]") -> None:
    from beamchain.report.tables.embed import coupled_table, pose_table

    out = console()
    print_table(coupled_table(proof.assembly))
    print_table(pose_table(proof))
    out.print(proof.time_error.words, markup=False)
    print_warnings((w for w in proof.warnings if w not in said), "note")
    out.print(proof.headline, markup=False)
