"""What a command and its page say first: what was reached against what was asked.

Lines of a terminal, at most twelve of 80 characters together with notes and files; and the three
figures at the head of a page, each with what it is.
"""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from beamchain.report.curves import count
from beamchain.report.formats import short, step_text
from beamchain.report.headlines import (
    cure_sentence,
    fit_headline,
    modes_sentence,
    reached_sentences,
)
from beamchain.report.tables.embed import modes_kept, size_words

if TYPE_CHECKING:
    from beamchain.control.margins import LoopMargins, Margins
    from beamchain.control.realisation import Plant
    from beamchain.craft.embedded import Embedded
    from beamchain.fitting.result import Fit

NOTES = 3  # the most important ones
APPENDAGES = 4  # each with a line of its own
LOOPS = 6
NAMES = 6  # of signals


def fit_lines(fit: "Fit") -> Iterator[str]:
    """The appendage, its chain, and the error against the tolerance."""
    yield f"{appendage_words(fit)}; kept: {modes_kept(fit)}; {', '.join(_parts(fit))}"
    if cure := cure_sentence(fit):
        yield cure
    yield from reached_sentences(fit)
    if fit.promise is None:
        yield fit_headline(fit)
    integrator = fit.spec.integrator
    limit = fit.written_limits.largest_step.get(integrator, math.inf)
    if math.isfinite(limit):
        yield f"largest stable step: {limit:.4g} s ({integrator})"


def file_lines(fit: "Fit") -> list[str]:
    """What the drop-in file is, what it reproduces and how to check it."""
    name = fit.spec.name
    return [
        f"{appendage_words(fit)}, as {', '.join(_parts(fit))}; SI units, x from the root outwards",
        f"kept: {modes_kept(fit)}; {fit_headline(fit)}",
        f"attach {name}_link1 to a site of your spacecraft; check with: beamchain inspect FILE",
    ]


def fit_tiles(fit: "Fit") -> list[tuple[str, str]]:
    """Error, largest step, size."""
    scene, error = fit.spec.scene, fit.in_band_error
    tiles: list[tuple[str, str]] = []
    if error is not None:
        asked = f", {scene.tolerance:g} asked" if scene is not None and fit.promise else ""
        tiles.append((f"{error:.2e}", f"largest error of the hub's motion in the band{asked}"))
    integrator = fit.spec.integrator
    limit = fit.written_limits.largest_step.get(integrator, math.inf)
    tiles.append((step_text(limit) + " s" * math.isfinite(limit), f"largest step, {integrator}"))
    links, *more = _parts(fit)
    return [*tiles, (links, ", ".join(more))]


def _parts(fit: "Fit") -> list[str]:
    """What a chain is made of, counted."""
    chain = fit.chain
    parts = {"link": chain.links, "hinge": chain.hinges, "tendon": chain.tendons}
    return [count(len(those), word) for word, those in parts.items() if those]


def embedded_lines(embedded: "Embedded") -> Iterator[str]:
    """The error of the whole against the tolerance, and what hangs on it."""
    composite, several = embedded.composite, embedded.appendages
    rigid = several[0].rigid  # the twin, which no cure is for
    if not rigid and (cure := cure_sentence(embedded)):
        yield cure
    yield embedded.headline
    yield f"{composite.body} with all that it carries: {short(composite.mass)} kg"
    for a in several[:APPENDAGES]:
        yield f"{a.at}: {appendage_words(a.fit)}; kept: {'none' if rigid else modes_kept(a.fit)}"
    if len(several) > APPENDAGES:
        yield f"and {len(several) - APPENDAGES} more appendages"
    if not rigid:
        first = list(_first_modes(embedded))
        among = ", among them" * (len(embedded.assembly.judged) > len(first))
        yield f"{modes_sentence(embedded)}{among}{':' if first else ''}"
        yield from first


def _first_modes(embedded: "Embedded") -> Iterator[str]:
    """The first kept mode, and the one that adds most to the motion that scenes are about."""
    rows = [mode for mode in embedded.assembly.modes if mode.kept and mode.error is not None]
    if not rows:
        return
    motions = embedded.promise.motions
    first, most = rows[0], max(rows, key=lambda mode: sum(mode.moved[k] ** 2 for k in motions))
    for mode in [first] if most is first else [first, most]:
        assert mode.mujoco is not None
        assert mode.error is not None
        beyond = mode.mujoco > embedded.band
        more = f"; above the band, off by {abs(mode.error):.1e}" if beyond else ""
        hz = short(mode.mujoco / math.tau)
        yield f"  {mode.mujoco:.4g} rad/s ({hz} Hz): {mode.words}{more}"


