"""The hinge chain: rigid links joined by hinges, with springs on the hinges or on modal tendons;
what MuJoCo simulates."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from beamchain.checks import one_of
from beamchain.errors import RealisationError
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, PORTS, Array, body_mass_matrix, offset_matrix
from beamchain.ports.rows import Rows

#: A degree of freedom of a chain: number of its hinge from 0,
#: and the port in which that hinge moves.
Freedom = tuple[int, str]

STRAIGHT = (0.0, 0.0)
PRINCIPAL = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Link:
    """A rigid link.

    Args:
        start: x of its inner end [m].
        length: [m].
        mass: [kg].
        com: x of its centre of mass [m], from the root.
        inertia: `(Ixx, Iyy, Izz)` about its own centre [kg m^2].
        beside: y and z of its centre of mass [m]; zero for a link of a straight beam.
        products: `(Ixy, Ixz, Iyz)` entries of the inertia matrix about its centre [kg m^2].
    """

    start: float
    length: float
    mass: float
    com: float
    inertia: tuple[float, float, float]
    beside: tuple[float, float] = STRAIGHT
    products: tuple[float, float, float] = PRINCIPAL

    @property
    def centre(self) -> Array:
        """`(3,)` centre of mass from the root [m]."""
        return np.array([self.com, *self.beside])

    def inertia_matrix(self) -> Array:
        """`(3, 3)` about the centre of mass [kg m^2]."""
        (xx, yy, zz), (xy, xz, yz) = self.inertia, self.products
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], dtype=np.float64)

    def mass_matrix(self) -> Array:
        """`(6, 6)` about the root."""
        return body_mass_matrix(self.mass, self.centre, self.inertia_matrix())

    def rows(self) -> Array:
        """`(6, 6)`: weighted velocity of the centre and rate of turn, per root motion."""
        values, axes = np.linalg.eigh(self.inertia_matrix())
        if self.products == PRINCIPAL:
            values = np.array(self.inertia)
            axes = np.eye(3)
        motion = offset_matrix(self.centre)
        turning = np.sqrt(np.maximum(values, 0.0))[:, None] * axes.T
        return np.vstack([np.sqrt(self.mass) * motion[:3], turning @ motion[3:]])


@dataclass(frozen=True)
class Hinge:
    """A hinge between two links at `x` [m].

    Args:
        x: from the root [m].
        stiffness: per port that moves here [N m/rad] ([N/m] for axial); zero:
            its springs are modal tendons.
        damping: per port, plain joint damping [N m s/rad].
    """

    x: float
    stiffness: Mapping[str, float]
    damping: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for port, value in self.stiffness.items():
            one_of("hinge.stiffness", port, PORTS)
            if not value >= 0.0:
                raise RealisationError(
                    f"hinge at x = {self.x:.6g} m: stiffness {port} = {value!r} must not be "
                    "negative."
                )
        object.__setattr__(self, "stiffness", MappingProxyType(dict(self.stiffness)))
        object.__setattr__(self, "damping", MappingProxyType(dict(self.damping)))

    def __reduce__(self) -> tuple[type["Hinge"], tuple[object, ...]]:
        # a proxy cannot be pickled
        return Hinge, (self.x, dict(self.stiffness), dict(self.damping))


def sprung(port: str, x: Array, stiffness: Array) -> tuple[Hinge, ...]:
    """Hinges at `x` `(h,)` [m] that move in one port, on springs."""
    return tuple(Hinge(float(at), {port: float(c)}) for at, c in zip(x, stiffness, strict=True))


@dataclass(frozen=True, eq=False)
class Tendon:
    """A fixed tendon over hinges of the chain: a mode, a filler mode, or inertia alone.

    The length of a modal tendon is the coordinate of its mass-normalised cantilever mode.

    Args:
        label: "mode1_xy", "mode1" where the mode moves several ports, "filler1_xy", "armature1".
        freedoms: hinges it runs over.
        coefficients: `(f,)` one per hinge.
        stiffness: frequency squared [1/s^2].
        damping: `2 zeta w` [1/s].
        armature: inertia along the tendon, in units of the modal mass.
    """

    label: str
    freedoms: tuple[Freedom, ...]
    coefficients: Array
    stiffness: float = 0.0
    damping: float = 0.0
    armature: float = 0.0

    @property
    def is_mode(self) -> bool:
        """Whether it is one of the modes kept."""
        return self.label.startswith("mode")


@dataclass(frozen=True)
class Chain:
    """Links 1..N and the N-1 hinges between them; link 1 is welded to the hub.

    A recipe with a hinge at the root starts with a massless link of no length.

    Args:
        links: from the root outwards.
        hinges: `hinges[i]` joins `links[i]` and `links[i + 1]`.
        length: root to tip [m].
        tendons: modes, where the springs are not on the hinges.
        hung: all links hang on the first, as pendulums, instead of one on the other.
        acceleration: along x, at which pendulums are looked at [m/s^2].
    """

    links: tuple[Link, ...]
    hinges: tuple[Hinge, ...]
    length: float
    tendons: tuple[Tendon, ...] = ()
    hung: bool = False
    acceleration: float = 0.0

    def __post_init__(self) -> None:
        if len(self.hinges) != len(self.links) - 1:
            raise RealisationError(
                f"{len(self.links)} links need {len(self.links) - 1} hinges, not "
                f"{len(self.hinges)}."
            )

    def carrier(self, link: int) -> int:
        """Number of the link that carries link 1, 2, ..., from 0."""
        return 0 if self.hung else link - 1

    def springs(self, hinge: int) -> Mapping[str, float]:
        """Stiffness of a hinge per port; that of a pendulum is its first moment times the
        acceleration [N m/rad]."""
        here = self.hinges[hinge]
        if not self.hung:
            return here.stiffness
        behind = self.links[hinge + 1]
        weight = self.acceleration * behind.mass * (here.x - behind.com)
        return {port: value + weight for port, value in here.stiffness.items()}

    @property
    def ports(self) -> tuple[str, ...]:
        """Ports in which at least one hinge moves."""
        return tuple(
            port for port in PORTS if any(port in hinge.stiffness for hinge in self.hinges)
        )

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return sum(link.mass for link in self.links)

    def rigid_mass(self) -> Array:
        """`(6, 6)` mass matrix of the frozen chain about the root."""
        return np.sum([link.mass_matrix() for link in self.links], axis=0)

    def freedoms(self, ports: Sequence[str] = PORTS) -> tuple[Freedom, ...]:
        """Degrees of freedom in the given ports, hinge by hinge."""
        return tuple(
            (i, p)
            for i, hinge in enumerate(self.hinges)
            for p in PORTS
            if p in ports and p in hinge.stiffness
        )

    def freedom_motion(self, freedom: Freedom) -> Array:
        """`(6,)` motion of the root that moves what hangs behind as the freedom does."""
        hinge, port = freedom
        return offset_matrix(np.array([-self.hinges[hinge].x, 0.0, 0.0])) @ PORT_MOTION[port][:, -1]

    def rows(self, freedoms: Sequence[Freedom]) -> tuple[Array, Array]:
        """Motion rows, rigid `(r, 6)` and elastic `(r, f)` per freedom: `M = rows^T rows`."""
        motions = np.column_stack([np.zeros((6, 0)), *(self.freedom_motion(f) for f in freedoms)])
        behind = np.array([i for i, _ in freedoms], dtype=np.int64)
        own = [link.rows() for link in self.links]
        elastic = [
            rows @ (motions * (behind == k - 1 if self.hung else behind < k))
            for k, rows in enumerate(own)
        ]
        tied = [
            self._along(t, freedoms) * np.sqrt(t.armature) for t in self.tendons if t.armature > 0.0
        ]
        tied = [row for row in tied if np.any(row)]
        return np.vstack([*own, np.zeros((len(tied), 6))]), np.vstack(
            [*elastic, *(row[None] for row in tied)]
        )

    def _along(self, tendon: Tendon, freedoms: Sequence[Freedom]) -> Array:
        """`(f,)` coefficients of a tendon over the given freedoms."""
        known = dict(zip(tendon.freedoms, tendon.coefficients, strict=True))
        return np.array([float(known.get(f, 0.0)) for f in freedoms])

    def spring_rows(self, freedoms: Sequence[Freedom]) -> Array:
        """`(s, f)` with `K = rows^T rows`: roots of the hinges' and tendons' springs."""
        springs = np.array([self.springs(i)[port] for i, port in freedoms])
        on_hinges = np.diag(np.sqrt(springs))[springs > 0.0]
        on_tendons = [
            np.sqrt(t.stiffness) * self._along(t, freedoms)
            for t in self.tendons
            if t.stiffness > 0.0
        ]
        return np.vstack([on_hinges, *(row[None] for row in on_tendons if np.any(row))])

    def stiffness(self, freedoms: Sequence[Freedom]) -> Array:
        """`(f, f)` stiffness matrix over `freedoms`."""
        rows = self.spring_rows(freedoms)
        return rows.T @ rows

    def damping(self, freedoms: Sequence[Freedom]) -> Array:
        """`(f, f)` damping matrix over `freedoms`."""
        out = np.diag([self.hinges[i].damping.get(port, 0.0) for i, port in freedoms])
        for tendon in self.tendons:
            along = self._along(tendon, freedoms)
            out += tendon.damping * np.outer(along, along)
        return out

    def port(self, port: str = "xy") -> PortModel:
        """How the chain pushes back at its root in one port, undamped, others locked."""
        one_of("port", port, PORTS)
        return self.model([port], PORT_MOTION[port])

    def model(self, ports: Sequence[str], motion: Array, *, damped: bool = False) -> PortModel:
        """The port model in motions `(6, m)` of the root with the hinges of some ports loose;
        `damped`: with the dampers of hinges and tendons."""
        freedoms = self.freedoms(ports)
        if not freedoms:
            return PortModel(
                motion.T @ self.rigid_mass() @ motion, np.zeros(0), np.zeros((0, motion.shape[1]))
            )
        tip = offset_matrix(np.array([self.length, 0.0, 0.0]))
        motions = np.column_stack([tip @ self.freedom_motion(f) for f in freedoms])
        return self._seen(freedoms, motion, motion.T @ motions, damped=damped)

    def _seen(
        self, freedoms: Sequence[Freedom], motion: Array, points: Array, *, damped: bool = False
    ) -> PortModel:
        """The port model over some freedoms; `points` `(p, f)`: what is read as its tip."""
        rigid, elastic = self.rows(freedoms)
        rows = Rows(
            rigid @ motion,
            elastic,
            springs=self.spring_rows(freedoms),
            damping=self.damping(freedoms) if damped else None,
            points=points,
        )
        return PortModel.from_rows(rows)

    def shapes(self, port: str) -> Array:
        """`(n, h)` hinge angles of a port in its mass-normalised modes."""
        freedoms = self.freedoms([port])
        shapes = self._seen(freedoms, PORT_MOTION[port], np.eye(len(freedoms))).tip
        assert shapes is not None
        return shapes

    def damped(self, port: str) -> PortModel:
        """`port(...)` with the damping ratios that hinges and tendons give its modes."""
        model = self.model([port], PORT_MOTION[port], damped=True)
        return model.replaced(damping=model.ratios)
