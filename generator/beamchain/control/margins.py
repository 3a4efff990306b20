"""Margins of a closed loop: at every input with the other loops closed, and of all loops at
once."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from beamchain import report
from beamchain.control.closed_loop import ClosedLoop, dead_beat
from beamchain.control.controllers import Response
from beamchain.control.delay_margin import sampled_delay_margin
from beamchain.control.instability import Instability, sentences
from beamchain.control.mu import balanced_bounds, bound
from beamchain.control.systems import Complex
from beamchain.ports.motions import Array, locked
from beamchain.ports.peaks import Extremum, crossings, largest
from beamchain.warning_codes import Caution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AT_ZERO = 1e-6  # of the lowest frequency, at which the response at rest is taken
VANISHING = 1e-8  # size of a response beside that at neighbouring frequencies, which is rounding
REAL = 1e-4  # imaginary by real part of a response that is real at rest
NO = float("nan")
NONE = Extremum(NO, NO)


@dataclass(frozen=True, eq=False, repr=False)
class LoopMargins:
    """Margins at an input of the plant, the loops of all others closed;
    infinite where there is no limit.

    Of an unstable closed loop they are not defined: NaN. Where plant and controller have direct
    parts and no dead time, a margin may be reached at infinite frequency alone; its frequency is
    then infinite.

    Args:
        input, outputs: the input that is broken, and what its loops measure.
        stable: whether the closed loop is stable, all loops together.
        causes: whether, of an unstable one, this loop is to blame (`Instability.causes`).
        gain: factor by which the gain may rise, and `gain_frequency` at which the loop
            then rings [rad/s].
        lowest_gain: factor below one to which it may fall, and `lowest_gain_frequency`; 0 where it
            may vanish.
        phase: [degrees] between -180 and 180, at `phase_frequency` [rad/s]: the least change in
            size that reaches the limit. Signed: where positive the phase of the open loop may fall
            by it (a lag), where negative it may rise by its size (a lead).
        delay: further dead time that the loop bears [s].
        modulus: modulus margin, the least `|1 + L|`, at `modulus_frequency` [rad/s].
        disk: disk margin (balanced, skew 0) at `disk_frequency` [rad/s]:
            gain and phase may change together by it, the gain from `(2 - disk)/(2 + disk)` up to
            `(2 + disk)/(2 - disk)`; of 2 or more the gain may rise without limit, and vanish; of
            more than 2 its sign may change as well.
        omega, response: `(k,)` [rad/s] and the open loop's response.
        modes: by figure (`gain`, `lowest_gain`, `phase`, `modulus`, `disk`) the flexible mode of a
            `Plant` that answers most within 20 % of the margin's frequency (of a sampled loop: of
            the frequency at which its samples show it); figures without one are left out.

    Example:
        >>> import beamchain as bc, control
        >>> plant = control.ss(control.tf([1.0], [1.0, 1.0, 0.0]))
        >>> loop = bc.margins(plant, control.tf([2.0], [0.1, 1.0])).loops[0]
        >>> loop.name, round(loop.gain_db, 2), round(loop.delay, 3)
        ('u[0] from y[0]', 14.81, 0.445)
    """

    input: str
    outputs: tuple[str, ...]
    stable: bool
    causes: bool
    gain: float
    gain_frequency: float
    lowest_gain: float
    lowest_gain_frequency: float
    phase: float
    phase_frequency: float
    delay: float
    modulus: float
    modulus_frequency: float
    disk: float
    disk_frequency: float
    omega: Array
    response: Response
    modes: Mapping[str, str] = field(default_factory=dict[str, str])

    def __repr__(self) -> str:
        state = "stable" if self.stable else "unstable"
        return (
            f"<LoopMargins of {self.name}, {state}: gain {self.gain_db:.4g} dB, phase "
            f"{self.phase:.4g} degrees, delay {self.delay:.4g} s, disk {self.disk:.4g}>"
        )

    @property
    def name(self) -> str:
        """Input and what its loops measure."""
        return f"{self.input} from {' + '.join(self.outputs)}"

    @property
    def gain_db(self) -> float:
        """`gain` [dB]."""
        return _decibels(self.gain)

    @property
    def lowest_gain_db(self) -> float:
        """`lowest_gain` [dB]; minus infinity where it may vanish."""
        return _decibels(self.lowest_gain)

    def as_dict(self) -> dict[str, Any]:
        """For JSON, without the curve; None where there is no limit."""
        figures = (
            "gain",
            "gain_db",
            "gain_frequency",
            "lowest_gain",
            "lowest_gain_db",
            "lowest_gain_frequency",
            "phase",
            "phase_frequency",
            "delay",
            "modulus",
            "modulus_frequency",
            "disk",
            "disk_frequency",
        )
        return {
            "input": self.input,
            "output": " + ".join(self.outputs),
            "stable": self.stable,
            "causes": self.causes,
            **{key: _finite(getattr(self, key)) for key in figures},
            "modes": dict(self.modes),
        }

    @property
    def limited(self) -> dict[str, float]:
        """Frequencies of the figures that are limited [rad/s]."""
        names = ("gain", "lowest_gain", "phase", "modulus", "disk")
        at = {name: float(getattr(self, f"{name}_frequency")) for name in names}
        return {name: w for name, w in at.items() if np.isfinite(w) and w > 0.0}


@dataclass(frozen=True, eq=False, repr=False)
class Margins:
    """Margins of a closed loop; of an unstable one all figures are NaN.

    Args:
        loops: at every input that the controller drives, the loops of the others closed.
        stable: whether the closed loop is stable.
        all_at_once: disk margin of all inputs at once, each by a gain and phase of its own: the
            loop stays stable for all factors `(1 + d)/(1 - d)`, `|d|` below half of it; of 2 or
            more all gains may rise without limit. From an
            upper bound of mu of `(S - T)/2`, which is mu itself for up to three inputs.
        peak_sensitivity, peak_complementary: largest singular values of S and T at the inputs.
        poles: `(n,)` of the closed loop [rad/s], dead times as Pade approximations; of a sampled
            one `log(z)/T`, those at z = 0 left out.
        instabilities: why it is unstable; empty where it is stable.
        timestep: [s] of the samples at which all of it holds; 0: continuous.
        pose: label of the pose; empty of a plant in none.
        beyond: sentences on figures above the highest mode kept that their loop shows.
        warnings: what is probably a mistake in the controller.
        omega, sensitivity, complementary: `(k,)` [rad/s] and largest singular values of S and T.

    Example:
        >>> import beamchain as bc, control
        >>> plant = control.ss(control.tf([1.0], [1.0, 1.0, 0.0]))
        >>> found = bc.margins(plant, control.tf([2.0], [0.1, 1.0]))
        >>> found.stable, round(found.loops[0].gain, 3), round(found.loops[0].phase, 1)
        (True, 5.5, 31.7)
        >>> bool(found.all_at_once.value <= found.loops[0].modulus * 2.0)
        True
    """

    loops: tuple[LoopMargins, ...]
    stable: bool
    all_at_once: Extremum
    peak_sensitivity: Extremum
    peak_complementary: Extremum
    poles: Complex
    instabilities: tuple[Instability, ...]
    timestep: float
    pose: str
    beyond: tuple[str, ...]
    omega: Array
    sensitivity: Array
    complementary: Array
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        when = f", sampled at {self.timestep:g} s" if self.timestep else ""
        what = "; ".join([repr(loop)[1:-1] for loop in self.loops] if self.stable else self.reasons)
        return f"<Margins{f' at {self.pose}' if self.pose else ''}{when}: {what or 'UNSTABLE'}>"

    @property
    def reasons(self) -> list[str]:
        """Why it is unstable in words: a question on signs before all where several poles ask it,
        then a sentence per growing pole."""
        return sentences(self.instabilities)

    @property
    def table(self) -> "report.Table":
        """All figures, gains in dB."""
        return report.margin_table([self])

    def bode(self) -> "Figure":
        """Gain and phase of every open loop, its margins marked."""
        return report.open_loop_figure([self])

    def nichols(self) -> "Figure":
        """Every open loop in the Nichols plane, with frequencies."""
        return report.nichols_figure([self])

    def _repr_html_(self) -> str:
        return report.margins_html(self)

    def as_dict(self) -> dict[str, Any]:
        """For JSON, without curves; None where there is no limit."""
        extrema = {
            key: {name: _finite(value) for name, value in getattr(self, key)._asdict().items()}
            for key in ("all_at_once", "peak_sensitivity", "peak_complementary")
        }
        return {
            "pose": self.pose,
            "stable": self.stable,
            "timestep": self.timestep,
            **extrema,
            "poles": [[pole.real, pole.imag] for pole in self.poles.tolist()],
            "instabilities": [one.as_dict() for one in self.instabilities],
            "loops": [loop.as_dict() for loop in self.loops],
        }


def margins_of(closed: ClosedLoop) -> Margins:
    """All margins of a closed loop, without what only a `Plant` tells."""
    omega = closed.omega
    loop = closed.open_loop(omega)
    eye = np.eye(len(closed.inputs))
    sensitivity = sensitivity_of(loop)
    at_all, peak_s, peak_t = _of_all(closed, sensitivity)
    poles = closed.to_s(closed.eigenvalues)
    return Margins(
        loops=tuple(
            _loop_margins(closed, i, 1.0 / sensitivity[:, i, i] - 1.0)
            for i in range(len(closed.inputs))
        ),
        stable=closed.stable,
        all_at_once=at_all,
        peak_sensitivity=peak_s,
        peak_complementary=peak_t,
        poles=poles[~dead_beat(poles, closed.step)],
        instabilities=(),
        timestep=closed.step,
        pose="",
        beyond=(),
        omega=locked(omega),
        sensitivity=locked(_largest(sensitivity)),
        complementary=locked(_largest(eye - sensitivity)),
        warnings=tuple(_long_delays(closed, loop)),
    )


def _long_delays(closed: ClosedLoop, loop: Complex) -> list[str]:
    """What to say of dead times that are longer than the period at which a loop alone, `(k, n, n)`
    on the closed loop's grid, first has the gain 1."""
    out: list[str] = []
    for i, (name, delay) in enumerate(zip(closed.inputs, closed.fed.delays, strict=True)):
        large = np.abs(loop[:, i, i]) > 1.0
        crossings = closed.omega[1:][large[1:] != large[:-1]]
        if crossings.size and delay > 2.0 * np.pi / float(crossings[0]):
            out.append(
                Caution(
                    "long-delay",
                    f"{name}: delay = {delay:g} s is longer than a period of the loop's crossover "
                    f"({2.0 * np.pi / float(crossings[0]):.3g} s, at {float(crossings[0]):.3g} "
                    "rad/s); delays are in seconds.",
                )
            )
    return out


