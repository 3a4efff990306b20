"""Timing of appendages that carry bodies: stable for every craft, pose and payload, and near exact
motion at the poses of one craft.

A tendon of stiffness k and damping d gets the armature, stiffness and damping

    a = c h^2 k + (1 + e) h d / 2,   (1 + s) k,   (1 + e) d

With `c = 1/12`, `s = e = 0` the coupled poles of any tree are right to fourth order in the step.
Under a semi-implicit step the tree is stable if for every appendage alone, its root free,

    S + diag((c - (1 + s)/4) x^2) > 0,    S = condensed M_hh - P^T R^-1 P,    x = h sqrt(k)

since the matrices of the tree are a congruence of those of its parts and what they carry only adds
mass. Among all c, s, e that meet it those are taken with which the craft's response at the step
comes nearest to that of exact motion (`steps/tree_response.py`): least squares by Gauss-Newton
steps within a logarithmic barrier (S. Boyd and L. Vandenberghe, Convex Optimization, 2004,
section 11.3).

Theory: docs/theory.md, section 9.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from beamchain.engine.bench import mass_of_bodies
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import mass_of_alone
from beamchain.engine.operating_point import poses, quiet_copy, rest_point
from beamchain.ports.motions import Array, offset_matrix
from beamchain.steps.forms import ModeTime, TendonValues, stability
from beamchain.steps.integrators import SCHEMES, Scheme, continuous_poles
from beamchain.steps.modal import Modal, condensed_mass
from beamchain.steps.step_map import last_kept, motion_for
from beamchain.steps.tree_response import ResponseResidual, Seen, Tendons, outer_dofs

HINGE = 3  # mjJNT_HINGE
APART = np.pi / 6.0  # by which joints turn from one pose to the next, at most
ROUNDING = 1e-9  # of that
MOST_PARTS = 12  # of the way from one keyframe to the next
TURNED = (np.pi / 4.0, np.pi / 2.0, 3.0 * np.pi / 4.0)  # where no keyframe turns anything
FASTEST = 0.5  # rad per step up to which the response is kept
UNASKED = 0.2  # the same where no band is asked for: the lower, the nearer
ROOM = 0.02  # of S + diag(c x^2) that is left over at least
START = 0.3  # of c above its limit, where the search begins
HIGHEST = 3.0  # c: a larger one would bring the tendon's own mode down towards the band
SOFTEST, STIFFEST = 0.01, 0.05  # bounds of |s|: a static error of that size
YIELDING = 5.0 / 16.0  # bound of |s| over the squared phase per step at the end of the band
DAMPED = 0.3  # bound of |e|
# distances from the imaginary axis at which responses are compared, relative to frequency: from
# afar first, since poles that are still wrong have nothing in common near it
NEARNESS = (0.3, 0.1, 0.03, 0.01, 0.003)
WEIGHTS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)  # of the barrier, one after the other
NEWTON_STEPS = 12
SETTLED = 1e-3  # decrease over the barrier's weight that ends the steps of one weight
ALIKE = 0.5  # relative difference below which responses are compared from nearer by
SHORTEST = 1e-6  # of a step that is tried
TOUCHING = 1e-9  # below c = 0, so that 0 can be had
NAME = re.compile(r"(?:mode|filler)\d+(?:_(?:xy|xz|torsion|axial)\d*)?$")


class FreeAppendage(NamedTuple):
    """The modal tendons of one appendage.

    Args:
        tendons: `(n,)` their places in `Modal`.
        held, free: `(n, n)` condensed mass of their lengths, the root held, and free, without what
            the appendage carries.
    """

    tendons: NDArray[np.intp]
    held: Array
    free: Array


def appendages_alone(model: "mujoco.MjModel", modal: Modal) -> list[FreeAppendage]:
    """Every appendage of a model that is not timed, alone."""
    prefixes = [NAME.sub("", name) for name in modal.names]
    quiet = quiet_copy(model)
    data = rest_point(quiet).data()
    out: list[FreeAppendage] = []
    for prefix in dict.fromkeys(prefixes):
        tendons = np.array([i for i, name in enumerate(prefixes) if name == prefix], dtype=np.intp)
        dofs = np.flatnonzero(np.any(modal.rows[tendons] != 0.0, axis=0))
        rows = modal.rows[np.ix_(tendons, dofs)]
        first = int(model.body_parentid[int(model.dof_bodyid[dofs[0]])])
        bodies = list(dict.fromkeys([first, *model.dof_bodyid[dofs].tolist()]))
        mass = mass_of_alone(quiet, bodies)[np.ix_(dofs, dofs)]
        rigid, momentum = _root(model, data, first, bodies, dofs)
        free = mass - momentum.T @ np.linalg.lstsq(rigid, momentum, rcond=1e-12)[0]
        held = condensed_mass(mass, rows)[0]
        out.append(FreeAppendage(tendons, held, condensed_mass((free + free.T) / 2.0, rows)[0]))
    return out


def _root(
    model: "mujoco.MjModel",
    data: "mujoco.MjData",
    root: int,
    bodies: list[int],
    dofs: NDArray[np.intp],
) -> tuple[Array, Array]:
    """Rigid mass `(6, 6)` about the root body, and the momentum `(6, n)` of unit rates of its
    degrees of freedom, in the world's axes."""
    origin = data.xpos[root]
    rigid = mass_of_bodies(model, data, bodies, origin, np.eye(3))
    momentum = np.zeros((6, dofs.size))
    for body in bodies:
        translation = np.zeros((3, model.nv))
        rotation = np.zeros((3, model.nv))
        mujoco.mj_jacBodyCom(model, data, translation, rotation, body)
        by_dofs = np.vstack([translation, rotation])[:, dofs]
        axes = data.ximat[body].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
        mass = block_diag(float(model.body_mass[body]) * np.eye(3), inertia)
        momentum += offset_matrix(data.xipos[body] - origin).T @ mass @ by_dofs
    return rigid, momentum


