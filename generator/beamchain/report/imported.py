"""What a report adds for imported modes: where they came from, what was done to them, and the oscillators."""

from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from beamchain.report.page import Block, Lines, Picture, Pictures, Section, Table, Text, inline
from beamchain.report.plots import OURS, STYLE, percent, short

if TYPE_CHECKING:
    from beamchain.chain.oscillators import Oscillators
    from beamchain.result import Fit, InSpace


def with_imported(fit: "Fit", page: list[Section], pictures: Pictures) -> list[Section]:
    """The page with a section on the imported modes after the first, and the oscillators in place of the chain.

    Args:
        fit: what is told.
        page: the sections of any fit.
        pictures: SVG texts by file name.
    """
    if fit.space is None:
        return page
    first, *rest = page
    if fit.oscillators is not None:
        made = fit.oscillators
        rest = [Section("The oscillators", _oscillators(made, pictures)) if s.title == "The chain" else s for s in rest]
    return [first, Section("The imported modes", _modes(fit.space)), *rest]


def _modes(space: "InSpace") -> list[Block]:
    data = space.data
    rows = [
        [
            str(k + 1), f"{w:.6g}", f"{w / (2.0 * np.pi):.6g}",
            *(f"{value + 0.0:.5g}" for value in data.participation[k]), data.belongs[k], percent(float(data.leaks[k])),
            f"{data.damping[k]:.4g}",
        ]
        for k, w in enumerate(data.frequencies)
    ]  # fmt: skip
    head = ["mode", "rad/s", "Hz", "x", "y", "z", "rot. x", "rot. y", "rot. z", "port", "outside it", "damping ratio"]
    note = (
        "Participation of the mass-normalised modes about the port, in appendage axes: √kg and √kg m. “Outside it”: "
        "part of the participation that lies in other ports, every motion scaled by its rigid mass."
    )
    error = space.error
    seen = (
        f"All {len(space.live)} motions of the root at once, read back through MuJoCo: frequencies within "
        f"{percent(error.frequency)}, participation within {percent(error.participation)}, in-band error "
        f"{percent(error.accelerance_in_band or 0.0)}."
    )
    return [Text(f"Form: {space.why}."), Lines(data.steps), Table(rows, head, note=note), Text(seen)]


def _oscillators(made: "Oscillators", pictures: Pictures) -> list[Block]:
    label = "The oscillators seen along z: every mode a body, drawn with an area in proportion to its mass."
    caption = "Places of the bodies; the area grows with the mass. Filled: sliders; open: bodies on hinges."
    rows: list[list[str]] = []
    for item in made.items:
        mass = 0.0 if item.body is None else item.body.mass
        inside = "root body" if item.inside is None else f"mode {made.items[item.inside].mode}"
        rows.append([
            str(item.mode), item.kind, _vector(item.axis), _vector(item.point), f"{mass:.6g}", f"{item.stiffness:.6g}",
            f"{item.damping:.6g}", inside,
        ])  # fmt: skip
    head = ["mode", "kind", "axis", "at, m", "mass, kg", "stiffness", "damping", "rides in"]
    note = (
        f"Root body: {made.root.mass:.6g} kg at {_vector(made.root.centre)} m. Stiffness of a slider in N/m, of a "
        "rotor or screw in N m/rad. Linear and exact at the port; no geometric stiffening and no shape of its own."
    )
    return [Picture(inline(pictures["chain.svg"], label), caption), Table(rows, head, note=note)]


def _vector(values: Any) -> str:
    return ", ".join(f"{float(v) + 0.0:.4g}" for v in values)


def oscillators_figure(fit: "Fit") -> Figure:
    """Where the oscillators stand, seen along z and along y."""
    made = fit.oscillators
    assert made is not None
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 5.2), layout="constrained")
        largest = max((i.body.mass for i in made.items if i.body is not None), default=1.0)
        for panel, axis in enumerate((1, 2)):
            ax = figure.add_subplot(2, 1, panel + 1)
            ax.plot([0.0, made.length], [0.0, 0.0], color="#bbbbbb", linewidth=3.0, solid_capstyle="butt")
            ax.plot(0.0, 0.0, marker="s", color="#444444", markersize=6.0)
            for item in made.items:
                mass = 0.0 if item.body is None else item.body.mass
                fill = OURS if item.kind == "slider" else "white"
                size = 3.0 + 14.0 * (mass / largest) ** 0.5
                ax.plot(
                    item.point[0], item.point[axis], marker="o", markersize=size, markerfacecolor=fill,
                    markeredgecolor=OURS, alpha=0.7, linestyle="none",
                )  # fmt: skip
                if mass > 0.02 * largest:
                    ax.annotate(
                        f"{item.mode}", (float(item.point[0]), float(item.point[axis])), xytext=(4, 4),
                        textcoords="offset points",
                    )  # fmt: skip
            ax.set_ylabel(f"{'xyz'[axis]}, m")
        figure.axes[-1].set_xlabel(f"x from the root, m (largest body {short(largest)} kg)")
    return figure
