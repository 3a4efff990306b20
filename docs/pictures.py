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


def slew() -> None:
    """The array on its satellite, turning; where MuJoCo cannot draw, the old picture stays."""
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["render", str(PATHS["array_scene"]), "-o", folder, "--width", "480", "--height", "280"]
        arguments += ["--quiet", "--no-mp4"]
        subprocess.run([sys.executable, "-m", "beamchain", *arguments], check=True)
        shutil.copy(Path(folder) / "array.gif", HERE / "slew.gif")


if __name__ == "__main__":
    from_fit()
    slew()
