"""What a replay shows of a spacecraft, as points for any positions of the model: the solids of its
bodies, and its appendages as bent ribbons."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from beamchain.craft.appendage import Appendage, names
from beamchain.craft.recovered_body import recovered_beam
from beamchain.engine.geometry import CORNERS
from beamchain.engine.library import mujoco, rotation_matrix
from beamchain.engine.model_diff import ids_of
from beamchain.engine.operating_point import base_body
from beamchain.errors import BeamchainError
from beamchain.mjcf.visuals import box_squares
from beamchain.ports.motions import Array
from beamchain.structure.beam import Beam
from beamchain.structure.section_loads import MOTION, snapped

STATIONS = 12  # of an appendage at which its modes are evaluated, where there are few,
FEWEST = 4
MOST_STATIONS = 160  # of all appendages together
LEAST = 4  # of a segment; where there are many, its ends
FINER = 2  # times as many points are drawn, by splines
MOST_SOLIDS = 40
MOST_APPENDAGES = 40
SLIM = 1.0 / 400.0  # of the length: half the width of an appendage whose section tells none
ROUND = 16  # corners of a circle
HIDDEN = 3  # MuJoCo's groups of geoms that its viewer does not show begin here
WAYS = np.array(
    [
        [x, y, z]
        for x in (-1, 0, 1)
        for y in (-1, 0, 1)
        for z in (-1, 0, 1)
        if (x, y, z) != (0, 0, 0)
    ],
    dtype=np.float64,
)


class Solid(NamedTuple):
    """A convex solid of a body: `corners` `(k, 3)` in its axes [m]; `faces`: the corners of each
    side, anticlockwise from outside, of a box; empty where the outline is all that is drawn."""

    body: int
    corners: Array
    faces: tuple[tuple[int, ...], ...]


class Ribbon(NamedTuple):
    """An appendage.

    Args:
        appendage: whose.
        root: number of its first link.
        links: `(s,)` body whose axes each station has: the first link where the beam bends
            between, else the link that is there.
        places: `(s, 3)` of the stations in these axes [m].
        sides: `(s, 2, 3)` from a station to the edges, half the extents along y and z [m].
        pieces: first and last station of each segment.
        motion: `(s, 6, n)` motion of the sections per modal coordinate.
        rows: `(n, nq)` of modal coordinates per position.
    """

    appendage: Appendage
    root: int
    links: NDArray[np.intp]
    places: Array
    sides: Array
    pieces: tuple[tuple[int, int], ...]
    motion: Array
    rows: Array


class Drawn(NamedTuple):
    """Points in the world [m]: corners `(k, 3)` of each solid; of each ribbon its middle `(s, 3)`
    and the ways to its edges `(s, 2, 3)`; each appendage's holder and root `(2, 3)`."""

    solids: list[Array]
    middles: list[Array]
    sides: list[Array]
    arms: list[Array]

    @property
    def points(self) -> Array:
        """`(n, 3)` all of them."""
        edges = [
            (middle[:, None] + sign * side).reshape(-1, 3)
            for middle, side in zip(self.middles, self.sides, strict=True)
            for sign in (-1.0, 1.0)
        ]
        return np.vstack([*self.solids, *edges, *self.arms])


