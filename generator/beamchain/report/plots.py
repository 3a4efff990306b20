"""Pictures of a fit, drawn with matplotlib's objects: no figure manager, no state left behind."""

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from threading import RLock
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.path import Path
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

from beamchain.chain.chain import Chain
from beamchain.checks import printable
from beamchain.ports.motions import Array
from beamchain.report.curves import (
    CHAIN,
    CLASSICAL,
    PLANES,
    Response,
    count,
    error_curves,
    moving,
    responses,
    rival_chains,
    rival_model,
    span,
    worst_hub,
)
from beamchain.report.formats import percent, short, superscript
from beamchain.structure.beam import Beam

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamchain.fitting.result import Fit

# blue, black and grey differ in lightness too, and rivals by their dashes: readable without colour
OURS, BEAM, RIVAL, SHADE, HATCH = "#0a5fb4", "#000000", "#8a8a8a", "#e9f1fa", "#cfcfcf"
ROUNDING = 1e-16  # the top of a picture of errors that are all less
LONGEST, ENDING = 48, 16  # characters of a name, and of its end where the middle is left out
# of a figure [inch]; text is then as large as the page's where the figure has the page's width
WIDTH = 8.6
DASHES = ("solid", (0, (5, 2)), (0, (1.2, 1.6)))
STYLE: Any = {
    "font.family": ["DejaVu Sans"],
    "font.size": 9.5,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.5,
    "axes.edgecolor": "#444444",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.unicode_minus": False,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "svg.fonttype": "none",
    "hatch.linewidth": 0.6,
}

#: Entries of the accelerance drawn: row, column, what it is, unit.
_PLANE = (
    (0, 0, "acceleration of the root per force", "(m/s²)/N"),
    (
        0,
        1,
        "acceleration of the root per moment, and angular acceleration per force",
        "(m/s²)/(N m)",
    ),
    (1, 1, "angular acceleration of the root per moment", "(rad/s²)/(N m)"),
)
ENTRIES = {
    "xy": _PLANE,
    "xz": _PLANE,
    "torsion": (
        (0, 0, "angular acceleration of the root about the axis per moment", "(rad/s²)/(N m)"),
    ),
    "axial": ((0, 0, "acceleration of the root along the axis per force", "(m/s²)/N"),),
}


def literal(name: str) -> str:
    """A user's name as a picture shows it: not as a formula, which a dollar sign would start,
    and not too wide."""
    text = printable(" ".join(name.split()))
    if len(text) > LONGEST:
        text = f"{text[: LONGEST - ENDING]} ... {text[-ENDING:]}"
    text = text.replace("$", r"\$")
    return f" {text}" if text.startswith("_") else text  # Matplotlib keeps "_..." out of legends


# -- accelerance -----------------------------------------------------------------------------------
def plot_accelerance(fit: "Fit", ax: "Axes | None" = None, port: str | None = None) -> "Axes":
    """Draw the first accelerance of a port: the beam, and the chain read back through MuJoCo."""
    port = next(iter(fit.target)) if port is None else port
    ax = panel(3.6)[1] if ax is None else ax
    _panel(ax, fit, port, 0, responses(fit, port, with_rivals=False))
    in_hz(ax)
    ax.set_xlabel("frequency, rad/s")
    ax.legend(loc="best")
    return ax


_pen = RLock()


@contextmanager
def drawing(**settings: Any) -> Generator[None]:
    """The style of our figures, and further settings, while one thread draws.

    All threads share Matplotlib's settings, fonts and parser of formulas,
    so that one draws at a time.
    """
    style: dict[Any, Any] = {**STYLE, **settings}
    with _pen, mpl.rc_context(style):
        yield


