"""The first minute: make demo. Fits the example boom, gives the shipped satellite two arrays that
bend, and films it where MuJoCo can draw; says every command that it runs."""

import shlex
import subprocess
import sys
from pathlib import Path

from beamchain.cli.shipped import everything
from beamchain.engine import backend
from beamchain.errors import EngineError

SHIPPED = {one.path.name: one.path for one in everything()}


def run(*words: str | Path) -> None:
    """A command of the package, said first; what it prints but the files is left out."""
    line = [str(word) for word in words]
    print(f"$ beamchain {shlex.join(line)}", flush=True)  # noqa: T201
    subprocess.run(
        [sys.executable, "-m", "beamchain", *line, "--force"], check=True, stdout=subprocess.DEVNULL
    )


def demo(folder: Path) -> list[Path]:
    """The files worth opening first, all in `folder`."""
    run("fit", SHIPPED["seed_boom.toml"], "-o", folder)
    flexible = folder / "satellite.xml"
    array = SHIPPED["array.toml"]
    places = ["--mount", f"left={array}", "--mount", f"right={array}"]
    run("embed", SHIPPED["craft.xml"], *places, "-o", flexible)
    made = [folder / "report.html", folder / "satellite_report.html", flexible]
    try:
        backend.choose_renderer()
    except EngineError as error:
        print(f"There is no picture of it: {error}")  # noqa: T201
        return made
    run("render", flexible, "-o", folder, "--angle", "20")
    return [flexible.with_suffix(".gif"), *made]


if __name__ == "__main__":
    for path in demo(Path(sys.argv[1])):
        print(path)  # noqa: T201
