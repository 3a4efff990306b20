"""The pointing error that one source makes: a wheel over its speeds, a stepping drive, a random
input, a thermal snap."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from beamchain.errors import InputError
from beamchain.pointing.disturbed_craft import DisturbedCraft
from beamchain.pointing.error_indices import (
    SIGMAS,
    ErrorIndex,
    closed_in,
    largest_deviation,
    mean_share,
    mean_squares,
)
from beamchain.pointing.jitter_sources import (
    NoiseDisturbance,
    StepperDisturbance,
    ThermalSnap,
    WheelDisturbance,
)
from beamchain.pointing.modal_response import ModalResponse
from beamchain.pointing.wheel_sweep import (
    LEAST,
    RIGID,
    UNDAMPED,
    Order,
    SpeedCurve,
    WheelSweep,
    joined,
    largest,
)
from beamchain.toolkit import Array, Complex, LinearCraft, locked

Kind = Literal["wheel", "stepper", "psd", "snap"]

# gain just beside an undamped mode over that a little farther away, from which it is driven
BESIDE, AWAY, DRIVEN = 1e-6, 1e-3, 10.0
GAUSS = np.polynomial.legendre.leggauss(10)  # nodes and weights of an interval of an integral
# half widths of a resonance, where intervals end: those of an undamped one reach half its frequency
HALVINGS = 2.0 ** np.arange(-1.0, 20.0)
LOBES = 64  # of the window's weight that are integrated one by one
OCTAVE = np.sqrt(2.0)  # longest interval of an integral
HARMONICS = 256, 20_000  # least and most of a stepping drive
BEYOND = 20.0  # times the highest frequency of the craft that harmonics go
SAMPLES = 2**16, 2**20  # least and most of a period
FEW = 10  # samples of half a window, below which the error is a straight line in it
IN_WINDOW = 400  # samples of a window at least
SNAP_PERIODS, SNAP_TIMES = 20.0, 10.0  # of the slowest mode, and time constants, that are looked at
FINE = 40.0  # samples of the shortest period, and of the time constant
SHOWS = 1e-5  # of the largest contribution to a snap: smaller ones need no samples of their own
MOST_SAMPLES = 200_000  # of a snap
ONE = np.ones(1)  # the only input of a drive or a snap
REST = 1e-6  # of the lowest frequency: slow enough for the static response


@dataclass(frozen=True, eq=False)
class SourceError:
    """The error that one source makes, per output.

    Args:
        name: of the source, such as `wheel rw1`.
        kind: of the source.
        ape: absolute performance error: the error itself. Of a wheel, at the speed that is worst.
        rpe: relative performance error: its deviation from the mean over the window.
        speed: `(outputs,)` at which a wheel's error has its largest peak [rad/s]; None: no wheel.
        shares: of the modes in the error, per output: of the peak where the source is a wheel or a
            thermal snap, of the mean square where it is a drive or random. They add up to 1.
        curve: the indices over a wheel's speed; None: no wheel.
    """

    name: str
    kind: Kind
    ape: ErrorIndex
    rpe: ErrorIndex
    speed: Array | None
    shares: tuple[dict[str, float], ...]
    curve: SpeedCurve | None = None

    def __repr__(self) -> str:
        peaks = ", ".join(f"{peak:.4g}" for peak in self.ape.peak)
        return f"<SourceError {self.name!r}, APE peak {peaks}>"


def wheel_orders(source: WheelDisturbance) -> list[Order]:
    """What a wheel does to the six inputs of `wheel_inputs`, order by order.

    A force that turns about the axis, `cos(h Omega t) e1 + sin(h Omega t) e2`, is the real part of
    `(e1 - j e2) exp(j h Omega t)`.
    """
    turning = np.array([1.0, -1.0j, 0.0])
    along = np.array([0.0, 0.0, 1.0])
    none = np.zeros(3)
    out: list[Order] = []
    for harmonic in source.orders:
        patterns = [
            np.concatenate([harmonic.radial_force * turning, none]),
            np.concatenate([none, harmonic.radial_torque * turning]),
            np.concatenate([harmonic.axial_force * along, none]),
        ]
        acting = [pattern for pattern in patterns if np.any(pattern)]
        out.append(Order(harmonic.order, np.array(acting, dtype=np.complex128).T))
    return out


def branches(source: WheelDisturbance) -> list[tuple[float, float, float]]:
    """Direction of rotation, lowest and highest speed above zero."""
    low, high = source.speeds
    least = LEAST * max(abs(low), abs(high))
    out = [
        (1.0, max(low, least), high),
        (-1.0, max(-high, least), -low),
    ]
    return [(direction, first, last) for direction, first, last in out if last >= first]


def wheel_error(
    whole: DisturbedCraft, number: int, name: str, source: WheelDisturbance, window: float
) -> SourceError:
    """The error over a wheel's speeds, others turning as they do."""
    system = whole.spinning(number, source.joint)
    curves: list[SpeedCurve] = []
    for direction, low, high in branches(source):
        sweep = WheelSweep(system, wheel_orders(source), direction, window)
        _check_crossings(whole, number, name, source, sweep, low, high)
        count = source.count if high > low else 1
        curves.append(sweep.resolved_curve(low, high, count))
    curve = SpeedCurve(*(locked(values) for values in joined(curves)))
    ape, rpe, speed = largest(curve)
    shares: list[dict[str, float]] = []
    for output, worst in enumerate(speed):
        lines = wheel_lines(whole, number, source, float(worst))
        sizes = [_along(parts) for line in lines for parts in line.parts[:, output].T]
        shares.append(_named_shares(lines[0].names, np.sum(sizes, axis=0)))
    return SourceError(name, "wheel", ape, rpe, locked(speed), tuple(shares), curve)


