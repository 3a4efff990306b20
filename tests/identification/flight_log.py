"""Logs of a rigid hub with an elastic appendage, and what they determine; shares no code with the
package.

The appendage is a uniform beam (two bending planes, torsion) in finite elements, or a pair of them.
Hub and appendage move freely by small motions; torque is held
between samples, and the transition over a sample is the matrix exponential of the coupled
equations. A sensor adds noise, bias, quantisation and saturation.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import expm, solve

import finite_elements as fe
from solver import Craft, Modes

AXES = "xyz"


# -- the structure ---------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Elastic:
    """Modes with the port held, mass-normalised: rad/s, ratios, `(6, n)` participation;
    `(6, 6)` rigid mass about the port."""

    frequency: np.ndarray
    damping: np.ndarray
    participation: np.ndarray
    rigid: np.ndarray

    def kept(self, which):
        """Fewer modes: the others follow rigidly (their mass stays, as residual mass)."""
        number = np.arange(which) if np.isscalar(which) else np.asarray(which)
        return replace(
            self,
            frequency=self.frequency[number],
            damping=self.damping[number],
            participation=self.participation[:, number],
        )

    def damped(self, ratios):
        return replace(
            self,
            damping=np.broadcast_to(np.asarray(ratios, dtype=float), self.frequency.shape).copy(),
        )

    def at_frequencies(self, values):
        """The first modes at other frequencies (rad/s)."""
        changed = self.frequency.copy()
        changed[: len(values)] = values
        return replace(self, frequency=changed)


def doublet(elastic, axis, frequency, apart, second=0.7):
    """The appendage with its first two modes about an axis near each other,
    the second's row that much of the first's."""
    row = 3 + AXES.index(axis)
    pair = np.flatnonzero(elastic.participation[row])[:2]
    changed = elastic.at_frequencies([])
    changed.frequency[pair] = frequency * np.array([1.0, 1.0 + apart])
    part = elastic.participation.copy()
    part[row, pair] = 0.98 * part[row, pair[0]] * np.array([1.0, second]) / np.hypot(1.0, second)
    return replace(changed, participation=part)


def boom(length, line_mass, ei_xy, ei_xz, gj, polar, counts=(16, 16, 8), damping=0.005):
    """A uniform Euler beam along x, its root clamped: bending in xy and xz, torsion;
    `polar` is inertia per length."""
    section = {
        "shape": "equivalent",
        "bending_stiffness_xy": ei_xy,
        "bending_stiffness_xz": ei_xz,
        "torsion_stiffness": gj,
        "linear_mass": line_mass,
        "polar_inertia": polar,
    }
    spec = {"segment": [{"length": length, "section": section}]}
    found = fe.cantilever(spec, dict(zip(fe.PORTS, counts, strict=False)))
    damping = np.full(len(found.ports), damping)
    return Elastic(found.frequencies, damping, found.participation.T, found.rigid)


def wings(length, line_mass, ei_xy, ei_xz, gj, polar, counts=(16, 16, 8), damping=0.005):
    """Two equal booms along x and -x: of the modes, those that turn the port without pushing it."""
    one = boom(length, line_mass, ei_xy, ei_xz, gj, polar, counts, damping)
    part = np.sqrt(2.0) * one.participation
    part[:3] = 0.0
    rigid = 2.0 * np.diag(np.diag(one.rigid))
    return replace(one, participation=part, rigid=rigid)


# -- the spacecraft --------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class Hub:
    """A rigid body: mass, mass centre, inertia about it,
    the port's place and axes (rows: the port's x, y, z)."""

    mass: float = 300.0
    inertia: np.ndarray = field(default_factory=lambda: np.diag([100.0, 120.0, 150.0]))
    centre: np.ndarray = field(default_factory=lambda: np.zeros(3))
    port: np.ndarray = field(default_factory=lambda: np.zeros(3))
    axes: np.ndarray = field(default_factory=lambda: np.eye(3))

    @property
    def xml(self):
        """The bare spacecraft as MJCF, with the site `mount`."""
        j = self.inertia
        full = " ".join(
            repr(float(v)) for v in (j[0, 0], j[1, 1], j[2, 2], j[0, 1], j[0, 2], j[1, 2])
        )
        say = lambda v: " ".join(repr(float(one)) for one in v)  # noqa: E731
        return (
            '<mujoco model="bus"><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>'
            f'<inertial pos="{say(self.centre)}" mass="{self.mass!r}" fullinertia="{full}"/>'
            f'<site name="mount" pos="{say(self.port)}" xyaxes="{say(self.axes[0])} '
            f'{say(self.axes[1])}"/>'
            "</body></worldbody></mujoco>"
        )

    def carrying(self, elastic):
        """Mass over the motions of the body's origin, in its axes, and the modes."""
        craft = Craft()
        craft.body(craft.base, self.mass, self.centre, self.inertia)
        rows = elastic.participation.T
        own = Modes(elastic.frequency, elastic.damping, rows, elastic.rigid, 0.0 * rows)
        craft.modes(craft.base.at(self.port, self.axes.T), own)
        return craft.matrices()[0]


