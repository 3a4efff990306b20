"""Pictures of plants."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import control
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from beamchain.ports.motions import Array
from beamchain.report.plots import (
    BEAM,
    OURS,
    RIVAL,
    WIDTH,
    drawing,
    in_hz,
    literal,
    log_axis,
    over_frequency,
    panel,
    plain,
    power,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamchain.plants.loops import Margins
    from beamchain.plants.realisation import Plant
    from beamchain.plants.scheduled import ScheduledPlant
    from beamchain.plants.uncertain_plant import WorstCase

PAIRS = 4  # of inputs and outputs that a Bode plot shows


def plot_scheduled(scheduled: "ScheduledPlant", ax: "Axes | None" = None) -> "Axes":
    """Frequencies of the modes over a drive's angle; the larger a marker,
    the larger the mode's gain."""
    ax = panel(3.8)[1] if ax is None else ax
    degrees = np.degrees(scheduled.angles)
    gain = scheduled.gain
    top = np.maximum(
        gain.max(axis=(0, 1), keepdims=True, initial=0.0), 1e-9 * gain.max(initial=0.0) + 1e-300
    )
    size = 4.0 + 60.0 * (gain / top).max(axis=(2, 3), initial=0.0)
    for k, name in enumerate(scheduled.modes):
        ax.plot(degrees, scheduled.frequency[:, k], color=BEAM, linewidth=0.8)
        ax.scatter(degrees, scheduled.frequency[:, k], s=size[:, k], color=OURS, linewidths=0.0)
        end = degrees[-1], scheduled.frequency[-1, k]
        ax.annotate(
            literal(name),
            end,
            fontsize=7,
            xytext=(8, 0),
            textcoords="offset points",
            verticalalignment="center",
        )
    ax.set_yscale("log")
    log_axis(ax.yaxis, ax.get_ylim(), plain)
    ax.set(xlabel=f"{literal(scheduled.joint)}, degrees", ylabel="frequency, rad/s")
    return ax


@drawing()
def scheduled_figure(scheduled: "ScheduledPlant") -> Figure:
    """The same as a figure of its own."""
    figure, ax = panel(3.8)
    plot_scheduled(scheduled, ax)
    return figure


def plot_worst(worst: "WorstCase", ax: "Axes | None" = None) -> "Axes":
    """Gains of a closed loop over frequency: worst sample, nominal plant, the peak in MuJoCo."""
    ax = panel(3.6)[1] if ax is None else ax
    ax.loglog(worst.omega, worst.worst, color=OURS, linewidth=1.4, label="worst sample found")
    ax.loglog(worst.omega, worst.nominal, color=RIVAL, linewidth=1.0, label="nominal")
    if np.isfinite(worst.simulated):
        ax.loglog(
            [worst.frequency],
            [worst.simulated],
            "o",
            color=BEAM,
            fillstyle="none",
            label="MuJoCo, worst sample",
        )
    _logarithmic(ax, worst.omega)
    over_frequency(ax, f"{literal(worst.output)} per {literal(worst.input)}, {worst.unit}")
    ax.legend(loc="best")
    return ax


@drawing()
def worst_figure(several: "Sequence[WorstCase]") -> Figure:
    """The same as a figure, one picture per angle."""
    figure = Figure(figsize=(WIDTH, 3.4 * len(several)), layout="constrained")
    for place, worst in enumerate(several, 1):
        plot_worst(worst, figure.add_subplot(len(several), 1, place)).legend_ = None
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside upper left", ncols=4)
    return figure


@drawing()
def drawn_figure(several: "Sequence[WorstCase]") -> Figure:
    """Peak gains of the draws, in order, with that of the worst sample."""
    figure, ax = panel(2.8)
    for worst in several:
        peaks = np.sort(worst.drawn[np.isfinite(worst.drawn)])
        ax.plot(peaks, np.arange(1, peaks.size + 1) / max(worst.drawn.size, 1), color=OURS)
        if np.isfinite(worst.gain):
            ax.axvline(worst.gain, color=OURS, linewidth=0.8, linestyle="dotted")
    ax.set(xlabel=f"peak gain, {several[0].unit}", ylabel="share of samples below")
    return figure


def _grid(plants: "Sequence[Plant]") -> Array:
    """`(k,)` frequencies that resolve the modes [rad/s]; none is a mode's own,
    where an undamped plant is infinite."""
    modes = np.concatenate([plant.frequency for plant in plants])
    modes = modes if modes.size else np.ones(1)
    near = np.outer(modes, 1.0 + 0.02 * np.sinh(np.linspace(-5.0, 5.0, 62)) / np.sinh(5.0))
    omega = np.unique(
        np.concatenate([np.geomspace(0.02 * modes.min(), 5.0 * modes.max(), 400), near.ravel()])
    )
    return np.asarray(
        omega[omega < np.pi / plants[0].dt] if plants[0].dt else omega, dtype=np.float64
    )


def _response(plant: "Plant", omega: Array) -> NDArray[np.complex128]:
    z = np.exp(1j * omega * plant.dt) if plant.dt else 1j * omega
    out: NDArray[np.complex128] = np.asarray(plant(z, squeeze=False), dtype=np.complex128)
    return out