class WheelLine(NamedTuple):
    """One order of a wheel at a speed.

    Args:
        omega: its frequency [rad/s].
        patterns: `(inputs, p)` complex amplitudes of what acts, each of a phase of its own.
        names: of what contributes to the error.
        parts: `(names, outputs, p)` its contributions.
    """

    omega: float
    patterns: Complex
    names: tuple[str, ...]
    parts: Complex


def wheel_lines(
    whole: DisturbedCraft, number: int, source: WheelDisturbance, speed: float
) -> list[WheelLine]:
    """What a wheel does at a speed, order by order."""
    response = _modal_response(whole.of_wheel(number, source.joint, speed))
    out: list[WheelLine] = []
    for order in wheel_orders(source):
        omega = order.order * abs(speed)
        patterns = speed**2 * order.turning(speed)
        parts = [response.parts(np.array([omega]), pattern)[:, 0] for pattern in patterns.T]
        out.append(WheelLine(omega, patterns, response.names, np.stack(parts, axis=2)))
    return out


def _along(parts: Complex) -> Array:
    """`(names,)` contributions `(names,)` along their sum, whose size they add up to."""
    total = complex(parts.sum())
    size = np.real(parts * np.conj(total)) / (abs(total) or 1.0)
    return np.asarray(size, dtype=np.float64)


def _named_shares(names: tuple[str, ...], shares: Array) -> dict[str, float]:
    """Shares by name, largest first; of nothing, none."""
    total = float(shares.sum())
    if not total:
        return {}
    order = np.argsort(-np.abs(shares), kind="stable")
    return {names[i]: float(shares[i]) / total for i in order if shares[i]}


def _modal_response(craft: LinearCraft) -> ModalResponse:
    return ModalResponse(craft.form().minimal(), craft.mode_names)


def _check_crossings(
    whole: DisturbedCraft,
    number: int,
    name: str,
    source: WheelDisturbance,
    sweep: WheelSweep,
    low: float,
    high: float,
) -> None:
    """Refuse speeds at which an undamped mode is driven without limit."""
    for crossing in sweep.crossings(low, high):
        if crossing.damping >= UNDAMPED:
            continue
        if _resonates(lambda speed: sweep.amplitudes(speed).sum(axis=0), crossing.speed):
            there = whole.of_wheel(number, source.joint, sweep.direction * crossing.speed)
            mode = _modal_response(there).oscillator_near(crossing.frequency)
            raise InputError(
                f"{name}: at {sweep.direction * crossing.speed:.5g} rad/s its order "
                f"{crossing.order:g} drives {mode!r} ({crossing.frequency:.5g} rad/s), which is "
                "undamped, without limit; give the mode a damping ratio, or leave that speed out "
                "of speeds."
            )


def _resonates(gain: Callable[[Array], Array], at: float) -> bool:
    """Whether a gain `(k, outputs)` over frequencies or speeds is far larger beside one of them
    than a little farther away."""
    beside, away = gain(at * (1.0 + np.array([BESIDE, AWAY])))
    return bool(np.any(beside > DRIVEN * away))


def noise_error(
    whole: DisturbedCraft, number: int, name: str, source: NoiseDisturbance, window: float
) -> SourceError:
    """The error of a random input: `sigma^2 = integral of |H|^2 S df`, a sum over lines of the
    amplitude `sqrt(2 S df)`."""
    response = _modal_response(whole.of_source(number))
    drive = np.eye(response.form.b.shape[1])
    _check_noise(response, name, source)
    omega, weights = _integral(response.poles, source, window)
    frequency = 2.0 * np.pi * np.array(source.frequency)
    density = np.exp(np.interp(np.log(omega), np.log(frequency), np.log(source.density)))
    size = np.sqrt(2.0 * density * weights / (2.0 * np.pi))
    squares = [
        mean_squares(response.parts(omega, signal) * size[None, :, None], omega, window)
        for signal in drive
    ]
    variance, deviation, shares = (np.sum(each, axis=0) for each in zip(*squares, strict=True))
    ape, rpe = np.sqrt(variance), np.sqrt(deviation)
    return SourceError(
        name,
        "psd",
        ErrorIndex(locked(ape), locked(SIGMAS * ape)),
        ErrorIndex(locked(rpe), locked(SIGMAS * rpe)),
        None,
        tuple(_named_shares(response.names, column) for column in shares.T),
    )


