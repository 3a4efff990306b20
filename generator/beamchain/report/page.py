"""Pages from the templates beside this module,
and the words and numbers that they are filled with."""

import platform
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, cast

import jinja2
import numpy as np

from beamchain.checks import printable
from beamchain.fitting.spec_text import spec_toml
from beamchain.ports.motions import PORTS
from beamchain.report.formats import error_text, number, short, typeset, typeset_unit, vector


class Verdict(NamedTuple):
    """The report in one sentence, and whether all that was asked for was reached."""

    good: bool
    sentence: str


def inline(svg: str, label: str) -> str:
    """An SVG file's text as it may stand inside a page, where it scrolls if need be."""
    quoted = printable(label).replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
    body = svg[svg.index("<svg") :].replace("<svg", f'<svg role="img" aria-label="{quoted}"', 1)
    for gone in (
        '<style type="text/css">*{stroke-linejoin: round; stroke-linecap: butt}</style>',
        ' xmlns:xlink="http://www.w3.org/1999/xlink"',
        ' xmlns="http://www.w3.org/2000/svg"',
    ):
        body = body.replace(gone, "")
    return f'<div class="scroll">{body.strip()}</div>'.replace("xlink:href", "href")


def capitalise(text: str, names: Iterable[str] = ()) -> str:
    """A sentence with its first letter large, unless it begins with a name that the user gave."""
    word = re.split(r"[\s:,]", text, maxsplit=1)[0]
    own = not word.isalpha() or word in {*PORTS, *names}  # segment[0] is a place in the user's file
    return text if own else text[:1].upper() + text[1:]


def page_text(template: str, folder: Path | None = None, **values: Any) -> str:
    """The text of a page, made from a template, of the report or in a folder, and what it asks for
    by name."""
    common = {
        "titles": [],
        "tiles": (),
        "zip": zip,
        "spec_toml": spec_toml,
    }
    page = _environment(folder).get_template(template)
    return page.render({**common, "versions": _versions(), **values})


def _versions() -> str:
    """What made the page, for its foot."""
    import beamchain
    from beamchain.engine.library import mujoco

    return (
        f"beamchain {beamchain.__version__}, MuJoCo {mujoco.__version__}, NumPy {np.__version__}, "
        f"Python {platform.python_version()}. SI units, radians; x runs from the root outwards."
    )


def _finalize(value: Any) -> Any:
    """What a template writes of a value: plain text without characters that would change how
    the rest is shown."""
    return printable(value) if type(value) is str else value


@cache
def _environment(folder: Path | None) -> jinja2.Environment:
    folders = [Path(__file__).parent / "templates", *([] if folder is None else [folder])]
    loader = jinja2.FileSystemLoader(folders)
    made = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, finalize=_finalize
    )
    words = {
        "begun": capitalise,
        "inline": inline,
        "number": number,
        "error_text": error_text,
        "short": short,
        "typeset": typeset,
        "typeset_unit": typeset_unit,
        "vector": vector,
    }
    cast("dict[str, Any]", made.filters).update(words)
    return made
