"""What a page is made of: tables, pictures, sentences and lists in sections; and the page itself from a template."""

import platform
import re
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
import numpy as np

from beamchain.ports.motions import PORTS


class Table(NamedTuple):
    """A table; its first column names the row.

    `words`: cells are text, not numbers; `named`: the second column is; `folded`: what to open to see it.
    """

    rows: Sequence[Sequence[str]]
    head: Sequence[str] = ()
    caption: str = ""
    note: str = ""
    words: bool = False
    named: bool = False
    folded: str = ""
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


def begun(text: str, names: Iterable[str] = ()) -> str:
    """A sentence with its first letter large, unless it begins with a name that the user gave."""
    word = re.split(r"[\s:,]", text, maxsplit=1)[0]
    own = not word.isalpha() or word in {*PORTS, *names}  # segment[0] is a place in the user's file
    return text if own else text[:1].upper() + text[1:]


def page_text(template: str, **values: Any) -> str:
    """The text of a page, made from one of the templates beside this module.

    Args:
        template: file name.
        values: what it asks for by name.
    """
    return _environment().get_template(template).render(**values)


def versions() -> str:
    """What made the page, for its foot."""
    import beamchain
    from beamchain.engine.library import mujoco

    return (
        f"beamchain {beamchain.__version__}, MuJoCo {mujoco.__version__}, NumPy {np.__version__}, "
        f"Python {platform.python_version()}. SI units, radians; x runs from the root outwards."
    )


@cache
def _environment() -> jinja2.Environment:
    loader = jinja2.FileSystemLoader(Path(__file__).parent / "templates")
    return jinja2.Environment(loader=loader, autoescape=True, undefined=jinja2.StrictUndefined)