def _integral(poles: Complex, source: NoiseDisturbance, window: float) -> tuple[Array, Array]:
    """Nodes [rad/s] and weights of an integral over all frequencies of a density, which resolve
    every resonance and the window's weight."""
    low, high = 2.0 * np.pi * source.frequency[0], 2.0 * np.pi * source.frequency[-1]
    octaves = int(np.ceil(np.log(high / low) / np.log(OCTAVE))) + 1
    ends = [
        2.0 * np.pi * np.array(source.frequency),
        np.geomspace(low, high, octaves),
        2.0 * np.pi / window * np.arange(1, LOBES + 1),
    ]
    for pole in poles[poles.imag > 0.0]:
        width = max(-float(pole.real), UNDAMPED * float(pole.imag))
        ends += [pole.imag + width * HALVINGS, pole.imag - width * HALVINGS, pole.imag[None]]
    edges = np.unique(np.concatenate(ends))
    edges = edges[(low <= edges) & (edges <= high)]
    middle, half = (edges[1:] + edges[:-1]) / 2.0, (edges[1:] - edges[:-1]) / 2.0
    nodes, weights = GAUSS
    omega = middle[:, None] + half[:, None] * nodes
    return omega.ravel(), (half[:, None] * weights).ravel()


def _check_noise(response: ModalResponse, name: str, source: NoiseDisturbance) -> None:
    """Refuse a density that drives an undamped mode: its variance has no end."""
    low, high = 2.0 * np.pi * source.frequency[0], 2.0 * np.pi * source.frequency[-1]
    poles = response.poles
    fastest = float(np.abs(poles).max(initial=0.0))

    def gain(omega: Array) -> Array:
        drive = np.eye(response.form.b.shape[1])
        return np.sum([np.abs(response.parts(omega, u).sum(axis=0)) for u in drive], axis=0)

    for pole in poles[(low <= poles.imag) & (poles.imag <= high)]:
        if abs(pole) < RIGID * fastest or -pole.real >= UNDAMPED * abs(pole):
            continue
        if _resonates(gain, pole.imag):
            raise InputError(
                f"{name}: its frequencies hold that of {response.oscillator_near(abs(pole))!r} "
                f"({abs(pole):.5g} rad/s), which is undamped, so that its variance has no limit; "
                "give the mode a damping ratio, or end the density before it."
            )


def stepper_error(
    whole: DisturbedCraft, number: int, name: str, source: StepperDisturbance, window: float
) -> SourceError:
    """The periodic error of a stepping drive, all harmonics of its rate with their phases."""
    response = _modal_response(whole.of_source(number))
    base = 2.0 * np.pi * source.rate
    fastest = float(np.abs(response.poles).max(initial=0.0))
    count = int(np.clip(np.ceil(BEYOND * fastest / base), *HARMONICS))
    n = np.arange(1.0, count + 1.0)
    omega = base * n
    parts = response.parts(omega, ONE) * stepper_harmonics(source, n)[None, :, None]
    error = parts.sum(axis=0)
    variance, windowed, shares = mean_squares(parts, omega, window)
    wanted = int(2.0 ** np.ceil(np.log2(max(IN_WINDOW / (window * source.rate), 4.0 * count))))
    samples = int(np.clip(wanted, *SAMPLES))
    half = np.ceil(window * source.rate * samples / 2.0)
    if half >= FEW:  # a whole number of samples
        samples = round(2.0 * half / (window * source.rate))
    values = _periodic(error, samples)
    mean = _periodic(error * mean_share(omega, window)[:, None], samples)
    if half >= FEW:
        deviation = largest_deviation(values, mean, int(min(half, samples)), "wrap")
    else:  # a straight line in so short a window
        slope = _periodic(error * (1j * omega)[:, None], samples)
        deviation = np.abs(slope).max(axis=0) * window / 2.0
    return SourceError(
        name,
        "stepper",
        ErrorIndex(locked(np.sqrt(variance)), locked(np.abs(values).max(axis=0))),
        ErrorIndex(locked(np.sqrt(windowed)), locked(deviation)),
        None,
        tuple(_named_shares(response.names, column) for column in shares.T),
    )


