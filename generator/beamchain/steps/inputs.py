"""The input that goes with models exact in time: the mean of this and the previous one.

Theory: docs/theory.md, section 5.
"""

import numpy as np
from numpy.typing import ArrayLike

from beamchain.ports.motions import Array


class HeldInput:
    """Half of this input and half of the previous one, `ctrl = (u_k + u_(k-1))/2`.

    A torque `u_k` held from `k h` to `(k + 1) h` moves a structure by a transfer function with `(z + 1)/2` where MuJoCo's
    Euler step, which gives the whole impulse at once, has `z`. Fed with this mean, every sampled position of a model made
    exact in time is the exact one. One object per model and per simulated world; `(worlds, nu)` arrays work as well.

    Args:
        before: input held before t = 0; zero where left out.

    Example:
        >>> held = HeldInput()
        >>> held(2.0), held(2.0), held(0.0), held(0.0)
        (array(1.), array(2.), array(1.), array(0.))
    """

    def __init__(self, before: ArrayLike | None = None) -> None:
        self._first = None if before is None else np.array(before, dtype=np.float64)
        self._previous = self._first

    def __call__(self, now: ArrayLike) -> Array:
        """What to write into `ctrl` (or `qfrc_applied`) for the step in which `now` is held.

        Args:
            now: `u_k`, any shape, the same at every call.
        """
        value = np.array(now, dtype=np.float64)
        before = np.zeros_like(value) if self._previous is None else self._previous
        self._previous = value
        return (value + before) / 2.0

    def reset(self) -> None:
        """Back to the input before t = 0."""
        self._previous = self._first
