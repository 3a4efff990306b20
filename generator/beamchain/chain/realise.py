"""The exact chain: for given modes, the one hinge chain whose root behaves as theirs does.

Block Lanczos on the beam's own root motion; cf. G. M. L. Gladwell, Inverse Problems in Vibration (2nd ed., 2004), on
reconstructing a discrete beam from its spectra. It answers Belonozhko's (2008) closing question, for links with
redistributed mass, in closed form.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from beamchain.chain import polar
from beamchain.chain.chain import Chain, Hinge, Link
from beamchain.errors import RealisationError
from beamchain.port import Array, PortModel
from beamchain.structure.beam import Beam


@dataclass(frozen=True, eq=False)
class Nodes:
    """The canonical planar chain: massless rods between point masses, springs at the inner nodes.

    Args:
        masses: `(N + 1,)` at the nodes, from the root [kg].
        lengths: `(N,)` of the rods [m].
        stiffness: `(N - 1,)` at nodes 1..N-1 [N m/rad].
        excess: `(N,)` rotary inertia of the rods beside their end masses [kg m^2]; None: none.
    """

    masses: Array
    lengths: Array
    stiffness: Array
    excess: Array | None = None

    @property
    def positions(self) -> Array:
        """`(N + 1,)` x of the nodes [m]."""
        return np.concatenate([[0.0], np.cumsum(self.lengths)])


def realise(target: PortModel) -> Nodes:
    """The canonical chain whose port model is `target`.

    Args:
        target: a plane's port model with n flexible modes; gives n + 1 rods.

    Raises:
        RealisationError: a mass, length or stiffness would not be positive, or digits are lost (the message names it).
    """
    n = target.modes
    rows = np.hstack([target.rigid_port_values, target.free_port_values.T])
    if rows.shape[1] != n + 2:
        raise RealisationError(
            "the target's residual mass is singular, so that its chain would need a hinge at the root."
        )
    lam = np.concatenate([[0.0, 0.0], target.free_frequencies**2])
    r, phi = [rows[0]], rows[1]
    masses, lengths, springs = [1.0 / (rows[0] @ rows[0])], [], []
    shear, moment = np.zeros(n + 2), np.zeros(n + 2)
    scale_length = target.rigid_mass[0, 1] / target.rigid_mass[0, 0]
    with np.errstate(all="ignore"):
        for j in range(1, n + 2):
            shear = shear + masses[-1] * lam * r[-1]
            if j > 1:
                springs.append(float(-(moment @ r[-2]) / (phi @ r[-2])))
                phi = phi + moment / springs[-1]
            lengths.append(float(-(r[-1] @ r[-1]) / (phi @ r[-1])))
            nxt = r[-1] + lengths[-1] * phi
            for _ in range(2):
                for old in r[:-1]:
                    nxt = nxt - (nxt @ old) / (old @ old) * old
            r.append(nxt)
            masses.append(float(1.0 / (nxt @ nxt)))
            moment = moment + lengths[-1] * shear
    nodes = Nodes(np.array(masses), np.array(lengths), np.array(springs))
    _check(nodes, scale_length)
    return nodes


def _check(nodes: Nodes, scale_length: float) -> None:
    for name, values, unit in (
        ("length of link", nodes.lengths, "m"),
        ("mass of node", nodes.masses, "kg"),
        ("stiffness of hinge", nodes.stiffness, "N m/rad"),
    ):
        for i, value in enumerate(values):
            if not (np.isfinite(value) and value > 0.0):
                raise RealisationError(
                    f"the exact chain with {nodes.stiffness.size} flexible modes is not physical: {name} "
                    f"{i + (name != 'mass of node')} would be {value:.4g} {unit}. Keep fewer modes, or choose "
                    'another target ("clamped", "free", "hub").'
                )
    if nodes.positions[-1] > 1e6 * scale_length:
        raise RealisationError(
            f"the exact chain with {nodes.stiffness.size} flexible modes is {nodes.positions[-1]:.3g} m long, far "
            f"beyond the appendage (mass centre at {scale_length:.3g} m): too many modes for double precision; "
            "keep fewer."
        )


def split(nodes: Nodes, beam_mass: Array, share: float = 0.02) -> tuple[Array, Array, Array]:
    """Share the inner nodes' masses between their two rods; the port does not notice.

    The natural split gives every link the beam's own mass between its two hinges. Where that would leave a rod with a
    negative end mass (and so a negative inertia), the nearest split that keeps `share` of the node is taken.

    Args:
        nodes: the canonical chain with N rods.
        beam_mass: `(N,)` mass of the beam between the hinges (last: up to the tip) [kg].
        share: least share of a node's mass on either side.

    Returns:
        masses `(N,)` [kg], mass centres `(N,)` from each rod's inner end [m], inertias `(N,)` [kg m^2].
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
    a, b = np.array(inner), np.array(outer)
    mass = a + b
    inertia = a * b / mass * nodes.lengths**2
    if nodes.excess is not None:
        inertia = inertia + nodes.excess
        if np.any(inertia <= 0.0) and share < 0.5:
            return split(nodes, beam_mass, 0.5)  # halves leave each rod the most inertia
        if np.any(inertia <= 0.0):
            raise RealisationError(
                "a link's rotary inertia would be negative; set scene.tip = false or keep other modes."
            )
    return mass, nodes.lengths * b / mass, inertia


