"""The hinge chain: rigid links joined by spring hinges, the thing MuJoCo simulates."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from beamchain.checks import one_of
from beamchain.errors import RealisationError
from beamchain.motion import PORT_MOTION, PORTS, Array
from beamchain.port import PortModel, port_from_rows


@dataclass(frozen=True)
class Link:
    """A rigid link along x.

    Args:
        start: x of its inner end [m].
        length: [m].
        mass: [kg].
        com: x of its centre of mass [m], from the root.
        inertia: principal inertias `(Ixx, Iyy, Izz)` about its own centre [kg m^2].
    """

    start: float
    length: float
    mass: float
    com: float
    inertia: tuple[float, float, float]


@dataclass(frozen=True)
class Hinge:
    """A spring hinge between two links at `x` [m].

    Args:
        x: from the root [m].
        stiffness: per port that bends here [N m/rad] ([N/m] for axial).
        damping: per port, plain joint damping [N m s/rad].
    """

    x: float
    stiffness: Mapping[str, float]
    damping: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for port, value in self.stiffness.items():
            one_of("hinge.stiffness", port, PORTS)
            if not value > 0.0:
                raise RealisationError(f"hinge at x = {self.x:.6g} m: stiffness {port} = {value!r} must be positive.")
        object.__setattr__(self, "stiffness", MappingProxyType(dict(self.stiffness)))
        object.__setattr__(self, "damping", MappingProxyType(dict(self.damping)))

    def __reduce__(self) -> tuple[type["Hinge"], tuple[object, ...]]:
        return Hinge, (self.x, dict(self.stiffness), dict(self.damping))  # a proxy cannot be pickled


@dataclass(frozen=True)
class Chain:
    """Links 1..N and the N-1 hinges between them; link 1 is welded to the hub.

    A recipe with a hinge at the root starts with a massless link of no length.

    Args:
        links: from the root outwards.
        hinges: `hinges[i]` joins `links[i]` and `links[i + 1]`.
        length: root to tip [m].
    """

    links: tuple[Link, ...]
    hinges: tuple[Hinge, ...]
    length: float

    def __post_init__(self) -> None:
        if len(self.hinges) != len(self.links) - 1:
            raise RealisationError(
                f"{len(self.links)} links need {len(self.links) - 1} hinges, not {len(self.hinges)}."
            )

    @property
    def ports(self) -> tuple[str, ...]:
        """Ports in which at least one hinge moves."""
        return tuple(port for port in PORTS if any(port in hinge.stiffness for hinge in self.hinges))

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return sum(link.mass for link in self.links)

    @property
    def centre(self) -> float:
        """x of the centre of mass [m]."""
        return sum(link.mass * link.com for link in self.links) / self.mass

    def rigid_mass(self) -> Array:
        """`(6, 6)` mass matrix of the frozen chain about the root."""
        out = np.zeros((6, 6))
        for link in self.links:
            m, x = link.mass, link.com
            ix, iy, iz = link.inertia
            out += np.diag([m, m, m, ix, iy + m * x**2, iz + m * x**2])
            out[1, 5] += m * x
            out[5, 1] += m * x
            out[2, 4] -= m * x
            out[4, 2] -= m * x
        return out

    def port(self, port: str = "xy") -> PortModel:
        """How the chain pushes back at its root: all its modes in one port, undamped.

        Args:
            port: "xy", "xz", "torsion" or "axial".
        """
        one_of("port", port, PORTS)
        moving = [(i, hinge) for i, hinge in enumerate(self.hinges) if port in hinge.stiffness]
        rigid, elastic = self._rows(port, moving)
        tip_x = self.length
        if port in ("xy", "xz"):
            jumps = np.array([1.0 / np.sqrt(h.stiffness[port]) for _, h in moving])
            arms = np.array([tip_x - h.x for _, h in moving])
            tip = np.vstack([arms * jumps, jumps]) if moving else np.zeros((2, 0))
        else:
            tip = np.array([[1.0 / np.sqrt(h.stiffness[port]) for _, h in moving]])
        if not moving:
            motion = PORT_MOTION[port]
            return PortModel(motion.T @ self.rigid_mass() @ motion, np.zeros(0), np.zeros((0, motion.shape[1])))
        return port_from_rows(rigid, elastic, tip)

    def _rows(self, port: str, moving: list[tuple[int, Hinge]]) -> tuple[Array, Array]:
        """Mass-weighted motion rows of the links; elastic coordinates scaled by the hinges' stiffness."""
        rigid: list[Array] = []
        elastic: list[Array] = []
        for i, link in enumerate(self.links):
            before = np.array([1.0 / np.sqrt(h.stiffness[port]) if j < i else 0.0 for j, h in moving])
            if port in ("xy", "xz"):
                arms = np.array([link.com - h.x for _, h in moving])
                mass, inertia = np.sqrt(link.mass), np.sqrt(link.inertia[2 if port == "xy" else 1])
                rigid += [mass * np.array([1.0, link.com]), inertia * np.array([0.0, 1.0])]
                elastic += [mass * arms * before, inertia * before]
            else:
                weight = np.sqrt(link.inertia[0] if port == "torsion" else link.mass)
                rigid.append(weight * np.ones(1))
                elastic.append(weight * before)
        return np.array(rigid), np.array(elastic)

    def moments(self, port: str, modes: PortModel) -> Array:
        """`(n, h)` hinge moments per unit mass-normalised modal amplitude, hinges that move in `port` only [N m].

        With `psi_k` the hinge angles of mode k, row k is `c * psi_k`: the coefficients of its damping tendon times
        `W_k^2`.

        Args:
            port: "xy", "xz", "torsion" or "axial".
            modes: `port(...)` of this chain, for the signs of its modes.
        """
        moving = [(i, hinge) for i, hinge in enumerate(self.hinges) if port in hinge.stiffness]
        rigid, elastic = self._rows(port, moving)
        u, s, vt = np.linalg.svd(elastic, full_matrices=False)
        signs = np.sign(np.sum((u.T @ rigid) * modes.participation, axis=1))
        roots = np.array([np.sqrt(h.stiffness[port]) for _, h in moving])
        return signs[:, None] * vt / s[:, None] * roots
