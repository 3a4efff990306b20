"""Bounds on what an MJCF document declares by number, and on the files it leads to.

A line of text may ask for a million bodies or gigabytes of memory, and MuJoCo ends the
process where a model attaches itself. The bounds lie far above any spacecraft; at each of
them MuJoCo takes seconds.
"""

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from lxml import etree
from lxml.etree import _Element as Element

from beamchain.errors import InputError
from beamchain.mjcf.craft import check_text

# of all that `<replicate>` multiplies: MuJoCo takes the square of it, 3 s for 2000
MOST_COPIES = 2000
MOST_ELEMENTS = 200_000  # with everything that is replicated and attached
MOST_POINTS = 2000  # of all soft bodies (`<flexcomp>`, `<composite>`)
MOST_HEIGHTS = 10_000_000  # of all height fields
MOST_PIXELS = 30_000_000  # of all textures that MuJoCo draws
MOST_FILES = 1000  # included and attached
MOST_MEMORY = 1_000_000_000  # bytes for `<size memory>`
DEEPEST_FILES = 50  # files that include or attach one another

#: Largest number of an attribute, by tag; "*" for any tag.
LARGEST: Mapping[tuple[str, str], float] = {
    ("size", "nkey"): 5000,
    ("size", "nuserdata"): 1_000_000,
    ("size", "nconmax"): 100_000,
    ("size", "njmax"): 100_000,
    ("size", "nstack"): 100_000_000,
    ("numeric", "size"): 1_000_000,
    ("user", "dim"): 100_000,
    ("*", "actdim"): 1000,
    ("*", "nsample"): 100_000,
} | {
    ("size", f"nuser_{kind}"): 1000
    for kind in ("body", "jnt", "geom", "site", "cam", "tendon", "actuator", "sensor")
}

#: How many bytes the letter behind a memory stands for.
UNITS = {"K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40, "P": 2**50, "E": 2**60}


@dataclass
class _Totals:
    """What a document and the files it leads to ask for."""

    elements: float = 0.0
    copies: float = 0.0
    points: float = 0.0
    heights: float = 0.0
    pixels: float = 0.0

    def add(self, other: "_Totals", times: float) -> None:
        """Add what another file asks for, several times over."""
        self.elements += times * other.elements
        self.copies += times * other.copies
        self.points += times * other.points
        self.heights += other.heights
        self.pixels += other.pixels


def check_sizes(content: bytes, folder: Path, what: str) -> None:
    """Refuse a document that asks for more than the bounds of this module,
    or includes or attaches itself.

    Args:
        content: of the main file.
        folder: where its relative paths start.
        what: how messages call it.

    Raises:
        InputError: a number is out of bounds, or files lead to themselves.
    """
    check_text(content, what)
    walk = _Walk(folder, what)
    root = _root(content)
    totals = _Totals() if root is None else walk.totals(root, folder, ())
    for name, value, most in (
        ("copies by <replicate>", totals.copies, MOST_COPIES),
        ("points of soft bodies (<flexcomp>, <composite>)", totals.points, MOST_POINTS),
        ("cells of height fields", totals.heights, MOST_HEIGHTS),
        ("pixels of textures", totals.pixels, MOST_PIXELS),
        ("elements, replicated and attached ones counted", totals.elements, MOST_ELEMENTS),
    ):
        if value > most:
            raise InputError(
                f"{what} asks for {value:.7g} {name}; at most {most} are taken: ask for fewer."
            )


def _root(content: bytes) -> Element | None:
    """The root element of what can be read; MuJoCo says what is wrong with a
    document that is no XML."""
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, huge_tree=True, recover=True
    )
    try:
        return etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError):
        return None


