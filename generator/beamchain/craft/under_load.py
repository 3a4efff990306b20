"""The exact spacecraft under its own load: gravity where it is held, or a constant thrust.

All mass is placed in space as a function of the spacecraft's joints q and the modal coordinates eta
of its appendages, rotations of any size; with V the potential of the field that acts in the
spacecraft's own axes (gravity less acceleration), what the load adds to the linear model is

    K += d2V/dz2,   M(0) -> M(eta_0),   W^2 eta_0 = -dV/d eta   (z = (q, eta))

at the sag eta_0. The joints stay where the pose has them: what holds them is taken as in balance.

Theory: docs/theory.md, section 9.
"""

from collections.abc import Iterator, Sequence
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


class _States(NamedTuple):
    """Places of all mass in b states: `(b, e, 3)`, and the axes of each `(b, e, 3, 3)`."""

    places: Array
    axes: Array


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

    def _states(self, moved: Array) -> Iterator[_States]:
        """All mass at coordinates `moved` `(b, n)` about the pose, in batches."""
        for part in np.array_split(moved, range(BATCH, len(moved), BATCH)):
            yield self._placed(part)

    def _placed(self, moved: Array) -> _States:
        craft = self.craft
        nv = craft.nv
        data = mujoco.MjData(craft)
        some, where = np.unique(moved[:, :nv], axis=0, return_inverse=True)
        places = np.empty((len(some), craft.nbody, 3))
        axes = np.empty((len(some), craft.nbody, 3, 3))
        origins = np.empty((len(some), len(self.roots), 3))
        frames = np.empty((len(some), len(self.roots), 3, 3))
        for k, change in enumerate(some):
            data.qpos[:] = self.qpos
            mujoco.mj_integratePos(craft, data.qpos, change, 1.0)
            mujoco.mj_kinematics(craft, data)
            places[k] = data.xipos
            axes[k] = data.ximat.reshape(-1, 3, 3)
            for i, mount in enumerate(self.mounts):
                origins[k, i], frames[k, i] = root_frame(mount, data)
        where = where.reshape(-1)
        places, axes, origins, frames = (a[where] for a in (places, axes, origins, frames))
        of_place, of_body = self._carriers
        bent = [
            line.bent(moved[:, a:b])
            for line, a, b in zip(self.lines, self._ends[:-1], self._ends[1:], strict=True)
        ]
        stood = origins.copy(), frames.copy()  # with every appendage straight

        def carry(hung: _Hung, place: Array, turn: Array) -> tuple[Array, Array]:
            """Where the port takes what stands at a place of the rigid spacecraft."""
            i = hung.number
            a, b = self._ends[i], self._ends[i + 1]
            end, tilt = self.lines[i].port(hung.load, bent[i][0], bent[i][1], moved[:, a:b])
            start = stood[0][:, i] + stood[1][:, i, :, 0] * self.roots[i].loads[hung.load].x
            # from the axes of the straight root to those of the moved port
            back = np.swapaxes(stood[1][:, i], 1, 2)
            rotation = frames[:, i] @ tilt @ back
            base = origins[:, i] + np.einsum("bij,bj->bi", frames[:, i], end)
            return base + np.einsum("bij,bj->bi", rotation, place - start), rotation @ turn

        for i in self._order:
            if i in of_place:
                origins[:, i], frames[:, i] = carry(of_place[i], stood[0][:, i], stood[1][:, i])
        for body, hung in of_body.items():
            places[:, body], axes[:, body] = carry(hung, places[:, body], axes[:, body])
        cells = [
            (
                origins[:, i, None] + np.einsum("bij,bcj->bci", frames[:, i], centres),
                frames[:, i, None] @ turned,
            )
            for i, (turned, _, centres) in enumerate(bent)
        ]
        return _States(
            np.concatenate([places, *(place for place, _ in cells)], axis=1),
            np.concatenate([axes, *(turn for _, turn in cells)], axis=1),
        )

    def _potential(self, moved: Array) -> Array:
        """`(b,)` potential of the field [J]."""
        mass = self._masses[0]
        field = self.loading.field
        parts = [np.einsum("e,bei,i->b", mass, s.places, field) for s in self._states(moved)]
        return -np.concatenate(parts)

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
        speed = (ahead.places - behind.places) / twice
        relative = ahead.axes @ np.swapaxes(behind.axes, -1, -2)
        turn = np.stack(
            [
                relative[..., 2, 1] - relative[..., 1, 2],
                relative[..., 0, 2] - relative[..., 2, 0],
                relative[..., 1, 0] - relative[..., 0, 1],
            ],
            axis=-1,
        ) / (2.0 * twice)
        own = np.einsum("neji,nej->nei", np.broadcast_to(here.axes, relative.shape), turn)
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
