"""A picture of a recovery: a quantity over time, a curve per station."""

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

from beamchain.checks import one_of
from beamchain.report.formats import short
from beamchain.report.plots import drawing, literal, panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from beamchain.craft.histories import Recovery

STRESS = ("largest", "smallest")


@drawing()
def plot_recovery(
    recovery: "Recovery", quantity: str, ax: "Axes | None" = None, part: str | None = None
) -> "Axes":
    """Draw one component of a quantity over time."""
    with_stress = recovery.sections is not None
    one_of("quantity", quantity, (*recovery.histories, *(("stress",) if with_stress else ())))
    if quantity == "stress":
        parts, units, values, x = STRESS, ("N/m^2",) * 2, recovery.stress, recovery.x
    else:
        history = recovery.histories[quantity]
        parts, units, values, x = history.parts, history.units, history.values, history.x
    if part is not None:
        one_of("part", part, parts)
    sizes = np.nanmax(np.abs(values), axis=(0, 1), initial=0.0)
    number = int(np.argmax(sizes)) if part is None else parts.index(part)
    ax = panel(3.6)[1] if ax is None else ax
    shades = mpl.colormaps["viridis"](np.linspace(0.0, 0.85, max(x.size, 1)))
    for s in range(values.shape[1]):
        label = f"x = {short(float(x[s]))} m" if x.size else None
        ax.plot(recovery.time, values[:, s, number], color=tuple(shades[s]), label=label)
    unit = f", {units[number]}" if units[number] else ""
    name = literal(f"{quantity} {parts[number]}".strip())
    ax.set(xlabel="time, s", ylabel=f"{name}{unit}", title=literal(recovery.place))
    ax.grid(visible=True, color="#e3e3e3", linewidth=0.6)
    if x.size:
        ax.legend(loc="best")
    return ax
