"""Run notebooks in place and make their pictures small:
python notebooks/execute.py [FILE.ipynb ...]; all without one."""

import base64
import io
import sys
import tempfile
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from PIL import Image

COLOURS = 24  # of a plot with two inks and their blends


def small(picture: str) -> str:
    """A base64 PNG with a palette of its own."""
    image = (
        Image.open(io.BytesIO(base64.b64decode(picture)))
        .convert("RGB")
        .quantize(COLOURS, dither=Image.Dither.NONE)
    )
    stream = io.BytesIO()
    image.save(stream, format="PNG", optimize=True)
    return base64.b64encode(stream.getvalue()).decode()


def execute(path: Path) -> None:
    """Run one notebook in an empty folder, and write it back with its outputs."""
    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        NotebookClient(notebook, timeout=600, kernel_name="python3", coalesce_streams=True).execute(
            cwd=folder
        )
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)  # times of day
        for output in cell.get("outputs", []):
            if "image/png" in output.get("data", {}):
                output["data"]["image/png"] = small(output["data"]["image/png"])
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    nbformat.write(notebook, path)


if __name__ == "__main__":
    for name in sys.argv[1:] or sorted(Path(__file__).parent.glob("*.ipynb")):
        execute(Path(name))
