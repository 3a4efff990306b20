"""Pictures of a craft: the hub's accelerance, exact assembly and MuJoCo;
how modes and gains spread over a sweep."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from beamchain.checks import one_of
from beamchain.fitting.needs import AXES
from beamchain.ports.motions import Array
from beamchain.report.curves import ErrorCurve
from beamchain.report.plots import (
    ACCELERANCE_OVER_ERROR,
    BEAM,
    OURS,
    alone,
    drawing,
    error_panel,
    finished,
    frame,
    literal,
    panel,
    panels,
)
from beamchain.report.svg import to_svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamchain.craft.assembly import Assembly
    from beamchain.variants.sweep import Sweep

MOST = 12  # modes in a picture
NONE = 1e-9  # of the largest gain: a mode below it is not driven or not seen
MOTIONS = (
    *((f"acceleration along {axis} per force", "(m/s²)/N") for axis in "xyz"),
    *((f"angular acceleration about {axis} per torque", "(rad/s²)/(N m)") for axis in "xyz"),
)


@drawing()
def assembly_figure(assembly: "Assembly") -> Figure:
    """The hub's accelerance in the motion whose largest error in the band is largest, and below it
    the error of all motions together, its largest in the band marked."""
    figure, (above, below) = panels(*ACCELERANCE_OVER_ERROR)
    kept = assembly.omega <= max(assembly.common, assembly.omega[0])
    off = np.abs(assembly.achieved - assembly.exact)[..., kept].max(axis=-1)
    size = np.abs(assembly.exact)[..., kept].max(axis=-1)
    _panel(above, assembly, int(np.argmax(np.diagonal(off) / np.diagonal(size))))
    curve = ErrorCurve(assembly.omega, assembly.error)
    title = "error of the hub's motion, all motions together"
    error_panel(below, curve, assembly.common, assembly.in_band, title)
    return finished(figure)


def _panel(ax: "Axes", assembly: "Assembly", place: int) -> None:
    """One motion's accelerance, exact and through MuJoCo."""
    title, unit = MOTIONS[assembly.motions[place]]
    exact = np.abs(assembly.exact[place, place])
    ours = np.abs(assembly.achieved[place, place])
    heights = float(min(exact.min(), ours.min())) / 1.3, 1.3 * float(max(exact.max(), ours.max()))
    frame(ax, (float(assembly.omega[0]), float(assembly.omega[-1])), heights, assembly.common)
    through_mujoco = "MuJoCo, from A and B of mjd_transitionFD"
    ax.plot(assembly.omega, ours, color=OURS, linewidth=3.0, label=through_mujoco)
    alike = "exact appendages on the same hub"
    ax.plot(assembly.omega, exact, color=BEAM, linewidth=1.0, label=alike)
    ax.set(title=title, ylabel=f"|H|, {unit}")


def plot_assembly(
    assembly: "Assembly", ax: "Axes | None" = None, motion: str | None = None
) -> "Axes":
    """Draw the hub's accelerance in one motion: the exact spacecraft,
    and the one read back through MuJoCo.

    `motion`: "tx", "ty", "tz", "x", "y" or "z"; the first that matters where left out.
    """
    known = {name: assembly.motions.index(i) for name, i in AXES.items() if i in assembly.motions}
    motion = next(iter(known)) if motion is None else motion
    one_of("motion", motion, known)
    ax = panel(3.6)[1] if ax is None else ax
    _panel(ax, assembly, known[motion])
    return alone(ax)


def assembly_svg(assembly: "Assembly") -> str:
    """The figure as SVG text."""
    return to_svg(assembly_figure(assembly), "assembly")


def sweep_pictures(sweep: "Sweep") -> dict[str, str]:
    """SVG texts by the name of their file."""
    out = {"coupled_frequencies.svg": _frequencies(sweep.coupled)}
    if sweep.gains:
        out["modal_gains.svg"] = _gains(sweep)
    return out


@drawing()
def _frequencies(coupled: Array) -> str:
    """A histogram of every coupled mode, each on its own axis."""
    count = min(coupled.shape[1], MOST)
    figure, axes = panels(1.0 + 1.1 * count, *[1.0] * count)
    for k, (ax, values) in enumerate(zip(axes, coupled.T, strict=False), 1):
        mean, spread = float(values.mean()), float(values.std())
        ax.hist(values, bins=min(40, max(5, values.size // 10)), color=OURS)
        # frequencies as they are, however close they lie
        ax.ticklabel_format(axis="x", useOffset=False, style="plain")
        hertz = f"{mean / (2.0 * np.pi):.4g} Hz, deviation {100 * spread / mean:.2g} %"
        ax.set(title=f"mode {k}: {mean:.4g} rad/s, {hertz}", ylabel="variants")
    label = "frequency of the coupled mode, rad/s"
    axes[-1].set_xlabel(_counted_label(label, coupled, count))
    return to_svg(figure, "sweep")


@drawing()
def _gains(sweep: "Sweep") -> str:
    """Every variant's gain over its mode, a panel per pair of signals."""
    figure, axes = panels(0.6 + 3.0 * len(sweep.gains), *[1.0] * len(sweep.gains))
    for ax, (name, values) in zip(axes, sweep.gains.items(), strict=True):
        seen = np.flatnonzero(values.max(axis=0) > NONE * values.max())[:MOST]
        for place, k in enumerate(seen):
            # beside each other, not by chance
            across = place + 0.5 * (np.arange(values.shape[0]) % 101) / 101.0 - 0.25
            ax.plot(across, values[:, k], ".", color=OURS, markersize=2.0, alpha=0.5)
            ax.hlines(np.median(values[:, k]), place - 0.32, place + 0.32, "black", linewidth=1.0)
        ax.set_yscale("log")
        names = [f"{k + 1}\n{np.median(sweep.coupled[:, k]):.3g} rad/s" for k in seen]
        ax.set_xticks(range(len(seen)), names, fontsize=7)
        ax.set(title=literal(f"modal gain {name}; bar: median"), ylabel=sweep.units[name])
        ax.set_xlabel(_counted_label("coupled mode, its median frequency", values, len(seen)))
    return to_svg(figure, "gains")


def _counted_label(label: str, table: Array, shown: int) -> str:
    return f"{label} ({table.shape[0]} variants, {shown} of {table.shape[1]} modes)"
