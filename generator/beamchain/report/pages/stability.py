"""The page of `inspect --steps`: steps that hold, and how far a chain may be driven."""

from pathlib import Path
from typing import TYPE_CHECKING

from beamchain.fitting.spec import read_spec
from beamchain.fitting.spec_text import spec_toml
from beamchain.report.page import Verdict, page_text
from beamchain.report.tables import stability as tables
from beamchain.report.tables.steps import step_table

if TYPE_CHECKING:
    from beamchain.craft.stability import StabilityStudy


def stability_report(study: "StabilityStudy", source: Path) -> str:
    """The text of the page; `source` is the SPEC.toml or MODEL.xml."""
    return page_text(
        "stability.html",
        name=source.stem,
        verdict=Verdict(not study.warnings, study.own_step),
        study=study,
        source=source,
        tables=tables,
        steps=step_table({each.name: each for each in study.budgets}, ""),
        names={limits.name.split()[0] for limits in study.budgets if limits.name},
        spec="" if source.suffix.lower() == ".xml" else spec_toml(read_spec(source)),
    )
