"""Interleaved hinges: every port keeps its own hinges, and a linear program finds bodies that satisfy all of them.

The appendage is cut at the union of the hinge positions; each cell between neighbouring cuts becomes one body. For each
port the cells of one of its links must together have that link's mass moments, up to point masses at its hinges,
which may belong to either side.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import linprog

from beamchain.chain.chain import Link
from beamchain.chain.realise import Nodes
from beamchain.errors import RealisationError
from beamchain.motion import Array
from beamchain.structure.beam import Moments
from beamchain.structure.mass_line import MassLine

SAME_PLACE = 1e-9  # hinges closer than this share of the length are one
NARROWEST = 0.005  # share of the length whose mass a shorter cell takes as its own to start from
EXTRA_SHARE = 0.8  # of a cell's polar inertia: how far its transverse inertias may be set apart
GRID = (-0.1, 1.2, 66)  # where point masses may sit, in lengths of the appendage
EXTRA_COST = 0.05  # of the objective, if every cell used all of it
FLOOR = 1e-6  # of a cell's mass: what every place of the grid carries at least, so that the solution is not a corner
ROOT_SHARE = 0.002  # of the whole mass: what a root body without length starts from
LEAST_SHARE = 1e-3  # least part of its real mass a cell may keep


@dataclass(frozen=True, eq=False)
class PlaneLinks:
    """What one plane asks of the cells.

    Args:
        hinges: `(h,)` x of its hinges [m]; none: the plane is rigid.
        moments: `(h + 1, 3)` mass, first and second moment about the root of its links.
    """

    hinges: Array
    moments: Array


@dataclass(frozen=True, eq=False)
class MassGroups:
    """What the axial port asks of the cells: the mass between its hinges.

    Args:
        hinges: `(h,)` [m].
        masses: `(h + 1,)` [kg].
    """

    hinges: Array
    masses: Array


def plane_links(nodes: Nodes) -> PlaneLinks:
    """The links of a canonical chain, inner nodes with the link inside them."""
    x, m = nodes.positions, nodes.masses
    moments = np.array([[m[i], m[i] * x[i], m[i] * x[i] ** 2] for i in range(1, x.size)])
    moments[0] += [m[0], 0.0, 0.0]
    if nodes.excess is not None:
        moments[:, 2] += nodes.excess
    return PlaneLinks(x[1:-1], moments)


def merge_cuts(positions: Sequence[Array], length: float) -> Array:
    """Union of hinge positions; those that coincide to rounding are one."""
    cuts: list[float] = []
    for x in sorted(float(v) for values in positions for v in values):
        if not cuts or x - cuts[-1] > SAME_PLACE * length:
            cuts.append(x)
    return np.array(cuts)


def cells(beam: MassLine, cuts: Array, xy: PlaneLinks, xz: PlaneLinks, axial: MassGroups | None = None) -> list[Link]:
    """Bodies between the cuts that satisfy every port; polar inertia is left at zero.

    Args:
        cuts: `(c,)` ascending [m].
        xy, xz: what the planes ask.
        axial: what the axial port asks.

    Raises:
        RealisationError: no physical bodies exist.
    """
    length, total = beam.length, float(xy.moments[:, 0].sum())
    edges = np.array([0.0, *cuts, length])
    marks = edges.copy()  # a cell of no length before a hinge at the root belongs before it
    marks[0] = -1e-6 * length
    count = edges.size - 1
    real = [_stretch(beam, float(a), float(b)) for a, b in pairwise(edges)]
    # unit length and mass from here on: moments of the real piece (m, s, j_xy, j_xz)
    unit = np.array([1.0, length, length**2, length**2]) * total
    own = np.array([[r.mass, r.first, r.second + r.rotary_xy, r.second + r.rotary_xz] for r in real]) / unit
    at_root = cuts.size > 0 and cuts[0] <= SAME_PLACE * length
    if at_root:  # a hinge at the root: the cell before it is a point there
        own[0] = [ROOT_SHARE, 0.0, 0.0, 0.0]
    grid = np.linspace(*GRID)
    grid[np.argmin(np.abs(grid))] = 0.0
    points = np.column_stack([np.ones_like(grid), grid, grid**2, grid**2])
    size = grid.size
    planes = ((xy, 2), (xz, 3))
    free = sum(p.hinges.size for p, _ in planes)
    # variables: tau, then per cell the point masses and a rotary extra of each plane, then the free hinge masses;
    # the extras stay below what the cell's polar inertia allows two transverse inertias to differ by
    per_cell = size + 2
    variables = 1 + count * per_cell + free
    rows: list[Array] = []
    values: list[float] = []

    def add(members: list[int], moment: int, value: float) -> Array:
        row = np.zeros(variables)
        for k in members:
            row[0] += own[k, moment]
            at = 1 + k * per_cell
            row[at : at + size] += points[:, moment]
            if moment >= 2:
                row[at + size + moment - 2] += 1.0
        rows.append(row)
        values.append(value)
        return row

    start = 1 + count * per_cell
    for plane, second in planes:
        x = plane.hinges / length
        for i, (m, s, j) in enumerate(plane.moments / unit[:3]):
            members = _members(marks, plane.hinges, i, length)
            for moment, value, power in ((0, m, 0), (1, s, 1), (second, j, 2)):
                row = add(members, moment, value)
                if i < x.size:
                    row[start + i] = -(x[i] ** power)
                if i > 0:
                    row[start + i - 1] = x[i - 1] ** power
        start += x.size
    if axial is not None:
        for i, mass in enumerate(axial.masses / total):
            add(_members(marks, axial.hinges, i, length), 0, float(mass))
    sheared = abs(xy.moments[:, 2].sum() - xz.moments[:, 2].sum()) > 1e-12 * xy.moments[:, 2].sum()
    cost = np.zeros(variables)
    cost[0] = -1.0
    bounds: list[tuple[float | None, float | None]] = [(0.0, 1.0)]
    for k in range(count):
        extra = EXTRA_SHARE * real[k].polar / unit[2] if sheared else 0.0
        if at_root and k == 0:
            bounds += [(0.0, None if x == 0.0 else 0.0) for x in grid] + [(0.0, 0.0)] * 2
            continue
        bounds += [(FLOOR * own[k, 0] / size, None)] * size + [(0.0, extra)] * 2
        cost[1 + k * per_cell + size : 1 + (k + 1) * per_cell] = EXTRA_COST / extra / count if extra else 0.0
    bounds += [(None, None)] * free
    solution = _solve(cost, np.array(rows), np.array(values), bounds)
    out: list[Link] = []
    for k in range(count):
        at = 1 + k * per_cell
        m, s, jxy, jxz = (solution[0] * own[k] + solution[at : at + size] @ points) * unit
        jxy += solution[at + size] * unit[2]
        jxz += solution[at + size + 1] * unit[3]
        com = s / m
        if at_root and k == 0:
            com = jxy = jxz = s = 0.0
        out.append(
            Link(
                start=float(edges[k]),
                length=float(edges[k + 1] - edges[k]),
                mass=float(m),
                com=float(com),
                inertia=(0.0, float(jxz - s * com), float(jxy - s * com)),
            )
        )
    return out


def _stretch(beam: MassLine, start: float, end: float) -> Moments:
    """The beam between two cuts; between cuts that nearly coincide, a little of it on either side."""
    widen = max(NARROWEST * beam.length - (end - start), 0.0) / 2.0
    end = min(end + widen, beam.length)
    return beam.moments(max(start - widen, 0.0), end, closed=end >= beam.length)


def _members(edges: Array, hinges: Array, link: int, length: float) -> list[int]:
    """Cells of link number `link` between a port's hinges."""
    low = hinges[link - 1] if link > 0 else -np.inf
    high = hinges[link] if link < hinges.size else np.inf
    close = 1e-8 * length
    return [k for k in range(edges.size - 1) if edges[k] >= low - close and edges[k + 1] <= high + close]


