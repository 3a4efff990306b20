"""What a link looks like: panels, tubes, trusses and what they carry, from the sections it is made of.

Shapes have no mass and touch nothing; they cost MuJoCo a frame transform each, so there are as few as the eye needs. Cells
and lattices are added where pictures are drawn (`engine/draw.py`), which knows panels and trusses by their colours.
"""

from typing import NamedTuple

from beamchain.chain.chain import Link
from beamchain.structure.beam import Beam
from beamchain.structure.mass_line import MassLine
from beamchain.structure.section import Equivalent, Rectangle, Round, Tube
from beamchain.structure.segment import Lump, Segment

PANEL = "0.15 0.27 0.62 1"  # the blue of a solar blanket
TUBE = "0.66 0.67 0.7 1"
TRUSS = "0.8 0.8 0.82 1"
CARRIED = "0.72 0.72 0.75 1"

GAP = 0.004  # of the appendage's length: what panels leave free at their hinge lines
SLIM = 1.0 / 200.0  # of the appendage's length: half the depth drawn where a section tells none
LATTICE = 1.0 / 120.0  # the same of a truss
DENSITY = 400.0  # kg/m^3, of a carried body of which only the mass is known
LARGEST = 0.1  # of the appendage's length: the half width of a carried body


class Shape(NamedTuple):
    """A massless solid."""

    kind: str  # MuJoCo's "box", "cylinder" or "capsule", the last two along x
    middle: float  # x from the root [m]
    half: tuple[float, float, float]  # extents along x, y, z [m]
    rgba: str


def shapes(link: Link, beam: MassLine | None, length: float) -> list[Shape]:
    """What to draw of a link of an appendage of some `length` [m]; a plain bar without the beam's sections."""
    slim = SLIM * length
    if not isinstance(beam, Beam):
        middle = link.length / 2.0
        return [Shape("box", link.start + middle, (middle, slim, slim), TRUSS)] if middle > 0.0 else []
    out: list[Shape] = []
    end = link.start + link.length
    for start, segment in zip(beam.starts, beam.segments, strict=True):
        low, high = max(link.start, start), min(end, start + segment.length)
        if high - low > 1e-9 * length:
            out.append(_piece(low, high, start, segment, beam, length))
    last = end > length * (1.0 - 1e-9)
    out += [_carried(lump, length) for lump in beam.lumps if link.start <= lump.x < end or (last and lump.x >= end)]
    return out


def _piece(low: float, high: float, start: float, segment: Segment, beam: Beam, length: float) -> Shape:
    """The stretch from `low` to `high` of a segment, as deep as it is in its middle."""
    section = segment.section
    truss = isinstance(section, Equivalent)
    bare = (LATTICE if truss else SLIM) * length
    y, z = (beam.depth((low + high) / 2.0, plane) / 2.0 or bare for plane in ("xy", "xz"))
    if isinstance(section, Rectangle) or (truss and section.draw is not None and section.draw.panel):
        gap = min(GAP * length, 0.1 * (high - low))
        low += gap if low <= start else 0.0
        high -= gap if high >= start + segment.length else 0.0
        kind, rgba = "box", PANEL
    elif isinstance(section, Round | Tube):
        kind, rgba = "cylinder", TUBE
    else:
        kind, rgba = "box", TRUSS if truss else TUBE
    return Shape(kind, (low + high) / 2.0, ((high - low) / 2.0, y, z), rgba)


def _carried(lump: Lump, length: float) -> Shape:
    """A lumped body as the even box of its mass and inertias, a cube of its mass where it has none."""
    x, y, z = lump.inertia
    squares = [1.5 / lump.mass * two for two in (y + z - x, x + z - y, x + y - z)]
    cube = (lump.mass / DENSITY) ** (1.0 / 3.0) / 2.0
    sides = [square**0.5 if square > 0.0 else cube for square in squares]
    a, b, c = (min(side, LARGEST * length) for side in sides)
    return Shape("box", lump.x, (a, b, c), CARRIED)
