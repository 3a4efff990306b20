"""Numbers of a spec that can be meant, but are more often a slip of units or of theory."""

from collections.abc import Collection, Sequence

import numpy as np

from beamchain.caution import Caution
from beamchain.fitting.options import Damping
from beamchain.structure.section import Custom, Equivalent
from beamchain.structure.segment import Segment

SOFT = 1e6  # N/m^2: rubber has more
LIGHT = 5.0  # kg/m^3: a foam has more
HUGE = 0.25  # of the appendage's length: a section as wide, and wider than 1 m, is likelier one in mm
THIN = 0.05  # m: a section with a dimension below was given in metres, unless another one is longer than the appendage
CODED = {
    "damped": "high-damping", "soft": "soft-material", "light": "light-material", "huge": "huge-section",
    "stocky": "stocky-beam",
}  # fmt: skip
DAMPED = 0.1  # ratio from which an aerospace structure is asked about: rubber has as much
STOCKY = 10.0  # length over depth, below which Euler's theory misses shear


def doubtful(
    segments: Sequence[Segment], damping: Damping | None = None, ports: Collection[str] = ("xy", "xz")
) -> list[str]:
    """Warnings, one of a kind.

    Args:
        segments: of the appendage.
        damping: of its modes.
        ports: that are kept: what is rigid by choice needs no theory.
    """
    out: dict[str, str] = {}
    for place, ratio in _ratios(damping):
        if ratio >= DAMPED:
            out["damped"] = (
                f"damping.{place} = {ratio:g} is {ratio:.0%} of critical, where structures have 0.001 to 0.02: a likely "
                f"slip; if {ratio:g} % were meant, write {ratio * 1e-2:g}."
            )
            break
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
        most, thin = max(sizes.values(), default=0.0), min(sizes.values(), default=0.0) < THIN
        if most > max(length if thin else HUGE * length, 1.0):  # a panel is wide, but thin
            name, size = max(sizes.items(), key=lambda item: item[1])
            meant = ", ".join(f"{key} = {value * 1e-3:g}" for key, value in sizes.items())
            out["huge"] = (
                f"{where}: {name} = {size:g} m on an appendage {length:g} m long; if mm were meant, write {meant}."
            )
            continue
        at = segment.at(np.array([0.0]))
        axial = float(at.axial[0])
        if segment.theory == "euler" and axial > 0.0:
            bending = {"xy": float(at.bending_xy[0]), "xz": float(at.bending_xz[0])}
            depth = np.sqrt(12.0 * max((bending[port] for port in ports if port in bending), default=0.0) / axial)
            if length < STOCKY * depth:
                out["stocky"] = (
                    f"{where}: the appendage is only {length / depth:.2g} times as long as it is deep; Euler's theory "
                    'leaves shear out: set theory = "timoshenko".'
                )
    return [Caution(CODED[kind], text) for kind, text in out.items()]


def _ratios(damping: Damping | None) -> list[tuple[str, float]]:
    """Every ratio stated, with its place."""
    if damping is None:
        return []
    if not isinstance(damping.ratio, dict):
        return [("ratio", damping.ratio)]
    return [(f"ratio.{port}[{i}]", v) for port, values in damping.ratio.items() for i, v in enumerate(values)]
