"""The exact linear motion of hub and appendage under a wrench on the hub: the reference of every study.

Modal superposition with the beam's own modes on the hub; a wrench that is constant between given times is integrated
exactly.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamchain.ports.compose import in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array, locked


@dataclass(frozen=True, eq=False)
class Profile:
    """A wrench on the hub, constant between given times and zero after the last.

    Args:
        times: `(k + 1,)` ascending, the first 0 [s].
        wrench: `(k, 6)` force and moment on the hub's centre, hub axes [N, N m].
    """

    times: Array
    wrench: Array

    def impulse(self, at: Array) -> Array:
        """`(t, 6)` integral of the wrench up to the times `at` `(t,)`."""
        total = np.vstack([np.zeros(6), np.cumsum(np.diff(self.times)[:, None] * self.wrench, axis=0)])
        return np.column_stack([np.interp(at, self.times, column) for column in total.T])

    def mean(self, timestep: float, steps: int) -> Array:
        """`(steps, 6)` mean wrench over each step, so that no impulse is lost where a step straddles a switch."""
        return np.diff(self.impulse(np.arange(steps + 1, dtype=np.float64) * timestep), axis=0) / timestep


@dataclass(frozen=True, eq=False)
class HubResponse:
    """The modes of hub and appendage, seen at the hub's centre.

    Args:
        mobility: `(6, 6)` inverse of the rigid mass matrix about the hub's centre.
        poles: `(p,)` one of each conjugate pair [1/s].
        drive: `(p, 6)` modal amplitude's rate per unit wrench.
        show: `(6, p)` hub motion is the real part of `show @ amplitude`.
    """

    mobility: Array
    poles: NDArray[np.complex128]
    drive: NDArray[np.complex128]
    show: NDArray[np.complex128]

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

    def _advance(
        self, state: NDArray[np.complex128], pull: NDArray[np.complex128], after: Array
    ) -> NDArray[np.complex128]:
        grown = np.exp(np.outer(after, self.poles))
        return grown * state + (grown - 1.0) / self.poles * pull


def hub_response(full: Mapping[str, PortModel], rigid_mass: Array, hub_mass: Array, offset: Array) -> HubResponse:
    """The response of a hub that carries an appendage.

    Args:
        full: all modes of the appendage per port, with their damping ratios.
        rigid_mass: `(6, 6)` of the appendage about the root.
        hub_mass: `(6, 6)` of the hub about the root.
        offset: `(3,)` from the hub's centre to the root [m].
    """
    model = in_space(full, rigid_mass).with_hub(hub_mass)
    x, y, z = offset
    centre = np.eye(6)  # motion of the centre from that of the root: u - rotation x offset
    centre[:3, 3:] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
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
