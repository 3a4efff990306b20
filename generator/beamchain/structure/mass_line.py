"""How an appendage's mass lies along its axis: what the links of a chain are cut from.

A `Beam` knows it from its segments. Imported modes come with a rigid mass matrix only; `spread` then makes the plainest
positive distribution with those moments. The port does not notice the difference; the links' shares do.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from beamchain.errors import InputError
from beamchain.motion import Array, locked
from beamchain.structure.beam import Beam, Moments
from beamchain.structure.elements import gauss
from beamchain.structure.lump import Lump

STATIONS = 5  # a linear taper's mass per length is quadratic, its polar inertia quartic: five stations are exact


class MassLine(Protocol):
    """What chain-making asks of an appendage."""

    @property
    def length(self) -> float:
        """Root to tip [m]."""
        ...

    @property
    def lumps(self) -> tuple[Lump, ...]:
        """Bodies carried along the way, for drawing."""
        ...

    @property
    def uniform(self) -> bool:
        """One prismatic segment, for which the transcendental solution holds."""
        ...

    def rigid_mass(self) -> Array:
        """`(6, 6)` mass matrix of the frozen appendage about the root."""
        ...

    def moments(self, start: float, end: float, *, closed: bool = False) -> Moments:
        """Moments of the stretch `[start, end)` about the root."""
        ...

    def compliance(self, start: float, end: float, port: str) -> float:
        """Rotation of the stretch per unit moment [rad/(N m)]."""
        ...

    def depth(self, x: float, plane: str) -> float:
        """Extent of the section, for drawing [m]; 0: not known."""
        ...


@dataclass(frozen=True, eq=False)
class Piece:
    """A stretch with smooth densities.

    Args:
        start: [m].
        length: [m].
        densities: `(k, 4)` mass [kg/m], polar inertia and rotary inertia in xy and xz [kg m] at k equally spaced
            stations, both ends included; in between the polynomial through them.
    """

    start: float
    length: float
    densities: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "densities", locked(self.densities))

    def at(self, fraction: Array) -> Array:
        """`(f, 4)` densities at fractions of the length."""
        k = self.densities.shape[0]
        if k == 1:
            return np.repeat(self.densities, fraction.size, axis=0)
        stations = np.linspace(0.0, 1.0, k)
        weights = np.ones((fraction.size, k))
        for i in range(k):
            for j in range(k):
                if j != i:
                    weights[:, i] *= (fraction - stations[j]) / (stations[i] - stations[j])
        return weights @ self.densities


@dataclass(frozen=True, eq=False)
class SpreadMass:
    """A mass line from pieces and points: a `MassLine` without a beam.

    Args:
        length: root to tip [m].
        rigid: `(6, 6)` mass matrix about the root.
        pieces: smooth stretches.
        points: `(p, 5)` x [m], mass [kg], polar and rotary inertia in xy and xz [kg m^2].
        stiffness: per port an average bending or torsion stiffness [N m^2], where a search starts.
    """

    length: float
    rigid: Array
    pieces: tuple[Piece, ...]
    points: Array
    stiffness: Mapping[str, float] = field(default_factory=dict)

    @property
    def lumps(self) -> tuple[Lump, ...]:
        """None are drawn."""
        return ()

    @property
    def uniform(self) -> bool:
        """Never: there is no beam to solve."""
        return False

    def rigid_mass(self) -> Array:
        """`(6, 6)` about the root, as imported."""
        return self.rigid

    def moments(self, start: float, end: float, *, closed: bool = False) -> Moments:
        """Moments of the stretch `[start, end)` about the root; `closed` takes in a point at `end` itself."""
        total = np.zeros(6)
        xi, weights = gauss(6)
        for piece in self.pieces:
            a, b = max(start, piece.start), min(end, piece.start + piece.length)
            if b <= a:
                continue
            x = a + (b - a) * (1.0 + xi) / 2.0
            at = piece.at((x - piece.start) / piece.length)
            w = weights * (b - a) / 2.0
            total += [w @ at[:, 0], w @ (at[:, 0] * x), w @ (at[:, 0] * x**2), *(w @ at[:, 1:])]
        edge = 1e-9 * self.length
        for x, mass, *rotary in self.points:
            if start - edge <= x < end - edge or (closed and x >= end - edge >= start):
                total += [mass, mass * x, mass * x**2, *rotary]
        return Moments(*(float(v) for v in total))

    def compliance(self, start: float, end: float, port: str) -> float:
        """Rotation per unit moment from the average stiffness [rad/(N m)]."""
        return (end - start) / self.stiffness.get(port, 1.0)

    def depth(self, x: float, plane: str) -> float:
        """Not known."""
        del x, plane
        return 0.0


def line_of(beam: Beam) -> tuple[tuple[Piece, ...], Array]:
    """Pieces and points of a beam, exact for linear tapers."""
    pieces: list[Piece] = []
    for x0, segment in zip(beam.starts, beam.segments, strict=True):
        at = segment.at(np.linspace(0.0, 1.0, STATIONS))
        turn = 1.0 if segment.theory == "timoshenko" else 0.0
        pieces.append(
            Piece(x0, segment.length, np.column_stack([at.mass, at.polar, turn * at.rotary_xy, turn * at.rotary_xz]))
        )
    points = [[b.x, b.mass, b.inertia[0], b.inertia[2], b.inertia[1]] for b in beam.lumps]
    return tuple(pieces), np.array(points, dtype=np.float64).reshape(-1, 5)


def default_length(rigid_mass: Array) -> float:
    """Length of the uniform piece with the same centre and radius of gyration along x: a proposal, to be reported."""
    mass, first, second, *_ = _along(rigid_mass)
    centre = first / mass
    return float(centre + np.sqrt(3.0 * max(second / mass - centre**2, 0.0)))


def _along(rigid_mass: Array) -> tuple[float, float, float, float, float, float]:
    """Mass, first and second moment along x, polar inertia, rotary inertia in xy and xz."""
    m = rigid_mass
    first = (m[1, 5] - m[2, 4]) / 2.0
    second = min(m[4, 4], m[5, 5])
    mass = (m[1, 1] + m[2, 2]) / 2.0
    return float(mass), float(first), float(second), float(m[3, 3]), float(m[5, 5] - second), float(m[4, 4] - second)


def spread(rigid_mass: ArrayLike, length: float, stiffness: Mapping[str, float] | None = None) -> SpreadMass:
    """The plainest positive mass distribution over `[0, length]` with the moments of a `(6, 6)` mass matrix.

    As much of it as possible is uniform; what is left sits at the root, at the tip and at one place between.

    Args:
        rigid_mass: about the root, x along the appendage.
        length: [m].
        stiffness: see `SpreadMass`.

    Raises:
        InputError: no such distribution exists, so that length, reference point, axes or units are wrong.
    """
    rigid = np.asarray(rigid_mass, dtype=np.float64)
    mass, first, second, polar, rotary_xy, rotary_xz = _along(rigid)
    c, q = first / mass / length, second / mass / length**2  # on a unit length from here on

    def feasible(share: float) -> bool:
        m, s, j = 1.0 - share, c - share / 2.0, q - share / 3.0
        return m > 0.0 and s >= 0.0 and j <= s + 1e-14 and s * s <= j * m + 1e-14

    if not (0.0 < c < 1.0 and feasible(0.0)):
        raise InputError(
            f"length = {length:.6g} m does not hold the mass: its centre lies at x = {c * length:.6g} m with a radius "
            f"of gyration of {np.sqrt(max(q - c * c, 0.0)) * length:.6g} m; check length, reference (the port), axes "
            "(x from the root outwards) and units."
        )
    low, high = 0.0, 1.0
    if abs(c - 0.5) < 1e-12 and abs(q - 1.0 / 3.0) < 1e-12:
        low = 1.0
    else:
        for _ in range(60):
            middle = (low + high) / 2.0
            low, high = (middle, high) if feasible(middle) else (low, middle)
    points: list[list[float]] = []
    rest = 1.0 - low
    if rest > 1e-12:
        s, j = (c - low / 2.0) / rest, (q - low / 3.0) / rest
        v = max(j - s * s, 0.0)
        root, tip = v / s if s > 0.0 else 0.0, v / (1.0 - s) if s < 1.0 else 0.0
        weights = [(0.0, root), (s, 1.0 - root - tip), (1.0, tip)]
        points = [[x * length, max(w, 0.0) * rest * mass] for x, w in weights if w > 1e-15]
    shares = np.array([polar, rotary_xy, rotary_xz]) / mass
    pieces = (Piece(0.0, length, low * mass / length * np.array([[1.0, *shares]])),) if low > 0.0 else ()
    placed = np.array([[x, w, *(w * shares)] for x, w in points]).reshape(-1, 5)
    return SpreadMass(length, locked(rigid), pieces, locked(placed), dict(stiffness or {}))


def of_line(
    length: float, rigid_mass: Array, pieces: Sequence[Piece], points: Array, stiffness: Mapping[str, float]
) -> SpreadMass:
    """The mass line that a file states.

    Raises:
        InputError: it disagrees with the rigid mass matrix.
    """
    line = SpreadMass(length, locked(rigid_mass), tuple(pieces), locked(points), dict(stiffness))
    have = line.moments(0.0, length, closed=True)
    mass, first, second, *_ = _along(rigid_mass)
    for name, ours, theirs in (("mass", have.mass, mass), ("first moment", have.first, first)):
        if abs(ours / theirs - 1.0) > 1e-6:
            raise InputError(
                f"line: its {name} is {ours:.8g}, but the rigid mass matrix has {theirs:.8g}; leave line out or make "
                "both agree."
            )
    del second
    return line
