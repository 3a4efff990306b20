"""The pointing error that one source makes: a wheel over its speeds, a stepping drive, a random
input, a thermal snap."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from beamchain.errors import InputError
from beamchain.pointing.disturbed_craft import DisturbedCraft
from beamchain.pointing.error_indices import (
    SIGMAS,
    ErrorIndex,
    largest_deviation,
    mean_share,
    windowed_variance,
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


def wheel_sweeps(
    whole: DisturbedCraft, number: int, source: WheelDisturbance, window: float
) -> list[tuple[WheelSweep, float, float]]:
    """A wheel's disturbance in each direction of its range, with its lowest and highest speed."""
    system = whole.spinning(number, source.joint)
    return [
        (WheelSweep(system, wheel_orders(source), direction, window), low, high)
        for direction, low, high in branches(source)
    ]


def wheel_error(
    whole: DisturbedCraft, number: int, name: str, source: WheelDisturbance, window: float
) -> SourceError:
    """The error over a wheel's speeds, others turning as they do."""
    curves: list[SpeedCurve] = []
    for sweep, low, high in wheel_sweeps(whole, number, source, window):
        _check_crossings(whole, number, name, source, sweep, low, high)
        count = source.count if high > low else 1
        curves.append(sweep.resolved_curve(low, high, count))
    curve = SpeedCurve(*(locked(values) for values in joined(curves)))
    ape, rpe, speed = largest(curve)
    shares = tuple(
        _wheel_shares(whole, number, source, float(worst), output)
        for output, worst in enumerate(speed)
    )
    return SourceError(name, "wheel", ape, rpe, locked(speed), shares, curve)


def _wheel_shares(
    whole: DisturbedCraft, number: int, source: WheelDisturbance, speed: float, output: int
) -> dict[str, float]:
    """Shares of the modes in an output's amplitude at a speed of a wheel."""
    response = _modal_response(whole.of_wheel(number, source.joint, speed))
    shares = np.zeros(len(response.names))
    for order in wheel_orders(source):
        omega = np.array([order.order * abs(speed)])
        patterns = order.patterns if speed > 0.0 else order.patterns.conj()
        for pattern in patterns.T:
            shares += _along(response.parts(omega, pattern)[:, 0, output])
    return _named_shares(response, shares)


def _along(parts: Complex) -> Array:
    """`(names,)` contributions `(names,)` along their sum, whose size they add up to."""
    total = complex(parts.sum())
    size = np.real(parts * np.conj(total)) / (abs(total) or 1.0)
    return np.asarray(size, dtype=np.float64)


def _named_shares(response: ModalResponse, shares: Array) -> dict[str, float]:
    """Shares by name, largest first; of nothing, none."""
    total = float(shares.sum())
    if not total:
        return {}
    order = np.argsort(-np.abs(shares), kind="stable")
    return {response.names[i]: float(shares[i]) / total for i in order if shares[i]}


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
        speeds = crossing.speed * (1.0 + np.array([BESIDE, AWAY]))
        beside, away = sweep.amplitudes(speeds).sum(axis=0)
        if np.any(beside > DRIVEN * away):
            there = whole.of_wheel(number, source.joint, sweep.direction * crossing.speed)
            mode = _mode_at(_modal_response(there), crossing.frequency)
            raise InputError(
                f"{name}: at {sweep.direction * crossing.speed:.5g} rad/s its order "
                f"{crossing.order:g} drives {mode!r} ({crossing.frequency:.5g} rad/s), which is "
                "undamped, without limit; give the mode a damping ratio, or leave that speed out "
                "of speeds."
            )


def _mode_at(response: ModalResponse, frequency: float) -> str:
    """Name of the oscillator nearest to a frequency [rad/s]."""
    form = response.form
    names = form.oscillators([n for n in form.names if not n.startswith("rigid_")])
    off: dict[str, float] = {}
    for name in names:
        at = [form.names.index(word) for word in (name, f"{name}_rate")]
        speed = float(np.abs(np.linalg.eigvals(form.a[np.ix_(at, at)])).max())
        off[name] = abs(speed - frequency)
    return min(off, key=lambda name: off[name], default="a mode")


