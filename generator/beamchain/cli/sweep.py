"""`beamchain sweep`: variants of an appendage for domain randomisation."""

from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.cli.common import Dask, Folder, Force, Json, Quiet, Resume, SpecPath, console
from beamchain.cli.output import print_table, tell
from beamchain.cli.progress import job_bar

if TYPE_CHECKING:
    from beamchain.studies.sweep import Sweep

Samples = Annotated[int, typer.Option(min=1, max=1_000_000, help="Number of variants.")]
Seed = Annotated[int, typer.Option(min=0, help="Random seed; the same seed gives the same variants on any machine.")]
Workers = Annotated[int, typer.Option(min=1, max=256, help="Local processes.")]


def sweep(
    spec: SpecPath,
    output: Folder,
    samples: Samples = 1000,
    seed: Seed = 0,
    workers: Workers = 2,
    dask: Dask = None,
    resume: Resume = False,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
) -> None:
    """Draw random variants of an appendage, fit each, and write them as arrays for one compiled model.

    Writes scene.xml, variants.npz, apply_variants.py, a picture and sweep.json into DIR.

    Example: beamchain sweep array.toml --samples 1000 -o variants
    """
    from beamchain.files import check_free
    from beamchain.fitting.spec import read_spec
    from beamchain.studies.jobs import workers as pool
    from beamchain.studies.sweep import sweep as draw

    read = read_spec(spec)
    check_free(output / "sweep.json", force=force)
    with pool(workers, dask) as executor, job_bar("fitting variants", quiet or as_json) as progress:
        result = draw(read, samples, seed=seed, executor=executor, folder=output, resume=resume, progress=progress)
    files = result.write(output, force=force)
    tell(result.as_dict, lambda: _show(result), files, as_json, quiet)


def _show(result: "Sweep") -> None:
    record = result.as_dict()
    console().print(
        f"[bold]{result.spec.name}[/bold]: {record['variants']} variants of {record['samples']} samples in "
        f"{result.seconds:.1f} s"
    )
    spreads = enumerate(record["coupled_frequencies"], 1)
    rows = [[str(k), *(f"{v:.5g}" for v in (s["mean"], s["deviation"], *s["quantiles"]))] for k, s in spreads]
    head = ("mode", "mean", "deviation", *(f"{100 * q:g} %" for q in record["quantiles"]))
    print_table("frequencies on the hub, rad/s", head, rows, left=())
    for entry in record["left_out"][:10]:
        console().print(f"left out: sample {entry['sample']}: {entry['why']}")
