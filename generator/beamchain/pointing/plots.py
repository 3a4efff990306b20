"""Pictures of a pointing budget."""

from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from beamchain.report import DASHES, drawing, literal, log_axis, panel, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamchain.pointing.pointing import Pointing

DECADE = 10.0  # ratio of speeds, from which their axis is logarithmic


def plot_pointing(pointing: "Pointing", ax: "Axes | None" = None) -> "Axes":
    """Peaks of the error over the speed of the wheels; a dot at the largest of each curve."""
    ax = panel(3.6)[1] if ax is None else ax
    wheels = [source for source in pointing.sources if source.curve is not None]
    for number, source in enumerate(wheels):
        curve = source.curve
        assert curve is not None
        for output, name in enumerate(pointing.outputs):
            peaks = curve.ape_peak[:, output]
            if not peaks.any():
                continue
            label = f"{source.name}, {name}" if len(wheels) > 1 else name
            (line,) = ax.plot(
                curve.speed,
                peaks,
                linewidth=1.0,
                linestyle=DASHES[number % len(DASHES)],
                label=literal(label),
            )
            top = int(peaks.argmax())
            ax.plot(curve.speed[top], peaks[top], "o", color=line.get_color(), markersize=4)
    units = ", ".join(dict.fromkeys(pointing.units))
    ax.set(yscale="log", xlabel="speed of the wheel, rad/s", ylabel=f"APE peak, {units}")
    low, high = ax.dataLim.intervalx
    if low > 0.0 and high > DECADE * low:
        ax.set_xscale("log")
        log_axis(ax.xaxis, (float(low), float(high)), plain)
    ax.legend(loc="best")
    return ax


@drawing()
def pointing_figure(pointing: "Pointing") -> Figure:
    """The same as a figure of its own."""
    figure, ax = panel(3.8)
    plot_pointing(pointing, ax)
    return figure
