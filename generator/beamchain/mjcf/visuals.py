"""What a link looks like: panels, tubes, trusses and what they carry, from the sections it is made of.

Shapes have no mass and touch nothing; they cost MuJoCo a frame transform each, so there are as few as the eye needs.
"""

from typing import NamedTuple

from beamchain.chain.chain import Link
from beamchain.structure.beam import Beam
from beamchain.structure.mass_line import MassLine
from beamchain.structure.section import Rectangle, Round, Tube
from beamchain.structure.segment import Lump, Segment

PANEL = "0.15 0.27 0.62 1"  # the blue of a solar blanket
TUBE = "0.66 0.67 0.7 1"
TRUSS = "0.8 0.8 0.82 1"
CARRIED = "0.45 0.46 0.5 1"

GAP = 0.004  # of the appendage's length: what panels leave free at their hinge lines
SLIM = 1.0 / 200.0  # of the appendage's length: half the depth drawn where a section tells none
DENSITY = 400.0  # kg/m^3, of a carried body of which only the mass is known
LARGEST = 0.06  # of the appendage's length: the half width of a carried body


class Shape(NamedTuple):
    """A massless solid.

    Args:
        kind: MuJoCo's "box", or "cylinder" along x.
        middle: x from the root [m].
        half: half extents along x, y, z [m].
        rgba: colour, as MJCF writes it.
    """

    kind: str
    middle: float
    half: tuple[float, float, float]
    rgba: str


def shapes(link: Link, beam: MassLine | None, length: float) -> list[Shape]:
    """What to draw of a link.

    Args:
        link: of a chain.
        beam: the appendage; without its sections a plain bar is drawn.
        length: of the whole appendage [m].
    """
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
    y, z = (beam.depth((low + high) / 2.0, plane) / 2.0 or SLIM * length for plane in ("xy", "xz"))
    if isinstance(segment.section, Rectangle):
        gap = min(GAP * length, 0.1 * (high - low))
        low += gap if low <= start else 0.0
        high -= gap if high >= start + segment.length else 0.0
        kind, rgba = "box", PANEL
    elif isinstance(segment.section, Round | Tube):
        kind, rgba = "cylinder", TUBE
    else:
        kind, rgba = "box", TRUSS
    return Shape(kind, (low + high) / 2.0, ((high - low) / 2.0, y, z), rgba)


def _carried(lump: Lump, length: float) -> Shape:
    """A lumped body as a cube of its mass."""
    side = min((lump.mass / DENSITY) ** (1.0 / 3.0) / 2.0, LARGEST * length)
    return Shape("box", lump.x, (side, side, side), CARRIED)
