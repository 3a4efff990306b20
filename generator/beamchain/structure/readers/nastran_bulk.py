"""Nastran's bulk data as superelements are delivered with it (.asm, .pch): grids, coordinate
systems, scalar points, the order of the freedoms, and matrices (DMIG)."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.structure.readers import safe_reading
from beamchain.structure.readers.nastran_op4 import DIGITS, SINGLE, Matrix, fortran_number

SMALLER = "deliver the matrices by OUTPUT4"
NO_TEXT = "give the assembly (.asm) or punch (.pch) file"
MOST_POINTS = safe_reading.LONGEST
MOST_FIELDS = 20_000  # of one card; a column of a full matrix has three per row
CARDS = frozenset(
    ("GRID", "CORD2R", "CORD2C", "CORD2S", "CORD1R", "CORD1C", "CORD1S", "SPOINT", "EXTRN", "DMIG")
)
PRINTED = 5e-10  # relative: D16.9 prints ten digits
SYMMETRIC = 6  # form of a DMIG that holds one triangle
COMPLEX = (3, 4)
DIRECTIONS = "123456"
TOGETHER = 1e-9  # relative length below which three points of a coordinate system lie on a line

Freedom = tuple[int, int]  # grid or scalar point, component (1 to 6; 0 of a scalar point)


@dataclass(frozen=True)
class Card:
    """A bulk data entry: its name and its fields, without those of the names."""

    name: str
    fields: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class System:
    """A coordinate system: `origin` `(3,)`, `axes` `(3, 3)` rows, in basic axes."""

    kind: str
    origin: Array
    axes: Array

    def place(self, given: Array) -> Array:
        """`(3,)` a point in basic axes; angles are in degrees."""
        a, b, c = given
        if self.kind == "C":
            given = np.array([a * np.cos(np.radians(b)), a * np.sin(np.radians(b)), c])
        elif self.kind == "S":
            polar, around = np.radians([b, c])
            ring = a * np.sin(polar)
            given = np.array([ring * np.cos(around), ring * np.sin(around), a * np.cos(polar)])
        return self.origin + self.axes.T @ given

    def axes_at(self, point: Array) -> Array:
        """`(3, 3)` rows: the directions of the components at a point, in basic axes."""
        if self.kind == "R":
            return self.axes
        x, y, z = self.axes @ (point - self.origin)
        around = np.arctan2(y, x)
        radial = np.array([np.cos(around), np.sin(around), 0.0])
        tangent = np.array([-np.sin(around), np.cos(around), 0.0])
        up = np.array([0.0, 0.0, 1.0])
        if self.kind == "C":
            return np.vstack([radial, tangent, up]) @ self.axes
        polar = np.arctan2(np.hypot(x, y), z)
        outwards = np.sin(polar) * radial + np.cos(polar) * up
        down = np.cos(polar) * radial - np.sin(polar) * up
        return np.vstack([outwards, down, tangent]) @ self.axes


BASIC = System("R", np.zeros(3), np.eye(3))


@dataclass(frozen=True, eq=False)
class GridPoint:
    """Where a grid is `(3,)` and the directions of its components `(3, 3)` rows, in basic axes."""

    at: Array
    axes: Array


@dataclass(eq=False)
class Bulk:
    """What a file of bulk data holds.

    Args:
        grids: by number.
        scalars: scalar points, ascending.
        connected: exterior freedoms in their order, as EXTRN lists them; empty without one.
        cards: of DMIG, by the name of the matrix.
    """

    grids: dict[int, GridPoint]
    scalars: tuple[int, ...] = ()
    connected: tuple[Freedom, ...] = ()
    dmig: dict[str, list[Card]] = field(default_factory=dict[str, list[Card]])

    def freedoms(self) -> tuple[Freedom, ...]:
        """Freedoms of a superelement's matrices: as EXTRN lists them and then scalar points, or
        all by ascending number."""
        if self.connected:
            listed = {point for point, _ in self.connected}
            further = [(point, 0) for point in self.scalars if point not in listed]
            return (*self.connected, *further)
        points = sorted({*self.grids, *self.scalars})
        return tuple(
            (point, component)
            for point in points
            for component in (range(1, 7) if point in self.grids else (0,))
        )


# -- cards -----------------------------------------------------------------------------------------
def _cards(path: Path) -> Iterator[Card]:
    """The cards that are understood here, with their continuations."""
    name = ""
    fields: list[str] = []
    for raw in safe_reading.lines(path, smaller=SMALLER, no_text=NO_TEXT):
        line = raw.split("$")[0].rstrip().expandtabs(8)
        if not line:
            continue
        if line[0] in " +*,":
            if name:
                fields += _fields(line)[1]
                if len(fields) > MOST_FIELDS:
                    raise ValueError(f"a card {name} has more than {MOST_FIELDS} fields")
            continue
        if name:
            yield Card(name, tuple(fields))
        first, fields = _fields(line)
        name = first.strip().upper()
        if name not in CARDS:
            name, fields = "", []
    if name:
        yield Card(name, tuple(fields))


def _fields(line: str) -> tuple[str, list[str]]:
    """The name of a line, or its continuation mark, and its fields: free, of 16 or of 8
    characters."""
    if "," in line:
        pieces = [piece.strip() for piece in line.split(",")]
        pieces += [""] * (9 - len(pieces))
        return pieces[0].rstrip("*"), pieces[1:9]
    first = line[:8].strip()
    width, count = (16, 4) if "*" in first else (8, 8)
    body = line[8 : 8 + width * count].ljust(width * count)
    pieces = [body[k * width : (k + 1) * width].strip() for k in range(count)]
    return first.rstrip("*"), pieces


def _whole(card: Card, place: int, default: int | None = None) -> int:
    text = card.fields[place] if place < len(card.fields) else ""
    if not text and default is not None:
        return default
    if not (text.isascii() and text.lstrip("+-").isdigit() and len(text) < 12):
        raise ValueError(f"a card {card.name} has {text!r:.20} where a whole number stands")
    return int(text)


def _real(card: Card, place: int) -> float:
    text = card.fields[place] if place < len(card.fields) else ""
    if not text:
        return 0.0
    if not DIGITS.issuperset(text):
        raise ValueError(f"a card {card.name} has {text!r:.20} where a number stands")
    return fortran_number(text)


def _numbers(card: Card, begin: int) -> list[int]:
    """Whole numbers with THRU, as SPOINT lists them."""
    words = [word for word in card.fields[begin:] if word]
    out: list[int] = []
    at = 0
    while at < len(words):
        if words[at].upper() == "THRU":
            low, high = out[-1] if out else 0, _whole(Card(card.name, tuple(words)), at + 1)
            if not 0 < low < high or high - low > MOST_POINTS:
                raise ValueError(f"a card {card.name} goes from {low} to {high}")
            out += range(low + 1, high + 1)
            at += 2
        else:
            out.append(_whole(Card(card.name, tuple(words)), at))
            at += 1
    return out


# -- what they say ---------------------------------------------------------------------------------
def read_bulk(path: Path) -> Bulk:
    """Grids, coordinate systems, scalar points and matrices of a file of bulk data.

    Raises:
        InputError: the file is no bulk data, or a card of it is spoilt.
    """
    try:
        return _read(path)
    except InputError:
        raise
    except (ValueError, OverflowError) as error:
        raise InputError(
            f"file {str(path)!r} cannot be read as bulk data ({error}); it is cut or spoilt: write "
            "it again."
        ) from None


def _read(path: Path) -> Bulk:
    systems: dict[int, Card] = {}
    grids: dict[int, Card] = {}
    scalars: set[int] = set()
    connected: list[Freedom] = []
    dmig: dict[str, list[Card]] = {}
    for card in _cards(path):
        if card.name == "GRID":
            grids[_whole(card, 0)] = card
        elif card.name.startswith("CORD"):
            systems[_whole(card, 0)] = card
        elif card.name == "SPOINT":
            scalars.update(_numbers(card, 0))
        elif card.name == "EXTRN":
            connected += [freedom for freedom in _connected(card) if freedom not in connected]
        elif card.name == "DMIG":
            dmig.setdefault(card.fields[0].upper(), []).append(card)
        if max(len(grids), len(systems), len(scalars), len(connected)) > MOST_POINTS:
            raise ValueError(f"it has more than {MOST_POINTS} points")
    resolved: dict[int, System] = {0: BASIC}
    points = {number: _grid(card, systems, resolved) for number, card in grids.items()}
    return Bulk(points, tuple(sorted(scalars)), tuple(connected), dmig)


def _connected(card: Card) -> Iterator[Freedom]:
    """Freedoms that a card EXTRN lists: pairs of a point and its components."""
    fields = [*card.fields, ""]
    for k in range(0, len(fields) - 1, 2):
        if not fields[k]:
            continue
        point, components = _whole(card, k), fields[k + 1] or "0"
        if not set(components) <= set("0" + DIRECTIONS):
            raise ValueError(f"a card EXTRN has the components {components!r:.20}")
        yield from ((point, int(c)) for c in components)


def _grid(card: Card, cards: Mapping[int, Card], resolved: dict[int, System]) -> GridPoint:
    given = np.array([_real(card, k) for k in (2, 3, 4)])
    at = _system(_whole(card, 1, 0), cards, resolved).place(given)
    output = _whole(card, 5, 0)
    if output < 0:
        raise ValueError(f"grid {card.fields[0]} is a fluid point")
    return GridPoint(at, _system(output, cards, resolved).axes_at(at))


def _system(
    number: int, cards: Mapping[int, Card], resolved: dict[int, System], depth: int = 0
) -> System:
    """A coordinate system, those that it refers to first."""
    if number in resolved:
        return resolved[number]
    if number not in cards:
        raise ValueError(f"coordinate system {number} is missing")
    card = cards[number]
    if card.name.startswith("CORD1"):
        raise ValueError(f"coordinate system {number} is a {card.name}; write it as a CORD2R")
    if depth > len(cards):
        raise ValueError(f"coordinate system {number} refers to itself")
    within = _system(_whole(card, 1, 0), cards, resolved, depth + 1)
    origin, on_z, in_xz = (
        within.place(np.array([_real(card, k + i) for i in range(3)])) for k in (2, 5, 8)
    )
    z = on_z - origin
    y = np.cross(z, in_xz - origin)
    size = np.linalg.norm(z) * np.linalg.norm(in_xz - origin)
    if not np.linalg.norm(y) > TOGETHER * size:
        raise ValueError(f"the three points of coordinate system {number} lie on a line")
    z = z / np.linalg.norm(z)
    y = y / np.linalg.norm(y)
    resolved[number] = System(card.name[-1], origin, np.vstack([np.cross(y, z), y, z]))
    return resolved[number]


# -- matrices --------------------------------------------------------------------------------------
def dmig_matrices(
    path: Path, bulk: Bulk, wanted: Collection[str]
) -> tuple[dict[str, Matrix], tuple[Freedom, ...]]:
    """The wanted square matrices of a punch file, and the freedoms of their rows.

    Raises:
        InputError: a matrix is complex, spoilt or too large.
    """
    held = {name: bulk.dmig[name] for name in wanted if name in bulk.dmig}
    try:
        freedoms = _freedoms_of(held)
        number = {freedom: k for k, freedom in enumerate(freedoms)}
        return {name: _matrix(name, cards, number) for name, cards in held.items()}, freedoms
    except (ValueError, OverflowError) as error:
        raise InputError(
            f"file {str(path)!r} cannot be read as bulk data ({error}); it is cut or spoilt: write "
            "it again."
        ) from None


def _freedoms_of(held: Mapping[str, Sequence[Card]]) -> tuple[Freedom, ...]:
    """The freedoms that matrices name, by ascending number."""
    found: set[Freedom] = set()
    for name, cards in held.items():
        for card in cards[1:]:
            found.update(row for row, _ in _entries(card))
            found.add(_freedom(card, 1))
            if len(found) > safe_reading.LONGEST:
                raise ValueError(f"{name} has more than {safe_reading.LONGEST} freedoms")
    return tuple(sorted(found))


def _matrix(name: str, cards: Sequence[Card], number: Mapping[Freedom, int]) -> Matrix:
    """A matrix of its header (form, type) and its columns."""
    header = cards[0]
    if _whole(header, 1) != 0:
        raise ValueError(f"{name} begins without its header")
    form, kind = _whole(header, 2), _whole(header, 3)
    if kind in COMPLEX:
        raise ValueError(f"{name} holds complex numbers, where real ones are taken")
    values = np.zeros((len(number), len(number)))
    for card in cards[1:]:
        column = number[_freedom(card, 1)]
        for row, value in _entries(card):
            k = number[row]
            values[k, column] = value
            if form == SYMMETRIC:
                values[column, k] = value
    if not np.all(np.isfinite(values)):
        raise ValueError(f"{name} holds a value that is not a finite number")
    return Matrix(values, SINGLE if kind == 1 else PRINTED)


def _freedom(card: Card, place: int) -> Freedom:
    point, component = _whole(card, place), _whole(card, place + 1, 0)
    if not 0 <= component <= len(DIRECTIONS):
        raise ValueError(f"a card {card.name} names component {component} of point {point}")
    return point, component


def _entries(card: Card) -> Iterator[tuple[Freedom, float]]:
    """Freedoms and numbers of a column: after its own freedom, groups of four fields."""
    for k in range(4, len(card.fields), 4):
        if card.fields[k]:
            yield _freedom(card, k), _real(card, k + 2)
