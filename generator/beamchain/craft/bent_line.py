"""A beam bent by its modes as far as it matters to forces that act on it: cells one behind the
other, turned by the rotations of the modes, each as long as the chord of its arc.

To second order in the modal coordinates its points move as those of the beam: they come nearer to
the root as it bends (foreshortening), and twist turns the plane in which it is bent.

Theory: docs/theory.md, section 9.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from beamchain.ports.compose import model_in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array
from beamchain.structure.beam import Beam

CELLS = 40  # of a beam, besides the cuts at ports and hinge lines
LOW = 6  # modes of each port that take part at least,
HIGHER = 3.0  # those up to this many times the band,
MORE = 3  # and some beyond
SHORT = 1e-9  # of the length: places nearer than that are one


@dataclass(frozen=True, eq=False)
class BentLine:
    """A beam cut into cells.

    Args:
        model: its lowest modes, and the static shapes of loads on its ports, in six motions.
        rows: `(m,)` numbers of the modes as they follow here, port by port.
        lengths, masses: `(c,)` of the cells; `centres` `(c,)`: from their starts [m].
        inertias: `(c, 3, 3)` about their centres.
        turns: `(m, c, 3)` by how much each mode turns a cell against the one before; `stretches`
            `(m, c)` [m]: by how much it lengthens a cell.
        bows: `(m, c, 3)` by how much each mode bends a cell, from its start to its end.
        ends: per port number of the cell that ends there, and `(m, 3)` the turn against it.
        size: `(m,)` largest rotation in each mode, or elongation over the length.
    """

    model: PortModel
    rows: NDArray[np.intp]
    lengths: Array
    masses: Array
    centres: Array
    inertias: Array
    turns: Array
    stretches: Array
    bows: Array
    ends: tuple[tuple[int, Array], ...]
    size: Array

    def bent(self, eta: Array) -> tuple[Array, Array, Array]:
        """Rotations of the cells `(b, c, 3, 3)`, their ends `(b, c, 3)` and centres of mass
        `(b, c, 3)` in the axes of the root, for modal coordinates `(b, m)`."""
        steps = turned_by(np.einsum("bm,mci->bci", eta, self.turns))
        axes = np.empty_like(steps)
        axes[:, 0] = steps[:, 0]
        for i in range(1, steps.shape[1]):
            axes[:, i] = axes[:, i - 1] @ steps[:, i]
        # the chord of an arc of length h that bends by t: h (1 - t^2 / 24)
        shorter = np.sum(np.einsum("bm,mci->bci", eta, self.bows) ** 2, axis=-1) / 24.0
        lengths = self.lengths * (1.0 - shorter) + eta @ self.stretches
        along = axes[..., 0] * lengths[..., None]
        ends = np.cumsum(along, axis=1)
        centres = ends - along * (1.0 - self.centres / self.lengths)[:, None]
        return axes, ends, centres

    def port(self, number: int, axes: Array, ends: Array, eta: Array) -> tuple[Array, Array]:
        """Place `(b, 3)` and rotation `(b, 3, 3)` of a port, of what `bent` gave for `eta`."""
        cell, turn = self.ends[number]
        return ends[:, cell], axes[:, cell] @ turned_by(eta @ turn)


def bent_line(
    beam: Beam,
    ports: Mapping[str, PortModel],
    rigid_mass: Array,
    stations: Sequence[float],
    band: float,
) -> BentLine:
    """A beam cut for its lowest modes.

    Args:
        beam: all of it.
        ports: its modes per port, as in `exact_appendage`.
        rigid_mass: `(6, 6)` of it.
        stations: x of ports that carry something [m].
        band: of interest [rad/s].
    """
    low = {port: _lowest(model, port, stations, band) for port, model in ports.items()}
    model = model_in_space(low, rigid_mass)
    lines = [x for port in PORTS if port != "axial" for x in beam.hinge_lines(port)]
    even = np.linspace(0.0, beam.length, CELLS + 1)
    wanted = np.sort(np.concatenate([even, lines, list(stations)]))
    apart = np.diff(wanted, prepend=-1.0) > SHORT * beam.length
    x = wanted[apart]
    x[-1] = beam.length
    mass, first, second, polar, rotary_xy, rotary_xz = beam.line.moments(x).T
    places = first / np.maximum(mass, 1e-300)
    about = second - mass * places**2
    diagonals = np.column_stack([polar, about + rotary_xz, about + rotary_xy])
    numbers = _numbers(low)
    rows: list[NDArray[np.intp]] = []
    cells: list[Array] = []
    turned: list[Array] = []
    stretches: list[Array] = []
    bows: list[Array] = []
    for port, part in low.items():
        if not part.modes:
            continue
        motion, slope, bend = _motion(part, x, sorted({0.0, *lines, beam.length}))
        axis = {"xy": (0, 0, 1), "xz": (0, -1, 0), "torsion": (1, 0, 0), "axial": (0, 0, 0)}[port]
        bows.append((bend * np.diff(x))[:, :, None] * (np.array(axis) * [0, 1, 1]))
        if port == "torsion":
            along = (motion[:, 1:] + motion[:, :-1]) / 2.0
            at_nodes = motion
        else:
            along = np.diff(motion, axis=1) / np.diff(x)
            at_nodes = slope
        grows = np.diff(motion, axis=1)
        stretches.append(grows if port == "axial" else 0.0 * grows)
        rows.append(numbers[port])
        cells.append(along[:, :, None] * np.array(axis))
        turned.append(at_nodes[:, :, None] * np.array(axis))
    cell_turns = np.vstack([np.zeros((0, x.size - 1, 3)), *cells])
    node_turns = np.vstack([np.zeros((0, x.size, 3)), *turned])
    longer = np.vstack([np.zeros((0, x.size - 1)), *stretches])
    ends = []
    for station in stations:
        node = int(np.argmin(np.abs(x - station)))
        ends.append((node - 1, node_turns[:, node] - cell_turns[:, node - 1]))
    return BentLine(
        model,
        np.concatenate([np.zeros(0, np.intp), *rows]),
        np.diff(x),
        mass,
        places - x[:-1],
        np.einsum("ci,ij->cij", diagonals, np.eye(3)),
        np.diff(cell_turns, axis=1, prepend=0.0),
        longer,
        np.vstack([np.zeros((0, x.size - 1, 3)), *bows]),
        tuple(ends),
        np.maximum(np.abs(cell_turns).max(axis=(1, 2)), np.abs(longer).sum(axis=1) / beam.length),
    )


def _lowest(model: PortModel, port: str, stations: Sequence[float], band: float) -> PortModel:
    """The lowest modes of a port, and the static shapes of loads on some points."""
    near = int(np.sum(model.frequencies <= HIGHER * band)) + MORE
    count = min(max(LOW, near), model.modes)
    if not stations:
        return model.truncated(count)
    low = model.attached(count, model.point_columns(stations))
    beyond = low.modes - count
    mean = float(np.mean(model.damping[count:])) if beyond else 0.0
    return low.replaced(
        damping=np.concatenate([model.damping[:count], np.full(beyond, mean)]),
        labels=(port,) * low.modes,
    )


def _numbers(ports: Mapping[str, PortModel]) -> dict[str, NDArray[np.intp]]:
    """Places of each port's modes among all of them together."""
    together = np.concatenate([model.frequencies for model in ports.values()])
    rank = np.empty(together.size, dtype=np.intp)
    rank[np.argsort(together, kind="stable")] = np.arange(together.size)
    starts = np.cumsum([0, *(model.modes for model in ports.values())])
    return {
        port: rank[a:b]
        for port, a, b in zip(ports, starts[:-1].tolist(), starts[1:].tolist(), strict=True)
    }


