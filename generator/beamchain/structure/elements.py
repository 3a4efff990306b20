"""p-version strain elements: the unknowns are strains (Legendre series in each piece), motion is their integral.

The root's motion and the strains are separate coordinates from the start, so the held root needs no constraint, a
compliant joint is one more strain, Euler's beam is Timoshenko's without the shear strains, and the stiffness is block
diagonal. Its square root (a QR of the strain rows, never a Gram matrix) scales the motion rows, whose singular values
are then 1 / frequency: no digits are lost to the stiffness, however stiff a joint or slender a beam is.

Theory: docs/theory.md, section 2.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander

from beamchain.ports.compose import port_from_rows
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array, locked
from beamchain.ports.shapes import Shapes


@dataclass(frozen=True, eq=False)
class Piece:
    """A smooth stretch of the appendage in one port, sampled at the Gauss points of `[start, start + length]`.

    Args:
        start, length: [m].
        stiffness: `(q,)` EI [N m^2], GJ [N m^2] or EA [N].
        inertia: `(q,)` per length: mass [kg/m] (bending, axial) or polar inertia [kg m] (torsion).
        shear_stiffness: `(q,)` k G A [N]; None: rigid in shear (Euler).
        rotary_inertia: `(q,)` rho I [kg m]; None: none (Euler).
    """

    start: float
    length: float
    stiffness: Array
    inertia: Array
    shear_stiffness: Array | None = None
    rotary_inertia: Array | None = None


@dataclass(frozen=True)
class Hinge:
    """A compliant joint at `x` [m]; `stiffness` [N m/rad] (or [N/m] in axial motion)."""

    x: float
    stiffness: float


@dataclass(frozen=True)
class Body:
    """A rigid body carried at `x` [m]: `mass` [kg] (or polar inertia in torsion), rotary `inertia` [kg m^2]."""

    x: float
    mass: float
    inertia: float = 0.0


def running(k: int, xi: Array) -> Array:
    """`(q, k)`: integral of the Legendre polynomials 0..k-1 from -1 to xi."""
    p = legvander(xi, k)
    out = np.empty((xi.size, k))
    out[:, 0] = xi + 1.0
    for i in range(1, k):
        out[:, i] = (p[:, i + 1] - p[:, i - 1]) / (2 * i + 1)
    return out


def running_twice(k: int, xi: Array) -> Array:
    """`(q, k)`: the integral of `running` from -1 to xi."""
    p = legvander(xi, k + 1)
    out = np.empty((xi.size, k))
    out[:, 0] = 0.5 * (xi + 1.0) ** 2
    if k > 1:
        out[:, 1] = (xi**3 / 3.0 - xi) / 2.0 - 1.0 / 3.0
    for i in range(2, k):
        upper, lower = (p[:, i + 2] - p[:, i]) / (2 * i + 3), (p[:, i] - p[:, i - 2]) / (2 * i - 1)
        out[:, i] = (upper - lower) / (2 * i + 1)
    return out


_END = np.array([1.0])


@dataclass(eq=False)
class _March:
    """Walks from the root outwards: rows of rotation and displacement at the current point."""

    size: int
    bending: bool
    rotation: Array = field(init=False)
    displacement: Array = field(init=False)
    elastic: list[Array] = field(default_factory=list[Array])
    rigid: list[Array] = field(default_factory=list[Array])
    places: list[Array] = field(default_factory=list[Array])
    stations: list[Array] = field(default_factory=list[Array])
    used: int = 0

    def __post_init__(self) -> None:
        self.rotation = np.zeros(self.size)
        self.displacement = np.zeros(self.size)

    def take(self, count: int) -> slice:
        """The next `count` strain coordinates."""
        self.used += count
        return slice(self.used - count, self.used)

    def add(self, weight: Array, rows: Array, rigid: Array, x: Array, *, turns: bool = False) -> None:
        """Inertia `weight` `(q,)` at `x` `(q,)` with motion `rows` per strain coordinate and `rigid` per root motion."""
        root = np.sqrt(weight)
        self.elastic.append(root[:, None] * rows)
        self.rigid.append(root[:, None] * rigid)
        self.places.append(np.column_stack([x, root * (not turns), root * turns]))

    def here(self) -> Array:
        """Motion rows of the current point."""
        return np.vstack([self.displacement, self.rotation]) if self.bending else self.displacement[None]

    def rigid_rows(self, x: Array) -> tuple[Array, Array]:
        """Displacement and rotation at `x` per unit motion of the port."""
        if not self.bending:
            return np.ones((x.size, 1)), np.zeros((x.size, 1))
        return np.column_stack([np.ones_like(x), x]), np.column_stack([np.zeros_like(x), np.ones_like(x)])


def strains(functions: int, xi: Array) -> Array:
    """`(q, functions)` the Legendre polynomials that a piece's strain is made of."""
    return np.asarray(legvander(xi, functions - 1), dtype=np.float64)


