"""Specifications and the spacecraft that come with the package."""

from pathlib import Path
from typing import NamedTuple

_EXAMPLES = Path(__file__).parents[1] / "examples"


class Shipped(NamedTuple):
    """A spec file of the package."""

    name: str
    path: Path
    about: str  # its first line, without the comment sign
    beside: tuple[Path, ...] = ()  # files that it names


def examples() -> list[Shipped]:
    """The shipped specifications, by name: examples, and commented ones to start from."""
    files = sorted(_EXAMPLES.glob("*.toml"))
    return [
        Shipped(p.stem, p, p.read_text(encoding="utf-8").split("\n", 1)[0].lstrip("# "))
        for p in files
    ]


_SPACECRAFT = {
    "craft": "A small spacecraft (MJCF) to embed an appendage into.",
    "arm": "A spacecraft with an arm of two links (MJCF), which upper and fore make flexible.",
    "wing_unfolds": "A spacecraft with three folded panels a side (MJCF), for panel.",
    "manipulator": "A published manipulator on a station (MJCF), for manipulator_link.",
    "two_panels": "A published satellite with two panels (MJCF), for hinged_panel.",
    "spinner": "A spinning spacecraft with four published booms (MJCF), for spin_boom.",
}


def spacecraft() -> list[Shipped]:
    """The spacecraft that `beamchain init` writes."""
    return [Shipped(name, _EXAMPLES / f"{name}.xml", about) for name, about in _SPACECRAFT.items()]


def deliveries() -> list[Shipped]:
    """Specifications of imported modes, each with the files of a finite-element program."""
    out: list[Shipped] = []
    for path in sorted(_EXAMPLES.glob("*/*.toml")):
        about = path.read_text(encoding="utf-8").split("\n", 1)[0].lstrip("# ")
        beside = sorted(p for p in path.parent.iterdir() if p.stem == path.stem and p != path)
        out.append(Shipped(path.stem, path, about, tuple(beside)))
    return out


def everything() -> list[Shipped]:
    """All that `beamchain init` writes."""
    return [*examples(), *deliveries(), *spacecraft()]


def pick(choices: list[Shipped], name: str, field: str) -> Shipped:
    """The one that is called `name`."""
    names = [one.name for one in choices]
    if name in names:
        return choices[names.index(name)]
    from beamchain.checks import unknown

    raise unknown(field, name, names)
