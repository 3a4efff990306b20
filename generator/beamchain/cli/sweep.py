"""`beamchain sweep`: variants of an appendage for domain randomisation."""

from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.cli.common import Dask, Folder, Force, Json, Quiet, Resume, SpecPath, console, print_json, print_written
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
    if as_json:
        print_json(result.as_dict())
    elif not quiet:
        _show(result)
        print_written(files)


def _show(result: "Sweep") -> None:
    from rich.table import Table

    out = console()
    record = result.as_dict()
    out.print(
        f"[bold]{result.spec.name}[/bold]: {record['variants']} variants of {record['samples']} samples in "
        f"{result.seconds:.1f} s"
    )
    table = Table(title="frequencies on the hub, rad/s", title_justify="left")
    for name in ("mode", "mean", "deviation", *(f"{100 * q:g} %" for q in record["quantiles"])):
        table.add_column(name, justify="right")
    for k, spread in enumerate(record["coupled_frequencies"]):
        numbers = [spread["mean"], spread["deviation"], *spread["quantiles"]]
        table.add_row(str(k + 1), *(f"{value:.5g}" for value in numbers))
    out.print(table)
    for entry in record["left_out"][:10]:
        out.print(f"left out: sample {entry['sample']}: {entry['why']}")
