"""The reference motions of a study: the exact linear one of hub and appendage, and its correction in large motion.

The linear motion superposes the beam's modes on the hub; what large motion changes is read from chains of many equal
links, each held against its own small motion, so that what few links do wrong in small motion falls out.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import krogh_interpolate
from scipy.spatial.transform import Rotation

from beamchain.ports.compose import in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array, locked, shifted

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Profile:
    """A wrench on the hub, constant between given times and zero after the last."""

    times: Array  # (k + 1,) ascending from 0 [s]
    wrench: Array  # (k, 6) force and moment on the hub's centre, hub axes [N, N m]

    def impulse(self, at: Array) -> Array:
        """`(t, 6)` integral of the wrench up to the times `at` `(t,)`."""
        total = np.vstack([np.zeros(6), np.cumsum(np.diff(self.times)[:, None] * self.wrench, axis=0)])
        return np.column_stack([np.interp(at, self.times, column) for column in total.T])

    def mean(self, timestep: float, steps: int) -> Array:
        """`(steps, 6)` mean wrench over each step, so that no impulse is lost where a step straddles a switch."""
        return np.diff(self.impulse(np.arange(steps + 1, dtype=np.float64) * timestep), axis=0) / timestep


@dataclass(frozen=True, eq=False)
class HubResponse:
    """The modes of hub and appendage, seen at the hub's centre."""

    mobility: Array  # (6, 6) inverse of the rigid mass matrix about the hub's centre
    poles: Complex  # (p,) one of each conjugate pair [1/s]
    drive: Complex  # (p, 6) modal amplitude's rate per unit wrench
    show: Complex  # (6, p) hub motion is the real part of show @ amplitude

    @property
    def slowest(self) -> float:
        """The longest period [s]."""
        return 2.0 * np.pi / float(np.min(np.abs(self.poles)))

    def motion(self, profile: Profile, at: Array) -> Array:
        """`(t, 6)` of the hub."""
        return self.elastic(profile, at) + self.rigid(profile, at)

    def rigid(self, profile: Profile, at: Array) -> Array:
        """`(t, 6)` motion of hub and frozen appendage."""
        starts, moments = profile.times[:-1], np.zeros((at.size, 6))
        for start, end, wrench in zip(starts, profile.times[1:], profile.wrench, strict=True):
            on, off = np.clip(at - start, 0.0, None), np.clip(at - end, 0.0, None)
            moments += 0.5 * (on**2 - off**2)[:, None] * wrench
        return moments @ self.mobility

    def elastic(self, profile: Profile, at: Array) -> Array:
        """`(t, 6)` what the elastic modes add to the hub's motion at the times `at`, ascending [s]."""
        out = np.zeros((at.size, 6))
        state = np.zeros(self.poles.size, dtype=np.complex128)
        edges = np.append(profile.times, np.inf)
        wrenches = np.vstack([profile.wrench, np.zeros(6)])
        for start, end, wrench in zip(edges[:-1], edges[1:], wrenches, strict=True):
            pull = self.drive @ wrench
            inside = (at >= start) & (at < end)
            out[inside] = np.real(self._advance(state, pull, at[inside] - start) @ self.show.T)
            if np.isfinite(end):
                state = self._advance(state, pull, np.array([end - start]))[0]
        return out

    def _advance(self, state: Complex, pull: Complex, after: Array) -> Complex:
        grown = np.exp(np.outer(after, self.poles))
        return grown * state + (grown - 1.0) / self.poles * pull


