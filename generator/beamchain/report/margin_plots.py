"""Pictures of closed loops: open-loop Bode and Nichols with their margins, S and T, poles."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from beamchain.ports.motions import Array
from beamchain.report.plots import (
    BEAM,
    HATCH,
    RIVAL,
    WIDTH,
    beside,
    drawing,
    in_hz,
    literal,
    log_axis,
    panel,
    panels,
    plain,
)
from beamchain.report.pose_looks import pose_legend, pose_looks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from beamchain.control.margins import LoopMargins, Margins

GROWING = "#b3261e"
LOW, HIGH = -60.0, 60.0  # dB that are drawn
DISTANCE = 0.5  # |1 + L| on the closed line about the critical point: |S| = 6 dB
TITLE = 8.0  # dB below a title, where it leaves no room for a number
NAMED = 7  # frequencies that a Nichols curve is marked with
# degrees between which a phase is drawn: that of a loop with lead is positive at modes
LEAST_PHASE, MOST_PHASE = -270.0, 90.0
PHASES = (-270, -180, -90, 0, 90)
TURN = 180.0  # degrees between two points beyond which a wrapped phase has jumped


def _labels(several: "Sequence[Margins]") -> list[str]:
    return [each.pose or "this pose" for each in several]


def _signed(value: float, _: float = 0.0) -> str:
    """A number of either sign on an axis."""
    return "0" if value == 0.0 else f"{'-' if value < 0.0 else ''}{plain(abs(value))}"


def _decibels(response: "NDArray[np.complex128]") -> Array:
    return 20.0 * np.log10(np.maximum(np.abs(response), 1e-12))


def _phase(response: "NDArray[np.complex128]") -> Array:
    """Phase in the drawn turn [degrees]."""
    return np.mod(np.degrees(np.angle(response)) - LEAST_PHASE, 360.0) + LEAST_PHASE


def _wrapped(response: "NDArray[np.complex128]") -> Array:
    """The same, broken where it jumps."""
    phase = _phase(response)
    phase[1:][np.abs(np.diff(phase)) > TURN] = np.nan
    return phase


def _by_loop(several: "Sequence[Margins]") -> "list[tuple[LoopMargins, ...]]":
    """Every loop in each of the poses."""
    return list(zip(*(each.loops for each in several), strict=True))


def _span(poses: "Sequence[LoopMargins]") -> tuple[float, float]:
    """Frequencies between which an open loop has a gain that is drawn [rad/s]."""
    gains = [_decibels(loop.response) for loop in poses]
    drawn = [
        loop.omega[(gain > LOW) & (gain < HIGH)] for loop, gain in zip(poses, gains, strict=True)
    ]
    seen = np.concatenate(drawn)
    omega = seen if np.unique(seen).size > 1 else poses[0].omega
    return float(omega.min()), float(omega.max())


def _over_frequency(ax: "Axes", span: tuple[float, float]) -> None:
    ax.set(xscale="log", xlim=span)
    log_axis(ax.xaxis, span, plain)


@drawing()
def open_loop_figure(several: "Sequence[Margins]") -> Figure:
    """Gain and phase of every open loop, the others closed, a curve per pose;
    the least margins are marked."""
    loops = _by_loop(several)
    looks = pose_looks(_labels(several))
    figure, axes = panels(4.2 * len(loops) + 0.4, *[3.0, 2.0] * len(loops))
    for poses, gain, phase in zip(loops, axes[::2], axes[1::2], strict=True):
        for loop, look in zip(poses, looks, strict=True):
            gain.plot(loop.omega, _decibels(loop.response), label=look.label, **look.line())
            phase.plot(loop.omega, _wrapped(loop.response), **look.line())
        gain.axhline(0.0, color=BEAM, linewidth=0.6)
        phase.axhline(-TURN, color=BEAM, linewidth=0.6)
        gain.set(ylim=(LOW, HIGH), ylabel="gain, dB")
        phase.set(ylim=(LEAST_PHASE, MOST_PHASE), yticks=PHASES, ylabel="phase, degrees")
        for ax in (gain, phase):
            _over_frequency(ax, _span(poses))
        gain.set_title(literal(poses[0].name), pad=24)
        in_hz(gain)
        _mark_gain(gain, poses)
        _mark_phase(phase, poses)
        phase.set_xlabel("frequency, rad/s")
    pose_legend(figure, _labels(several))
    return figure


def _mark_gain(ax: "Axes", poses: "Sequence[LoopMargins]") -> None:
    """Gain margins up and down as lines from the curve to 0 dB, the least of each with its
    figure."""
    margins = [
        *((loop.gain_db, loop.gain_frequency) for loop in poses),
        *((loop.lowest_gain_db, loop.lowest_gain_frequency) for loop in poses),
    ]
    drawn = [(margin, omega) for margin, omega in margins if np.isfinite(margin) and omega > 0.0]
    for margin, omega in drawn:
        ax.plot([omega] * 2, [-margin, 0.0], color=BEAM, linewidth=0.9, marker="_")
    for side in (1.0, -1.0):
        of_side = [pair for pair in drawn if side * pair[0] > 0.0]
        if of_side:
            margin, omega = min(of_side, key=lambda pair: abs(pair[0]))
            _say(ax, f"{margin:.1f} dB at {omega:.3g} rad/s", omega, -margin)


def _mark_phase(ax: "Axes", poses: "Sequence[LoopMargins]") -> None:
    """Phase margins as lines from the curve to -180 degrees, the least with its figure."""
    loops = [loop for loop in poses if np.isfinite(loop.phase)]
    for loop in loops:
        ends = [-TURN, loop.phase - TURN]
        ax.plot([loop.phase_frequency] * 2, ends, color=BEAM, linewidth=0.9, marker="_")
    if loops:
        least = min(loops, key=lambda loop: abs(loop.phase))
        text = f"{least.phase:.1f}° at {least.phase_frequency:.3g} rad/s"
        _say(ax, text, least.phase_frequency, least.phase - TURN)


def _say(ax: "Axes", text: str, x: float, y: float) -> None:
    """A figure beside a point, within the panel."""
    plate = {"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.8}
    beside(ax, text, (x, y), verticalalignment="center", fontsize=9.0, bbox=plate)


@drawing()
def nichols_figure(several: "Sequence[Margins]") -> Figure:
    """Open loops in the Nichols plane with frequencies, a panel per loop."""
    loops = _by_loop(several)
    looks = pose_looks(_labels(several))
    figure, axes = panels(3.9 * len(loops) + 0.4, *[1.0] * len(loops))
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    circle = (-1.0 + DISTANCE * np.exp(1j * turn)).astype(np.complex128)
    for ax, poses in zip(axes, loops, strict=True):
        for loop, look in zip(poses, looks, strict=True):
            gain = _decibels(loop.response)
            ax.plot(_wrapped(loop.response), gain, label=look.label, **look.line(1.0))
        _mark_frequencies(ax, poses[0])
        ax.plot(_phase(circle), _decibels(circle), color=RIVAL, linewidth=0.9)
        ax.plot([-TURN], [0.0], "+", color=BEAM, markersize=10)
        ax.annotate("|S| = 6 dB", (-TURN, 6.5), fontsize=8.5, color="#555555", ha="center")
        ax.set(xlim=(LEAST_PHASE, MOST_PHASE), ylim=(LOW, HIGH), ylabel="gain, dB")
        ax.set(xticks=PHASES, title=literal(poses[0].name))
    axes[-1].set_xlabel("phase, degrees")
    pose_legend(figure, _labels(several))
    return figure


def _mark_frequencies(ax: "Axes", loop: "LoopMargins") -> None:
    """Points on a Nichols curve with their frequencies [rad/s]: evenly spread on a logarithmic
    scale, and where margins are."""
    gain, phase = _decibels(loop.response), _phase(loop.response)
    seen = loop.omega[(gain > LOW) & (gain < HIGH - TITLE)]
    if not seen.size:
        return
    spread = np.geomspace(seen[0], seen[-1], NAMED)
    margins = [w for w in (loop.gain_frequency, loop.phase_frequency) if np.isfinite(w)]
    style: Any = {"textcoords": "offset points", "fontsize": 8.0, "annotation_clip": True}
    for omega in (*spread, *margins):
        at = int(np.argmin(np.abs(loop.omega - omega)))
        ax.plot(phase[at], gain[at], ".", color=BEAM, markersize=4)
        ax.annotate(f"{omega:.3g}", (phase[at], gain[at]), xytext=(4, 3), **style)


@drawing()
def sensitivity_figure(several: "Sequence[Margins]") -> Figure:
    """S (upper) and T (lower) of every loop, the others closed, a curve per pose."""
    loops = _by_loop(several)
    looks = pose_looks(_labels(several))
    figure = Figure(figsize=(WIDTH, 2.7 * len(loops) + 0.5), layout="constrained")
    axes = figure.subplots(len(loops), 2, squeeze=False, sharey="row")
    for (left, right), poses in zip(axes, loops, strict=True):
        for loop, look in zip(poses, looks, strict=True):
            sensitivity = 1.0 / (1.0 + loop.response)
            complementary = loop.response * sensitivity
            left.plot(loop.omega, _decibels(sensitivity), label=look.label, **look.line())
            right.plot(loop.omega, _decibels(complementary), **look.line())
        for ax, name in ((left, "S"), (right, "T")):
            ax.axhline(0.0, color=BEAM, linewidth=0.6)
            ax.set(ylim=(-40.0, 20.0), title=f"{name}, {literal(poses[0].name)}")
            _over_frequency(ax, _span(poses))
        left.set_ylabel("size, dB")
    for ax in axes[-1]:
        ax.set_xlabel("frequency, rad/s")
    pose_legend(figure, _labels(several))
    return figure


@drawing()
def closed_poles_figure(several: "Sequence[Margins]") -> Figure:
    """Poles of the closed loop above the real axis; those that grow are circled."""
    figure, ax = panel(4.2)
    every = np.concatenate([np.asarray(each.poles) for each in several])
    sizes, parts = np.abs(every), np.abs(every.real)
    top = float(sizes.max(initial=1.0))
    least = float(parts[parts > 1e-9 * top].min(initial=top))
    for each, look in zip(several, pose_looks(_labels(several)), strict=True):
        poles = np.asarray(each.poles, dtype=np.complex128)
        poles = poles[poles.imag >= 0.0]
        ax.plot(poles.real, poles.imag, "x", color=look.colour, markersize=5, label=look.label)
        growing = np.array([found.pole for found in each.instabilities], dtype=np.complex128)
        ring: Any = {"color": GROWING, "fillstyle": "none", "markersize": 10}
        ax.plot(growing.real, growing.imag, "o", **ring)
    ax.axvline(0.0, color=BEAM, linewidth=0.6)
    ax.axvspan(0.0, top, color=HATCH, alpha=0.25, linewidth=0.0)
    ax.set_xscale("symlog", linthresh=least)
    ax.set_yscale("symlog", linthresh=max(float(sizes[sizes > 0.0].min(initial=top)), 1e-6 * top))
    right = top if any(each.instabilities for each in several) else least
    ax.set(xlim=(-2.0 * top, right), ylim=(0.0, 2.0 * top))
    for axis, size in ((ax.xaxis, least), (ax.yaxis, 0.0)):
        # beside zero there is room for zero alone
        axis.set_major_formatter(
            lambda value, _, size=size: "" if 0.0 < abs(value) < 3.0 * size else _signed(value)
        )
    ax.set(xlabel="real part, 1/s", ylabel="imaginary part, rad/s")
    pose_legend(figure, _labels(several))
    return figure
