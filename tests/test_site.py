"""The documentation site: every key, command and public name is in it; nothing is dead, fetched or
without a text."""

import importlib.util
import inspect
import json
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from urllib.parse import unquote, urldefrag

import msgspec
import pytest
from lxml import html

import beamchain as bc
import returned
from beamchain.warning_codes import CODES
from command import app
from products import PRODUCTS

DOCS = Path(__file__).parent.parent / "docs"
SOURCES = [DOCS.parent / "README.md", *sorted(DOCS.glob("*.md")), *sorted(DOCS.glob("howto/*.md"))]
PUBLIC = returned.public()
NAMES = {full.rpartition(".")[2]: full for full in PUBLIC}
pytestmark = pytest.mark.skipif(
    not DOCS.is_dir(), reason="docs are not beside the tests (an installed wheel)"
)
sources = pytest.mark.parametrize(
    "path", SOURCES, ids=lambda path: path.relative_to(DOCS.parent).as_posix()
)


@pytest.fixture(scope="module")
def pages():
    """Generated pages by their path."""
    spec = importlib.util.spec_from_file_location("site_reference", DOCS / "reference.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.pages()


# -- what the pages say ----------------------------------------------------------------------------
def rows(text):
    """Cells of every table row."""
    return [
        [cell.strip() for cell in line[1:-1].split(" | ")]
        for line in re.findall(r"^\| .* \|$", text, re.M)
    ]


@pytest.mark.parametrize(
    ("page", "struct"), [("specification", bc.Spec), ("controller", bc.spec.Controller)]
)
@pytest.mark.slow
def test_every_key_is_in_the_reference(pages, page, struct):
    """As often as there are tables with a key of that name."""
    definitions = msgspec.json.schema(struct)["$defs"].values()
    keys = Counter(f"`{key}`" for table in definitions for key in table["properties"])
    assert Counter(row[0] for row in rows(pages[f"reference/{page}.md"]) if row[0] != "key") == keys


@pytest.mark.parametrize(
    "expected",
    [
        ["`youngs_modulus`", "number", "N/m^2", "required", "> 0"],
        ["`repeat`", "whole number", "", "`1`", "≥ 1, ≤ 500"],
        ["`theory`", '`"euler"`, `"timoshenko"`', "", '`"euler"`', ""],
        ["`target`", '`"auto"`, `"clamped"`, `"free"`, `"hub"`', "", "", ""],
        ["`tip`", "true or false", "", "`false`", ""],
        ["`inertia`", "list of 3: number", "kg m^2", "required", "> 0"],
        ["`segment`", "list: [table](#Spec-Segment)", "", "", ""],
        [
            "`axes`",
            'list: `"tx"`, `"ty"`, `"tz"`, `"x"`, `"y"`, `"z"`',
            "",
            '`["x", "y", "z", "tx", "ty", "tz"]`',
            "",
        ],
    ],
)
def test_a_key_has_type_unit_default_and_bounds(pages, expected):
    """A few, typed by hand."""
    assert expected in [[row[0], *row[2:]] for row in rows(pages["reference/specification.md"])]


@pytest.mark.parametrize(
    "command", [c for c in app.registered_commands if not c.hidden], ids=lambda c: c.name
)
def test_every_command_and_option_is_in_the_reference(pages, command):
    text = re.search(
        rf"^## beamchain {command.name}\n(.*?)(?=^## |\Z)",
        pages["reference/commands.md"],
        re.S | re.M,
    )
    assert text is not None
    arguments = len(inspect.signature(command.callback).parameters)
    assert len([row for row in rows(text[1]) if row[0] != "argument or option"]) == arguments
    assert "beamchain " in text[1]


def test_every_warning_is_in_the_reference(pages):
    found = re.findall(
        r"^## (\S+)\n\n.+\.\n\n\*\*Cure:\*\* .+\.$", pages["reference/warnings.md"], re.M
    )
    assert found == list(CODES)


def test_every_error_is_in_the_reference(pages):
    found = {row[0].strip("`") for row in rows(pages["reference/warnings.md"]) if "`" in row[0]}
    assert found == {one.__name__ for one in bc.BeamchainError.__subclasses__()}


def test_every_public_name_has_a_page(pages):
    for name, full in NAMES.items():
        assert f":: beamchain.{full}" in pages[f"reference/python/{name}.md"]
        assert f"[bc.{full}]({name}.md)" in pages["reference/python/index.md"]


def test_every_class_that_a_function_returns_has_a_page(pages):
    """By annotations: of public functions, and of the members of what they return."""
    assert returned.by_functions() == {}  # what a public function returns is public
    every = "".join(text for path, text in pages.items() if path.startswith("reference/"))
    assert [
        name
        for name, one in returned.by_all().items()
        if f":: {one.__module__}.{name}\n" not in every
    ] == []
    products = {"robust": ("UncertainPlant", "WorstCase"), "worlds": ("Worlds",)}
    of_products = (name for one in PRODUCTS for name in products.get(one, ()))
    results = {"Plant", "ScheduledPlant", "Sweep", "Study", *of_products}
    assert results <= set(NAMES)
    for name in results:
        assert "Returned by `" in pages[f"reference/python/{name}.md"]


@pytest.mark.skipif("worlds" not in PRODUCTS, reason="worlds is not there")
def test_the_environment_has_a_page(pages):
    text = pages["reference/results/gym.md"]
    assert all(
        f":: beamchain.{name}" in text for name in ("worlds.gym", "worlds.satellite.Satellite")
    )


@sources
def test_one_title_and_a_text_for_every_picture(path):
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.S | re.M)
    assert len(re.findall(r"^# ", text, re.M)) == 1
    assert all(len(words) > 15 for words in re.findall(r"!\[([^\]]*)\]\(", text))