@drawing()
def accelerance_figure(fit: "Fit", port: str) -> Figure:
    """The port's accelerances over frequency, magnitude and phase: beam, chain through MuJoCo,
    rivals; undamped."""
    panels = len(ENTRIES[port])
    figure = Figure(figsize=(WIDTH, 1.8 + 2.7 * panels))
    curves = responses(fit, port, with_rivals=True)
    grid = figure.add_gridspec(
        3 * panels - 1, 1, height_ratios=[3.2, 0.62, 0.72] * (panels - 1) + [3.2, 0.62]
    )
    for i in range(panels):
        ax, below = (figure.add_subplot(grid[3 * i + k]) for k in (0, 1))
        _panel(ax, fit, port, i, curves)
        _phase(below, fit, port, i, curves)
        if i == 0:
            in_hz(ax)
        # ticks are most of what drawing costs
        for shared in (ax, *([below] if i < panels - 1 else [])):
            shared.tick_params(labelbottom=False)
            shared.xaxis.set_minor_locator(NullLocator())
    figure.axes[-1].set_xlabel("frequency, rad/s")
    figure.subplots_adjust(
        left=0.095, right=0.965, bottom=0.48 / figure.get_figheight(), hspace=0.16
    )
    _legend(figure, figure.axes[0], list(curves)[:2])
    return figure


def _phase(ax: "Axes", fit: "Fit", port: str, entry: int, curves: Mapping[str, Response]) -> None:
    """Without damping the phase is 0 or 180 degrees and turns over at each pole and zero."""
    i, j, *_ = ENTRIES[port][entry]
    frame(ax, span(fit, port), (-50.0, 230.0), fit.bandwidth[port], decades=False)
    _draw(ax, {label: curve.phase(i, j) for label, curve in curves.items()})
    ax.set_yticks([0.0, 180.0])
    ax.set_ylabel("phase, °", fontsize=8.5)


def _panel(ax: "Axes", fit: "Fit", port: str, entry: int, curves: Mapping[str, Response]) -> None:
    i, j, title, unit = ENTRIES[port][entry]
    beam = next(iter(curves.values()))
    frame(ax, span(fit, port), _heights(beam, i, j), fit.bandwidth[port])
    _draw(ax, {label: (curve.omega, np.abs(curve.values[i, j])) for label, curve in curves.items()})
    poles, zeros = beam.crossings(i, j)
    edge: Any = {
        "transform": ax.get_xaxis_transform(),
        "color": BEAM,
        "linestyle": "none",
        "clip_on": False,
    }
    ax.plot(poles, np.ones(poles.size), marker="x", markersize=5.5, label="beam's poles", **edge)
    edge["markerfacecolor"] = "white"
    ax.plot(zeros, np.zeros(zeros.size), marker="o", markersize=5.0, label="beam's zeros", **edge)
    ax.set_title(title, pad=8.0)
    ax.set_ylabel(f"|W|, {unit}")


def _draw(ax: "Axes", curves: Mapping[str, tuple[Array, Array]]) -> None:
    """The beam over the chain over its rivals."""
    beam, ours, *others = curves
    for order, label in enumerate(others):
        ax.plot(
            *curves[label], color=RIVAL, linestyle=DASHES[order % 3], linewidth=1.2, label=label
        )
    ax.plot(*curves[ours], color=OURS, linewidth=3.4, solid_joinstyle="round", label=ours)
    ax.plot(*curves[beam], color=BEAM, linewidth=1.1, label=beam)


def _heights(curve: Response, i: int, j: int) -> tuple[float, float]:
    """Limits that hold the curve but cut its peaks and dips."""
    even = np.geomspace(curve.omega[0], curve.omega[-1], 150)
    size = np.log10(np.clip(np.abs(curve.values[i, j]), 1e-300, None))
    low, high = np.quantile(np.interp(even, curve.omega, size), [0.05, 0.95])
    return float(10.0 ** (low - 0.7)), float(10.0 ** (high + 0.9))


