"""A picture of a sweep: how the coupled frequencies spread."""

from typing import TYPE_CHECKING

import matplotlib as mpl
from matplotlib.figure import Figure

from beamchain.report.plots import OURS, STYLE, to_svg

if TYPE_CHECKING:
    from beamchain.studies.sweep import Sweep

MOST = 6  # modes drawn


def sweep_picture(sweep: "Sweep") -> str:
    """Histograms of the coupled frequencies relative to their means, SVG text."""
    count = min(sweep.coupled.shape[1], MOST)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 1.0 + 1.1 * count), layout="constrained")
        for k in range(count):
            ax = figure.add_subplot(count, 1, k + 1)
            values = sweep.coupled[:, k]
            ax.hist(values, bins=min(40, max(5, values.size // 10)), color=OURS)
            ax.set_title(
                f"mode {k + 1}: {values.mean():.4g} rad/s, deviation {100 * values.std() / values.mean():.2g} %"
            )
            ax.set_yticks([])
        figure.axes[-1].set_xlabel("frequency on the hub, rad/s")
    return to_svg(figure, "sweep")
