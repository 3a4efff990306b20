"""Pictures of worst cases."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from beamchain.report import (
    BEAM,
    OURS,
    RIVAL,
    WIDTH,
    drawing,
    literal,
    logarithmic,
    over_frequency,
    panel,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamchain.robust.bounds import GainBound
    from beamchain.robust.worst_gains import WorstCase


def plot_worst(worst: "WorstCase", ax: "Axes | None" = None) -> "Axes":
    """Gains of a closed loop over frequency: worst sample, nominal plant, the peak in MuJoCo."""
    ax = panel(3.6)[1] if ax is None else ax
    ax.loglog(worst.omega, worst.worst, color=OURS, linewidth=1.4, label="worst sample found")
    ax.loglog(worst.omega, worst.nominal, color=RIVAL, linewidth=1.0, label="nominal")
    if worst.bound is not None:
        plot_steps(worst.bound, ax)
    if np.isfinite(worst.simulated):
        ax.loglog(
            [worst.frequency],
            [worst.simulated],
            "o",
            color=BEAM,
            fillstyle="none",
            label="MuJoCo, worst sample",
        )
    logarithmic(ax, worst.omega)
    over_frequency(ax, f"{literal(worst.output)} per {literal(worst.input)}, {worst.unit}")
    ax.legend(loc="best")
    return ax


def plot_steps(bound: "GainBound", ax: "Axes") -> None:
    """An upper bound as steps: a level line per interval, risers where neighbours are finite."""
    low, high = ax.get_xlim()
    ends = np.clip(bound.edges, low, high)
    level = np.where(np.isfinite(bound.gains), bound.gains, np.nan)
    ax.stairs(level, ends, baseline=None, color=BEAM, linewidth=1.0, label="no value exceeds")
    ax.set_xlim(low, high)


@drawing()
def worst_figure(several: "Sequence[WorstCase]") -> Figure:
    """The same as a figure, one picture per angle."""
    figure = Figure(figsize=(WIDTH, 3.4 * len(several)), layout="constrained")
    for place, worst in enumerate(several, 1):
        plot_worst(worst, figure.add_subplot(len(several), 1, place)).legend_ = None
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=4)
    return figure


@drawing()
def drawn_figure(several: "Sequence[WorstCase]") -> Figure:
    """Peak gains of the draws, in order, with that of the worst sample."""
    figure, ax = panel(2.8)
    for worst in several:
        peaks = np.sort(worst.drawn[np.isfinite(worst.drawn)])
        ax.plot(peaks, np.arange(1, peaks.size + 1) / max(worst.drawn.size, 1), color=OURS)
        if np.isfinite(worst.gain):
            ax.axvline(worst.gain, color=OURS, linewidth=0.8, linestyle="dotted")
    ax.set(xlabel=f"peak gain, {several[0].unit}", ylabel="share of samples below")
    return figure
