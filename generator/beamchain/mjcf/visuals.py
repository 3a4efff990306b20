"""Shapes of a link: panels, tubes, trusses and what they carry, from its sections.

Shapes have no mass and touch nothing; they cost MuJoCo a frame transform each, so there are as few
as the eye needs. In place of them, surfaces that bend: `mjcf/surfaces.py`.
"""

from collections.abc import Sequence
from typing import NamedTuple

from beamchain.chain.chain import Link
from beamchain.structure.beam import Beam
from beamchain.structure.section import ROOT, Equivalent, Rectangle
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


def is_panel(segment: Segment) -> bool:
    """Whether a segment is drawn with solar cells."""
    section = segment.section
    drawn = isinstance(section, Equivalent) and section.draw is not None and section.draw.panel
    return drawn or isinstance(section, Rectangle)


def is_truss(segment: Segment) -> bool:
    """Whether a segment is drawn as a lattice."""
    return isinstance(segment.section, Equivalent) and not is_panel(segment)


def is_round(segment: Segment) -> bool:
    """Whether a segment is drawn with a circular section."""
    section = segment.section
    return not isinstance(section, Equivalent) and section.half_widths(section, ROOT).is_round


def link_shapes(link: Link, beam: Beam | None, length: float) -> list[Shape]:
    """What to draw of a link of an appendage of some `length` [m];
    a plain bar without the beam's sections."""
    slim = SLIM * length
    if beam is None:
        half = link.length / 2.0
        if half <= 0.0:
            return []
        return [Shape("box", middle=link.start + half, half=(half, slim, slim), rgba=TRUSS)]
    shapes: list[Shape] = []
    end = link.start + link.length
    for start, segment in zip(beam.starts, beam.segments, strict=True):
        low = max(link.start, start)
        high = min(end, start + segment.length)
        if high - low > 1e-9 * length:
            stretch = (low, high)
            shapes.append(_segment_shape(stretch, start, segment=segment, beam=beam, length=length))
    is_last = end > length * (1.0 - 1e-9)
    for lump in beam.lumps:
        if link.start <= lump.x < end or (is_last and lump.x >= end):
            shapes.append(_lump_shape(lump, length))
    return shapes


def _segment_shape(
    stretch: tuple[float, float], start: float, *, segment: Segment, beam: Beam, length: float
) -> Shape:
    """The stretch `(low, high)` of a segment, as deep as it is in its middle."""
    low, high = stretch
    section = segment.section
    slim = (LATTICE if isinstance(section, Equivalent) else SLIM) * length
    middle = (low + high) / 2.0
    y = beam.depth(middle, "xy") / 2.0 or slim
    z = beam.depth(middle, "xz") / 2.0 or slim
    kind = "box"
    rgba = TRUSS if is_truss(segment) else TUBE
    if is_panel(segment):
        gap = min(GAP * length, 0.1 * (high - low))
        low += gap if low <= start else 0.0
        high -= gap if high >= start + segment.length else 0.0
        rgba = PANEL
    elif is_round(segment):
        kind = "cylinder"
    return Shape(kind, middle=(low + high) / 2.0, half=((high - low) / 2.0, y, z), rgba=rgba)


def _lump_shape(lump: Lump, length: float) -> Shape:
    """A lumped body as the even box of its mass and inertias,
    a cube of its mass where it has none."""
    cube = (lump.mass / DENSITY) ** (1.0 / 3.0) / 2.0
    squares = box_squares(lump.mass, lump.inertia)
    sides = [square**0.5 if square > 0.0 else cube for square in squares]
    a, b, c = (min(side, LARGEST * length) for side in sides)
    return Shape("box", middle=lump.x, half=(a, b, c), rgba=CARRIED)


def box_squares(mass: float, inertia: Sequence[float]) -> tuple[float, float, float]:
    """Squares of the half sides of the even box of a mass and three principal inertias; not above
    zero where no box has them."""
    # of a box with half sides a, b, c: Iyy + Izz - Ixx = 2 m a^2 / 3
    x, y, z = (float(value) for value in inertia)
    scale = 1.5 / mass
    return scale * (y + z - x), scale * (x + z - y), scale * (x + y - z)
