"""Form 4: armature and damping of the held appendage's modes, tuned until the craft's own poles are exact.

Form 2's tendons keep their coefficients and stiffness; of each, armature and damping are two numbers, and the craft has as
many coupled modes as it has tendons, each with a complex pole: as many equations as unknowns. From form 2, which is near,
Newton's method gets there in two or three steps. In modal coordinates the step's poles obey `P(z) y = 0`,

    P(z) = (z - 1)^2 (C + mu) + h (z - 1) D + h^2 z K          tendon damping explicit (Euler)
    P(z) = (z - 1)^2 (C + mu) + h z (z - 1) D + h^2 z K        implicit (implicit, implicitfast)

all symmetric, so that a change of P moves a pole by `dz = -y^T dP y/(y^T P'(z) y)`. Where two appendages are alike, their modes
in step and in opposition ask for different armature on the same tendons: the least-squares answer is taken.

Theory: docs/theory.md, section 5.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment, lsq_linear

from beamchain.ports.motions import Array
from beamchain.steps.discrete import SCHEMES, Complex

ITERATIONS = 12
CLOSE = 1e-13  # relative pole error at which to stop
STEADY = 1e-7  # weight that keeps unknowns where the poles do not ask for a change


@dataclass(frozen=True, eq=False)
class Tuned:
    """What the tuning found.

    Args:
        armature: `(n,)` of the tendons.
        damping: `(n,)` of the tendons [1/s].
        error: worst relative error of a pole, `|z - z*|/|z* - 1|`.
        start: the same before tuning.
    """

    armature: Array
    damping: Array
    error: float
    start: float


def tune(
    integrator: str, c: Array, stiffness: Array, armature: Array, damping: Array, wanted: Complex, timestep: float
) -> Tuned:
    """Tendon armature and damping for which the step of the craft has the poles `wanted`, as nearly as can be.

    Args:
        integrator: "Euler", "implicit" or "implicitfast".
        c: `(n, n)` condensed mass of the modal coordinates.
        stiffness: `(n,)` of the tendons.
        armature: `(n,)` to begin with.
        damping: `(n,)` to begin with; where all are zero, they stay so.
        wanted: `(n,)` poles z in the upper half plane.
        timestep: h [s].
    """
    implicit, h, n = SCHEMES[integrator].implicit_damping, float(timestep), stiffness.size
    damped = bool(np.any(damping > 0.0))
    size = np.abs(wanted - 1.0)
    best: tuple[float, Array, Array] | None = None
    start = float("inf")
    mu, d = np.array(armature), np.array(damping)
    for _ in range(ITERATIONS):
        z, y = _poles(implicit, c + np.diag(mu), np.diag(stiffness), np.diag(d), h)
        if z.size < n:
            break
        pick = linear_sum_assignment(np.abs(z[None, :] - wanted[:, None]) / size[:, None])[1]
        z, y = z[pick], y[:, pick]
        miss = (wanted - z) / size
        error = float(np.max(np.abs(miss)))
        if best is None:
            start = error
        if best is None or error < best[0]:
            best = (error, mu, d)
        if error < CLOSE or error > 2.0 * best[0]:
            break
        step = z - 1.0
        slope = 2.0 * step[None, :] * ((c + np.diag(mu)) @ y) + h**2 * stiffness[:, None] * y
        slope += h * d[:, None] * y * (2.0 * z - 1.0 if implicit else np.ones(n))[None, :]
        lever = -(y**2) / np.sum(y * slope, axis=0)[None, :] / size[None, :]  # (tendon, pole)
        by_mass = (lever * step[None, :] ** 2).T
        by_drag = (lever * h * step[None, :] * (z if implicit else np.ones(n))[None, :]).T
        unit = (1.0 - np.exp(-h * np.sqrt(stiffness))) / h  # scale of the dampers
        jacobian = np.hstack([by_mass, by_drag * unit[None, :]]) if damped else by_mass
        rows = np.vstack([np.real(jacobian), np.imag(jacobian), STEADY * np.eye(jacobian.shape[1])])
        right = np.concatenate([np.real(miss), np.imag(miss), np.zeros(jacobian.shape[1])])
        lowest = -np.concatenate([mu, d / unit]) if damped else -mu
        change = lsq_linear(rows, right, (np.minimum(lowest, -1e-300), np.full(lowest.size, np.inf)), method="bvls").x
        mu = np.maximum(mu + change[:n], 0.0)
        if damped:
            d = np.maximum(d + change[n:] * unit, 0.0)
    if best is None:
        return Tuned(armature, damping, start, start)
    return Tuned(best[1], best[2], best[0], start)


def _poles(
    implicit: bool, mass: Array, stiffness: Array, damping: Array, h: float
) -> tuple[Complex, NDArray[np.complex128]]:
    """Oscillating poles of the step, upper half plane, and the modes in columns."""
    n = mass.shape[0]
    solved = np.linalg.solve(
        mass + (h * damping if implicit else 0.0),
        np.hstack([h**2 * stiffness, mass if implicit else mass - h * damping]),
    )
    pull, keep = solved[:, :n], solved[:, n:]
    z, vectors = np.linalg.eig(np.block([[np.eye(n) - pull, keep], [-pull, keep]]))
    upper = np.imag(z) > 1e-12
    return z[upper].astype(np.complex128), vectors[:n, upper].astype(np.complex128)
