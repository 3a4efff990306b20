"""The error that a turning wheel makes, over its speeds: whirl included, resonances resolved.

The wheel's gyroscopic moments make A and C linear in its speed Omega, `A = A0 + Omega A1`. At
`s = j h Omega`, h the order of a disturbance, they are `(A1/(j h)) s`, so that

    (s - A0 - Omega A1) x = B u   becomes   (s - E^-1 A0) x = E^-1 B u,   E = 1 - A1/(j h),

a system that does not depend on the speed: its eigenvalues are the crossings of the line h Omega
with the whirling modes (Campbell's diagram), its Schur form gives the response at every speed.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import schur

from beamchain.pointing.error_indices import (
    ErrorIndex,
    closed_in,
    deviation_share,
    windowed_variance,
)
from beamchain.toolkit import Array, Complex, System

# half widths of a resonance, from its top, at which it is looked at
AROUND = np.sinh(np.linspace(-6.0, 6.0, 37))
LEAST = 1e-4  # of the highest speed: a range that begins at rest is looked at from there
HIGH = 0.95  # of the highest sample: lower ones are no tops, for samples lie within 2 % of theirs
MOST_TOPS = 6  # of an output
CHUNK = 2000  # speeds that are looked at together
UNDAMPED = 1e-6  # damping ratio below which a resonance has no end
RIGID = 1e-6  # of the fastest pole: slower ones are rigid motion


class SpinningSystem(NamedTuple):
    """A craft in modal coordinates with one wheel's speed left open.

    Args:
        still: A0, B, C0, D with the wheel at rest.
        by_speed: A1 and C1, their slopes by its speed.
    """

    still: System
    by_speed: tuple[Array, Array]


class Order(NamedTuple):
    """Amplitudes of one order of a wheel's disturbance over the square of its speed.

    Args:
        order: frequency over that of the wheel.
        patterns: `(inputs, p)` complex amplitudes of what acts, each of a phase of its own.
    """

    order: float
    patterns: Complex

    def turning(self, direction: float) -> Complex:
        """The patterns with the wheel turning about its axis, above zero, or against it."""
        return self.patterns if direction > 0.0 else self.patterns.conj()


class SpeedCurve(NamedTuple):
    """Indices of the error over a wheel's speed.

    Args:
        speed: `(k,)` [rad/s].
        ape_rms, ape_peak, rpe_rms, rpe_peak: `(k, outputs)`.
    """

    speed: Array
    ape_rms: Array
    ape_peak: Array
    rpe_rms: Array
    rpe_peak: Array


class Crossing(NamedTuple):
    """A speed at which an order meets a mode: `frequency` of the mode there, `damping` its ratio
    [rad/s]."""

    speed: float
    frequency: float
    damping: float
    order: float


class WheelSweep:
    """A wheel's disturbance in one direction of rotation, at any speed above zero.

    Args:
        system: the craft; its inputs those of the patterns.
        orders: what disturbs.
        direction: 1.0 about the wheel's axis, -1.0 against it.
        window: of RPE [s].
    """

    def __init__(
        self, system: SpinningSystem, orders: Sequence[Order], direction: float, window: float
    ) -> None:
        self.direction = direction
        self._window = window
        self._orders = [_OrderResponse(system, order, direction) for order in orders]

    def crossings(self, low: float, high: float) -> list[Crossing]:
        """Where an order meets a mode, between two speeds [rad/s]."""
        return [
            Crossing(
                speed=float(pole.imag) / order.order,
                frequency=float(abs(pole)),
                damping=float(-pole.real / abs(pole)),
                order=order.order,
            )
            for order in self._orders
            for pole in order.poles
            if low <= pole.imag / order.order <= high
        ]

    def amplitudes(self, speed: Array) -> Array:
        """`(orders, k, outputs)` amplitudes of the error at speeds `(k,)`; what acts at one order
        in the phases that are worst."""
        return np.array([np.abs(o.response(speed)).sum(axis=2) for o in self._orders])

    def curve(self, speed: Array) -> SpeedCurve:
        """The indices at speeds `(k,)`, whose sign is the direction."""
        size = self.amplitudes(speed)
        omega = np.array([order.order for order in self._orders])[:, None] * speed
        power = size**2 / 2.0
        kept = windowed_variance(omega, self._window)[:, :, None]
        deviation = deviation_share(omega, self._window)[:, :, None]
        return SpeedCurve(
            speed=self.direction * speed,
            ape_rms=np.sqrt(power.sum(axis=0)),
            ape_peak=size.sum(axis=0),
            rpe_rms=np.sqrt((power * kept).sum(axis=0)),
            rpe_peak=(size * deviation).sum(axis=0),
        )

    def grid(self, low: float, high: float, count: int) -> Array:
        """Speeds that resolve every resonance between two speeds, and `count` others."""
        even = np.linspace(low, high, count)
        near = [
            crossing.speed * (1.0 + max(crossing.damping, UNDAMPED) * AROUND)
            for crossing in self.crossings(low, high)
        ]
        speed = np.unique(np.concatenate([even, *near]))
        return speed[(low <= speed) & (speed <= high)]

    def resolved_curve(self, low: float, high: float, count: int) -> SpeedCurve:
        """The curve from `low` to `high`, with the tops of each output's indices."""
        curve = self.curve(self.grid(low, high, count))
        pieces = [curve]
        for index in ("ape_peak", "ape_rms", "rpe_peak", "rpe_rms"):
            for output in range(curve.ape_rms.shape[1]):

                def size(speed: Array, index: str = index, output: int = output) -> Array:
                    return getattr(self.curve(speed), index)[:, output]

                tops = [
                    closed_in(size, np.abs(curve.speed), place)
                    for place in _high_places(getattr(curve, index)[:, output])
                ]
                pieces.append(self.curve(np.array(tops)))
        return joined(pieces)


