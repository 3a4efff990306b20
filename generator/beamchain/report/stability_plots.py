"""Pictures of a stability study: steps per integrator, and the damping that each integrator shows."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from beamchain.report.plots import BEAM, OURS, RIVAL, STYLE, log_axis, plain, power, short

if TYPE_CHECKING:
    from beamchain.steps.budget import Budget
    from beamchain.studies.stability import StepRow

#: Marks differ in shape, not in colour alone.
MARKS = {"Euler": "v", "implicit": "s", "implicitfast": "o", "discrete": "D", "RK4": "^"}
SMALLEST = 1e-7  # damping ratio: below it an integrator adds none to speak of


def steps_figure(limits: "Budget", rows: Sequence["StepRow"]) -> Figure:
    """Per integrator the range of stable steps, the measured limit, the steps for 1 % and 0.1 %.

    Args:
        limits: of one model.
        rows: its measured limits.
    """
    names = list(limits.largest_step)
    finite = [v for v in limits.largest_step.values() if np.isfinite(v)]
    tenths = [tenth for _, tenth in limits.accuracy.values()]
    low, high = 0.5 * min(tenths), 2.5 * max([*finite, *(one for one, _ in limits.accuracy.values())])
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 1.15 + 0.34 * len(names)), layout="constrained")
        ax = figure.add_subplot()
        for y, name in enumerate(names):
            largest = limits.largest_step[name]
            ax.barh(y, min(largest, high), color="#e9f1fa", edgecolor=OURS, linewidth=0.8, height=0.62,
                    label="stable, predicted" if y == 0 else None)  # fmt: skip
            if not np.isfinite(largest):
                ax.text(high / 1.06, y, "no limit", ha="right", va="center", fontsize=8.5, color=OURS)
            one, tenth = limits.accuracy[name]
            style: Any = {"linestyle": "none", "color": BEAM, "markersize": 9.0}
            ax.plot(
                tenth, y, marker="|", markeredgewidth=2.2, label="first mode within 0.1 %" if y == 0 else None, **style
            )
            ax.plot(one, y, marker="|", markeredgewidth=1.0, label="within 1 %" if y == 0 else None, **style)
        measured = [(names.index(r.integrator), r.measured) for r in rows if np.isfinite(r.measured)]
        ax.plot(
            [m for _, m in measured], [y for y, _ in measured], "o", color=OURS, markersize=5.0, label="measured limit"
        )
        ax.set_xscale("log")
        ax.set_xlim(low, high)
        log_axis(ax.xaxis, (low, high), plain)
        ax.set_yticks(range(len(names)), names)
        ax.invert_yaxis()
        ax.tick_params(axis="y", length=0.0)
        ax.set_xlabel("time step, s")
        figure.legend(loc="outside upper left", ncols=2, columnspacing=1.6)
    return figure


def damping_figure(limits: "Budget") -> Figure:
    """Damping ratio of every mode, the structure's own and as each integrator shows it; over frequency."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 3.5), layout="constrained")
        ax = figure.add_subplot()
        w = limits.frequencies
        own = limits.ratios
        if np.any(own > 0.0):
            ax.plot(w[own > 0.0], own[own > 0.0], color=BEAM, linestyle="none", marker="_", markersize=16.0,
                    markeredgewidth=2.0, label="the structure's own")  # fmt: skip
        for name, values in limits.shown.items():
            ratio = values[:, 1]
            seen = ratio > SMALLEST
            colour = RIVAL if name == "discrete" else OURS
            ax.plot(
                w[seen], ratio[seen], marker=MARKS.get(name, "x"), markersize=6.0, linestyle="none", color=colour,
                fillstyle="none", markeredgewidth=1.4, label=name if np.any(seen) else f"{name}: none, or unstable",
            )  # fmt: skip
        ax.set_xscale("log")
        ax.set_yscale("log")
        shown = [float(z) for v in (own[:, None], *limits.shown.values()) for z in v[:, -1] if z > SMALLEST]
        across = float(w[0]) / 1.6, 1.6 * float(w[-1])
        upwards = 0.3 * min(shown, default=SMALLEST), 3.0 * max(shown, default=1.0)
        ax.set_xlim(*across)
        ax.set_ylim(*upwards)
        log_axis(ax.xaxis, across, plain)
        log_axis(ax.yaxis, upwards, power)
        ax.grid(visible=True, color="#e3e3e3", linewidth=0.6)
        ax.set_axisbelow(True)
        ax.set_xlabel("frequency of the mode, rad/s")
        ax.set_ylabel("damping ratio")
        ax.set_title(f"at a step of {short(limits.timestep)} s")
        figure.legend(loc="outside upper left", ncols=3, columnspacing=1.2)
    return figure
