"""The report of `embed`: the whole spacecraft against the exact assembly, and every appendage in it."""

from typing import TYPE_CHECKING

import numpy as np

from beamchain.assess.budget import budget
from beamchain.engine.linearise import INTEGRATORS
from beamchain.errors import EngineError
from beamchain.report import plots
from beamchain.report.assembly_plot import assembly_figure, difference_figure
from beamchain.report.curves import count
from beamchain.report.notebook import kept_word
from beamchain.report.page import Block, Lines, Picture, Section, Table, Text, begun, inline, page_text, versions
from beamchain.report.plots import percent, short, to_svg
from beamchain.report.sections import Verdict, left_out_blocks, mode_table, shape_blocks, step_words
from beamchain.report.shapes import kept_modes
from beamchain.report.spec_text import spec_toml

if TYPE_CHECKING:
    from beamchain.appendage import Appendage
    from beamchain.assess.assembly import Assembly
    from beamchain.embedding import Embedded


def embed_report(embedded: "Embedded", craft: str, output: str) -> str:
    """The text of the page.

    Args:
        embedded: what is told.
        craft: name of the spacecraft's file.
        output: name of the file that was written.
    """
    assembly, appendages = embedded.assembly, embedded.appendages
    parts = [
        Section("What was asked", _asked(embedded, craft, output)),
        Section("Coupled modes of the whole spacecraft", [_modes(assembly)]),
        Section("The hub over frequency", _hub(assembly)),
    ]
    own = {name for a in appendages for name in (a.at, a.at.partition(":")[2], a.fit.spec.name)}
    if embedded.warnings:
        parts.append(Section("Before you use it", [Lines([begun(t, own) for t in embedded.warnings])]))
    parts += [Section(f"{a.fit.spec.name} at {a.at}", _appendage(a, i)) for i, a in enumerate(appendages, 1)]
    parts.append(Section("Time steps", _steps(embedded)))
    parts.append(Section("Left out", _left_out(embedded)))
    parts.append(Section("To reproduce", _reproduce(embedded, craft, output)))
    return page_text(
        "embed.html", name=output, output=output, sections=parts, verdict=_verdict(embedded), versions=versions()
    )


def _verdict(embedded: "Embedded") -> Verdict:
    assembly = embedded.assembly
    kept = assembly.judged
    text = f"{embedded.headline[:1].upper()}{embedded.headline[1:]} " + (
        f"{count(len(embedded.appendages), 'appendage')}, {count(len(kept), 'coupled mode')} kept up to "
        f"{short(assembly.band)} rad/s: the worst is off by {percent(assembly.worst)} from beams on the same "
        "spacecraft, read back through MuJoCo."
    )
    if embedded.met is False:
        return Verdict(False, text)
    short_of = [a.at for a in embedded.appendages if not a.fit.status.ok]
    if short_of:
        return Verdict(False, f"Less than was asked for at {', '.join(short_of)}. {text}")
    return Verdict(True, text)


def _asked(embedded: "Embedded", craft: str, output: str) -> list[Block]:
    where = "" if embedded.form == "inline" else ", each appendage in a file of its own beside it"
    rows = [("spacecraft", craft), ("written", f"{output}{where}")]
    before, after = embedded.craft, embedded.model
    rows.append(("degrees of freedom", f"{before.nv} of the spacecraft, {after.nv - before.nv} of the appendages"))
    head = ["at", "appendage", "modes kept", "target", "rigidly behind its root, kg", "on", "status"]
    placed = [
        [
            a.at,
            f"{a.fit.spec.name}: {short(a.fit.mass_line.length)} m, {short(float(a.fit.measured.rigid_mass[0, 0]))} kg",
            ", ".join(f"{kept_modes(a.fit, port)} in {port}" for port in a.fit.target) or "as imported",
            a.fit.kept_for,
            f"{a.hub.mass:.6g}",
            ", ".join(f"{joint.kind} joint {joint.name}".strip() for joint in a.mount.joints) or "nothing that moves",
            "as asked" if a.fit.status.ok else a.fit.status.message,
        ]
        for a in embedded.appendages
    ]
    note = "Each appendage is fitted to what stands rigidly behind its root, the other appendages taken as rigid."
    return [Table(rows, words=True), Table(placed, head, caption="Appendages", note=note, words=True)]


def _modes(assembly: "Assembly") -> Table:
    rows: list[list[str]] = []
    for k, mode in enumerate(assembly.modes, 1):
        exact = ["", ""] if mode.exact is None else [f"{mode.exact:.7g}", f"{mode.exact / (2.0 * np.pi):.5g}"]
        ours = "left out" if mode.mujoco is None else f"{mode.mujoco:.7g}"
        error = "" if mode.error is None else percent(mode.error)
        rows.append([str(k), *exact, ours, error, kept_word(assembly, mode)])
    head = ["mode", "exact, rad/s", "exact, Hz", "MuJoCo, rad/s", "difference", "kept"]
    note = (
        "Exact: the spacecraft's own mass and stiffness with every appendage as the beam it is, all its modes. MuJoCo: "
        "A and B of mjd_transitionFD of the file that was written. Kept: most of the mode's strain energy is in "
        "modes that the chains were asked to keep, or in the spacecraft's own springs; judged up to "
        f"{short(assembly.band)} rad/s."
    )
    return Table(rows, head, note=note)


