"""What the page's script has to know of a plot to zoom into it."""

from typing import Any

from matplotlib.figure import Figure


def described(figure: Figure, name: str) -> list[dict[str, Any]]:
    """Where each axes with a logarithmic x stands in the SVG [pt], and the limits it shows."""
    width, height = 72.0 * figure.get_size_inches()
    out: list[dict[str, Any]] = []
    for i, ax in enumerate(figure.axes, 1):
        if ax.get_xscale() != "log":
            continue
        at = ax.get_position()
        out.append({
            "id": f"{name}-axes_{i}",
            "box": [round(v, 3) for v in (at.x0 * width, (1.0 - at.y1) * height, at.width * width, at.height * height)],
            "x": [float(f"{v:.9g}") for v in ax.get_xlim()],
            "y": [float(f"{v:.9g}") for v in ax.get_ylim()],
            "log": ax.get_yscale() == "log",
        })  # fmt: skip
    return out
