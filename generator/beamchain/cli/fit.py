"""`beamchain fit`: the main job."""

from typing import TYPE_CHECKING

import typer

from beamchain.cli.common import Folder, Force, Full, Json, SpecPath, console
from beamchain.cli.output import print_first, print_headed, print_table, spinner, tell

if TYPE_CHECKING:
    from beamchain.fitting.result import Fit
    from beamchain.steps.step_map import TimeError


def fit(
    spec: SpecPath,
    output: Folder,
    as_json: Json = False,
    force: Force = False,
    full: Full = False,
) -> None:
    """Fit a hinge chain to an appendage, verify it in MuJoCo,
    and write the drop-in file and a report.

    Writes appendage.xml, scene.xml, report.html, pictures and fit.json into DIR.

    Example: beamchain fit boom.toml -o boom
    """
    from beamchain.files import check_free
    from beamchain.fitting.fit import fit as fit_chain
    from beamchain.fitting.spec import read_spec

    with spinner("reading the spec") as say:
        read = read_spec(spec)
        check_free(output / "fit.json", force=force)
        say("fitting the chain and reading it back from MuJoCo")
        result = fit_chain(read)
        say("drawing and writing")
        files = result.write(output, force=force)
    tell(result.as_dict, lambda: _show(result, full=full), files, as_json)
    if not as_json:
        console().print(
            f"next: beamchain embed CRAFT.xml --mount SITE={spec} -o flexible.xml", markup=False
        )
    if not result.status.ok:
        raise typer.Exit(3)


def _show(result: "Fit", *, full: bool) -> None:
    from beamchain.report.tables.first_screen import fit_lines
    from beamchain.report.tables.fit import assumed_sentences, left_out_sentences

    notes = [*result.warnings, *left_out_sentences(result), *assumed_sentences(result)]
    print_first(fit_lines(result), notes, full=full)
    if full:
        _show_tables(result)
        _explain(result)


def _show_tables(result: "Fit") -> None:
    from beamchain.fitting.hub import assumed_hub
    from beamchain.report.headlines import made_sentence
    from beamchain.report.tables import fit as tables
    from beamchain.report.tables.steps import step_sentence

    out = console()
    print_headed(result.spec.name, made_sentence(result))
    if result.spec.root.hub is None:
        out.print(assumed_hub(result.line))
    if result.space is not None:
        for step in result.space.data.steps:
            if "reference point is" in step:
                imported = result.spec.imported
                moved = imported is not None and any(imported.reference)
                place = "`reference` away from it" if moved else "there"
                out.print(f"{step}: place the spacecraft's site {place}", markup=False)
        print_table(tables.effective_mass_table(result.space))
    print_table(tables.mode_table(result, "Modes, read back from MuJoCo"))
    for port in result.target:
        out.print(result.measured.reading_sentence(port), markup=False)
    print_table(tables.link_table(result))
    print_table(tables.hinge_table(result))
    if result.chain.tendons:
        print_table(tables.tendon_table(result))
    if result.kept_for in ("free", "hub"):
        what = "free modes" if result.kept_for == "free" else "coupled modes on the hub given"
        out.print(
            f'target "{result.kept_for}": the {what} are the beam\'s. The cantilever modes above '
            "are the chain's own, which differ from the beam's; the relative errors compare them "
            "with the values computed for that chain."
        )
    if result.promise is None:  # which is the in-band error, where there is one
        print_table(tables.in_band_table(result))
    if result.spec.payload is not None:
        out.print(
            "payload: the tip is exact with the root, so that your scene may attach any body "
            "there; the figures above are without it."
        )
    out.print(step_sentence(result.written_limits))
    if result.time_error is not None:
        out.print(_sampled_sentence(result, result.time_error), markup=False)
    milliseconds = 1e3 * sum(result.seconds.values())
    out.print(f"spec to verified chain: {milliseconds:.1f} ms")


def _sampled_sentence(result: "Fit", error: "TimeError") -> str:
    """How far the step moves the hub and the poles."""
    from beamchain.steps.sampled import off_by

    moved = off_by(result.sampled_error or 0.0)
    return (
        f"stepped by {error.integrator} at {error.step:g} s: motion of the hub off {moved}; "
        f"{error.words}"
    )


def _explain(result: "Fit") -> None:
    """How the modes were chosen, what was left out, what the model cannot answer,
    which step to take."""
    from beamchain.report.tables import fit as tables

    out = console()
    if result.choice is None:
        out.print(
            "The spec states the modes itself; give [scene] a bandwidth and leave [modes] out to "
            "have them chosen."
        )
        return
    for line in result.choice.reasoning:
        out.print(line)
    print_table(tables.left_out_table(result.left_out))
    for line in result.choice.cannot:
        out.print(f"cannot answer: {line}")
    if result.steps:  # a rigid body takes any
        print_table(tables.kept_step_table(result))
