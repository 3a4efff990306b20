"""What an identification shows: its page, its picture, its few lines in a notebook."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from beamchain.identification import tables
from beamchain.identification.result import INTERVAL, Identification
from beamchain.report import BEAM, OURS, RIVAL, Verdict, drawing, page_text, table_html, to_svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_identification(
    found: Identification, ax: "Axes | None" = None, channel: str = ""
) -> "Axes":
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
    title = f"Identification of {found.source}: {_sentence(found)}"
    return table_html(tables.mode_table(found), notes, title)


def identification_page(found: Identification, name: str) -> str:
    """The text of one HTML file."""
    figures = {f"spectrum{i}": _spectrum(found, channel) for i, channel in enumerate(found.spectra)}
    figures |= {"order": _stabilisation(found), "bars": _bars(found)}
    return page_text(
        "identification.html",
        Path(__file__).parent,
        name=name,
        found=found,
        verdict=Verdict(all(m.determined for m in found.modes), _sentence(found)),
        modes=tables.mode_table(found),
        participation=tables.participation_table(found),
        orders=tables.order_table(found),
        channels=tables.channel_table(found),
        drawn={key: to_svg(figure, key) for key, figure in figures.items()},
    )


def _sentence(found: Identification) -> str:
    sure = sum(m.determined for m in found.modes)
    return f"{sure} of {len(found.modes)} modes are determined in frequency and damping."


@drawing()
def _spectrum(found: Identification, channel: str) -> Figure:
    figure = Figure(figsize=(6.4, 3.6), layout="constrained")
    plot_identification(found, figure.add_subplot(), channel)
    return figure


@drawing()
def _stabilisation(found: Identification) -> Figure:
    figure = Figure(figsize=(6.4, 3.4), layout="constrained")
    ax = figure.add_subplot()
    for one in found.order:
        if one.modes:
            ax.semilogx(
                one.frequencies,
                np.full(len(one.frequencies), one.modes),
                "o",
                color=OURS,
                markersize=4.0,
            )
    best = min(
        (o for o in found.order if np.isfinite(o.criterion)),
        key=lambda o: o.criterion,
        default=None,
    )
    if best is not None and best.modes:
        ax.axhline(best.modes, color=RIVAL, linewidth=0.8, linestyle="dashed")
    ax.set_xlabel("frequency of the coupled mode, rad/s")
    ax.set_ylabel("modes in the model")
    return figure


@drawing()
def _bars(found: Identification) -> Figure:
    figure = Figure(figsize=(6.4, 3.0), layout="constrained")
    for at, (kind, label) in enumerate(
        (("frequency", "frequency"), ("damping", "damping ratio")), 1
    ):
        ax = figure.add_subplot(1, 2, at)
        relative = [
            100.0 * INTERVAL * getattr(m, f"{kind}_std") / max(getattr(m, kind), 1e-300)
            for m in found.modes
        ]
        colours = [OURS if m.determined else RIVAL for m in found.modes]
        ax.bar([str(m.number) for m in found.modes], relative, color=colours)
        if any(v > 0.0 for v in relative):
            ax.set_yscale("log")
        ax.set_xlabel("mode")
        ax.set_ylabel(f"{label}, ± % (95 %)")
    return figure
