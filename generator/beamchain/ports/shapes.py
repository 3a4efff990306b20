"""Mode shapes where an appendage has mass, for the hinges of a chain."""

from dataclasses import dataclass

import numpy as np

from beamchain.ports.motions import Array


@dataclass(frozen=True, eq=False)
class Shapes:
    """Mode shapes where an appendage has mass.

    Args:
        x: `(r,)` [m].
        moved, turned: `(r,)` square roots of mass and of rotary inertia there; in a scalar port `moved` only.
        values: `(n, r)` motion in each mass-normalised mode times those roots.
        bending: a hinge turns what lies behind it; else it shifts or twists it.
    """

    x: Array
    moved: Array
    turned: Array
    values: Array
    bending: bool

    def momenta(self, hinges: Array) -> Array:
        """`(n, h)`: what each mode's motion is worth in the unit motion of a hinge at each of `hinges` `(h,)` [m]."""
        reach = self.x[:, None] - hinges[None, :]
        behind = reach > 0.0
        arms = np.where(behind, reach, 0.0) if self.bending else behind
        return self.values @ (self.moved[:, None] * arms + self.turned[:, None] * behind)

    def combined(self, modes: Array) -> "Shapes":
        """Those of combinations `(k, n)` of the modes."""
        return Shapes(self.x, self.moved, self.turned, modes @ self.values, self.bending)
