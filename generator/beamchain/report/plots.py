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
from beamchain.report.curves import (
    CHAIN,
    PLANES,
    ErrorCurve,
    count,
    error_curve,
    responses,
    span,
    worst_hub,
)
from beamchain.report.formats import error_text, short, superscript
from beamchain.structure.beam import Beam

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamchain.fitting.result import Fit

# blue, black and grey differ in lightness too: readable without colour
OURS, BEAM, RIVAL, SHADE, HATCH = "#0a5fb4", "#000000", "#8a8a8a", "#e9f1fa", "#cfcfcf"
ROUNDING = 1e-16  # the top of a picture of errors that are all less
LONGEST, ENDING = 48, 16  # characters of a name, and of its end where the middle is left out
# of a figure [inch]; text is then as large as the page's where the figure has the page's width
WIDTH = 8.6
ACCELERANCE_OVER_ERROR = 5.6, 1.5, 1.0  # height [inch] of two panels and their shares of it
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

#: the first entry of a port's accelerance: what it is, unit
ENTRIES = {
    "xy": ("acceleration of the root per force", "(m/s²)/N"),
    "xz": ("acceleration of the root per force", "(m/s²)/N"),
    "torsion": ("angular acceleration of the root about the axis per moment", "(rad/s²)/(N m)"),
    "axial": ("acceleration of the root along the axis per force", "(m/s²)/N"),
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
    _accelerance(ax, fit, port)
    return alone(ax)


def alone(ax: "Axes") -> "Axes":
    """Axes over frequency with what they need where no others stand below them."""
    over_frequency(ax, ax.get_ylabel())
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
def response_figure(fit: "Fit", port: str) -> Figure:
    """Accelerance of the root, undamped, of the beam and of the chain through MuJoCo, and below it
    the error of the hub's motion, whose largest in the band is the in-band error."""
    figure, (above, below) = panels(*ACCELERANCE_OVER_ERROR)
    _accelerance(above, fit, port)
    hub, place = worst_hub(fit, port)
    curve = error_curve(fit, port, hub, span(fit, port))
    band = fit.bandwidth[port]
    stated = fit.readback_error[port].accelerance_in_band
    title = f"error of the hub's motion, {place}"
    error_panel(below, curve, band, curve.largest(band) if stated is None else stated, title)
    return finished(figure)


def finished(figure: Figure) -> Figure:
    """The figure of two panels with its scales of frequency and its legend."""
    above, below = figure.axes
    for ax in (above, below):
        ax.xaxis.set_minor_locator(NullLocator())  # ticks are most of what drawing costs
        ax.yaxis.set_minor_locator(NullLocator())
    in_hz(above)
    above.tick_params(labelbottom=False)
    below.set_xlabel("frequency, rad/s")
    figure.legend(*above.get_legend_handles_labels(), loc="outside upper left", ncols=3)
    return figure


def _accelerance(ax: "Axes", fit: "Fit", port: str) -> None:
    """The beam over the chain, with the beam's poles and zeros at the edges."""
    what, unit = ENTRIES[port]
    beam, chain = responses(fit, port)
    low, high = np.quantile(np.log10(np.clip(np.abs(beam.even()), 1e-300, None)), [0.05, 0.95])
    frame(ax, span(fit, port), (10.0 ** (low - 0.7), 10.0 ** (high + 0.9)), fit.bandwidth[port])
    ours: Any = {"color": OURS, "linewidth": 3.4, "solid_joinstyle": "round"}
    ax.plot(chain.omega, np.abs(chain.values), label=f"{CHAIN}, through MuJoCo", **ours)
    ax.plot(beam.omega, np.abs(beam.values), color=BEAM, linewidth=1.1, label="beam")
    poles, zeros = beam.crossings()
    edge: Any = {"transform": ax.get_xaxis_transform(), "color": BEAM, "clip_on": False}
    ax.plot(poles, np.ones(poles.size), "x", markersize=5.5, label="beam's poles", **edge)
    edge["markerfacecolor"] = "white"
    ax.plot(zeros, np.zeros(zeros.size), "o", markersize=5.0, label="beam's zeros", **edge)
    ax.set_title(what, pad=8.0)
    ax.set_ylabel(f"|W|, {unit}")


def error_panel(ax: "Axes", curve: ErrorCurve, band: float, stated: float, title: str) -> None:
    """Error of the hub's motion over frequency; its largest in the band is marked with what is
    stated of it."""
    top = float(curve.error.max(initial=ROUNDING))
    bottom = float(np.clip(curve.error.min(), 1e-7 * top, 0.1 * top))
    limits = float(curve.omega[0]), float(curve.omega[-1])
    frame(ax, limits, (bottom / 2.0, 4.0 * top), band)
    ax.plot(curve.omega, curve.error, color=OURS, linewidth=2.0)
    at = curve.peak(band)
    x, y = float(curve.omega[at]), float(curve.error[at])
    ax.plot(x, y, marker="o", markersize=5.5, color=OURS, linestyle="none")
    beside(ax, error_text(stated), (x, y), up=4, color=OURS, fontweight="bold")
    ax.set_title(title, pad=6.0)
    ax.set_ylabel("relative error")


def beside(ax: "Axes", text: str, at: tuple[float, float], up: float = 0.0, **style: Any) -> None:
    """A text beside a point, so many points above it, on the side where the panel has room."""
    low, high = ax.get_xlim()
    right = at[0] > low * (high / low) ** 0.7
    side: Any = {"textcoords": "offset points", "ha": "right" if right else "left"}
    ax.annotate(text, at, xytext=(-6 if right else 6, up), **side, **style)


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
    labelled = (1.0, 2.0, 5.0) if short else (1.0,)
    ticked = tuple(np.arange(2.0, 10.0)) if decades < 6.0 else (1.0,)
    axis.set_major_locator(LogLocator(subs=labelled, numticks=12 if short else 8))
    axis.set_minor_locator(LogLocator(subs=ticked, numticks=60))
    axis.set_major_formatter(FuncFormatter(plain if short else text))
    axis.set_minor_formatter(NullFormatter())


def frame(
    ax: "Axes", limits: tuple[float, float], heights: tuple[float, float], band: float = 0.0
) -> None:
    """Logarithmic axes with the kept band, if any, shaded and what is beyond it hatched."""
    ax.set(xscale="log", yscale="log", xlim=limits, ylim=heights)
    log_axis(ax.xaxis, limits, plain)
    log_axis(ax.yaxis, heights, power)
    ax.grid(visible=True, color="#e3e3e3", linewidth=0.6)
    ax.set_axisbelow(True)
    low, high = limits
    below: Any = {"linewidth": 0, "zorder": 0}
    if band:
        ax.axvspan(low, min(band, high), color=SHADE, label="kept band", **below)
    if 0.0 < band < high:
        below |= {"facecolor": "none", "edgecolor": HATCH, "hatch": "////"}
        ax.axvspan(max(band, low), high, label="not asked for", **below)


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
    corner: Any = {"xycoords": "axes fraction", "textcoords": "offset points"}
    ax.annotate("Hz", (1.0, 1.0), xytext=(4.0, 1.0), fontsize=8.5, **corner)


def over_frequency(ax: "Axes", ylabel: str) -> None:
    """Label axes over frequency, and show it in Hz above."""
    in_hz(ax)
    ax.set(xlabel="frequency, rad/s", ylabel=ylabel)


def panels(height: float, *shares: float) -> "tuple[Figure, list[Axes]]":
    """A new figure of a height [inch] with panels below each other that have these shares of it."""
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    return figure, list(figure.subplots(len(shares), 1, squeeze=False, height_ratios=shares)[:, 0])


def panel(height: float) -> "tuple[Figure, Axes]":
    """The same with one panel."""
    figure, (ax,) = panels(height, 1.0)
    return figure, ax


# -- the chain -------------------------------------------------------------------------------------
_MARKERS = {"xy": "o", "xz": "s", "torsion": "D", "axial": "^"}
_LABEL, _ROWS = 8.5, 3  # size of a label [pt]; rows of labels above and below the chain
_CROSSED = Path.make_compound_path(
    Path.unit_circle(), Path([(-1, 0), (1, 0), (0, -1), (0, 1)], [1, 2, 1, 2])
)


@drawing()
def chain_figure(fit: "Fit") -> Figure:
    """The chain to scale along x."""
    plane = next((port for port in fit.target if port in PLANES), next(iter(fit.target), PLANES[0]))
    height = 2.55
    figure = Figure(figsize=(WIDTH, height))
    figure.subplots_adjust(left=0.02, right=0.98, top=1.0 - 0.28 / height, bottom=0.77 / height)
    ax = figure.add_subplot()
    _draw_chain(ax, fit.chain, fit.beam, plane)
    ax.set_xlabel("x from the root, m")
    style: Any = {"ncols": 6, "handlelength": 1.2, "columnspacing": 1.0, "borderaxespad": 0.2}
    figure.legend(*ax.get_legend_handles_labels(), loc="lower center", **style)
    return figure


def _draw_chain(ax: "Axes", chain: Chain, beam: Beam | None, plane: str) -> None:
    length = chain.length
    left, right = -0.055 * length, 1.03 * length
    ax.set(xlim=(left, right), ylim=(-1.05, 1.05))
    ax.yaxis.set_visible(False)
    ax.spines["left"].set_visible(False)
    x = np.linspace(0.0, length, 121)
    depth = np.array([0.0 if beam is None else beam.depth(float(at), plane) for at in x])
    depth = 0.24 * (depth / depth.max() if depth.max() > 0.0 else np.ones(x.size))
    ax.fill_between(x, -depth, depth, color="#dddddd", linewidth=0, label="beam")
    hub: Any = {"facecolor": "#f4f4f4", "edgecolor": "#777777", "hatch": "////", "linewidth": 0.8}
    ax.fill_between([left, 0.0], -0.3, 0.3, **hub)
    for lump in () if beam is None else beam.lumps:
        ax.plot(lump.x, 0.27, "v", color="#777777", markersize=6.0)
    real = [link for link in chain.links if link.mass > 0.0]
    gap = 0.004 * length
    for link in real:
        ends = [link.start + gap, min(link.start + link.length, length) - gap]
        ax.plot(ends, [0.0, 0.0], color=OURS, linewidth=5.0, solid_capstyle="butt")
    centre: Any = {"marker": _CROSSED, "markersize": 7.0, "fillstyle": "none", "linestyle": "none"}
    centres = [link.com for link in real]
    ax.plot(centres, np.zeros(len(real)), color="black", label="centre of mass", **centre)
    edge: Any = {"markerfacecolor": "white", "markeredgecolor": OURS, "markeredgewidth": 1.8}
    for port in chain.ports:
        at = [hinge.x for hinge in chain.hinges if port in hinge.stiffness]
        label = "hinge" if len(chain.ports) == 1 else f"hinge {port}"
        size = 6.5 if port == "xy" else 5.5
        ax.plot(at, np.zeros(len(at)), _MARKERS[port], markersize=size, label=label, **edge)
    masses = _rows(ax, [(link.com, f"{short(link.mass)} kg") for link in real])
    springs = _rows(ax, [(hinge.x, _springs(hinge.stiffness)) for hinge in chain.hinges])
    what = f"{count(len(real), 'link')}, {count(len(chain.hinges), 'hinge')}"
    if len(chain.ports) > 1:
        what += "; stiffness in N m/rad" + (", axial N/m" if "axial" in chain.ports else "")
    if masses is None or springs is None:
        what += " (too many to label; see the table)"
    else:
        _write(ax, masses, 1.0, OURS)
        _write(ax, springs, -1.0, "#222222")
    ax.set_title(what, pad=3.0, color=OURS)


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
    width = 72.0 * ax.get_position().width * WIDTH  # of the panel [pt]
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