def stepper_harmonics(source: StepperDisturbance, n: Array) -> Complex:
    """`(k,)` complex amplitudes of the harmonics n of a stepping drive.

    A staircase of steps theta less its mean slope is `theta (1/2 - {t f})`, whose harmonics are
    `theta sin(2 pi n f t) / (pi n)`; pulses of torque T and width w have
    `2 T f w sinc(n f w) cos(2 pi n f (t - w/2))`.
    """
    if source.torque is None or source.width is None:
        assert source.step is not None
        return np.asarray(-1j * source.step / (np.pi * n), dtype=np.complex128)
    share = source.rate * source.width
    size = 2.0 * source.torque * share * np.sinc(n * share)
    return np.asarray(size * np.exp(-1j * np.pi * n * share), dtype=np.complex128)


def _periodic(amplitudes: Complex, samples: int) -> Array:
    """`(samples, outputs)` of a period of harmonics 1, 2, ... with amplitudes
    `(harmonics, outputs)`."""
    spectrum = np.zeros((samples // 2 + 1, amplitudes.shape[1]), dtype=np.complex128)
    spectrum[1 : amplitudes.shape[0] + 1] = amplitudes * samples / 2.0
    return np.fft.irfft(spectrum, samples, axis=0)


def snap_error(
    whole: DisturbedCraft, number: int, name: str, source: ThermalSnap, window: float
) -> SourceError:
    """The error of a thermal snap, from rest until it has settled in its new shape."""
    response = _modal_response(whole.of_source(number))
    rise = source.time_constant

    def error(times: Array) -> Array:
        return response.rising_parts(times, rise).sum(axis=0)

    times = _snap_times(response, rise, window)
    spacing = float(times[1])  # the first is zero
    values = error(times)
    peaks = np.zeros(values.shape[1])
    shares: list[dict[str, float]] = []
    for output, place in enumerate(np.abs(values).argmax(axis=0)):
        top = closed_in(lambda t, o=output: np.abs(error(t)[:, o]), times, int(place))
        at_top = response.rising_parts(np.array([top]), rise)[:, 0, output]
        peaks[output] = abs(float(at_top.sum()))
        shares.append(_named_shares(response.names, at_top))
    reach = max(round(window / spacing / 2.0), 1)
    # at rest before, in its new shape afterwards
    padded = np.pad(values, ((2 * reach + 1, 0), (0, 0)))
    padded = np.pad(padded, ((0, 2 * reach + 1), (0, 0)), mode="edge")
    deviation = largest_deviation(padded, _running_mean(padded, reach), reach, "nearest")
    # a straight line in a window shorter than two samples
    deviation = deviation * window / (2.0 * reach * spacing)
    none = np.full(values.shape[1], np.nan)
    return SourceError(
        name,
        "snap",
        ErrorIndex(locked(none), locked(peaks)),
        ErrorIndex(locked(none), locked(deviation)),
        None,
        tuple(shares),
    )


def _snap_times(response: ModalResponse, tau: float, window: float) -> Array:
    """Times [s] that resolve all modes which show, and the load."""
    frequency = np.array([response.frequency(mode) for mode in response.names[:-1]])
    slowest = float(frequency.min(initial=1.0 / tau))
    length = max(SNAP_TIMES * tau + SNAP_PERIODS * 2.0 * np.pi / slowest, window / 4.0)
    at_rest = response.parts(np.array([REST * slowest]), ONE)[:-1]
    static = np.abs(at_rest).max(axis=(1, 2), initial=0.0)
    # a load that rises in tau leaves a mode ringing with this amplitude
    ringing = static / np.hypot(1.0, frequency * tau)
    shows = frequency[ringing > SHOWS * static.max(initial=0.0)]
    finest = min(2.0 * np.pi / float(shows.max(initial=1.0 / tau)), tau) / FINE
    finest = min(finest, window / IN_WINDOW)
    spacing = max(finest, length / MOST_SAMPLES)
    if window >= 2.0 * spacing:  # half a window is a whole number of them
        spacing = window / 2.0 / np.ceil(window / 2.0 / spacing)
    return spacing * np.arange(np.ceil(length / spacing) + 1.0)


def _running_mean(values: Array, reach: int) -> Array:
    """`(k, outputs)` mean of samples over `reach` to either side, by the trapezoidal rule."""
    total = np.cumsum((values[1:] + values[:-1]) / 2.0, axis=0)
    total = np.concatenate([np.zeros((1, values.shape[1])), total])
    place = np.arange(values.shape[0])
    first = np.maximum(place - reach, 0)
    last = np.minimum(place + reach, values.shape[0] - 1)
    return (total[last] - total[first]) / np.maximum(last - first, 1)[:, None]
