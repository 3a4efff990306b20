"""Specs that come with the package: examples to run, and commented ones to start from."""

import difflib
from pathlib import Path
from typing import NamedTuple

from beamchain.errors import InputError

_HERE = Path(__file__).parents[1]


class Shipped(NamedTuple):
    """A spec file of the package."""

    name: str
    path: Path
    about: str  # its first line, without the comment sign


def examples() -> list[Shipped]:
    """The shipped examples, by name."""
    return _of("examples")


def starts() -> list[Shipped]:
    """The commented specs that `beamchain init` writes, by name."""
    return _of("starts")


def spacecraft() -> Shipped:
    """The small spacecraft that `beamchain init craft` writes."""
    return Shipped("craft", _HERE / "starts" / "craft.xml", "A small spacecraft (MJCF) to embed an appendage into.")


def pick(choices: list[Shipped], name: str, field: str) -> Shipped:
    """The one that is called `name`."""
    names = [one.name for one in choices]
    if name in names:
        return choices[names.index(name)]
    near = difflib.get_close_matches(name, names, n=1)
    guess = f"did you mean {near[0]!r}? Choose" if near else "choose"
    raise InputError(f"{field} {name!r} is not known; {guess} from {', '.join(names)}.")


def _of(folder: str) -> list[Shipped]:
    out: list[Shipped] = []
    for path in sorted((_HERE / folder).glob("*.toml")):
        first = path.read_text(encoding="utf-8").split("\n", 1)[0]
        out.append(Shipped(path.stem, path, first.lstrip("# ")))
    return out
