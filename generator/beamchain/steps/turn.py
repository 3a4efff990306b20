"""What an integrator's step costs where the rigid spacecraft turns:
its gyroscopic moment is half a step old.

Theory: docs/theory.md, section 5.
"""

from collections.abc import Sequence

import numpy as np

from beamchain.engine.library import mujoco, quiet
from beamchain.ports.motions import Array

TURN = 1.0  # rad by which the body turns
MOST_STEPS = 20_000  # of a turn that is slow beside the step: a shorter one is looked at
SLIM = 1e-9  # of the largest moment: least that a body has
FINER = 8  # steps of the reference in one


def turn_error(
    inertia: Array, rates: Sequence[float], timestep: float, integrator: str = "Euler"
) -> float:
    """Error of a rigid body's rates after it has turned freely by one radian, over their size.

    `inertia` `(3, 3)` about its mass centre [kg m^2]; `rates` initial, about its own axes [rad/s].

    Example:
        >>> round(turn_error(np.diag([4.0, 6.0, 9.0]), (0.1, 0.1, 0.1), 0.1), 5)
        0.00141
        >>> turn_error(np.diag([4.0, 6.0, 9.0]), (0.0, 0.1, 0.0), 0.1) < 1e-12
        True
    """
    start = np.array(rates, dtype=np.float64)
    size = float(np.linalg.norm(start))
    if size == 0.0:
        return 0.0
    count = int(np.clip(np.ceil(TURN / (size * timestep)), 1, MOST_STEPS))
    ours = _turn(inertia, start, timestep, integrator, count)
    finer = FINER if count < MOST_STEPS / 10 else 2  # so short a step leaves RK4 next to no error
    exact = _turn(inertia, start, timestep / finer, "RK4", count * finer)
    return float(np.linalg.norm(ours - exact)) / size


def central_inertia(mass: Array) -> Array:
    """`(3, 3)` inertia about the mass centre [kg m^2] of a mass matrix `(6, 6)`."""
    arm = mass[3:, :3] / mass[0, 0]
    return np.asarray(mass[3:, 3:] - mass[0, 0] * arm @ arm.T, dtype=np.float64)


def _turn(inertia: Array, rates: Array, timestep: float, integrator: str, count: int) -> Array:
    spec = mujoco.MjSpec()
    spec.option.timestep = timestep
    spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
    moments, axes = np.linalg.eigh((inertia + inertia.T) / 2.0)
    moments = np.maximum(moments, SLIM * moments[2])  # a far centre leaves rounding of moments
    moments[2] = min(moments[2], moments[0] + moments[1])
    body = spec.worldbody.add_body(mass=1.0, inertia=moments, explicitinertial=True)
    body.add_freejoint()
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel[3:] = axes.T @ rates
    with quiet():  # a step far too long ends in numbers that are not finite
        mujoco.mj_step(model, data, count)
    return axes @ data.qvel[3:]
