"""Pictures of studies: error against run time, times against links, steps and their damping."""

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from beamchain.report.formats import STUDY_TITLES, short
from beamchain.report.plots import (
    BEAM,
    OURS,
    RIVAL,
    SHADE,
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
    figure, ax = panel(5.8)
    rivals = [model for model in study.models if model not in field.OURS]
    ours = [model for model in study.models if model in field.OURS]
    marks = {
        **{model: MARKS[k] for k, model in enumerate(rivals)},
        **{model: MARKS[list(field.OURS).index(model)] for model in ours},
    }
    for k, (model, mark) in enumerate(marks.items()):
        style: Any = {"color": GREYS[k % 5], "linewidth": 1.1, "zorder": 2}
        if model in ours:
            style = {"color": COLOURS[model], "linewidth": 1.8, "zorder": 3}
        found = front([ladder for ladder in study.ladders if ladder.entry.model == model], "error")
        line = [(error, 1e3 * point.seconds) for error, point in found if error < WORST]
        errors, times = np.reshape(line, (-1, 2)).T
        ax.plot(times, errors, marker=mark, markersize=4.5, label=model, **style)
    ax.set(xscale="log", yscale="log", title=STUDY_TITLES["error"])
    ax.set_ylabel("error / largest elastic motion")
    ax.set_xlabel(f"time to simulate {study.scenario.duration:g} s, ms")
    ax.grid(which="major", color="#e6e6e6", linewidth=0.6)
    figure.legend(loc="outside upper left", ncols=2)
    return figure


@drawing()
def steps_figure(limits: "Budget") -> Figure:
    """Per integrator the range of stable steps, and the steps for 1 % and 0.1 %."""
    names = list(limits.largest_step)
    places = np.arange(len(names))
    largest = np.array(list(limits.largest_step.values()))
    one, tenth = np.transpose([limits.accuracy[name] for name in names])
    low = 0.5 * float(tenth.min())
    high = 2.5 * float(max(largest[np.isfinite(largest)].max(initial=0.0), one.max()))
    figure, ax = panel(1.15 + 0.34 * len(names))
    bar: Any = {"color": SHADE, "edgecolor": OURS, "linewidth": 0.8, "height": 0.62}
    ax.barh(places, np.minimum(largest, high), label="stable", **bar)
    for y in places[np.isinf(largest)]:
        ax.text(high / 1.06, y, "no limit", ha="right", va="center", fontsize=8.5, color=OURS)
    stroke: Any = {"color": BEAM, "markersize": 9.0}
    ax.plot(tenth, places, "|", markeredgewidth=2.2, label="first mode within 0.1 %", **stroke)
    ax.plot(one, places, "|", markeredgewidth=1.0, label="within 1 %", **stroke)
    ax.set(xscale="log", xlim=(low, high), xlabel="time step, s")
    log_axis(ax.xaxis, (low, high), plain)
    ax.set_yticks(places, names)
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
        bar: Any = {"color": BEAM, "markersize": 16.0, "markeredgewidth": 2.0}
        ax.plot(w[own > 0.0], own[own > 0.0], "_", label="the structure's own", **bar)
    for name, values in limits.shown.items():
        ratio = values[:, 1]
        seen = ratio > SMALLEST
        mark: Any = {"markersize": 6.0, "fillstyle": "none", "markeredgewidth": 1.4}
        mark["color"] = RIVAL if name == "discrete" else OURS
        label = name if np.any(seen) else f"{name}: none, or unstable"
        ax.plot(w[seen], ratio[seen], STEP_MARKS.get(name, "x"), label=label, **mark)
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
