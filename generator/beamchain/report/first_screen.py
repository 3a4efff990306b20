"""What a command says first: what was reached against what was asked, and what to do next.

At most twelve lines of 80 characters together with the notes and files; tables stand behind them.
"""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from beamchain.report.formats import short
from beamchain.report.headlines import (
    cure_sentence,
    fit_headline,
    modes_sentence,
    verdict_sentences,
)
from beamchain.report.tables.embed import modes_kept

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
    chain = fit.chain
    counts = [(len(chain.links), "link"), (len(chain.hinges), "hinge")]
    counts.append((len(chain.tendons), "tendon"))
    parts = ", ".join(
        f"{count} {word}{'s' if count > 1 else ''}" for count, word in counts if count
    )
    yield f"{appendage_words(fit)}; kept: {modes_kept(fit)}; {parts}"
    yield from verdict_sentences(fit)
    if fit.promise is None:
        yield fit_headline(fit)
    integrator = fit.spec.integrator
    limit = fit.written_limits.largest_step.get(integrator, np.inf)
    if np.isfinite(limit):
        yield f"largest stable step: {limit:.4g} s ({integrator})"


def embedded_lines(embedded: "Embedded") -> Iterator[str]:
    """The error of the whole against the tolerance, and what hangs on it."""
    if cure := cure_sentence(embedded):
        yield cure
    yield embedded.headline
    composite, several = embedded.composite, embedded.appendages
    yield f"{composite.body} with all that it carries: {short(composite.mass)} kg"
    for a in several[:APPENDAGES]:
        yield f"{a.at}: {appendage_words(a.fit)}; kept: {modes_kept(a.fit)}"
    if len(several) > APPENDAGES:
        yield f"and {len(several) - APPENDAGES} more appendages"
    yield modes_sentence(embedded)


def appendage_words(fit: "Fit") -> str:
    """Name, length, mass and first frequency of an appendage whose root is held."""
    mass = float(fit.measured.rigid_mass[0, 0])
    said = f"{fit.spec.name}: {short(fit.line.length)} m, {short(mass)} kg"
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
    yield (
        f"{len(plant.modes)} flexible modes: {slow} to {fast} rad/s, damping ratios {least} to "
        f"{most}"
    )


def margin_lines(several: "Sequence[Margins]") -> Iterator[str]:
    """The margins of every loop, of many the smallest."""
    loops = [(margins.pose, loop) for margins in several for loop in margins.loops]
    loops.sort(key=lambda pair: (pair[1].stable, np.nan_to_num(pair[1].disk, nan=0.0)))
    for pose, loop in loops[:LOOPS]:
        yield f"{pose}: {_margin_words(loop)}" if pose else _margin_words(loop)
    if len(loops) > LOOPS:
        yield f"and {len(loops) - LOOPS} loops with larger margins"


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