def noise_error(
    whole: DisturbedCraft, number: int, name: str, source: NoiseDisturbance, window: float
) -> SourceError:
    """The error of a random input: `sigma^2 = integral of |G|^2 S df`."""
    response = _modal_response(whole.of_source(number))
    low, high = 2.0 * np.pi * source.frequency[0], 2.0 * np.pi * source.frequency[-1]
    drive = np.eye(response.form.b.shape[1])
    _check_noise(response, name, drive, low, high)
    omega, weights = _integral(response.poles, source, window)
    density = np.exp(
        np.interp(
            np.log(omega), np.log(2.0 * np.pi * np.array(source.frequency)), np.log(source.density)
        )
    )
    power = weights * density / (2.0 * np.pi)
    kept = windowed_variance(omega, window)
    outputs = response.form.c.shape[0]
    variance = np.zeros(outputs)
    deviation = np.zeros(outputs)
    shares = np.zeros((len(response.names), outputs))
    for signal in drive.T:
        parts = response.parts(omega, signal)
        total = parts.sum(axis=0)
        variance += power @ np.abs(total) ** 2
        deviation += (power * kept) @ np.abs(total) ** 2
        shares += np.einsum("k,nko->no", power, np.real(parts * total.conj()))
    ape, rpe = np.sqrt(variance), np.sqrt(deviation)
    return SourceError(
        name,
        "psd",
        ErrorIndex(locked(ape), locked(SIGMAS * ape)),
        ErrorIndex(locked(rpe), locked(SIGMAS * rpe)),
        None,
        tuple(_named_shares(response, column) for column in shares.T),
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


def _check_noise(response: ModalResponse, name: str, drive: Array, low: float, high: float) -> None:
    """Refuse a density that drives an undamped mode: its variance has no end."""
    poles = response.poles
    fastest = float(np.abs(poles).max(initial=0.0))
    for pole in poles[(low <= poles.imag) & (poles.imag <= high)]:
        if abs(pole) < RIGID * fastest or -pole.real >= UNDAMPED * abs(pole):
            continue
        omega = pole.imag * (1.0 + np.array([BESIDE, AWAY]))
        gains = [np.abs(response.parts(omega, signal).sum(axis=0)) for signal in drive.T]
        beside, away = np.sum(gains, axis=0)
        if np.any(beside > DRIVEN * away):
            raise InputError(
                f"{name}: its frequencies hold that of {_mode_at(response, abs(pole))!r} "
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
    parts = response.parts(base * n, ONE) * stepper_harmonics(source, n)[None, :, None]
    error = parts.sum(axis=0)
    power = np.abs(error) ** 2 / 2.0
    kept = windowed_variance(base * n, window)
    wanted = int(2.0 ** np.ceil(np.log2(max(IN_WINDOW / (window * source.rate), 4.0 * count))))
    samples = int(np.clip(wanted, *SAMPLES))
    half = np.ceil(window * source.rate * samples / 2.0)
    if half >= FEW:  # a whole number of samples
        samples = round(2.0 * half / (window * source.rate))
    values = _periodic(error, samples)
    mean = _periodic(error * mean_share(base * n, window)[:, None], samples)
    if half >= FEW:
        deviation = largest_deviation(values, mean, int(min(half, samples)), "wrap")
    else:  # a straight line in so short a window
        slope = _periodic(error * (1j * base * n)[:, None], samples)
        deviation = np.abs(slope).max(axis=0) * window / 2.0
    shares = np.real(parts * error.conj()).sum(axis=1)
    return SourceError(
        name,
        "stepper",
        ErrorIndex(locked(np.sqrt(power.sum(axis=0))), locked(np.abs(values).max(axis=0))),
        ErrorIndex(
            locked(np.sqrt((power * kept[:, None]).sum(axis=0))),
            locked(deviation),
        ),
        None,
        tuple(_named_shares(response, column) for column in shares.T),
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
    tau = source.time_constant

    def parts(times: Array) -> Array:
        return response.exponential_parts(times, ONE, tau)

    times = _snap_times(response, tau, window)
    spacing = float(times[1])  # the first is zero
    values = parts(times).sum(axis=0)
    peaks = np.zeros(values.shape[1])
    shares: list[dict[str, float]] = []
    for output, place in enumerate(np.abs(values).argmax(axis=0)):
        top = _closed_in(lambda t, o=output: np.abs(parts(t).sum(axis=0)[:, o]), times, int(place))
        at_top = parts(np.array([top]))[:, 0, output]
        peaks[output] = abs(float(at_top.sum()))
        shares.append(_named_shares(response, at_top))
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
    frequency = np.array([_frequency(response, mode) for mode in response.names[:-1]])
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


def _frequency(response: ModalResponse, name: str) -> float:
    form = response.form
    at = [form.names.index(word) for word in (name, f"{name}_rate")]
    return float(np.abs(np.linalg.eigvals(form.a[np.ix_(at, at)])).max())


def _closed_in(size: Callable[[Array], Array], times: Array, place: int) -> float:
    """The time of a local maximum of `size`, between the neighbours of a sample."""
    low, high = times[max(place - 1, 0)], times[min(place + 1, times.size - 1)]
    at = times[place]
    for _ in range(3):
        near = np.unique(np.append(np.linspace(low, high, 41), at))
        best = int(np.argmax(size(near)))
        low, high = near[max(best - 1, 0)], near[min(best + 1, near.size - 1)]
        at = near[best]
    return float(at)


def _running_mean(values: Array, reach: int) -> Array:
    """`(k, outputs)` mean of samples over `reach` to either side, by the trapezoidal rule."""
    total = np.cumsum((values[1:] + values[:-1]) / 2.0, axis=0)
    total = np.concatenate([np.zeros((1, values.shape[1])), total])
    place = np.arange(values.shape[0])
    first = np.maximum(place - reach, 0)
    last = np.minimum(place + reach, values.shape[0] - 1)
    return (total[last] - total[first]) / np.maximum(last - first, 1)[:, None]