def _of_all(closed: ClosedLoop, sensitivity: Complex) -> tuple[Extremum, Extremum, Extremum]:
    """Disk margin of all inputs at once, and the peaks of S and T."""
    if not closed.stable:
        return NONE, NONE, NONE
    omega = closed.omega
    eye = np.eye(len(closed.inputs))

    def at(w: float) -> Complex:
        return sensitivity_of(closed.open_loop(np.array([w])))[0]

    def peak(values: Array, size: Callable[[Complex], float]) -> Extremum:
        limit = None if closed.limit is None else size(sensitivity_of(closed.limit))
        return largest(omega, values, lambda w: size(at(w)), limit)

    peak_s = peak(_largest(sensitivity), lambda s: float(np.linalg.norm(s, 2)))
    peak_t = peak(_largest(eye - sensitivity), lambda s: float(np.linalg.norm(eye - s, 2)))
    # (S - T)/2 = S - 1/2
    middle = sensitivity - eye / 2.0
    bounds = _refined(middle, balanced_bounds(middle))
    mu = peak(bounds, lambda s: bound(s - eye / 2.0))
    return Extremum(1.0 / mu.value, mu.frequency), peak_s, peak_t


def sensitivity_of(loop: Complex | Array) -> Complex:
    """`S = 1/(1 + L)` `(..., n, n)`."""
    return np.linalg.inv(np.eye(loop.shape[-1]) + loop).astype(np.complex128)


