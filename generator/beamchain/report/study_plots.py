"""The picture of a study: error against run time."""

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from beamchain.report.formats import STUDY_TITLE
from beamchain.report.plots import OURS, drawing, panel
from beamchain.studies import field
from beamchain.studies.pareto import front

if TYPE_CHECKING:
    from beamchain.studies.study import Study

#: Ours in colours that differ in lightness, rivals in grey, each told by its mark too.
COLOURS = dict(zip(field.OURS, ("#082f5c", OURS, "#3d8fd6", "#8dbbe6"), strict=True))
GREYS = ("#9a9a9a", "#707070", "#b4b4b4", "#555555", "#c4c4c4")
MARKS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "h")
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
    ax.set(xscale="log", yscale="log", title=STUDY_TITLE)
    ax.set_ylabel("error / largest elastic motion")
    ax.set_xlabel(f"time to simulate {study.scenario.duration:g} s, ms")
    ax.grid(which="major", color="#e6e6e6", linewidth=0.6)
    figure.legend(loc="outside upper left", ncols=2)
    return figure