def _logarithmic(ax: "Axes", omega: Array) -> None:
    """Logarithmic axes with plain numbers, their tops in Hz."""
    ax.set(xscale="log", yscale="log", xlim=(float(omega[0]), float(omega[-1])))
    log_axis(ax.xaxis, ax.get_xlim(), plain)
    log_axis(ax.yaxis, ax.get_ylim(), power)


@drawing()
def bode_figure(plants: "Sequence[Plant]") -> Figure:
    """Magnitude and phase of the pairs with the largest modal gains;
    of the further plants the magnitude, in grey."""
    plant = plants[0]
    omega = _grid(plants)
    responses = [_response(one, omega) for one in plants]
    seen = np.abs(responses[0]).max(axis=-1) > 0.0  # zeros have no logarithm
    pairs: list[tuple[int, int]] = [(i, j) for i, j in np.argwhere(seen).tolist()]
    pairs = sorted(pairs, key=lambda at: -float(plant.gain[:, at[0], at[1]].max(initial=0.0)))[
        :PAIRS
    ]
    if not pairs:
        figure, ax = panel(1.2)
        ax.set_axis_off()
        ax.text(0.5, 0.5, "no input moves an output", ha="center", va="center")
        return figure
    figure = Figure(figsize=(WIDTH, 2.6 * len(pairs) + 0.6), layout="constrained")
    for place, (i, j) in enumerate(pairs):
        ax = figure.add_subplot(len(pairs), 1, place + 1)
        for other in responses[1:]:
            ax.loglog(omega, np.abs(other[i, j]), color=RIVAL, linewidth=0.8)
        ax.loglog(omega, np.abs(responses[0][i, j]), color=OURS, linewidth=1.4)
        _logarithmic(ax, omega)
        ax.set_title(f"{literal(plant.output_names[i])} per {literal(plant.input_names[j])}")
        ax.set_ylabel(f"{plant.output_units[i]} per {plant.input_units[j]}")
        angle = ax.twinx()
        phase = np.degrees(np.unwrap(np.angle(responses[0][i, j])))
        angle.plot(omega, phase, color=BEAM, linewidth=0.7, linestyle="dotted")
        angle.set_ylabel("phase, degrees (dotted)")
        if place == 0:
            in_hz(ax)
    figure.supxlabel("frequency, rad/s", fontsize=9.5)
    return figure


@drawing()
def singular_figure(plants: "Sequence[Plant]") -> Figure:
    """Singular values of the first plant over frequency."""
    omega = _grid(plants)
    figure, ax = panel(3.4)
    values = np.linalg.svd(np.moveaxis(_response(plants[0], omega), -1, 0), compute_uv=False)
    ax.loglog(
        omega, np.maximum(values, 1e-12 * values.max(initial=1e-300)), color=OURS, linewidth=1.0
    )
    _logarithmic(ax, omega)
    over_frequency(ax, "singular values")
    return figure


@drawing()
def poles_figure(plants: "Sequence[Plant]") -> Figure:
    """Poles of every plant, and the zeros of the pair with the largest modal gain of the first."""
    plant = plants[0]
    figure, ax = panel(3.8)
    *others, poles = (np.asarray(one.poles(), dtype=np.complex128) for one in (*plants[1:], plant))
    for other in others:
        ax.plot(other.real, other.imag, "x", color=RIVAL, markersize=4)
    ax.plot(poles.real, poles.imag, "x", color=OURS, label="poles")
    i, j = np.unravel_index(
        int(np.argmax(plant.gain.max(axis=0, initial=0.0))), (plant.noutputs, plant.ninputs)
    )
    a, b, c, d = (np.asarray(getattr(plant, name), dtype=np.float64) for name in "ABCD")
    one: Any = control.ss(a, b[:, [j]], c[[i]], d[np.ix_([i], [j])], plant.dt)
    zeros = np.asarray(one.zeros(), dtype=np.complex128)
    pair = f"{literal(plant.output_names[i])} per {literal(plant.input_names[j])}"
    reach = 2.0 * float(np.abs(poles).max(initial=1e-12))
    zeros = zeros[np.abs(zeros) < reach]
    ax.plot(zeros.real, zeros.imag, "o", color=BEAM, fillstyle="none", label=f"zeros, {pair}")
    unit = "" if plant.dt else ", rad/s"
    ax.set(xlabel=f"real part{unit}", ylabel=f"imaginary part{unit}")
    figure.legend(loc="outside upper left", ncols=2)
    return figure


@drawing()
def nichols_figure(loops: "Sequence[Margins]") -> Figure:
    """Open loops in the Nichols plane."""
    figure, ax = panel(4.2)
    for loop in loops:
        phase = np.degrees(np.unwrap(np.angle(loop.response)))
        phase -= 360.0 * np.round((phase[0] + 180.0) / 360.0)
        label = literal(loop.name)
        ax.plot(
            phase,
            20.0 * np.log10(np.maximum(np.abs(loop.response), 1e-6)),
            linewidth=1.0,
            label=label,
        )
    ax.plot([-180.0], [0.0], "+", color=BEAM, markersize=10)
    ax.set(xlim=(-540.0, 180.0), ylim=(-60.0, 60.0), xlabel="phase, degrees", ylabel="gain, dB")
    if len(loops) <= 6:
        figure.legend(loc="outside upper left", ncols=2)
    return figure