def _refined(matrices: Complex, bounds: Array) -> Array:
    """Upper bounds `(k,)` of mu, made as small as scaling makes them where that can matter for
    the largest."""
    out = bounds.copy()
    top = 0.0
    for k in np.argsort(-bounds):
        if bounds[k] <= top:
            break
        out[k] = bound(matrices[k])
        top = max(top, float(out[k]))
    return np.minimum(out, top)


def _largest(matrices: Complex) -> Array:
    """`(k,)` largest singular values of matrices `(k, n, n)`."""
    return np.asarray(np.linalg.norm(matrices, 2, axis=(1, 2)), dtype=np.float64)


class _Figures(NamedTuple):
    """Figures of one open loop; those that there are not are NaN."""

    gain: Extremum = NONE
    lowest: Extremum = NONE
    phase: Extremum = NONE
    delay: float = NO
    modulus: Extremum = NONE
    disk: Extremum = NONE


def _loop_margins(closed: ClosedLoop, i: int, response: Complex) -> LoopMargins:
    """Margins of one open loop, on the grid of all."""
    figures = _figures(closed, i, response) if closed.stable else _Figures()
    return LoopMargins(
        input=closed.inputs[i],
        outputs=closed.measured[i],
        stable=closed.stable,
        causes=not closed.stable,  # until it is known which are to blame
        gain=figures.gain.value,
        gain_frequency=figures.gain.frequency,
        lowest_gain=figures.lowest.value,
        lowest_gain_frequency=figures.lowest.frequency,
        phase=figures.phase.value,
        phase_frequency=figures.phase.frequency,
        delay=figures.delay,
        modulus=figures.modulus.value,
        modulus_frequency=figures.modulus.frequency,
        disk=figures.disk.value,
        disk_frequency=figures.disk.frequency,
        omega=locked(closed.omega),
        response=response,
    )


