"""What the modes of a beam do inside it: motion of its sections, and momentum of what lies beyond.

A section carries the rate of change of the momentum beyond it. With P_k the momentum beyond a
section per rate of mode k, the force that strain makes there is `sum_k P_k W_k^2 eta_k`, as exact
as the mode itself, without a derivative of its shape.

Theory: docs/theory.md, section 10.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from beamchain.errors import InputError
from beamchain.ports.model import PortModel, Shapes
from beamchain.ports.motions import Array
from beamchain.structure.beam import Beam
from beamchain.structure.discretise import Parts, converged_model

Reduce = Callable[[PortModel, Sequence[int]], PortModel]

AT_ONCE = 6  # stations that one discretisation is cut at: more would cost it its written rows
SNAPPED = 1e-6  # of the length: a station so near to a step of the beam is meant to stand there
BEYOND = 1e-9  # of the length: what hangs at a station itself hangs before it


@dataclass(frozen=True, eq=False)
class Inside:
    """The kept modes (n) and the static response of a port's m motions at s stations.

    What drives the modes are i accelerations: the m of the root and, in axial motion, that of a
    spin, which grows with x. Points that carry something (c) drive them by m forces each.

    Args:
        frequencies: `(n,)` of the kept modes [rad/s].
        motion: `(n, s, m)` of the sections in each kept mode.
        momentum: `(n, s, m)` beyond each section per rate of each kept mode, about the section.
        drive: `(n, i)` force on each kept mode per acceleration, turned round: `L_k`.
        drive_carried: `(n, c m)` force on each kept mode per force on the points.
        static: `(s, m, i)` motion of the sections per constant acceleration, all modes.
        static_carried: `(s, m, c m)` motion of the sections per constant force on the points.
    """

    frequencies: Array
    motion: Array
    momentum: Array
    drive: Array
    drive_carried: Array
    static: Array
    static_carried: Array

    @property
    def left_out(self) -> Array:
        """`(s, m, i)` motion of the sections per constant acceleration, the modes left out."""
        return self.static + _static(self.motion, self.frequencies, self.drive)

    @property
    def left_out_carried(self) -> Array:
        """`(s, m, c m)` motion of the sections per constant force, the modes left out."""
        return self.static_carried - _static(self.motion, self.frequencies, self.drive_carried)

    def joined(self, other: Self) -> "Inside":
        """The stations of both."""
        return Inside(
            self.frequencies,
            np.concatenate([self.motion, other.motion], axis=1),
            np.concatenate([self.momentum, other.momentum], axis=1),
            self.drive,
            self.drive_carried,
            np.concatenate([self.static, other.static]),
            np.concatenate([self.static_carried, other.static_carried]),
        )


def _static(motion: Array, frequencies: Array, force: Array) -> Array:
    """`(s, m, i)` `sum_k u_k g_k / W_k^2`: motion `(n, s, m)` under constant forces `(n, i)`."""
    return np.einsum("nsm,n,ni->smi", motion, frequencies**-2.0, force)


def snapped(beam: Beam, x: Array) -> Array:
    """Stations moved onto ends of segments and lumps right beside them."""
    ends = np.array([*beam.starts, beam.length, *(lump.x for lump in beam.lumps)])
    nearest = ends[np.argmin(np.abs(x[:, None] - ends), axis=1)]
    return np.where(np.abs(x - nearest) <= SNAPPED * beam.length, nearest, x)


def inside_beam(
    beam: Beam,
    port: str,
    modes: int,
    reduce: Reduce,
    stations: Array,
    carried: Sequence[float] = (),
) -> Inside | None:
    """What happens at some stations of a beam in a port; None where the beam is rigid there.

    Args:
        beam: the appendage.
        port: "xy", "xz", "torsion" or "axial".
        modes: the lowest that have to be right.
        reduce: from all modes to those that are kept, of a model in whose `tip` the points that
            carry something have the numbers given.
        stations: `(s,)`, as `snapped` leaves them [m].
        carried: x of points that may carry something [m].
    """
    parts = Parts(beam.segments, beam.joints, beam.lumps)
    every: Inside | None = None
    for some in np.split(stations, range(AT_ONCE, stations.size, AT_ONCE)):
        cuts = sorted({*some.tolist(), *carried})
        try:
            full = converged_model(parts, port, modes, tuple(cuts), shaped=True)
        except InputError:
            return None
        columns = [1 + cuts.index(x) for x in some.tolist()]
        points = [1 + cuts.index(x) for x in carried]
        kept = reduce(full, points)
        motion, forced = (_points(full, c) for c in (columns, points))
        own, own_forced = (_points(kept, c) for c in (columns, points))
        part = Inside(
            kept.frequencies,
            own,
            _momentum(_shapes(kept), some, BEYOND * beam.length),
            _drive(kept, port),
            _flat(own_forced),
            -_static(motion, full.frequencies, _drive(full, port)),
            _static(motion, full.frequencies, _flat(forced)),
        )
        every = part if every is None else every.joined(part)
    return every


def _points(model: PortModel, columns: Sequence[int]) -> Array:
    """`(n, k, m)` motion of some points in each mode."""
    assert model.tip is not None
    shape = (model.modes, model.tip.shape[1] // model.motions, model.motions)
    return model.tip.reshape(shape)[:, list(columns)]


def _flat(motion: Array) -> Array:
    """`(n, k m)` of motion `(n, k, m)`."""
    return motion.reshape(len(motion), motion.shape[1] * motion.shape[2])


def _shapes(model: PortModel) -> Shapes:
    assert model.shapes is not None
    return model.shapes


def _drive(model: PortModel, port: str) -> Array:
    """`(n, i)` participation, in axial motion that in an acceleration of x per metre as well."""
    if port != "axial":
        return model.participation
    shapes = _shapes(model)
    return np.column_stack([model.participation, shapes.values @ (shapes.moved * shapes.x)])


def _momentum(shapes: Shapes, stations: Array, edge: float) -> Array:
    """`(n, s, m)` momentum beyond each station, about it, per rate of each mode."""
    reach = shapes.x[:, None] - stations
    beyond = np.where(reach > edge, 1.0, 0.0)
    force = shapes.values @ (shapes.moved[:, None] * beyond)
    if not shapes.bending:
        return force[:, :, None]
    arms = shapes.moved[:, None] * reach + shapes.turned[:, None]
    return np.stack([force, shapes.values @ (arms * beyond)], axis=2)