def _solve(cost: Array, matrix: Array, values: Array, bounds: list[tuple[float | None, float | None]]) -> Array:
    """Maximise the share of the real piece that every cell keeps; then polish the equalities to rounding."""
    found = linprog(
        cost, A_eq=matrix, b_eq=values, bounds=bounds, method="highs", options={"primal_feasibility_tolerance": 1e-10}
    )
    x = found.x if found.status == 0 else None
    if x is None or x[0] < LEAST_SHARE:
        share = "" if x is None else f"; bodies would keep {x[0]:.1e} of their mass"
        raise RealisationError(
            f"no physical bodies satisfy both planes with these modes{share}; "
            "keep another number of modes in one plane."
        )
    x = np.array(x)
    scale = np.array([1.0 if low is None else max(abs(v), 1e-9) for v, (low, _) in zip(x, bounds, strict=True)])
    for _ in range(4):  # each correction in proportion to what is there, so that nothing turns negative
        x -= scale * np.linalg.lstsq(matrix * scale, matrix @ x - values, rcond=1e-14)[0]
    if any(low is not None and v < -1e-12 for v, (low, _) in zip(x, bounds, strict=True)):
        raise RealisationError("the bodies of both planes are determined too badly; keep fewer modes.")
    if float(np.max(np.abs(matrix @ x - values))) > 1e-11:
        raise RealisationError("the bodies of both planes are determined too badly; keep fewer modes.")
    return x
