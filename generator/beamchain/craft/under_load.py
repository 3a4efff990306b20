"""The exact spacecraft under its own load: gravity where it is held, or a constant thrust.

All mass is placed in space as a function of the spacecraft's joints q and the modal coordinates eta
of its appendages, rotations of any size; with V the potential of the field that acts in the
spacecraft's own axes (gravity less acceleration), what the load adds to the linear model is

    K += d2V/dz2,   M(0) -> M(eta_0),   W^2 eta_0 = -dV/d eta   (z = (q, eta))

at the sag eta_0. The joints stay where the pose has them: what holds them is taken as in balance.

Theory: docs/theory.md, section 9.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from beamchain.craft.bent_line import BentLine
from beamchain.craft.hanging_liquid import HangingLiquid
from beamchain.craft.loads import Root
from beamchain.engine.library import mujoco
from beamchain.engine.linear import Linear
from beamchain.engine.loaded import Loading
from beamchain.engine.mount import Mount, root_frame
from beamchain.ports.motions import Array

STEP = 3e-3  # rad (m of slides) by which places are differenced
ROUNDS = 30  # of the search for the sag
SETTLED = 1e-12  # of the largest sag
FEEL = (600.0, 300.0, 100.0, 30.0, 10.0)  # times the band: modes whose inertia the sag changes
MOST = 1.0 - 1e-6  # of the inertia of a mode that the sag may take: beyond, it is rounding
BATCH = 2000  # states worked on at a time


class _Hung(NamedTuple):
    """What carries something: number of the appendage, and of the load among its own."""

    number: int
    load: int


def _frames(places: Array, axes: Array) -> Array:
    """`(..., 4, 4)` homogeneous, of places `(..., 3)` and axes `(..., 3, 3)` in columns."""
    out = np.zeros((*axes.shape[:-2], 4, 4))
    out[..., :3, :3] = axes
    out[..., :3, 3] = places
    out[..., 3, 3] = 1.0
    return out


@dataclass(frozen=True, eq=False)
class LoadedTree:
    """The bare, quiet spacecraft at a pose with appendages that bend.

    Args:
        craft: compiled; `qpos` `(nq,)` its pose.
        roots: of its appendages there, on their `mounts`; `lines`: how each bends.
        loading: the field and what pushes.
    """

    craft: "mujoco.MjModel"
    qpos: Array
    roots: Sequence[Root]
    mounts: Sequence[Mount]
    lines: Sequence[BentLine | HangingLiquid]
    loading: Loading

    @cached_property
    def _carriers(self) -> tuple[dict[int, _Hung], dict[int, _Hung]]:
        """What carries each appendage and each body most directly."""
        of_place: dict[int, _Hung] = {}
        of_body: dict[int, _Hung] = {}
        number = {root.at: i for i, root in enumerate(self.roots)}
        every = [
            (len(load.bodies) + len(load.places), _Hung(i, k), load)
            for i, root in enumerate(self.roots)
            for k, load in enumerate(root.loads)
        ]
        # the outermost port carries least
        for _, hung, load in sorted(every, key=lambda item: -item[0]):
            of_place |= {number[at]: hung for at in load.places if at in number}
            of_body |= dict.fromkeys(load.bodies, hung)
        return of_place, of_body

    @cached_property
    def _order(self) -> list[int]:
        """Appendages, carriers before what they carry."""
        of_place = self._carriers[0]

        def depth(i: int) -> int:
            return 0 if i not in of_place else 1 + depth(of_place[i].number)

        return sorted(range(len(self.roots)), key=depth)

    @cached_property
    def _masses(self) -> tuple[Array, Array]:
        """`(e,)` masses and `(e, 3, 3)` inertias in their own axes: bodies, then cells."""
        bodies = np.einsum("ei,ij->eij", self.craft.body_inertia, np.eye(3))
        return (
            np.concatenate([self.craft.body_mass, *(line.masses for line in self.lines)]),
            np.concatenate([bodies, *(line.inertias for line in self.lines)]),
        )

    @cached_property
    def _steps(self) -> Array:
        """`(n,)` by how much each coordinate is moved."""
        return np.concatenate(
            [np.full(self.craft.nv, STEP), *(STEP / line.size for line in self.lines)]
        )

    @cached_property
    def _ends(self) -> list[int]:
        """Where the modal coordinates of each appendage begin, and the last ends."""
        nv = self.craft.nv
        counts = [line.rows.size for line in self.lines]
        return np.cumsum([nv, *counts]).tolist()

    def _straight(self, joints: Array) -> tuple[Array, Array]:
        """Frames of the masses of all bodies `(b, nbody, 4, 4)`, and of the roots of all appendages
        `(b, roots, 4, 4)`, where none bends; `joints` `(b, nv)`: about the pose."""
        data = mujoco.MjData(self.craft)
        some, where = np.unique(joints, axis=0, return_inverse=True)
        bodies = list[Array]()
        roots = list[list[Array]]()
        for change in some:
            data.qpos[:] = self.qpos
            mujoco.mj_integratePos(self.craft, data.qpos, change, 1.0)
            mujoco.mj_kinematics(self.craft, data)
            bodies.append(_frames(data.xipos, data.ximat.reshape(-1, 3, 3)))
            roots.append([_frames(*root_frame(mount, data)) for mount in self.mounts])
        where = where.reshape(-1)
        return np.array(bodies)[where], np.array(roots)[where]

    def _placed(self, moved: Array) -> Array:
        """`(b, e, 4, 4)` frames of all mass, bodies and then cells, at coordinates `moved` `(b, n)`
        about the pose."""
        of_place, of_body = self._carriers
        bodies, straight = self._straight(moved[:, : self.craft.nv])
        cells: list[Array] = [straight] * len(self.lines)
        ports = {*of_place.values(), *of_body.values()}
        shifts: dict[_Hung, Array] = {}  # of all that a port carries
        for i in self._order:
            root = straight[:, i]
            if i in of_place:
                root = shifts[of_place[i]] @ root
            eta = moved[:, self._ends[i] : self._ends[i + 1]]
            turned, ends, centres = self.lines[i].bent(eta)
            cells[i] = root[:, None] @ _frames(centres, turned)
            for hung in (hung for hung in ports if hung.number == i):
                port = _frames(*self.lines[i].port(hung.load, turned, ends, eta))
                along = np.array([self.roots[i].loads[hung.load].x, 0.0, 0.0])
                unbent = straight[:, i] @ _frames(along, np.eye(3))
                shifts[hung] = root @ port @ np.linalg.inv(unbent)
        for body, hung in of_body.items():
            bodies[:, body] = shifts[hung] @ bodies[:, body]
        return np.concatenate([bodies, *cells], axis=1)

    def _potential(self, moved: Array) -> Array:
        """`(b,)` potential of the field [J]."""
        mass = self._masses[0]
        field = self.loading.field
        batches = np.array_split(moved, range(BATCH, len(moved), BATCH))
        places = (self._placed(batch)[..., :3, 3] for batch in batches)
        return -np.concatenate([np.einsum("e,bei,i->b", mass, place, field) for place in places])

    @cached_property
    def sag(self) -> Array:
        """`(n,)` coordinates at rest under the load: those of the joints are zero."""
        n = self._ends[-1]
        nv = self.craft.nv
        squares = [line.model.frequencies[line.rows] ** 2 for line in self.lines]
        spring = np.concatenate([np.zeros(nv), *squares])
        sag = np.zeros(n)
        bending = np.arange(nv, n)
        stiffness = np.diag(spring[bending]) + self._curvature(sag, bending, bending)
        for _ in range(ROUNDS):
            force = self._slope(sag, bending) + spring[bending] * sag[bending]
            change = np.linalg.solve(stiffness, force)
            sag[bending] -= change
            if np.all(np.abs(change) <= SETTLED * np.max(np.abs(sag), initial=1e-300)):
                break
        return sag

    def _slope(self, at: Array, coordinates: NDArray[np.intp]) -> Array:
        """dV/dz at a state, for some coordinates."""
        steps = self._steps[coordinates]
        ways = np.zeros((len(coordinates), at.size))
        ways[np.arange(len(coordinates)), coordinates] = steps
        both = self._potential(np.vstack([at + ways, at - ways]))
        ahead, behind = np.split(both, 2)
        return (ahead - behind) / (2.0 * steps)

    def _curvature(self, at: Array, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Array:
        """`(rows, columns)` d2V/dz2 at a state."""
        pairs = sorted({(min(i, j), max(i, j)) for i in rows.tolist() for j in columns.tolist()})
        first, second = np.array(pairs).T
        ways = np.diag(self._steps)
        moved = np.concatenate(
            [
                at + a * ways[first] + b * ways[second]
                for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))
            ]
        )
        values = self._potential(moved).reshape(4, -1)
        slopes = (values[0] - values[1] - values[2] + values[3]) / (
            4.0 * self._steps[first] * self._steps[second]
        )
        out = np.zeros((at.size, at.size))
        out[first, second] = slopes
        out[second, first] = slopes
        return out[np.ix_(rows, columns)]

    def _mass_matrix(self, at: Array) -> Array:
        """`(n, n)` of all mass at a state."""
        n = at.size
        mass, inertia = self._masses
        ways = np.diag(self._steps)
        ahead, behind = (self._placed(at + sign * ways) for sign in (1.0, -1.0))
        here = self._placed(at[None])
        twice = 2.0 * self._steps[:, None, None]
        speed = (ahead - behind)[..., :3, 3] / twice
        relative = ahead[..., :3, :3] @ np.swapaxes(behind[..., :3, :3], -1, -2)
        turn = np.stack(
            [
                relative[..., 2, 1] - relative[..., 1, 2],
                relative[..., 0, 2] - relative[..., 2, 0],
                relative[..., 1, 0] - relative[..., 0, 1],
            ],
            axis=-1,
        ) / (2.0 * twice)
        own = np.einsum("neji,nej->nei", np.broadcast_to(here[..., :3, :3], relative.shape), turn)
        flat = (speed * np.sqrt(mass)[:, None]).reshape(n, -1)
        turning = own.reshape(n, -1) @ np.einsum("eij,nej->nei", inertia, own).reshape(n, -1).T
        mass = flat @ flat.T + turning
        nv = self.craft.nv
        mass[np.arange(nv), np.arange(nv)] += self.craft.dof_armature
        return mass

    def loaded(self, craft: Linear, bases: Sequence[int], band: float) -> Linear:
        """A linear model of the straight spacecraft under the load.

        `bases`: where the modes of each appendage begin among its coordinates; `band`: of interest
        [rad/s].
        """
        nv = self.craft.nv
        rows = [base + line.rows for base, line in zip(bases, self.lines, strict=True)]
        to = np.concatenate([np.arange(nv), *rows])
        every = np.arange(self._ends[-1])
        curvature = self._curvature(self.sag, every, every)
        curvature[:nv, :nv] += self.loading.pushed
        heavier = self._mass_matrix(self.sag) - self._mass_matrix(np.zeros_like(self.sag))
        stiffness = craft.stiffness.copy()
        stiffness[np.ix_(to, to)] += self.loading.in_own_axes(curvature)
        # of what is slow enough to feel it: y = B^T M z of the modes B of the straight spacecraft
        squares, modes = eigh(craft.stiffness, craft.mass)
        tops = [modes[:, squares < (share * band) ** 2] for share in FEEL]
        changes = [slow[to].T @ heavier @ slow[to] for slow in tops]
        fine = [bool(np.all(np.linalg.eigvalsh(changed) > -MOST)) for changed in changes]
        chosen = fine.index(True) if any(fine) else -1
        slow = tops[chosen]
        changed = changes[chosen]
        to_slow = slow.T @ craft.mass
        mass = craft.mass + to_slow.T @ changed @ to_slow
        return replace(craft, mass=mass, stiffness=stiffness)