def _figures(closed: ClosedLoop, i: int, response: Complex) -> _Figures:
    omega = closed.omega

    def at(w: float) -> complex:
        return complex(1.0 / sensitivity_of(closed.open_loop(np.array([w])))[0, i, i] - 1.0)

    # of the open loop at infinite frequency, the other loops closed
    limit = None
    if closed.limit is not None:
        limit = complex(1.0 / sensitivity_of(closed.limit)[i, i] - 1.0)
    factors = _phase_crossings(closed, omega, response, at)
    if limit is not None and limit.real < 0.0:
        factors.append(Extremum(_factor(limit), np.inf))
    gain = min((one for one in factors if one.value > 1.0), default=Extremum(np.inf, np.inf))
    lowest = max((one for one in factors if one.value < 1.0), default=Extremum(0.0, np.inf))
    phases = [
        Extremum(float(np.degrees(np.angle(-value))), w)
        for w, value in _gain_crossings(omega, response, at)
    ]
    phase = min(phases, key=lambda one: abs(one.value), default=Extremum(np.inf, np.inf))
    later = [float(np.radians(np.mod(one.value, 360.0))) / one.frequency for one in phases]
    if limit is not None and abs(limit) >= 1.0:
        later.append(0.0)  # however short, a dead time turns it to -1 at some high frequency
    modulus = largest(
        omega,
        -np.abs(1.0 + response),
        lambda w: -abs(1.0 + at(w)),
        None if limit is None else -abs(1.0 + limit),
    )
    size = np.abs((1.0 - response) / (1.0 + response))
    disk = largest(
        omega,
        size,
        lambda w: abs((1.0 - at(w)) / (1.0 + at(w))),
        None if limit is None else abs((1.0 - limit) / (1.0 + limit)),
    )
    return _Figures(
        gain,
        lowest,
        phase,
        min(later, default=float("inf"))
        if closed.held is None
        else sampled_delay_margin(closed, closed.held, i),
        Extremum(-modulus.value, modulus.frequency),
        Extremum(2.0 / disk.value, disk.frequency),
    )


def _phase_crossings(
    closed: ClosedLoop, omega: Array, response: Complex, at: Callable[[float], complex]
) -> list[Extremum]:
    """Factors of the gain that bring an open loop to -1, and where."""
    out: list[Extremum] = []
    for k, w in crossings(omega, response.imag, lambda w: at(w).imag):
        value = at(w)
        # at an undamped pole the response changes its sign through infinity, at an undamped zero
        # through nothing
        vanishes = abs(value) < VANISHING * float(np.abs(response[k : k + 2]).max())
        if not (vanishes or closed.undamped(w)):
            out.append(Extremum(_factor(value), w))
    still = AT_ZERO * float(omega[0])
    rest = at(still), at(10.0 * still)
    if abs(rest[1].imag) < REAL * abs(rest[1]) and abs(rest[1] - rest[0]) < REAL * abs(rest[0]):
        out.append(Extremum(_factor(rest[0]), 0.0))
    if closed.step and omega[-1] >= np.pi / closed.step:
        out.append(Extremum(_factor(complex(response[-1])), float(omega[-1])))
    return [one for one in out if np.isfinite(one.value) and one.value > 0.0]


def _factor(value: complex) -> float:
    """Of the gain that brings a real response to -1."""
    return -1.0 / value.real if value.real else float("inf")


def _gain_crossings(
    omega: Array, response: Complex, at: Callable[[float], complex]
) -> list[tuple[float, complex]]:
    """Frequencies at which an open loop has the size one, and its values."""
    found = crossings(omega, np.abs(response) - 1.0, lambda w: abs(at(w)) - 1.0)
    return [(w, at(w)) for _, w in found]


def _decibels(factor: float) -> float:
    return float(20.0 * np.log10(factor)) if factor != 0.0 else float("-inf")


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
