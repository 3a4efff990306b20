"""Motions that no compiled model has: of given stiffness and damping."""

import numpy as np

from formulas import Motion


def made_motion(squares, implicit, damping, integrator, timestep, shapes=None):
    """In coordinates of unit mass; without the matrices of its step."""
    nothing = np.zeros((0, 0))
    return Motion(
        nothing if shapes is None else shapes,
        squares,
        damping,
        implicit,
        loose=0,
        timestep=timestep,
        integrator=integrator,
        difference=nothing,
        drive=nothing,
    )
