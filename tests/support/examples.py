"""The specifications that come with the package, as files."""

from importlib.resources import files
from pathlib import Path

EXAMPLES = Path(str(files("beamchain"))) / "examples"


def example(name: str) -> Path:
    """The file of one of them, by the name that `beamchain init` knows it by."""
    path = EXAMPLES / f"{name}.toml"
    assert path.is_file(), name
    return path