def tree_form(
    model: "mujoco.MjModel",
    modal: Modal,
    integrator: str,
    timestep: float,
    *,
    joints: Array,
    band: float | None = None,
) -> TendonValues:
    """Stiffness, damping and armature of every modal tendon of a model that is not timed.

    `joints` `(nv,)`: armature that the craft's own joints get; `band` [rad/s]: up to where the
    response is kept; where left out the last kept mode, and at most 0.2 rad per step.
    """
    h = float(timestep)
    scheme = SCHEMES[integrator]
    if integrator == "discrete":  # stable whatever is carried, and cannot be made exact
        alone = Tendons(modal.stiffness, modal.damping, np.zeros(len(modal.names)))
        modes = _modes(modal, alone, integrator, h)
        return TendonValues(alone.damping, alone.armature, scheme.phase, 0.0, modes)
    places = tuned_poses(model, modal)
    motions = [motion_for(model, h, integrator, place) for place in places]
    top = min(band or min(last_kept(model, motions[0]), UNASKED / h), FASTEST / h)
    room = _TendonBounds.of(appendages_alone(model, modal), modal, integrator, h, top)
    seen = [
        Seen.of(model, modal, place, motion, top, joints)
        for place, motion in zip(places, motions, strict=True)
    ]
    unknowns = _nearest(room, seen)
    tendons = room.tendons(unknowns)
    return TendonValues(
        tendons.damping,
        tendons.armature,
        scheme.phase,
        room.largest(unknowns),
        _modes(modal, tendons, integrator, h),
        tendons.stiffness,
    )


def tuned_poses(model: "mujoco.MjModel", modal: Modal) -> list[Array]:
    """The pose of rest and the keyframes, and poses between them so that no joint of the craft
    turns by more than 30 degrees; without keyframes each of its hinges in the tree, turned."""
    known = list(poses(model).values())
    if len(known) == 1:
        return [*known, *turned_poses(model, modal)]
    out = known[:1]
    motion = np.zeros(model.nv)
    for start, end in pairwise(known):
        mujoco.mj_differentiatePos(model, motion, 1.0, start, end)
        largest = np.max(np.abs(motion[outer_dofs(model, modal)]), initial=0.0)
        parts = min(max(int(np.ceil(largest / APART - ROUNDING)), 1), MOST_PARTS)
        for part in range(1, parts + 1):
            place = start.copy()
            mujoco.mj_integratePos(model, place, motion, part / parts)
            out.append(place)
    return out


