"""The page of a plant: modes and their gains, responses, poles, and the margins of a controller."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from beamchain.craft.plants.loops import HEAD, Margins, told
from beamchain.craft.plants.realisation import Plant
from beamchain.craft.robust.uncertain_plant import WorstCase
from beamchain.report import plant_plots
from beamchain.report.page import Table, Verdict, page_text
from beamchain.report.svg import to_svg

if TYPE_CHECKING:
    from beamchain.craft.plants.scheduled import ScheduledPlant


def plant_report(
    found: "Plant | ScheduledPlant", of_loops: Sequence[Sequence[Margins]], name: str, worst: Sequence[WorstCase] = ()
) -> str:
    """The text of one HTML file; `of_loops`, `worst`: margins and worst case per plant, empty where there are none."""
    plants = [found] if isinstance(found, Plant) else list(found.plants)
    figures = {"bode": plant_plots.bode_figure(plants), "singular": plant_plots.singular_figure(plants)}
    figures["poles"] = plant_plots.poles_figure(plants)
    if of_loops and of_loops[0]:
        figures["nichols"] = plant_plots.nichols_figure([one for several in of_loops for one in several])
    if not isinstance(found, Plant):
        figures["angles"] = plant_plots.scheduled_figure(found)
    if worst:
        figures["worst"], figures["drawn"] = plant_plots.worst_figure(worst), plant_plots.drawn_figure(worst)
    return page_text(
        "plant.html",
        name=name,
        plant=plants[0],
        scheduled=None if isinstance(found, Plant) else found,
        verdict=_verdict(plants[0], of_loops, worst),
        modes=_modes(plants[0]),
        gains=_gains(plants[0]),
        warnings=told(plants, of_loops),
        margins=_margins(of_loops),
        worst=_worst(worst),
        worst_values=_worst_values(worst),
        drawn={key: to_svg(figure, key) for key, figure in figures.items()},
    )


def _verdict(plant: Plant, of_loops: Sequence[Sequence[Margins]], of_samples: Sequence[WorstCase]) -> Verdict:
    every = [one for several in of_loops for one in several]
    size = f"{plant.nstates} states, {len(plant.modes)} flexible modes"
    if not every:
        return Verdict(True, f"{size}; no controller was given.")
    if not all(one.stable for one in every):
        return Verdict(False, f"{size}; the closed loop is unstable.")
    if not all(one.stable for one in of_samples):
        return Verdict(False, f"{size}; the closed loop is unstable for some values of the uncertain quantities.")
    worst = min(every, key=lambda one: one.disk)
    return Verdict(
        True,
        f"{size}; every closed loop is stable, least disk margin {worst.disk:.3g} "
        f"({worst.name}) at {worst.disk_frequency:.4g} rad/s.",
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
    rows = [
        ((f"{i}: " if row[0] and len(of_loops) > 1 else "") + row[0], *row[1:])
        for i, several in enumerate(of_loops, 1)
        for one in several
        for row in one.rows()
    ]
    return Table(rows, HEAD, note="Each input of the plant broken, the loops of the others closed; dead times are exact. The "
                 "least margins, over all crossovers. Disk margin: balanced (skew 0), gain and phase changing together. An "
                 "unstable closed loop has no margins.")  # fmt: skip


def _worst(several: Sequence[WorstCase]) -> Table:
    def words(value: float) -> str:
        return f"{value:.5g}" if math.isfinite(value) else "none"

    rows = [
        (
            f"{i}: {one.input} → {one.output}" if len(several) > 1 else f"{one.input} → {one.output}",
            words(float(one.stability.max())), words(one.upper), words(one.gain) if one.stable else "unstable",
            words(one.simulated), words(one.frequency), words(float(max(one.drawn, default=math.nan))), one.unit,
        )
        for i, one in enumerate(several, 1)
    ]  # fmt: skip
    head = ("disturbance → output", "structured singular value at most", "gain at most", "worst sample, predicted",
            "worst sample, MuJoCo", "at, rad/s", "worst of the draws", "unit")  # fmt: skip
    return Table(rows, head, note="Peak gains over frequency. Below one, the structured singular value says that the loop is "
                 "stable for all values. Bounds hold at the frequencies of the picture.")  # fmt: skip


def _worst_values(several: Sequence[WorstCase]) -> Table:
    if not several:
        return Table([], ())
    rows = [(name, *(f"{one.values[name]:.6g}" for one in several)) for name in several[0].values]
    head = (
        "quantity",
        *(f"worst sample {i}" if len(several) > 1 else "worst sample" for i in range(1, len(several) + 1)),
    )
    return Table(rows, head)
