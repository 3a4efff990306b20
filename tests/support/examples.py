"""The specifications that come with the package, as files."""

from functools import cache
from importlib.resources import files
from pathlib import Path

import beamchain as bc

EXAMPLES = Path(str(files("beamchain"))) / "examples"


def example(name: str) -> Path:
    """The file of one of them, by the name that `beamchain init` knows it by."""
    path = EXAMPLES / f"{name}.toml"
    assert path.is_file(), name
    return path


@cache
def shipped_arm(retime: bool | None = None) -> bc.Embedded:
    """The arm of two links on its spacecraft, embedded once for all tests that only read it."""
    at = {"shoulder": EXAMPLES / "upper.toml", "forearm": EXAMPLES / "fore.toml"}
    return bc.embed(EXAMPLES / "arm.xml", at, retime=retime)
