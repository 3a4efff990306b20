"""p-version strain elements: the unknowns are strains, motion is their integral.

Strains are Legendre series in each piece.

The stiffness is block diagonal; its square root (a QR of the strain rows) scales the motion rows,
whose singular values are then 1 / frequency. Motion is a running sum along the appendage, so that
for hundreds of pieces the rows need not be written down: a Krylov space of the compliance holds the
lowest modes and the static response.

Theory: docs/theory.md, section 2.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss, legint, legvander

from beamchain.ports.model import PortModel, Shapes
from beamchain.ports.motions import Array, locked
from beamchain.ports.rows import Rows

STILL = 1e-11  # relative change of the wanted frequencies between two checks
ROUNDED = 1e-5  # the same, where it falls no further: rounding of what is that far apart
BLOCKS = 6  # blocks between two checks
MOST_CHECKS = 40  # without converged frequencies; beams of hundreds of pieces took 6
DEPENDENT = 1e-11  # remainder of a vector, relative, below which it is in the space already

Indices = np.ndarray[tuple[int], np.dtype[np.int64]]


@dataclass(frozen=True, eq=False)
class Piece:
    """A smooth stretch `[start, start + length]` [m] in one port, sampled at its Gauss points."""

    start: float
    length: float
    stiffness: Array  #: `(q,)` EI [N m^2], GJ [N m^2] or EA [N]
    inertia: Array  #: `(q,)` mass [kg/m], in torsion polar inertia [kg m], per length
    shear_stiffness: Array | None = None  #: `(q,)` k G A [N]; None: rigid in shear
    rotary_inertia: Array | None = None  #: `(q,)` rho I [kg m]


class Spring(NamedTuple):
    """A compliant joint at `x` [m]; `stiffness` [N m/rad] (or [N/m] in axial motion)."""

    x: float
    stiffness: float


class PointBody(NamedTuple):
    """A body at `x` [m]: `mass` [kg] (torsion: polar), rotary `inertia` [kg m^2]."""

    x: float
    mass: float
    inertia: float = 0.0


@cache
def legendre_series(k: int, count: int) -> tuple[Array, Array, Array, Array]:
    """Legendre polynomials 0..k-1 at the Gauss points, their first and second integrals from -1,
    and the second ones at 1.

    All `(count, k)`, the last `(k,)`.
    """
    xi, _ = gauss(count)
    first = legint(np.eye(k), 1, lbnd=-1)
    second = legint(np.eye(k), 2, lbnd=-1)
    values = legvander(xi, k - 1)
    first_values = legvander(xi, k) @ first
    second_values = legvander(xi, k + 1) @ second
    second_ends = np.sum(second, axis=0)  # every polynomial is 1 at 1
    return locked(values), locked(first_values), locked(second_values), locked(second_ends)


def inverse_stiffness_root(strain: Array, weight: Array) -> Array:
    """`R^-1` `(k, k)` or `(p, k, k)`: `R^T R` is the stiffness of strains `(q, k)`
    with weights `(q,)` or `(p, q)`."""
    r = np.linalg.qr(np.sqrt(weight)[..., None] * strain, mode="r")
    return np.linalg.inv(r)


@cache
def gauss(count: int) -> tuple[Array, Array]:
    """Points in (-1, 1) and weights of the Gauss rule, read-only."""
    points, weights = leggauss(count)
    return locked(points), locked(weights)


class MotionRows:
    """Rows of motion of a chain of pieces as an operator on strain coordinates."""

    def __init__(
        self,
        pieces: Sequence[Piece],
        *,
        hinges: Sequence[Spring],
        bodies: Sequence[PointBody],
        functions: int,
        bending: bool,
        stations: Sequence[float] = (),
    ) -> None:
        self.bending: bool = bending
        self.count: int = len(pieces)
        self.half: Array = np.array([piece.length for piece in pieces]) / 2.0
        tip = pieces[-1].start + pieces[-1].length
        self.nodes: Array = np.array([*(piece.start for piece in pieces), tip])
        self.hinge_nodes: Indices = self._nearest_nodes([hinge.x for hinge in hinges])
        self.body_nodes: Indices = self._nearest_nodes([body.x for body in bodies])
        self.points: tuple[float, ...] = (tip, *stations)
        self.ends: list[int] = [self.count, *self._nearest_nodes(stations).tolist()]

        # strain and shear of coordinates whose strain energy is |y|^2 / 2
        xi, weights = gauss(pieces[0].stiffness.size)
        series, once, twice, end_twice = legendre_series(functions, xi.size)
        h = self.half[:, None, None]
        lengths = weights * self.half[:, None]
        stiffness = np.array([piece.stiffness for piece in pieces])
        strain = inverse_stiffness_root(series, lengths * stiffness)
        shear = _shear_scale(pieces, series, lengths)
        if shear is not None:
            strain, shear = np.dstack([strain, 0.0 * shear]), np.dstack([0.0 * strain, shear])
        hinge_stiffness = np.array([hinge.stiffness for hinge in hinges], dtype=np.float64)
        self.jumps: Array = 1.0 / np.sqrt(hinge_stiffness)
        self.arm: Array = self.half[:, None] * (1.0 + xi)  #: `(p, q)` of points from the start
        # turn and displacement against the start of a piece: at its points, and at its end
        self.turn_within: Array = h * (once @ strain)
        self.turn_gain: Array = 2.0 * h[:, 0] * strain[:, 0]
        self.move_within: Array = h**2 * (twice @ strain)
        self.move_gain: Array = h[:, 0] ** 2 * (end_twice @ strain)
        if shear is not None:
            self.move_within += h * (once @ shear)
            self.move_gain += 2.0 * h[:, 0] * shear[:, 0]

        # square roots of the inertia that moves and that turns
        inertia = np.sqrt(lengths * np.array([piece.inertia for piece in pieces]))
        body_mass = np.sqrt(np.array([body.mass for body in bodies], dtype=np.float64))
        if bending:
            zeros = np.zeros(xi.size)
            rotary = [
                zeros if piece.rotary_inertia is None else piece.rotary_inertia for piece in pieces
            ]
            body_inertia = np.array([body.inertia for body in bodies], dtype=np.float64)
            self.move: Array = inertia
            self.turn: Array = np.sqrt(lengths * np.array(rotary))
            self.body_move: Array = body_mass
            self.body_turn: Array = np.sqrt(body_inertia)
        else:
            self.move = np.zeros_like(inertia)
            self.turn = inertia
            self.body_move = np.zeros_like(body_mass)
            self.body_turn = body_mass
        # whether any row weighs a rotation between the nodes
        self.turns: bool = bool(np.any(self.turn))

    def _nearest_nodes(self, places: Sequence[float]) -> Indices:
        """Node of each place."""
        middles = (self.nodes[:-1] + self.nodes[1:]) / 2.0
        return np.searchsorted(middles, np.array(places, dtype=np.float64)).astype(np.int64)

    @property
    def size(self) -> int:
        """Strain coordinates."""
        return self.turn_gain.size + self.jumps.size

    def rows(self, y: Array) -> tuple[Array, Array]:
        """Weighted motion `(b, r)`, and that of the ends `(b, t)`, for `y` `(b, n)`.

        With `xi` from -1 to 1 in a piece of half length `h`, curvature `e` and shear `g`:
        `turn = turn_0 + h int e`, `move = move_0 + h (1 + xi) turn_0 + h^2 int int e + h int g`.
        """
        count = len(y)
        strains = y[:, : self.turn_gain.size].reshape(count, self.count, -1)
        jump = self._at_nodes(self.hinge_nodes, y[:, self.turn_gain.size :] * self.jumps)
        # turn at each node before its own hinge, and at the start of each piece behind it
        turn = _sums_before(jump[:, :-1] + np.sum(strains * self.turn_gain, axis=2))
        start = (turn + jump)[:, :-1]
        blocks = [turn[:, self.body_nodes] * self.body_turn]
        if self.turns:
            turned = start[:, :, None] + _each(strains, self.turn_within)
            blocks.append((self.turn * turned).reshape(count, -1))
        if not self.bending:
            return np.hstack(blocks), turn[:, self.ends]
        move = _sums_before(2.0 * self.half * start + np.sum(strains * self.move_gain, axis=2))
        moved = move[:, :-1, None] + self.arm * start[:, :, None] + _each(strains, self.move_within)
        blocks.append(move[:, self.body_nodes] * self.body_move)
        blocks.append((self.move * moved).reshape(count, -1))
        ends = np.stack([move[:, self.ends], turn[:, self.ends]], axis=2)
        return np.hstack(blocks), ends.reshape(count, -1)

    def loads(self, rows: Array, tip: Array) -> Array:
        """The transpose of `rows`, its lines from the last to the first: loads `(b, n)` of forces
        `(b, r)` and `(b, t)`."""
        count = len(rows)
        sizes = [self.body_nodes.size, self.turn.size * self.turns, self.body_nodes.size]
        body_turn, turned, body_move, moved = np.split(rows, np.cumsum(sizes), axis=1)
        shape = (count, *self.turn.shape)
        strains = np.zeros((count, *self.turn_gain.shape))
        start = np.zeros((count, self.count))
        if self.bending:
            moved = moved.reshape(shape) * self.move
            move = self._at_nodes(self.body_nodes, body_move * self.body_move)
            move += self._at_nodes(self.ends, tip[:, ::2])
            move[:, :-1] += np.sum(moved, axis=2)
            gain = _sums_behind(move)
            start = np.sum(moved * self.arm, axis=2) + 2.0 * self.half * gain
            strains += _each(moved, self.move_within.swapaxes(1, 2))
            strains += gain[:, :, None] * self.move_gain
        if self.turns:
            turned = turned.reshape(shape) * self.turn
            start += np.sum(turned, axis=2)
            strains += _each(turned, self.turn_within.swapaxes(1, 2))
        turn = self._at_nodes(self.body_nodes, body_turn * self.body_turn)
        turn += self._at_nodes(self.ends, tip[:, 1::2] if self.bending else tip)
        turn[:, :-1] += start
        gain = _sums_behind(turn)
        strains += gain[:, :, None] * self.turn_gain
        jump = np.pad(start + gain, ((0, 0), (0, 1)))
        return np.hstack([strains.reshape(count, -1), jump[:, self.hinge_nodes] * self.jumps])

    def _at_nodes(self, nodes: Indices | list[int], values: Array) -> Array:
        """`(b, p + 1)` sums of `values` `(b, k)` that stand at `nodes` `(k,)`."""
        out = np.zeros((self.count + 1, len(values)))
        np.add.at(out, nodes, values.T)
        return out.T

    @property
    def _gauss_places(self) -> Array:
        """x of the Gauss points of all pieces [m]."""
        return (self.nodes[:-1, None] + self.arm).ravel()

    @property
    def _turned(self) -> Array:
        """Square roots of the inertia that turns: bodies, then points."""
        points = self.turn.ravel() if self.turns else np.zeros(0)
        return np.concatenate([self.body_turn, points])

    @property
    def _moved(self) -> Array:
        """Square roots of the mass that moves: bodies, then points."""
        return np.concatenate([self.body_move, self.move.ravel()])

    @cached_property
    def rigid(self) -> Array:
        """`(m, r)` weighted motion of all points per unit motion of the root."""
        turned = self._turned
        if not self.bending:
            return turned[None]
        moved = self._moved
        places = np.concatenate([self.nodes[self.body_nodes], self._gauss_places])
        displacement = np.concatenate([0.0 * turned, moved])
        rotation = np.concatenate([turned, moved * places])
        return np.vstack([displacement, rotation])

    def shapes(self, values: Array) -> Shapes:
        """The shapes of modes whose weighted motion `(n, r)` is given."""
        turned = self._turned
        all_places = np.concatenate([self.nodes[self.body_nodes], self._gauss_places])
        turned_places = all_places[: turned.size]
        if not self.bending:
            return Shapes(
                x=turned_places,
                moved=turned,
                turned=0.0 * turned,
                values=values,
                bending=False,
            )
        return Shapes(
            x=np.concatenate([turned_places, all_places]),
            moved=np.concatenate([0.0 * turned, self._moved]),
            turned=np.concatenate([turned, np.zeros(all_places.size)]),
            values=values,
            bending=True,
        )


def _shear_scale(pieces: Sequence[Piece], strain: Array, lengths: Array) -> Array | None:
    """`(p, k, k)` as `inverse_stiffness_root` of shear, zero in a piece that is rigid in shear;
    None where all are."""
    sheared = np.array([piece.shear_stiffness is not None for piece in pieces])
    if not np.any(sheared):
        return None
    ones = np.ones(lengths.shape[1])
    stiffness = [
        ones if piece.shear_stiffness is None else piece.shear_stiffness for piece in pieces
    ]
    scale = inverse_stiffness_root(strain, lengths * np.array(stiffness))
    return scale * sheared[:, None, None]


def assemble(rows: MotionRows) -> PortModel:
    """The port model of all modes of the discretisation, from the rows written down."""
    elastic, ends = rows.rows(np.eye(rows.size))
    moved = Rows(rows.rigid.T, elastic.T, points=ends.T)
    return PortModel.from_rows(moved, shapes=rows.shapes, points=rows.points)


def assemble_lowest(line: MotionRows, wanted: int, *, shaped: bool = False) -> PortModel | None:
    """The port model reduced to the Krylov space of loads on root, tip and one of all points.

    `shaped`: with the shapes of its modes, at all points.

    None where its `wanted` lowest frequencies do not converge. Each check costs the square of the
    space so far, so that the number of checks bounds the work.
    """
    rigid = line.rigid
    block = _first_loads(line)
    space = np.zeros((0, line.size))
    motions = np.zeros((0, rigid.shape[1]))
    ends = np.zeros((0, _end_motions(line)))
    before = (np.zeros(0), np.zeros(0))
    least = np.inf
    for _ in range(MOST_CHECKS):
        for _ in range(BLOCKS):
            block = _new_directions(space, block)
            if not block.size:
                break
            moved, end = line.rows(block)
            space = np.vstack([space, block])
            motions = np.vstack([motions, moved])
            ends = np.vstack([ends, end])
            block = line.loads(moved, np.zeros_like(end))
        # rows with the same products, as few as there are columns
        every = np.vstack([motions, rigid]).T
        shapes = None
        if shaped:
            q, r = np.linalg.qr(every)
            shapes = partial(_shapes_of_fewer, line, q)
        else:
            r = np.asarray(np.linalg.qr(every, mode="r"), dtype=np.float64)
        fewer = Rows(r[:, len(motions) :], r[:, : len(motions)], points=ends.T)
        model = PortModel.from_rows(fewer, shapes=shapes, points=line.points)
        now = model.frequencies[:wanted], model.free_frequencies[:wanted]
        change = _largest_change(before, now)
        converged = change < STILL or 0.3 * least < change < ROUNDED
        if not block.size or (converged and model.modes > 2 * wanted):
            return model
        before = now
        least = min(change, least)
    return None


def _shapes_of_fewer(line: MotionRows, basis: Array, values: Array) -> Shapes:
    """The shapes of modes whose weighted motion `(n, k)` is told in columns `(r, k)`."""
    return line.shapes(values @ basis.T)


def _end_motions(line: MotionRows) -> int:
    """Number of motions of all its ends together."""
    return len(line.ends) * (2 if line.bending else 1)


def _first_loads(line: MotionRows) -> Array:
    """`(b, n)` loads of unit accelerations of the root, unit forces on the ends, and one on all
    points for modes that move neither."""
    rigid = line.rigid
    count = _end_motions(line)
    any_force = np.random.default_rng(0).standard_normal((1, rigid.shape[1]))
    forces = np.vstack([rigid, np.zeros((count, rigid.shape[1])), any_force])
    root_rows = np.zeros((len(rigid), count))
    any_row = np.zeros((1, count))
    return line.loads(forces, np.vstack([root_rows, np.eye(count), any_row]))


def _each(values: Array, matrices: Array) -> Array:
    """`(b, p, j)`: each piece's `matrices` `(p, j, k)` times its `values` `(b, p, k)`."""
    return np.matmul(values.swapaxes(0, 1), matrices.swapaxes(1, 2)).swapaxes(0, 1)


