"""MuJoCo's time integrators by their names in files, those that the installed version has."""

import mujoco

INTEGRATORS = tuple(
    name
    for name in ("Euler", "implicit", "implicitfast", "discrete", "RK4")
    if hasattr(mujoco.mjtIntegrator, f"mjINT_{name.upper()}")
)