class Outlines:
    """What is drawn of a compiled spacecraft with appendages.

    `left_out`: how many appendages and solids are not drawn, the shortest and smallest.
    """

    def __init__(self, model: "mujoco.MjModel", appendages: Sequence[Appendage]) -> None:
        self.model = model
        self._data = mujoco.MjData(model)
        self.base = base_body(model, int(model.body(f"{appendages[0].prefix}link1").id))
        own = set(ids_of(model, names(appendages))["body"])
        drawn = sorted(appendages, key=lambda a: -a.fit.chain.length)[:MOST_APPENDAGES]
        stations = max(min(STATIONS, MOST_STATIONS // len(drawn)), FEWEST)
        self.ribbons = [_ribbon(model, a, stations) for a in appendages if a in drawn]
        solids = [
            solid
            for i in range(model.ngeom)
            if int(model.geom_bodyid[i]) not in {0, *own} and (solid := _solid(model, i))
        ]
        if self.base not in {solid.body for solid in solids}:
            longest = max(a.fit.chain.length for a in appendages)
            solids.append(_box_of_inertia(model, self.base, 0.1 * longest))
        solids.sort(key=lambda solid: -float(np.ptp(solid.corners, axis=0).max()))
        self.solids = solids[:MOST_SOLIDS]
        self.left_out = len(appendages) - len(drawn), len(solids) - len(self.solids)

    @property
    def corners(self) -> int:
        """About how many points a drawing has."""
        return sum(2 * ribbon.links.size for ribbon in self.ribbons) + 12 * len(self.solids)

    def at(self, qpos: Array) -> Drawn:
        """The points at positions `(nq,)`."""
        data = self._data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, data)
        axes = np.array(data.xmat).reshape(-1, 3, 3)
        places = np.array(data.xpos)
        middles: list[Array] = []
        sides: list[Array] = []
        arms: list[Array] = []
        for ribbon in self.ribbons:
            motion = ribbon.motion @ (ribbon.rows @ qpos)
            turned = ribbon.sides + np.cross(motion[:, None, 3:], ribbon.sides)
            turn = axes[ribbon.links]
            moved = ribbon.places + motion[:, :3]
            middles.append(places[ribbon.links] + np.einsum("sij,sj->si", turn, moved))
            sides.append(np.einsum("sij,skj->ski", turn, turned))
            holder = int(self.model.body_parentid[ribbon.root])
            arms.append(places[[holder, ribbon.root]])
        solids = [places[s.body] + s.corners @ axes[s.body].T for s in self.solids]
        return Drawn(solids, middles, sides, arms)

    def frame(self, qpos: Array) -> tuple[Array, Array]:
        """Place `(3,)` and axes `(3, 3)`, in columns, of the base at positions `(nq,)`."""
        data = self._data
        data.qpos[:] = qpos
        mujoco.mj_kinematics(self.model, data)
        return data.xpos[self.base].copy(), data.xmat[self.base].reshape(3, 3).copy()


# -- appendages ------------------------------------------------------------------------------------
def _ribbon(model: "mujoco.MjModel", a: Appendage, stations: int) -> Ribbon:
    root = int(model.body(f"{a.prefix}link1").id)
    beam = a.fit.beam
    if beam is None:
        return _ribbon_of_links(model, a, root)
    ends = [*beam.starts, beam.length]
    least = LEAST if LEAST * len(beam.starts) <= 2 * stations else 2
    if least * len(beam.starts) > 4 * stations:  # drawn as one
        ends = [0.0, beam.length]
    parts = (np.diff(ends) / beam.length).tolist()
    counts = [max(round(stations * part), least) for part in parts]
    coarse = [
        np.linspace(low, high, count)
        for low, high, count in zip(ends[:-1], ends[1:], counts, strict=True)
    ]
    x, where = np.unique(snapped(beam, np.concatenate(coarse)), return_inverse=True)
    try:
        body = recovered_beam(a, tuple(x.tolist()))
    except BeamchainError:  # a chain whose modes are not found again, of fewer modes than asked for
        return _ribbon_of_links(model, a, root)
    motion = body.outputs.modes[:, MOTION]
    finer: list[Array] = []
    moved: list[Array] = []
    pieces: list[tuple[int, int]] = []
    for at, pick in zip(coarse, np.split(where, np.cumsum(counts)[:-1]), strict=True):
        fine = np.linspace(at[0], at[-1], FINER * (at.size - 1) + 1)
        start = pieces[-1][1] + 1 if pieces else 0
        pieces.append((start, start + fine.size - 1))
        finer.append(fine)
        moved.append(CubicSpline(at, motion[pick])(fine))
    points = np.concatenate(finer)
    depths = np.vstack([_depths(beam, fine) for fine in finer])
    return Ribbon(
        a,
        root,
        np.full(points.size, root),
        np.column_stack([points, 0.0 * points, 0.0 * points]),
        _sides(depths / 2.0, beam.length),
        tuple(pieces),
        np.concatenate(moved),
        body.coordinates(model, a).amplitudes,
    )


def _depths(beam: Beam, x: Array) -> Array:
    """`(k, 2)` extents along y and z at points of a segment [m], just inside it at its ends."""
    inside = x + 1e-6 * (x.mean() - x)
    return np.array([[beam.depth(at, plane) for plane in ("xy", "xz")] for at in inside.tolist()])


def _ribbon_of_links(model: "mujoco.MjModel", a: Appendage, root: int) -> Ribbon:
    """The links of the chain: imported modes have no line between."""
    chain = a.fit.chain
    links = [int(model.body(f"{a.prefix}link{i + 1}").id) for i in range(len(chain.links))]
    places = np.zeros((len(links) + 1, 3))
    places[-1, 0] = chain.length - chain.links[-1].start
    depths = np.zeros((len(places), 2))
    return Ribbon(
        a,
        root,
        np.array([*links, links[-1]]),
        places,
        _sides(depths, chain.length),
        ((0, len(places) - 1),),
        np.zeros((len(places), 6, 0)),
        np.zeros((0, model.nq)),
    )


def _sides(half: Array, length: float) -> Array:
    half = np.where(half.max(axis=1, keepdims=True) > 0.0, half, SLIM * length)
    return np.einsum("sk,ki->ski", half, np.eye(3)[1:])


# -- solids ----------------------------------------------------------------------------------------
# of a box, by the numbers of its corners
_SIDES = (
    (0, 1, 3, 2),
    (4, 6, 7, 5),
    (0, 4, 5, 1),
    (2, 3, 7, 6),
    (0, 2, 6, 4),
    (1, 5, 7, 3),
)


def _solid(model: "mujoco.MjModel", geom: int) -> Solid | None:
    """What is drawn of a geom; None of a plane, a field, and what cannot be seen."""
    material = int(model.geom_matid[geom])
    opacity = float(model.geom_rgba[geom, 3])
    if material >= 0:
        opacity = min(opacity, float(model.mat_rgba[material, 3]))
    if opacity <= 0.0 or int(model.geom_group[geom]) >= HIDDEN:
        return None
    kinds = mujoco.mjtGeom
    kind = int(model.geom_type[geom])
    size = np.array(model.geom_size[geom])
    faces: tuple[tuple[int, ...], ...] = ()
    if kind == int(kinds.mjGEOM_BOX):
        corners = CORNERS * size
        faces = _SIDES
    elif kind in (int(kinds.mjGEOM_SPHERE), int(kinds.mjGEOM_ELLIPSOID)):
        corners = _ball() * (size[:1] if kind == int(kinds.mjGEOM_SPHERE) else size)
    elif kind in (int(kinds.mjGEOM_CYLINDER), int(kinds.mjGEOM_CAPSULE)):
        end = size[0] * (_ball() if kind == int(kinds.mjGEOM_CAPSULE) else _circle())
        corners = np.vstack([end + np.array([0.0, 0.0, s * size[1]]) for s in (-1.0, 1.0)])
    elif kind == int(kinds.mjGEOM_MESH):
        mesh = int(model.geom_dataid[geom])
        start = int(model.mesh_vertadr[mesh])
        every = np.array(model.mesh_vert[start : start + int(model.mesh_vertnum[mesh])])
        corners = every[np.unique(np.argmax(every @ WAYS.T, axis=0))].astype(np.float64)
    else:
        return None
    turn = rotation_matrix(model.geom_quat[geom])
    corners = model.geom_pos[geom] + corners @ turn.T
    return Solid(int(model.geom_bodyid[geom]), corners, faces)


def _circle() -> Array:
    """`(ROUND, 3)` about z, of radius 1."""
    angle = 2.0 * np.pi * np.arange(ROUND) / ROUND
    return np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])


def _ball() -> Array:
    """Points of a unit sphere on circles of latitude."""
    heights = np.radians([-90.0, -54.0, -18.0, 18.0, 54.0, 90.0])
    rings = [_circle() * np.cos(h) + [0.0, 0.0, np.sin(h)] for h in heights]
    return np.vstack(rings)


def _box_of_inertia(model: "mujoco.MjModel", body: int, most: float) -> Solid:
    """A body without a visible geom: the even box of its mass and inertias, `most` [m] at most."""
    mass = max(float(model.body_mass[body]), 1e-300)
    squares = box_squares(mass, model.body_inertia[body].tolist())
    half = np.clip(np.sqrt(np.maximum(squares, 0.0)), 0.1 * most, most)
    turn = rotation_matrix(model.body_iquat[body])
    corners = model.body_ipos[body] + (CORNERS * half) @ turn.T
    return Solid(body, corners, _SIDES)
