"""report.html: what was asked, what came out, how far it is from the beam; one file, nothing fetched."""

from typing import TYPE_CHECKING

from beamchain.report import imported, plots, sections
from beamchain.report.page import page_text, versions
from beamchain.report.verdict import rival_errors, verdict

if TYPE_CHECKING:
    from beamchain.fitting.result import Fit


def fit_report(fit: "Fit") -> tuple[str, dict[str, str]]:
    """The report and its pictures.

    Returns:
        The text of report.html, and the text of the SVG files to stand beside it, by name.
    """
    pictures: dict[str, str] = {}
    for port in fit.target:
        pictures[f"accelerance_{port}.svg"] = plots.to_svg(plots.accelerance_figure(fit, port), f"accelerance_{port}")
        pictures[f"error_{port}.svg"] = plots.to_svg(plots.error_figure(fit, port), f"error_{port}")
    pictures["chain.svg"] = plots.to_svg(plots.chain_figure(fit), "chain")
    record, rivals = fit.as_dict(), rival_errors(fit)
    page = page_text(
        "report.html",
        name=fit.spec.name,
        sections=imported.with_imported(fit, sections.all_sections(fit, pictures, rivals, record["left_out"])),
        verdict=verdict(fit, rivals),
        versions=versions(),
    )
    return page, pictures
