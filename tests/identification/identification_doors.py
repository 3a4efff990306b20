"""Doors to formulas of identification that no public name reaches alone."""

from beamchain.identification.resolution import resolution

__all__ = [
    "resolution",
]
