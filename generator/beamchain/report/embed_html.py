"""The report of `embed`: the whole spacecraft against the exact assembly, and every appendage in it."""

from typing import TYPE_CHECKING

from beamchain.engine.linearise import NUMBERS
from beamchain.errors import EngineError
from beamchain.report.assembly_plot import assembly_figure, difference_figure
from beamchain.report.curves import count
from beamchain.report.html import mode_table
from beamchain.report.notebook import kept_word
from beamchain.report.page import Verdict, page_text
from beamchain.report.plots import chain_figure, percent, short, to_svg
from beamchain.report.shapes import all_shapes, kept_modes
from beamchain.steps.budget import budget

if TYPE_CHECKING:
    from beamchain.craft.embedded import Embedded


def embed_report(embedded: "Embedded", craft: str, output: str) -> str:
    """The text of the page; `craft` and `output` are the names of the files that were read and written."""
    assembly, appendages, model = embedded.assembly, embedded.appendages, embedded.model
    figures = {"assembly": assembly_figure(assembly, columns=1), "difference": difference_figure(assembly)}
    figures |= {f"chain{i}": chain_figure(a.fit) for i, a in enumerate(appendages, 1)}
    try:
        limits = budget(model)
    except EngineError as error:
        limits = str(error)
    files = [f"{a.prefix.rstrip('_.-') or a.fit.spec.name}.toml" for a in appendages]
    return page_text(
        "embed.html",
        name=output,
        output=output,
        verdict=_verdict(embedded),
        embedded=embedded,
        assembly=assembly,
        craft=craft,
        before=embedded.craft,
        model=model,
        kept_modes=kept_modes,
        kept_word=kept_word,
        drawn={name: to_svg(figure, name) for name, figure in figures.items()},
        names={name for a in appendages for name in (a.at, a.at.partition(":")[2], a.fit.spec.name)},
        mode_table=mode_table,
        all_shapes=all_shapes,
        limits=limits,
        own_integrator=NUMBERS[int(model.opt.integrator)],
        gone=[m.exact for m in assembly.modes if m.mujoco is None and m.exact is not None],
        command=_command(embedded, craft, output, files),
        files=files,
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


def _command(embedded: "Embedded", craft: str, output: str, files: list[str]) -> str:
    """The command line that makes the same file from the specs in `files`."""
    appendages = embedded.appendages
    words = [f"beamchain embed {craft}", *(f"--at {a.at}={f}" for a, f in zip(appendages, files, strict=True))]
    if any(a.prefix != f"{a.spec.name}_" for a in appendages):
        words += [f"--prefix {a.prefix}" for a in appendages]
    if embedded.form != "inline":
        words.append(f"--form {embedded.form}")
    return " \\\n  ".join([*words, f"-o {output}"])
