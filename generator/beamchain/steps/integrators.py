"""What a time step does to an oscillation, per integrator: stability limits, frequency shift, numerical damping.

Theory: docs/theory.md, section 5.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from beamchain.checks import one_of

Poles = NDArray[np.complex128]

INTEGRATORS = ("Euler", "implicit", "implicitfast", "discrete", "RK4")


def step_pole(
    integrator: str, angle: ArrayLike, ratio: ArrayLike = 0.0, *, tendon: bool = False, sprung: bool = False
) -> Poles:
    """Pole z of one step of `q'' + 2 ratio w q' + w^2 q = 0` with `angle = w h`, the one with the larger modulus.

    Args:
        integrator: MuJoCo's name. Euler, implicit, implicitfast: stiffness explicit, joint damping implicit;
            "discrete": both implicit; "RK4": the classical Runge-Kutta polynomial.
        angle: w h, any shape.
        ratio: damping ratio, below 1.
        tendon: the damping sits on a tendon, which Euler integrates explicitly.
        sprung: so does the spring, which "discrete" takes implicitly for the force of the position alone.
    """
    one_of("integrator", integrator, INTEGRATORS)
    angle, ratio = np.asarray(angle, dtype=np.float64), np.asarray(ratio, dtype=np.float64)
    spring, damper = angle**2, 2.0 * ratio * angle
    if integrator == "RK4":
        s = angle * (-ratio + 1j * np.sqrt(1.0 - ratio**2))
        return 1.0 + s * (1.0 + s / 2.0 * (1.0 + s / 3.0 * (1.0 + s / 4.0)))
    # v+ = (keep v - spring q / h) , q+ = q + h v+: z^2 - (1 + keep - pull) z + keep = 0
    if integrator == "discrete":
        keep = 1.0 / (1.0 + damper + (0.0 if sprung else spring))
        pull = spring / (1.0 + damper + spring)
    elif integrator == "Euler" and tendon:
        keep, pull = 1.0 - damper, spring
    else:
        keep, pull = 1.0 / (1.0 + damper), spring / (1.0 + damper)
    half = (1.0 + keep - pull) / 2.0
    root = np.sqrt((half**2 - keep).astype(np.complex128))
    outward: Poles = np.where(half < 0.0, -root, root)
    return half + outward


def largest_angle(integrator: str, ratio: float = 0.0, *, tendon: bool = False) -> float:
    """Largest stable `w h`; infinity for "discrete".

    Closed forms for the semi-implicit steps, the root of the Runge-Kutta polynomial for RK4.
    """
    one_of("integrator", integrator, INTEGRATORS)
    if integrator == "discrete":
        return float("inf")
    if integrator == "RK4":
        grid = np.linspace(1.0, 4.0, 301)  # the polynomial's region is left once, between 2 and 3.3
        inside = int(np.flatnonzero(np.abs(step_pole("RK4", grid, ratio)) <= 1.0 + 1e-12)[-1])
        return float(brentq(lambda x: abs(complex(step_pole("RK4", x, ratio))) - 1.0, grid[inside], grid[inside + 1]))
    root = 2.0 * np.sqrt(1.0 + ratio**2)
    return float(root - 2.0 * ratio if integrator == "Euler" and tendon else root + 2.0 * ratio)


def numerical_pole(integrator: str, omega: float, ratio: float, timestep: float, *, tendon: bool = False) -> complex:
    """`log(z) / h` of the oscillating pole of one step [rad/s]: what the simulation shows instead of the structure."""
    return complex(np.log(step_pole(integrator, omega * timestep, ratio, tendon=tendon)) / timestep)
