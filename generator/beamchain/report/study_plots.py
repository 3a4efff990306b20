"""Pictures of a study: error against run time, and time against the number of links."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
from matplotlib.figure import Figure

from beamchain.report.plots import OURS, STYLE, log_axis, plain
from beamchain.studies import field
from beamchain.studies.front import Metric, front

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamchain.studies.run_time import Growth
    from beamchain.studies.study import Study

#: Ours in colours that differ in lightness, rivals in grey, each told by its mark too.
COLOURS = {
    field.TIMED: "#082f5c",
    "exact, hub": OURS,
    "exact, clamped": "#3d8fd6",
    "exact, free": "#8dbbe6",
    "least squares": "#2b7a6f",
}
MARKS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "h")
TITLES: dict[Metric, str] = {
    "error": "Error of the hub's motion as simulated",
    "error_appendage": "Error with the integrator's own rigid-hub error taken off, on its clock",
}
WORST = 2.0  # errors above are left out of the picture: nothing of the appendage is right there


def pareto_figure(study: "Study") -> Figure:
    """Error against run time, log-log: each model's front.

    Args:
        study: what was measured.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 5.8))
        _panel(figure.add_subplot(), study, "error")
        figure.axes[-1].set_xlabel(f"time to simulate {study.scenario.duration:g} s, ms")
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper left", ncols=2, bbox_to_anchor=(0.09, 1.0))
        rows = (len(labels) + 1) // 2
        figure.subplots_adjust(left=0.11, right=0.98, bottom=0.085, top=0.93 - 0.035 * rows)
    return figure


def _frame(ax: "Axes", metric: Metric) -> None:
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_title(TITLES[metric])
    ax.set_ylabel("error / largest elastic motion")
    ax.grid(which="major", color="#e6e6e6", linewidth=0.6)


def _panel(ax: "Axes", study: "Study", metric: Metric) -> None:
    _frame(ax, metric)
    order = [m for m in study.models if m not in field.OURS] + [m for m in study.models if m in field.OURS]
    grey = 0
    for model in order:
        ours = model in field.OURS
        mark = MARKS[list(field.OURS).index(model) if ours else grey]
        colour = COLOURS[model] if ours else ("#9a9a9a", "#707070", "#b4b4b4", "#555555", "#c4c4c4")[grey % 5]
        grey += not ours
        line = [pair for pair in front([x for x in study.ladders if x.entry.model == model], metric) if pair[0] < WORST]
        style: Any = {"color": colour, "marker": mark, "markersize": 4.5, "linewidth": 1.8 if ours else 1.1}
        ax.plot([1e3 * p.seconds for _, p in line], [e for e, _ in line], label=model, zorder=3 if ours else 2, **style)


Points = Sequence[Mapping[str, Any]]


def peer_panel(ax: "Axes", own: Points, peers: Mapping[str, Points], metric: Metric) -> None:
    """Fronts of the points of study.json and of other simulators' points by name, in one set of axes."""
    _frame(ax, metric)
    ax.set_xlabel("time, ms")
    models = list(dict.fromkeys(str(p["model"]) for p in own))
    curves = [(m, [p for p in own if p["model"] == m]) for m in models] + list(peers.items())
    for i, (name, points) in enumerate(curves):
        lower: list[tuple[float, float]] = []
        for seconds, error in sorted((1e3 * p["seconds"], p[metric]) for p in points if p[metric] < WORST):
            if not lower or error < lower[-1][1]:
                lower.append((seconds, error))
        colour = COLOURS.get(name, "#9a9a9a" if name in models else "#a5641e")
        style: Any = {"linestyle": "solid" if name in models else (0, (4, 2)), "markersize": 4.0}
        ax.plot(
            *zip(*lower, strict=True), color=colour, marker=MARKS[i % len(MARKS)], label=name, **style
        ) if lower else None


def growth_figure(growth: "Growth") -> Figure:
    """Time per step against links, and time to find a chain against modes."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.2, 3.0), layout="constrained")
        for i, (title, points, exponent, unit, factor) in enumerate(
            (
                ("Euler step against hinges", growth.step, growth.exponent, "µs", 1e6),
                ("exact chain, found and compiled", growth.fit, growth.fit_exponent, "ms", 1e3),
            )
        ):
            ax = figure.add_subplot(1, 2, i + 1)
            n, times = [float(n) for n, _ in points], [factor * t for _, t in points]
            ax.loglog(n, times, color=OURS, marker="o", markersize=4.0)
            if points:  # a study restricted to one model measures no growth
                log_axis(ax.xaxis, (n[0], n[-1]), plain)
                log_axis(ax.yaxis, (min(times), max(times)), plain)
            ax.set_title(title if exponent is None else f"{title}: n^{exponent:.2f}")
            ax.set_xlabel("n")
            ax.set_ylabel(unit)
            ax.grid(which="major", color="#ececec", linewidth=0.5)
    return figure