def embedded_tiles(embedded: "Embedded") -> list[tuple[str, str]]:
    """Error in continuous time and at the step, and what was added to the spacecraft."""
    tolerance = embedded.tolerance
    asked = "" if tolerance is None else f", {tolerance:g} asked"
    band = f"up to {short(embedded.band)} rad/s"
    tiles = [(f"{embedded.craft_error:.2e}", f"largest error of the motion {band}{asked}")]
    if embedded.by_step:
        step = float(embedded.model.opt.timestep)
        tiles.append((f"{embedded.sampled_error:.2e}", f"the same when stepped at {step:g} s"))
    added = embedded.model.nv - embedded.craft.nv
    words = f"added to the {embedded.craft.nv} of the spacecraft"
    return [*tiles, (f"{added} degrees of freedom", words)]


def plant_tiles(plant: "Plant", several: "Sequence[Margins]") -> list[tuple[str, str]]:
    """The margins of every loop, of many the smallest; without a controller the modes."""
    if not several:
        return [(str(plant.nstates), "states"), (str(len(plant.modes)), "flexible modes")]
    tiles: list[tuple[str, str]] = []
    for pose, loop in _smallest(several)[:LOOPS]:
        name = f"{pose}: {loop.name}" if pose else loop.name
        if loop.stable:
            gain, phase = _at(loop.gain_db, "dB"), _at(loop.phase, "degrees")
            tiles.append((f"gain {gain}, phase {phase}", f"margins of {name}"))
        else:
            tiles.append(("unstable", name))
    return tiles


def appendage_words(fit: "Fit") -> str:
    """Name, length, mass and first frequency of an appendage whose root is held."""
    said = size_words(fit)
    first = [model.frequencies[0] for model in fit.body.ports.values() if model.modes]
    if not first:
        return said
    return f"{said}, first frequency {short(min(first))} rad/s ({short(min(first) / math.tau)} Hz)"


def plant_lines(plant: "Plant") -> Iterator[str]:
    """Its size, and the range of its flexible modes."""
    inputs, outputs = (_listed(names) for names in (plant.input_names, plant.output_names))
    yield f"{plant.nstates} states; inputs: {inputs}; outputs: {outputs}"
    if not plant.modes:
        yield "no flexible modes"
        return
    slow, fast = (short(float(pick(plant.frequency))) for pick in (np.min, np.max))
    least, most = (f"{float(pick(plant.damping_ratio)):.3g}" for pick in (np.min, np.max))
    ratios = f"damping ratios {least} to {most}"
    yield f"{len(plant.modes)} flexible modes: {slow} to {fast} rad/s, {ratios}"


def margin_lines(several: "Sequence[Margins]") -> Iterator[str]:
    """The margins of every loop, of many the smallest."""
    loops = _smallest(several)
    for pose, loop in loops[:LOOPS]:
        yield f"{pose}: {_margin_words(loop)}" if pose else _margin_words(loop)
    if len(loops) > LOOPS:
        yield f"and {len(loops) - LOOPS} loops with larger margins"


def _smallest(several: "Sequence[Margins]") -> "list[tuple[str, LoopMargins]]":
    """Every loop with its pose, unstable ones first, then those with the smallest margins."""
    loops = [(margins.pose, loop) for margins in several for loop in margins.loops]
    return sorted(loops, key=lambda pair: (pair[1].stable, np.nan_to_num(pair[1].disk)))


def _margin_words(loop: "LoopMargins") -> str:
    if not loop.stable:
        return f"{loop.name}: unstable"
    margins = {
        "gain": _at(loop.gain_db, "dB", loop.gain_frequency),
        "phase": _at(loop.phase, "degrees", loop.phase_frequency),
        "delay": _at(loop.delay, "s"),
    }
    return f"{loop.name}: " + ", ".join(f"{name} margin {said}" for name, said in margins.items())


def _at(value: float, unit: str, frequency: float = math.nan) -> str:
    """A margin, and the frequency at which it is."""
    if not math.isfinite(value):
        return "without limit"
    at = f" at {frequency:.3g} rad/s" if math.isfinite(frequency) else ""
    return f"{value:.3g} {unit}{at}"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - NAMES} more" if len(names) > NAMES else ""
    return ", ".join(names[:NAMES]) + more
