"""What a study asks of every model: a hub with an appendage, a wrench on the hub, a duration,
and the exact answer.

The motion is the linear one: the beam's modes superposed on the hub.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from beamchain.engine.runs import held_columns
from beamchain.errors import InputError
from beamchain.ports.compose import model_in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array, locked, offset_matrix
from beamchain.studies.field import Task

Complex = NDArray[np.complex128]

COLUMNS = ("fx", "fy", "fz", "mx", "my", "mz")

#: Motion of the hub that the default doublet drives, per port,
#: in the order in which ports are looked for.
DRIVEN = {"xy": 5, "xz": 4, "torsion": 3, "axial": 0}

ROUND = (1.0, 2.0, 3.0, 6.0)  # durations and pulses are these times a power of ten
PERIODS = 4.0  # of the first coupled mode, at least
LEAST_PERIODS, MOST_PERIODS = 1e-3, 1e4  # of the slowest mode that a study may last
PULSE = 15.0  # the default doublet is a fifteenth of the duration
# elastic hub motion of the default doublet at most [rad, or share of the appendage's length]
SMALL = 1e-5
ROUNDING = 1e-15  # of all modes together: a mode that adds less to a motion is left out


@dataclass(frozen=True, eq=False)
class Profile:
    """A wrench on the hub, constant between given times and zero after the last."""

    times: Array  # (k + 1,) ascending from 0 [s]
    wrench: Array  # (k, 6) force and moment on the hub's centre, hub axes [N, N m]

    def impulse(self, at: Array) -> Array:
        """`(t, 6)` integral of the wrench up to the times `at` `(t,)`."""
        impulses = np.diff(self.times)[:, None] * self.wrench
        total = np.vstack([np.zeros(6), np.cumsum(impulses, axis=0)])
        return np.column_stack([np.interp(at, self.times, column) for column in total.T])

    def mean(self, timestep: float, steps: int) -> Array:
        """`(steps, 6)` mean wrench over each step,
        so that no impulse is lost where a step straddles a switch."""
        edges = np.arange(steps + 1, dtype=np.float64) * timestep
        return np.diff(self.impulse(edges), axis=0) / timestep


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
        starts = profile.times[:-1]
        moments = np.zeros((at.size, 6))
        for start, end, wrench in zip(starts, profile.times[1:], profile.wrench, strict=True):
            on = np.clip(at - start, 0.0, None)
            off = np.clip(at - end, 0.0, None)
            moments += 0.5 * (on**2 - off**2)[:, None] * wrench
        return moments @ self.mobility

    def elastic(self, profile: Profile, at: Array) -> Array:
        """`(t, 6)` what the elastic modes add to the hub's motion at the times `at`,
        ascending [s]."""
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
        # z(t) = e^(p t) z_0 + (e^(p t) - 1) / p pull
        growth = np.exp(np.outer(after, self.poles))
        return growth * state + (growth - 1.0) / self.poles * pull


def hub_response(
    full: Mapping[str, PortModel], rigid_mass: Array, hub_mass: Array, offset: Array
) -> HubResponse:
    """The response of a hub that carries an appendage; mass matrices about the root,
    `offset` from centre to root [m]."""
    model = model_in_space(full, rigid_mass + hub_mass)
    centre = offset_matrix(-np.asarray(offset))  # motion of the centre from that of the root
    mobility = centre @ np.linalg.inv(model.rigid_mass) @ centre.T
    values = model.free_port_values @ centre.T
    w = model.free_frequencies
    shapes = model._free.shares
    if not np.any(model.damping > 0.0):
        poles = (1j * w).astype(np.complex128)
        drive = values.astype(np.complex128)
        return felt(HubResponse(locked(mobility), poles, drive, (values / poles[:, None]).T))
    # states (w q, q'): skew but for the dissipation,
    # so that the small frequencies keep their digits
    # loss_ij = w_i w_j sum_k v_ki v_kj 2 zeta_k / W_k
    weights = (2.0 * model.damping / model.frequencies)[:, None]
    loss = (w[:, None] * shapes.T) @ (weights * shapes * w)
    system = np.block([[np.zeros_like(loss), np.diag(w)], [-np.diag(w), -loss]])
    eigenvalues, vectors = np.linalg.eig(system)
    poles = eigenvalues.astype(np.complex128)
    right = vectors.astype(np.complex128)
    left = np.linalg.inv(right)
    upper = np.imag(poles) > 0.0
    use = upper | (np.imag(poles) == 0.0)  # an overdamped mode counts once, not as half of a pair
    weight = np.where(upper[use], 2.0, 1.0)
    drive = np.asarray(left[use][:, w.size :] @ values, dtype=np.complex128)
    show = np.asarray(
        (values / w[:, None]).T @ right[: w.size][:, use] * weight, dtype=np.complex128
    )
    return felt(HubResponse(locked(mobility), poles[use], drive, show))


def felt(response: HubResponse) -> HubResponse:
    """A response without the modes that move the hub by less than rounding: those of a stiff panel
    on a soft hinge."""
    gain = response.drive / response.poles[:, None]
    size = np.abs(np.einsum("mp,pw->pmw", response.show, gain))  # per motion and wrench
    kept = np.any(size > ROUNDING * np.sum(size, axis=0), axis=(1, 2))
    return replace(
        response,
        poles=response.poles[kept],
        drive=response.drive[kept],
        show=response.show[:, kept],
    )


def relative_motion(start: Array, end: Array) -> Array:
    """`(t, 6)` from one motion to another: difference of displacements,
    rotation vector of the relative attitude."""
    turn = Rotation.from_rotvec(start[:, 3:]).inv() * Rotation.from_rotvec(end[:, 3:])
    return np.hstack([end[:, :3] - start[:, :3], turn.as_rotvec()])


@dataclass(frozen=True, eq=False)
class Scenario:
    """A wrench on the hub, how long it is followed, and the reference motion."""

    profile: Profile
    duration: float  # [s]
    watched: tuple[int, ...]  # hub motions (0..5) that are compared: those the profile drives
    response: HubResponse
    largest: Array  # (w,) largest elastic part of each watched motion
    beat: float  # the switching times are multiples of it [s]
    nonlinear: float = 0.0  # what large motion would change, relative to the largest elastic part

    def scaled(self, factor: float) -> "Scenario":
        """The same task with a wrench multiplied by `factor`, still linear."""
        profile = Profile(self.profile.times, locked(factor * self.profile.wrench))
        return replace(self, profile=profile, largest=locked(factor * self.largest))

    def motion(self, at: Array) -> Array:
        """`(t, 6)` the hub's reference motion."""
        return self.response.motion(self.profile, at)

    def error(
        self, motion: Array, timestep: float, rigid: Array | None = None, shift: float = 0.0
    ) -> float:
        """Largest error of the hub's simulated motion `(t, 6)` over the largest elastic part of it.

        With `rigid`, that of the frozen appendage by the same integrator, only the elastic
        parts are compared. The simulated time after step k is `(k + shift) timestep`: the
        integrator's own clock.
        """
        at = timestep * (np.arange(1, motion.shape[0] + 1) + shift)
        if not np.all(np.isfinite(motion)):
            return float("inf")
        exact = self.response.elastic(self.profile, at)
        if rigid is None:
            rigid = self.response.rigid(self.profile, at)
        worst = self.size(motion - exact - rigid)
        return worst if np.isfinite(worst) else float("inf")

    def size(self, motion: Array) -> float:
        """The largest of the watched motions, relative to their elastic parts."""
        largest = np.max(np.abs(motion[:, list(self.watched)]), axis=0)
        return float(np.max(largest / self.largest))


