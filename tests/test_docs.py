"""What README, the pages and docstrings say is true: snippets and commands run,
every public argument is told."""

import contextlib
import inspect
import io
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import beamchain as bc
import returned
from command import app, main
from pages import pieces
from products import GONE, is_gone

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
HOWTO = sorted((ROOT / "docs" / "howto").glob("*.md"))
PRODUCTS = [
    page for page in sorted((ROOT / "docs" / "products").glob("*.md")) if not is_gone(page.stem)
]
PAGES = [README, *sorted((ROOT / "docs").glob("*.md")), *HOWTO, *PRODUCTS]
# these pages begin in an empty folder
EMPTY = [*(ROOT / "docs" / f"{name}.md" for name in ("start", "control", "gallery")), *HOWTO]
# sections whose `py` block needs another package: page, title, what must import
HOSTS = {
    "basilisk": ("simulators", "Basilisk", "Basilisk.simulation.mujoco"),
    "cluster": ("variants", "On a cluster", "distributed"),
    "dm_control": ("simulators", "dm_control", "dm_control.mjcf"),
    "mjx": ("simulators", "MJX", "mujoco.mjx"),
    "newton": ("simulators", "Newton", "newton"),
    "sections": ("array", "Section of any profile", "sectionproperties.analysis"),
    "warp": ("simulators", "MuJoCo Warp", "mujoco_warp"),
}
QUICKER = {
    "--samples 1000": "--samples 8",
    "beamchain study": "beamchain study --budget 0.002",
}  # minutes
LARGEST, FIRST, ALL = 1_000_000, 1_500_000, 8_000_000  # bytes: a picture, README's, all of them
DONE = (0, 3)  # exit: done; done but less came out than was asked for

PUBLIC = returned.public()
COMMANDS = {command.name for command in app.registered_commands}

readme = pytest.mark.skipif(
    not README.is_file(), reason="README is not beside the tests (an installed wheel)"
)


@readme
def test_pictures_are_small_enough_to_load():
    pictures = [path for end in ("gif", "png", "svg") for path in (ROOT / "docs").glob(f"*.{end}")]
    assert pictures
    sizes = {path.name: path.stat().st_size for path in pictures}
    first = re.search(r"!\[[^]]*\]\(docs/([^)]+)\)", README.read_text(encoding="utf-8"))
    assert first
    assert sizes[first[1]] <= FIRST
    assert {name: size for name, size in sizes.items() if size > LARGEST and name != first[1]} == {}
    assert sum(sizes.values()) <= ALL


# -- README ----------------------------------------------------------------------------------------
def starting_files():
    """What README's commands may take for granted beside them: the shipped specs,
    and a spacecraft to embed into."""
    for kind in ("boom", "array", "mast"):
        run_command(f"beamchain init {kind} --force")
    examples = Path(bc.__file__).parent / "examples"
    Path("generator/beamchain").mkdir(parents=True)
    Path("generator/beamchain/examples").symlink_to(examples)
    Path("tests").mkdir()
    Path("tests/crafts").symlink_to(ROOT / "tests" / "crafts")
    craft = """<mujoco model="craft"><option gravity="0 0 0"/><worldbody><body name="bus">
    <freejoint/>
    <inertial pos="0 0 0" mass="300" diaginertia="100 120 150"/>
    <geom type="box" size=".5 .5 .5" mass="0"/>
    <site name="mount" pos="0.5 0 0"/><site name="left" pos="0 0.5 0" xyaxes="0 1 0 -1 0 0"/>
    </body></worldbody></mujoco>"""
    Path("craft.xml").write_text(craft)


def run_command(line):
    """Exit status of a command line, in this process."""
    before, sys.argv = sys.argv, shlex.split(line)
    try:
        main()
    except SystemExit as stopped:
        return int(stopped.code or 0)
    finally:
        sys.argv = before
    return 0


def draws_with(name):
    """Whether MuJoCo has a driver of this name to draw with, asked in a process of its own,
    which a missing one may end."""
    done = subprocess.run(
        [sys.executable, "-c", "import mujoco; mujoco.GLContext(8, 8)"],
        env={**os.environ, "MUJOCO_GL": name},
        capture_output=True,
        check=False,
    )
    return done.returncode == 0