def _sums_before(values: Array) -> Array:
    """`(b, p + 1)` sums at the nodes, of values `(b, p)` in the pieces before each."""
    return np.pad(np.cumsum(values, axis=1), ((0, 0), (1, 0)))


def _sums_behind(values: Array) -> Array:
    """`(b, p)` sums over the nodes behind each piece, of values `(b, p + 1)` at the nodes."""
    return np.cumsum(values[:, :0:-1], axis=1)[:, ::-1]


def _new_directions(space: Array, block: Array) -> Array:
    """Orthonormal rows that span the part of `block` outside `space`.

    Gram and Schmidt's, twice, since once leaves rounding along the others.
    """
    new: list[Array] = []
    sizes = np.linalg.norm(block, axis=1, keepdims=True)
    block = block / np.maximum(sizes, np.finfo(np.float64).tiny)
    for _ in range(2):
        block = block - (block @ space.T) @ space
    for row in block:
        rest = row
        for _ in range(2):
            for direction in new:
                rest = rest - (direction @ rest) * direction
        size = float(np.linalg.norm(rest))
        if size > DEPENDENT:
            rest = rest / size
            rest = rest - (space @ rest) @ space
            new.append(rest / np.linalg.norm(rest))
    return np.array(new).reshape(len(new), block.shape[1])


def _largest_change(before: tuple[Array, Array], now: tuple[Array, Array]) -> float:
    """Largest relative change of frequencies; infinity where sizes differ."""
    pairs = list(zip(before, now, strict=True))
    if any(old.size != new.size for old, new in pairs):
        return np.inf
    return max(float(np.max(np.abs(new / old - 1.0), initial=0.0)) for old, new in pairs)
