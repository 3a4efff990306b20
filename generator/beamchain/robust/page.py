"""The page of a worst case."""

from collections.abc import Sequence
from pathlib import Path

from beamchain.report import Verdict, page_text, to_svg
from beamchain.robust import plots
from beamchain.robust.tables import worst_table, worst_value_table
from beamchain.robust.worst_gains import WorstCase


def worst_case_page(cases: Sequence[WorstCase], name: str, warnings: Sequence[str]) -> str:
    """The text of one HTML file, of a worst case at every pose."""
    worst = max(cases, key=lambda case: case.gain)
    figures = {"worst": plots.worst_figure(cases), "drawn": plots.drawn_figure(cases)}
    return page_text(
        "worst_case.html",
        Path(__file__).parent,
        name=name,
        verdict=Verdict(worst.stable, f"{worst.sentence}."),
        warnings=warnings,
        worst=worst_table(cases),
        worst_values=[worst_value_table(case) for case in cases],
        bounds=[case.bound.sentence for case in cases if case.bound],
        drawn={key: to_svg(figure, key) for key, figure in figures.items()},
    )
