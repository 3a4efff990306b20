"""The hub's motion where the linear response no longer holds: the linear one, corrected by fine chains in MuJoCo.

The exact linear response carries all modes; what large motion changes is read from chains of many equal links, each held
against its own small motion, so that what a chain of few links does wrong in small motion falls out.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from beamchain.ports.motions import Array
from beamchain.studies.hub_response import HubResponse, Profile


@dataclass(frozen=True)
class Figures:
    """How good a large-motion reference is, relative to the largest elastic motion.

    Args:
        nonlinear: what large motion changes at most; all there is where the reference is linear.
        links: of the chains that the reference was extrapolated from, the finest last.
        change: what the last chain changed in the extrapolated motion.
        step_change: what half the step changed in the coarsest chain.
        small_motion: how far the extrapolated chains alone, without the exact linear response, miss it in small motion.
        wanted: change at which refining stops.
    """

    nonlinear: float
    links: tuple[int, ...] = ()
    change: float = 0.0
    step_change: float = 0.0
    small_motion: float = 0.0
    wanted: float = 0.0

    @property
    def error(self) -> float:
        """How far the reference may be off: what refining still changed, and the share that the chains miss at all."""
        return max(self.change, self.step_change, self.small_motion * self.nonlinear)

    @property
    def met(self) -> bool:
        """Whether that is as little as was wanted."""
        return self.error <= self.wanted


@dataclass(frozen=True, eq=False)
class LargeReference:
    """The hub's motion under a profile, and that of hub and frozen appendage.

    Args:
        response: exact linear motion.
        profile: wrench on the hub.
        moved: `(t,) -> (t, 6)` what large motion adds: displacement in world axes [m], rotation vector [rad] from the
            linear attitude to the real one.
        moved_rigid: the same with the appendage frozen.
        figures: how good it is.
    """

    response: HubResponse
    profile: Profile
    moved: Callable[[Array], Array]
    moved_rigid: Callable[[Array], Array]
    figures: Figures

    def motion(self, at: Array) -> Array:
        """`(t, 6)` of the hub's centre: displacement [m], rotation vector [rad]."""
        linear = self.response.elastic(self.profile, at) + self.response.rigid(self.profile, at)
        return added(linear, self.moved(at))

    def rigid(self, at: Array) -> Array:
        """`(t, 6)` with the appendage frozen."""
        return added(self.response.rigid(self.profile, at), self.moved_rigid(at))

    def elastic(self, at: Array) -> Array:
        """`(t, 6)` what bending adds."""
        return between(self.rigid(at), self.motion(at))

    def gap(self, motion: Array, at: Array, rigid: Array | None) -> Array:
        """`(t, 6)` how far a simulated motion is off.

        Args:
            motion: `(t, 6)` simulated.
            at: `(t,)` the times it belongs to.
            rigid: `(t, 6)` of the frozen appendage by the same integrator, taken off first.
        """
        return between(self.motion(at), motion) if rigid is None else between(rigid, motion) - self.elastic(at)


def between(start: Array, end: Array) -> Array:
    """`(t, 6)` from one motion to another: difference of displacements, rotation vector of the relative attitude."""
    turn = Rotation.from_rotvec(start[:, 3:]).inv() * Rotation.from_rotvec(end[:, 3:])
    return np.hstack([end[:, :3] - start[:, :3], turn.as_rotvec()])


def added(start: Array, more: Array) -> Array:
    """`(t, 6)` the motion that `between(start, .)` gives `more` for; its rotation vector is at most half a turn."""
    turn = Rotation.from_rotvec(start[:, 3:]) * Rotation.from_rotvec(more[:, 3:])
    return np.hstack([start[:, :3] + more[:, :3], turn.as_rotvec()])


def at_zero(where: list[float], values: list[Array]) -> Array:
    """Neville's extrapolation to 0 of values at `where`."""
    rows = list(values)
    for k in range(1, len(rows)):
        rows = [
            (where[i + k] * rows[i] - where[i] * rows[i + 1]) / (where[i + k] - where[i]) for i in range(len(rows) - 1)
        ]
    return rows[0]
