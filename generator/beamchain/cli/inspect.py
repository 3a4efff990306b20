"""`beamchain inspect`: modes, masses and step limits of a MuJoCo model."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.cli.common import Force, Json
from beamchain.cli.embed import Loaded
from beamchain.cli.output import print_all, print_headed, print_warnings, spinner, tell
from beamchain.errors import InputError

if TYPE_CHECKING:
    from beamchain.craft.embedded import Embedded
    from beamchain.craft.inspect import Inspection
    from beamchain.craft.stability import StabilityStudy

Prove = Annotated[
    bool,
    typer.Option(
        "--prove",
        help="Prove a file of `embed` as it stands, after it was edited: against the exact "
        "appendages that its marks name. Exit status 3: above the tolerance of their scenes.",
    ),
]


Steps = Annotated[
    bool,
    typer.Option(
        "--steps",
        help="Print the largest stable steps of every integrator, the damping that steps add and "
        "the limits of large motion; slew the hinges of a file of `embed`.",
    ),
]
Output = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        metavar="DIR",
        help="Folder for report.html and stability.json of --steps.",
    ),
]


def inspect(
    model: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL.xml", help="Any MuJoCo model; with --steps also a SPEC.toml."
        ),
    ],
    prove: Prove = False,
    loaded: Loaded = False,
    steps: Steps = False,
    output: Output = None,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Print modes, masses and step limits of any MuJoCo model with hinge chains.

    Example: beamchain inspect boom/scene.xml

    Example: beamchain inspect boom.toml --steps -o boom-steps
    """
    from beamchain.craft.inspect import inspect_model

    if loaded and not prove:
        raise InputError("--loaded proves under a load; give --prove with it.")
    if output is not None and not steps:
        raise InputError("inspect: --output is of --steps; give --steps too.")
    if not steps and model.suffix.lower() == ".toml":
        raise InputError(f"inspect: {model} is no MuJoCo model; give --steps for a specification.")
    if steps:
        if prove:
            raise InputError("inspect: --prove and --steps are both given; leave one out.")
        _steps(model, output, as_json=as_json, force=force)
        return
    found = inspect_model(model)
    record = found.as_dict()
    proof = None
    if prove:
        from beamchain.craft.proof import prove as prove_file

        with spinner("proving the file"):
            proof = prove_file(model, loaded=loaded)
            record["proof"] = proof.as_dict()
    tell(lambda: record, lambda: _show(found, proof), (), as_json)
    if proof is not None and proof.met is False:
        raise typer.Exit(3)


def _steps(source: Path, output: Path | None, *, as_json: bool, force: bool) -> None:
    from beamchain.craft.stability import stability
    from beamchain.files import check_free, to_json, write_files
    from beamchain.report.pages.stability import stability_report

    if output is not None:
        check_free(output / "stability.json", force=force)
    files: dict[Path, str | bytes] = {}
    with spinner("reading") as say:
        result = stability(source, say)
        record = result.as_dict()
        if output is not None:
            files[output / "report.html"] = stability_report(result, source)
            files[output / "stability.json"] = to_json(record)
            write_files(files, force=force)
    tell(lambda: record, lambda: _show_steps(result), files, as_json)


def _show_steps(result: "StabilityStudy") -> None:
    from beamchain.report.tables import stability as tables
    from beamchain.report.tables.steps import step_table

    steps = step_table({each.name: each for each in result.budgets}, "Largest time step")
    print_all(result.own_step, steps, *map(tables.damping_table, result.budgets))
    print_all(
        tables.LIFTED if result.is_retimable else None,
        tables.large_motion_table(result) if result.large else None,
    )
    if result.slews:
        print_all(tables.chain_table(result), tables.slew_table(result))
    print_warnings(result.warnings, "note")


def _show(found: "Inspection", proof: "Embedded | None") -> None:
    from beamchain.report.tables import inspect as tables
    from beamchain.report.tables.embed import coupled_table, pose_table
    from beamchain.report.tables.steps import step_table, timing_sentences

    print_headed(
        found.name,
        f"{found.bodies} bodies, {found.joints} joints, {found.dofs} degrees of freedom, mass "
        f"{found.mass:.6g} kg",
    )
    without = "modes and steps in these tables are without it, and --prove says what it keeps"
    print_all(
        *(whole.sentence for whole in found.composite),
        tables.mode_table(found),
        tables.spring_table(found) if found.springs else None,
        tables.tendon_table(found) if found.tendons else None,
        *timing_sentences(found.made_for, without),
    )
    print_warnings(found.warnings, "note")
    title = f"Largest time steps (the model asks for {found.integrator}, {found.timestep:g} s)"
    print_all(step_table({"": found.limits}, title))
    if proof is not None:
        print_all(coupled_table(proof.assembly), pose_table(proof), proof.time_error.words)
        print_warnings((w for w in proof.warnings if w not in found.warnings), "note")
        print_all(proof.headline)
