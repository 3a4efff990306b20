"""The table of `retime`: the modes of a craft as its step shows them."""

from typing import TYPE_CHECKING

from beamchain.report.formats import damping_ratio, digits, relative
from beamchain.report.table import Rows, Table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from beamchain.steps.poles import PoleRow


def pole_table(poles: "Sequence[PoleRow]") -> Table:
    """Frequencies and damping ratios without and with the step."""
    column = Rows(poles).column
    precise = digits(8)  # shows what a step changes
    columns = (
        column("frequency", "frequency", "rad/s", precise),
        column("achieved", "achieved_frequency", "rad/s", precise),
        column("damping ratio", "ratio", format=damping_ratio),
        column("achieved", "achieved_ratio", format=damping_ratio),
        column("slowed", lambda pole: "yes" if pole.slowed else ""),
        column("error of its pole", "step_error", format=relative),
    )
    return Table("Modes of the whole model at this step", columns)