# -- the site as built -----------------------------------------------------------------------------
@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Every page of the site, built with warnings as errors."""
    for name in ("sphinx", "myst_nb", "pydata_sphinx_theme", "latex2mathml"):
        pytest.importorskip(name, reason="the site's packages are not installed: make docs")
    folder = tmp_path_factory.mktemp("site")
    words = [
        sys.executable,
        "-m",
        "sphinx",
        "-q",
        "-W",
        "--keep-going",
        "-d",
        folder / "read",
        DOCS,
        folder / "html",
    ]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return {
        path: html.parse(path).getroot()
        for path in (folder / "html").rglob("*.html")
        if "_static" not in path.parts
    }


@pytest.mark.slow
def test_links_lead_somewhere(site):
    ids = {path: set(page.xpath("//@id")) for path, page in site.items()}
    dead = []
    for path, page in site.items():
        for link in page.xpath("//a/@href"):
            place, fragment = urldefrag(unquote(link))
            if re.match(r"[a-z]+:", place):
                continue
            target = (path.parent / place).resolve() if place else path
            if not target.is_file() or (fragment and target in ids and fragment not in ids[target]):
                dead.append((path.name, link))
    assert dead == []


@pytest.mark.slow
def test_nothing_is_fetched(site):
    found = [
        (path.name, address)
        for path, page in site.items()
        for address in page.xpath(
            "//script/@src | //link[@rel='stylesheet' or @rel='preload']/@href | //img/@src | "
            "//iframe/@src"
        )
        if re.match(r"(https?:)?//", address)
    ]
    folder = min(site, key=lambda path: len(path.parts)).parent
    for style in folder.rglob("*.css"):
        found += re.findall(
            r"(?:url\(|@import )['\"]?(?:https?:)?//[^)]*", style.read_text(encoding="utf-8")
        )
    assert found == []


@pytest.mark.slow
def test_headings_and_pictures(site):
    """One title per page, no level left out, and words for every picture,
    those of notebooks included."""
    for path, page in site.items():
        levels = [
            int(heading.tag[1])
            for heading in page.xpath("//main//*[self::h1 or self::h2 or self::h3 or self::h4]")
        ]
        assert levels.count(1) == 1, path
        assert all(
            after <= before + 1 for before, after in zip(levels, levels[1:], strict=False)
        ), path
        texts = [picture.get("alt") or "" for picture in page.xpath("//main//img")]
        assert all(len(text.split()) > 3 for text in texts), (path, texts)
        assert len(set(texts)) == len(texts), path


@pytest.mark.slow
def test_no_title_stands_twice_in_the_navigation(site):
    for path, page in site.items():
        links = page.xpath("//nav[contains(@class, 'bd-docs-nav')]//a")
        titles = Counter(link.text_content().strip() for link in links)
        assert [title for title, count in titles.items() if count > 1] == [], path


@pytest.mark.slow
def test_numbers_stay_on_one_line(site):
    """Browsers break a line at the hyphen of an exponent."""
    for path, page in site.items():
        texts = page.xpath(
            "//main//td//text()[not(ancestor::code or ancestor::*[@class='together'] or "
            "ancestor::pre)]"
        )
        assert [text for text in texts if re.search(r"\de-\d", text)] == [], path


@pytest.mark.slow
def test_options_keep_both_dashes(site):
    """Typography would make one long dash of them."""
    for path, page in site.items():
        assert re.findall(r"(?:^|\s)–[a-z]\S*", page.xpath("//main")[0].text_content()) == [], path


@pytest.mark.slow
def test_no_header_of_a_column_is_empty(site):
    for path, page in site.items():
        assert [
            cell for cell in page.xpath("//main//th") if not cell.text_content().strip()
        ] == [], path


@pytest.mark.slow
def test_every_name_is_shown_with_its_example(site):
    folders = ("python", "results")
    shown = {
        path.stem: page.text_content() for path, page in site.items() if path.parent.name in folders
    }
    names = [*NAMES, *returned.by_functions()]
    assert set(names) <= set(shown)
    assert [name for name in names if ">>> import beamchain as bc" not in shown[name]] == []


@pytest.mark.slow
def test_notebooks_show_their_outputs(site):
    pages = {path.stem: page for path, page in site.items() if path.parent.name == "notebooks"}
    for path in DOCS.parent.glob("notebooks/*.ipynb"):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        pictures = sum(
            "image/png" in o.get("data", {}) for cell in cells for o in cell.get("outputs", [])
        )
        assert len(pages[path.stem].xpath("//main//img")) >= pictures
