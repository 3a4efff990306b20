"""Every notebook runs as it stands, and what is committed is an executed, small one."""

import base64
import importlib
import json
import re
import sys
from pathlib import Path

import pytest

import beamchain
from products import PRODUCTS, is_gone

BESIDE = re.compile(r"from beamchain import (\w+)")  # packages beside the core
EVERY = sorted((Path(__file__).parent.parent / "notebooks").glob("*.ipynb"))
NOTEBOOKS = [
    path
    for path in EVERY
    if not any(map(is_gone, BESIDE.findall(path.read_text(encoding="utf-8"))))
]
LARGEST = 300_000  # bytes of a notebook
LARGEST_PICTURE = 60_000  # bytes
SECONDS = 600  # for one cell

notebooks = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_notebooks_run_with_the_package_under_test(tmp_path):
    """The kernel is this environment's: in that of the wheel the notebooks run with the wheel."""
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    cell = nbformat.v4.new_code_cell(
        "import sys, beamchain; print(beamchain.__file__); print(sys.executable)"
    )
    notebook = nbformat.v4.new_notebook(cells=[cell])
    nbclient.NotebookClient(notebook, timeout=SECONDS, kernel_name="python3").execute(
        cwd=str(tmp_path)
    )
    file, python = "".join(
        output["text"] for output in cell["outputs"] if output.get("name") == "stdout"
    ).split()
    assert file == beamchain.__file__
    assert python == sys.executable


@notebooks
@pytest.mark.slow
# what jupyter's own packages say of each other is not ours to mend
@pytest.mark.filterwarnings("ignore")
def test_notebook_runs(path, tmp_path):
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    notebook = nbformat.read(path, as_version=4)
    client = nbclient.NotebookClient(notebook, timeout=SECONDS, kernel_name="python3")
    client.execute(cwd=str(tmp_path))  # raises CellExecutionError with the cell's traceback


@notebooks
def test_notebook_is_executed_and_small(path):
    assert path.stat().st_size < LARGEST
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    for output in (output for cell in code for output in cell["outputs"]):
        assert output["output_type"] != "error"
        assert output.get("name") != "stderr"
        assert len(base64.b64decode(output.get("data", {}).get("image/png", ""))) < LARGEST_PICTURE


@notebooks
def test_every_picture_has_a_text_for_those_who_do_not_see_it(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    drawing = [
        cell
        for cell in cells
        if any("image/png" in o.get("data", {}) for o in cell.get("outputs", []))
    ]
    texts = [cell["metadata"].get("mystnb", {}).get("image", {}).get("alt", "") for cell in drawing]
    assert all(len(text.split()) > 10 for text in texts), texts
    assert len(set(texts)) == len(texts)


#: what the notebooks compare with or look into: the paper's chains, rivals, step limits;
#: every other name is public
RESEARCH = {
    f"beamchain.{name}"
    for name in (
        "chain.baselines",
        "chain.seed",
        "structure.exact",
        "steps.budget",
        "steps.large_motion",
        "studies.field",
    )
}


@notebooks
def test_notebook_uses_the_public_list_only(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    code = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    assert "import beamchain as bc" in code
    assert set(re.findall(r"from (beamchain\.[\w.]*) import", code)) <= RESEARCH
    assert set(BESIDE.findall(code)) <= set(PRODUCTS)
    assert "import beamchain." not in code
    names = set(re.findall(r"\bbc\.(\w+)", code))
    assert names
    assert names <= set(beamchain.__all__)
    for module in ("spec", "results", *PRODUCTS):
        typed = set(re.findall(rf"(?<![\w/.])(?:bc\.)?{module}\.([A-Za-z]\w*)\(", code))
        assert typed <= set(importlib.import_module(f"beamchain.{module}").__all__), module