def scaled(strain: Array, weight: Array) -> Array:
    """Inverse square root of a piece's stiffness: strain coordinates = `R^-1 y`, strain energy `|y|^2 / 2`.

    Args:
        strain: `(q, k)`.
        weight: `(q,)` of one piece, or `(p, q)` of many.
    """
    r = np.linalg.qr(np.sqrt(weight)[..., None] * strain, mode="r")
    return np.linalg.inv(r)


@cache
def gauss(count: int) -> tuple[Array, Array]:
    """Points in (-1, 1) and weights of the Gauss rule with `count` points, read-only: one rule serves all."""
    points, weights = leggauss(count)
    return locked(points), locked(weights)


def assemble(
    pieces: list[Piece],
    hinges: list[Hinge],
    bodies: list[Body],
    functions: int,
    *,
    bending: bool,
    stations: Sequence[float] = (),
) -> PortModel:
    """The port model of a chain of pieces: all modes of the discretisation, the lowest of them converged.

    Args:
        pieces: from the root outwards, without gaps.
        hinges: compliant joints; each at the end of a piece or at the root.
        bodies: rigid bodies; each at the end of a piece or at the root.
        functions: Legendre polynomials per piece and strain.
        bending: True: displacement and rotation (2 motions); False: torsion or axial (1 motion).
        stations: further points whose motion stands behind the tip's, ascending; each at the end of a piece or the root.
    """
    length = pieces[-1].start + pieces[-1].length
    close = 1e-9 * length
    shear = sum(1 for p in pieces if p.shear_stiffness is not None)
    march = _March(functions * (len(pieces) + shear) + len(hinges), bending)
    q = pieces[0].stiffness.size
    xi, weights = gauss(q)
    strain = strains(functions, xi)
    once, twice = running(functions, xi), running_twice(functions, xi)
    end_twice = running_twice(functions, _END)[0]
    waiting = list(stations)
    waiting_hinges, waiting_bodies = sorted(hinges, key=lambda h: h.x), sorted(bodies, key=lambda b: b.x)

    def stop(x: float) -> None:
        """Bodies and joints at `x`: a body at a joint hangs before it."""
        while waiting_bodies and waiting_bodies[0].x <= x + close:
            body = waiting_bodies.pop(0)
            place = np.array([body.x])
            at, turn = march.rigid_rows(place)
            march.add(np.array([body.mass]), march.displacement[None], at, place)
            if bending and body.inertia > 0.0:
                march.add(np.array([body.inertia]), march.rotation[None], turn, place, turns=True)
        while waiting and waiting[0] <= x + close:
            waiting.pop(0)
            march.stations.append(march.here().copy())
        while waiting_hinges and waiting_hinges[0].x <= x + close:
            column = march.take(1)
            jump = 1.0 / np.sqrt(waiting_hinges.pop(0).stiffness)
            if bending:
                march.rotation[column] += jump
            else:
                march.displacement[column] += jump

    stop(0.0)
    for piece in pieces:
        half = piece.length / 2.0
        columns = march.take(functions)
        scale = scaled(strain, weights * half * piece.stiffness)
        x = piece.start + half * (1.0 + xi)
        at, turn = march.rigid_rows(x)
        if not bending:
            rows = np.tile(march.displacement, (q, 1))
            rows[:, columns] += half * once @ scale
            march.add(weights * half * piece.inertia, rows, at, x)
            march.displacement = march.displacement.copy()
            march.displacement[columns] += half * 2.0 * scale[0]
        else:
            rotation = np.tile(march.rotation, (q, 1))
            rotation[:, columns] += half * once @ scale
            rows = march.displacement + half * (1.0 + xi)[:, None] * march.rotation
            rows[:, columns] += half**2 * twice @ scale
            displacement = march.displacement + 2.0 * half * march.rotation
            displacement[columns] += half**2 * end_twice @ scale
            if piece.shear_stiffness is not None:
                sheared = march.take(functions)
                shear_scale = scaled(strain, weights * half * piece.shear_stiffness)
                rows[:, sheared] += half * once @ shear_scale
                displacement[sheared] += half * 2.0 * shear_scale[0]
            march.add(weights * half * piece.inertia, rows, at, x)
            if piece.rotary_inertia is not None:
                march.add(weights * half * piece.rotary_inertia, rotation, turn, x, turns=True)
            march.rotation = march.rotation.copy()
            march.rotation[columns] += half * 2.0 * scale[0]
            march.displacement = displacement
        stop(piece.start + piece.length)
    x, moved, turned = np.vstack(march.places).T
    return port_from_rows(
        np.vstack(march.rigid), np.vstack(march.elastic), np.vstack([march.here(), *march.stations]),
        lambda values: Shapes(x, moved, turned, values, bending),
    )  # fmt: skip
