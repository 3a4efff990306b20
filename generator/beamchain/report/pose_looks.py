"""How the curves of several poses are told apart: colours and dashes, the same in every picture."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.colors import to_hex

from beamchain.report.plots import literal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# they differ in lightness and in their dashes too
COLOURS = ("#0a5fb4", "#d1661b", "#2a9153", "#8a3ea1", "#7a5c12", "#111111")
DASHES: tuple[Any, ...] = (
    "solid",
    (0, (6, 1.5)),
    (0, (3, 1.2)),
    (0, (1.2, 1.2)),
    (0, (6, 1.5, 1.2, 1.5)),
    "solid",
)


class PoseLook(NamedTuple):
    """Label, colour and dashes of the curves of a pose."""

    label: str
    colour: str
    dashes: Any

    def line(self, width: float = 1.1) -> dict[str, Any]:
        """Matplotlib's words for a curve."""
        return {"color": self.colour, "linestyle": self.dashes, "linewidth": width}


def pose_looks(labels: Sequence[str]) -> list[PoseLook]:
    """A look per pose; beyond six they go through a range of colours."""
    if len(labels) <= len(COLOURS):
        looks = zip(labels, COLOURS, DASHES, strict=False)
        return [PoseLook(literal(label), colour, dashes) for label, colour, dashes in looks]
    colours = mpl.colormaps["viridis"](np.linspace(0.0, 0.9, len(labels)))
    return [
        PoseLook(literal(label), to_hex(colour), "solid")
        for label, colour in zip(labels, colours, strict=True)
    ]


def pose_legend(figure: "Figure", labels: Sequence[str]) -> None:
    """A legend of the poses above a figure whose first panel names them, if there are several."""
    if len(labels) > 1:
        handles = figure.axes[0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside upper left", ncols=3)
