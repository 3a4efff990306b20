"""What a study asks of every model: a hub with an appendage, a wrench on the hub, a duration, and the exact answer."""

import csv
import io
from dataclasses import dataclass, replace

import numpy as np

from beamchain.errors import InputError
from beamchain.ports.motions import PORTS, Array, locked
from beamchain.studies.field import Task
from beamchain.studies.reference import HubResponse, LargeReference, Profile, hub_response

COLUMNS = ("fx", "fy", "fz", "mx", "my", "mz")
MOTIONS = ("tx", "ty", "tz", "x", "y", "z")  # names of hub motions as in [scene] axes

#: Motion of the hub that the default doublet drives, per port, in the order in which ports are looked for.
DRIVEN = {"xy": 5, "xz": 4, "torsion": 3, "axial": 0}

ROUND = (1.0, 2.0, 3.0, 6.0)  # durations and pulses are these times a power of ten
PERIODS = 4.0  # of the first coupled mode, at least
PULSE = 15.0  # the default doublet is a fifteenth of the duration
SMALL = 1e-5  # elastic hub motion of the default doublet at most [rad, or share of the appendage's length]
LONGEST_CSV = 1_000_000


@dataclass(frozen=True, eq=False)
class Scenario:
    """A wrench on the hub, how long it is followed, and the reference motion."""

    profile: Profile
    duration: float  # [s]
    watched: tuple[int, ...]  # hub motions (0..5) that are compared: those the profile drives
    response: HubResponse
    largest: Array  # (w,) largest elastic part of each watched motion
    beat: float  # the switching times are multiples of it [s]
    nonlinear: float = 0.0  # what large motion changes, relative to the largest elastic part
    large: LargeReference | None = None  # where that is too much for the linear motion

    def in_large_motion(self, reference: LargeReference) -> "Scenario":
        """The same task, compared with what happens in large motion."""
        moved = np.abs(reference.elastic(np.linspace(0.0, self.duration, 4001)))
        largest = locked(np.max(moved, axis=0)[list(self.watched)])
        return replace(self, large=reference, largest=largest, nonlinear=reference.figures.nonlinear)

    def scaled(self, factor: float) -> "Scenario":
        """The same task with a wrench multiplied by `factor`, still linear."""
        profile = Profile(self.profile.times, locked(factor * self.profile.wrench))
        return replace(self, profile=profile, largest=locked(factor * self.largest))

    def motion(self, at: Array) -> Array:
        """`(t, 6)` the hub's reference motion."""
        return self.response.motion(self.profile, at) if self.large is None else self.large.motion(at)

    def error(self, motion: Array, timestep: float, rigid: Array | None = None, shift: float = 0.0) -> float:
        """Largest error of the hub's simulated motion `(t, 6)` over the largest elastic part of it.

        With `rigid`, that of the frozen appendage by the same integrator, only the elastic parts are compared. The simulated
        time after step k is `(k + shift) timestep`: the integrator's own clock.
        """
        at = timestep * (np.arange(1, motion.shape[0] + 1) + shift)
        if not np.all(np.isfinite(motion)):
            return float("inf")
        if self.large is not None:
            gap = self.large.gap(motion, at, rigid)
        else:
            exact = self.response.elastic(self.profile, at)
            gap = motion - exact - (self.response.rigid(self.profile, at) if rigid is None else rigid)
        worst = self.size(gap)
        return worst if np.isfinite(worst) else float("inf")

    def size(self, motion: Array) -> float:
        """The largest of the watched motions, relative to their elastic parts."""
        return float(np.max(np.max(np.abs(motion[:, list(self.watched)]), axis=0) / self.largest))


