"""Picture of the proof: the hub's accelerance, exact assembly and MuJoCo."""

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from beamchain.report.plots import BEAM, OURS, STYLE, to_svg

if TYPE_CHECKING:
    from beamchain.assess.assembly import Assembly

MOTIONS = (
    ("x: force → displacement", "(m/s²)/N"),
    ("y: force → displacement", "(m/s²)/N"),
    ("z: force → displacement", "(m/s²)/N"),
    ("about x: torque → rotation", "(rad/s²)/(N m)"),
    ("about y: torque → rotation", "(rad/s²)/(N m)"),
    ("about z: torque → rotation", "(rad/s²)/(N m)"),
)


def assembly_figure(assembly: "Assembly") -> Figure:
    """Diagonal of the hub's accelerance over frequency, one panel per motion the hub has."""
    rows = (len(assembly.motions) + 1) // 2
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 0.9 + 1.9 * rows), layout="constrained")
        for place, motion in enumerate(assembly.motions):
            ax = figure.add_subplot(rows, 2, place + 1)
            title, unit = MOTIONS[motion]
            ax.axvspan(assembly.omega[0], assembly.common, color="#e9f1fa", zorder=0)
            ax.loglog(
                assembly.omega, np.abs(assembly.achieved[place, place]), color=OURS, linewidth=3.0,
                label="MuJoCo, from A and B of mjd_transitionFD",
            )  # fmt: skip
            ax.loglog(
                assembly.omega,
                np.abs(assembly.exact[place, place]),
                color=BEAM,
                linewidth=1.0,
                label="exact beams on the same hub",
            )
            ax.set_xlim(float(assembly.omega[0]), float(assembly.omega[-1]))
            ax.set_title(title)
            ax.set_ylabel(f"|H|, {unit}")
            if place >= len(assembly.motions) - 2:
                ax.set_xlabel("frequency, rad/s")
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=2)
    return figure


def assembly_svg(assembly: "Assembly") -> str:
    """The figure as SVG text, shaded where every kept port is complete."""
    return to_svg(assembly_figure(assembly), "assembly")
