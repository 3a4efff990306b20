"""The page of `embed`: what hangs where, the coupled modes, and every appendage by itself."""

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from beamchain.engine.library import one_thread
from beamchain.fitting.spec_text import spec_toml
from beamchain.report import plots
from beamchain.report.craft_plots import assembly_figure
from beamchain.report.curves import count
from beamchain.report.formats import error_text, short
from beamchain.report.headlines import cure_sentence, spring_sentence
from beamchain.report.page import Verdict, page_text
from beamchain.report.replay import craft_replays
from beamchain.report.svg import to_svg
from beamchain.report.tables import embed as tables
from beamchain.report.tables import fit as fit_tables
from beamchain.report.tables.first_screen import embedded_tiles

if TYPE_CHECKING:
    from beamchain.craft.appendage import Appendage
    from beamchain.craft.embedded import Embedded
    from beamchain.steps.deployment import Commands

SAME = 1e-3  # relative difference of chains below which appendages of one spec are shown once


@one_thread()
def embed_report(
    embedded: "Embedded", craft: str, output: str, given: "Commands | None" = None
) -> str:
    """The text of the page; `craft` and `output` are the names of the files that were read and
    written, `given` the commands of actuators under which it is filmed in place of a turn."""
    assembly = embedded.assembly
    appendages = embedded.appendages
    alike = _alike(appendages)
    figures = {"assembly": assembly_figure(assembly)}
    for i, group in enumerate(alike, 1):
        figures[f"chain{i}"] = plots.chain_figure(group.those[0].fit)
    files = _spec_files(appendages)
    return page_text(
        "embed.html",
        name=output,
        verdict=_verdict(embedded),
        tiles=embedded_tiles(embedded),
        embedded=embedded,
        assembly=assembly,
        tables=tables,
        drawn={name: to_svg(figure, name) for name, figure in figures.items()},
        replays=craft_replays(embedded, given),
        names=_user_names(appendages),
        alike=alike,
        imported=any(a.fit.space is not None for a in appendages),
        fit_tables=fit_tables,
        spring_sentence=spring_sentence,
        gone=[m.exact for m in assembly.modes if m.mujoco is None and m.exact is not None],
        command=_command(embedded, craft, output, files),
        specs={file: a.spec for file, a in zip(files, appendages, strict=True)},
    )


def _spec_files(appendages: Sequence["Appendage"]) -> list[str]:
    """A file name for the specification of every appendage, one name per specification."""
    texts = {spec_toml(a.spec): a.spec.name for a in appendages}
    uses = Counter(texts.values())
    stems = []
    for a in appendages:
        by_prefix = a.prefix.rstrip("_.-") or a.spec.name
        stems.append(a.spec.name if uses[a.spec.name] == 1 else by_prefix)
    return [f"{stem}.toml" for stem in stems]


def _user_names(appendages: Sequence["Appendage"]) -> set[str]:
    """Names that the user gave, which keep their letters at the start of a sentence."""
    names = set[str]()
    for a in appendages:
        names |= {a.at, a.at.partition(":")[2], a.spec.name}
    return names


class Alike(NamedTuple):
    """Appendages of one spec whose chains differ by at most `difference`, relative;
    the first stands for all."""

    those: "list[Appendage]"
    difference: float


def _alike(appendages: Sequence["Appendage"]) -> list[Alike]:
    """The appendages, equal ones together, in the order of the document."""
    found: list[Alike] = []
    for a in appendages:
        away = [_difference(group.those[0], a) for group in found]
        at = next((i for i, difference in enumerate(away) if difference < SAME), None)
        if at is None:
            found.append(Alike([a], 0.0))
        else:
            found[at] = Alike([*found[at].those, a], max(found[at].difference, away[at]))
    return found


def _difference(a: "Appendage", b: "Appendage") -> float:
    """Largest relative difference of the links of two appendages; infinite between specs."""
    one, two = (
        np.array([(x.start, x.mass, x.com, *x.inertia) for x in item.fit.chain.links])
        for item in (a, b)
    )
    if spec_toml(a.spec) != spec_toml(b.spec) or one.shape != two.shape:
        return np.inf
    return float(np.max(np.abs(one - two) / np.maximum(np.abs(one).max(axis=0), 1e-300)))


def _verdict(embedded: "Embedded") -> Verdict:
    assembly = embedded.assembly
    kept = assembly.judged
    said = f"{embedded.headline[:1].upper()}{embedded.headline[1:]} "
    text = f"{cure_sentence(embedded)} {said}".lstrip() + (
        f"{count(len(embedded.appendages), 'appendage')}, {count(len(kept), 'coupled mode')} kept "
        f"up to {short(assembly.band)} rad/s: the worst is off by {error_text(assembly.worst)} "
        "from exact appendages on the same spacecraft, read back through MuJoCo."
    )
    short_of = [a.at for a in embedded.appendages if not a.fit.status.ok]
    missed = embedded.met is False or embedded.ruined
    if short_of and embedded.met is not False:
        text = f"Less than was asked for at {', '.join(short_of)}. {text}"
    return Verdict(not missed and not short_of, text)


def _command(embedded: "Embedded", craft: str, output: str, files: list[str]) -> str:
    """The command line that makes the same file from the specs in `files`."""
    appendages = embedded.appendages
    words = [
        f"beamchain embed {craft}",
        *(f"--mount {a.at}={f}" for a, f in zip(appendages, files, strict=True)),
    ]
    if embedded.loaded:
        words.append("--loaded")
    return " \\\n  ".join([*words, f"-o {output}"])
