"""A beam's plane reduced to its lowest modes on a hub, from finite elements and normal modes of the
tests' own."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, null_space

import beamchain as bc
import finite_elements as fe
from solver import body_mass, normal_modes
from spec_tables import table_of


@dataclass(frozen=True)
class Plane:
    """Rigid mass `(m, m)`, frequencies `(n,)` with the root held and participation `(n, m)`,
    force positive."""

    rigid: np.ndarray
    frequencies: np.ndarray
    participation: np.ndarray

    def on(self, hub: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """Mass and stiffness over the motions of the root and the modes, on a rigid hub `(m, m)`;
        None: nothing there."""
        root = self.rigid if hub is None else self.rigid + hub
        rows = self.participation
        mass = np.block([[root, rows.T], [rows, np.eye(len(rows))]])
        return mass, block_diag(np.zeros_like(root), np.diag(self.frequencies**2))

    def free_frequencies(self, hub: np.ndarray | None = None) -> np.ndarray:
        """`(n,)` with the root free on a hub."""
        shift = self.frequencies.min() * self.frequencies.max()
        return normal_modes(*self.on(hub), shift)[0][len(self.rigid) :]


def positive(rows: np.ndarray, rigid: np.ndarray) -> np.ndarray:
    """The rows with their first number that is not negligible made positive."""
    size = np.sqrt(np.diag(rigid))
    return np.array([row * fe.first_sign(row / size) for row in rows]).reshape(-1, rigid.shape[0])


def reduced(table: dict, port: str, n: int, hub: np.ndarray | None = None) -> Plane:
    """The plane that keeps the `n` lowest modes on a hub `(m, m)`; None: with the root held."""
    found = fe.every_mode(table)
    own, turn = np.array(found.ports) == port, fe.into_space(port)
    w, rows = found.frequencies[own], found.participation[own] @ turn
    whole = Plane(turn.T @ found.rigid @ turn, w, rows)
    if hub is not None:
        mass, stiffness = whole.on(hub)
        m = len(hub)
        _, shapes = normal_modes(mass, stiffness, w[0] * w[n])
        kept = shapes[:, : m + n]
        held = kept @ null_space(kept[:m])
        w, shapes = normal_modes(held.T @ mass @ held, held.T @ stiffness @ held)
        rows = (held @ shapes).T @ mass[:, :m]
    return Plane(whole.rigid, w[:n], positive(rows[:n], whole.rigid))


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
        whole = body_mass(body.mass, [-x for x in body.offset], body.inertia)
        hub = whole[np.ix_([1, 5], [1, 5])]
    return reduced(table_of(beam), port, n, hub)
