"""The tables of `inspect`: modes and springs of any MuJoCo model."""

import math
from operator import itemgetter
from typing import TYPE_CHECKING

from beamchain.report.formats import damping_ratio, number, whole
from beamchain.report.headlines import strain_words
from beamchain.report.table import Column, Rows, Table

if TYPE_CHECKING:
    from beamchain.craft.inspect import Inspection

# of slide joints, and of tendons over points or slide joints; of hinges, and of tendons over them
STIFFNESS = "N/m or N m/rad"
DAMPING = "N s/m or N m s/rad"
ARMATURE = "kg or kg m^2"


def mode_table(inspection: "Inspection") -> Table:
    """The oscillating modes about the rest pose."""
    frequencies = inspection.frequencies.tolist()
    ratios = inspection.damping.tolist()
    columns = (
        Column("mode", range(1, len(frequencies) + 1), format=whole),
        Column("frequency", frequencies, "rad/s", number, key="frequency"),
        Column("frequency", [w / math.tau for w in frequencies], "Hz", number),
        Column("damping ratio", ratios, format=damping_ratio, key="damping"),
    )
    moving = [strain_words(shares) for shares in inspection.moving]
    if any(moving):
        columns += (Column("what bends", moving, key="bends"),)
    still = "Motions that servos or dampers keep from oscillating are not listed."
    notes = (still,) if inspection.has_overdamped else ()
    return Table("Modes about the rest pose", columns, notes=notes)


def spring_table(inspection: "Inspection") -> Table:
    """Joints with springs."""
    column = Rows(inspection.springs).column
    columns = (
        column("joint", itemgetter(0), key="joint"),
        column("stiffness", itemgetter(1), STIFFNESS, number, key="stiffness"),
        column("damping", itemgetter(2), DAMPING, number, key="damping"),
    )
    return Table("Sprung joints", columns)


def tendon_table(inspection: "Inspection") -> Table:
    """Tendons with springs."""
    column = Rows(inspection.tendons).column
    columns = (
        column("tendon", itemgetter(0), key="tendon"),
        column("stiffness", itemgetter(1), STIFFNESS, number, key="stiffness"),
        column("damping", itemgetter(2), DAMPING, number, key="damping"),
        column("armature", itemgetter(3), ARMATURE, number, key="armature"),
    )
    return Table("Sprung tendons", columns)
