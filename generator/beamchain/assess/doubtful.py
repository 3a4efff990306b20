"""Numbers of a spec that can be meant, but are more often a slip of units or of theory."""

from collections.abc import Sequence

import numpy as np

from beamchain.structure.section import Custom, Equivalent
from beamchain.structure.segment import Segment

SOFT = 1e6  # N/m^2: rubber has more
LIGHT = 5.0  # kg/m^3: a foam has more
HUGE = 0.25  # of the appendage's length: a section as wide, and wider than 1 m, is likelier one in mm
STOCKY = 10.0  # length over depth, below which Euler's theory misses shear


def doubtful(segments: Sequence[Segment]) -> list[str]:
    """Warnings, one of a kind.

    Args:
        segments: of the appendage.
    """
    out: dict[str, str] = {}
    length = sum(segment.length for segment in segments)
    for i, segment in enumerate(segments):
        where, material = f"segment[{i}]", segment.material
        if material is not None and material.youngs_modulus < SOFT:
            e = material.youngs_modulus
            out["soft"] = (
                f"{where}: youngs_modulus = {e:g} N/m^2 is softer than rubber; if GPa were meant, write {e * 1e9:g}."
            )
        if material is not None and material.density < LIGHT:
            rho = material.density
            out["light"] = (
                f"{where}: density = {rho:g} kg/m^3 is lighter than foam; if g/cm^3 were meant, write {rho * 1e3:g}."
            )
        sizes = {} if isinstance(segment.section, Custom | Equivalent) else segment.section.dimensions()
        if sizes and max(sizes.values()) > max(HUGE * length, 1.0):
            name, size = max(sizes.items(), key=lambda item: item[1])
            meant = ", ".join(f"{key} = {value * 1e-3:g}" for key, value in sizes.items())
            out["huge"] = (
                f"{where}: {name} = {size:g} m on an appendage {length:g} m long; if mm were meant, write {meant}."
            )
            continue
        at = segment.at(np.array([0.0]))
        axial = float(at.axial[0])
        if segment.theory == "euler" and axial > 0.0:
            depth = np.sqrt(12.0 * max(float(at.bending_xy[0]), float(at.bending_xz[0])) / axial)
            if length < STOCKY * depth:
                out["stocky"] = (
                    f"{where}: the appendage is only {length / depth:.2g} times as long as it is deep; Euler's theory "
                    'leaves shear out: set theory = "timoshenko".'
                )
    return list(out.values())
