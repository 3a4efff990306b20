"""A beam's plane reduced to its lowest modes on a hub,
from finite elements and linear algebra of the tests' own."""

from dataclasses import dataclass

import numpy as np

import beamchain as bc
import finite_elements as fe
from spec_tables import table_of


@dataclass(frozen=True)
class Plane:
    """Rigid mass `(m, m)`, frequencies `(n,)` with the root held and participation `(n, m)`,
    force positive."""

    rigid: np.ndarray
    frequencies: np.ndarray
    participation: np.ndarray

    def free_frequencies(self, hub: np.ndarray | None = None) -> np.ndarray:
        """`(n,)` with the root free on a rigid hub `(m, m)`; None: nothing there."""
        return free_modes(self, hub)[0]


def free_modes(plane: Plane, hub: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies `(n,)` and root motion `(n, m)` of the mass-normalised modes on a hub `(m, m)`.

    With held modal coordinates y / w (strain energy |y|^2 / 2) the mass of the motion that keeps
    the momenta at zero is `1 / w (I - L M^-1 L^T) 1 / w`.
    """
    mass = plane.rigid if hub is None else plane.rigid + hub
    rows = plane.participation / plane.frequencies[:, None]
    inner = np.diag(1.0 / plane.frequencies**2) - rows @ np.linalg.solve(mass, rows.T)
    values, shapes = np.linalg.eigh((inner + inner.T) / 2.0)
    w, shapes = 1.0 / np.sqrt(values[::-1]), shapes[:, ::-1]
    return w, -(np.linalg.solve(mass, rows.T) @ shapes * w).T


def held_modes(rigid: np.ndarray, w: np.ndarray, motion: np.ndarray, hub: np.ndarray) -> Plane:
    """The plane whose modes on a hub are `w` `(n,)` and `motion` `(n, m)`, seen with its root held.

    `W(s) = M^-1 + sum s^2 p p^T / (s^2 + w^2)`: with p0 p0^T = M^-1 the held modes are singular
    vectors of [1 / w, -(p0^-1 p^T) / w].
    """
    root = np.linalg.inv(np.linalg.cholesky(rigid + hub)).T
    held = -np.linalg.solve(root, motion.T) / w
    u, s, _ = np.linalg.svd(np.vstack([np.diag(1.0 / w), held]), full_matrices=False)
    rows = u.T @ np.vstack([np.zeros((w.size, rigid.shape[0])), np.linalg.inv(root)])
    order = np.argsort(1.0 / s)
    return Plane(rigid, (1.0 / s)[order], positive(rows[order], rigid))


def positive(rows: np.ndarray, rigid: np.ndarray) -> np.ndarray:
    """The rows with their first number that is not negligible made positive."""
    size = np.sqrt(np.diag(rigid))
    return np.array([row * fe._sign(row / size) for row in rows]).reshape(-1, rigid.shape[0])


def reduced(table: dict, port: str, n: int, hub: np.ndarray | None = None) -> Plane:
    """The plane that keeps the `n` lowest modes on a hub `(m, m)`; None: with the root held."""
    beam = fe.port(table, port, max(n, 8))
    if hub is None:
        return Plane(beam.rigid, beam.frequencies[:n], beam.participation[:n])
    carried = np.asarray(hub, dtype=float)
    values, vectors = np.linalg.eigh(carried)
    extra = np.sqrt(np.clip(values, 0.0, None))[:, None] * vectors.T
    root = np.vstack([beam.rows.rigid, extra])
    basis, triangle = np.linalg.qr(root)
    elastic = np.vstack([beam.rows.elastic, np.zeros((extra.shape[0], beam.rows.elastic.shape[1]))])
    left = elastic.copy()
    for _ in range(2):
        left = left - basis @ (basis.T @ left)
    _, s, right = np.linalg.svd(left, full_matrices=False)
    w = 1.0 / s[:n]
    motion = -(np.linalg.solve(triangle, basis.T @ elastic @ right[:n].T) * w).T
    return held_modes(beam.rigid, w, motion, carried)


def hub_of(beam: bc.Beam) -> bc.Hub:
    """Twice as heavy as the beam, its centre a tenth of the length behind the root."""
    mass = 2.0 * beam.rigid_mass()[0, 0]
    length = beam.length
    return bc.Hub(
        mass=mass, inertia=(0.19 * mass * length**2,) * 3, offset=(0.1 * length, 0.0, 0.0)
    )


def kept_for(beam: bc.Beam, target: str, n: int, port: str = "xy") -> Plane:
    """The `n` modes of a plane that a target keeps: "clamped", "free",
    or "hub" on `hub_of(beam)`."""
    hub = None
    if target == "free":
        hub = np.zeros((2, 2))
    elif target == "hub":
        body = hub_of(beam)
        mass, x = body.mass, body.offset[0]
        hub = np.array([[mass, -mass * x], [-mass * x, body.inertia[2] + mass * x**2]])
    return reduced(table_of(beam), port, n, hub)