def named(page):
    return page.relative_to(ROOT).with_suffix("").as_posix()


@readme
@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=named)
def test_everything_on_the_page_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    if page not in EMPTY:
        starting_files()
    run(page.read_text(encoding="utf-8"), page.name)


@readme
@pytest.mark.slow
@pytest.mark.host
@pytest.mark.filterwarnings("ignore")  # other simulators warn of their own future
@pytest.mark.parametrize("host", HOSTS)
def test_a_section_runs_in_its_host(host, tmp_path, monkeypatch):
    """What stands before the first section, then the section with its `py` block."""
    page, title, module = HOSTS[host]
    pytest.importorskip(module, reason=f"{host} is not installed: make hosts HOSTS={host}")
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "howto" / f"{page}.md").read_text(encoding="utf-8")
    opening, *sections = re.split(r"^## ", text, flags=re.M)
    (section,) = (one for one in sections if one.startswith(f"{title}\n"))
    assert "```py\n" in section
    run(opening + section.replace("```py\n", "```python\n"), page)


def run(text, name):
    """Blocks and commands of a text, in the folder where one is."""
    names: dict[str, object] = {"__name__": "__main__"}
    draws = any(map(draws_with, ("egl", "osmesa")))
    for kind, content in pieces(text):
        if kind == "python":
            with contextlib.redirect_stdout(io.StringIO()):
                exec(compile(content, name, "exec"), names)
            continue
        if kind != "command":
            Path(kind).write_text(content, encoding="utf-8")
            continue
        for long, short in QUICKER.items():
            content = content.replace(long, short)
        words = shlex.split(content)
        if words[1] == "render" and not draws:
            continue
        if words[1] == "init":  # the files taken for granted are what this line makes
            for kind in ("toml", "xml"):
                Path(f"{words[2]}.{kind}").unlink(missing_ok=True)
        done = subprocess.run(
            [sys.executable, "-m", *words],
            capture_output=True,
            text=True,
            check=False,
            stdin=subprocess.DEVNULL,
        )
        assert done.returncode in DONE, f"{content}\n{done.stderr}"


@readme
def test_readme_has_examples():
    kinds = [kind for kind, _ in pieces(README.read_text(encoding="utf-8"))]
    assert "python" in kinds
    assert "command" in kinds


def went_with_a_product(target):
    """Whether a link leads to the page or a notebook of a product that was taken out."""
    page = re.search(r"products/(\w+)\.\w+$", target)
    return is_gone(page[1]) if page else bool(GONE) and "notebooks/" in target


@readme
@pytest.mark.parametrize("page", PAGES, ids=named)
def test_links_lead_somewhere(page):
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.S | re.M)
    for target in re.findall(r"\]\(([^)#]+)\)", text):
        # generated: tests/test_site.py
        if not target.startswith(("http:", "https:", "reference/", "../reference/")):
            assert (page.parent / target).exists() or went_with_a_product(target), target


@readme
@pytest.mark.parametrize("page", PAGES, ids=named)
def test_commands_that_the_page_names_exist(page):
    for kind, content in pieces(page.read_text(encoding="utf-8")):
        if kind == "command":
            word = content.split()[1]
            assert word in COMMANDS or is_gone(word) or word.startswith("-"), content


# -- help ------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "command",
    [c for c in app.registered_commands if not c.hidden],
    ids=lambda command: command.name,
)
def test_examples_in_help_use_options_there_are(command, capsys, monkeypatch):
    lines = re.findall(r"^Example: (beamchain .*)$", inspect.getdoc(command.callback) or "", re.M)
    assert lines, command.name
    monkeypatch.setenv("COLUMNS", "200")
    assert run_command(f"beamchain {command.name} --help") == 0
    known = set(
        re.findall(
            r"(?<![\w-])(--?[a-z][\w-]*)", re.sub(r"Example:.*", "", capsys.readouterr().out)
        )
    )
    for line in lines:
        words = shlex.split(line.split(" > ")[0])
        assert words[1] == command.name
        assert {word.split("=")[0] for word in words[2:] if word.startswith("-")} <= known, line


# -- docstrings ------------------------------------------------------------------------------------
def told(text, name):
    """Whether an argument is documented: an entry of its own,
    or named in the text as code or by its word."""
    return re.search(rf"\b{re.escape(name)}\b", text) is not None


