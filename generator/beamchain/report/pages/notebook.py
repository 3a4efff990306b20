"""What results show of themselves in a notebook cell and at a prompt: a few lines,
never their arrays."""

from html import escape
from typing import TYPE_CHECKING

import numpy as np

from beamchain.report.formats import number, relative, step_text, typeset
from beamchain.report.headlines import modes_sentence
from beamchain.report.table import Table
from beamchain.report.tables.embed import coupled_table
from beamchain.report.tables.fit import every_mode, mode_table
from beamchain.report.tables.plant import closed_loop_table, margin_table
from beamchain.report.tables.recovery import recovery_table

if TYPE_CHECKING:
    from collections.abc import Iterable

    from beamchain.control.margins import Margins
    from beamchain.craft.embedded import Embedded
    from beamchain.craft.histories import Recovery
    from beamchain.fitting.result import Fit


def fit_text(fit: "Fit") -> str:
    """One line per fact."""
    lines = [f"<Fit {fit.spec.name!r}: {fit.status.message}>", fit.headline]
    for mode in every_mode(fit):
        frequency_error = relative(mode.frequency_error)
        participation_error = relative(mode.participation_error)
        lines.append(
            f"{mode.port} {mode.number}: {number(mode.target_frequency)} rad/s, "
            f"readback error {frequency_error}, participation {participation_error}"
        )
    return "\n  ".join(lines)


def fit_html(fit: "Fit") -> str:
    """The message, the modes and what to know before use."""
    steps = fit.written_limits.largest_step
    finite = {name: step for name, step in steps.items() if np.isfinite(step)}
    notes = [fit.headline]
    if finite:
        limits = ", ".join(f"{name} {step_text(step)} s" for name, step in finite.items())
        notes.append(f"largest stable step: {limits}")
    notes += [f"warning: {text}" for text in fit.warnings]
    title = f"{fit.spec.name}: {fit.status.message}"
    return table_html(mode_table(fit, title), notes)


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


def recovery_html(recovery: "Recovery") -> str:
    """The extremes inside an appendage."""
    table = recovery_table(recovery)
    return table_html(table, title=table.title)


def table_html(table: Table, notes: "Iterable[str]" = (), title: str = "") -> str:
    """A table below its title, above its notes and further ones."""
    shown = table.brief()
    head = "".join(f"<th>{escape(text)}</th>" for text in shown.head)
    body = "".join(_row_html(row) for row in shown.rows)
    below = "".join(f"<div>{escape(note)}</div>" for note in (*table.notes, *notes))
    heading = escape(title or table.title)
    return f"<div><b>{heading}</b><table><tr>{head}</tr>{body}</table>{below}</div>"


def _row_html(cells: tuple[str, ...]) -> str:
    return "<tr>" + "".join(f"<td>{escape(typeset(cell))}</td>" for cell in cells) + "</tr>"