# -- error -----------------------------------------------------------------------------------------
@drawing()
def error_figure(fit: "Fit", port: str) -> Figure:
    """Error of the hub's motion over frequency; its largest in the band is the in-band error."""
    figure = Figure(figsize=(WIDTH, 4.2))
    ax = figure.add_subplot()
    hub, place = worst_hub(fit, port)
    limits = span(fit, port)
    band = fit.bandwidth[port]
    rivals = rival_chains(fit, port)
    rival_models = [rival_model(fit, port, chain) for chain in rivals.values()]
    models = [fit.measured.damped_port(port), *rival_models]
    ours, *others = error_curves(fit, port, models, hub, limits)
    top = max(float(curve.error.max(initial=ROUNDING)) for curve in (ours, *others))
    bottom = float(np.clip(ours.error.min(), 1e-7 * top, 0.1 * top))
    frame(ax, limits, (bottom / 2.0, 3.0 * top), band)
    for dash, curve, (label, chain) in zip(DASHES, others, rivals.items(), strict=False):
        label = f"{label}, {count(moving(chain, port), 'hinge')}"
        ax.plot(curve.omega, curve.error, color=RIVAL, linestyle=dash, linewidth=1.2, label=label)
    name = f"{CHAIN}, through MuJoCo"
    ax.plot(ours.omega, ours.error, color=OURS, linewidth=2.0, label=name)
    at = ours.peak(band)
    x = float(ours.omega[at])
    y = float(ours.error[at])
    ax.plot(x, y, marker="o", markersize=5.5, color=OURS, linestyle="none", label="largest in band")
    stated = fit.readback_error[port].accelerance_in_band
    box: Any = {
        "boxstyle": "square,pad=0.1",
        "facecolor": "white",
        "edgecolor": "none",
        "alpha": 0.75,
    }
    left = x < limits[0] * (limits[1] / limits[0]) ** 0.85
    style: Any = {"textcoords": "offset points", "color": OURS, "fontweight": "bold", "bbox": box}
    text = percent(y if stated is None else stated)
    ax.annotate(
        text, (x, y), xytext=(7 if left else -7, 4), ha="left" if left else "right", **style
    )
    ax.set_title(place, pad=6.0)
    over_frequency(ax, "error of the hub's motion, relative")
    figure.subplots_adjust(left=0.095, right=0.965, bottom=0.12)
    _legend(figure, ax, [name])
    return figure


# -- logarithmic axes ------------------------------------------------------------------------------
def power(value: float, _: float = 0.0) -> str:
    """A power of ten on an axis."""
    exponent = round(np.log10(value))
    return {0: "1", 1: "10"}.get(exponent, f"10{superscript(exponent)}")


def plain(value: float, _: float = 0.0) -> str:
    """A number on an axis."""
    return f"{value:g}" if 1e-4 <= value < 1e5 else power(value)


def log_axis(axis: Any, limits: tuple[float, float], text: Callable[[float, float], str]) -> None:
    """Powers of ten labelled, 2 and 5 too on a short axis; none of it mathtext,
    which is slow and no plain text."""
    decades = float(np.log10(limits[1] / limits[0]))
    short = decades < 2.2
    axis.set_major_locator(
        LogLocator(subs=(1.0, 2.0, 5.0) if short else (1.0,), numticks=12 if short else 8)
    )
    axis.set_minor_locator(
        LogLocator(subs=tuple(np.arange(2.0, 10.0)) if decades < 6.0 else (1.0,), numticks=60)
    )
    axis.set_major_formatter(FuncFormatter(plain if short else text))
    axis.set_minor_formatter(NullFormatter())


def frame(
    ax: "Axes",
    limits: tuple[float, float],
    heights: tuple[float, float],
    band: float = 0.0,
    *,
    decades: bool = True,
) -> None:
    """Logarithmic axes (upwards only with `decades`) with the kept band, if any,
    shaded and what is beyond it hatched."""
    ax.set(xscale="log", yscale="log" if decades else "linear", xlim=limits, ylim=heights)
    log_axis(ax.xaxis, limits, plain)
    if decades:
        log_axis(ax.yaxis, heights, power)
    ax.grid(visible=True, color="#e3e3e3", linewidth=0.6)
    ax.set_axisbelow(True)
    if band:
        ax.axvspan(
            limits[0], min(band, limits[1]), color=SHADE, linewidth=0, zorder=0, label="kept band"
        )
    if 0.0 < band < limits[1]:
        style: Any = {
            "facecolor": "none",
            "edgecolor": HATCH,
            "hatch": "////",
            "linewidth": 0,
            "zorder": 0,
        }
        ax.axvspan(max(band, limits[0]), limits[1], label="not asked for", **style)


