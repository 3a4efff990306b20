"""How an appendage's mass lies along its axis: what the links of a chain are cut from.

Theory: docs/theory.md, section 4.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import factorial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from beamchain.errors import InputError
from beamchain.import_lock import importing
from beamchain.ports.motions import Array, body_mass_matrix, locked, mean_mass
from beamchain.structure.elements import gauss
from beamchain.structure.settle_modes import MOTIONS

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

FLAT = 1e-9  # of the second moment along x: a spread across it that is negative by less is none
INNER = 0.2  # of the length: no point stands nearer to the root, unless the moments ask for it
STATED = 1e-6  # relative, to which a line that is stated has the rigid mass matrix
GAUSS = 6  # points, exact for densities of the eighth degree times x^2
EDGE = 1e-9  # of the length: a body so near an edge stands at it
NO_MASS = 1e-12  # of the whole: a point or a link with less has none
ROUNDING = 1e-14  # of moments on a unit length and mass
SMOOTH = 0.02  # least share of the smooth part where one is possible: no link is without mass


class Moments(NamedTuple):
    """Mass, first and second moment about the root, polar and rotary inertia, SI."""

    mass: float
    first: float
    second: float
    polar: float
    rotary_xy: float
    rotary_xz: float


def _of_moments() -> Array:
    """`(6, 36)`: the mass matrix about the root of every one of `Moments`."""
    mass, first, second, polar, rotary_xy, rotary_xz = np.zeros((6, 6, 6))
    np.fill_diagonal(mass[:3, :3], 1.0)
    first[1, 5] = first[5, 1] = 1.0
    first[2, 4] = first[4, 2] = -1.0
    second[4, 4] = second[5, 5] = 1.0
    polar[3, 3] = rotary_xz[4, 4] = rotary_xy[5, 5] = 1.0
    return locked(np.stack([mass, first, second, polar, rotary_xy, rotary_xz]).reshape(6, 36))


OF_MOMENTS = _of_moments()


def straight_mass_matrices(moments: Array) -> Array:
    """`(k, 6, 6)` mass matrices about the root of stretches with their mass on the x axis:
    `(k, 6)` as in `Moments`."""
    return (moments @ OF_MOMENTS).reshape(-1, 6, 6)


@dataclass(frozen=True, eq=False)
class MassPiece:
    """A stretch `[start, start + length]` [m] with smooth densities.

    `densities` `(k, 4)`: mass [kg/m], polar and rotary inertia in xy and xz [kg m] at k equally
    spaced stations, both ends included; in between the polynomial through them.
    """

    start: float
    length: float
    densities: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "densities", locked(self.densities))

    @property
    def end(self) -> float:
        """x of its outer end [m]."""
        return self.start + self.length


@dataclass(frozen=True, eq=False)
class MassBesideAxis:
    """Mass beside the x axis: the mean of y and z is linear in x, their covariance constant.

    `lean` `(2, 2)`: value [m] and slope of y, then of z. `covariance` `(2, 2)` [m^2].
    """

    lean: Array
    covariance: Array

    def mass_matrix(self, mass: float, first: float, second: float) -> Array:
        """`(6, 6)` about the root of a stretch with these moments along x."""
        line = np.vstack([[0.0, 1.0], self.lean])  # x, y, z as linear functions of x
        along = np.array([[mass, first], [first, second]])
        # integral of r r^T dm about the root, then about the centre
        moments = line @ along @ line.T
        moments[1:, 1:] += mass * self.covariance
        centre = line @ np.array([mass, first]) / mass if mass > 0.0 else np.zeros(3)
        central = moments - mass * np.outer(centre, centre)
        return body_mass_matrix(mass, centre, inertia=np.trace(central) * np.eye(3) - central)


@dataclass(frozen=True, eq=False)
class MassLine:
    """How an appendage's mass lies along x: what chain-making asks of it.

    Args:
        length: root to tip [m].
        pieces: stretches with smooth densities; those that overlap add up.
        bodies: `(p, 5)` x [m], mass, polar and rotary inertia in xy and xz.
        rigid: `(6, 6)` mass matrix about the root that was stated; None: that of its moments.
        beside: how the mass lies beside the axis; None: on it.
        hinge_lines: per port, x of the compliant joints [m].
        exact: known to rounding, as that of a beam, and not to the digits of a print.
    """

    length: float
    pieces: tuple[MassPiece, ...]
    bodies: Array
    rigid: Array | None = None
    beside: MassBesideAxis | None = None
    hinge_lines: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    exact: bool = False

    def rigid_mass(self) -> Array:
        """`(6, 6)` about the root, as it was stated."""
        return self.whole if self.rigid is None else self.rigid

    @cached_property
    def whole(self) -> Array:
        """`(6, 6)` about the root, of the moments."""
        return locked(self.behind(np.array([-self.length]))[0])

    def times(self, factor: float) -> "MassLine":
        """The same with all mass times a factor."""
        heavier = (replace(piece, densities=piece.densities * factor) for piece in self.pieces)
        return replace(
            self,
            pieces=tuple(heavier),
            bodies=self.bodies * np.array([1.0, *[factor] * 4]),
            rigid=None if self.rigid is None else self.rigid * factor,
        )

    def moments(self, edges: ArrayLike, *, inner: bool = False) -> Array:
        """`(k - 1, 6)` as in `Moments`, of what lies between edges `(k,)` [m], in order.

        A body at an edge counts to the stretch behind it, or with `inner` to the one before it; a
        body at the tip to the last.
        """
        edges = np.asarray(edges, dtype=np.float64)
        near = EDGE * self.length
        limits = edges + near if inner else edges - near
        limits[0] = -np.inf if inner else limits[0]
        limits[-1] = np.inf if edges[-1] >= self.length - near else limits[-1]
        x = self.bodies[:, 0]
        inside = (x >= limits[:-1, None]) & (x < limits[1:, None])
        return self._smooth(edges.clip(0.0, self.length)) + inside @ self._body_moments

    def behind(self, x: Array) -> Array:
        """`(k, 6, 6)` mass matrix about the root of what lies behind each `x` `(k,)` [m];
        a body there hangs before it."""
        hangs = self.bodies[:, 0] > x[:, None] + EDGE * self.length
        smooth = self._integral(self.length - x.clip(0.0, self.length))
        return self.matrices(smooth + hangs @ self._body_moments)

    def matrices(self, moments: Array) -> Array:
        """`(k, 6, 6)` mass matrices about the root of stretches with `moments` `(k, 6)`."""
        if self.beside is None:
            return straight_mass_matrices(moments)
        return np.array([self.beside.mass_matrix(*row[:3]) for row in moments.tolist()])

    @cached_property
    def _body_moments(self) -> Array:
        """`(p, 6)` as in `Moments`."""
        x, mass, *inertias = self.bodies.T
        return np.column_stack([mass, mass * x, mass * x**2, *inertias])

    def _smooth(self, edges: Array) -> Array:
        """`(k - 1, 6)` as in `Moments`, of the smooth part between edges `(k,)` [m]: by Gauss, as
        differences of the integral lose the digits of short stretches."""
        breaks = self.length - self._integral.x
        cuts = np.unique([*edges, *breaks.clip(edges[0], edges[-1])])
        half = np.diff(cuts)[:, None] / 2.0
        xi, weights = gauss(GAUSS)
        values = self._integral(self.length - cuts[:-1, None] - half * (1.0 + xi), 1)
        total = np.zeros((edges.size - 1, 6))
        number = np.searchsorted(edges, cuts[:-1], side="right") - 1
        np.add.at(total, number, np.einsum("kq,kqi->ki", half * weights, values))
        return total

    @cached_property
    def _integral(self) -> "PPoly":
        """`(6,)` as in `Moments`, of the smooth part within a distance of the tip [m]: summed from
        there, where what is small keeps its digits."""
        with importing:
            # late: it takes 20 ms to load
            from scipy.interpolate import PPoly

        ends = [0.0, self.length, *(x for piece in self.pieces for x in (piece.start, piece.end))]
        breaks = np.unique(self.length - np.array(ends))
        order = max((len(piece.densities) for piece in self.pieces), default=1)
        densities = np.zeros((order, breaks.size - 1, 4))
        for piece in self.pieces:
            low, high = self.length - piece.end, self.length - piece.start
            here = np.flatnonzero((breaks[:-1] >= low) & (breaks[1:] <= high))
            k = len(piece.densities)
            # the polynomial through the stations, in powers of the distance from the outer end
            powers = np.vander(np.linspace(high - low, 0.0, k))
            own = PPoly(np.linalg.solve(powers, piece.densities)[:, None], np.array([low, high]))
            for i in range(k):  # by Taylor from the outer end of every interval
                densities[order - 1 - i, here] += own(breaks[here], i) / factorial(i)

        def times_x(polynomial: Array) -> Array:
            """Of the distance from the outer end, which lies at length - break."""
            zero = np.zeros((1, breaks.size - 1))
            at_end = np.vstack([zero, (self.length - breaks[:-1]) * polynomial])
            return at_end - np.vstack([polynomial, zero])

        columns = np.zeros((order + 2, breaks.size - 1, 6))
        columns[2:, :, [0, 3, 4, 5]] = densities
        columns[1:, :, 1] = times_x(densities[:, :, 0])
        columns[:, :, 2] = times_x(columns[1:, :, 1])
        return PPoly(columns, breaks).antiderivative()


def default_length(rigid_mass: Array) -> float:
    """Length [m] of the uniform piece with the same moments along x, or, where that is longer, the
    least on which mass can have them."""
    _, first, second = _moments_along_x(rigid_mass)
    # mass on [0, L] has x (L - x) >= 0 everywhere: first L >= second
    least = second / first if first > 0.0 else 0.0
    return max(uniform_length(rigid_mass), least)


def uniform_length(rigid_mass: Array) -> float:
    """Length [m] of the uniform piece with the same centre and radius of gyration."""
    mass, first, second = _moments_along_x(rigid_mass)
    # a uniform piece from a to b has the centre (a + b) / 2 and the gyration (b - a) / sqrt(12)
    centre = first / mass
    gyration_squared = max(second / mass - centre**2, 0.0)
    return float(centre + np.sqrt(3.0 * gyration_squared))


def _moments_along_x(rigid_mass: Array) -> tuple[float, float, float]:
    """Mass, first and second moment along x."""
    along = _moments_along_axis(rigid_mass)
    beside = _mass_beside_axis(rigid_mass)
    return along.mass, along.first, along.second if beside is None else beside[0]


def _moments_along_axis(rigid_mass: Array) -> Moments:
    """Moments of a body whose mass lies on the x axis but for its polar and rotary inertia."""
    m = rigid_mass
    second = min(m[4, 4], m[5, 5])
    return Moments(
        mass=float((m[1, 1] + m[2, 2]) / 2.0),
        first=float((m[1, 5] - m[2, 4]) / 2.0),
        second=float(second),
        polar=float(m[3, 3]),
        rotary_xy=float(m[5, 5] - second),
        rotary_xz=float(m[4, 4] - second),
    )


def _mass_beside_axis(rigid_mass: Array) -> tuple[float, MassBesideAxis] | None:
    """Second moment along x [kg m^2] and mass beside it; None: no such body."""
    mass = mean_mass(rigid_mass)
    # the block m [c x] of both halves
    cross = (rigid_mass[3:, :3] + rigid_mass[:3, 3:].T) / 2.0 / mass
    differences = [cross[2, 1] - cross[1, 2], cross[0, 2] - cross[2, 0], cross[1, 0] - cross[0, 1]]
    centre = np.array(differences) / 2.0
    # integral of r r^T dm from the inertia J = tr(.) 1 - (.), about the root and about the centre
    inertia = (rigid_mass[3:, 3:] + rigid_mass[3:, 3:].T) / 2.0
    moments = np.trace(inertia) / 2.0 * np.eye(3) - inertia
    central = moments - mass * np.outer(centre, centre)
    second = float(moments[0, 0])
    if central[0, 0] < -FLAT * second:
        return None
    # regression of y and z on x; a body at one x has none
    slope = central[1:, 0] / central[0, 0] if central[0, 0] > FLAT * second else np.zeros(2)
    covariance = central[1:, 1:] / mass - np.outer(slope, slope) * central[0, 0] / mass
    values, vectors = np.linalg.eigh(covariance)
    if values[0] < -FLAT * second / mass:
        return None
    covariance = (vectors * np.maximum(values, 0.0)) @ vectors.T
    lean = np.column_stack([centre[1:] - slope * centre[0], slope])
    return second, MassBesideAxis(locked(lean), locked(covariance))


def _smooth_share(whole: Array, smooth: Array) -> float:
    """Largest share of the smooth part beside which the rest can be a point at the tip and one
    before it.

    `whole`, `smooth`: mass, first and second moment `(3,)` of unit mass on a unit length.
    """

    def share_behind(x: float) -> float:
        """Largest share that leaves neither point nearer to the root than `x`."""
        # sum of m (s - x) (1 - s) >= 0 over points at s
        weights = np.array([-x, 1.0 + x, -1.0])
        return float(weights @ whole / (weights @ smooth))

    # W - share S >= 0, both [mass, first; first, second]: share is below the eigenvalues of
    # L^-1 W L^-T, S = L L^T
    matrix = np.array([[0, 1], [1, 2]])
    scale = np.linalg.inv(np.linalg.cholesky(smooth[matrix]))
    of_masses = float(np.linalg.eigvalsh(scale @ whole[matrix] @ scale.T)[0])
    share = max(0.0, min(of_masses, share_behind(INNER)))
    possible = min(of_masses, share_behind(0.0))
    return max(share, SMOOTH) if possible >= SMOOTH else share


def _two_points(moments: Array) -> list[tuple[float, float]]:
    """Place and mass of a point at the tip of a unit length and of one before it; those without
    mass are left out.

    `moments` `(3,)`: mass, first and second moment of both.
    """
    mass, first, second = moments.tolist()
    if mass <= NO_MASS:
        return []
    # the tip has no part in the sums of m (1 - x) and m x (1 - x)
    short = mass - first
    place = (first - second) / short if short > 0.0 else 1.0
    inner = min(mass, short / (1.0 - place)) if place < 1.0 else 0.0
    return [(x, m) for x, m in ((place, inner), (1.0, mass - inner)) if m > NO_MASS]


def spread_mass(
    rigid_mass: ArrayLike,
    length: float,
    power: int = 0,
) -> MassLine:
    """The plainest positive mass distribution over `[0, length]` [m] with the moments of a
    `(6, 6)` mass matrix.

    The smooth part grows with a power of x; what is left sits at the tip and at
    one place before it.
    """
    rigid = np.asarray(rigid_mass, dtype=np.float64)
    along = _moments_along_axis(rigid)
    mass = along.mass
    beside = _mass_beside_axis(rigid)
    if beside is not None:
        second, across = beside
        yy = across.covariance[0, 0]
        zz = across.covariance[1, 1]
        along = along._replace(
            second=second,
            polar=mass * (yy + zz),
            rotary_xy=mass * yy,
            rotary_xz=mass * zz,
        )
    if along.first <= 0.0:
        raise InputError(
            f"the mass centre lies at x = {along.first / mass:.6g} m, not outwards of the root, so "
            "that no length holds the mass; x must point from the root outwards: check reference "
            "(the port), and if the structure points to -x give axes = [[-1, 0, 0], [0, -1, 0], "
            "[0, 0, 1]]."
        )
    c = along.first / mass / length
    q = along.second / mass / length**2
    if not (0.0 < c <= 1.0 and c**2 - ROUNDING <= q <= c + ROUNDING):
        raise InputError(
            f"length = {length:.6g} m does not hold the mass: its centre lies at x = "
            f"{c * length:.6g} m with a radius of gyration of "
            f"{np.sqrt(max(q - c * c, 0.0)) * length:.6g} m; check length, reference (the port), "
            "axes (x from the root outwards) and units."
        )
    whole = np.array([1.0, c, q])
    smooth = (power + 1.0) / (power + np.array([1.0, 2.0, 3.0]))
    share = _smooth_share(whole, smooth)
    # inertias per mass are those of the whole everywhere
    inertias = np.array([along.polar, along.rotary_xy, along.rotary_xz]) / mass
    pieces: tuple[MassPiece, ...] = ()
    if share > 0.0:
        grown = (power + 1.0) * np.linspace(0.0, 1.0, power + 1) ** power
        densities = share * mass / length * grown[:, None] * np.array([1.0, *inertias])
        pieces = (MassPiece(0.0, length, densities),)
    rows = [
        [place * length, part * mass, *(part * mass * inertias)]
        for place, part in _two_points(whole - share * smooth)
    ]
    return MassLine(
        length,
        pieces,
        locked(np.array(rows).reshape(-1, 5)),
        rigid=locked(rigid),
        beside=None if beside is None else beside[1],
    )


def mass_line_of_pieces(
    length: float,
    rigid_mass: Array,
    *,
    pieces: Sequence[MassPiece],
    points: Array,
) -> MassLine:
    """The mass line that a file states."""
    for piece in pieces:
        if not -EDGE * length <= piece.start < piece.end <= length * (1.0 + EDGE):
            raise InputError(
                f"line: a piece runs from {piece.start:.6g} to {piece.end:.6g} m, but they run "
                f"outwards between the root and the tip at {length:.6g} m; check start and length."
            )
    line = MassLine(length, tuple(pieces), locked(points), rigid=locked(rigid_mass))
    stated = line.whole
    scale = np.sqrt(np.maximum(np.diag(stated), np.diag(rigid_mass)))
    apart = np.abs(stated - rigid_mass) > STATED * np.outer(scale, scale)
    if np.any(apart):
        i, j = (int(k) for k in np.argwhere(apart)[0])
        raise InputError(
            f"line: its mass matrix, with points, has {stated[i, j]:.8g} in ({MOTIONS[i]}, "
            f"{MOTIONS[j]}), but the rigid mass matrix has {rigid_mass[i, j]:.8g}; make both agree "
            "(mass and where it lies, polar, rotary_xy, rotary_xz), or leave line and points out."
        )
    return line