def _hub(assembly: "Assembly") -> list[Block]:
    label = f"Accelerance of {assembly.hub} over frequency: exact beams and MuJoCo."
    caption = (
        f"{assembly.hub}: acceleration of each motion per wrench along it. Where blue has a black core, MuJoCo and the "
        "exact beams agree; the in-band error is taken over the shaded band. 0.5 % damping where none is given."
    )
    drawn = to_svg(assembly_figure(assembly, columns=1), "assembly")
    off = to_svg(difference_figure(assembly), "difference")
    told = (
        "Difference of the two at each frequency, all motions together, relative to the motion at that frequency; "
        f"the largest drawn in the band is {percent(assembly.in_band)}."
    )
    return [
        Picture(inline(drawn, label), caption, "zoom"),
        Picture(inline(off, f"Relative error of the motion of {assembly.hub} over frequency."), told, "zoom"),
    ]


def _appendage(a: "Appendage", number: int) -> list[Block]:
    """The appendage by itself, on the hub that it feels."""
    fit = a.fit
    blocks: list[Block] = [Text(fit.status.message)]
    blocks += [mode_table(fit, port)._replace(note="") for port in fit.target]
    rows = [
        [port, f"0 to {fit.bandwidth[port]:.6g}", percent(error.accelerance_in_band or 0.0)]
        for port, error in fit.error.items()
    ]
    note = "Modes above: cantilever, root held. In band: alone on the hub that its root feels, against the whole beam."
    blocks.append(Table(rows, ["port", "band, rad/s", "in-band error"], caption="In-band error", note=note))
    blocks += shape_blocks(fit)
    what = "The chain drawn to scale along its axis."
    svg = to_svg(plots.chain_figure(fit), f"chain{number}")
    caption = f"{what} Lengths in m from the root; the first body is welded to the spacecraft."
    return [*blocks, Picture(inline(svg, f"{fit.spec.name}: {what}"), caption)]


def _steps(embedded: "Embedded") -> list[Block]:
    try:
        found = budget(embedded.model)
    except EngineError as error:
        return [Text(str(error))]
    option = embedded.model.opt
    own = next((name for name, value in INTEGRATORS.items() if int(value) == int(option.integrator)), "")
    rows: list[list[str]] = []
    for name, largest in found.largest_step.items():
        one, tenth = found.accuracy[name]
        verdict = ""
        if name == own:
            fits = "stable" if option.timestep < largest else "unstable: too large"
            verdict = f"the file's, step {option.timestep:g} s: {fits}"
        rows.append([name, step_words(largest), step_words(one), step_words(tenth), verdict])
    head = ["integrator", "stable up to, s", "first mode within 1 % up to, s", "within 0.1 % up to, s", ""]
    note = f"Of the whole file at rest; fastest mode {float(found.frequencies.max()):.6g} rad/s."
    return [Table(rows, head, caption="Largest time step", note=note)]


def _left_out(embedded: "Embedded") -> list[Block]:
    blocks: list[Block] = []
    gone = [m.exact for m in embedded.assembly.modes if m.mujoco is None and m.exact is not None]
    band = f"Up to {short(embedded.assembly.band)} rad/s "
    if gone:
        listed = ", ".join(f"{w:.5g}" for w in gone)
        blocks.append(
            Text(f"{band}the exact assembly has coupled modes that no chain was asked to keep: {listed} rad/s.")
        )
    else:
        blocks.append(Text(f"{band}no coupled mode of the exact assembly is missing."))
    for a in embedded.appendages:
        items = [{"what": i.what, "why": i.why, "cost": i.cost} for i in a.fit.left_out]
        if items:
            blocks += [Text(f"{a.fit.spec.name} at {a.at}", "heading"), *left_out_blocks(items)]
    return blocks


def _reproduce(embedded: "Embedded", craft: str, output: str) -> list[Block]:
    appendages = embedded.appendages
    files = [f"{a.prefix.rstrip('_.-') or a.fit.spec.name}.toml" for a in appendages]
    words = [f"beamchain embed {craft}", *(f"--at {a.at}={f}" for a, f in zip(appendages, files, strict=True))]
    if any(a.prefix != f"{a.spec.name}_" for a in appendages):
        words += [f"--prefix {a.prefix}" for a in appendages]
    if embedded.form != "inline":
        words.append(f"--form {embedded.form}")
    blocks: list[Block] = [Text("Save the specs below under the names above them, then:")]
    blocks.append(Text(" \\\n  ".join([*words, f"-o {output}"]), "code"))
    for a, file in zip(appendages, files, strict=True):
        blocks += [Text(file, "heading"), Text(spec_toml(a.spec), "code")]
    return blocks
