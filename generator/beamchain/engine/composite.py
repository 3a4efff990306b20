"""Mass properties of a whole spacecraft, everything that it carries frozen."""

from typing import Any, NamedTuple

import numpy as np

from beamchain.engine.bench import frozen_mass
from beamchain.engine.library import mujoco, rest
from beamchain.ports.motions import Array, shifted

NOTHING = 1e-9  # relative, below which a number is printed as zero


class Composite(NamedTuple):
    """Mass properties of a body with all that hangs on it."""

    body: str
    mass: float  # [kg]
    centre: Array  # (3,) of mass from the body's origin, in its axes [m]
    inertia: Array  # (3, 3) about the centre of mass, in its axes [kg m^2]

    @property
    def sentence(self) -> str:
        """The numbers in a line."""
        largest = float(np.max(np.abs(self.inertia)))
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = np.where(np.abs(self.inertia) > NOTHING * largest, self.inertia, 0.0)
        size = np.sqrt(largest / self.mass)
        centre = ", ".join(f"{value:.5g}" for value in np.where(np.abs(self.centre) > NOTHING * size, self.centre, 0.0))
        return (
            f"{self.body} with all that it carries: {self.mass:.6g} kg, centre of mass at ({centre}) m, inertia about it "
            f"Ixx {xx:.5g}, Iyy {yy:.5g}, Izz {zz:.5g}, Ixy {xy:.3g}, Ixz {xz:.3g}, Iyz {yz:.3g} kg m^2"
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return self._asdict()


def composite(model: "mujoco.MjModel", body: int) -> Composite:
    """Mass properties of a body, by its id, and all that hangs on it, at rest."""
    data = rest(model)
    matrix = frozen_mass(model, data, body, data.xpos[body], data.xmat[body].reshape(3, 3))
    mass = float(np.trace(matrix[:3, :3])) / 3.0
    centre = np.array([matrix[1, 5], matrix[2, 3], matrix[0, 4]]) / max(mass, 1e-300)
    cross = shifted(centre)[:3, 3:]
    inertia = matrix[3:, 3:] + mass * cross @ cross
    return Composite(model.body(body).name or f"body {body}", mass, centre, (inertia + inertia.T) / 2.0)
