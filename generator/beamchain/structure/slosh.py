"""`[slosh]` of SPEC.toml: the liquid in a cylindrical tank, as pendulums beside a fixed mass.

Linear potential flow in a cylinder of radius R, filled to the height h, x along its axis from the
bottom. With the surface locked the liquid moves as the Stokes-Joukowski potential of the walls
says, which gives the rigid mass matrix: mass m at h/2, and about that point across the axis

    I = m (h^2/12 - 3 R^2/4 + 16 R^3/h sum tanh(xi_n h/2R) / (xi_n^3 (xi_n^2 - 1)))

(xi_n: the zeros of J1'), and none about the axis, since an inviscid liquid is not dragged along.
Every lateral mode of the surface is a pendulum of mass m_n and length L_n whose mass stands at h_n:

    w_n^2 = a / L_n,   L_n = R / (xi_n tanh(xi_n h/R)),   h_n = h - 2R/xi_n tanh(xi_n h/2R),
    m_n / m = 2 R tanh(xi_n h/R) / (xi_n h (xi_n^2 - 1)).

The fixed mass is what the kept pendulums leave of the rigid mass matrix, so that force and moment
at low frequency are those of all modes.

Source: H. N. Abramson (ed.), The Dynamic Behavior of Liquids in Moving Containers, NASA SP-106
(1966); F. T. Dodge, The New "Dynamic Behavior of Liquids in Moving Containers" (2000).

Theory: docs/theory.md, section 11.
"""

from functools import cache
from typing import Annotated, Literal, NamedTuple

import numpy as np
from scipy.special import jnp_zeros

from beamchain.checks import Struct, field
from beamchain.errors import InputError
from beamchain.ports.motions import UPRIGHT, Array, Quaternion, body_mass_matrix, locked
from beamchain.structure.mass_line import MassLine, MassPiece
from beamchain.structure.modal_data import ModalData

FEWEST = 2  # lateral modes of a plane that become pendulums, unless the specification says
MOST = 6  # as many at most
KNOWN = 12  # that the reference has
SHALLOWEST, DEEPEST = 0.01, 100.0  # of the liquid's height over the radius
TERMS = 1000  # of the series of the inertia: the rest is below 1e-15 of its sum


#: Attitude of the tank on its place, as a quaternion, by the axis of the place that the tank's x
#: is: x, y and z of the tank are z, x and y of the place, say; against an axis y is reversed too.
TURNS = {
    "x": UPRIGHT,
    "y": (0.5, 0.5, 0.5, 0.5),
    "z": (0.5, -0.5, -0.5, -0.5),
    "-x": (0.0, 0.0, 0.0, 1.0),
    "-y": (0.5, -0.5, 0.5, -0.5),
    "-z": (0.5, -0.5, 0.5, 0.5),
}


