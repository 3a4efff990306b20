"""The documentation site: `make docs` builds it into build/site. Nothing is fetched,
and warnings are errors.

Reference pages are generated (reference.py); notebooks,
README and the like are copied beside the pages at each build.
"""

import re
import shutil
import sys
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import reference  # noqa: E402

import beamchain  # noqa: E402

project = "beamchain"
author = "beamchain maintainers"
release = beamchain.__version__
copyright = author
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
nb_execution_mode = "off"  # the outputs are those committed, which the tests repeat
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 3
default_role = "literal"  # docstrings write code between single backticks
autodoc_preserve_defaults = True
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the signature's types stand in the text, with shapes and units
add_module_names = False
smartquotes_action = "qe"  # quotes and dots; options keep both of their dashes
suppress_warnings = ["misc.highlighting_failure"]  # TOML with [ ... ]
html_theme = "pydata_sphinx_theme"
html_title = f"beamchain {release}"
html_static_path = ["site.css", "site.js"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_show_sourcelink, html_copy_source = False, False
templates_path = ["templates"]
html_sidebars = {"**": ["pages.html"], "index": []}
html_theme_options = {
    "navbar_center": [],  # the sidebar has all pages
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
}

PROJECT = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "CITATION.cff")


def beside() -> None:
    """Write generated pages and copies into docs/reference, docs/notebooks and docs/project;
    old ones go."""
    wanted = {HERE / path: text for path, text in reference.pages().items()}
    wanted |= {
        HERE / "notebooks" / p.name: p.read_text("utf-8")
        for p in HERE.parent.glob("notebooks/*.ipynb")
    }
    wanted |= {HERE / "project" / name: (HERE.parent / name).read_text("utf-8") for name in PROJECT}
    for folder in ("reference", "notebooks", "project"):
        for old in set((HERE / folder).rglob("*.*")) - set(wanted):
            shutil.rmtree(old) if old.is_dir() else old.unlink()
    for path, text in wanted.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")


OPTIONAL = r"\[([^\]]*)\]\(([^)#\s]*(?:products/[\w-]+\.md|notebooks/\w+\.ipynb))[^)]*\)"


def without_links(text: str, here: Path) -> str:
    """A page's text without its links to pages and notebooks that are not there, nor an entry of a
    toctree that no page is left of."""
    bases = (here, HERE.parent, HERE.parent / "notebooks")  # of the site; README; notebooks
    lines = []
    for line in text.splitlines(keepends=True):
        links = re.finditer(OPTIONAL, line)
        gone = [m for m in links if not any((base / m[2]).exists() for base in bases)]
        no_page = line == "/products/*\n" and not list(HERE.glob("products/*.md"))
        if no_page or (gone and line.startswith(("* ", "| "))):
            continue
        for link in gone:
            line = line.replace(link[0], link[1])
        lines.append(line)
    return "".join(lines)


def moved(_app: Any, name: str, source: list[str]) -> None:
    """Links as they are right in the repository lead to the same pages of the site.

    Of a package beside the core that was taken out, the page and the notebook are gone: entries
    and rows that lead there go, and within a text the link.
    """
    here = (HERE / name).parent
    there = without_links(source[0], here)
    there = re.sub(r"\]\((?:\.\./)*docs/", "](/", there)
    there = re.sub(r"\]\((?:\.\./)*notebooks/", "](/notebooks/", there)
    source[0] = re.sub(
        rf"\]\((?:\.\./)*({'|'.join(map(re.escape, PROJECT))})", r"](/project/\1", there
    )


def sentence(
    _app: Any, kind: str, _name: str, _thing: Any, _options: Any, lines: list[str]
) -> None:
    """An empty comment above a property's text:
    napoleon takes what stands before a colon in the first line for a type."""
    if kind in ("property", "attribute"):
        lines[:0] = ["..", ""]


def formula(self: Any, node: Any) -> None:
    """A formula as MathML, which browsers draw without a script."""
    from docutils.nodes import SkipNode

    block = node.tagname == "math_block"
    made = convert(node.astext(), display="block" if block else "inline")
    self.body.append(f'<div class="formula">{made}</div>' if block else made)
    raise SkipNode


UNIT = r" (?:%|[kmnµ]?[msgNJ]|rad|[kM]?Hz)(?:/s²?)?(?![\w/])"
NUMBER = re.compile(rf"(-?\d[\d.,]*e-?\d+(?:{UNIT})?|-?\d[\d.,]*{UNIT})")

LONGEST = 34  # letters of a word of code that stay together on a narrow page


def laid_out(_app: Any, doctree: Any) -> None:
    """Numbers stay on one line with their exponents and units, formulas with the stop behind them.

    Long words of code may break, drawings scroll where the page is narrower.
    """
    from docutils import nodes

    for text in list(doctree.findall(nodes.Text)):
        if not isinstance(text.parent, nodes.paragraph):
            continue
        parts = enumerate(NUMBER.split(text.astext()))
        pieces = [
            nodes.inline("", part, classes=["together"]) if i % 2 else nodes.Text(part)
            for i, part in parts
        ]
        if len(pieces) > 1:
            text.parent.replace(text, pieces)
    for math in list(doctree.findall(nodes.math)):
        parent = math.parent
        at = math.parent.index(math)
        after = "".join(text for text in parent[at + 1 : at + 2] if isinstance(text, nodes.Text))
        if stop := re.match(r"[.,:;)\]]+", after):
            whole = nodes.inline("", "", math, nodes.Text(stop[0]), classes=["together"])
            parent[at : at + 2] = [whole, nodes.Text(after[stop.end() :])]
    for literal in doctree.findall(nodes.literal):
        if max(map(len, literal.astext().split()), default=0) > LONGEST:
            literal["classes"].append("long")
    for image in list(doctree.findall(nodes.image)):
        if isinstance(image.parent, nodes.container):  # of a cell
            image.replace_self(box := nodes.container(classes=["drawing"]))
            box += image
        elif image["uri"].endswith((".svg", "extremes.png")):
            image.parent["classes"].append("drawing")


def setup(app: Any) -> None:
    """Called by Sphinx."""
    beside()
    app.connect("source-read", moved)
    app.connect("doctree-read", laid_out)
    app.connect("autodoc-process-docstring", sentence, priority=100)
    app.add_html_math_renderer("mathml", (formula, None), (formula, None))


html_math_renderer = "mathml"
