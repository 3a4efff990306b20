"""The table of `retime`: the modes of a craft as its step shows them."""

from typing import TYPE_CHECKING

from beamchain.report.formats import damping_ratio, digits, relative
from beamchain.report.table import Column, Table

if TYPE_CHECKING:
    from collections.abc import Sequence

    from beamchain.steps.poles import PoleRow

frequency = digits(8)  # shows what a step changes


def pole_table(poles: "Sequence[PoleRow]") -> Table:
    """Frequencies and damping ratios without and with the step."""
    achieved = [pole.achieved_frequency for pole in poles]
    achieved_ratios = [pole.achieved_ratio for pole in poles]
    slowed = ["yes" if pole.slowed else "" for pole in poles]
    columns = (
        Column("frequency", [pole.frequency for pole in poles], "rad/s", frequency),
        Column("achieved", achieved, "rad/s", frequency),
        Column("damping ratio", [pole.ratio for pole in poles], format=damping_ratio),
        Column("achieved", achieved_ratios, format=damping_ratio),
        Column("slowed", slowed),
        Column("error of its pole", [pole.step_error for pole in poles], format=relative),
    )
    return Table("Modes of the whole model at this step", columns)