class Slosh(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The liquid in a tank, in place of [[segment]]: the root is the centre of the tank's bottom.

    In the appendage's own axes x is the axis of the tank, and an acceleration along +x presses the
    liquid onto the bottom; `axis` says which axis of the place that is.

    Example:
        >>> import beamchain as bc
        >>> water = bc.spec.Slosh(
        ...     shape="cylinder",
        ...     radius=0.5,
        ...     height=1.0,
        ...     density=1000.0,
        ...     ratio=0.005,
        ...     acceleration=0.1,
        ... )
        >>> water.axis
        'x'
    """

    shape: Annotated[Literal["cylinder"], field("shape of the tank")]
    radius: Annotated[float, field("radius of the tank", "m", above=0.0)]
    height: Annotated[float, field("height of the liquid in the tank", "m", above=0.0)]
    density: Annotated[float, field("density of the liquid", "kg/m^3", above=0.0)]
    ratio: Annotated[
        float, field("damping ratio of the lateral modes at `acceleration`", "", above=0.0)
    ]
    acceleration: Annotated[
        float,
        field(
            "acceleration along the axis, of thrust or gravity, at which `ratio` holds and the "
            "frequencies are listed",
            "m/s^2",
            above=0.0,
        ),
    ]
    axis: Annotated[
        Literal["x", "y", "z", "-x", "-y", "-z"],
        field(
            "axis of the place, a site or body, that points from the tank's bottom to the surface"
        ),
    ] = "x"
    modes: Annotated[
        int | None,
        field(
            "lateral modes of each plane that become pendulums; 2 where left out, or more where "
            "the tolerance of a scene on a spacecraft needs them",
            "",
            least=1,
            most=MOST,
        ),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.ratio < 1.0:
            raise InputError(
                f"ratio = {self.ratio!r} is not an oscillation; damping ratios lie between 0 and 1 "
                "(0.005 is usual of a smooth tank, 0.05 with baffles)."
            )
        if not SHALLOWEST <= self.height / self.radius <= DEEPEST:
            raise InputError(
                f"height = {self.height!r} m is {self.height / self.radius:.3g} times the radius "
                f"of {self.radius!r} m; liquids of {SHALLOWEST:g} to {DEEPEST:g} radii are taken: "
                "check the units."
            )

    @property
    def kept(self) -> int:
        """Lateral modes of each plane that become pendulums."""
        return FEWEST if self.modes is None else self.modes

    @property
    def turn(self) -> Quaternion:
        """Attitude of the tank, x along its axis, on its place: a quaternion."""
        return TURNS[self.axis]

    @property
    def mass(self) -> float:
        """Of the liquid [kg]."""
        return float(np.pi * self.radius**2 * self.height * self.density)

    def pendulums(self, count: int = KNOWN) -> "Pendulums":
        """The first lateral modes of a plane.

        Args:
            count: of modes; as many as the reference has where left out.
        """
        radius, height = self.radius, self.height
        xi = _zeros()[:count]
        tilted = np.tanh(xi * height / radius)
        return Pendulums(
            masses=self.mass * 2.0 * radius * tilted / (xi * height * (xi**2 - 1.0)),
            lengths=radius / (xi * tilted),
            heights=height - 2.0 * radius / xi * np.tanh(xi * height / (2.0 * radius)),
        )

    def frequencies(self, acceleration: float | None = None) -> Array:
        """`(n,)` of the lateral modes of a plane at an acceleration [m/s^2], the stated one where
        left out [rad/s]."""
        return np.sqrt((acceleration or self.acceleration) / self.pendulums().lengths)

    @property
    def inertia(self) -> float:
        """Of the liquid under a locked surface, about its centre, across the axis [kg m^2]."""
        radius, height = self.radius, self.height
        xi = _zeros()
        series = np.sum(np.tanh(xi * height / (2.0 * radius)) / (xi**3 * (xi**2 - 1.0)))
        return float(
            self.mass * (height**2 / 12.0 - 0.75 * radius**2 + 16.0 * radius**3 / height * series)
        )

    def rigid_mass(self) -> Array:
        """`(6, 6)` of the liquid under a locked surface, about the bottom's centre."""
        across = self.inertia
        centre = np.array([self.height / 2.0, 0.0, 0.0])
        return body_mass_matrix(self.mass, centre, np.diag([0.0, across, across]))

    def participation(self) -> Array:
        """`(2 n, 6)` rows of the mass-normalised modes, the planes xy and xz by turns."""
        parts = self.pendulums()
        rows = np.zeros((2 * KNOWN, 6))
        root = np.sqrt(parts.masses)
        rows[0::2, 1], rows[0::2, 5] = root, root * parts.heights
        rows[1::2, 2], rows[1::2, 4] = root, -root * parts.heights
        return rows

    def data(self) -> ModalData:
        """The lateral modes at the stated acceleration, without the moment of the liquid's weight
        as it moves aside."""
        frequencies = np.repeat(self.frequencies(), 2)
        return ModalData(
            rigid_mass=self.rigid_mass(),
            frequencies=frequencies,
            participation=self.participation(),
            damping=np.full(frequencies.size, self.ratio),
            length=self.height,
            source="liquid in a cylinder",
            printed=False,
        )

    def line(self) -> MassLine:
        """How the liquid lies along the axis."""
        rotary = (self.inertia - self.mass * self.height**2 / 12.0) / self.height
        densities = np.array([self.mass / self.height, 0.0, rotary, rotary])
        whole = MassPiece(0.0, self.height, densities[None])
        return MassLine(self.height, (whole,), np.zeros((0, 5)), rigid=locked(self.rigid_mass()))


class Pendulums(NamedTuple):
    """Lateral modes as pendulums, `(n,)` each: masses [kg], lengths [m], and the heights at which
    the masses stand [m]; a pivot is a length above its mass."""

    masses: Array
    lengths: Array
    heights: Array

    @property
    def pivots(self) -> Array:
        """Heights of the pivots [m]."""
        return self.heights + self.lengths


@cache
def _zeros() -> Array:
    """Zeros of J1'."""
    return locked(np.asarray(jnp_zeros(1, TERMS), dtype=np.float64))
