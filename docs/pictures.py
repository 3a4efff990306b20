"""Draw the pictures that README shows, into this folder: make docs-pictures."""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import beamchain as bc
from beamchain.cli.shipped import examples

HERE = Path(__file__).parent
PATHS = {one.name: one.path for one in examples()}


def from_fit() -> None:
    """The boom's accelerance and its chain, as `beamchain fit` draws them."""
    with tempfile.TemporaryDirectory() as folder:
        bc.fit(bc.read_spec(PATHS["seed_boom"])).write(folder)
        shutil.copy(Path(folder) / "accelerance_xy.svg", HERE / "accelerance.svg")
        shutil.copy(Path(folder) / "chain.svg", HERE / "chain.svg")


def run(*words: str) -> None:
    """A command of the package; 3: written, but slower than wanted (modes at the file's step)."""
    command = [sys.executable, "-m", "beamchain", *words, "--quiet"]
    status = subprocess.run(command, check=False).returncode
    if status not in (0, 3):
        raise SystemExit(f"{' '.join(command)} ended with status {status}")


def rendered() -> None:
    """The array on its satellite, turning; a mode of a satellite with two arrays;
    the mast with its instrument."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        size = ["--width", "432", "--height", "243", "--no-mp4"]
        run(
            "render",
            str(PATHS["array_scene"]),
            "-o",
            name,
            "--width",
            "328",
            "--height",
            "185",
            "--no-mp4",
        )
        shutil.copy(folder / "array.gif", HERE / "slew.gif")
        array = PATHS["array"]
        craft = PATHS["array"].parent / "satellite.xml"
        places = ["--at", f"left={array}", "--at", f"right={array}"]
        run("embed", str(craft), *places, "-o", str(folder / "satellite.xml"))
        run("render", str(folder / "satellite.xml"), "-o", name, "--modes", "2", *size)
        shutil.copy(folder / "satellite_mode2.gif", HERE / "mode.gif")
        run(
            "render",
            str(PATHS["instrument_mast"]),
            "-o",
            name,
            "--width",
            "720",
            "--height",
            "405",
            "--no-mp4",
        )
        shutil.copy(folder / "mast.png", HERE / "mast.png")


if __name__ == "__main__":
    from_fit()
    rendered()