def turned_poses(model: "mujoco.MjModel", modal: Modal) -> list[Array]:
    """The pose of rest with each of the craft's hinges in the tree turned."""
    out: list[Array] = []
    for dof in outer_dofs(model, modal):
        joint = int(model.dof_jntid[dof])
        if int(model.jnt_type[joint]) != HINGE:
            continue
        for angle in TURNED:
            place = np.array(model.qpos0)
            place[int(model.jnt_qposadr[joint])] += angle
            low, high = model.jnt_range[joint]
            if not model.jnt_limited[joint] or low <= place[model.jnt_qposadr[joint]] <= high:
                out.append(place)
    return out


@dataclass(frozen=True, eq=False)
class _TendonBounds:
    """What c, s and e may be, one after the other in a vector `(3 n,)`, and the barrier that keeps
    them there.

    Args:
        appendages: alone.
        stiffness, damping: `(n,)` of the tendons without timing.
        integrator: MuJoCo's name.
        timestep: [s].
        low, high: `(3 n,)` bounds.
    """

    appendages: Sequence[FreeAppendage]
    stiffness: Array
    damping: Array
    integrator: str
    timestep: float
    low: Array
    high: Array

    @classmethod
    def of(
        cls,
        appendages: Sequence[FreeAppendage],
        modal: Modal,
        integrator: str,
        timestep: float,
        band: float,
    ) -> "_TendonBounds":
        """Of the tendons of a model that is not timed."""
        n = len(modal.names)
        softer = float(np.clip(YIELDING * (band * timestep) ** 2, SOFTEST, STIFFEST))
        bound = np.repeat([softer, DAMPED], n)
        return cls(
            appendages,
            modal.stiffness,
            modal.damping,
            integrator,
            timestep,
            low=np.concatenate([np.full(n, -TOUCHING), -bound]),
            high=np.concatenate([np.full(n, HIGHEST), bound]),
        )

    @property
    def start(self) -> Array:
        """Unknowns in the middle of what is allowed."""
        n = self.stiffness.size
        return np.concatenate([np.full(n, self._scheme.limit + START), np.zeros(2 * n)])

    @property
    def _scheme(self) -> Scheme:
        return SCHEMES[self.integrator]

    def tendons(self, unknowns: Array) -> Tendons:
        """The numbers of the tendons."""
        found = self._unbounded(unknowns)
        return found._replace(armature=np.maximum(found.armature, 0.0))

    def _unbounded(self, unknowns: Array) -> Tendons:
        c, s, e = np.split(unknowns, 3)
        h = self.timestep
        damping = (1.0 + e) * self.damping
        armature = c * h**2 * self.stiffness + self._scheme.lag * h * damping
        return Tendons((1.0 + s) * self.stiffness, damping, armature)

    @property
    def units(self) -> Array:
        """`(3 n,)` slope of stiffness, damping and armature by s, e and c."""
        return np.concatenate([self.stiffness, self.damping, self.timestep**2 * self.stiffness])

    def by_unknowns(self, slopes: Array) -> Array:
        """Slopes by c, s and e of what has `slopes` by stiffness, damping and armature."""
        by_stiffness, by_damping, by_armature = np.split(slopes * self.units, 3, axis=1)
        late = self._scheme.lag * self.timestep * self.damping
        return np.hstack([by_armature, by_stiffness, by_damping + slopes[:, -late.size :] * late])

    def value(self, unknowns: Array) -> float:
        """The barrier; infinity outside."""
        if np.any(unknowns <= self.low) or np.any(unknowns >= self.high):
            return float("inf")
        value = -np.sum(np.log(unknowns - self.low)) - np.sum(np.log(self.high - unknowns))
        for spare in self._spare(unknowns):
            try:
                root = np.linalg.cholesky(spare)
            except np.linalg.LinAlgError:
                return float("inf")
            value -= 2.0 * np.sum(np.log(np.diag(root)))
        return float(value)

    def derivatives(self, unknowns: Array) -> tuple[Array, Array]:
        """Gradient `(3 n,)` and Hessian `(3 n, 3 n)` of the barrier."""
        below = 1.0 / (unknowns - self.low)
        above = 1.0 / (self.high - unknowns)
        gradient = above - below
        hessian = np.diag(above**2 + below**2)
        n = self.stiffness.size
        for alone, spare in zip(self.appendages, self._spare(unknowns), strict=True):
            inverse = np.linalg.inv(spare)
            x2 = self.timestep**2 * self.stiffness[alone.tendons]
            slopes = np.zeros((alone.tendons.size, 3 * n))  # of the diagonal, by c and s
            own = np.arange(alone.tendons.size)
            slopes[own, alone.tendons] = (1.0 - ROOM) * x2
            slopes[own, n + alone.tendons] = -self._scheme.limit * x2
            gradient -= slopes.T @ np.diag(inverse)
            hessian += slopes.T @ inverse**2 @ slopes
        return gradient, hessian

    def largest(self, unknowns: Array) -> float:
        """`h^2 lambda_max` of the appendages alone; stable below 4 (RK4: 8)."""
        k, d, a = self.tendons(unknowns)
        return max(
            stability(self.integrator, alone.free[None], k[i], d[i], a[i], self.timestep)
            for alone in self.appendages
            for i in [alone.tendons]
        )

    def _spare(self, unknowns: Array) -> list[Array]:
        """`(1 - ROOM) (S + diag(c x^2)) - diag((1 + s) x^2/4)` of every appendage, of RK4 `/8`."""
        c, s, _ = np.split(unknowns, 3)
        held = (1.0 - ROOM) * c - self._scheme.limit * (1.0 + s)
        spare = held * self.timestep**2 * self.stiffness
        return [
            (1.0 - ROOM) * alone.free + np.diag(spare[alone.tendons]) for alone in self.appendages
        ]


