"""Pictures of a sweep: how the coupled modes and the modal gains of a craft spread over its variants."""

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from beamchain.ports.motions import Array
from beamchain.report.plots import OURS, STYLE, WIDTH, literal
from beamchain.report.svg import to_svg

if TYPE_CHECKING:
    from beamchain.craft.variants.sweep import Sweep

MOST = 12  # modes in a picture
NONE = 1e-9  # of the largest gain: a mode below it is not driven or not seen


def sweep_pictures(sweep: "Sweep") -> dict[str, str]:
    """SVG texts by the name of their file."""
    out = {"coupled_frequencies.svg": _histograms(sweep.coupled, "frequency of the coupled mode, rad/s", "rad/s")}
    if sweep.gains:
        out["modal_gains.svg"] = _gains(sweep)
    return out


@mpl.rc_context(STYLE)
def _histograms(table: Array, label: str, unit: str) -> str:
    """A histogram per column, each on its own axis."""
    count = min(table.shape[1], MOST)
    figure = Figure(figsize=(WIDTH, 1.0 + 1.1 * count), layout="constrained")
    for k in range(count):
        ax = figure.add_subplot(count, 1, k + 1)
        values = table[:, k]
        mean, spread = float(values.mean()), float(values.std())
        ax.hist(values, bins=min(40, max(5, values.size // 10)), color=OURS)
        ax.set_title(
            f"mode {k + 1}: {mean:.4g} {unit}, {mean / (2.0 * np.pi):.4g} Hz, deviation {100 * spread / mean:.2g} %"
        )
        ax.set_ylabel("variants")
    figure.axes[-1].set_xlabel(_counted(label, table, count))
    return to_svg(figure, "sweep")


@mpl.rc_context(STYLE)
def _gains(sweep: "Sweep") -> str:
    """Every variant's gain over its mode, a panel per pair of signals."""
    figure = Figure(figsize=(WIDTH, 0.6 + 3.0 * len(sweep.gains)), layout="constrained")
    for row, (name, values) in enumerate(sweep.gains.items(), 1):
        ax = figure.add_subplot(len(sweep.gains), 1, row)
        seen = [k for k in range(values.shape[1]) if values[:, k].max() > NONE * values.max()][:MOST]
        for place, k in enumerate(seen):
            across = place + 0.5 * (np.arange(values.shape[0]) % 101) / 101.0 - 0.25  # beside each other, not by chance
            ax.plot(across, values[:, k], ".", color=OURS, markersize=2.0, alpha=0.5)
            ax.plot([place - 0.32, place + 0.32], [np.median(values[:, k])] * 2, color="black", linewidth=1.0)
        ax.set_yscale("log")
        ax.set_xticks(
            range(len(seen)), [f"{k + 1}\n{np.median(sweep.coupled[:, k]):.3g} rad/s" for k in seen], fontsize=7
        )
        ax.set(title=literal(f"modal gain {name}; bar: median"), ylabel=sweep.units[name])
        ax.set_xlabel(_counted("coupled mode, its median frequency", values, len(seen)))
    return to_svg(figure, "gains")


def _counted(label: str, table: Array, shown: int) -> str:
    return f"{label} ({table.shape[0]} variants, {shown} of {table.shape[1]} modes)"
