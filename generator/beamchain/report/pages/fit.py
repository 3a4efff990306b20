"""The page of `fit`: what was asked, what came out, how far it is from the beam."""

from typing import TYPE_CHECKING

from beamchain.fitting.hub import assumed_hub
from beamchain.ports.compare import keeps_tolerance
from beamchain.report import plots
from beamchain.report.curves import alike_ports, count, kept_count
from beamchain.report.formats import error_text, number, short, vector
from beamchain.report.headlines import spring_sentence, tip_sentence
from beamchain.report.page import Verdict, page_text
from beamchain.report.replay import scene_replays
from beamchain.report.svg import to_svg
from beamchain.report.tables import fit as tables
from beamchain.report.tables.first_screen import appendage_words, fit_tiles
from beamchain.report.tables.steps import step_table

if TYPE_CHECKING:
    from beamchain.fitting.result import Fit

TARGETS = {
    "clamped": "clamped: the first cantilever modes, the better the heavier the hub",
    "free": "free: the first modes with nothing attached (the 2008 paper's)",
    "hub": "hub: the first modes of hub and appendage together",
    "auto": "auto: whichever needs fewest modes",
}


def fit_report(fit: "Fit") -> tuple[str, dict[str, str]]:
    """The text of report.html, and that of the SVG files to stand beside it, by name."""
    # the worst port first
    groups = sorted(alike_ports(fit), key=lambda ports: fit.worst_port not in ports)
    figures = {f"response_{port}": plots.response_figure(fit, port) for port, *_ in groups}
    figures["chain"] = plots.chain_figure(fit)
    pictures = {f"{name}.svg": to_svg(figure, name) for name, figure in figures.items()}
    page = page_text(
        "report.html",
        name=fit.spec.name,
        verdict=_verdict(fit),
        tiles=fit_tiles(fit),
        fit=fit,
        tables=tables,
        pictures=pictures,
        asked=_specification(fit),
        modes_word=_modes_word(fit).capitalize(),
        curves=groups,
        spring_sentence=spring_sentence,
        replays=scene_replays(fit),
        steps=step_table({"": fit.written_limits}, "Largest time step"),
    )
    return page, pictures


# -- the sentence at the head ----------------------------------------------------------------------
def _kept_modes(fit: "Fit") -> str:
    """`first 2 modes in xy and 1 in torsion`."""
    (port, modes), *more = [(port, kept_count(fit, port)) for port in fit.target]
    first = f"first {'mode' if modes == 1 else f'{modes} modes'} in {port}"
    parts = [first, *(f"{n} in {other}" for other, n in more)]
    return first if not more else f"{', '.join(parts[:-1])} and {parts[-1]}"


def _verdict(fit: "Fit") -> Verdict:
    """What to tell somebody who reads one sentence."""
    scene, error = fit.spec.scene, fit.in_band_error
    less = "" if fit.status.ok else f"Less than was asked for: {fit.status.message.rstrip('.')}. "
    band = fit.bandwidth.get(fit.worst_port or "", 0.0)
    if fit.promise is not None and scene is not None and scene.bandwidth is not None:
        band = scene.bandwidth
    off = f"off by at most {error_text(error or 0.0)} up to {short(band)} rad/s"
    if not fit.readback_error:  # the scene needs no mode
        known = "" if fit.promise is None else f": the motion of the hub is {off}"
        return Verdict(fit.status.ok, f"{less}One rigid body stands for the appendage{known}.")
    links = sum(link.mass > 0.0 for link in fit.chain.links)
    kept = f"the beam's {_kept_modes(fit)}"
    if fit.space is not None:
        kept = fit.space.kept_words if fit.kept_for == "clamped" else _kept_modes(fit)
    if fit.spec.slosh is not None:
        kept = f"{_modes_word(fit)}: {kept}"
    hub = "the hub of the spec"
    if fit.hub_mass is None:
        hub = "a hub of 0.1, 1 or 10 times the appendage's mass"
    text = (
        f"{count(links, 'rigid link')} on {count(len(fit.chain.hinges), 'hinge')} stand for "
        f"{kept}: the motion of {hub} is {off}"
    )
    missed = scene is not None and not keeps_tolerance(error or 0.0, scene.tolerance)
    if scene is not None and missed:
        text += f", more than the tolerance of {scene.tolerance:g} less its margin of 1 %"
    if (tip := tip_sentence(fit)) is not None:
        text += f"; {tip}"
    frequency = max(found.frequency for found in fit.readback_error.values())
    text += (
        f". Read back through MuJoCo the kept frequencies are within {error_text(frequency)} of "
        "what was asked for"
    )
    return Verdict(fit.status.ok and not missed, f"{less}{text}.")


# -- what was asked --------------------------------------------------------------------------------
def _specification(fit: "Fit") -> list[tuple[str, str]]:
    """What the specification comes to, line by line; it stands itself at the end of the page."""
    bands = (f"{port} up to {number(band)} rad/s" for port, band in fit.bandwidth.items())
    return [
        ("appendage", appendage_words(fit)),
        ("modes to keep", _asked_modes(fit)),
        ("target", TARGETS[fit.kept_for]),
        ("hub", _hub(fit)),
        ("band", "; ".join(bands)),
    ]


def _hub(fit: "Fit") -> str:
    hub = fit.spec.root.hub
    if hub is None:
        return assumed_hub(fit.line)
    text = f"{short(hub.mass)} kg, inertia {vector(hub.inertia)} kg m² about its centre"
    return f"{text}, root at {vector(hub.offset)} m from it" if any(hub.offset) else text


def _modes_word(fit: "Fit") -> str:
    """What the modes are, where they are no beam's."""
    return "the imported modes" if fit.spec.slosh is None else "the liquid's lateral modes"


def _asked_modes(fit: "Fit") -> str:
    """The modes that the spec asks for."""
    modes = fit.spec.modes
    given = fit.spec.kept if fit.choice is None or modes is None else modes.given()
    counts = ", ".join(f"{n} in {port}" for port, n in given.items())
    if fit.spec.slosh is not None:
        return f"{fit.spec.slosh.kept} in each plane, as pendulums"
    if fit.choice is None:
        return counts or "as imported"
    chosen = "as few as the scene needs"
    return f"{chosen}; {counts} as given" if modes is not None and given else chosen
