"""What results show of themselves: reports, pictures, records, notebook views.

The one door through which the `plot`, `write`, `as_dict` and `_repr_html_` of results reach them;
results know nothing else of reports, and nothing is imported before it is asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from beamchain.late import importing

if TYPE_CHECKING:
    from beamchain.report.craft_plots import assembly_svg as assembly_svg
    from beamchain.report.craft_plots import plot_assembly as plot_assembly
    from beamchain.report.craft_plots import sweep_pictures as sweep_pictures
    from beamchain.report.margin_plots import nichols_figure as nichols_figure
    from beamchain.report.margin_plots import open_loop_figure as open_loop_figure
    from beamchain.report.pages.embed import embed_report as embed_report
    from beamchain.report.pages.fit import fit_report as fit_report
    from beamchain.report.pages.identification import identification_html as identification_html
    from beamchain.report.pages.identification import identification_page as identification_page
    from beamchain.report.pages.identification import plot_identification as plot_identification
    from beamchain.report.pages.notebook import embedded_html as embedded_html
    from beamchain.report.pages.notebook import embedded_text as embedded_text
    from beamchain.report.pages.notebook import fit_html as fit_html
    from beamchain.report.pages.notebook import fit_text as fit_text
    from beamchain.report.pages.notebook import margins_html as margins_html
    from beamchain.report.pages.notebook import pointing_html as pointing_html
    from beamchain.report.pages.notebook import recovery_html as recovery_html
    from beamchain.report.pages.notebook import table_html as table_html
    from beamchain.report.pages.study import study_page as study_page
    from beamchain.report.plant_plots import plot_pointing as plot_pointing
    from beamchain.report.plant_plots import plot_scheduled as plot_scheduled
    from beamchain.report.plant_plots import plot_worst as plot_worst
    from beamchain.report.plots import plot_accelerance as plot_accelerance
    from beamchain.report.recovery_plots import plot_recovery as plot_recovery
    from beamchain.report.table import Table as Table
    from beamchain.report.tables.plant import margin_table as margin_table
    from beamchain.report.tables.plant import worst_margin_table as worst_margin_table
    from beamchain.report.tables.plant import worst_table as worst_table
    from beamchain.report.tables.plant import worst_value_table as worst_value_table
    from beamchain.report.tables.pointing import pointing_mode_table as pointing_mode_table
    from beamchain.report.tables.pointing import pointing_table as pointing_table
    from beamchain.report.tables.record import embed_record as embed_record
    from beamchain.report.tables.record import fit_record as fit_record
    from beamchain.report.tables.record import inspection_record as inspection_record
    from beamchain.report.tables.record import study_record as study_record
    from beamchain.report.tables.recovery import recovery_record as recovery_record
    from beamchain.report.tables.recovery import recovery_table as recovery_table

_PLACES = {
    "craft_plots": ("assembly_svg", "plot_assembly", "sweep_pictures"),
    "pages.embed": ("embed_report",),
    "pages.fit": ("fit_report",),
    "pages.identification": ("identification_html", "identification_page", "plot_identification"),
    "pages.notebook": (
        "embedded_html",
        "embedded_text",
        "fit_html",
        "fit_text",
        "margins_html",
        "pointing_html",
        "recovery_html",
        "table_html",
    ),
    "plant_plots": ("plot_pointing", "plot_scheduled", "plot_worst"),
    "margin_plots": ("nichols_figure", "open_loop_figure"),
    "plots": ("plot_accelerance",),
    "table": ("Table",),
    "tables.plant": ("margin_table", "worst_margin_table", "worst_table", "worst_value_table"),
    "tables.pointing": ("pointing_mode_table", "pointing_table"),
    "recovery_plots": ("plot_recovery",),
    "tables.record": ("embed_record", "fit_record", "inspection_record", "study_record"),
    "tables.recovery": ("recovery_record", "recovery_table"),
    "pages.study": ("study_page",),
}
_HOME = {name: module for module, names in _PLACES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'beamchain.report' has no attribute {name!r}")
    with importing:
        return getattr(import_module(f"beamchain.report.{_HOME[name]}"), name)
