"""The page of a plant: modes and their gains, responses, poles, and the margins of a controller."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from beamchain.control.margins import Margins
from beamchain.control.realisation import Plant
from beamchain.control.verdicts import margin_warnings
from beamchain.report import margin_plots, plant_plots
from beamchain.report.page import Verdict, page_text
from beamchain.report.plots import drawing, panel
from beamchain.report.svg import to_svg
from beamchain.report.tables import plant as tables
from beamchain.report.tables.first_screen import plant_tiles

if TYPE_CHECKING:
    from beamchain.control.scheduled import ScheduledPlant


def plant_report(
    found: "Plant | ScheduledPlant",
    of_loops: Sequence[Margins],
    name: str,
) -> str:
    """The text of one HTML file; `of_loops`: margins per plant, empty where there are none."""
    scheduled = None if isinstance(found, Plant) else found
    plants = [found] if isinstance(found, Plant) else list(found.plants)
    labels = () if scheduled is None else scheduled.labels
    figures = {"bode": plant_plots.bode_figure(plants, labels)}
    if of_loops:
        figures["loops"] = margin_plots.open_loop_figure(of_loops)
        figures["nichols"] = margin_plots.nichols_figure(of_loops)
        figures["sensitivities"] = margin_plots.sensitivity_figure(of_loops)
        figures["closed"] = margin_plots.closed_poles_figure(of_loops)
    if scheduled is not None:
        with drawing():
            figures["angles"], ax = panel(4.4)
            plant_plots.plot_scheduled(scheduled, ax)
    return page_text(
        "plant.html",
        name=name,
        plant=plants[0],
        scheduled=scheduled,
        of_loops=of_loops,
        tables=tables,
        verdict=_verdict(plants[0], of_loops),
        tiles=plant_tiles(plants[0], of_loops),
        warnings=margin_warnings(plants, of_loops),
        drawn={key: to_svg(figure, key) for key, figure in figures.items()},
    )


def _verdict(plant: Plant, of_loops: Sequence[Margins]) -> Verdict:
    size = f"{plant.nstates} states, {len(plant.modes)} flexible modes"
    if not of_loops:
        return Verdict(True, f"{size}; no controller was given.")
    if unstable := [margins for margins in of_loops if not margins.stable]:
        why = " ".join(unstable[0].reasons)
        named = "; ".join(margins.pose for margins in unstable if margins.pose)
        where = f" at {named}" if named else ""
        if len(unstable) > 1 and why:
            why = f"At {unstable[0].pose}: {why}"
        return Verdict(False, f"{size}; the closed loop{where} is unstable. {why}".strip())
    every = [(margins.pose, loop) for margins in of_loops for loop in margins.loops]
    pose, worst = min(every, key=lambda at: at[1].disk)
    where = f"{pose}, {worst.name}" if pose else worst.name
    at_once = min(of_loops, key=lambda margins: margins.all_at_once.value)
    of_all = f"{at_once.all_at_once.value:.3g} of all loops at once"
    of_all += f" ({at_once.pose})" if at_once.pose else ""
    return Verdict(
        True,
        f"{size}; every closed loop is stable, least disk margin {worst.disk:.3g} "
        f"({where}) at {worst.disk_frequency:.4g} rad/s, {of_all}.",
    )
