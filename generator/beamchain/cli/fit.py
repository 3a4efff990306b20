"""`beamchain fit`: the main job."""

from typing import TYPE_CHECKING

import typer

from beamchain.cli.common import Folder, Force, Full, Json, SpecPath
from beamchain.cli.output import print_all, print_first, print_headed, spinner, tell

if TYPE_CHECKING:
    from beamchain.fitting.result import Fit


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
    from beamchain.fitting.spec import read_spec

    with spinner("reading the spec") as say:
        read = read_spec(spec)
        check_free(output / "fit.json", force=force)
        from beamchain.fitting.fit import fit as fit_chain  # what it loads takes half a second

        say("fitting the chain and reading it back from MuJoCo")
        result = fit_chain(read)
        say("drawing and writing")
        files = result.write(output, force=force)
    tell(result.as_dict, lambda: _show(result, full=full), files, as_json)
    if not as_json:
        print_all(f"next: beamchain embed CRAFT.xml --mount SITE={spec} -o flexible.xml")
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
    from beamchain.steps.sampled import off_by

    print_headed(result.spec.name, made_sentence(result))
    if result.spec.root.hub is None:
        print_all(assumed_hub(result.line))
    if result.space is not None:
        imported = result.spec.imported
        moved = imported is not None and any(imported.reference)
        place = "`reference` away from it" if moved else "there"
        for step in result.space.data.steps:
            if "reference point is" in step:
                print_all(f"{step}: place the spacecraft's site {place}")
        print_all(tables.effective_mass_table(result.space))
    print_all(
        tables.mode_table(result, "Modes, read back from MuJoCo"),
        *(result.measured.reading_sentence(port) for port in result.target),
        tables.link_table(result),
        tables.hinge_table(result),
        tables.tendon_table(result) if result.chain.tendons else None,
    )
    if result.kept_for in ("free", "hub"):
        what = "free modes" if result.kept_for == "free" else "coupled modes on the hub given"
        print_all(
            f'target "{result.kept_for}": the {what} are the beam\'s. The cantilever modes above '
            "are the chain's own, which differ from the beam's; the relative errors compare them "
            "with the values computed for that chain."
        )
    if result.promise is None:  # which is the in-band error, where there is one
        print_all(tables.in_band_table([result]))
    if result.spec.payload is not None:
        print_all(
            "payload: the tip is exact with the root, so that your scene may attach any body "
            "there; the figures above are without it."
        )
    print_all(step_sentence(result.written_limits))
    if (error := result.time_error) is not None:
        moved = off_by(result.sampled_error or 0.0)
        stepped = f"stepped by {error.integrator} at {error.step:g} s"
        print_all(f"{stepped}: motion of the hub off {moved}; {error.words}")
    print_all(f"spec to verified chain: {1e3 * sum(result.seconds.values()):.1f} ms")


def _explain(result: "Fit") -> None:
    """How the modes were chosen, what was left out, what the model cannot answer,
    which step to take."""
    from beamchain.report.tables import fit as tables

    if result.choice is None:
        print_all(
            "The spec states the modes itself; give [scene] a bandwidth and leave [modes] out to "
            "have them chosen."
        )
        return
    print_all(
        *result.choice.reasoning,
        tables.left_out_table(result.left_out),
        *(f"cannot answer: {line}" for line in result.choice.cannot),
        tables.kept_step_table(result) if result.steps else None,  # a rigid body takes any
    )