def _high_places(values: Array) -> list[int]:
    """Where samples have local maxima that are nearly as high as the highest, or become it."""
    edge = np.full(1, -np.inf)
    before = np.concatenate([edge, values[:-1]])
    after = np.concatenate([values[1:], edge])
    high = (values >= before) & (values >= after) & (values >= HIGH * values.max())
    places = np.flatnonzero(high)
    return places[np.argsort(-values[places])][:MOST_TOPS].tolist()


def joined(curves: Sequence[SpeedCurve]) -> SpeedCurve:
    """One curve of several, speeds ascending."""
    columns = SpeedCurve(*(np.concatenate(values) for values in zip(*curves, strict=True)))
    _, order = np.unique(columns.speed, return_index=True)
    return SpeedCurve(*(values[order] for values in columns))


def largest(curve: SpeedCurve) -> tuple[ErrorIndex, ErrorIndex, Array]:
    """APE and RPE at the speed that is worst for each, and the speed `(outputs,)` of the largest
    peak."""
    ape = ErrorIndex(curve.ape_rms.max(axis=0), curve.ape_peak.max(axis=0))
    rpe = ErrorIndex(curve.rpe_rms.max(axis=0), curve.rpe_peak.max(axis=0))
    return ape, rpe, curve.speed[curve.ape_peak.argmax(axis=0)]


class _OrderResponse:
    """Response to one order at any speed, by the Schur form of the system in which the speed no
    longer stands."""

    def __init__(self, system: SpinningSystem, order: Order, direction: float) -> None:
        a, b, c, d = system.still
        self.order = order.order
        patterns = order.turning(direction)
        by_speed = direction * system.by_speed[0]
        inverse = np.linalg.inv(np.eye(a.shape[0]) - by_speed / (1j * order.order))
        triangle, basis = schur(inverse @ a, output="complex")
        self._triangle: Complex = np.asarray(triangle, dtype=np.complex128)
        self._driven = np.asarray(basis.conj().T @ inverse @ b @ patterns, dtype=np.complex128)
        self._seen = c @ basis
        self._seen_by_speed = direction * system.by_speed[1] @ basis
        self._through = d @ patterns
        poles = np.diag(self._triangle)
        fastest = float(np.abs(poles).max(initial=0.0))
        self.poles: Complex = poles[(poles.imag > 0.0) & (np.abs(poles) > RIGID * fastest)]

    def response(self, speed: Array) -> Complex:
        """`(k, outputs, p)` complex amplitudes of the error at speeds `(k,)`."""
        parts = np.array_split(speed, -(-speed.size // CHUNK))
        return np.concatenate([self._response(part) for part in parts])

    def _response(self, speed: Array) -> Complex:
        states = _back_substitution(self._triangle, self._driven, self.order * speed)
        error = np.tensordot(self._seen, states, 1)
        error = error + speed[:, None] * np.tensordot(self._seen_by_speed, states, 1)
        error = np.moveaxis(error, 0, 1) + self._through
        return speed[:, None, None] ** 2 * error


def _back_substitution(triangle: Complex, right: Complex, omega: Array) -> Complex:
    """`(n, k, p)` solutions of `(j omega - T) x = right` for an upper triangle T `(n, n)`, right
    `(n, p)`, and omega `(k,)`."""
    n, p = right.shape
    s = np.asarray(1j * omega, dtype=np.complex128)
    out = np.zeros((n, s.size, p), dtype=np.complex128)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for i in reversed(range(n)):
            known = np.tensordot(triangle[i, i + 1 :], out[i + 1 :], 1)
            out[i] = (right[i] + known) / (s - triangle[i, i])[:, None]
    return out
