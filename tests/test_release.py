"""What is handed out: sdist and wheel hold everything, the wheel is what is tested,
its types hold outside.

The first tests need `dist/` beside the tests: `make wheel-test` puts it there.
"""

import hashlib
import importlib.util
import json
import os
import re
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

import beamchain as bc

ROOT = Path(__file__).parent.parent
SDIST, WHEEL = (
    next(iter((ROOT / "dist").glob(pattern)), None) for pattern in ("*.tar.gz", "*.whl")
)
PACKAGE = Path(bc.__file__).parent

# part of the names, private modules included, whose type is stated; measured 0.990
COMPLETE = 0.985

installed = "site-packages" in PACKAGE.parts
built = pytest.mark.skipif(
    not installed or SDIST is None or WHEEL is None,
    reason="no installed wheel with dist/ beside the tests: make wheel-test",
)
typed = pytest.mark.skipif(
    importlib.util.find_spec("basedpyright") is None, reason="basedpyright is not installed"
)

SCRIPT = """
from pathlib import Path
from typing import assert_type

import beamchain as bc

steel = bc.Material(youngs_modulus=2.06e11, density=7800.0)
rod = bc.Segment(length=15.0, section=bc.Round(diameter=0.012), material=steel)
beam = bc.Beam(segments=(rod,))
hub = bc.Hub(mass=500.0, inertia=(500.0, 500.0, 500.0))
fit = bc.fit(beam, modes={"xy": 2}, root=bc.spec.Root(hub=hub))
assert_type(fit, bc.Fit)
assert_type(len(fit.chain.links), int)
assert_type(fit.target["xy"], bc.PortModel)
assert_type(fit.write("boom", force=True), list[Path])
assert_type(fit.readback_error["xy"].accelerance_in_band, float | None)
assert_type(bc.stability("boom.toml").budgets[0].largest_step, dict[str, float])
assert_type(bc.embed("craft.xml", {"mount": "boom.toml"}), bc.Embedded)
assert_type(bc.read_spec("boom.toml"), bc.Spec)
"""


# -- contents --------------------------------------------------------------------------------------
def sdist_files():
    assert SDIST is not None
    with tarfile.open(SDIST) as archive:
        return {name.partition("/")[2]: name for name in archive.getnames()}


@built
def test_sdist_holds_tests_notebooks_and_what_builds():
    held = sdist_files()
    beside = [
        path.relative_to(ROOT).as_posix()
        for folder in ("tests", "notebooks")
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and not {"__pycache__", ".pytest_cache", ".hypothesis"} & set(path.parts)
    ]
    assert len(beside) > 80
    assert [name for name in beside if name not in held] == []
    for name in (
        "pyproject.toml",
        "Makefile",
        "README.md",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "CITATION.cff",
        "LICENSE",
    ):
        assert name in held
    for start in ("mjcf_templates/", "docs/", "typings/", "generator/beamchain/report/templates/"):
        assert any(name.startswith(start) for name in held), start


@built
def test_wheel_holds_all_of_the_package():
    assert WHEEL is not None
    with zipfile.ZipFile(WHEEL) as archive:
        names = set(archive.namelist())
    source = {
        n.removeprefix("generator/")
        for n in sdist_files()
        if n.startswith("generator/beamchain/") and "." in n
    }
    templates = {
        f"beamchain/{name}" for name in sdist_files() if name.startswith("mjcf_templates/")
    }
    assert len(source) > 120
    assert (source | templates) - names == set()
    assert "beamchain/py.typed" in names
    assert not [name for name in names if name.startswith(("tests", "notebooks"))]


@built
def test_what_is_tested_is_the_wheel():
    assert WHEEL is not None
    with zipfile.ZipFile(WHEEL) as archive:
        for name in archive.namelist():
            if name.startswith("beamchain/") and not name.endswith("/"):
                mine = (PACKAGE.parent / name).read_bytes()
                assert (
                    hashlib.sha256(mine).digest() == hashlib.sha256(archive.read(name)).digest()
                ), name


