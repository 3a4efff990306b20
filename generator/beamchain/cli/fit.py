"""`beamchain fit`: the main job."""

from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.cli.common import Folder, Force, Json, Quiet, SpecPath, console, print_json, print_written
from beamchain.cli.progress import spinner

if TYPE_CHECKING:
    from pathlib import Path

    from beamchain.fitting.result import Fit


Explain = Annotated[bool, typer.Option("--explain", help="Print why these modes were chosen for the scene.")]
Full = Annotated[
    bool,
    typer.Option(
        "--full", help="Keep every port, with all modes up to three times the scene's bandwidth (one to five)."
    ),
]


def fit(
    spec: SpecPath,
    output: Folder,
    as_json: Json = False,
    force: Force = False,
    quiet: Quiet = False,
    explain: Explain = False,
    full: Full = False,
) -> None:
    """Fit a hinge chain to an appendage, verify it in MuJoCo, and write the drop-in file and a report.

    Writes appendage.xml, scene.xml, report.html, pictures and fit.json into DIR.

    Example: beamchain fit boom.toml -o boom
    """
    from beamchain.fitting.fit import fit as fit_chain
    from beamchain.fitting.spec import read_spec

    with spinner("reading the spec", quiet or as_json) as say:
        read = read_spec(spec)
        if full:
            from beamchain.fitting.choose import everything

            read = everything(read)
        say("fitting the chain and reading it back from MuJoCo")
        result = fit_chain(read)
        say("drawing and writing")
        files = result.write(output, force=force)
    if as_json:
        print_json(result.as_dict())
    elif not quiet:
        _show(result, files)
        if explain:
            _explain(result)
    if not result.status.ok:
        raise typer.Exit(3)


def _show(result: "Fit", files: "list[Path]") -> None:
    from rich.markup import escape
    from rich.table import Table

    out = console()
    out.print(f"[bold]{result.spec.name}[/bold]: {escape(result.status.message)}")
    out.print(escape(result.headline))
    table = Table(title="modes, read back from MuJoCo (mjd_transitionFD)", title_justify="left")
    headings = (
        "port",
        "mode",
        "cantilever rad/s",
        "free rad/s",
        "participation",
        "readback, frequency",
        "readback, participation",
    )
    damping = result.spec.damping
    headings += ("damping wanted", "achieved") if damping is not None else ()
    for column in headings:
        table.add_column(column, justify="left" if column == "port" else "right")
    for port, achieved in result.achieved.items():
        error = result.error[port]
        for (i, j), df, dp in zip(error.matches, error.frequency_errors, error.participation_errors, strict=True):
            free = achieved.free_frequencies
            row = ", ".join(f"{v:.5g}" for v in achieved.participation[i])
            loose = f"{free[i]:.6g}" if i < free.size else "none"
            cells = [port, str(j + 1), f"{achieved.frequencies[i]:.6g}", loose, row, f"{df:+.1e}", f"{dp:.1e}"]
            if damping is not None:
                cells += [f"{damping.ratios(port, j + 1)[j]:.6g}", f"{achieved.damping[i]:.6g}"]
            table.add_row(*cells)
    out.print(table)
    chain = Table(title="chain", title_justify="left")
    for column in ("link", "from m", "length m", "mass kg", "inertia kg m2", "hinge behind it N m/rad"):
        chain.add_column(column, justify="right")
    for i, link in enumerate(result.chain.links):
        hinge = result.chain.hinges[i] if i < len(result.chain.hinges) else None
        springs = ", ".join(f"{p} {f'{c:.5g}' if c else 'free'}" for p, c in hinge.stiffness.items()) if hinge else "-"
        chain.add_row(
            str(i + 1), f"{link.start:.5g}", f"{link.length:.5g}", f"{link.mass:.5g}", f"{link.inertia[2]:.5g}", springs
        )
    out.print(chain)
    if result.chain.tendons:
        tendons = Table(title="tendons", title_justify="left")
        for column in ("tendon", "frequency rad/s", "damping 1/s", "armature"):
            tendons.add_column(column, justify="left" if column == "tendon" else "right")
        for tendon in result.chain.tendons:
            w = f"{tendon.stiffness**0.5:.6g}" if tendon.stiffness else "-"
            tendons.add_row(f"{result.spec.name}_{tendon.label}", w, f"{tendon.damping:.4g}", f"{tendon.armature:.4g}")
        out.print(tendons)
    if result.kept_for in ("free", "hub"):
        what = "free modes" if result.kept_for == "free" else "coupled modes on the hub given"
        out.print(
            f"target \"{result.kept_for}\": the {what} are the beam's. The cantilever modes above are the chain's own, which "
            "differ from the beam's; the readback errors compare them with the values computed for that chain."
        )
    for port, error in result.error.items() if result.promise is None else ():  # one in-band error: the promise
        band = result.bandwidth[port]
        on = "on the hub given" if result.spec.root.hub else "worst of three hubs"
        out.print(
            f"in-band error {port} up to {band:.4g} rad/s, {on}, against the whole beam: "
            f"{error.accelerance_in_band:.2e}"
        )
    if result.spec.payload is not None:
        out.print(
            "payload: the tip is exact with the root, so that your scene may attach any body there; the figures above are "
            "without it."
            if result.spec.fit.method == "exact"
            else f"payload: fitted with 0, 2, 20 and 100 % of {result.spec.payload.mass:g} kg on the tip at once, so that "
            "your scene may attach any of it; the figures above are without it.",
            markup=False,
        )
    steps = ", ".join(f"{k} {v:.4g} s" if v < 1e9 else f"{k} no limit" for k, v in result.limits.largest_step.items())
    out.print(f"largest stable step: {steps}")
    took = sum(result.seconds.values())
    out.print(f"spec to verified chain: {took * 1e3:.1f} ms")
    for text in result.warnings:
        out.print(f"[bold yellow]warning[/bold yellow]: {escape(text)}")
    print_written(files)


def _explain(result: "Fit") -> None:
    """How the modes were chosen, what was left out, what the model cannot answer, which step to take."""
    from rich.table import Table

    out = console()
    if result.choice is None:
        out.print(
            "The spec states the modes itself; give [scene] a bandwidth and leave [modes] out to have them chosen.",
            markup=False,
        )
        return
    for line in result.choice.reasoning:
        out.print(line, markup=False)
    left = Table(title="left out", title_justify="left")
    for column in ("what", "why", "cost"):
        left.add_column(column, justify="right" if column == "cost" else "left")
    for item in result.left_out:
        left.add_row(item.what, item.why, f"{item.cost:.1e}" if item.cost else "0")
    out.print(left)
    for line in result.choice.cannot:
        out.print(f"cannot answer: {line}", markup=False)
    if not result.steps:  # a rigid body takes any
        return
    steps = Table(title="steps that keep the tolerance", title_justify="left")
    for column in ("integrator", "largest step s", "bounded by", "cost"):
        steps.add_column(column, justify="left" if column in ("integrator", "bounded by") else "right")
    for choice in result.steps:
        steps.add_row(choice.integrator, f"{choice.step:.3g}", choice.bound, f"{choice.cost:.2f}")
    out.print(steps)
