"""What a fit or an embedding shows of itself in a notebook cell and at a prompt: a few lines, never its arrays."""

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from beamchain.craft.assembly import Assembly, Mode
    from beamchain.craft.embedded import Embedded
    from beamchain.fitting.result import Fit

HEAD = ("port", "mode", "cantilever, rad/s", "through MuJoCo", "readback, frequency", "readback, participation")
COUPLED = ("mode", "exact, rad/s", "through MuJoCo", "error", "kept")


def fit_text(fit: "Fit") -> str:
    """One line per fact."""
    rows = [f"{port} {k}: {w} rad/s, readback error {dw}, participation {dl}" for port, k, w, _, dw, dl in _modes(fit)]
    return "\n  ".join([f"<Fit {fit.spec.name!r}: {fit.status.message}>", fit.headline, *rows])


def fit_html(fit: "Fit") -> str:
    """The message, the modes and what to know before use."""
    steps = fit.limits.largest_step
    limits = ", ".join(f"{name} {h:.4g} s" for name, h in steps.items() if np.isfinite(h))
    notes = [fit.headline, *([f"largest stable step: {limits}"] if limits else [])]
    notes += [f"warning: {text}" for text in fit.warnings]
    return block(f"{fit.spec.name}: {fit.status.message}", HEAD, _modes(fit), notes)


def embedded_text(done: "Embedded") -> str:
    """One line per fact."""
    places = ", ".join(f"{a.spec.name} at {a.at}" for a in done.appendages)
    line = f"<Embedded {places}; {done.headline} Worst kept coupled mode off by {done.assembly.worst:.1e}>"
    return "\n  note: ".join([line, *done.warnings])


def embedded_html(done: "Embedded") -> str:
    """Where the appendages are, the coupled modes, the warnings."""
    title = ", ".join(f"{a.spec.name} at {a.at} ({a.fit.kept_for} target)" for a in done.appendages)
    rows = [
        [str(i), _value(m.exact, ".6g"), _value(m.mujoco, ".6g"), _value(m.error, ".1e"), kept_word(done.assembly, m)]
        for i, m in enumerate(done.assembly.modes, 1)
    ]
    notes = [done.headline, done.assembly.worst_told]
    notes += [f"note: {text}" for text in done.warnings]
    return block(title, COUPLED, rows, notes)


def _modes(fit: "Fit") -> list[list[str]]:
    """Kept modes, port by port, slowest first."""
    return [
        [row.port, str(row.number), f"{row.frequency_rad_s:.6g}", f"{row.achieved_rad_s:.6g}",
         f"{row.frequency_error:.1e}", f"{row.participation_error:.1e}"]
        for row in fit.modes
    ]  # fmt: skip


def kept_word(assembly: "Assembly", mode: "Mode") -> str:
    """Whether a coupled mode is judged: yes, no, or kept but beyond the band."""
    return "yes" if mode in assembly.judged else "beyond the band" if mode.kept else "no"


def _value(number: float | None, form: str) -> str:
    return "none" if number is None else format(number, form)


def block(title: str, head: Sequence[str], rows: Sequence[Sequence[str]], notes: Iterable[str]) -> str:
    """A table below its title, above its notes."""
    top = "".join(f"<th>{escape(word)}</th>" for word in head)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    below = "".join(f"<div>{escape(note)}</div>" for note in notes)
    return f"<div><b>{escape(title)}</b><table><tr>{top}</tr>{body}</table>{below}</div>"
