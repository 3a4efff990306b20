"""The page of a plant: modes and their gains, responses, poles, and the margins of a controller."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from beamchain.plants.loops import Margins, margin_warnings
from beamchain.plants.realisation import Plant
from beamchain.plants.uncertain_plant import WorstCase
from beamchain.report import plant_plots
from beamchain.report.page import Verdict, page_text
from beamchain.report.svg import to_svg
from beamchain.report.tables import plant as tables

if TYPE_CHECKING:
    from beamchain.plants.scheduled import ScheduledPlant


def plant_report(
    found: "Plant | ScheduledPlant",
    of_loops: Sequence[Sequence[Margins]],
    name: str,
    worst: Sequence[WorstCase] = (),
) -> str:
    """The text of one HTML file; `of_loops`, `worst`: margins and worst case per plant,
    empty where there are none."""
    plants = [found] if isinstance(found, Plant) else list(found.plants)
    figures = {
        "bode": plant_plots.bode_figure(plants),
        "singular": plant_plots.singular_figure(plants),
    }
    figures["poles"] = plant_plots.poles_figure(plants)
    if of_loops and of_loops[0]:
        figures["nichols"] = plant_plots.nichols_figure(
            [one for several in of_loops for one in several]
        )
    if not isinstance(found, Plant):
        figures["angles"] = plant_plots.scheduled_figure(found)
    if worst:
        figures["worst"] = plant_plots.worst_figure(worst)
        figures["drawn"] = plant_plots.drawn_figure(worst)
    return page_text(
        "plant.html",
        name=name,
        plant=plants[0],
        scheduled=None if isinstance(found, Plant) else found,
        verdict=_verdict(plants[0], of_loops, worst),
        inputs=tables.signal_table("Inputs", plants[0].input_names, plants[0].input_units),
        outputs=tables.signal_table("Outputs", plants[0].output_names, plants[0].output_units),
        modes=tables.mode_table(plants[0]),
        gains=tables.gain_table(plants[0]),
        warnings=margin_warnings(plants, of_loops),
        margins=tables.margin_table(of_loops),
        worst=tables.worst_table(worst),
        worst_values=[tables.worst_value_table(case) for case in worst],
        bounds=[case.bound.sentence for case in worst if case.bound],
        drawn={key: to_svg(figure, key) for key, figure in figures.items()},
    )


def _verdict(
    plant: Plant, of_loops: Sequence[Sequence[Margins]], of_samples: Sequence[WorstCase]
) -> Verdict:
    every = [one for several in of_loops for one in several]
    size = f"{plant.nstates} states, {len(plant.modes)} flexible modes"
    if not every:
        return Verdict(True, f"{size}; no controller was given.")
    if not all(one.stable for one in every):
        return Verdict(False, f"{size}; the closed loop is unstable.")
    if not all(one.stable for one in of_samples):
        return Verdict(
            False,
            f"{size}; the closed loop is unstable for some values of the uncertain quantities.",
        )
    worst = min(every, key=lambda one: one.disk)
    return Verdict(
        True,
        f"{size}; every closed loop is stable, least disk margin {worst.disk:.3g} "
        f"({worst.name}) at {worst.disk_frequency:.4g} rad/s.",
    )
