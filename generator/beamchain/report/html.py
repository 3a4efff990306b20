"""The pages of `fit` and `embed`: what was asked, what came out, how far it is from the beam."""

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from beamchain.engine.linearise import NUMBERS
from beamchain.errors import EngineError
from beamchain.fitting.hub import assumed_hub, port_hub_mass
from beamchain.fitting.spec_text import spec_toml
from beamchain.ports.compare import in_band_error
from beamchain.report import plots
from beamchain.report.craft_plots import assembly_figure, difference_figure
from beamchain.report.curves import METHODS, beam_model, chain_label, count, rival_chains, rival_model
from beamchain.report.notebook import kept_word
from beamchain.report.page import Table, Verdict, number, page_text, vector
from beamchain.report.plots import percent, short
from beamchain.report.record import mass_record
from beamchain.report.shapes import all_shapes, kept_modes
from beamchain.report.svg import to_svg
from beamchain.steps.budget import budget
from beamchain.structure.beam import Beam

if TYPE_CHECKING:
    from beamchain.craft.appendage import Appendage
    from beamchain.craft.embedded import Embedded
    from beamchain.fitting.result import Fit

SAME = 1e-3  # relative difference of chains below which appendages of one spec are shown once


def fit_report(fit: "Fit") -> tuple[str, dict[str, str]]:
    """The text of report.html, and that of the SVG files to stand beside it, by name."""
    figures = {f"accelerance_{port}": plots.accelerance_figure(fit, port) for port in fit.target}
    figures |= {f"error_{port}": plots.error_figure(fit, port) for port in fit.target}
    pictures = {f"{name}.svg": to_svg(figure, name) for name, figure in figures.items()}
    pictures["chain.svg"] = to_svg(plots.chain_figure(fit), "chain")
    rivals, bench = rival_errors(fit), fit.measured.linearisation
    continuous, (discrete, ratios) = bench.frequencies(), bench.discrete_frequencies()
    page = page_text(
        "report.html",
        name=fit.spec.name,
        verdict=_verdict(fit, rivals),
        fit=fit,
        pictures=pictures,
        asked=_asked(fit),
        assumed_hub=assumed_hub(fit.mass_line),
        carried=_carried(fit),
        mode_tables=[mode_table(fit, port) for port in fit.target],
        drawn_shapes=all_shapes(fit),
        in_band=_in_band(fit, rivals),
        model_errors={port: _frequencies(fit, port) for port in fit.target},
        masses=_masses(fit),
        damped=[port for port in fit.chain.ports if any(port in hinge.damping for hinge in fit.chain.hinges)],
        bench=bench,
        bench_modes=list(zip(continuous, discrete, ratios, strict=True)) if continuous.size == discrete.size else (),
    )
    return page, pictures


# -- the sentence at the head ----------------------------------------------------------------------------------------
def _kept(fit: "Fit") -> str:
    """`first 2 modes in xy and 1 in torsion`."""
    (port, modes), *more = [(port, kept_modes(fit, port)) for port in fit.target]
    first = f"first {'mode' if modes == 1 else f'{modes} modes'} in {port}"
    parts = [first, *(f"{n} in {other}" for other, n in more)]
    return first if not more else f"{', '.join(parts[:-1])} and {parts[-1]}"


RivalErrors = dict[str, dict[str, float]]


def rival_errors(fit: "Fit") -> RivalErrors:
    """Per port and rival its in-band error, computed as the chain's own."""
    out: RivalErrors = {}
    for port in fit.target:
        beam, hub = beam_model(fit, port), None if fit.hub_mass is None else port_hub_mass(fit.hub_mass, port)
        out[port] = {
            label: in_band_error(rival_model(fit, port, chain), beam, hub, fit.bandwidth[port])
            for label, chain in rival_chains(fit, port).items()
        }
    return out


