"""The legend of a picture as text of its page, so that it is readable where the picture is small."""

from html import escape
from typing import Any

from lxml import etree

SVG = "{http://www.w3.org/2000/svg}"
SWATCH = 20.0, 7.0, 10.0  # width of a handle, from it to its text, its height [pt]
GAP = 3.0  # [pt], left where the legend was


def parted(svg: str) -> tuple[str, str]:
    """A picture without the legend that stands above or below its panels, cut off there, and that legend as HTML.

    Args:
        svg: of `to_svg`, with the declarations of its file.
    """
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
