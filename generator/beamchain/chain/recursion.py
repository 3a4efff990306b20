"""The exact chain: for given modes, the one hinge chain whose root behaves as theirs does.

Block Lanczos on the beam's own root motion; cf. G. M. L. Gladwell, Inverse Problems in Vibration
(2nd ed., 2004), on reconstructing a discrete beam from its spectra. It answers Belonozhko's (2008)
closing question, for links with redistributed mass, in closed form.

Theory: docs/theory.md, section 3.
"""

from dataclasses import dataclass, replace
from math import fsum

import numpy as np

from beamchain.chain.chain import Chain, Link, sprung
from beamchain.chain.links import rigid_in_torsion
from beamchain.errors import RealisationError
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array
from beamchain.structure.mass_line import MassLine

NO_MASS = 1e-12  # of the rigid mass: less is none
NEAR_ROOT = 1e-9  # of the distance of the mass centre: a hinge closer to the root stands at it


@dataclass(frozen=True, eq=False)
class Nodes:
    """The canonical planar chain: massless rods between point masses, springs at the inner nodes.

    `masses` `(N + 1,)` from the root [kg], the first 0: a hinge at the root or a massless first
    rod; `lengths` `(N,)` of the rods [m], the first may be 0 then; `stiffness` `(N - 1,)` at
    nodes 1..N-1 [N m/rad].
    """

    masses: Array
    lengths: Array
    stiffness: Array

    @property
    def positions(self) -> Array:
        """`(N + 1,)` x of the nodes [m]."""
        return np.concatenate([[0.0], np.cumsum(self.lengths)])


def realise(target: PortModel) -> Nodes:
    """The canonical chain whose port model is `target`, a plane's with n modes: n + 1 rods.

    Where its residual mass is singular (all mass of the root moves with the kept modes in one
    direction), the first rod is massless. Refused where a mass, length or stiffness would not be
    positive, or digits are lost.
    """
    n = target.modes
    rows = np.hstack([target.rigid_port_values, target.free_port_values.T])
    lam = np.concatenate([[0.0, 0.0], target.free_frequencies**2])
    scale_length = target.rigid_mass[0, 1] / target.rigid_mass[0, 0]
    if rows.shape[1] == n + 1:
        nodes = _with_root_hinge(target, rows, lam)
    elif rows.shape[1] == n + 2:
        nodes = Nodes(*_rods(rows[0], rows[1], lam, n + 1))
    else:
        raise RealisationError(
            f"with {n} modes no residual mass is left at the root in either direction, where a "
            "chain needs one; keep fewer modes, or give the rigid mass with that of the clamped "
            "nodes."
        )
    _check(nodes, scale_length)
    return _with_mass(nodes, float(target.rigid_mass[0, 0]))


def _with_mass(nodes: Nodes, mass: float) -> Nodes:
    """The nodes with the rigid mass for their sum: the heaviest takes what rounding left of it."""
    masses = nodes.masses.copy()
    masses[np.argmax(masses)] += mass - fsum(masses)
    return replace(nodes, masses=masses)


def _rods(r: Array, phi: Array, lam: Array, count: int) -> tuple[Array, Array, Array]:
    """Masses `(count + 1,)`, lengths `(count,)`, springs `(count - 1,)` from a node."""
    nodes = [r]
    masses = [float(1.0 / (r @ r))]
    lengths = list[float]()
    springs = list[float]()
    shear = np.zeros(r.size)
    moment = np.zeros(r.size)
    with np.errstate(all="ignore"):
        for j in range(1, count + 1):
            shear = shear + masses[-1] * lam * nodes[-1]
            if j > 1:
                springs.append(float(-(moment @ nodes[-2]) / (phi @ nodes[-2])))
                phi = phi + moment / springs[-1]
            lengths.append(float(-(nodes[-1] @ nodes[-1]) / (phi @ nodes[-1])))
            nxt = nodes[-1] + lengths[-1] * phi
            for _ in range(2):
                for old in nodes[:-1]:
                    nxt = nxt - (nxt @ old) / (old @ old) * old
            nodes.append(nxt)
            masses.append(float(1.0 / (nxt @ nxt)))
            moment = moment + lengths[-1] * shear
    return np.array(masses), np.array(lengths), np.array(springs)


def _with_root_hinge(target: PortModel, rows: Array, lam: Array) -> Nodes:
    """The chain of a target whose residual mass is that of a point at `x0`:
    the first rod is massless and ends there.

    The hinge's stiffness is what resists at high frequency along `v = (-x0, 1)`:
    `c_1 = sum W_k^2 (L_k v)^2`.
    """
    residual = target.residual_mass
    reach = abs(float(target.rigid_mass[0, 1] / target.rigid_mass[0, 0]))
    if residual[0, 0] <= NO_MASS * target.rigid_mass[0, 0]:
        raise RealisationError(
            "all mass at the root moves with the modes kept, so that its displacement meets no "
            "mass; keep fewer modes, or give the rigid mass with that of the clamped nodes."
        )
    x0 = float(residual[0, 1] / residual[0, 0])
    if x0 < -NEAR_ROOT * reach:
        raise RealisationError(
            f"the exact chain would need a hinge at x = {x0:.4g} m, before the root; keep fewer "
            "modes, or check the reference point."
        )
    x0 = x0 if x0 > NEAR_ROOT * reach else 0.0
    moments = target.participation @ np.array([-x0, 1.0])
    stiffness = float(np.sum((target.frequencies * moments) ** 2))
    masses, lengths, springs = _rods(rows[0] + x0 * rows[1], rows[1], lam, target.modes)
    return Nodes(
        np.concatenate([[0.0], masses]),
        np.concatenate([[x0], lengths]),
        np.concatenate([[stiffness], springs]),
    )