def seen(hub, elastic):
    """What torques and rotation rates can tell: `(3, 3)` inertia of all, `(3, n)` rows, `(n, n)`
    modal mass, free to translate."""
    mass = hub.carrying(elastic)
    rest = mass[3:, 3:] - mass[3:, :3] @ solve(mass[:3, :3], mass[:3, 3:], assume_a="pos")
    return rest[:3, :3], rest[:3, 3:], rest[3:, 3:]


def as_seen(hub, elastic):
    """The modes with the hub's rotation held and its translation free: frequency, damping,
    `(3, n)` rows in the hub's axes."""
    _, turning, modal = seen(hub, elastic)
    root = np.linalg.cholesky(modal)
    stiffness = np.linalg.solve(root, np.linalg.solve(root, np.diag(elastic.frequency**2)).T)
    squares, shapes = np.linalg.eigh(stiffness)
    shapes = np.linalg.solve(root.T, shapes)
    rates = np.einsum("ik,i,ik->k", shapes, 2.0 * elastic.damping * elastic.frequency, shapes)
    return np.sqrt(squares), rates / (2.0 * np.sqrt(squares)), turning @ shapes


def motion(hub, elastic):
    """`A`, `B` of x = (angles, modal coordinates, their rates), torque on the hub in."""
    inertia, turning, modal = seen(hub, elastic)
    n = elastic.frequency.size
    mass = np.block([[inertia, turning], [turning.T, modal]])
    zero = np.zeros(3)
    forces = np.hstack(
        [
            np.diag(-np.concatenate([zero, elastic.frequency**2])),
            np.diag(-np.concatenate([zero, 2.0 * elastic.damping * elastic.frequency])),
        ]
    )
    both = np.linalg.solve(mass, np.hstack([forces, np.eye(n + 3, 3)]))
    a = np.vstack([np.hstack([np.zeros((n + 3, n + 3)), np.eye(n + 3)]), both[:, :-3]])
    return a, np.vstack([np.zeros((n + 3, 3)), both[:, -3:]])


def turn(hub, elastic, time, torque, start=None):
    """Rates and angles `(n, 3)` at the samples; `torque` `(n, 3)` at a sample acts until the next.
    Starts at rest, or at `start`."""
    a, b = motion(hub, elastic)
    half = a.shape[0] // 2
    steps = np.round(np.diff(time), 9)
    kinds, which = np.unique(steps, return_inverse=True)
    x = np.zeros(2 * half) if start is None else np.array(start, dtype=float)
    states = np.empty((len(time), 2 * half))
    moves = []
    for step in kinds:
        both = expm(np.block([[a, b], [np.zeros((3, 2 * half + 3))]]) * step)
        moves.append((both[: 2 * half, : 2 * half], both[: 2 * half, 2 * half :]))
    push = np.empty((len(steps), 2 * half))
    for kind, (_, held) in enumerate(moves):
        push[which == kind] = torque[:-1][which == kind] @ held.T
    states[0] = x
    for i, kind in enumerate(which):
        x = moves[kind][0] @ x + push[i]
        states[i + 1] = x
    return states[:, half : half + 3], states[:, :3]


def response(hub, elastic, omega):
    """`(n, 3, 3)` rates per torque at the frequencies `omega` [rad/s]."""
    inertia, turning, modal = seen(hub, elastic)
    s = 1j * np.asarray(omega)[:, None, None]
    spring = (
        s**2 * modal
        + np.diag(elastic.frequency**2)
        + s * np.diag(2.0 * elastic.damping * elastic.frequency)
    )
    felt = inertia - s**2 * turning @ np.linalg.solve(
        spring, np.broadcast_to(turning.T, (s.shape[0], *turning.T.shape))
    )
    return np.linalg.inv(felt) / s


