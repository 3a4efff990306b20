"""The surfaces of a beam: panels with solar cells, tubes and lattices, as triangles.

Every vertex lies in a cross-section, so that what the section does in a mode is what the
vertex should do.
"""

from collections.abc import Callable, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain.mjcf.visuals import GAP, LATTICE, SLIM, is_panel, is_round, is_truss
from beamchain.ports.motions import Array
from beamchain.structure.beam import Beam

Indices = NDArray[np.int64]
Sides = Sequence[tuple[int, int]]

STATIONS = 24  # intervals between cross-sections along the whole appendage
FEWEST = 2  # of a segment
MOST_SEGMENTS = 40  # that are drawn as surfaces: beyond, the file would be long
ACROSS = 4  # solar cells across a panel
MOST_BAYS = 12  # of trusses, along the whole appendage
STRUT = 0.07  # radius of a truss's struts, of its half width

#: Corners of an outline, and the pairs of them between which a face stretches along x. Each side
#: of a box has corners of its own, so that its edges stay sharp.
ROUND = np.array([[np.cos(a), np.sin(a)] for a in np.arange(8) * np.pi / 4.0])
ROUND_SIDES = [(k, (k + 1) % 8) for k in range(8)]
CORNERS = np.array([[1.0, -1.0], [1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0]])
SQUARE = CORNERS[[0, 1, 1, 2, 2, 3, 3, 0]]
SQUARE_SIDES = [(0, 1), (2, 3), (4, 5), (6, 7)]
ROD = np.array([[np.cos(a), np.sin(a)] for a in np.arange(3) * 2.0 * np.pi / 3.0])
ROD_SIDES = [(0, 1), (1, 2), (2, 0)]


class Surface(NamedTuple):
    """Triangles of one look."""

    look: str  # "panel", "tube" or "truss"
    points: Array  # (v, 3) vertices from the root [m]
    faces: Indices  # (f, 3) of vertices, counterclockwise seen from outside
    cells: Array  # (v, 2) place in units of a solar cell, along and across; of panels


def beam_surfaces(beam: Beam) -> list[Surface]:
    """The surfaces of a beam, one per look; none where it has too many segments."""
    if len(beam.segments) > MOST_SEGMENTS:
        return []
    pieces: dict[str, list[Surface]] = {}
    for index in range(len(beam.segments)):
        piece = _segment_surface(beam, index)
        pieces.setdefault(piece.look, []).append(piece)
    return [_join(group) for group in pieces.values()]


def stations(surfaces: Sequence[Surface]) -> Array:
    """x of all cross-sections that hold vertices, in order [m]."""
    return np.unique(np.concatenate([surface.points[:, 0] for surface in surfaces]))


def _segment_surface(beam: Beam, index: int) -> Surface:
    """One segment, with gaps at its ends where it is a panel or ends at a joint."""
    segment = beam.segments[index]
    length = beam.length
    low = beam.starts[index]
    high = low + segment.length
    inside = 1e-9 * segment.length
    slim = (LATTICE if is_truss(segment) else SLIM) * length

    def half_extents(x: float) -> Array:
        """`(2,)` along y and z at `x` [m]."""
        at = min(max(x, low + inside), high - inside)
        return np.array([beam.depth(at, plane) / 2.0 or slim for plane in ("xy", "xz")])

    jointed = {joint.after_segment for joint in beam.joints}
    gap = min(GAP * length, 0.1 * segment.length)
    start = low + gap * (is_panel(segment) or index in jointed)
    stop = high - gap * (is_panel(segment) or index + 1 in jointed)
    part = (stop - start) / length
    if is_truss(segment):
        return _truss(start, stop, part, half_extents)
    x = np.linspace(start, stop, max(round(STATIONS * part), FEWEST) + 1)
    sizes = np.array([half_extents(float(at)) for at in x])
    if is_round(segment):
        points, faces = _prism(x, sizes, ROUND, ROUND_SIDES)
    else:
        points, faces = _prism(x, sizes, SQUARE, SQUARE_SIDES)
    if is_panel(segment):
        return Surface("panel", points, faces, _cells(x, sizes))
    return Surface("tube", points, faces, np.zeros((len(points), 2)))


def _prism(x: Array, sizes: Array, outline: Array, sides: Sides) -> tuple[Array, Indices]:
    """Vertices and faces of an `outline` `(k, 2)`, `sizes` `(s, 2)` large at the stations `x`
    `(s,)`, closed at both ends."""
    k = len(outline)
    points = np.empty((x.size, k, 3))
    points[:, :, 0] = x[:, None]
    points[:, :, 1:] = outline * sizes[:, None, :]
    last = (x.size - 1) * k
    faces: list[tuple[int, int, int]] = []
    for a in range(0, last, k):
        b = a + k
        for i, j in sides:
            faces += [(a + i, a + j, b + i), (a + j, b + j, b + i)]
    for i in range(1, k - 1):
        faces += [(0, i + 1, i), (last, last + i, last + i + 1)]
    return points.reshape(-1, 3), np.array(faces, dtype=np.int64)


def _cells(x: Array, sizes: Array) -> Array:
    """`(v, 2)` places of a panel's vertices in units of a solar cell, whole cells along and
    across."""
    wide = int(np.argmax(sizes[x.size // 2]))
    cell = 2.0 * float(np.mean(sizes[:, wide])) / ACROSS
    extent = float(x[-1] - x[0])
    cells = np.empty((x.size, len(SQUARE), 2))
    cells[:, :, 0] = (x[:, None] - x[0]) / extent * max(round(extent / cell), 1)
    cells[:, :, 1] = (1.0 + SQUARE[:, wide]) / 2.0 * ACROSS
    return cells.reshape(-1, 2)


def _truss(
    start: float, stop: float, part: float, half_extents: Callable[[float], Array]
) -> Surface:
    """Four longerons, and a diagonal in every bay of every side; `part` of the appendage."""
    wide = 2.0 * float(np.max(half_extents((start + stop) / 2.0)))
    bays = max(min(round((stop - start) / wide), round(MOST_BAYS * part)), FEWEST)
    x = np.linspace(start, stop, bays + 1)
    sizes = np.array([half_extents(float(at)) for at in x])
    corners = CORNERS * sizes[:, None, :]
    struts = [(x, corners[:, k]) for k in range(4)]
    for bay, k in product(range(bays), range(4)):
        # the diagonals of neighbouring bays meet
        ends = [corners[bay, (k + bay) % 4], corners[bay + 1, (k + bay + 1) % 4]]
        struts.append((x[bay : bay + 2], np.array(ends)))
    rods: list[Surface] = []
    for along, middles in struts:
        radii = np.full((along.size, 2), STRUT * float(np.max(sizes)))
        points, faces = _prism(along, radii, ROD, ROD_SIDES)
        points[:, 1:] += np.repeat(middles, len(ROD), axis=0)
        rods.append(Surface("truss", points, faces, np.zeros((len(points), 2))))
    return _join(rods)


def _join(parts: Sequence[Surface]) -> Surface:
    """Surfaces of one look as one."""
    first = np.cumsum([0, *(len(part.points) for part in parts[:-1])])
    faces = [part.faces + n for part, n in zip(parts, first, strict=True)]
    return Surface(
        parts[0].look,
        points=np.concatenate([part.points for part in parts]),
        faces=np.concatenate(faces),
        cells=np.concatenate([part.cells for part in parts]),
    )
