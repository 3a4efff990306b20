"""The rigid spacecraft that carries the appendage: its mass matrix about the root,
from the spec and back."""

from typing import Annotated

import numpy as np

from beamchain.checks import Struct, field, number
from beamchain.errors import InputError
from beamchain.ports.motions import PORT_MOTION, Array, body_mass_matrix
from beamchain.structure.mass_line import MassLine
from beamchain.structure.segment import check_body_inertia

Triple = tuple[float, float, float]
ROUNDING = (
    # least inertia over mass x offset^2: below,
    # the mass matrix about the root is singular but for rounding
    1e-14
)


class Hub(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The rigid spacecraft that carries the appendage.

    Example:
        >>> import beamchain as bc
        >>> hub = bc.Hub(mass=500.0, inertia=(400.0, 400.0, 500.0), offset=(1.0, 0.0, 0.0))
        >>> hub.mass_matrix().shape
        (6, 6)
    """

    mass: Annotated[float, field("mass", "kg", above=0.0)]
    inertia: Annotated[
        Triple,
        field(
            "moments of inertia [Ixx, Iyy, Izz] about its centre, in the axes of the appendage",
            "kg m^2",
            above=0.0,
        ),
    ]
    offset: Annotated[
        Triple, field("from its centre to the root, in the axes of the appendage", "m")
    ] = (0.0, 0.0, 0.0)
    products: Annotated[
        Triple,
        field("products of inertia [Ixy, Ixz, Iyz], where those axes are not principal", "kg m^2"),
    ] = (0.0, 0.0, 0.0)
    apparent: Annotated[
        tuple[tuple[float, ...], ...] | None,
        field("6 x 6 mass matrix about the root in place of all that, for a hub with loose joints"),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_body_inertia("inertia", self.inertia)
        arm = self.mass * sum(float(value) ** 2 for value in self.offset)
        if min(self.inertia) < ROUNDING * arm:
            raise InputError(
                f"offset = {list(self.offset)!r} m puts the root so far from the hub's centre that "
                f"the hub's inertia {list(self.inertia)!r} kg m^2 is lost beside mass x offset^2 = "
                f"{arm:.4g} kg m^2 (at least {ROUNDING:g} of it is needed); check the units of "
                "offset (m), mass (kg) and inertia (kg m^2)."
            )
        if self.apparent is not None:
            sizes = [len(row) for row in self.apparent]
            matrix = np.array(
                [[number("apparent", v, "") for v in row] for row in self.apparent if len(row) == 6]
            )
            if (
                sizes != [6] * 6
                or float(np.linalg.eigvalsh(matrix)[0]) <= 0.0
                or np.any(matrix != matrix.T)
            ):
                raise InputError(
                    "apparent must be a symmetric positive definite 6 x 6 matrix [kg, kg m, kg "
                    "m^2]."
                )
        a, b, c = (float(v) for v in np.linalg.eigvalsh(self.inertia_matrix()))
        if a <= 0.0 or c > (a + b) * (1.0 + 1e-9):
            raise InputError(
                f"products = {list(self.products)!r} with inertia = {list(self.inertia)!r} belong "
                f"to no rigid body (principal inertias {a:.6g}, {b:.6g}, {c:.6g}); check signs and "
                "order [Ixy, Ixz, Iyz]."
            )

    def inertia_matrix(self) -> Array:
        """`(3, 3)` inertia about the centre, in appendage axes [kg m^2]."""
        (xx, yy, zz), (xy, xz, yz) = self.inertia, self.products
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=np.float64)

    def mass_matrix(self) -> Array:
        """`(6, 6)` mass matrix about the root, motions (x, y, z, rotations)."""
        if self.apparent is not None:
            return np.array(self.apparent, dtype=np.float64)
        return body_mass_matrix(self.mass, -np.array(self.offset), self.inertia_matrix())

    @classmethod
    def from_mass_matrix(cls, matrix: Array) -> "Hub":
        """The hub with a given `(6, 6)` mass matrix about the root."""
        mass = float(np.mean(np.diag(matrix)[:3]))
        coupling = (matrix[3:, :3] - matrix[:3, 3:]) / 2.0 / mass
        x = coupling[2, 1]
        y = coupling[0, 2]
        z = coupling[1, 0]
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        inertia = matrix[3:, 3:] + mass * cross @ cross
        xx, yy, zz = (float(v) for v in np.diag(inertia))
        return cls(
            mass=mass,
            inertia=(xx, yy, zz),
            offset=(-float(x), -float(y), -float(z)),
            products=(float(inertia[0, 1]), float(inertia[0, 2]), float(inertia[1, 2])),
        )


def port_hub_mass(hub: Array, port: str) -> Array:
    """`(m, m)` the hub's mass matrix as one port sees it: its block of the `(6, 6)` matrix."""
    motion = PORT_MOTION[port]
    return motion.T @ hub @ motion


def default_hub(beam: MassLine) -> Hub:
    """Ten times the appendage's mass, a cube as wide as a tenth of its length, root at a face."""
    mass = 10.0 * beam.rigid_mass()[0, 0]
    side = 0.1 * beam.length
    inertia = max(mass * side**2 / 6.0, 1e-12)
    return Hub(mass=mass, inertia=(inertia, inertia, inertia), offset=(side / 2.0, 0.0, 0.0))


def assumed_hub(line: MassLine) -> str:
    """What is taken for the hub where a specification has none, in a sentence."""
    mass = line.rigid_mass()[0, 0]
    return (
        "no hub is given ([root] hub): errors are the worst on hubs of 0.1, 1 and 10 times the "
        f"appendage's {mass:.4g} kg, and scene.xml has a hub of {default_hub(line).mass:.4g} kg; "
        "beamchain embed reads the hub from your spacecraft."
    )