def _verdict(fit: "Fit", rivals: RivalErrors) -> Verdict:
    """What to tell somebody who reads one sentence."""
    scene = fit.spec.scene
    promised: tuple[float, float] | None = None
    if fit.promise is not None and scene is not None and scene.bandwidth is not None:
        promised = fit.promise, scene.bandwidth
    less = "" if fit.status.ok else f"Less than was asked for: {fit.status.message.rstrip('.')}. "
    if not fit.error:  # the scene needs no mode
        text = "One rigid body stands for the appendage"
        if promised:
            error, band = promised
            text += f": the motion of the hub is off by at most {percent(error)} up to {short(band)} rad/s"
        return Verdict(fit.status.ok, f"{less}{text}.")
    frequency = max(error.frequency for error in fit.error.values())
    errors = {port: error.accelerance_in_band or 0.0 for port, error in fit.error.items()}
    worst = max(errors, key=lambda port: errors[port])
    links = sum(link.mass > 0.0 for link in fit.chain.links)
    what = f"{count(links, 'rigid link')} on {count(len(fit.chain.hinges), 'hinge')} stand for the beam's {_kept(fit)}"
    if fit.space is not None:
        what = what.replace("the beam's", "the imported modes:")
    hub = "the hub of the spec" if fit.hub_mass is not None else "a hub of 0.1, 1 or 10 times the appendage's mass"
    error, band = promised or (errors[worst], fit.bandwidth[worst])
    text = f"{what}: the motion of {hub} is off by at most {percent(error)} up to {short(band)} rad/s"
    classical = None if promised else rivals[worst].get(METHODS["classical"])
    if classical is not None:
        text += f" (classical chain with as many hinges: {percent(classical)})"
    missed = scene is not None and error > scene.tolerance
    if scene is not None and missed:
        text += f", more than the tolerance of {percent(scene.tolerance)}"
    if (tip := fit.tip_told) is not None:
        text += f"; {tip}"
    text += f". Read back through MuJoCo the kept frequencies are within {percent(frequency)} of what was asked for"
    return Verdict(fit.status.ok and not missed, f"{less}{text}.")


# -- the tables ------------------------------------------------------------------------------------------------------
def _carried(fit: "Fit") -> str:
    """What the appendage is made of."""
    beam, imported = fit.mass_line, fit.spec.imported
    if not isinstance(beam, Beam):
        return f"imported from {imported.file}" if imported is not None else "imported"
    parts = (("segment", beam.segments), ("compliant joint", beam.joints), ("lumped body", beam.lumps))
    return ", ".join(count(len(those), what).replace("bodys", "bodies") for what, those in parts if those)


def _asked(fit: "Fit") -> str:
    """The modes that the spec asks for."""
    given = fit.spec.kept if fit.choice is None or fit.spec.modes is None else fit.spec.modes.given()
    counts = ", ".join(f"{n} in {port}" for port, n in given.items())
    if fit.choice is None:
        return counts or "as imported"
    chosen = "as few as the scene needs"
    return f"{chosen}; {counts} as given" if fit.spec.modes is not None and given else chosen


def mode_table(fit: "Fit", port: str) -> Table:
    """Modes of a port: asked for, read back through MuJoCo, how far off."""
    target, achieved, error = fit.target[port], fit.achieved[port], fit.error[port]
    ratios, tip = bool(np.any(target.damping > 0.0) or np.any(achieved.damping > 0.0)), fit.tip_error.get(port)
    head = ["mode", "target, rad/s", "target, Hz", "through MuJoCo, rad/s", "relative error"]
    head += ["participation, target", "participation, through MuJoCo", "relative error"]
    head += ["damping ratio, asked", "damping ratio, through MuJoCo"] if ratios else []
    head += ["tip motion, relative error"] if tip is not None else []
    rows: list[list[str]] = []
    order = np.argsort(error.matches[:, 1])
    for (i, j), df, dp in zip(
        error.matches[order], error.frequency_errors[order], error.participation_errors[order], strict=True
    ):
        want, have = float(target.frequencies[j]), float(achieved.frequencies[i])
        row = [str(int(j) + 1), number(want), number(want / (2.0 * np.pi)), number(have), percent(df)]
        row += [vector(target.participation[j]), vector(achieved.participation[i]), percent(dp)]
        row += [f"{target.damping[j]:.4g}", f"{achieved.damping[i]:.4g}"] if ratios else []
        row += [percent(float(tip[j])) if j < tip.size else ""] if tip is not None else []
        rows.append(row)
    unit = {"torsion": "√(kg m²)", "axial": "√kg"}.get(port, "force √kg, moment √kg m")
    note = f"Cantilever modes, root held. Participation in {unit}."
    if fit.kept_for in ("free", "hub"):
        note += " The target keeps other modes exactly (next section); its own cantilever modes differ from the beam's."
    return Table(rows, head, caption=f"Port {port}", note=note)


def _in_band(fit: "Fit", rivals: RivalErrors) -> Table:
    labels = list(dict.fromkeys(label for found in rivals.values() for label in found))
    rows: list[list[str]] = []
    for port, error in fit.error.items():
        own = percent(error.accelerance_in_band or 0.0)
        others = [percent(rivals[port][label]) if label in rivals[port] else "" for label in labels]
        rows.append([port, f"0 to {number(fit.bandwidth[port])}", own, *others])
    place = "On the hub of the spec." if fit.hub_mass is not None else (
        "No hub is given: the worst of three, 0.1, 1 and 10 times the appendage's rigid mass."
    )  # fmt: skip
    names = [f"{label}, as many hinges" if label == METHODS["classical"] else label for label in labels]
    if fit.promise is not None:
        place += " Each port by itself; what the scene asks of the hub counts all ports together."
    head = ["port", "band, rad/s", chain_label(fit), *names]
    return Table(rows, head, caption="In-band error", note=place)


