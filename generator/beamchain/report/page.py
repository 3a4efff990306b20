"""What a page is made of: tables, pictures, sentences and lists in sections."""

from collections.abc import Sequence
from typing import NamedTuple


class Table(NamedTuple):
    """A table; its first column names the row. `words`: cells are text, not numbers."""

    rows: Sequence[Sequence[str]]
    head: Sequence[str] = ()
    caption: str = ""
    note: str = ""
    words: bool = False
    kind: str = "table"


class Picture(NamedTuple):
    """An inline SVG; `moves`: "zoom" (a plot that the page's script zooms) or "ring" (mode shapes)."""

    svg: str
    caption: str
    moves: str = ""
    kind: str = "figure"


class Text(NamedTuple):
    """A paragraph, heading or code."""

    text: str
    kind: str = "paragraph"


class Lines(NamedTuple):
    """A list."""

    lines: Sequence[str]
    kind: str = "list"


Block = Table | Picture | Text | Lines
Pictures = dict[str, str]


class Section(NamedTuple):
    """A part of the page."""

    title: str
    blocks: Sequence[Block]


def inline(svg: str, label: str) -> str:
    """An SVG file's text as it may stand inside a page."""
    body = svg[svg.index("<svg") :]
    body = body.replace('<style type="text/css">*{stroke-linejoin: round; stroke-linecap: butt}</style>', "")
    body = body.replace(' xmlns:xlink="http://www.w3.org/1999/xlink"', "").replace("xlink:href", "href")
    body = body.replace(' xmlns="http://www.w3.org/2000/svg"', "", 1)
    quoted = label.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
    return body.replace("<svg", f'<svg role="img" aria-label="{quoted}"', 1).strip()