def in_hz(ax: "Axes") -> None:
    """The same frequencies in Hz above logarithmic axes in rad/s."""
    turn: Any = 2.0 * np.pi
    above: Any = ax.secondary_xaxis(
        "top", functions=(lambda w: np.divide(w, turn), lambda f: np.multiply(f, turn))
    )
    above.set_gid(f"hz{len(ax.figure.axes)}")
    low, high = ax.get_xlim()
    log_axis(above.xaxis, (low / turn, high / turn), plain)
    above.xaxis.set_minor_locator(NullLocator())
    above.tick_params(labelsize=8.5, pad=1.5)
    ax.annotate(
        "Hz",
        (1.0, 1.0),
        xycoords="axes fraction",
        xytext=(4.0, 1.0),
        textcoords="offset points",
        fontsize=8.5,
    )


def over_frequency(ax: "Axes", ylabel: str) -> None:
    """Label axes over frequency, and show it in Hz above."""
    in_hz(ax)
    ax.set(xlabel="frequency, rad/s", ylabel=ylabel)


def panel(height: float) -> "tuple[Figure, Axes]":
    """A new figure of a height [inch] with one panel."""
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    return figure, figure.add_subplot()


def _legend(figure: Figure, ax: "Axes", first: Sequence[str]) -> None:
    """A legend in two columns above all panels; sets the panels' upper edge below it."""
    handles, labels = ax.get_legend_handles_labels()
    entries = dict(zip(labels, handles, strict=True))
    order = [*first, *(label for label in labels if label not in first)]
    style: Any = {
        "handlelength": 2.2,
        "columnspacing": 1.4,
        "borderaxespad": 0.2,
        "bbox_to_anchor": (0.0, 1.0),
    }
    figure.legend([entries[label] for label in order], order, loc="upper left", ncols=2, **style)
    inches = 0.62 + 0.192 * ((len(order) + 1) // 2)
    figure.subplots_adjust(top=1.0 - inches / figure.get_figheight())


# -- the chain -------------------------------------------------------------------------------------
_MARKERS = {"xy": "o", "xz": "s", "torsion": "D", "axial": "^"}
_LABEL, _ROWS = 8.5, 3  # size of a label [pt]; rows of labels above and below the chain
_CROSSED = Path.make_compound_path(
    Path.unit_circle(), Path([(-1, 0), (1, 0), (0, -1), (0, 1)], [1, 2, 1, 2])
)
_CENTRE: Any = {
    "marker": _CROSSED,
    "markersize": 7.0,
    "color": "black",
    "fillstyle": "none",
    "linestyle": "none",
}


@drawing()
def chain_figure(fit: "Fit") -> Figure:
    """The chain to scale along x, and below it the classical chain with as many hinges."""
    plane = next((port for port in fit.target if port in PLANES), next(iter(fit.target), PLANES[0]))
    chains = {CHAIN: fit.chain}
    classical = rival_chains(fit, plane).get(CLASSICAL) if fit.target else None
    if classical is not None:
        chains[CLASSICAL] = classical
    figure = Figure(figsize=(WIDTH, 1.05 + 1.5 * len(chains)))
    height = figure.get_figheight()
    figure.subplots_adjust(
        left=0.02, right=0.98, top=1.0 - 0.28 / height, bottom=0.77 / height, hspace=0.22
    )
    for i, (label, chain) in enumerate(chains.items()):
        ax = figure.add_subplot(len(chains), 1, i + 1)
        _draw_chain(ax, chain, fit.beam, plane, label, OURS if i == 0 else "#6f6f6f")
        ax.tick_params(labelbottom=i == len(chains) - 1)
    figure.axes[-1].set_xlabel("x from the root, m")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="lower center",
        ncols=6,
        handlelength=1.2,
        columnspacing=1.0,
        borderaxespad=0.2,
    )
    return figure


