"""What the modes of a beam do inside it: motion of its sections, and momentum of what lies beyond;
from these the output matrices of its sections.

A section carries the rate of change of the momentum beyond it. With P_k the momentum beyond a
section per rate of mode k, the force that strain makes there is `sum_k P_k W_k^2 eta_k`, as exact
as the mode itself, without a derivative of its shape.

Theory: docs/theory.md, section 10.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from beamchain.errors import InputError
from beamchain.ports.model import PortModel, Shapes
from beamchain.ports.motions import PORT_MOTION, Array, offset_matrix
from beamchain.structure.beam import Beam
from beamchain.structure.discretise import Parts, converged_model
from beamchain.structure.recovery_rows import OutputMatrices, RecoveredQuantity, crossed

Reduce = Callable[[PortModel, Sequence[float]], PortModel]

AT_ONCE = 6  # stations that one discretisation is cut at: more would cost it its written rows
SNAPPED = 1e-6  # of the length: a station so near to a step of the beam is meant to stand there
BEYOND = 1e-9  # of the length: what hangs at a station itself hangs before it
AXES = ("x", "y", "z")
SECTION = tuple(
    RecoveredQuantity(name, AXES, (unit,) * 3, name.endswith("acceleration"))
    for name, unit in (
        ("force", "N"),
        ("moment", "N m"),
        ("displacement", "m"),
        ("rotation", "rad"),
        ("acceleration", "m/s^2"),
        ("angular acceleration", "rad/s^2"),
    )
)
MOTION = slice(6, 12)  # displacement and rotation among these components


@dataclass(frozen=True, eq=False)
class Inside:
    """The kept modes (n) and the static response of a port of a beam at s stations, in space.

    Args:
        frequencies: `(n,)` of the kept modes [rad/s].
        drives: `(n, d)` force on each kept mode per drive; see `OutputMatrices`.
        motion: `(s, 6, n)` of the sections in each kept mode.
        momentum: `(s, 6, n)` beyond each section per rate of each kept mode, about the section.
        static: `(s, 6, d)` motion of the sections per constant drive, all modes.
    """

    frequencies: Array
    drives: Array
    motion: Array
    momentum: Array
    static: Array


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
) -> Inside:
    """What happens at some stations of a beam in a port; nothing where the beam is rigid there.

    Args:
        beam: the appendage.
        port: "xy", "xz", "torsion" or "axial".
        modes: the lowest that have to be right.
        reduce: from all modes to those that are kept, of a model that has the points, x [m], that
            carry something.
        stations: `(s,)`, as `snapped` leaves them [m].
        carried: x of points that may carry something [m].
    """
    parts = Parts(beam.segments, beam.joints, beam.lumps)
    pieces: list[Inside] = []
    for some in np.split(stations, range(AT_ONCE, stations.size, AT_ONCE)):
        cuts = sorted({*some.tolist(), *carried})
        try:
            full = converged_model(parts, port, modes, tuple(cuts), shaped=True)
        except InputError:
            still = np.zeros((stations.size, 6, 6 + 9 + 6 * len(carried)))
            return Inside(np.zeros(0), still[0, :0], still[:, :, :0], still[:, :, :0], still)
        kept = reduce(full, carried)
        momentum = _momentum(_shapes(kept), some, BEYOND * beam.length)
        # sum_k u_k D_k / W_k^2
        yielding = _drives(full, port, carried) / full.frequencies[:, None] ** 2
        pieces.append(
            Inside(
                kept.frequencies,
                _drives(kept, port, carried),
                _points(kept, port, some.tolist()),
                PORT_MOTION[port] @ momentum.transpose(1, 2, 0),
                _points(full, port, some.tolist()) @ yielding,
            )
        )
    return Inside(
        pieces[0].frequencies,
        pieces[0].drives,
        np.concatenate([piece.motion for piece in pieces]),
        np.concatenate([piece.momentum for piece in pieces]),
        np.concatenate([piece.static for piece in pieces]),
    )


def section_outputs(
    beam: Beam, ports: Sequence[Inside], stations: Array, carried: Sequence[float]
) -> OutputMatrices:
    """Loads and motion of the sections of a beam at stations `(s,)` [m], all its ports together.

    `carried`: x of points that may carry something [m].
    """
    frequencies = np.concatenate([inside.frequencies for inside in ports])
    motion = np.concatenate([inside.motion for inside in ports], axis=2)
    momentum = np.concatenate([inside.momentum for inside in ports], axis=2)
    load = momentum * frequencies**2
    static = np.sum([inside.static for inside in ports], axis=0)
    root = _offsets(stations)
    # in space: a + w x (w x r) + 2 w x u' + u'', and as much of its turn
    coriolis = crossed(motion) * np.repeat([2.0, 1.0], 3)[:, None, None]
    spin = np.concatenate([crossed(root[:, :, 3:]), coriolis], axis=3)
    return OutputMatrices(
        quantities=SECTION,
        frequencies=frequencies,
        drives=np.vstack([inside.drives for inside in ports]),
        modes=np.concatenate([load, motion, 0.0 * motion], axis=1),
        accelerations=np.concatenate([0.0 * load, 0.0 * motion, motion], axis=1),
        root=np.pad(root, ((0, 0), (12, 0), (0, 0))),
        spin=np.pad(spin, ((0, 0), (12, 0), (0, 0), (0, 0))),
        static=np.concatenate([_rigid_load(beam, stations, carried), static, 0.0 * static], axis=1),
    )


def _offsets(distances: Array) -> Array:
    """`(s, 6, 6)` motion of points on the axis per motion of one so far before them `(s,)` [m]."""
    return np.array([offset_matrix(np.array([x, 0.0, 0.0])) for x in distances])


def _rigid_load(beam: Beam, stations: Array, carried: Sequence[float]) -> Array:
    """`(s, 6, d)` load at the stations per drive where the beam is rigid: by Newton and Euler of
    what lies beyond, and wrenches on points beyond, moved to the station."""
    mass = beam.line.behind(stations)
    weight = np.concatenate([mass, crossed(mass[:, :, 3:]).reshape(-1, 6, 9)], axis=2)
    loads = [-_offsets(-stations).transpose(0, 2, 1) @ weight]
    for x in carried:
        beyond = stations < x * (1.0 - BEYOND)
        loads.append(_offsets(x - stations).transpose(0, 2, 1) * beyond[:, None, None])
    return np.concatenate(loads, axis=2)


def _points(model: PortModel, port: str, points: Sequence[float]) -> Array:
    """`(k, 6, n)` motion of some points, x [m], in each mode."""
    return PORT_MOTION[port] @ model.point_motion(points).transpose(1, 2, 0)


def _shapes(model: PortModel) -> Shapes:
    assert model.shapes is not None
    return model.shapes


def _drives(model: PortModel, port: str, points: Sequence[float]) -> Array:
    """`(n, d)` force on each mode: `-L` of the root's acceleration, the motion of the points of
    wrenches on them."""
    rows = model.participation @ PORT_MOTION[port].T
    # w x (w x e_x): across the axis as an angular acceleration does
    along, across_y, across_z = crossed(_offsets(np.ones(1))[:, :, 3:])[0, :3].reshape(3, 9)
    spun = np.outer(rows[:, 5], across_y) - np.outer(rows[:, 4], across_z)
    if port == "axial":
        shapes = _shapes(model)
        spun += np.outer(shapes.values @ (shapes.moved * shapes.x), along)
    motion = _points(model, port, points).reshape(6 * len(points), model.modes)
    return np.hstack([-rows, -spun, motion.T])


def _momentum(shapes: Shapes, stations: Array, edge: float) -> Array:
    """`(n, s, m)` momentum beyond each station, about it, per rate of each mode."""
    reach = shapes.x[:, None] - stations
    beyond = np.where(reach > edge, 1.0, 0.0)
    force = shapes.values @ (shapes.moved[:, None] * beyond)
    if not shapes.bending:
        return force[:, :, None]
    arms = shapes.moved[:, None] * reach + shapes.turned[:, None]
    return np.stack([force, shapes.values @ (arms * beyond)], axis=2)
