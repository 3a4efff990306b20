"""Pictures of plants."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from beamchain.report.plots import BEAM, OURS

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamchain.craft.plants.scheduled import ScheduledPlant


def plot_scheduled(scheduled: "ScheduledPlant", ax: "Axes | None" = None) -> "Axes":
    """Frequencies of the modes over a drive's angle; the larger a marker, the larger the mode's gain.

    Args:
        scheduled: the plants.
        ax: drawn into; those of a new figure where left out.
    """
    if ax is None:
        ax = Figure(figsize=(6.4, 3.8), layout="constrained").add_subplot()
    degrees, gain = np.degrees(scheduled.angles), scheduled.gain
    top = np.maximum(gain.max(axis=(0, 1), keepdims=True, initial=0.0), 1e-9 * gain.max(initial=0.0) + 1e-300)
    size = 4.0 + 60.0 * (gain / top).max(axis=(2, 3), initial=0.0)
    for k, name in enumerate(scheduled.modes):
        ax.plot(degrees, scheduled.frequency[:, k], color=BEAM, linewidth=0.8)
        ax.scatter(degrees, scheduled.frequency[:, k], s=size[:, k], color=OURS, linewidths=0.0)
        ax.annotate(
            name, (degrees[-1], scheduled.frequency[-1, k]), fontsize=7, xytext=(4, 0), textcoords="offset points"
        )
    ax.set_yscale("log")
    ax.set_xlabel(f"{scheduled.joint}, degrees")
    ax.set_ylabel("frequency, rad/s")
    return ax
