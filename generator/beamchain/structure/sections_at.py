"""Sections of a beam at stations, and normal stresses in them."""

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from beamchain.ports.motions import Array
from beamchain.structure.beam import Beam
from beamchain.structure.section import Equivalent


@dataclass(frozen=True, eq=False)
class Sections:
    """Sections at s stations, `(s,)` each, SI; NaN where they are not known.

    `half_y`, `half_z` are half widths of the outline, a circle where it `is_round`.
    """

    area: Array
    second_moment_z: Array
    second_moment_y: Array
    half_y: Array
    half_z: Array
    is_round: NDArray[np.bool_]

    def stress(self, force: Array, moment: Array, y: float, z: float) -> Array:
        """`(t, s)` normal stress of a fibre [N/m^2] under loads `(t, s, 3)`."""
        axial = force[..., 0] / self.area
        bending_z = -moment[..., 2] * y / self.second_moment_z
        bending_y = moment[..., 1] * z / self.second_moment_y
        return axial + bending_z + bending_y

    def extreme_stress(self, force: Array, moment: Array) -> Array:
        """`(t, s, 2)` largest and smallest normal stress in the section [N/m^2]."""
        axial = force[..., 0] / self.area
        about_y = np.abs(moment[..., 1]) * self.half_z / self.second_moment_y
        about_z = np.abs(moment[..., 2]) * self.half_y / self.second_moment_z
        both = np.where(self.is_round, np.hypot(about_y, about_z), about_y + about_z)
        return np.stack([axial + both, axial - both], axis=-1)

    def fibre(self, s: int, moment: Array, sign: float) -> tuple[float, float]:
        """y and z of the fibre where bending by a `moment` `(3,)` gives most tension (`sign` 1)
        or compression (-1)."""
        towards = sign * np.array([-moment[2], moment[1]])
        size = float(np.linalg.norm(towards))
        if self.is_round[s]:
            direction = towards / size if size > 0.0 else towards
        else:
            direction = np.sign(towards)
        return float(direction[0] * self.half_y[s]), float(direction[1] * self.half_z[s])

    def per_load(self, s: int, y: float, z: float) -> Array:
        """`(6,)` normal stress of a fibre per force and moment."""
        out = np.zeros(6)
        out[0] = 1.0 / self.area[s]
        out[4] = z / self.second_moment_y[s]
        out[5] = -y / self.second_moment_z[s]
        return out


def sections_at(beam: Beam, stations: Array) -> Sections:
    """The sections of a beam at stations `(s,)` [m]; where two segments meet, that of the outer."""
    values = np.full((5, stations.size), np.nan)
    is_round = np.zeros(stations.size, dtype=np.bool_)
    starts = beam.starts
    for i, x in enumerate(stations.tolist()):
        index = max(bisect_right(starts, x * (1.0 + 1e-12)) - 1, 0)
        segment = beam.segments[index]
        if isinstance(segment.section, Equivalent):
            continue
        fraction = np.clip(np.array([(x - starts[index]) / segment.length]), 0.0, 1.0)
        geometry, outline, *_ = segment.section._properties(segment.end, fraction)
        values[:3, i] = [
            float(geometry.area[0]),
            float(geometry.second_moment_z[0]),
            float(geometry.second_moment_y[0]),
        ]
        values[3:, i] = float(outline.half_y[0]), float(outline.half_z[0])
        is_round[i] = outline.is_round
    area, second_z, second_y, half_y, half_z = values
    return Sections(area, second_z, second_y, half_y, half_z, is_round)
