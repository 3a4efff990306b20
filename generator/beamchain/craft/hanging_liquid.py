"""The liquid of a tank as masses that a load moves: its lateral modes, limp without acceleration.

Its exact form is that of potential flow: masses that move aside by u_n and thereby rise by
`u_n^2 / 2 L_n`, which is the potential energy of the surface, and the fixed mass.

Theory: docs/theory.md, section 11.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamchain.fitting.slosh import limp_model, pendulum_chain
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array
from beamchain.structure.slosh import KNOWN, Slosh

SLACK = 1e-6  # of its frequency: what is left of a mode's stiffness without acceleration


@dataclass(frozen=True, eq=False)
class HangingLiquid:
    """A liquid as masses that a load moves; it is used as a `BentLine` is.

    Args:
        model: its lateral modes, limp, in six motions.
        rows: `(m,)` numbers of the modes.
        masses, inertias: `(c,)`, `(c, 3, 3)` of the fixed mass, then of a mass per mode and plane.
        size: `(m,)` by how much the liquid's surface turns per unit of each mode.
        places: `(c,)` along the axis [m].
        lengths: `(m,)` of the pendulums [m].
    """

    model: PortModel
    rows: NDArray[np.intp]
    masses: Array
    inertias: Array
    size: Array
    places: Array
    lengths: Array

    def bent(self, eta: Array) -> tuple[Array, Array, Array]:
        """Rotations `(b, c, 3, 3)`, and twice the centres of mass `(b, c, 3)` in the axes of the
        root, for modal coordinates `(b, m)`."""
        count = eta.shape[0]
        centres = np.zeros((count, self.masses.size, 3))
        centres[:, :, 0] = self.places
        for plane in (0, 1):
            aside = eta[:, plane::2] / np.sqrt(self.masses[1:])
            centres[:, 1:, 1 + plane] = aside
            centres[:, 1:, 0] += aside**2 / (2.0 * self.lengths)
        axes = np.broadcast_to(np.eye(3), (count, self.masses.size, 3, 3))
        return axes, centres, centres

    def port(self, number: int, axes: Array, ends: Array, eta: Array) -> tuple[Array, Array]:
        """A liquid has no port."""
        raise NotImplementedError(f"port {number} of a liquid")


def hanging_liquid(liquid: Slosh) -> HangingLiquid:
    """The liquid with all lateral modes of the reference."""
    parts = liquid.pendulums()
    model = limp_model(liquid, SLACK)
    fixed = liquid.mass - float(parts.masses.sum())
    first = liquid.mass * liquid.height / 2.0 - float(parts.masses @ parts.heights)
    about = model.rigid_mass[5, 5] - float(parts.masses @ parts.heights**2) - first**2 / fixed
    inertias = np.zeros((KNOWN + 1, 3, 3))
    inertias[0] = np.diag([0.0, about, about])
    return HangingLiquid(
        model=model,
        rows=np.arange(2 * KNOWN),
        masses=np.append(fixed, parts.masses),
        inertias=inertias,
        size=np.repeat(1.0 / (np.sqrt(parts.masses) * parts.lengths), 2),
        places=np.append(first / fixed, parts.heights),
        lengths=parts.lengths,
    )


def springs_at_stated(liquid: Slosh) -> Array:
    """`(n,)` stiffness of the pendulums' hinges at the stated acceleration [N m/rad]."""
    chain = pendulum_chain(liquid)
    return np.array([chain.springs(i)[port] for i, port in chain.freedoms()])