def _check(nodes: Nodes, scale_length: float) -> None:
    for name, values, unit in (
        ("length of link", nodes.lengths, "m"),
        ("mass of node", nodes.masses, "kg"),
        ("stiffness of hinge", nodes.stiffness, "N m/rad"),
    ):
        for i, value in enumerate(values):
            if i == 0 and value == 0.0 and nodes.masses[0] == 0.0:
                continue  # a hinge at the root
            if not (np.isfinite(value) and value > 0.0):
                raise RealisationError(
                    f"the exact chain with {nodes.stiffness.size} flexible modes is not physical: "
                    f"{name} "
                    f"{i + (name != 'mass of node')} would be {value:.4g} {unit}. Keep fewer "
                    "modes, or choose "
                    'another target ("clamped", "free", "hub").'
                )
    if nodes.positions[-1] > 1e6 * scale_length:
        raise RealisationError(
            f"the exact chain with {nodes.stiffness.size} flexible modes is "
            f"{nodes.positions[-1]:.3g} m long, far beyond the appendage (mass centre at "
            f"{scale_length:.3g} m): too many modes for double precision; keep fewer."
        )


def split(nodes: Nodes, beam_mass: Array, share: float = 0.02) -> tuple[Array, Array, Array]:
    """Share the inner nodes' masses between their two rods,
    each link with the beam's own mass `(N,)` where that can be.

    Returns masses [kg], mass centres from each rod's inner end [m] and inertias
    [kg m^2], all `(N,)`.
    """
    inner, outer = [nodes.masses[0]], []
    count = nodes.lengths.size
    for j in range(count):
        node = nodes.masses[j + 1]
        if j == count - 1:
            outer.append(node)
            break
        outer.append(float(np.clip(beam_mass[j] - inner[j], share * node, (1.0 - share) * node)))
        inner.append(node - outer[j])
    a = np.array(inner)
    b = np.array(outer)
    mass = a + b
    return mass, nodes.lengths * b / mass, a * b / mass * nodes.lengths**2


def planar_links(nodes: Nodes, beam: MassLine) -> list[Link]:
    """Links that cover the real beam, without polar inertia, alike in both planes."""
    x = nodes.positions
    edges = [*x[:-1].tolist(), max(beam.length, float(x[-1]))]
    mass, com, inertia = split(nodes, beam.moments(edges)[:, 0])
    ends = [*edges[1:-1], beam.length]
    return [
        Link(
            start=a,
            length=b - a,
            mass=float(m),
            com=float(a + c),
            inertia=(0.0, float(i), float(i)),
        )
        for a, b, m, c, i in zip(edges[:-1], ends, mass, com, inertia, strict=True)
    ]


def planar_chain(nodes: Nodes, beam: MassLine, port: str = "xy") -> Chain:
    """The chain of `nodes` in one bending plane: `planar_links` with the beam's own polar inertia,
    rigid in torsion."""
    cuts = nodes.positions[1:-1]
    links = rigid_in_torsion(beam, planar_links(nodes, beam), cuts)
    return Chain(tuple(links), sprung(port, cuts, nodes.stiffness), beam.length)


def realise_scalar(target: PortModel) -> tuple[Array, Array]:
    """Inertias `(n + 1,)` and springs `(n,)` of a scalar target: a Stieltjes string."""
    n = target.modes
    r = np.concatenate([target.rigid_port_values[0], target.free_port_values[:, 0]])
    lam = np.concatenate([[0.0], target.free_frequencies**2])
    rows = [r]
    inertias = [1.0 / float(r @ r)]
    springs = []
    torque = inertias[0] * lam * r
    finite = r.size - 1
    for _ in range(finite):
        last = rows[-1]
        springs.append(float((torque @ last) / (last @ last)))
        nxt = last - torque / springs[-1]
        for _ in range(2):
            for old in rows:
                nxt = nxt - (nxt @ old) / (old @ old) * old
        rows.append(nxt)
        inertias.append(1.0 / float(nxt @ nxt))
        torque = torque + inertias[-1] * lam * nxt
    if finite < n:  # no residual inertia: a massless root on a spring, D -> -sum W_k^2 L_k^2 / s^2
        inertias.insert(0, 0.0)
        springs.insert(0, float(np.sum((target.frequencies * target.participation[:, 0]) ** 2)))
    result = np.array(inertias), np.array(springs)
    if not (np.all(result[0][finite < n :] > 0.0) and np.all(result[1] > 0.0)):
        raise RealisationError(f"the string with {n} modes loses its digits; keep fewer modes.")
    return result