def planar_links(nodes: Nodes, beam: Beam) -> list[Link]:
    """Links that cover the real beam, without polar inertia; the same inertia stands in both planes.

    Args:
        nodes: from `realise`.
        beam: gives the mass between the hinges.
    """
    x = nodes.positions
    edges = [*x[:-1].tolist(), max(beam.length, float(x[-1]))]
    own = [beam.moments(a, b, closed=b >= beam.length).mass for a, b in pairwise(edges)]
    mass, com, inertia = split(nodes, np.array(own))
    ends = [*edges[1:-1], beam.length]
    return [
        Link(start=a, length=b - a, mass=float(m), com=float(a + c), inertia=(0.0, float(i), float(i)))
        for a, b, m, c, i in zip(edges[:-1], ends, mass, com, inertia, strict=True)
    ]


def planar_chain(nodes: Nodes, beam: Beam, port: str = "xy") -> Chain:
    """The chain of `nodes` in one bending plane: `planar_links` with the beam's own polar inertia, rigid in torsion.

    Args:
        nodes: from `realise`.
        beam: gives mass and polar inertia between the hinges.
        port: "xy" or "xz".

    Raises:
        RealisationError: the beam is too wide for its length to be a chain of thin links.
    """
    links = planar_links(nodes, beam)
    cuts = nodes.positions[1:-1]
    real = polar.real_polar(beam, cuts)
    _, inertias = polar.place(beam, links, cuts, np.array([real.sum()]), real)
    hinges = tuple(Hinge(x=float(x), stiffness={port: float(c)}) for x, c in zip(cuts, nodes.stiffness, strict=True))
    return Chain(links=tuple(polar.with_polar(links, inertias)), hinges=hinges, length=beam.length)


def realise_scalar(target: PortModel) -> tuple[Array, Array]:
    """The string of inertias and springs whose port model is a scalar `target` (torsion or axial).

    A Stieltjes string (M. G. Krein): positive for any data.

    Args:
        target: port model with one motion and n flexible modes.

    Returns:
        inertias `(n + 1,)` from the root and springs `(n,)` between them.
    """
    n = target.modes
    r = np.concatenate([target.rigid_port_values[0], target.free_port_values[:, 0]])
    lam = np.concatenate([[0.0], target.free_frequencies**2])
    rows = [r]
    inertias, springs = [1.0 / float(r @ r)], []
    torque = inertias[0] * lam * r
    for _ in range(n):
        last = rows[-1]
        springs.append(float((torque @ last) / (last @ last)))
        nxt = last - torque / springs[-1]
        for _ in range(2):
            for old in rows:
                nxt = nxt - (nxt @ old) / (old @ old) * old
        rows.append(nxt)
        inertias.append(1.0 / float(nxt @ nxt))
        torque = torque + inertias[-1] * lam * nxt
    result = np.array(inertias), np.array(springs)
    if not (np.all(result[0] > 0.0) and np.all(result[1] > 0.0)):
        raise RealisationError(f"the string with {n} modes loses its digits; keep fewer modes.")
    return result
