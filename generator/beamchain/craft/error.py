"""The craft's promise: the coupled spacecraft with exact appendages against what MuJoCo has, pose by pose.

The in-band error of `ports.compare.Reference` with the craft's base body for a hub: its motions in its own axes, all
appendages exact (every mode) against all appendages as the model has them, at the rest pose and at every keyframe.

Theory: docs/theory.md, section 6.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import linear_sum_assignment

from beamchain.craft.assembly import Carried, Matrices, Mode, accelerance, craft_damping, quiet
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import dense_mass
from beamchain.engine.mount import motion
from beamchain.errors import InputError
from beamchain.ports.compare import grid_of, relative
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array

STEP = 1e-4  # perturbation of positions and rates; springs and dampers are linear
RANK = 1e-9  # relative singular value below which a motion of the base is held


@dataclass(frozen=True)
class CraftError:
    """What the craft's promise came to.

    Args:
        error: the worst of all poses.
        band: upper end [rad/s].
        poses: error per pose: "rest", then keyframes by name or number.
        motions: which motions of the base body count (0 to 5: x, y, z, rotations).
        body: name of the base body.
    """

    error: float
    band: float
    poses: dict[str, float]
    motions: tuple[int, ...]
    body: str


def peaks_of_craft(craft: Matrices) -> Array:
    """Peaks `(k, 2)`, frequency [rad/s] and damping ratio, with the base free, and with its own joints held."""
    held = np.abs(craft.base).max(axis=0, initial=0.0) <= 0.0
    parts = [_modes(craft.mass, craft.damping, craft.stiffness)]
    if np.any(held):
        pick = np.ix_(held, held)
        parts.append(_modes(craft.mass[pick], craft.damping[pick], craft.stiffness[pick]))
    return np.vstack(parts)


def _modes(mass: Array, damping: Array, stiffness: Array) -> Array:
    values, shapes = eigh(stiffness, mass)
    moving = values > 1e-12 * max(float(np.max(values, initial=0.0)), 1e-300)
    w, shapes = np.sqrt(values[moving]), shapes[:, moving]
    ratios = np.einsum("ik,ij,jk->k", shapes, damping, shapes) / (2.0 * w)
    return np.column_stack([w, np.clip(ratios, 0.0, 1.0)])


def matrices(model: "mujoco.MjModel", qpos: Array, body: int) -> Matrices:
    """Mass, damping, stiffness at `qpos`, nothing moving, and the motion of `body`."""
    data = mujoco.MjData(model)
    nv = model.nv

    def push(position: Array, rate: Array) -> Array:
        data.qpos[:], data.qvel[:] = position, rate
        mujoco.mj_forward(model, data)
        return np.asarray(data.qfrc_passive + data.qfrc_actuator, dtype=np.float64)

    stiffness, damping, still = np.zeros((nv, nv)), np.zeros((nv, nv)), np.zeros(nv)
    for i, unit in enumerate(np.eye(nv)):
        ends: list[Array] = []
        for sign in (1.0, -1.0):
            moved = qpos.copy()
            mujoco.mj_integratePos(model, moved, unit, sign * STEP)
            ends.append(push(moved, still))
        stiffness[:, i] = (ends[1] - ends[0]) / (2.0 * STEP)
        damping[:, i] = (push(qpos, -STEP * unit) - push(qpos, STEP * unit)) / (2.0 * STEP)
    push(qpos, still)
    base = motion(model, data, body, data.xpos[body], data.xmat[body].reshape(3, 3))
    return Matrices(dense_mass(model, data), (damping + damping.T) / 2.0, (stiffness + stiffness.T) / 2.0, base)


def base_body(model: "mujoco.MjModel", body: int) -> int:
    """The body that carries everything: the farthest out from `body` towards the world that still moves."""
    top = int(model.body_weldid[body])
    while (parent := int(model.body_weldid[int(model.body_parentid[top])])) != 0:
        top = parent
    return top


def poses(model: "mujoco.MjModel") -> dict[str, Array]:
    """Positions by pose: the rest pose, then keyframes by name or number."""
    out = {"rest": np.array(model.qpos0)}
    for k in range(model.nkey):
        out[model.key(k).name or f"number {k}"] = np.array(model.key_qpos[k])
    return out


class Pose:
    """The bare, quiet craft at a pose, and the exact answer on it.

    Motions of the base body that are `wanted` but that it cannot make are left out; `band`: upper end [rad/s].
    """

    def __init__(
        self, craft: "mujoco.MjModel", qpos: Array, carried: Sequence[Carried], band: float, wanted: Sequence[int]
    ) -> None:
        body = base_body(craft, carried[0].mount.body)
        own = matrices(craft, qpos, body)
        self.own: Matrices = replace(own, damping=craft_damping(own.damping, own.stiffness, own.mass))
        self.extra: Array = self.own.damping - own.damping
        data = mujoco.MjData(craft)
        data.qpos[:] = qpos
        mujoco.mj_kinematics(craft, data)
        mujoco.mj_comPos(craft, data)
        self.jacobians: list[Array] = [port_motion(craft, data, item) for item in carried]
        self.carried: Sequence[Carried] = carried
        self.band: float = band
        rows = np.linalg.norm(self.own.base, axis=1)
        able = [i for i in range(6) if rows[i] > RANK * rows.max(initial=1e-300)]
        self.motions: tuple[int, ...] = tuple(i for i in wanted if i in able) or tuple(able)
        frozen = self.own.mass + sum(
            (j.T @ item.whole.rigid_mass @ j for j, item in zip(self.jacobians, carried, strict=True)),
            np.zeros_like(self.own.mass),
        )
        mine = np.abs(self.own.base).max(axis=0) > 0.0  # the base body's own joints: all others locked
        locked = frozen[np.ix_(mine, mine)]
        rigid = self.own.base[:, mine] @ np.linalg.solve(locked, self.own.base[:, mine].T)
        inverse = np.linalg.pinv(rigid, rcond=RANK, hermitian=True)
        s = np.sqrt(np.diag(inverse))[list(self.motions)]
        self.scale: Array = np.outer(s, s)
        self.frozen: float = float(np.linalg.norm(rigid[np.ix_(self.motions, self.motions)] * self.scale, 2))

    def response(self, models: Sequence[PortModel], omega: Array) -> NDArray[np.complex128]:
        """`(k, n, n)` dimensionless accelerance of the base body with these appendages."""
        dynamic = self.own.dynamic(omega, models, self.jacobians)
        return accelerance(dynamic, self.own.base[list(self.motions)]) * self.scale

    @cached_property
    def near(self) -> list[PortModel]:
        """The exact appendages with what lies far above the band gathered: their peaks are the same."""
        return [item.whole.condensed(25.0 * self.band) for item in self.carried]

    @cached_property
    def known(self) -> tuple[Array, Array, NDArray[np.complex128]]:
        """Peaks of the exact craft, a grid that resolves them, and the exact response there."""
        peaks = peaks_of_craft(self.own.coupled(self.near, self.jacobians))
        omega = grid_of([peaks], self.band)
        return peaks, omega, self.response([item.whole for item in self.carried], omega)

    def of_models(self, models: Sequence[PortModel]) -> float:
        """In-band error with `models` for appendages."""
        _, omega, exact = self.known
        return float(relative(self.response(models, omega), exact, self.frozen).max())

    def of_mujoco(self, model: "mujoco.MjModel", qpos: Array, body: int, old: Sequence[int]) -> float:
        """In-band error of the compiled `model` at `qpos`; `old`: the craft's own degrees of freedom in it."""
        ours = matrices(model, qpos, body).comparable(self.carried, old, self.extra)
        omega = grid_of([self.known[0], peaks_of_craft(ours)], self.band)
        achieved = accelerance(ours.dynamic(omega), ours.base[list(self.motions)]) * self.scale
        exact = self.response([item.whole for item in self.carried], omega)
        return float(relative(achieved, exact, self.frozen).max())