def _nearest(room: _TendonBounds, seen: Sequence[Seen]) -> Array:
    """The unknowns with which the responses come nearest to the exact ones."""
    unknowns = room.start
    compared = [pose.compared(NEARNESS[0]) for pose in seen]
    nearness = iter(NEARNESS[1:])
    for weight in WEIGHTS:
        for _ in range(NEWTON_STEPS):
            step, decrease = _newton_step(room, compared, weight, unknowns)
            length = _step_length(room, compared, weight, unknowns, step, decrease)
            unknowns = unknowns + length * step
            if length == 0.0 or decrease < SETTLED * weight:
                break
        width = next(nearness, NEARNESS[-1])
        nearer = [pose.compared(width) for pose in seen]
        if max(response.worst(room.tendons(unknowns)) for response in nearer) < ALIKE:
            compared = nearer
    return unknowns


def _newton_step(
    room: _TendonBounds, compared: Sequence[ResponseResidual], weight: float, unknowns: Array
) -> tuple[Array, float]:
    """A step of Gauss and Newton, and the decrease of the objective that it promises."""
    tendons = room.tendons(unknowns)
    gradient, hessian = (weight * part for part in room.derivatives(unknowns))
    uphill, squares = np.zeros(unknowns.size), np.zeros_like(hessian)
    for response in compared:
        missed, slopes = response.slopes(tendons)
        uphill += slopes.T @ missed
        squares += slopes.T @ slopes
    gradient += room.by_unknowns(uphill[None])[0]
    hessian += room.by_unknowns(room.by_unknowns(squares).T)
    step = np.asarray(-np.linalg.solve(hessian, gradient), dtype=np.float64)
    return step, float(-gradient @ step)


def _step_length(
    room: _TendonBounds,
    compared: Sequence[ResponseResidual],
    weight: float,
    unknowns: Array,
    step: Array,
    decrease: float,
) -> float:
    """The first of 1, 1/2, 1/4, ... that lowers the objective enough; 0: none does."""

    def objective(at: Array) -> float:
        barrier = room.value(at)
        if not np.isfinite(barrier):
            return barrier
        tendons = room.tendons(at)
        squares = sum(float(np.sum(c.difference(tendons) ** 2)) for c in compared)
        return squares / 2.0 + weight * barrier

    now = objective(unknowns)
    length = 1.0
    while length > SHORTEST:
        if objective(unknowns + length * step) < now - 1e-4 * length * decrease:
            return length
        length /= 2.0
    return 0.0


def _modes(
    modal: Modal, tendons: Tendons, integrator: str, timestep: float
) -> tuple[ModeTime, ...]:
    zeta = modal.damping / (2.0 * modal.frequency)
    poles = continuous_poles(modal.frequency, zeta)[0]
    slowed = modal.frequency * timestep > SCHEMES[integrator].phase
    return tuple(
        ModeTime(
            name=modal.names[i],
            frequency=float(modal.frequency[i]),
            ratio=float(zeta[i]),
            mass=1.0 + float(tendons.armature[i]),
            damping=float(tendons.damping[i]),
            pole=complex(poles[i]),
            slowed=bool(slowed[i]),
            clamped=False,
        )
        for i in range(len(modal.names))
    )
