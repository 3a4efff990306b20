"""The tables of `inspect`: modes and springs of any MuJoCo model."""

import math
from typing import TYPE_CHECKING

from beamchain.report.formats import damping_ratio, number, whole
from beamchain.report.table import Column, Table

if TYPE_CHECKING:
    from beamchain.craft.inspect import Inspection


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
    if any(inspection.moving):
        columns += (Column("what bends", inspection.moving, key="bends"),)
    return Table("Modes about the rest pose", columns)


def spring_table(inspection: "Inspection") -> Table:
    """Joints with springs."""
    names = [name for name, _, _ in inspection.springs]
    stiffness = [value for _, value, _ in inspection.springs]
    damping = [value for _, _, value in inspection.springs]
    columns = (
        Column("joint", names, key="joint"),
        Column("stiffness", stiffness, format=number, key="stiffness"),
        Column("damping", damping, format=number, key="damping"),
    )
    return Table("Sprung joints", columns)


def tendon_table(inspection: "Inspection") -> Table:
    """Tendons with springs."""
    tendons = inspection.tendons
    columns = (
        Column("tendon", [name for name, _, _, _ in tendons], key="tendon"),
        Column("stiffness", [value for _, value, _, _ in tendons], format=number, key="stiffness"),
        Column("damping", [value for _, _, value, _ in tendons], format=number, key="damping"),
        Column("armature", [value for _, _, _, value in tendons], format=number, key="armature"),
    )
    return Table("Sprung tendons", columns)
