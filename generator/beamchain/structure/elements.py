"""p-version strain elements: the unknowns are strains (Legendre series in each piece), motion is their integral.

The stiffness is block diagonal; its square root (a QR of the strain rows) scales the motion rows, whose singular values
are then 1 / frequency. Motion is a running sum along the appendage, so that for hundreds of pieces the rows need not be
written down: a Krylov space of the compliance holds the lowest modes and the static response.

Theory: docs/theory.md, section 2.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss, legint, legvander

from beamchain.ports.compose import port_from_rows
from beamchain.ports.model import PortModel, Shapes
from beamchain.ports.motions import Array, locked

STILL = 1e-11  # relative change of the wanted frequencies between two looks
ROUNDED = 1e-5  # the same, where it falls no further: rounding of what is that far apart
LOOK = 6  # blocks between two looks
DEPENDENT = 1e-11  # what is left of a vector, relative, below which it is in the space already

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


class Body(NamedTuple):
    """A body at `x` [m]: `mass` [kg] (torsion: polar), rotary `inertia` [kg m^2]."""

    x: float
    mass: float
    inertia: float = 0.0


@cache
def series(k: int, count: int) -> tuple[Array, Array, Array, Array]:
    """Legendre polynomials 0..k-1 at the Gauss points, their integrals from -1, and twice so, there and at 1.

    All `(count, k)`, the last `(k,)`.
    """
    xi, _ = gauss(count)
    once, twice = (legint(np.eye(k), m, lbnd=-1) for m in (1, 2))
    values = legvander(xi, k - 1), legvander(xi, k) @ once, legvander(xi, k + 1) @ twice, np.sum(twice, axis=0)
    return locked(values[0]), locked(values[1]), locked(values[2]), locked(values[3])


def scaled(strain: Array, weight: Array) -> Array:
    """Inverse square root of the stiffness of pieces: strains `(q, k)`, weights `(q,)` or `(p, q)`."""
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
        hinges: Sequence[Spring],
        bodies: Sequence[Body],
        functions: int,
        *,
        bending: bool,
        stations: Sequence[float] = (),
    ) -> None:
        self.bending: bool = bending
        self.functions: int = functions
        self.count: int = len(pieces)
        self.half: Array = np.array([p.length for p in pieces]) / 2.0
        self.nodes: Array = np.array([*(p.start for p in pieces), pieces[-1].start + pieces[-1].length])
        xi, weights = gauss(pieces[0].stiffness.size)
        self.reach: Array = 1.0 + xi
        self.once: Array
        self.twice: Array
        self.end_twice: Array
        strain, self.once, self.twice, self.end_twice = series(functions, xi.size)
        stretch = weights * self.half[:, None]
        self.scale: Array = scaled(strain, stretch * np.array([p.stiffness for p in pieces]))
        sheared = [p.shear_stiffness is not None for p in pieces]
        self.shear_scale: Array | None = None
        if any(sheared):  # a piece without shear has none in its coordinates
            given = [np.ones(xi.size) if p.shear_stiffness is None else p.shear_stiffness for p in pieces]
            self.shear_scale = scaled(strain, stretch * np.array(given)) * np.array(sheared)[:, None, None]
        inertia = np.sqrt(stretch * np.array([p.inertia for p in pieces]))
        rotary = np.array([np.zeros(xi.size) if p.rotary_inertia is None else p.rotary_inertia for p in pieces])
        self.move: Array = inertia if bending else np.zeros_like(inertia)
        self.turn: Array = np.sqrt(stretch * rotary) if bending else inertia
        self.turns: bool = bool(np.any(self.turn))  # else no row weighs a rotation between the nodes
        self.hinge_nodes: Indices = self._nearest([h.x for h in hinges])
        self.ends: list[int] = [self.count, *self._nearest(stations).tolist()]
        self.jumps: Array = 1.0 / np.sqrt(np.array([h.stiffness for h in hinges], dtype=np.float64))
        self.body_nodes: Indices = self._nearest([b.x for b in bodies])
        mass = np.sqrt(np.array([b.mass for b in bodies], dtype=np.float64))
        self.body_move: Array = mass if bending else np.zeros_like(mass)
        self.body_turn: Array = np.sqrt(np.array([b.inertia for b in bodies], dtype=np.float64)) if bending else mass

    def _nearest(self, places: Sequence[float]) -> Indices:
        """Node of each place."""
        middles = (self.nodes[:-1] + self.nodes[1:]) / 2.0
        return np.searchsorted(middles, np.array(places, dtype=np.float64)).astype(np.int64)

    @property
    def size(self) -> int:
        """Strain coordinates."""
        strains = 1 if self.shear_scale is None else 2
        return strains * self.count * self.functions + self.jumps.size

    def _split(self, y: Array) -> tuple[Array, Array | None, Array]:
        """Strain series, shear series and hinge angles of coordinates `(b, n)`."""
        block = self.count * self.functions
        shape = (y.shape[0], self.count, self.functions)
        series = [y[:, :block]] if self.shear_scale is None else [y[:, :block], y[:, block : 2 * block]]
        parts = [
            np.matmul(scale, part.reshape(shape)[..., None])[..., 0]
            for part, scale in zip(series, (self.scale, self.shear_scale), strict=False)
            if scale is not None
        ]
        return parts[0], parts[1] if len(parts) > 1 else None, y[:, len(series) * block :]

    def rows(self, y: Array) -> tuple[Array, Array]:
        """Weighted motion `(b, r)`, and that of the ends `(b, t)`, for `y` `(b, n)`."""
        strain, shear, angles = self._split(y)
        half = self.half
        jump = np.zeros((y.shape[0], self.count + 1))
        np.add.at(jump.T, self.hinge_nodes, (angles * self.jumps).T)
        before = np.zeros_like(jump)  # turn at each node, its own hinge not in it yet
        before[:, 1:] = np.cumsum(jump[:, :-1] + 2.0 * half * strain[:, :, 0], axis=1)
        start = (before + jump)[:, :-1]
        out = [before[:, self.body_nodes] * self.body_turn]
        if self.turns:
            turn = start[:, :, None] + half[:, None] * (strain @ self.once.T)
            out.append((self.turn * turn).reshape(y.shape[0], -1))
        if not self.bending:
            return np.hstack(out), before[:, self.ends]
        move = half[:, None] ** 2 * (strain @ self.twice.T) + (half[:, None] * self.reach) * start[:, :, None]
        grown = 2.0 * half * start + half**2 * (strain @ self.end_twice)
        if shear is not None:
            move += half[:, None] * (shear @ self.once.T)
            grown = grown + 2.0 * half * shear[:, :, 0]
        at = np.zeros_like(jump)
        at[:, 1:] = np.cumsum(grown, axis=1)
        move += at[:, :-1, None]
        out += [at[:, self.body_nodes] * self.body_move, (self.move * move).reshape(y.shape[0], -1)]
        return np.hstack(out), np.stack([at[:, self.ends], before[:, self.ends]], axis=2).reshape(y.shape[0], -1)

    def loads(self, rows: Array, tip: Array) -> Array:
        """The transpose of `rows`: loads `(b, n)` of forces `(b, r)` and `(b, t)`."""
        b, bodies = rows.shape[0], self.body_nodes.size
        points = bodies + self.turn.size * self.turns
        shape, half = (b, *self.turn.shape), self.half
        moment = np.zeros((b, self.count + 1))  # on each node, before its hinge
        np.add.at(moment.T, self.body_nodes, (rows[:, :bodies] * self.body_turn).T)
        each = 2 if self.bending else 1
        np.add.at(moment.T, self.ends, tip[:, each - 1 :: each].T)
        strain, start = np.zeros((b, self.count, self.functions)), np.zeros((b, self.count))
        if self.turns:
            turn = rows[:, bodies:points].reshape(shape) * self.turn
            strain, start = half[:, None] * (turn @ self.once), np.sum(turn, axis=2)
        shear = None
        if self.bending:
            move = rows[:, points + bodies :].reshape(shape) * self.move
            force = np.zeros((b, self.count + 1))
            np.add.at(force.T, self.body_nodes, (rows[:, points : points + bodies] * self.body_move).T)
            force[:, :-1] += np.sum(move, axis=2)
            np.add.at(force.T, self.ends, tip[:, ::2].T)
            beyond = _beyond(force)
            start = start + half * (move @ self.reach) + 2.0 * half * beyond
            strain += half[:, None] ** 2 * (move @ self.twice + beyond[:, :, None] * self.end_twice)
            if self.shear_scale is not None:
                shear = half[:, None] * (move @ self.once)
                shear[:, :, 0] += 2.0 * half * beyond
        moment[:, :-1] += start
        behind = _beyond(moment)
        strain[:, :, 0] += 2.0 * half * behind
        hinge = np.zeros((b, self.count + 1))
        hinge[:, :-1] = start + behind
        parts = [np.matmul(strain[:, :, None, :], self.scale)[:, :, 0].reshape(b, -1)]
        if shear is not None and self.shear_scale is not None:
            parts.append(np.matmul(shear[:, :, None, :], self.shear_scale)[:, :, 0].reshape(b, -1))
        return np.hstack([*parts, hinge[:, self.hinge_nodes] * self.jumps])

    @cached_property
    def rigid(self) -> Array:
        """`(m, r)` weighted motion of all points per unit motion of the root."""
        turned = np.concatenate([self.body_turn, self.turn.ravel() if self.turns else np.zeros(0)])
        if not self.bending:
            return turned[None]
        x = (self.nodes[:-1, None] + self.half[:, None] * self.reach).ravel()
        move = np.concatenate([self.body_move, self.move.ravel()])
        far = np.concatenate([self.nodes[self.body_nodes], x])
        return np.vstack([np.concatenate([0.0 * turned, move]), np.concatenate([turned, move * far])])

    def shapes(self, values: Array) -> Shapes:
        """The shapes of modes whose weighted motion `(n, r)` is given."""
        x = (self.nodes[:-1, None] + self.half[:, None] * self.reach).ravel()
        at, turn = self.nodes[self.body_nodes], self.turn.ravel() if self.turns else np.zeros(0)
        turned = np.concatenate([self.body_turn, turn])
        places = np.concatenate([at, x[: turn.size]])
        if not self.bending:
            return Shapes(places, turned, 0.0 * turned, values, bending=False)
        moved = np.concatenate([0.0 * turned, self.body_move, self.move.ravel()])
        turned = np.concatenate([turned, np.zeros(at.size + x.size)])
        return Shapes(np.concatenate([places, at, x]), moved, turned, values, bending=True)


def assemble(rows: MotionRows) -> PortModel:
    """The port model of all modes of the discretisation, from the rows written down."""
    elastic, ends = rows.rows(np.eye(rows.size))
    return port_from_rows(rows.rigid.T, elastic.T, ends.T, rows.shapes)


def assemble_lowest(line: MotionRows, wanted: int) -> PortModel:
    """The port model reduced to what its `wanted` lowest modes and root notice."""
    rigid = line.rigid
    tips = np.eye(len(line.ends) * (2 if line.bending else 1))
    any_load = np.random.default_rng(0).standard_normal((1, rigid.shape[1]))  # a mode that root and tip hardly notice
    block = line.loads(np.vstack([rigid, 0.0 * rigid[:1].repeat(len(tips), 0), any_load]), np.vstack([
        np.zeros((len(rigid), len(tips))), tips, np.zeros((1, len(tips))),
    ]))  # fmt: skip
    space, motions, ends = np.zeros((0, line.size)), np.zeros((0, rigid.shape[1])), np.zeros((0, len(tips)))
    before, least = (np.zeros(0), np.zeros(0)), np.inf
    while True:
        for _ in range(LOOK):
            block = _new(space, block)
            if not block.size:
                break
            moved, end = line.rows(block)
            space, motions, ends = np.vstack([space, block]), np.vstack([motions, moved]), np.vstack([ends, end])
            block = line.loads(moved, np.zeros_like(end))
        # what the rows weigh, in as few rows as columns
        r = np.asarray(np.linalg.qr(np.vstack([motions, rigid]).T, mode="r"), dtype=np.float64)
        model = port_from_rows(r[:, len(motions) :], r[:, : len(motions)], ends.T)
        now = model.frequencies[:wanted], model.free_frequencies[:wanted]
        change = _change(before, now)
        stands = change < STILL or 0.3 * least < change < ROUNDED
        if not block.size or (stands and model.modes > 2 * wanted):
            return model
        before, least = now, min(change, least)


def _beyond(values: Array) -> Array:
    """`(b, p)` sums over the nodes behind each piece, of values `(b, p + 1)` at the nodes."""
    return np.cumsum(values[:, :0:-1], axis=1)[:, ::-1]


def _new(space: Array, block: Array) -> Array:
    """Orthonormal rows for what of `block` is not in `space` yet."""
    out: list[Array] = []
    block = block / np.maximum(np.linalg.norm(block, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    for _ in range(2):
        block = block - (block @ space.T) @ space
    for rest in block:
        for _ in range(2):
            for other in out:
                rest = rest - (other @ rest) * other
        left = float(np.linalg.norm(rest))
        if left > DEPENDENT:
            rest = rest / left
            rest = rest - (space @ rest) @ space
            out.append(rest / np.linalg.norm(rest))
    return np.array(out).reshape(len(out), block.shape[1])


def _change(before: tuple[Array, Array], now: tuple[Array, Array]) -> float:
    """Largest relative change of frequencies; infinity where sizes differ."""
    if any(a.size != b.size for a, b in zip(before, now, strict=True)):
        return np.inf
    return max(float(np.max(np.abs(b / a - 1.0), initial=0.0)) for a, b in zip(before, now, strict=True))