@built
def test_sdist_builds_without_a_network(tmp_path):
    pytest.importorskip("hatchling", reason="hatchling is not installed")
    words = [
        "wheel",
        "--no-index",
        "--no-build-isolation",
        "--no-deps",
        "--quiet",
        "--wheel-dir",
        str(tmp_path),
    ]
    done = subprocess.run(
        [sys.executable, "-m", "pip", *words, str(SDIST)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert WHEEL is not None
    assert [path.name for path in tmp_path.iterdir()] == [WHEEL.name]


@built
def test_a_package_index_accepts_both():
    pytest.importorskip("twine", reason="twine is not installed")
    words = [sys.executable, "-m", "twine", "check", "--strict", str(SDIST), str(WHEEL)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


# -- files that are read elsewhere -----------------------------------------------------------------
checkout = pytest.mark.skipif(not (ROOT / ".github").is_dir(), reason="not a checkout")


@checkout
def test_workflow_names_targets_and_versions_there_are():
    text = (ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M))
    asked = re.findall(r"run: make ([a-z-]+)", text)
    assert {"lint", "tests", "wheel-test", "docs"} == set(asked) <= targets
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    stated = set(re.findall(r"Python :: (3\.\d+)", project))
    assert stated <= set(re.findall(r'"(3\.\d+)"', text))


@checkout
def test_one_version_is_stated_everywhere():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "version"
    ]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").split("## ")[1].split()[0] == version


# -- types -----------------------------------------------------------------------------------------
def pyright(folder, *arguments):
    """What the type checker says in a folder that knows of nothing but this environment."""
    environment = {
        **os.environ,
        "VIRTUAL_ENV": sys.prefix,
        "PATH": f"{sys.prefix}/bin:{os.environ['PATH']}",
    }
    return subprocess.run(
        [sys.executable, "-m", "basedpyright", "--outputjson", *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    ).stdout


def errors(folder, script):
    (folder / "script.py").write_text(script)
    (folder / "pyrightconfig.json").write_text('{"typeCheckingMode": "standard"}')
    told = json.loads(pyright(folder, "--pythonpath", sys.executable, "script.py"))
    return [item["rule"] for item in told["generalDiagnostics"] if item["severity"] == "error"]


@typed
@pytest.mark.slow
def test_types_are_seen_from_outside(tmp_path):
    assert errors(tmp_path, SCRIPT) == []


@typed
@pytest.mark.slow
@pytest.mark.parametrize(
    ("mistake", "rule"),
    [
        ("fit.write(3)", "reportArgumentType"),
        ("fit.chain.lenght", "reportAttributeAccessIssue"),
        ("bc.Hub(mass=1.0)", "reportCallIssue"),
        ("bc.fitt", "reportAttributeAccessIssue"),
    ],
)
def test_mistakes_are_seen_from_outside(mistake, rule, tmp_path):
    assert errors(tmp_path, f"{SCRIPT}\nprint({mistake})\n") == [rule]


@built
@typed
@pytest.mark.slow
def test_nothing_in_the_package_has_an_unknown_type(tmp_path):
    """Types of other packages aside; what is left are a few variables without an annotation."""
    told = json.loads(pyright(tmp_path, "--verifytypes", "beamchain", "--ignoreexternal"))[
        "typeCompleteness"
    ]
    counts = told["exportedSymbolCounts"]
    assert counts["withKnownType"] > 2000
    unknown = [
        s["name"]
        for s in told["symbols"]
        if s["isExported"] and not s["isTypeKnown"] and not s["isTypeAmbiguous"]
    ]
    # a plant is a control.StateSpace, which has no types: its metaclass is unknown,
    # and so is what takes or gives a plant
    products = r"\.(control|robust|pointing)\."
    takes_plants = re.compile(rf"plant|Plant|StateSpace|scheduled|{products}|^beamchain\.margins$")
    assert [name for name in unknown if not takes_plants.search(name)] == []
    assert told["completenessScore"] > COMPLETE
    public = {f"{getattr(getattr(bc, n), '__module__', '')}.{n}" for n in bc.__all__}
    unclear = [s["name"] for s in told["symbols"] if s["name"] in public and not s["isTypeKnown"]]
    plants = (".plant", ".Plant", ".ScheduledPlant", ".verdicts.margins")
    assert [name for name in unclear if not name.endswith(plants)] == []