def arguments(thing):
    try:
        signature = inspect.signature(thing)
    except (TypeError, ValueError):
        return []
    return [
        name
        for name in signature.parameters
        if name not in ("self", "cls") and not name.startswith("_")
    ]


@pytest.mark.parametrize("name", list(PUBLIC))
def test_public_names_are_documented_with_every_argument(name):
    thing = PUBLIC[name]
    text = inspect.getdoc(thing) or ""
    assert len(text.split()) >= 4, name
    missing = [argument for argument in arguments(thing) if not told(text, argument)]
    assert missing == []


CLASSES = {
    name: thing for name, thing in PUBLIC.items() if inspect.isclass(thing)
} | returned.by_functions()
METHODS = [
    (name, member)
    for name, thing in CLASSES.items()
    for member, value in vars(thing).items()
    if not member.startswith("_")
    and (inspect.isfunction(value) or isinstance(value, (classmethod, property)))
]


@pytest.mark.parametrize(("name", "member"), METHODS)
def test_methods_are_documented_with_every_argument(name, member):
    thing = getattr(CLASSES[name], member)
    text = inspect.getdoc(thing) or ""
    assert text, f"{name}.{member}"
    if not isinstance(thing, property):
        missing = [argument for argument in arguments(thing) if not told(text, argument)]
        assert missing == []


@pytest.mark.parametrize(
    "name", ["Round", "Tube", "Rectangle", "Box", "Custom", "Equivalent", "Material", "Hub", "Lump"]
)
def test_dimensions_have_their_units(name):
    text = inspect.getdoc(getattr(bc, name)) or ""
    assert re.search(r"\[(m|m\^2|m\^4|kg|kg m\^2|N m\^2|N/m\^2|Pa|kg/m\^3)\]", text), text


@pytest.mark.skipif(not (ROOT / "docs").is_dir(), reason="docs are not beside the tests")
def test_pages_and_sections_that_docstrings_cite_exist():
    source = "".join(
        path.read_text(encoding="utf-8") for path in Path(bc.__file__).parent.rglob("*.py")
    )
    cited = re.findall(r"(docs/\w+\.md)(?:, sections? (\d+)(?: and (\d+))?)?", source)
    assert len(cited) > 20
    for page, *sections in cited:
        text = (ROOT / page).read_text(encoding="utf-8")
        assert all(f"\n## {number}. " in text for number in sections if number), (page, sections)


# -- files beside the package ----------------------------------------------------------------------
@pytest.mark.skipif(
    not (ROOT / "CITATION.cff").is_file(), reason="CITATION.cff is not beside the tests"
)
def test_citation_is_of_this_version():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"version: {bc.__version__}\n" in text
    assert "Belonozhko" in text


@pytest.mark.skipif(not (ROOT / "docs").is_dir(), reason="docs are not beside the tests")
def test_words_of_the_symbol_table_are_in_the_code():
    text = (ROOT / "docs" / "theory.md").read_text(encoding="utf-8").split("\n## Symbols\n")[1]
    source = "".join(
        path.read_text(encoding="utf-8") for path in Path(bc.__file__).parent.rglob("*.py")
    )
    words = [
        w
        for row in re.findall(r"^\|[^|]*\|([^|]*)\|", text, re.M)
        for w in re.findall(r"`(\w+)`", row)
    ]
    assert len(words) > 15
    assert [word for word in words if word not in source] == []


def test_a_broken_readme_would_be_seen(tmp_path, monkeypatch):
    """The other way round: wrong commands and snippets fail."""
    monkeypatch.chdir(tmp_path)
    assert run_command("beamchain fit nothing.toml -o out") not in DONE
    found = pieces(
        "a\n\n    beamchain init   # told\n\n```python\nx = 1\n```\n```toml\nbeamchain = 3\n```\n"
    )
    assert found == [("command", "beamchain init"), ("python", "x = 1\n")]
    assert not os.listdir(tmp_path)


@readme
def test_what_remove_gives_back_is_said_alike():
    told = [README, *(ROOT / "docs").glob("*.md"), *(ROOT / "notebooks").glob("*.ipynb")]
    for page in told:
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"gives the\s+original back,?\s+byte", text), page.name