def _draw_chain(
    ax: "Axes", chain: Chain, beam: Beam | None, plane: str, title: str, color: str
) -> None:
    length = chain.length
    left, right = -0.055 * length, 1.03 * length
    ax.set(xlim=(left, right), ylim=(-1.05, 1.05))
    ax.yaxis.set_visible(False)
    ax.spines["left"].set_visible(False)
    x = np.linspace(0.0, length, 121)
    depth = np.array([0.0 if beam is None else beam.depth(float(at), plane) for at in x])
    depth = 0.24 * (depth / depth.max() if depth.max() > 0.0 else np.ones(x.size))
    ax.fill_between(x, -depth, depth, color="#dddddd", linewidth=0, label="beam")
    ax.fill_between(
        [left, 0.0],
        -0.3,
        0.3,
        facecolor="#f4f4f4",
        edgecolor="#777777",
        hatch="////",
        linewidth=0.8,
    )
    if beam is not None and beam.lumps:
        at = [lump.x for lump in beam.lumps]
        ax.plot(
            at,
            np.full(len(at), 0.27),
            marker="v",
            color="#777777",
            markersize=6.0,
            linestyle="none",
        )
    real = [link for link in chain.links if link.mass > 0.0]
    gap = 0.004 * length
    for link in real:
        ends = [link.start + gap, min(link.start + link.length, length) - gap]
        ax.plot(ends, [0.0, 0.0], color=color, linewidth=5.0, solid_capstyle="butt")
    ax.plot([link.com for link in real], np.zeros(len(real)), label="centre of mass", **_CENTRE)
    for port in chain.ports:
        at = [hinge.x for hinge in chain.hinges if port in hinge.stiffness]
        style: Any = {
            "marker": _MARKERS[port],
            "markersize": 6.5 if port == "xy" else 5.5,
            "linestyle": "none",
        }
        style |= {"markerfacecolor": "white", "markeredgecolor": color, "markeredgewidth": 1.8}
        ax.plot(
            at,
            np.zeros(len(at)),
            label="hinge" if len(chain.ports) == 1 else f"hinge {port}",
            **style,
        )
    masses = _rows(ax, [(link.com, f"{short(link.mass)} kg") for link in real])
    springs = _rows(ax, [(hinge.x, _springs(hinge.stiffness)) for hinge in chain.hinges])
    what = f"{title}: {count(len(real), 'link')}, {count(len(chain.hinges), 'hinge')}"
    if len(chain.ports) > 1:
        what += "; stiffness in N m/rad" + (", axial N/m" if "axial" in chain.ports else "")
    if masses is None or springs is None:
        what += " (too many to label; see the table)"
    else:
        _write(ax, masses, 1.0, color)
        _write(ax, springs, -1.0, "#222222")
    ax.set_title(what, pad=3.0, color=color)


def with_si_prefix(value: float, unit: str) -> str:
    """Three digits with k, M, G before the unit."""
    for size, prefix in ((1e9, "G"), (1e6, "M"), (1e4, "k")):
        if abs(value) >= size:
            return f"{short(value / (1e3 if prefix == 'k' else size))} {prefix}{unit}"
    return f"{short(value)} {unit}"


def _springs(stiffness: Mapping[str, float]) -> str:
    if len(stiffness) == 1:
        ((port, value),) = stiffness.items()
        return with_si_prefix(value, "N/m" if port == "axial" else "N m/rad") if value else "free"
    return ", ".join(
        f"{port} {with_si_prefix(value, '').strip() if value else 'free'}"
        for port, value in stiffness.items()
    )


def _rows(
    ax: "Axes", labels: Sequence[tuple[float, str]]
) -> "list[tuple[float, float, int, str]] | None":
    """Labels in rows, so that none overlap: x, where the text is centred, row, text;
    None where they do not all fit."""
    left, right = ax.get_xlim()
    figure = ax.get_figure()
    width = (
        72.0
        * ax.get_position().width
        * (figure.get_size_inches()[0] if isinstance(figure, Figure) else WIDTH)
    )
    ends: list[float] = [-np.inf] * _ROWS
    placed: list[tuple[float, float, int, str]] = []
    for x, text in sorted(labels):
        half = 0.5 * (right - left) / width * (0.62 * _LABEL * len(text) + 5.0)
        centre = min(max(x, left + half), right - half)
        row = next((i for i, end in enumerate(ends) if centre - half >= end), None)
        if row is None:
            return None
        ends[row] = centre + half
        placed.append((x, centre, row, text))
    return placed


def _write(
    ax: "Axes", labels: Sequence[tuple[float, float, int, str]], side: float, color: str
) -> None:
    """Labels above (`side` 1) or below (-1) the chain, each with a thin line to its place."""
    for x, centre, row, text in labels:
        y = side * (0.47 + 0.21 * row)
        ax.plot([x, x], [side * 0.14, y - side * 0.1], color="#b0b0b0", linewidth=0.6, zorder=1)
        ax.text(centre, y, text, ha="center", va="center", fontsize=_LABEL, color=color)