def make_scenario(
    task: Task, profile: Profile | None = None, duration: float | None = None, amplitude: float | None = None
) -> Scenario:
    """What is asked of the models of a task.

    Left out, the profile is a doublet about the first kept port's axis, its amplitude [N, N m] is small enough to stay
    linear, and the duration [s] is four periods of the first coupled mode, rounded up.
    """
    full, hub, beam = task.full, task.hub, task.beam
    response = hub_response(full, beam.rigid_mass(), hub.mass_matrix(), np.asarray(hub.offset))
    if duration is None:
        longest = 0.0 if profile is None else float(profile.times[-1])
        duration = rounded_up(max(PERIODS * response.slowest, longest))
    if profile is None:
        profile = _doublet(response, next(port for port in DRIVEN if port in full), duration, beam.length, amplitude)
    fine = np.linspace(0.0, duration, 4001)
    largest = np.max(np.abs(response.elastic(profile, fine)), axis=0)
    watched = tuple(int(i) for i in np.flatnonzero(np.any(profile.wrench != 0.0, axis=0)) if largest[i] > 0.0)
    if not watched:
        raise InputError(
            "the profile drives no hub motion in which the appendage bends; push along an axis of a kept port "
            f"({', '.join(p for p in PORTS if p in full)})."
        )
    return Scenario(profile, duration, watched, response, locked(largest[list(watched)]), _beat(profile.times))


def _doublet(response: HubResponse, port: str, duration: float, length: float, amplitude: float | None) -> Profile:
    """Plus and minus, of a size that is given, or a power of ten small enough to stay linear."""
    axis, half = DRIVEN[port], duration / PULSE / 2.0
    wrench = np.zeros((2, 6))
    wrench[0, axis], wrench[1, axis] = 1.0, -1.0
    unit = Profile(locked([0.0, half, 2.0 * half]), locked(wrench))
    moved = np.max(np.abs(response.elastic(unit, np.linspace(0.0, duration, 2001))), axis=0)
    moved[:3] /= length
    size = amplitude or 10.0 ** np.floor(np.log10(SMALL / float(np.max(moved))))
    return Profile(unit.times, locked(size * wrench))


def rounded_up(value: float) -> float:
    """The next 1, 2, 3 or 6 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(m * power for m in (*ROUND, 10.0) if m * power >= value * (1.0 - 1e-9)))


def _beat(times: Array) -> float:
    """The largest time that goes into every switching time, to a millionth of the last."""
    unit = float(times[-1]) * 1e-6
    return unit * float(np.gcd.reduce(np.rint(times[1:] / unit).astype(np.int64)))


def parse_profile(content: str, source: str) -> Profile:
    """A profile from CSV text: a column `time` [s] and any of fx fy fz [N], mx my mz [N m]; a row holds until the next.

    The last row only ends the profile.
    """
    try:
        rows = [row for row in csv.reader(io.StringIO(content)) if row and not row[0].lstrip().startswith("#")]
    except csv.Error as error:
        raise InputError(f"profile {source!r} is no CSV ({error}); give numbers between commas.") from None
    head = [cell.strip() for cell in rows[0]] if rows else []
    unknown = [name for name in head if name not in ("time", *COLUMNS)]
    if "time" not in head or unknown or len(head) < 2 or not 3 <= len(rows) <= LONGEST_CSV:
        raise InputError(
            f"profile {source!r} has the head {', '.join(head) or 'nothing'} and {max(len(rows) - 1, 0)} rows; give "
            f"a column time, one or more of {', '.join(COLUMNS)}, and at least two rows."
        )
    try:
        values = np.array([[float(cell) for cell in row] for row in rows[1:]])
    except ValueError as error:
        raise InputError(f"profile {source!r}: {error}; give one number per column in every row.") from None
    times = values[:, head.index("time")]
    if not np.all(np.isfinite(values)) or times[0] != 0.0 or np.any(np.diff(times) <= 0.0):
        raise InputError(f"profile {source!r}: times must start at 0 and ascend, and every number must be finite.")
    wrench = np.zeros((times.size - 1, 6))
    for name in {*head} - {"time"}:
        wrench[:, COLUMNS.index(name)] = values[:-1, head.index(name)]
    return Profile(locked(times), locked(wrench))
