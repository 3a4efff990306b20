"""The pendulums that have the lateral modes of a tank's liquid."""

import numpy as np

from beamchain.chain.chain import Chain, Hinge, Link
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array
from beamchain.structure.slosh import Slosh
from beamchain.warning_codes import Caution

BALL = 1e-3  # of a pendulum's length: by as much its mass centre is nearer to the pivot
# of a pendulum's inertia across the axis, that about it: a moving body has some in MuJoCo
ROLL = 1e-6
LEAST = 2e-15  # kg m^2, above MuJoCo's mjMINVAL
HEAVIEST = 1e7  # kg: more is in no tank
MANY = 100.0  # times the mass of the spacecraft that carries it
PLANES = ("xy", "xz")


def heavy(liquid: Slosh, base: float | None) -> list[str]:
    """The warning for a liquid that is probably in other units.

    `base`: mass of the rigid spacecraft that carries it [kg]; None where none is known.
    """
    mass = float(liquid.rigid_mass()[0, 0])
    many = "" if base is None else f", {mass / base:.3g} times the {base:.4g} kg that carry it"
    if mass <= HEAVIEST and (base is None or mass <= MANY * base):
        return []
    text = (
        f"the liquid of slosh.radius = {liquid.radius:g} m and slosh.height = {liquid.height:g} m "
        f"has {mass:.3g} kg{many}; if mm were meant, write radius = {liquid.radius * 1e-3:g} and "
        f"height = {liquid.height * 1e-3:g}."
    )
    return [Caution("heavy-liquid", text)]


def weightless(where: str) -> Caution:
    """The warning for a liquid that nothing presses onto the bottom."""
    return Caution(
        "slosh-weightless",
        f"{where}: without thrust or gravity along its axis the liquid's pendulums have no "
        "stiffness and drift, and what a liquid does then, by surface tension, is not in the "
        "model; simulate and linearise it under a thrust or gravity.",
    )


def pendulum_chain(liquid: Slosh) -> Chain:
    """The fixed mass and the pendulums of the first modes at the stated acceleration.

    A pendulum is a body whose mass centre is a thousandth nearer to the pivot than the length of
    the pendulum: with the mass `m_n L / L'` and the inertia `m_n L (L - L')` about that centre,
    force, moment and frequency are those of the point mass m_n.
    """
    parts = liquid.pendulums(liquid.kept)
    damping = 2.0 * liquid.ratio * liquid.frequencies()[: liquid.kept]
    links: list[Link] = []
    hinges: list[Hinge] = []
    left = liquid.rigid_mass()
    for mass, length, pivot, rate in zip(
        parts.masses.tolist(),
        parts.lengths.tolist(),
        parts.pivots.tolist(),
        damping.tolist(),
        strict=True,
    ):
        arm = (1.0 - BALL) * length
        own = mass * length * (length - arm)
        roll = max(ROLL * own, LEAST)
        link = Link(pivot - arm, 0.0, mass * length / arm, pivot - arm, (roll, own, own))
        left = left - link.mass_matrix()
        links.append(link)
        damper = rate * mass * length**2
        hinges.append(Hinge(pivot, dict.fromkeys(PLANES, 0.0), dict.fromkeys(PLANES, damper)))
    return Chain(
        (_fixed(left, liquid.height), *links),
        tuple(hinges),
        liquid.height,
        hung=True,
        acceleration=liquid.acceleration,
    )


def _fixed(left: Array, height: float) -> Link:
    """The body that is left at the root of a `(6, 6)` mass matrix; it has no inertia about the
    axis, for an inviscid liquid is not dragged along."""
    mass = float(left[0, 0])
    centre = float(left[1, 5]) / mass
    across = float(left[5, 5]) - mass * centre**2
    return Link(0.0, height, mass, centre, (0.0, across, across))


def limp_model(liquid: Slosh, slack: float) -> PortModel:
    """All lateral modes of the reference without the stiffness that an acceleration gives them,
    but for a `slack` part of each frequency; damped as at the stated acceleration."""
    data = liquid.data()
    return PortModel(
        _with_roll(liquid),
        slack * data.frequencies,
        data.participation,
        np.full(data.modes, liquid.ratio / slack),
    )


def _with_roll(liquid: Slosh) -> Array:
    """`(6, 6)` with the little inertia about the axis that the pendulums have."""
    roll = sum(link.inertia[0] for link in pendulum_chain(liquid).links)
    return liquid.rigid_mass() + np.diag([0.0, 0.0, 0.0, roll, 0.0, 0.0])
