"""`beamchain sweep`: variants of an appendage or of a whole craft,
as arrays for one compiled model."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.cli.common import Folder, Force
from beamchain.cli.embed import places
from beamchain.cli.output import job_bar, print_all, print_files, print_headed, print_warnings

if TYPE_CHECKING:
    from beamchain.variants.sweep import Sweep

Source = Annotated[
    Path,
    typer.Argument(
        metavar="SPEC.toml|CRAFT.xml",
        help="An appendage with \\[uncertain], or a spacecraft: bare with --mount, or as "
        "`beamchain embed` wrote it.",
    ),
]
Mounts = Annotated[
    list[str] | None,
    typer.Option(
        "--mount",
        metavar="NAME=SPEC.toml",
        help="Site or body of the spacecraft and its appendage, as for `embed`. Repeatable.",
    ),
]
Known = Annotated[
    Path | None,
    typer.Option(
        "--uncertain",
        metavar="CRAFT.toml",
        help="What is uncertain of the craft: \\[body.NAME], \\[joint.NAME], "
        "\\[appendage.PREFIX], \\[\\[correlation]].",
    ),
]
Gains = Annotated[
    list[str] | None,
    typer.Option(
        "--gain",
        metavar="INPUT=OUTPUT",
        help="Signals, named as for `plant`, whose modal gains are followed. Repeatable. "
        "Default: torque:BASE=attitude.",
    ),
]
Samples = Annotated[int, typer.Option(min=1, max=1_000_000, help="Number of variants.")]
Seed = Annotated[
    int,
    typer.Option(min=0, help="Random seed; the same seed gives the same variants on any machine."),
]


def sweep(
    source: Source,
    output: Folder,
    mount: Mounts = None,
    uncertain: Known = None,
    gain: Gains = None,
    samples: Samples = 1000,
    seed: Seed = 0,
    force: Force = False,
) -> None:
    """Draw random variants of an appendage or of a whole spacecraft,
    and write them as arrays for one compiled model.

    Writes scene.xml or flexible.xml, variants.npz, apply_variants.py, pictures and sweep.json into
    DIR. Uncertain modes, masses and drives only change numbers; an uncertain structure is fitted
    again for every sample, in a process per core (LOKY_MAX_CPU_COUNT sets fewer).

    Example: beamchain sweep craft.xml --mount mount=array.toml --uncertain craft.toml -o variants
    """
    from joblib import cpu_count

    from beamchain.engine.jobs import MOST_WORKERS
    from beamchain.files import check_free
    from beamchain.variants.sweep import sweep as draw

    wanted = places(mount) if mount else None
    check_free(output / "sweep.json", force=force)
    with job_bar("making variants") as progress:
        result = draw(
            source,
            samples,
            mounts=wanted,
            uncertain=uncertain,
            gains=gain,
            seed=seed,
            workers=min(cpu_count(), MOST_WORKERS),
            progress=progress,
        )
    files = result.write(output, force=force)
    _show(result)
    print_files(files)


def _show(result: "Sweep") -> None:
    from beamchain.report.tables.sweep import spread_tables

    record = result.as_dict()
    print_headed(
        result.name,
        f"{record['variants']} variants of {record['samples']} samples in {result.seconds:.1f} s",
    )
    left_out = (f"sample {entry['sample']}: {entry['why']}" for entry in record["left_out"][:10])
    print_all(*spread_tables(result), *(f"left out: {said}" for said in left_out))
    print_warnings(result.warnings, "note")