# -- torque and sensor -----------------------------------------------------------------------------
def steps_at(time, size=1.0, dwell=5.0, seed=0):
    """A sign drawn anew every `dwell` seconds."""
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], int(time[-1] // dwell) + 2)
    return size * signs[(time // dwell).astype(int)]


def chirp(time, size=1.0, low=0.02, high=2.0):
    """A sine whose frequency rises evenly from `low` to `high` [Hz]."""
    span = time[-1] - time[0]
    return size * np.sin(2.0 * np.pi * (low * time + 0.5 * (high - low) * time**2 / span))


def noise(time, size=1.0, seed=0):
    return size * np.random.default_rng(seed).standard_normal(len(time))


def slew(time, size=1.0, begin=2.0, burn=6.0, pause=8.0):
    """A push, a pause and the push back."""
    there = (time >= begin) & (time < begin + burn)
    back = (time >= begin + burn + pause) & (time < begin + 2.0 * burn + pause)
    return size * (there.astype(float) - back)


@dataclass(frozen=True)
class Gyro:
    """White noise per sample [rad/s], bias, quantum and largest reading."""

    noise: float = 0.0
    bias: float = 0.0
    quantum: float = 0.0
    limit: float = np.inf

    def read(self, rates, seed=0):
        rates = (
            rates
            + self.bias
            + self.noise * np.random.default_rng(seed).standard_normal(rates.shape)
        )
        if self.quantum:
            rates = self.quantum * np.round(rates / self.quantum)
        return np.clip(rates, -self.limit, self.limit)


def record(hub, elastic, time, torques, gyro=None, seed=0, start=None, attitude=False):
    """A log as a mapping; `torques` by axis (`{"z": array}`), rates about the same axes."""
    torque = np.zeros((len(time), 3))
    for axis, values in torques.items():
        torque[:, AXES.index(axis)] = values
    rates, angles = turn(hub, elastic, time, torque, start)
    rates = (gyro or Gyro()).read(rates, seed)
    log = {"time": np.asarray(time, dtype=float)}
    for axis in torques:
        i = AXES.index(axis)
        log |= {f"torque_{axis}": torque[:, i], f"rate_{axis}": rates[:, i]}
        if attitude:
            log[f"attitude_{axis}"] = angles[:, i]
    return log


def without(log, *spans):
    """The log with the samples in `spans` (s) missing."""
    keep = np.ones(len(log["time"]), dtype=bool)
    for begin, end in spans:
        keep &= (log["time"] < begin) | (log["time"] >= end)
    return {name: values[keep] for name, values in log.items()}


def as_csv(log):
    rows = np.column_stack(list(log.values()))
    return (
        "\n".join([",".join(log), *(",".join(repr(float(v)) for v in row) for row in rows)]) + "\n"
    )


# -- what the data determine -----------------------------------------------------------------------
def cramer_rao(hub, elastic, time, torques, sigma, *, rigid=True):
    """Least standard deviations of (frequency, damping, row) of every mode,
    from one axis of torque and rate.

    The inertia of all (unless `rigid` is False), the bias and the initial state are estimated with
    them. Sensitivities by central differences of `turn`. For an appendage that does not push its
    port (`wings`), about one axis.
    """
    ((axis, values),) = torques.items()
    i = AXES.index(axis)
    n = elastic.frequency.size
    torque = np.zeros((len(time), 3))
    torque[:, i] = values

    def rate(change):
        share = change[: 3 * n].reshape(3, n)
        part = elastic.participation.copy()
        part[3 + i] *= 1.0 + share[2]
        mass = elastic.rigid.copy()
        mass[3 + i, 3 + i] *= 1.0 + change[3 * n]
        other = Elastic(
            elastic.frequency * (1 + share[0]), elastic.damping * (1 + share[1]), part, mass
        )
        return turn(hub, other, time, torque)[0][:, i]

    small = np.where(np.arange(3 * n + 1) // n == 0, 1e-6, 1e-4)
    columns = [
        (rate(e) - rate(-e)) / (2.0 * s) for s, e in zip(small, np.diag(small), strict=True)
    ][: 3 * n + int(rigid)]
    half = n + 3
    # free motion, each from one initial value
    for state in (*range(3, half), half + i, *range(half + 3, 2 * half)):
        first = np.eye(2 * half)[state]
        columns.append(turn(hub, elastic, time, 0.0 * torque, first)[0][:, i])
    columns.append(np.ones(len(time)))
    jacobian = np.column_stack(columns)
    jacobian /= (norms := np.linalg.norm(jacobian, axis=0))
    _, values_, vectors = np.linalg.svd(jacobian, full_matrices=False)
    kept = values_ > 1e-12 * values_[0]
    inverse = (vectors[kept].T / values_[kept]) / norms[:, None]
    share = sigma * np.sqrt((inverse**2).sum(axis=1))[: 3 * n].reshape(3, n)
    return share * np.abs([elastic.frequency, elastic.damping, elastic.participation[3 + i]])