def _frequencies(fit: "Fit", port: str) -> list[tuple[str, float, float]]:
    """Held, free and on the hub, of the beam and of the chain in continuous time."""
    full, achieved = fit.full[port], fit.achieved[port]
    kept = min(fit.target[port].modes, achieved.modes, achieved.free_frequencies.size)
    cases = [("root held", full.frequencies, achieved.frequencies)]
    cases.append(("nothing attached", full.free_frequencies, achieved.free_frequencies))
    if fit.hub_mass is not None:
        hub = port_hub_mass(fit.hub_mass, port)
        cases.append(("on the hub", full.with_hub(hub).free_frequencies, achieved.with_hub(hub).free_frequencies))
    return [
        (f"{name}, mode {k}", float(a), float(b))
        for name, exact, ours in cases
        for k, (a, b) in enumerate(zip(exact[:kept], ours[:kept], strict=False), 1)
    ]


def _masses(fit: "Fit") -> list[tuple[str, float, float]]:
    """Mass, centre and inertia about the root, of the beam and of the chain."""
    beam, chain = mass_record(fit.mass_line.rigid_mass()), mass_record(fit.measured.rigid_mass)
    rows = [("mass, kg", beam["mass"], chain["mass"])]
    rows += [(f"centre of mass {x}, m", a, b) for x, a, b in zip("xyz", beam["com"], chain["com"], strict=True)]
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        a, b = float(beam["inertia"][i, j]), float(chain["inertia"][i, j])
        if i == j or a or b:
            rows.append((f"inertia {'xyz'[i]}{'xyz'[j]}, kg m²", a, b))
    return rows


# -- embedded --------------------------------------------------------------------------------------------------------
def embed_report(embedded: "Embedded", craft: str, output: str) -> str:
    """The text of the page; `craft` and `output` are the names of the files that were read and written."""
    assembly, appendages, model = embedded.assembly, embedded.appendages, embedded.model
    figures = {"assembly": assembly_figure(assembly, columns=1), "difference": difference_figure(assembly)}
    alike = _alike(appendages)
    figures |= {f"chain{i}": plots.chain_figure(group.those[0].fit) for i, group in enumerate(alike, 1)}
    try:
        limits = budget(model)
    except EngineError as error:
        limits = str(error)
    texts = {spec_toml(a.spec): a.spec.name for a in appendages}
    once = Counter(texts.values())
    stems = [a.spec.name if once[a.spec.name] == 1 else a.prefix.rstrip("_.-") or a.spec.name for a in appendages]
    files = [f"{stem}.toml" for stem in stems]
    return page_text(
        "embed.html",
        name=output,
        output=output,
        verdict=_embedded_verdict(embedded),
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
        specs={file: a.spec for file, a in zip(files, appendages, strict=True)},
        alike=alike,
    )


class Alike(NamedTuple):
    """Appendages of one spec whose chains differ by at most `difference`, relative; the first stands for all."""

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
    one, two = (np.array([(x.start, x.mass, x.com, *x.inertia) for x in item.fit.chain.links]) for item in (a, b))
    if spec_toml(a.spec) != spec_toml(b.spec) or one.shape != two.shape:
        return np.inf
    return float(np.max(np.abs(one - two) / np.maximum(np.abs(one).max(axis=0), 1e-300)))


def _embedded_verdict(embedded: "Embedded") -> Verdict:
    assembly = embedded.assembly
    kept = assembly.judged
    text = f"{embedded.headline[:1].upper()}{embedded.headline[1:]} " + (
        f"{count(len(embedded.appendages), 'appendage')}, {count(len(kept), 'coupled mode')} kept up to "
        f"{short(assembly.band)} rad/s: the worst is off by {percent(assembly.worst)} from beams on the same "
        "spacecraft, read back through MuJoCo."
    )
    short_of = [a.at for a in embedded.appendages if not a.fit.status.ok]
    if short_of and embedded.met is not False:
        text = f"Less than was asked for at {', '.join(short_of)}. {text}"
    return Verdict(embedded.met is not False and not short_of, text)


def _command(embedded: "Embedded", craft: str, output: str, files: list[str]) -> str:
    """The command line that makes the same file from the specs in `files`."""
    appendages = embedded.appendages
    words = [f"beamchain embed {craft}", *(f"--at {a.at}={f}" for a, f in zip(appendages, files, strict=True))]
    if any(a.prefix != f"{a.spec.name}_" for a in appendages):
        words += [f"--prefix {a.prefix}" for a in appendages]
    if embedded.form != "inline":
        words.append(f"--form {embedded.form}")
    return " \\\n  ".join([*words, f"-o {output}"])