def modes_at(
    craft: "mujoco.MjModel", model: "mujoco.MjModel", carried: Sequence[Carried], band: float, key: str
) -> tuple[Mode, ...]:
    """Coupled modes up to `band` [rad/s] at a keyframe: exact, and MuJoCo's that is nearest in frequency."""
    craft, model = quiet(craft), quiet(model)
    known = poses(craft)
    if key not in known:
        raise InputError(f"keyframe {key!r} is not in the spacecraft; choose from {', '.join(known)}.")
    pose = Pose(craft, known[key], carried, band, range(6))
    whole = pose.own.coupled([item.whole for item in carried], pose.jacobians)
    exact = _modes(whole.mass, whole.damping, whole.stiffness)[:, 0]
    body = base_body(model, int(model.body(craft.body(base_body(craft, carried[0].mount.body)).name).id))
    found = matrices(model, poses(model)[key], body)
    ours = _modes(found.mass, found.damping, found.stiffness)[:, 0]
    exact = np.sort(exact[exact <= band])
    first, second = linear_sum_assignment(np.abs(np.log(exact[:, None] / ours[None, :])))
    pairs = dict(zip(first.tolist(), second.tolist(), strict=True))
    return tuple(Mode(float(w), float(ours[pairs[i]]) if i in pairs else None, True) for i, w in enumerate(exact))


def port_motion(craft: "mujoco.MjModel", data: "mujoco.MjData", item: Carried) -> Array:
    """`(6, nv)` motion of an appendage's root, in its axes, at a pose."""
    body, turn = item.mount.body, np.zeros(9)
    mujoco.mju_quat2Mat(turn, item.mount.quaternion / np.linalg.norm(item.mount.quaternion))
    frame = data.xmat[body].reshape(3, 3)
    return motion(craft, data, body, data.xpos[body] + frame @ item.mount.position, frame @ turn.reshape(3, 3))


def craft_poses(
    craft: "mujoco.MjModel", carried: Sequence[Carried], band: float, wanted: Sequence[int]
) -> dict[str, list[Pose]]:
    """Every pose of the craft with its exact answer, one per base body that carries appendages."""
    craft = quiet(craft)
    groups: dict[int, list[Carried]] = {}
    for item in carried:
        groups.setdefault(base_body(craft, item.mount.body), []).append(item)
    return {
        name: [Pose(craft, qpos, group, band, wanted) for group in groups.values()]
        for name, qpos in poses(craft).items()
    }


def craft_error(
    craft: "mujoco.MjModel", model: "mujoco.MjModel", carried: Sequence[Carried], found: Mapping[str, list[Pose]]
) -> CraftError:
    """The craft's promise as the compiled model keeps it, against what `craft_poses` found."""
    model = quiet(model)
    new = {dof for item in carried for dof in item.dofs}
    old = [i for i in range(model.nv) if i not in new]
    positions = poses(model)
    errors: dict[str, float] = {}
    names: list[str] = []
    for name, several in found.items():
        for pose in several:
            body = base_body(craft, pose.carried[0].mount.body)
            label = craft.body(body).name
            names.append(label or f"body {body}")
            there = int(model.body(label).id) if label else body
            errors[name] = max(errors.get(name, 0.0), pose.of_mujoco(model, positions[name], there, old))
    first = next(iter(found.values()))[0]
    return CraftError(max(errors.values()), first.band, errors, first.motions, names[0])
