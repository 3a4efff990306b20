"""Modal damping: exact through one fixed tendon per mode, or as near as plain joint damping comes."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls

from beamchain.chain.chain import Chain
from beamchain.motion import Array


class Damper(NamedTuple):
    """One damped mode as a fixed tendon.

    Args:
        port: the mode's port.
        mode: its number, from 1.
        coefficients: `(hinge number from 1, coefficient)` over the hinges that move in the port.
        damping: `2 zeta W` [1/s].
    """

    port: str
    mode: int
    coefficients: tuple[tuple[int, float], ...]
    damping: float


def tendons(chain: Chain, port: str, ratios: Array) -> list[Damper]:
    """One tendon per damped mode: coefficients `c psi_k / W_k^2`, damping `2 zeta_k W_k`.

    In mass-normalised cantilever modes `psi_k` the tendon's rate is the modal rate, so that each damps its own mode
    only; it is internal and puts no net wrench on the hub.

    Args:
        chain: the chain.
        port: which port.
        ratios: `(n,)` damping ratios of its cantilever modes.
    """
    modes = chain.port(port)
    moments = chain.moments(port, modes)
    moving = [i for i, hinge in enumerate(chain.hinges, 1) if port in hinge.stiffness]
    out: list[Damper] = []
    for k in range(modes.modes):
        if k < ratios.size and ratios[k] > 0.0:
            w = float(modes.frequencies[k])
            pairs = tuple((h, float(v)) for h, v in zip(moving, moments[k] / w**2, strict=True))
            out.append(Damper(port, k + 1, pairs, 2.0 * float(ratios[k]) * w))
    return out


def joint_damping(chain: Chain, port: str, ratios: Array) -> Chain:
    """The chain with plain damping in the hinges of a port: the best non-negative least-squares fit of the ratios.

    Args:
        chain: the chain.
        port: which port.
        ratios: `(n,)` wanted ratios of its cantilever modes.
    """
    modes = chain.port(port)
    moving = [i for i, hinge in enumerate(chain.hinges) if port in hinge.stiffness]
    stiffness = np.array([chain.hinges[i].stiffness[port] for i in moving])
    shapes = chain.moments(port, modes) / stiffness  # hinge angles of each mode
    wanted = 2.0 * ratios[: modes.modes] * modes.frequencies
    damped = wanted > 0.0
    if not np.any(damped):
        return chain
    scale = 1.0 / np.where(damped, wanted, np.max(wanted))
    values, _ = nnls(shapes**2 * scale[:, None], np.where(damped, 1.0, 0.0))
    hinges = list(chain.hinges)
    for i, value in zip(moving, values, strict=True):
        hinges[i] = replace(hinges[i], damping={**hinges[i].damping, port: float(value)})
    return replace(chain, hinges=tuple(hinges))


def modal_ratios(chain: Chain, port: str) -> Array:
    """`(n,)` damping ratios that the hinges' own dampers give the cantilever modes of a port."""
    modes = chain.port(port)
    moving = [hinge for hinge in chain.hinges if port in hinge.stiffness]
    stiffness = np.array([hinge.stiffness[port] for hinge in moving])
    dampers = np.array([hinge.damping.get(port, 0.0) for hinge in moving])
    shapes = chain.moments(port, modes) / stiffness
    return (shapes**2 @ dampers) / (2.0 * modes.frequencies)
