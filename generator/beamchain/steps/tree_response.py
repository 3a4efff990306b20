"""The response of a craft at the step, for given stiffness, damping and armature of its modal
tendons, and its slopes by them.

With R the motions of the base and of the craft's own joints inside the tree and P(z) that of
`integrators.StepMap`, the sampled accelerance is `A = R P^-1 R^T`. A change of one tendon,
`dP = p b b^T` with b its row, moves it by `-p g g^T`, `g = R P^-1 b`.

Theory: docs/theory.md, section 9.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain.engine.library import hangs_on, mujoco
from beamchain.engine.linear import linear_at
from beamchain.engine.mount import motion
from beamchain.engine.operating_point import base_body, quiet_copy, rest_point
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.steps.integrators import SCHEMES, Complex, step_factors
from beamchain.steps.modal import HINGE_OR_SLIDE, Modal
from beamchain.steps.sampled import Responder, exact_response
from beamchain.steps.step_map import Motion

POINTS = 40  # frequencies that are compared, beside those of poles
LOWEST = 0.02  # of the band: where they begin
BEYOND = 1.1  # times the band: poles up to there are compared
SLOW = 1e-3  # of the band, below which a pole is rigid motion
HELD = 1e-9  # of the largest motion: a row below it is none


class Tendons(NamedTuple):
    """Stiffness, damping and armature `(n,)` of modal tendons."""

    stiffness: Array
    damping: Array
    armature: Array


@dataclass(frozen=True, eq=False)
class Seen:
    """A craft without timing at one pose, and the response that its step should have.

    Args:
        motion: of the craft without timing, at the step.
        rows: `(m, nv)` R by the coordinates of `motion`, scaled so that the craft's rigid
            accelerance has ones on its diagonal.
        tendons: `(n, nv)` b, likewise.
        plain: of the modal tendons, without timing.
        joints: `(nv, nv)` armature of the craft's own joints, by the coordinates of `motion`.
        exact: the sampled accelerance of exact motion.
        omega: `(k,)` frequencies that are compared [rad/s].
    """

    motion: Motion
    rows: Array
    tendons: Array
    plain: Tendons
    joints: Array
    exact: Responder
    omega: Array

    @classmethod
    def of(
        cls,
        model: "mujoco.MjModel",
        modal: Modal,
        qpos: Array,
        motion: Motion,
        band: float,
        joints: Array,
    ) -> "Seen":
        """`model` without timing; `motion`: of it, at the step and pose; `joints` `(nv,)`: armature
        that the craft's own joints get."""
        still = quiet_copy(model)
        point = rest_point(still, qpos)
        outer = outer_motions(still, modal, point.data())
        rows = outer @ motion.shapes
        tendons = modal.rows @ motion.shapes
        # tendons locked: what is left of the unit mass in motions that do not stretch them
        held = np.linalg.lstsq(tendons, tendons, rcond=None)[0]
        rigid = np.sum((rows - rows @ held) * rows, axis=1)
        if not np.max(rigid, initial=0.0) > HELD * np.max(np.sum(rows**2, axis=1), initial=0.0):
            raise InputError(
                "the appendages that carry bodies hang on a base that is fixed in the world, and "
                "no joint of the craft stands between them, so that nothing else moves by which "
                "their step could be judged; give the base a free joint, or leave them without "
                "timing."
            )
        moves = rigid > HELD * np.max(rigid, initial=1e-300)
        scale = 1.0 / np.sqrt(rigid[moves])
        rows = rows[moves] * scale[:, None]
        linear = linear_at(point)
        read = linear.outputs._replace(acceleration=outer[moves] * scale[:, None])
        h = motion.timestep
        poles = motion.continuous_poles() / h
        ringing = (poles.imag > 0.0) & (np.abs(poles) > SLOW * band)
        slow = np.abs(poles[ringing])
        return cls(
            motion,
            rows,
            tendons,
            Tendons(modal.stiffness, modal.damping, np.zeros_like(modal.stiffness)),
            motion.shapes.T @ (joints[:, None] * motion.shapes),
            exact_response(replace(linear, outputs=read), h).at,
            np.union1d(np.geomspace(LOWEST * band, band, POINTS), slow[slow < BEYOND * band]),
        )

    def compared(self, nearness: float) -> "ResponseResidual":
        """The response at `z = exp((j + nearness) w h)`."""
        step = np.expm1((1j + nearness) * self.omega * self.motion.timestep)
        exact = self.exact(step)
        # not less than the rigid response of one motion
        size = np.maximum(np.linalg.norm(exact, 2, axis=(1, 2)), 1.0)
        return ResponseResidual(self, step, exact, size)


