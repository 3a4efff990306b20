"""A target that is right at one time step: frequencies aimed lower by what the semi-implicit step adds.

The undamped semi-implicit step (Euler, implicit, implicitfast) turns a frequency w into W with
`(2/h) sin(W h/2) = w`; aimed at `w' = (2/h) sin(w h/2)`, the simulated frequency is the beam's.
"""

import numpy as np

from beamchain.errors import RealisationError
from beamchain.port import Array, PortModel


def prewarped(model: PortModel, modes: int, hub_mass: Array, timestep: float) -> PortModel:
    """The first `modes` modes of hub and beam, lowered for one step, hub taken off again.

    Port values are scaled with the frequencies, which keeps each mode's static response.

    Args:
        model: all modes of the beam in one port.
        modes: how many coupled modes are kept.
        hub_mass: `(m, m)` the hub's mass matrix on the port.
        timestep: [s].

    Raises:
        RealisationError: the step is too long for the highest kept mode (w h >= pi).
    """
    loaded = model.with_hub(hub_mass)
    frequencies = loaded.free_frequencies[:modes]
    if frequencies[-1] * timestep >= np.pi:
        raise RealisationError(
            f"a step of {timestep:.4g} s cannot show a mode of {frequencies[-1]:.4g} rad/s; take less than "
            f"{np.pi / frequencies[-1]:.4g} s, or keep fewer modes."
        )
    aimed = 2.0 / timestep * np.sin(frequencies * timestep / 2.0)
    values = loaded.free_port_values[:modes] * (aimed / frequencies)[:, None]
    return PortModel.from_free_modes(loaded.rigid_mass, aimed, values).replaced(rigid_mass=model.rigid_mass)
