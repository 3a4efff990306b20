"""Plain damping in the hinges: as near to given modal ratios as it comes."""

from dataclasses import replace

import numpy as np
from scipy.optimize import nnls

from beamchain.chain.chain import Chain
from beamchain.ports.motions import Array


def joint_damping(chain: Chain, port: str, ratios: Array) -> Chain:
    """The chain with plain damping in the hinges of a port: the best non-negative least-squares fit of the ratios.

    Args:
        chain: the chain, springs on its hinges.
        port: which port.
        ratios: `(n,)` wanted ratios of its cantilever modes.
    """
    modes = chain.port(port)
    moving = [i for i, hinge in enumerate(chain.hinges) if port in hinge.stiffness]
    wanted = 2.0 * ratios[: modes.modes] * modes.frequencies
    damped = wanted > 0.0
    if not np.any(damped):
        return chain
    scale = 1.0 / np.where(damped, wanted, np.max(wanted))
    values, _ = nnls(chain.shapes(port, modes) ** 2 * scale[:, None], np.where(damped, 1.0, 0.0))
    hinges = list(chain.hinges)
    for i, value in zip(moving, values, strict=True):
        hinges[i] = replace(hinges[i], damping={**hinges[i].damping, port: float(value)})
    return replace(chain, hinges=tuple(hinges))
