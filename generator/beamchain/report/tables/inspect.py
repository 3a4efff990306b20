"""The tables of `inspect`: modes and springs of any MuJoCo model."""

import math
from typing import TYPE_CHECKING

from beamchain.report.formats import damping_ratio, number, whole
from beamchain.report.headlines import strain_words
from beamchain.report.table import Column, Table

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
    names = [name for name, _, _ in inspection.springs]
    stiffness = [value for _, value, _ in inspection.springs]
    damping = [value for _, _, value in inspection.springs]
    columns = (
        Column("joint", names, key="joint"),
        Column("stiffness", stiffness, STIFFNESS, number, key="stiffness"),
        Column("damping", damping, DAMPING, number, key="damping"),
    )
    return Table("Sprung joints", columns)


def tendon_table(inspection: "Inspection") -> Table:
    """Tendons with springs."""
    tendons = inspection.tendons
    columns = (
        Column("tendon", [name for name, _, _, _ in tendons], key="tendon"),
        Column("stiffness", [k for _, k, _, _ in tendons], STIFFNESS, number, key="stiffness"),
        Column("damping", [d for _, _, d, _ in tendons], DAMPING, number, key="damping"),
        Column("armature", [a for _, _, _, a in tendons], ARMATURE, number, key="armature"),
    )
    return Table("Sprung tendons", columns)
