"""report.html: what was asked, what came out, how far it is from the beam; one file, nothing fetched."""

import platform
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import jinja2
import numpy as np

from beamchain.report import imported, plots, sections

if TYPE_CHECKING:
    from beamchain.result import Fit


def fit_report(fit: "Fit") -> tuple[str, dict[str, str]]:
    """The report and its pictures.

    Returns:
        The text of report.html, and the text of the SVG files to stand beside it, by name.
    """
    pictures: dict[str, str] = {}
    for port in fit.target:
        pictures[f"accelerance_{port}.svg"] = plots.to_svg(plots.accelerance_figure(fit, port), f"accelerance_{port}")
        pictures[f"error_{port}.svg"] = plots.to_svg(plots.error_figure(fit, port), f"error_{port}")
    draw = plots.chain_figure if fit.oscillators is None else imported.oscillators_figure
    pictures["chain.svg"] = plots.to_svg(draw(fit), "chain")
    record, rivals = fit.as_dict(), sections.rival_errors(fit)
    page = _template().render(
        name=fit.spec.name,
        sections=imported.with_imported(
            fit, sections.all_sections(fit, pictures, rivals, record["left_out"]), pictures
        ),
        verdict=sections.verdict(fit, rivals),
        versions=f"beamchain {record['beamchain']}, MuJoCo {record['mujoco']}, NumPy {np.__version__}, "
        f"Python {platform.python_version()}. SI units, radians; x runs from the root outwards.",
    )
    return page, pictures


@cache
def _template() -> jinja2.Template:
    loader = jinja2.FileSystemLoader(Path(__file__).parent / "templates")
    return jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined).get_template(
        "report.html"
    )