@dataclass(frozen=True, eq=False)
class ResponseResidual:
    """A response at given `z - 1` `(k,)`, the exact one `(k, m, m)`, and what differences are
    relative to `(k,)`; `known`: the last one, since a search asks for it again."""

    seen: Seen
    step: Complex
    exact: NDArray[np.complex128]
    size: Array
    known: dict[bytes, NDArray[np.complex128]] = field(default_factory=dict)

    def difference(self, tendons: Tendons) -> Array:
        """`(k m (m + 1),)` real and imaginary parts of what the response misses, relative; pairs
        of equal entries once, by `sqrt(2)`."""
        return self._error(self._solved(tendons))

    def worst(self, tendons: Tendons) -> float:
        """The largest relative difference of the whole response."""
        missed = (self.seen.rows @ self._solved(tendons) - self.exact) / self.size[:, None, None]
        return float(np.max(np.linalg.norm(missed, 2, axis=(1, 2))))

    def slopes(self, tendons: Tendons) -> tuple[Array, Array]:
        """`difference`, and its slopes `(k m (m + 1), 3 n)` by stiffness, damping and armature."""
        solved = self._solved(tendons)
        g = np.swapaxes(self.seen.tendons @ solved, 1, 2)  # (k, m, n)
        first, second, weight = self._entries
        lever = g[:, first] * g[:, second] * (-weight[:, None] / self.size[:, None, None])
        motion = self.seen.motion
        spring, implicit, explicit = step_factors(motion.integrator, self.step, motion.timestep)
        damper = implicit if SCHEMES[motion.integrator].implicit_damping else explicit
        by_stiffness, by_damping = (f[:, None, None] * lever for f in (spring, damper))
        table = np.concatenate([by_stiffness, by_damping, lever], axis=2)
        slopes = np.asarray(table.reshape(-1, table.shape[2]), dtype=np.complex128)
        return self._error(solved), np.vstack([np.real(slopes), np.imag(slopes)])

    @cached_property
    def _entries(self) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
        """Rows, columns and weights of the entries of a symmetric response."""
        rows, columns = np.triu_indices(self.seen.rows.shape[0])
        return rows, columns, np.where(rows == columns, 1.0, np.sqrt(2.0))

    def _error(self, solved: NDArray[np.complex128]) -> Array:
        missed = (self.seen.rows @ solved - self.exact) / self.size[:, None, None]
        first, second, weight = self._entries
        entries = missed[:, first, second] * weight
        return np.concatenate([entries.real.ravel(), entries.imag.ravel()])

    def _solved(self, tendons: Tendons) -> NDArray[np.complex128]:
        """`P^-1 R^T` `(k, nv, m)`."""
        key = b"".join(values.tobytes() for values in tendons)
        if key not in self.known:
            self.known.clear()
            self.known[key] = self._solve(tendons)
        return self.known[key]

    def _solve(self, tendons: Tendons) -> NDArray[np.complex128]:
        seen = self.seen
        change = (now - plain for now, plain in zip(tendons, seen.plain, strict=True))
        step = seen.motion.with_tendons(seen.tendons, *change)
        dynamic = replace(step, mass=step.mass + seen.joints).dynamic(self.step)
        force = np.broadcast_to(seen.rows.T, (self.step.size, *seen.rows.T.shape))
        return np.asarray(np.linalg.solve(dynamic, force), dtype=np.complex128)


def outer_motions(model: "mujoco.MjModel", modal: Modal, data: "mujoco.MjData") -> Array:
    """`(m, nv)` motion of every body that carries all else, in its own axes, and of the craft's own
    hinges and slides between appendages."""
    inner = _inner_dofs(modal)
    bases = dict.fromkeys(base_body(model, link) for link in _links(model, inner))
    rows = [
        motion(model, data, base, data.xpos[base], data.xmat[base].reshape(3, 3)) for base in bases
    ]
    return np.vstack([*rows, np.eye(model.nv)[outer_dofs(model, modal)]])


def outer_dofs(model: "mujoco.MjModel", modal: Modal) -> list[int]:
    """Degrees of freedom of the craft's own hinges and slides that hang on appendages."""
    inner = _inner_dofs(modal)
    links = _links(model, inner)
    return [
        int(model.jnt_dofadr[j])
        for j in range(model.njnt)
        if int(model.jnt_type[j]) in HINGE_OR_SLIDE
        and int(model.jnt_dofadr[j]) not in inner
        and any(hangs_on(model, int(model.jnt_bodyid[j]), link) for link in links)
    ]


def _inner_dofs(modal: Modal) -> list[int]:
    """Degrees of freedom of the hinges of appendages."""
    return np.flatnonzero(np.any(modal.rows != 0.0, axis=0)).tolist()


def _links(model: "mujoco.MjModel", inner: Sequence[int]) -> list[int]:
    """The bodies that hinges of appendages move."""
    return list(dict.fromkeys(int(model.dof_bodyid[dof]) for dof in inner))
