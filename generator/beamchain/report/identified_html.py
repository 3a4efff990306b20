"""What an identification shows: its page, its picture, its few lines in a notebook."""

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from beamchain.craft.identification.result import INTERVAL, Identification, IdentifiedMode
from beamchain.report.notebook import block
from beamchain.report.page import Table, Verdict, page_text
from beamchain.report.plots import BEAM, OURS, RIVAL, STYLE
from beamchain.report.svg import to_svg
from beamchain.structure.planes import MOTIONS

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_identification(found: Identification, ax: "Axes | None" = None, channel: str = "") -> "Axes":
    """Spectral densities of a channel: measured, modelled, and what is left.

    Args:
        found: the identification.
        ax: drawn into; those of a new figure where left out.
        channel: its name; the first where left out.
    """
    if ax is None:
        ax = Figure(figsize=(6.4, 3.6), layout="constrained").add_subplot()
    name = channel or next(iter(found.spectra), "")
    if name:
        omega, measured, modelled, left = found.spectra[name]
        ax.loglog(omega, np.sqrt(measured), color=BEAM, linewidth=1.6, label="measured")
        ax.loglog(omega, np.sqrt(modelled), color=OURS, linewidth=1.0, label="modelled")
        ax.loglog(omega, np.sqrt(left), color=RIVAL, linewidth=0.8, label="left")
        ax.legend(loc="best")
    ax.set_xlabel("frequency, rad/s")
    ax.set_ylabel(f"{name}, per sqrt(Hz)")
    return ax


def identification_html(found: Identification) -> str:
    """The modes and what to know of them, for a notebook cell."""
    notes = [*found.undetermined, *(f"warning: {text}" for text in found.warnings)]
    return block(
        f"Identification of {found.source}: {_sentence(found)}", _HEAD[:6], [row[:6] for row in mode_rows(found)], notes
    )


def identification_page(found: Identification, name: str) -> str:
    """The text of one HTML file."""
    figures = {f"spectrum{i}": _spectrum(found, channel) for i, channel in enumerate(found.spectra)}
    figures |= {"order": _stabilisation(found), "bars": _bars(found)}
    return page_text(
        "identification.html",
        name=name,
        found=found,
        verdict=Verdict(all(m.determined for m in found.modes), _sentence(found)),
        modes=Table(mode_rows(found), _HEAD, note="Intervals are of 95 %."),
        rows=_rows(found),
        orders=_orders(found),
        channels=_channels(found),
        factors=_factors(found),
        drawn={key: to_svg(figure, key) for key, figure in figures.items()},
    )


_HEAD = ("mode", "frequency, rad/s", "±", "damping ratio", "±", "determined", "remark")


def _sentence(found: Identification) -> str:
    sure = sum(m.determined for m in found.modes)
    return f"{sure} of {len(found.modes)} modes are determined in frequency and damping."


def mode_rows(found: Identification) -> list[tuple[str, ...]]:
    """Numbers, intervals of 95 % and remarks of the modes, as texts."""
    return [
        (
            str(m.number),
            f"{m.frequency:.7g}",
            f"{INTERVAL * m.frequency_std:.2g}",
            f"{m.damping:.4g}",
            f"{INTERVAL * m.damping_std:.2g}",
            "yes" if m.determined else "no",
            m.remark,
        )
        for m in found.modes
    ]


def _rows(found: Identification) -> Table:
    def cell(mode: IdentifiedMode, k: int) -> str:
        value, std = float(mode.participation[k]), float(mode.participation_std[k])
        return f"{value + 0.0:.5g}" + (f" ± {INTERVAL * std:.2g}" if np.isfinite(std) else ", unknown")

    cells = [(str(m.number), *(cell(m, k) for k in range(6))) for m in found.modes]
    note = "Mass-normalised, about the port, in the appendage's axes: sqrt(kg), m sqrt(kg)."
    return Table(cells, ("mode", *MOTIONS), note=note)


def _orders(found: Identification) -> Table:
    rows = [
        (str(o.modes), f"{o.criterion:.6g}", f"{o.gain:.4g}", ", ".join(f"{w:.5g}" for w in o.frequencies))
        for o in found.order
    ]
    note = "Bayesian information criterion of the raw model; gain: fall of minus twice the log likelihood over one mode fewer."
    return Table(rows, ("modes", "criterion", "gain", "coupled frequencies, rad/s"), note=note)


def _channels(found: Identification) -> Table:
    rows = [
        (name, f"{found.noise[name]:.4g}", f"{found.whiteness[name]:.2g}", f"{100 * found.held_out[name]:.3g} %")
        for name in found.noise
    ]
    return Table(rows, ("channel", "residual, deviation", "probability of white residuals", "held-out part, error"))


def _factors(found: Identification) -> Table:
    update = found.update
    if update is None:
        return Table([])
    widths = {k: f"{INTERVAL * std:.2g}" if np.isfinite(std) else "not determined" for k, std in update.std.items()}
    rows = [(name.replace("_", " "), f"{value:.6g}", widths[name]) for name, value in update.factors.items()]
    rows.append(("stiffness over mass", f"{update.ratio:.6g}", f"{INTERVAL * update.ratio_std:.2g}"))
    return Table(rows, ("factor on the prior's", "value", "±"))


@mpl.rc_context(STYLE)
def _spectrum(found: Identification, channel: str) -> Figure:
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    plot_identification(found, figure.add_subplot(), channel)
    return figure


@mpl.rc_context(STYLE)
def _stabilisation(found: Identification) -> Figure:
    figure = Figure(figsize=(6.4, 3.4), layout="constrained")
    ax = figure.add_subplot()
    for one in found.order:
        if one.modes:
            ax.semilogx(one.frequencies, np.full(len(one.frequencies), one.modes), "o", color=OURS, markersize=4.0)
    best = min((o for o in found.order if np.isfinite(o.criterion)), key=lambda o: o.criterion, default=None)
    if best is not None and best.modes:
        ax.axhline(best.modes, color=RIVAL, linewidth=0.8, linestyle="dashed")
    ax.set_xlabel("frequency of the coupled mode, rad/s")
    ax.set_ylabel("modes in the model")
    return figure


@mpl.rc_context(STYLE)
def _bars(found: Identification) -> Figure:
    figure = Figure(figsize=(6.4, 3.0), layout="constrained")
    for at, (kind, label) in enumerate((("frequency", "frequency"), ("damping", "damping ratio")), 1):
        ax = figure.add_subplot(1, 2, at)
        relative = [100.0 * INTERVAL * getattr(m, f"{kind}_std") / max(getattr(m, kind), 1e-300) for m in found.modes]
        colours = [OURS if m.determined else RIVAL for m in found.modes]
        ax.bar([str(m.number) for m in found.modes], relative, color=colours)
        if any(v > 0.0 for v in relative):
            ax.set_yscale("log")
        ax.set_xlabel("mode")
        ax.set_ylabel(f"{label}, ± % (95 %)")
    return figure
