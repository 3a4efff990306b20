"""The page of a pointing budget."""

from pathlib import Path

from beamchain.pointing.plots import pointing_figure
from beamchain.pointing.pointing import Pointing
from beamchain.report import Verdict, page_text, to_svg


def pointing_page(budget: Pointing, name: str) -> str:
    """The text of one HTML file."""
    figures = {}
    if any(source.curve is not None for source in budget.sources):
        figures["pointing"] = pointing_figure(budget)
    return page_text(
        "pointing.html",
        Path(__file__).parent,
        name=name,
        verdict=Verdict(True, f"{len(budget.sources)} sources, {len(budget.outputs)} outputs."),
        budget=budget,
        drawn={key: to_svg(figure, key) for key, figure in figures.items()},
    )
