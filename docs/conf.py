"""The documentation site: `make docs` builds it into build/site. Nothing is fetched, and warnings are errors.

Reference pages are generated (reference.py); notebooks, README and the like are copied beside the pages at each build.
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

project, author, release = "beamchain", "beamchain maintainers", beamchain.__version__
copyright = author
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["paper"]  # written for a journal
nb_execution_mode = "off"  # the outputs are those committed, which the tests repeat
myst_enable_extensions = ["dollarmath", "amsmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 3
default_role = "literal"  # docstrings write code between single backticks
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the signature's types stand in the text, with shapes and units
add_module_names = False
suppress_warnings = ["misc.highlighting_failure"]  # TOML with [ ... ]
html_theme = "pydata_sphinx_theme"
html_title = f"beamchain {release}"
html_static_path, html_css_files = ["site.css"], ["site.css"]
html_show_sourcelink, html_copy_source = False, False
html_sidebars = {page: [] for page in ("index", "start", "theory", "gallery", "migration")}  # no pages below them
html_theme_options = {
    "header_links_before_dropdown": 7,
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
}

PROJECT = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "CITATION.cff")


def beside() -> None:
    """Write generated pages and copies into docs/reference, docs/notebooks and docs/project; old ones go."""
    wanted = {HERE / path: text for path, text in reference.pages().items()}
    wanted |= {HERE / "notebooks" / p.name: p.read_text("utf-8") for p in HERE.parent.glob("notebooks/*.ipynb")}
    wanted |= {HERE / "project" / name: (HERE.parent / name).read_text("utf-8") for name in PROJECT}
    for folder in ("reference", "notebooks", "project"):
        for old in set((HERE / folder).rglob("*.*")) - set(wanted):
            shutil.rmtree(old) if old.is_dir() else old.unlink()
    for path, text in wanted.items():
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")


def moved(_app: Any, name: str, source: list[str]) -> None:
    """Links as they are right in the repository lead to the same pages of the site.

    In a toctree, `page?` is a place for a page to come: it is left out until there is one.
    """
    here = (HERE / name).parent
    there = re.sub(
        r"^(/?)([\w-]+)\?$",
        lambda m: m[1] + m[2] if ((HERE if m[1] else here) / f"{m[2]}.md").exists() else "",
        source[0],
        flags=re.M,
    )
    there = re.sub(r"\]\((?:\.\./)*docs/", "](/", there)
    there = re.sub(r"\]\((?:\.\./)*notebooks/", "](/notebooks/", there)
    source[0] = re.sub(rf"\]\((?:\.\./)*({'|'.join(map(re.escape, PROJECT))})", r"](/project/\1", there)


def formula(self: Any, node: Any) -> None:
    """A formula as MathML, which browsers draw without a script."""
    from docutils.nodes import SkipNode

    block = node.tagname == "math_block"
    made = convert(node.astext(), display="block" if block else "inline")
    self.body.append(f'<div class="formula">{made}</div>' if block else made)
    raise SkipNode


def told(_app: Any, doctree: Any) -> None:
    """An alternative text for each picture that a notebook's cell drew: the section that it belongs to."""
    for image in doctree.findall(lambda node: node.tagname == "image" and not node.get("alt")):
        section = image.parent
        while section.tagname != "section":
            section = section.parent
        image["alt"] = f"Plot drawn by the cell above it: {section.next_node(lambda n: n.tagname == 'title').astext()}"


def setup(app: Any) -> None:
    """Called by Sphinx."""
    beside()
    app.connect("source-read", moved)
    app.connect("doctree-read", told)
    app.add_html_math_renderer("mathml", (formula, None), (formula, None))


html_math_renderer = "mathml"
