"""Figures as SVG; the legend as text of the page, so that it is readable where the picture is small."""

import io
import json
from html import escape
from typing import Any

import matplotlib as mpl
from lxml import etree
from matplotlib.figure import Figure

from beamchain.report.plots import STYLE

SVG = "{http://www.w3.org/2000/svg}"
SWATCH = 20.0, 7.0, 10.0  # width of a handle, from it to its text, its height [pt]
GAP = 3.0  # [pt], left where the legend was


def to_svg(figure: Figure, name: str) -> str:
    """SVG text of a figure, the same for the same fit; ids carry `name`, so that several can stand in one page.

    Axes with logarithmic frequency (or time) are described in `data-plot`, for the page's script to zoom into them.
    """
    for i, ax in enumerate(figure.axes, 1):  # by itself matplotlib would count those in Hz too
        ax.set_gid(f"panel_{i}")
    stream = io.StringIO()
    with mpl.rc_context({**STYLE, "svg.hashsalt": name}):
        figure.savefig(stream, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    text = stream.getvalue().replace("'DejaVu Sans'", "'DejaVu Sans', Verdana, sans-serif")
    for before in ('id="', "url(#", 'href="#'):
        text = text.replace(before, f"{before}{name}-")
    told = json.dumps(_described(figure, name), separators=(",", ":"))
    return text.replace("<svg ", f"<svg data-plot='{told}' ", 1) if told != "[]" else text


def _described(figure: Figure, name: str) -> list[dict[str, Any]]:
    """Where each axes with a logarithmic x stands in the SVG [pt], and the limits it shows."""
    width, height = 72.0 * figure.get_size_inches()
    out: list[dict[str, Any]] = []
    for i, ax in enumerate(figure.axes, 1):
        if ax.get_xscale() != "log":
            continue
        at = ax.get_position()
        out.append({
            "id": f"{name}-panel_{i}",
            "box": [round(v, 3) for v in (at.x0 * width, (1.0 - at.y1) * height, at.width * width, at.height * height)],
            "x": [float(f"{v:.9g}") for v in ax.get_xlim()],
            "y": [float(f"{v:.9g}") for v in ax.get_ylim()],
            "log": ax.get_yscale() == "log",
        })  # fmt: skip
    return out


def parted(svg: str) -> tuple[str, str]:
    """A picture of `to_svg` without the legend above or below its panels, cut off there, and that legend as HTML."""
    root: Any = etree.fromstring(svg.encode())
    figure = root.find(f"{SVG}g")
    legend = next((g for g in figure if "legend" in g.get("id", "")), None)
    if legend is None:
        return svg, ""
    entries: list[str] = []
    handle: list[Any] = []
    heights: list[float] = []
    for item in legend:
        text = item.find(f"{SVG}text")
        if text is None:
            handle.append(item)
            continue
        x, y = float(text.get("x")), float(text.get("y"))
        heights.append(y)
        entries.append(_entry(handle, x, y, text.text or ""))
        handle = []
    figure.remove(legend)
    left, top, width, height = (float(v) for v in root.get("viewBox").split())
    above, below = max(heights) + GAP, min(heights) - SWATCH[2] - GAP
    top, height = (above, height - above) if above < height / 2.0 else (top, below)
    root.set("viewBox", f"{left:g} {top:.2f} {width:g} {height:.2f}")
    root.set("height", f"{height:.2f}pt")
    return etree.tostring(root, encoding="unicode"), f'<ul class="legend">{"".join(entries)}</ul>'


def _entry(handle: list[Any], x: float, y: float, text: str) -> str:
    """A line of the legend; its handle stands left of `x` on the line of text at `y`."""
    width, space, height = SWATCH
    box = f"{x - space - width:.2f} {y - height + 1.5:.2f} {width:g} {height:g}"
    drawn = "".join(etree.tostring(item, encoding="unicode", with_tail=False) for item in handle)
    name = escape(text)
    return f'<li><svg role="img" aria-label="mark: {name}" viewBox="{box}">{drawn}</svg>{name}</li>'