class _Walk:
    """Follows a document into the files that it includes and attaches."""

    def __init__(self, home: Path, what: str) -> None:
        self.home = home
        self.what = what
        self.known: dict[Path, _Totals] = {}

    def totals(self, root: Element, folder: Path, chain: tuple[Path, ...]) -> _Totals:
        """What the document below `root` asks for; `chain`: the files that lead to it."""
        models: dict[str, _Totals | None] = {}
        for node in root.iter("model"):
            if node.get("file"):
                name = str(node.get("name") or node.get("file"))
                models[name] = self._file(node, folder, chain)
        out = _Totals()
        pending = [(root, 1.0)]
        while pending:
            node, times = pending.pop()
            if not isinstance(node.tag, str):
                continue  # a comment
            self._check_numbers(node)
            out.elements += times
            if node.tag == "replicate":
                times *= max(self._number(node, "count"), 1.0)
                out.copies += times
            elif node.tag in ("flexcomp", "composite"):
                out.points += times * self._product(node, "count")
            elif node.tag == "hfield":
                out.heights += self._number(node, "nrow") * self._number(node, "ncol")
            elif node.tag == "texture":
                width = self._number(node, "width")
                height = self._number(node, "height")
                out.pixels += width * (height or 6.0 * width)
            elif node.tag == "attach":
                attached = models.get(str(node.get("model")))
                if attached is not None:
                    out.add(attached, times)
            elif node.tag == "include":
                included = self._file(node, folder, chain)
                if included is not None:
                    out.add(included, times)
            pending += [(child, times) for child in node]
        return out

    def _file(self, node: Element, folder: Path, chain: tuple[Path, ...]) -> _Totals | None:
        """What a file asks for that an element names; None where there is no such file,
        which MuJoCo then says."""
        name = node.get("file") or ""
        verb = "includes" if node.tag == "include" else "attaches"
        folders = (self.home.absolute(), folder.absolute())
        places = (Path(os.path.normpath(start / name)) for start in folders)
        path = next((place for place in places if place.is_file()), None)
        if path is None or path.suffix.lower() == ".urdf":
            return None
        path = path.resolve()
        if path in chain or len(chain) >= DEEPEST_FILES:
            ring = " -> ".join(place.name for place in (*chain[-4:], path))
            raise InputError(
                f"{self.what} {verb} {path.name!r} in a cycle or more than {DEEPEST_FILES} files "
                f"deep ({ring}); take that line out."
            )
        if path not in self.known:
            if len(self.known) >= MOST_FILES:
                raise InputError(
                    f"{self.what} leads to more than the {MOST_FILES} files taken; join some of "
                    "them."
                )
            label = f"{self.what}: file {str(path)!r}"
            try:
                content = path.read_bytes()
            except OSError as error:
                raise InputError(
                    f"{label} cannot be read ({error.strerror}); check its permissions."
                ) from None
            check_text(content, label)
            root = _root(content)
            self.known[path] = (
                _Totals() if root is None else self.totals(root, path.parent, (*chain, path))
            )
        return self.known[path]

    def _check_numbers(self, node: Element) -> None:
        """Refuse a number that alone is too large."""
        for word in node.attrib:
            most = LARGEST.get((str(node.tag), str(word)), LARGEST.get(("*", str(word))))
            if most is not None and self._number(node, str(word)) > most:
                raise InputError(
                    f"{self.what}: <{node.tag} {word}={str(node.get(word))!r:.40}> is more than "
                    f"the {most:g} taken; write a smaller {word}."
                )
        if node.tag == "size" and self._memory(node) > MOST_MEMORY:
            raise InputError(
                f"{self.what}: <size memory={str(node.get('memory'))!r:.40}> is more than the "
                f"{MOST_MEMORY} bytes taken; leave memory out, and MuJoCo chooses it."
            )

    @staticmethod
    def _memory(node: Element) -> float:
        """Bytes that `<size memory>` asks for; 0 where it says nothing that can be read."""
        word = (node.get("memory") or "0").strip().upper()
        unit = UNITS.get(word[-1:], 1)
        return max(_real(word.rstrip("".join(UNITS))), 0.0) * unit

    @staticmethod
    def _number(node: Element, word: str) -> float:
        """A number of an element; 0 where it is none, which MuJoCo then says."""
        return max(_real(node.get(word) or "0"), 0.0)

    @staticmethod
    def _product(node: Element, word: str) -> float:
        """The product of the numbers of an attribute."""
        numbers = (node.get(word) or "1").split()[:3]
        return math.prod(max(_real(number), 1.0) for number in numbers)


def _real(word: str) -> float:
    """A number; 0 where the word is none."""
    try:
        value = float(word)
    except ValueError:
        return 0.0
    return 0.0 if math.isnan(value) else value