def hub_response(full: Mapping[str, PortModel], rigid_mass: Array, hub_mass: Array, offset: Array) -> HubResponse:
    """The response of a hub that carries an appendage; mass matrices about the root, `offset` from centre to root [m]."""
    model = in_space(full, rigid_mass + hub_mass)
    centre = shifted(-offset)  # motion of the centre from that of the root
    mobility = centre @ np.linalg.inv(model.rigid_mass) @ centre.T
    values = model.free_port_values @ centre.T
    w, shapes = model.free_frequencies, model._free[2]
    if not np.any(model.damping > 0.0):
        poles = (1j * w).astype(np.complex128)
        return HubResponse(locked(mobility), poles, values.astype(np.complex128), (values / poles[:, None]).T)
    # states (w q, q'): skew but for the dissipation, so that the small frequencies keep their digits
    loss = (w[:, None] * shapes.T) @ ((2.0 * model.damping / model.frequencies)[:, None] * shapes * w)
    system = np.block([[np.zeros_like(loss), np.diag(w)], [-np.diag(w), -loss]])
    found, right = np.linalg.eig(system)
    poles, right = found.astype(np.complex128), right.astype(np.complex128)
    left = np.linalg.inv(right)
    upper = np.imag(poles) > 0.0
    use = upper | (np.imag(poles) == 0.0)  # an overdamped mode counts once, not as half of a pair
    weight = np.where(upper[use], 2.0, 1.0)
    drive = np.asarray(left[use][:, w.size :] @ values, dtype=np.complex128)
    show = np.asarray((values / w[:, None]).T @ right[: w.size][:, use] * weight, dtype=np.complex128)
    return HubResponse(locked(mobility), poles[use], drive, show)


@dataclass(frozen=True)
class Figures:
    """How good a large-motion reference is, relative to the largest elastic motion."""

    nonlinear: float  # what large motion changes at most
    links: tuple[int, ...] = ()  # of the chains extrapolated from, the finest last
    change: float = 0.0  # by the last chain in the extrapolated motion
    step_change: float = 0.0  # by half the step in the coarsest chain
    small_motion: float = 0.0  # how far the extrapolated chains alone miss the exact small motion
    wanted: float = 0.0  # change at which refining stops

    @property
    def error(self) -> float:
        """How far the reference may be off."""
        return max(self.change, self.step_change, self.small_motion * self.nonlinear)

    @property
    def met(self) -> bool:
        """Whether that is as little as was wanted."""
        return self.error <= self.wanted


@dataclass(frozen=True, eq=False)
class LargeReference:
    """The hub's motion under a profile, and that of hub and frozen appendage.

    `moved` is what large motion adds at times `(t,)`: `(t, 6)` displacement in world axes [m], rotation vector [rad]
    from the linear attitude to the real one; `moved_rigid` the same with the appendage frozen.
    """

    response: HubResponse
    profile: Profile
    moved: Callable[[Array], Array]
    moved_rigid: Callable[[Array], Array]
    figures: Figures

    def motion(self, at: Array) -> Array:
        """`(t, 6)` of the hub's centre: displacement [m], rotation vector [rad]."""
        return added(self.response.motion(self.profile, at), self.moved(at))

    def rigid(self, at: Array) -> Array:
        """`(t, 6)` with the appendage frozen."""
        return added(self.response.rigid(self.profile, at), self.moved_rigid(at))

    def elastic(self, at: Array) -> Array:
        """`(t, 6)` what bending adds."""
        return between(self.rigid(at), self.motion(at))

    def gap(self, motion: Array, at: Array, rigid: Array | None) -> Array:
        """`(t, 6)` how far a simulated motion is off, that of the frozen appendage (`rigid`) taken off first."""
        return between(self.motion(at), motion) if rigid is None else between(rigid, motion) - self.elastic(at)


def between(start: Array, end: Array) -> Array:
    """`(t, 6)` from one motion to another: difference of displacements, rotation vector of the relative attitude."""
    turn = Rotation.from_rotvec(start[:, 3:]).inv() * Rotation.from_rotvec(end[:, 3:])
    return np.hstack([end[:, :3] - start[:, :3], turn.as_rotvec()])


def added(start: Array, more: Array) -> Array:
    """`(t, 6)` the motion that `between(start, .)` gives `more` for; its rotation vector is at most half a turn."""
    turn = Rotation.from_rotvec(start[:, 3:]) * Rotation.from_rotvec(more[:, 3:])
    return np.hstack([start[:, :3] + more[:, :3], turn.as_rotvec()])


def at_zero(where: Sequence[float], values: Sequence[Array]) -> Array:
    """Extrapolation to 0 of values at `where`, by the polynomial through all of them."""
    return np.asarray(krogh_interpolate(where, values, 0.0))