def make_scenario(
    task: Task,
    profile: Profile | None = None,
    duration: float | None = None,
    amplitude: float | None = None,
) -> Scenario:
    """What is asked of the models of a task.

    Left out, the profile is a doublet about the first kept port's axis, its amplitude [N, N
    m] is small enough to stay linear, and the duration [s] is four periods of the first
    coupled mode, rounded up.
    """
    full = task.full
    hub = task.hub
    beam = task.beam
    response = hub_response(full, beam.rigid_mass(), hub.mass_matrix(), np.asarray(hub.offset))
    if duration is None:
        longest = 0.0 if profile is None else float(profile.times[-1])
        duration = round_up(max(PERIODS * response.slowest, longest))
    shortest = LEAST_PERIODS * response.slowest
    longest = MOST_PERIODS * response.slowest
    if not shortest <= duration <= longest:
        raise InputError(
            f"duration = {duration!r} s must lie from {shortest:.4g} to {longest:.4g} s, "
            f"{LEAST_PERIODS:g} to {MOST_PERIODS:g} periods of the slowest mode; left out, it is "
            f"{PERIODS:g}."
        )
    if profile is None:
        profile = _doublet(
            response,
            port=next(port for port in DRIVEN if port in full),
            duration=duration,
            length=beam.length,
            amplitude=amplitude,
        )
    fine = np.linspace(0.0, duration, 4001)
    largest = np.max(np.abs(response.elastic(profile, fine)), axis=0)
    driven = np.any(profile.wrench != 0.0, axis=0)
    watched = tuple(np.flatnonzero(driven & (largest > 0.0)).tolist())
    if not watched:
        raise InputError(
            "the profile drives no hub motion in which the appendage bends; push along an axis of "
            f"a kept port ({', '.join(p for p in PORTS if p in full)})."
        )
    return Scenario(
        profile,
        duration=duration,
        watched=watched,
        response=response,
        largest=locked(largest[list(watched)]),
        beat=_beat(profile.times),
    )


def _doublet(
    response: HubResponse, *, port: str, duration: float, length: float, amplitude: float | None
) -> Profile:
    """Plus and minus, of a size that is given, or a power of ten small enough to stay linear."""
    axis = DRIVEN[port]
    half = duration / PULSE / 2.0
    wrench = np.zeros((2, 6))
    wrench[0, axis] = 1.0
    wrench[1, axis] = -1.0
    unit = Profile(locked([0.0, half, 2.0 * half]), locked(wrench))
    motion = response.elastic(unit, np.linspace(0.0, duration, 2001))
    largest = np.max(np.abs(motion), axis=0)
    largest[:3] /= length
    size = amplitude or 10.0 ** np.floor(np.log10(SMALL / float(np.max(largest))))
    return Profile(unit.times, locked(size * wrench))


def round_up(value: float) -> float:
    """The next 1, 2, 3 or 6 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(m * power for m in (*ROUND, 10.0) if m * power >= value * (1.0 - 1e-9)))


def _beat(times: Array) -> float:
    """The largest time that goes into every switching time, to a millionth of the last."""
    unit = float(times[-1]) * 1e-6
    return unit * float(np.gcd.reduce(np.rint(times[1:] / unit).astype(np.int64)))


def parse_profile(content: str, source: str) -> Profile:
    """A profile from CSV text: a column `time` [s] and any of fx fy fz [N], mx my mz [N m];
    a row holds until the next.

    The last row only ends the profile.
    """
    names, times, values = held_columns(content, f"profile {source!r}", COLUMNS)
    wrench = np.zeros((times.size - 1, 6))
    wrench[:, [COLUMNS.index(name) for name in names]] = values[:-1]
    return Profile(locked(times), locked(wrench))
