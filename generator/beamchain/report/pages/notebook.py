"""What results show of themselves in a notebook cell and at a prompt: a few lines,
never their arrays."""

from html import escape
from typing import TYPE_CHECKING

from beamchain.report.formats import number, relative, typeset
from beamchain.report.headlines import modes_sentence
from beamchain.report.table import Table
from beamchain.report.tables.embed import coupled_table
from beamchain.report.tables.fit import every_mode, mode_table
from beamchain.report.tables.plant import closed_loop_table, margin_table
from beamchain.report.tables.steps import step_sentence

if TYPE_CHECKING:
    from collections.abc import Iterable

    from beamchain.control.margins import Margins
    from beamchain.craft.embedded import Embedded
    from beamchain.fitting.result import Fit


def fit_text(fit: "Fit") -> str:
    """One line per fact."""
    lines = [f"<Fit {fit.spec.name!r}: {fit.status.message}>", fit.headline]
    for mode in every_mode(fit):
        frequency = f"{number(mode.target_frequency)} rad/s"
        error = f"readback error {relative(mode.frequency_error)}"
        participation = f"participation {relative(mode.participation_error)}"
        lines.append(f"{mode.port} {mode.number}: {frequency}, {error}, {participation}")
    return "\n  ".join(lines)


def fit_html(fit: "Fit") -> str:
    """The message, the modes and what to know before use."""
    warnings = (f"warning: {text}" for text in fit.warnings)
    notes = [fit.headline, step_sentence(fit.written_limits), *warnings]
    return table_html(mode_table(fit, f"{fit.spec.name}: {fit.status.message}"), notes)


def embedded_text(embedded: "Embedded") -> str:
    """One line per fact."""
    places = ", ".join(f"{a.spec.name} at {a.at}" for a in embedded.appendages)
    line = (
        f"<Embedded {places}; {embedded.headline} Worst kept coupled mode off by "
        f"{embedded.assembly.worst:.1e}>"
    )
    return "\n  note: ".join([line, *embedded.warnings])


def embedded_html(embedded: "Embedded") -> str:
    """Where the appendages are, the coupled modes, the warnings."""
    places = [f"{a.spec.name} at {a.at} ({a.fit.kept_for} target)" for a in embedded.appendages]
    notes = [embedded.headline, modes_sentence(embedded)]
    notes += [f"note: {text}" for text in embedded.warnings]
    return table_html(coupled_table(embedded.assembly), notes, title=", ".join(places))


def margins_html(margins: "Margins") -> str:
    """The margins, and what lies above the modes kept."""
    at_once = closed_loop_table([margins])
    return table_html(margin_table([margins]), margins.beyond) + table_html(at_once)


def table_html(table: Table, notes: "Iterable[str]" = (), title: str = "") -> str:
    """A table below its title, above its notes and further ones."""
    shown = table.brief()
    head = "".join(f"<th>{escape(text)}</th>" for text in shown.head)
    rows = ("".join(f"<td>{escape(typeset(cell))}</td>" for cell in row) for row in shown.rows)
    body = "".join(f"<tr>{cells}</tr>" for cells in rows)
    below = "".join(f"<div>{escape(note)}</div>" for note in (*table.notes, *notes))
    heading = escape(title or table.title)
    return f"<div><b>{heading}</b><table><tr>{head}</tr>{body}</table>{below}</div>"
