"""The page of a plant: modes and their gains, responses, poles, and the margins of a controller."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from beamchain.craft.plants.loops import Margins
from beamchain.craft.plants.realisation import Plant
from beamchain.report import plant_plots
from beamchain.report.page import Table, Verdict, page_text
from beamchain.report.plots import to_svg

if TYPE_CHECKING:
    from beamchain.craft.plants.scheduled import ScheduledPlant


def plant_report(found: "Plant | ScheduledPlant", of_loops: Sequence[Sequence[Margins]], name: str) -> str:
    """The text of one HTML file; `of_loops`: margins per plant, empty without a controller; `name` of the model's file."""
    plants = [found] if isinstance(found, Plant) else list(found.plants)
    figures = {"bode": plant_plots.bode_figure(plants), "singular": plant_plots.singular_figure(plants)}
    figures["poles"] = plant_plots.poles_figure(plants)
    if of_loops and of_loops[0]:
        figures["nichols"] = plant_plots.nichols_figure([one for several in of_loops for one in several])
    if not isinstance(found, Plant):
        figures["angles"] = plant_plots.scheduled_figure(found)
    return page_text(
        "plant.html",
        name=name,
        plant=plants[0],
        scheduled=None if isinstance(found, Plant) else found,
        verdict=_verdict(plants[0], of_loops),
        modes=_modes(plants[0]),
        gains=_gains(plants[0]),
        margins=_margins(of_loops),
        drawn={key: to_svg(figure, key) for key, figure in figures.items()},
    )


def _verdict(plant: Plant, of_loops: Sequence[Sequence[Margins]]) -> Verdict:
    every = [one for several in of_loops for one in several]
    size = f"{plant.nstates} states, {len(plant.modes)} flexible modes"
    if not every:
        return Verdict(True, f"{size}; no controller was given.")
    if not all(one.stable for one in every):
        return Verdict(False, f"{size}; the closed loop is unstable.")
    worst = min(every, key=lambda one: one.disk)
    return Verdict(
        True,
        f"{size}; every closed loop is stable, least disk margin {worst.disk:.3g} "
        f"({worst.loop.input} from {worst.loop.output}) at {worst.disk_frequency:.4g} rad/s.",
    )


def _modes(plant: Plant) -> Table:
    rows = [
        (name, f"{w:.6g}", f"{w / math.tau:.5g}", f"{z:.3g}")
        for name, w, z in zip(plant.modes, plant.frequency, plant.damping_ratio, strict=True)
    ]
    return Table(rows, ("mode", "rad/s", "Hz", "damping ratio"))


def _gains(plant: Plant) -> Table:
    pairs = [(i, j) for i in range(plant.noutputs) for j in range(plant.ninputs)]
    strong = sorted(pairs, key=lambda at: -float(plant.gain[:, at[0], at[1]].max(initial=0.0)))[:6]
    head = ("mode", *(f"{plant.input_labels[j]} → {plant.output_labels[i]}" for i, j in strong))
    least = 1e-9 * plant.gain.max(axis=0, initial=0.0).max(initial=0.0)  # below: rounding
    rows = [
        (name, *(f"{g:.3g}" if (g := float(plant.gain[k, i, j])) > least else "0" for i, j in strong))
        for k, name in enumerate(plant.modes)
    ]
    return Table(rows, head, note="Size of the mode's numerator over s² + 2ζωs + ω², at s = jω; the six largest pairs.")


def _margins(of_loops: Sequence[Sequence[Margins]]) -> Table:
    def words(value: float) -> str:
        return f"{value:.4g}" if math.isfinite(value) else "no limit"

    rows = [
        (
            f"{i}: {m.loop.input} from {m.loop.output}" if len(of_loops) > 1 else f"{m.loop.input} from {m.loop.output}",
            "stable" if m.stable else "unstable", words(m.gain), words(m.gain_frequency), words(m.lowest_gain),
            words(m.phase), words(m.delay), words(m.disk), words(m.disk_frequency),
        )
        for i, several in enumerate(of_loops, 1)
        for m in several
    ]  # fmt: skip
    head = ("loop", "closed loop", "gain up to, factor", "rings at, rad/s", "gain down to, factor", "phase, degrees",
            "delay, s", "disk margin", "at, rad/s")  # fmt: skip
    return Table(rows, head, note="Each loop broken at the plant's input, the others closed; dead times are exact. Disk margin:"
                 " balanced (skew 0), gain and phase changing together.")  # fmt: skip
