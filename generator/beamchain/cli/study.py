"""`beamchain study`: error against run time."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.cli.common import Folder, Force, SpecPath, read_text
from beamchain.cli.output import job_bar, print_all, print_files, print_headed, print_warnings

if TYPE_CHECKING:
    from beamchain.studies.study import Study

Profile = Annotated[
    Path | None,
    typer.Option(
        metavar="CSV", help="Wrench on the hub: columns time, fx fy fz [N], mx my mz [N m]."
    ),
]
Budget = Annotated[
    float, typer.Option(metavar="SECONDS", help="Computing time per model and integrator.")
]
Only = Annotated[
    list[str] | None,
    typer.Option("--model", metavar="NAME", help="Measure this model only. Repeatable."),
]


def study(
    spec: SpecPath,
    output: Folder,
    profile: Profile = None,
    budget: Budget = 0.1,
    model: Only = None,
    force: Force = False,
) -> None:
    """Measure error against run time for many models of an appendage on its hub,
    including chains of equal links.

    Writes study.html, study.json, a picture and the recommended specs into DIR.

    Example: beamchain study boom.toml -o study
    """
    from beamchain.checks import positive
    from beamchain.files import check_free
    from beamchain.fitting.spec import read_spec
    from beamchain.studies.study import study as measure

    read = read_spec(spec)
    positive("--budget", budget, "s")
    check_free(output / "study.json", force=force)
    text = None if profile is None else read_text(profile, "--profile")
    with job_bar("measuring") as progress:
        result = measure(
            read,
            models=model or (),
            budget=budget,
            profile=text,
            progress=progress,
        )
    files = result.write(output, force=force)
    show(result)
    print_files(files)


def show(result: "Study") -> None:
    """The answer as tables."""
    from beamchain.report.pages.study import answer, commands, how_to_feed, scenario_sentence
    from beamchain.report.tables.study import reach_table

    print_headed(result.spec.name, answer(result))
    hub = ", ".join(f"{name} {1e6 * seconds:.2f} us" for name, seconds in result.rigid_hub.items())
    alone = f"a step of the rigid hub alone: {hub}"
    print_all(scenario_sentence(result), reach_table(result), alone)
    print_warnings(result.warnings)
    print_all(*commands(result), *how_to_feed(result))
