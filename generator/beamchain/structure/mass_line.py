"""How an appendage's mass lies along its axis: what the links of a chain are cut from.

Theory: docs/theory.md, section 4.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamchain.errors import InputError
from beamchain.ports.motions import Array, body_mass_matrix, locked
from beamchain.structure.beam import Beam, Moments, straight_mass_matrices
from beamchain.structure.elements import gauss
from beamchain.structure.segment import Lump

FLAT = 1e-9  # of the second moment along x: a spread across it that is negative by less is none
INNER = 0.2  # of the length: nearer to the root no point stands, unless the moments leave nothing else


@dataclass(frozen=True, eq=False)
class MassPiece:
    """A stretch `[start, start + length]` [m] with smooth densities.

    `densities` `(k, 4)`: mass [kg/m], polar and rotary inertia in xy and xz [kg m] at k equally spaced stations, both ends
    included; in between the polynomial through them.
    """

    start: float
    length: float
    densities: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "densities", locked(self.densities))

    def at(self, fraction: Array) -> Array:
        """`(f, 4)` densities at fractions of the length."""
        return np.asarray(self._polynomial(fraction), dtype=np.float64)

    @cached_property
    def _polynomial(self) -> Any:
        from scipy.interpolate import KroghInterpolator  # late: 30 ms to load, and few appendages need it

        return KroghInterpolator(np.linspace(0.0, 1.0, len(self.densities)), self.densities)


@dataclass(frozen=True, eq=False)
class Beside:
    """Mass beside the x axis: a mean of y and z linear in x (`lean`, rows: value [m], slope), constant covariance [m^2]."""

    lean: Array
    spread: Array

    def mass_matrix(self, mass: float, first: float, second: float) -> Array:
        """`(6, 6)` about the root of a stretch with these moments along x."""
        line = np.vstack([[0.0, 1.0], self.lean])  # x, y, z as linear functions of x
        along = np.array([[mass, first], [first, second]])
        moments = line @ along @ line.T
        moments[1:, 1:] += mass * self.spread
        centre = line @ np.array([mass, first]) / mass if mass > 0.0 else np.zeros(3)
        about = moments - mass * np.outer(centre, centre)
        return body_mass_matrix(mass, centre, np.trace(about) * np.eye(3) - about)


@dataclass(frozen=True, eq=False)
class SpreadMass:
    """A mass line without a beam: smooth pieces, and points `(p, 5)` with the columns of `Moments`, x first.

    `stiffness`: per port an average bending or torsion stiffness [N m^2], where a search starts.
    """

    length: float
    rigid: Array
    pieces: tuple[MassPiece, ...]
    points: Array
    stiffness: Mapping[str, float] = field(default_factory=dict)
    beside: "Beside | None" = None

    lumps: ClassVar[tuple[Lump, ...]] = ()  # none are drawn

    @property
    def steps(self) -> tuple[float, ...]:
        """x of its points [m]."""
        return tuple(self.points[:, 0].tolist())

    def hinge_lines(self, port: str) -> tuple[float, ...]:
        """None are known."""
        del port
        return ()

    def rigid_mass(self) -> Array:
        """`(6, 6)` about the root, as imported."""
        return self.rigid

    def moments(self, start: float, end: float, *, closed: bool = False) -> Moments:
        """Moments of the stretch `[start, end)` about the root; `closed` takes in a point at `end` itself."""
        edge, at = 1e-9 * self.length, self.points[:, 0]
        inside = (start - edge <= at) & (at < end - edge)
        if closed:
            inside |= at >= end - edge
        return Moments(*self._moments(start, end, inside))

    def _moments(self, start: float, end: float, points: NDArray[np.bool_]) -> list[float]:
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
        for x, mass, *rotary in self.points[points]:
            total += [mass, mass * x, mass * x**2, *rotary]
        return total.tolist()

    def behind(self, x: Array) -> Array:
        """`(k, 6, 6)` mass matrix about the root of what lies behind each `x` `(k,)` [m]; a point there hangs before it."""
        edge, places = 1e-9 * self.length, self.points[:, 0]
        moments = [self._moments(at, self.length, places > at + edge) for at in np.asarray(x).tolist()]
        if self.beside is None:
            return straight_mass_matrices(np.array(moments))
        return np.array([self.beside.mass_matrix(*along[:3]) for along in moments])

    def compliance(self, start: float, end: float, port: str) -> float:
        """Rotation per unit moment from the average stiffness [rad/(N m)]."""
        return (end - start) / self.stiffness.get(port, 1.0)

    def depth(self, x: float, plane: str) -> float:
        """Not known."""
        del x, plane
        return 0.0


#: What chain-making asks of an appendage: how its mass lies along x, whatever it was made from.
MassLine = Beam | SpreadMass


def default_length(rigid_mass: Array) -> float:
    """Length [m] of the uniform piece with the same centre and radius of gyration."""
    mass, first, second, *_ = _along(rigid_mass)
    beside = _beside(rigid_mass)
    second = second if beside is None else beside[0]
    centre = first / mass
    return float(centre + np.sqrt(3.0 * max(second / mass - centre**2, 0.0)))


def _along(rigid_mass: Array) -> tuple[float, float, float, float, float, float]:
    """Mass, first and second moment along x, polar inertia, rotary inertia in xy and xz."""
    m = rigid_mass
    first = (m[1, 5] - m[2, 4]) / 2.0
    mass = (m[1, 1] + m[2, 2]) / 2.0
    second = min(m[4, 4], m[5, 5])
    return float(mass), float(first), float(second), float(m[3, 3]), float(m[5, 5] - second), float(m[4, 4] - second)


def _beside(rigid_mass: Array) -> tuple[float, Beside] | None:
    """Second moment along x [kg m^2] and mass beside it; None: no such body."""
    mass = float(np.trace(rigid_mass[:3, :3])) / 3.0
    coupling = (rigid_mass[3:, :3] + rigid_mass[:3, 3:].T) / 2.0 / mass
    centre = (
        np.array([coupling[2, 1] - coupling[1, 2], coupling[0, 2] - coupling[2, 0], coupling[1, 0] - coupling[0, 1]])
        / 2.0
    )
    about = (rigid_mass[3:, 3:] + rigid_mass[3:, 3:].T) / 2.0
    moments = np.trace(about) / 2.0 * np.eye(3) - about
    own = moments - mass * np.outer(centre, centre)
    if own[0, 0] <= 0.0:
        return None
    slope = own[1:, 0] / own[0, 0]
    spread = own[1:, 1:] / mass - np.outer(slope, slope) * own[0, 0] / mass
    values, vectors = np.linalg.eigh(spread)
    size = float(moments[0, 0]) / mass
    if values[0] < -FLAT * size:
        return None
    spread = (vectors * np.maximum(values, 0.0)) @ vectors.T
    lean = np.column_stack([centre[1:] - slope * centre[0], slope])
    return float(moments[0, 0]), Beside(locked(lean), locked(spread))


def spread(
    rigid_mass: ArrayLike, length: float, stiffness: Mapping[str, float] | None = None, power: int = 0
) -> SpreadMass:
    """The plainest positive mass distribution over `[0, length]` [m] with the moments of a `(6, 6)` mass matrix.

    The smooth part grows with a power of x; what is left sits at the tip and at one place before it.
    """
    rigid = np.asarray(rigid_mass, dtype=np.float64)
    mass, first, second, polar, rotary_xy, rotary_xz = _along(rigid)
    beside = _beside(rigid)
    if beside is not None:
        second = beside[0]
        yy, zz = beside[1].spread[0, 0], beside[1].spread[1, 1]
        polar, rotary_xy, rotary_xz = mass * (yy + zz), mass * yy, mass * zz
    c, q = first / mass / length, second / mass / length**2  # on a unit length from here on

    smooth_first, smooth_second = (power + 1.0) / (power + 2.0), (power + 1.0) / (power + 3.0)

    def feasible(share: float) -> bool:
        m, s, j = 1.0 - share, c - share * smooth_first, q - share * smooth_second
        return m > 0.0 and s >= 0.0 and j <= s + 1e-14 and s * s <= j * m + 1e-14

    if not (0.0 < c < 1.0 and feasible(0.0)):
        raise InputError(
            f"length = {length:.6g} m does not hold the mass: its centre lies at x = {c * length:.6g} m with a radius "
            f"of gyration of {np.sqrt(max(q - c * c, 0.0)) * length:.6g} m; check length, reference (the port), axes "
            "(x from the root outwards) and units."
        )

    def near(share: float) -> float:
        """Where the inner of two points stands that carry the rest with the tip."""
        m, s, j = 1.0 - share, c - share * smooth_first, q - share * smooth_second
        return (s - j) / (m - s) if m > s else 1.0

    low, high, inner = 0.0, 1.0, min(INNER, near(0.0))
    if abs(c - smooth_first) < 1e-12 and abs(q - smooth_second) < 1e-12:
        low = 1.0
    else:
        for _ in range(60):
            middle = (low + high) / 2.0
            good = feasible(middle) and near(middle) >= inner
            low, high = (middle, high) if good else (low, middle)
    points: list[list[float]] = []
    rest = 1.0 - low
    if rest > 1e-12:
        s, x = (c - low * smooth_first) / rest, near(low)
        a = (1.0 - s) / (1.0 - x) if x < 1.0 else 0.0
        points = [[at * length, max(w, 0.0) * rest * mass] for at, w in ((x, a), (1.0, 1.0 - a)) if w > 1e-15]
    shares = np.array([polar, rotary_xy, rotary_xz]) / mass
    grown = (power + 1.0) * np.linspace(0.0, 1.0, power + 1) ** power if power else np.ones(1)
    density = low * mass / length * grown[:, None] * np.array([1.0, *shares])
    pieces = (MassPiece(0.0, length, density),) if low > 0.0 else ()
    placed = np.array([[x, w, *(w * shares)] for x, w in points]).reshape(-1, 5)
    return SpreadMass(
        length, locked(rigid), pieces, locked(placed), dict(stiffness or {}), None if beside is None else beside[1]
    )


def of_line(
    length: float, rigid_mass: Array, pieces: Sequence[MassPiece], points: Array, stiffness: Mapping[str, float]
) -> SpreadMass:
    """The mass line that a file states."""
    line = SpreadMass(length, locked(rigid_mass), tuple(pieces), locked(points), dict(stiffness))
    have = line.moments(0.0, length, closed=True)
    mass, first, *_ = _along(rigid_mass)
    for name, ours, theirs in (("mass", have.mass, mass), ("first moment", have.first, first)):
        if abs(ours / theirs - 1.0) > 1e-6:
            raise InputError(
                f"line: its {name} is {ours:.8g}, but the rigid mass matrix has {theirs:.8g}; leave line out or make "
                "both agree."
            )
    return line
