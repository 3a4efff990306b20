"""Pictures of plants."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from beamchain.ports.motions import Array
from beamchain.ports.peaks import around, half_widths
from beamchain.report.plots import (
    BEAM,
    OURS,
    drawing,
    in_hz,
    literal,
    log_axis,
    panel,
    panels,
    plain,
    power,
)
from beamchain.report.pose_looks import pose_legend, pose_looks

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamchain.control.realisation import Plant
    from beamchain.control.scheduled import ScheduledPlant

APART = 0.035  # of the height of a panel, between the names of modes
PAIRS = 4  # of inputs and outputs that a Bode plot shows


def plot_scheduled(scheduled: "ScheduledPlant", ax: "Axes | None" = None) -> "Axes":
    """Frequencies of the modes over the poses, or the positions of a grid's joint; the larger a
    marker, the larger the mode's gain."""
    ax = panel(3.8)[1] if ax is None else ax
    grid = scheduled.grid
    places = np.arange(len(scheduled), dtype=np.float64) if grid is None else grid[0]
    gain = scheduled.gain
    least = 1e-9 * gain.max(initial=0.0) + 1e-300
    top = np.maximum(gain.max(axis=(0, 1), keepdims=True, initial=0.0), least)
    size = 4.0 + 60.0 * (gain / top).max(axis=(2, 3), initial=0.0)
    for k in range(len(scheduled.modes)):
        ax.plot(places, scheduled.frequency[:, k], color=BEAM, linewidth=0.8)
        ax.scatter(places, scheduled.frequency[:, k], s=size[:, k], color=OURS, linewidths=0.0)
    ax.set_yscale("log")
    log_axis(ax.yaxis, ax.get_ylim(), plain)
    _name_modes(ax, scheduled, places, size.max(axis=0))
    ax.set_ylabel("frequency, rad/s")
    if grid is None:
        labels = [literal(label) for label in scheduled.labels]
        ax.set_xticks(places, labels, rotation=20.0, ha="right", fontsize=8)
    else:
        ax.set_xlabel(f"{literal(scheduled.joint or '')}, {grid[1]}")
    return ax


def _name_modes(ax: "Axes", scheduled: "ScheduledPlant", places: Array, size: Array) -> None:
    """Names beside the ends of the curves, apart from each other; of too many modes those of the
    largest gain."""
    last = [int(np.flatnonzero(~np.isnan(w))[-1]) for w in scheduled.frequency.T]
    frequency = np.array([scheduled.frequency[i, k] for k, i in enumerate(last)])
    largest = np.argsort(-size)[: int(1.0 / APART)]
    order = largest[np.argsort(frequency[largest])]
    to_axes = ax.transData + ax.transAxes.inverted()
    heights = np.array([to_axes.transform((places[last[k]], frequency[k]))[1] for k in order])
    steps = APART * np.arange(len(heights))
    heights = np.maximum.accumulate(heights - steps) + steps
    heights = np.minimum(heights, 1.0 - steps[::-1])
    style: Any = {"textcoords": "axes fraction", "va": "center", "annotation_clip": False}
    for k, height in zip(order, heights, strict=True):
        at = (places[last[k]], frequency[k])
        ax.annotate(literal(scheduled.modes[k]), at, (1.02, height), fontsize=7, **style)


def _grid(plants: "Sequence[Plant]") -> Array:
    """`(k,)` frequencies that resolve the modes [rad/s]; none is a mode's own,
    where an undamped plant is infinite."""
    modes = np.concatenate([plant.frequency for plant in plants])
    modes = modes if modes.size else np.ones(1)
    near = around(modes, 0.02 / np.sinh(5.0) * modes, half_widths(5.0, 62))
    even = np.geomspace(0.02 * modes.min(), 5.0 * modes.max(), 400)
    omega = np.unique(np.concatenate([even, near]))
    return omega[omega < np.pi / plants[0].dt] if plants[0].dt else omega


def _response(plant: "Plant", omega: Array) -> NDArray[np.complex128]:
    z = np.exp(1j * omega * plant.dt) if plant.dt else 1j * omega
    out: NDArray[np.complex128] = np.asarray(plant(z, squeeze=False), dtype=np.complex128)
    return out


def logarithmic(ax: "Axes", omega: Array) -> None:
    """Logarithmic axes with plain numbers, their tops in Hz."""
    ax.set(xscale="log", yscale="log", xlim=(float(omega[0]), float(omega[-1])))
    log_axis(ax.xaxis, ax.get_xlim(), plain)
    log_axis(ax.yaxis, ax.get_ylim(), power)


@drawing()
def bode_figure(plants: "Sequence[Plant]", labels: Sequence[str] = ()) -> Figure:
    """Magnitude of the pairs with the largest modal gains, a curve per pose, and the phase in the
    first; `labels`: of the poses."""
    plant = plants[0]
    omega = _grid(plants)
    responses = [_response(one, omega) for one in plants]
    seen = np.abs(responses[0]).max(axis=-1) > 0.0  # zeros have no logarithm
    gains = plant.gain.max(axis=0, initial=0.0)
    pairs = sorted(np.argwhere(seen).tolist(), key=lambda pair: -gains[*pair])[:PAIRS]
    if not pairs:
        figure, ax = panel(1.2)
        ax.set_axis_off()
        ax.text(0.5, 0.5, "no input moves an output", ha="center", va="center")
        return figure
    looks = pose_looks(labels or ["this pose"] * len(plants))
    figure, axes = panels(2.6 * len(pairs) + 0.6, *[1.0] * len(pairs))
    for ax, (i, j) in zip(axes, pairs, strict=True):
        for response, look in zip(responses, looks, strict=True):
            ax.loglog(omega, np.abs(response[i, j]), label=look.label, **look.line())
        logarithmic(ax, omega)
        ax.set_title(f"{literal(plant.output_names[i])} per {literal(plant.input_names[j])}")
        ax.set_ylabel(f"{plant.output_units[i]} per {plant.input_units[j]}")
        angle = ax.twinx()
        phase = np.degrees(np.unwrap(np.angle(responses[0][i, j])))
        angle.plot(omega, phase, color=BEAM, linewidth=0.7, linestyle="dotted")
        angle.set_ylabel("phase, degrees (dotted)")
    in_hz(axes[0])
    figure.supxlabel("frequency, rad/s", fontsize=9.5)
    pose_legend(figure, labels)
    return figure
