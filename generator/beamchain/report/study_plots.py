"""Pictures of studies: error against run time, times against links, steps and their damping."""

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from beamchain.report.formats import STUDY_TITLES, short
from beamchain.report.plots import (
    BEAM,
    OURS,
    RIVAL,
    WIDTH,
    drawing,
    frame,
    in_hz,
    log_axis,
    panel,
    plain,
)
from beamchain.studies import field
from beamchain.studies.pareto import front

if TYPE_CHECKING:
    from beamchain.steps.budget import Budget
    from beamchain.studies.study import Study

#: Ours in colours that differ in lightness, rivals in grey, each told by its mark too.
COLOURS = dict(zip(field.OURS, ("#082f5c", OURS, "#3d8fd6", "#8dbbe6"), strict=True))
GREYS = ("#9a9a9a", "#707070", "#b4b4b4", "#555555", "#c4c4c4")
MARKS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "h")
#: Marks differ in shape, not in colour alone.
STEP_MARKS = {"Euler": "v", "implicit": "s", "implicitfast": "o", "discrete": "D", "RK4": "^"}
SMALLEST = 1e-7  # damping ratio: below it an integrator adds none to speak of
WORST = 2.0  # errors above are left out of the picture: nothing of the appendage is right there


@drawing()
def pareto_figure(study: "Study") -> Figure:
    """Error against run time, log-log: each model's front."""
    figure = Figure(figsize=(WIDTH, 5.8))
    ax = figure.add_subplot()
    rivals = [m for m in study.models if m not in field.OURS]
    for model in (*rivals, *(m for m in study.models if m in field.OURS)):
        ours = model in field.OURS
        place = list(field.OURS).index(model) if ours else rivals.index(model)
        line = [
            pair
            for pair in front([x for x in study.ladders if x.entry.model == model], "error")
            if pair[0] < WORST
        ]
        style: Any = {
            "color": COLOURS[model] if ours else GREYS[place % 5],
            "marker": MARKS[place],
            "markersize": 4.5,
        }
        style |= {"linewidth": 1.8, "zorder": 3} if ours else {"linewidth": 1.1, "zorder": 2}
        ax.plot([1e3 * p.seconds for _, p in line], [e for e, _ in line], label=model, **style)
    ax.set(
        xscale="log",
        yscale="log",
        title=STUDY_TITLES["error"],
        ylabel="error / largest elastic motion",
    )
    ax.set_xlabel(f"time to simulate {study.scenario.duration:g} s, ms")
    ax.grid(which="major", color="#e6e6e6", linewidth=0.6)
    legend = figure.legend(loc="upper left", ncols=2, bbox_to_anchor=(0.09, 1.0))
    rows = (len(legend.get_texts()) + 1) // 2
    figure.subplots_adjust(left=0.11, right=0.98, bottom=0.085, top=0.93 - 0.035 * rows)
    return figure


@drawing()
def steps_figure(limits: "Budget") -> Figure:
    """Per integrator the range of stable steps, and the steps for 1 % and 0.1 %."""
    names = list(limits.largest_step)
    finite = [v for v in limits.largest_step.values() if np.isfinite(v)]
    tenths = [tenth for _, tenth in limits.accuracy.values()]
    low = 0.5 * min(tenths)
    high = 2.5 * max([*finite, *(one for one, _ in limits.accuracy.values())])
    figure, ax = panel(1.15 + 0.34 * len(names))
    for y, name in enumerate(names):
        largest = limits.largest_step[name]
        ax.barh(
            y,
            min(largest, high),
            color="#e9f1fa",
            edgecolor=OURS,
            linewidth=0.8,
            height=0.62,
            label="stable" if y == 0 else None,
        )
        if not np.isfinite(largest):
            ax.text(high / 1.06, y, "no limit", ha="right", va="center", fontsize=8.5, color=OURS)
        one, tenth = limits.accuracy[name]
        style: Any = {"linestyle": "none", "color": BEAM, "markersize": 9.0}
        ax.plot(
            tenth,
            y,
            marker="|",
            markeredgewidth=2.2,
            label="first mode within 0.1 %" if y == 0 else None,
            **style,
        )
        ax.plot(
            one, y, marker="|", markeredgewidth=1.0, label="within 1 %" if y == 0 else None, **style
        )
    ax.set(xscale="log", xlim=(low, high), xlabel="time step, s")
    log_axis(ax.xaxis, (low, high), plain)
    ax.set_yticks(range(len(names)), names)
    ax.invert_yaxis()
    ax.tick_params(axis="y", length=0.0)
    figure.legend(loc="outside upper left", ncols=2, columnspacing=1.6)
    return figure


@drawing()
def damping_figure(limits: "Budget") -> Figure:
    """Damping ratio of every mode, the structure's own and as each integrator shows it;
    over frequency."""
    figure, ax = panel(3.5)
    w = limits.frequencies
    own = limits.ratios
    if np.any(own > 0.0):
        ax.plot(
            w[own > 0.0],
            own[own > 0.0],
            color=BEAM,
            linestyle="none",
            marker="_",
            markersize=16.0,
            markeredgewidth=2.0,
            label="the structure's own",
        )
    for name, values in limits.shown.items():
        ratio = values[:, 1]
        seen = ratio > SMALLEST
        colour = RIVAL if name == "discrete" else OURS
        ax.plot(
            w[seen],
            ratio[seen],
            marker=STEP_MARKS.get(name, "x"),
            markersize=6.0,
            linestyle="none",
            color=colour,
            fillstyle="none",
            markeredgewidth=1.4,
            label=name if np.any(seen) else f"{name}: none, or unstable",
        )
    shown = [
        float(z) for v in (own[:, None], *limits.shown.values()) for z in v[:, -1] if z > SMALLEST
    ]
    upwards = 0.3 * min(shown, default=SMALLEST), 3.0 * max(shown, default=1.0)
    frame(ax, (float(w[0]) / 1.6, 1.6 * float(w[-1])), upwards)
    in_hz(ax)
    title = f"at a step of {short(limits.timestep)} s"
    ax.set(xlabel="frequency of the mode, rad/s", ylabel="damping ratio", title=title)
    figure.legend(loc="outside upper left", ncols=3, columnspacing=1.2)
    return figure
