"""`beamchain fit`: the main job."""

from typing import TYPE_CHECKING, Annotated

import typer

from beamchain.cli.common import Folder, Force, Json, Quiet, SpecPath, console
from beamchain.cli.output import print_table, print_warnings, spinner, tell

if TYPE_CHECKING:
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
    from beamchain.files import check_free
    from beamchain.fitting.fit import fit as fit_chain
    from beamchain.fitting.spec import read_spec

    with spinner("reading the spec", quiet or as_json) as say:
        read = read_spec(spec)
        check_free(output / "fit.json", force=force)
        if full:
            from beamchain.fitting.choose import everything

            read = everything(read)
        say("fitting the chain and reading it back from MuJoCo")
        result = fit_chain(read)
        say("drawing and writing")
        files = result.write(output, force=force)
    tell(result.as_dict, lambda: _show(result), files, as_json, quiet)
    if explain and not as_json and not quiet:
        _explain(result)
    if not result.status.ok:
        raise typer.Exit(3)


def _show(result: "Fit") -> None:
    from rich.markup import escape

    from beamchain.fitting.hub import assumed_hub

    out, chain, damping = console(), result.chain, result.spec.damping
    out.print(f"[bold]{result.spec.name}[/bold]: {escape(result.status.message)}")
    out.print(escape(result.headline))
    if result.spec.root.hub is None:
        out.print(escape(assumed_hub(result.mass_line)))
    head = ("port", "mode", "cantilever rad/s", "free rad/s", "participation")
    head += ("readback, frequency", "readback, participation")
    head += ("damping wanted", "achieved") if damping is not None else ()
    rows: list[list[str]] = []
    for port, achieved in result.achieved.items():
        error, free = result.error[port], achieved.free_frequencies
        for (i, j), df, dp in zip(error.matches, error.frequency_errors, error.participation_errors, strict=True):
            participation = ", ".join(f"{v:.5g}" for v in achieved.participation[i])
            loose = f"{free[i]:.6g}" if i < free.size else "none"
            rows.append([port, str(j + 1), f"{achieved.frequencies[i]:.6g}", loose, participation])
            rows[-1] += [f"{df:+.1e}", f"{dp:.1e}"]
            if damping is not None:
                rows[-1] += [f"{damping.ratios(port, j + 1)[j]:.6g}", f"{achieved.damping[i]:.6g}"]
    print_table("modes, read back from MuJoCo (mjd_transitionFD)", head, rows)
    springs = [", ".join(f"{p} {f'{c:.5g}' if c else 'free'}" for p, c in h.stiffness.items()) for h in chain.hinges]
    springs += ["-"] * (len(chain.links) - len(springs))
    links = [
        [str(i), *(f"{v:.5g}" for v in (link.start, link.length, link.mass, link.inertia[2])), spring]
        for i, (link, spring) in enumerate(zip(chain.links, springs, strict=True), 1)
    ]
    head = ("link", "from m", "length m", "mass kg", "inertia kg m2", "hinge behind it N m/rad")
    print_table("chain", head, links, left=())
    if chain.tendons:
        tendons = [
            (f"{result.spec.name}_{t.label}", f"{t.stiffness**0.5:.6g}" if t.stiffness else "-", f"{t.damping:.4g}",
             f"{t.armature:.4g}")
            for t in chain.tendons
        ]  # fmt: skip
        print_table("tendons", ("tendon", "frequency rad/s", "damping 1/s", "armature"), tendons)
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
    out.print(f"spec to verified chain: {sum(result.seconds.values()) * 1e3:.1f} ms")
    print_warnings(result.warnings)


def _explain(result: "Fit") -> None:
    """How the modes were chosen, what was left out, what the model cannot answer, which step to take."""
    out = console()
    if result.choice is None:
        out.print(
            "The spec states the modes itself; give \\[scene] a bandwidth and leave \\[modes] out to have them chosen."
        )
        return
    for line in result.choice.reasoning:
        out.print(line, markup=False)
    costs = [(item.what, item.why, f"{item.cost:.1e}" if item.cost else "0") for item in result.left_out]
    print_table("left out", ("what", "why", "cost"), costs, left=(0, 1))
    for line in result.choice.cannot:
        out.print(f"cannot answer: {line}", markup=False)
    if result.steps:  # a rigid body takes any
        head = ("integrator", "largest step s", "bounded by", "cost")
        steps = [(s.integrator, f"{s.step:.3g}", s.bound, f"{s.cost:.2f}") for s in result.steps]
        print_table("steps that keep the tolerance", head, steps, left=(0, 2))
