"""Form 2 of `beamchain.steps.retime` for many sets of modal tendons at once: one array operation for all of them."""

import numpy as np
from numpy.typing import NDArray

from beamchain.ports.motions import Array
from beamchain.steps.forms import LOWEST, MARGIN, SEMI_IMPLICIT_MARGIN
from beamchain.steps.integrators import SCHEMES, Timed, polynomial, timed

HALVINGS = 14  # of the phase limit, as in forms.py


def form2_many(integrator: str, c: Array, stiffness: Array, damping: Array, timestep: float) -> Timed:
    """What `form2` gives each of k crafts: every mode of the held appendages exact, the phase limit lowered where needed.

    `c` `(n, n)` or `(k, n, n)`: condensed mass of the modal coordinates; `stiffness` [1/s^2] and `damping` [1/s] `(k, n)` of
    the tendons before they were made exact.
    """
    w = np.sqrt(stiffness)
    zeta, c = damping / (2.0 * w), np.broadcast_to(c, (w.shape[0], *c.shape[-2:]))
    phase = np.full((w.shape[0], 1), SCHEMES[integrator].phase)
    out = timed(integrator, w, zeta, timestep, phase=phase)
    short = np.flatnonzero(~_stable(integrator, c, stiffness, out, timestep))
    if short.size and np.isfinite(phase[0, 0]):
        low, high = np.full((short.size, 1), LOWEST), phase[short]
        for _ in range(HALVINGS):
            middle = np.sqrt(low * high)
            tried = timed(integrator, w[short], zeta[short], timestep, phase=middle)
            good = _stable(integrator, c[short], stiffness[short], tried, timestep)[:, None]
            low, high = np.where(good, middle, low), np.where(good, high, middle)
        phase[short] = low
        out = timed(integrator, w, zeta, timestep, phase=phase)
    return out


def _stable(integrator: str, c: Array, stiffness: Array, t: Timed, h: float) -> NDArray[np.bool_]:
    """`(k,)`: whether `h^2 lambda_max` of each craft is within the margin of its integrator."""
    n = stiffness.shape[1]
    mass = c + (t.mass - 1.0)[:, :, None] * np.eye(n)
    if integrator == "RK4":  # the poles of the modes, within the same share of its stability region
        flow = np.zeros((stiffness.shape[0], 2 * n, 2 * n))
        flow[:, :n, n:] = np.eye(n)
        held = np.concatenate([stiffness[:, :, None] * np.eye(n), t.damping[:, :, None] * np.eye(n)], axis=2)
        flow[:, n:] = -np.linalg.solve(mass, held)
        reach = h * np.sqrt(8.0 / MARGIN["RK4"])
        return np.asarray(np.max(np.abs(polynomial(np.linalg.eigvals(flow) * reach)), axis=1) <= 1.0 + 1e-9)
    sign = -1.0 if SCHEMES[integrator].implicit_damping else 1.0
    force = h**2 * stiffness + 2.0 * sign * h * t.damping
    if SCHEMES[integrator].implicit_springs:
        return np.ones(stiffness.shape[0], dtype=np.bool_)
    scale = 1.0 / np.sqrt(np.abs(np.einsum("kii->ki", mass)))
    left = SEMI_IMPLICIT_MARGIN * mass - force[:, :, None] * np.eye(n)
    return np.asarray(np.linalg.eigvalsh(left * scale[:, :, None] * scale[:, None, :])[:, 0] >= 0.0)
