"""Draw the pictures of README and docs, into this folder: make docs-pictures.

The commands of gallery.md run in an empty folder, and each picture that the page shows is what they
wrote under its name, or accelerance_picture.py did. `products/NAME_picture.py` draws
`products/NAME.svg` behind the Python of `products/NAME.md`.
"""

import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from pages import pieces  # tests/support

HERE = Path(__file__).parent


def beamchain(line: str, folder: Path) -> None:
    """A command of the package, in a folder."""
    print(line, flush=True)  # noqa: T201
    words = shlex.split(line)
    done = subprocess.run(
        [sys.executable, "-m", *words], cwd=folder, check=False, stdout=subprocess.DEVNULL
    )
    if done.returncode not in (0, 3):  # 3: less came out than was asked for
        raise SystemExit(f"{line} ended with status {done.returncode}")


def run_page(page: str, folder: Path, then: str = "") -> None:
    """Files and commands of a page in a folder, and its Python where some more follows it."""
    code = ""
    for kind, content in pieces((HERE / page).read_text(encoding="utf-8")):
        if kind == "python":
            code += content
        elif kind == "command" and not then:
            beamchain(content, folder)
        elif kind != "command":
            (folder / kind).write_text(content, encoding="utf-8")
    if then:
        subprocess.run([sys.executable, "-c", code + then], cwd=folder, check=True)


def shown() -> list[str]:
    """The pictures of the gallery."""
    text = (HERE / "gallery.md").read_text(encoding="utf-8")
    return re.findall(r"!\[[^]]*\]\(([^)]+)\)", text)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        run_page("gallery.md", place)
        script = HERE / "accelerance_picture.py"
        subprocess.run([sys.executable, script], cwd=place, check=True)
        beamchain("beamchain init boom", place)
        for script in sorted((HERE / "products").glob("*_picture.py")):
            page = script.stem.removesuffix("_picture")
            run_page(f"products/{page}.md", place, script.read_text(encoding="utf-8"))
            shutil.copy(place / f"{page}.svg", script.parent)
        for picture in shown():
            (made,) = place.rglob(picture)
            shutil.copy(made, HERE / picture)
            print(f"{made.stat().st_size / 1e3:7.0f} kB  {picture}")  # noqa: T201