def _motion(model: PortModel, x: Array, breaks: Sequence[float]) -> tuple[Array, Array, Array]:
    """Motion of modes and its slope at `x`, `(modes, x)`, and its second derivative halfway between
    them: splines through the points where the beam has mass, one between each two of its hinge
    lines."""
    shapes = model.shapes
    assert shapes is not None
    known = shapes.moved > 0.0
    at, first = np.unique(shapes.x[known], return_index=True)
    values = (shapes.values[:, known] / shapes.moved[known])[:, first]
    count = len(values)
    at = np.concatenate([[0.0], at[at > 0.0]])
    values = np.hstack([np.zeros((count, 1)), values[:, values.shape[1] - (at.size - 1) :]])
    motion = np.zeros((count, x.size))
    slope = np.zeros((count, x.size))
    middles = (x[1:] + x[:-1]) / 2.0
    bend = np.zeros((count, middles.size))
    for low, high in zip(breaks[:-1], breaks[1:], strict=True):
        edge = SHORT * breaks[-1]
        inside = (at >= low - edge) & (at <= high + edge)
        spline = CubicSpline(at[inside], values[:, inside], axis=1)
        here = (x > low + edge) & (x <= high + edge) | ((x <= edge) & (low == 0.0))
        motion[:, here] = spline(x[here])
        slope[:, here] = spline(x[here], 1)
        within = (middles > low) & (middles < high)
        bend[:, within] = spline(middles[within], 2)
    return motion, slope, bend


def turned_by(vectors: Array) -> Array:
    """`(..., 3, 3)` rotations by vectors `(..., 3)` (Rodrigues)."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    cross = np.zeros((*vectors.shape[:-1], 3, 3))
    x, y, z = np.moveaxis(vectors, -1, 0)
    cross[..., 0, 1], cross[..., 0, 2] = -z, y
    cross[..., 1, 0], cross[..., 1, 2] = z, -x
    cross[..., 2, 0], cross[..., 2, 1] = -y, x
    # sin(a) / a and (1 - cos(a)) / a^2
    sine, half = np.sinc(angle / np.pi), np.sinc(angle / (2.0 * np.pi))
    return np.eye(3) + sine * cross + half**2 / 2.0 * (cross @ cross)
