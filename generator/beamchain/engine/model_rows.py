"""MuJoCo's own bodies, springs and dampers, read one by one: what A and B hold,
where those lose digits.

The mass matrix is never formed; its square root, the bodies' Jacobians,
keeps the precision of all modes.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.ports.motions import Array
from beamchain.ports.rows import Rows


class Readings(NamedTuple):
    """What a model is made of, about its rest pose.

    `rows` `(r, nv)`: velocities of bodies, joints and tendons times the root of their inertia,
    `rows^T rows = M`; `springs` `(s, nv)`: `springs^T springs = K`; `damping` `(nv, nv)`.
    """

    rows: Array
    springs: Array
    damping: Array

    def held_at(self, root: Sequence[int], inner: Sequence[int], motions: Array) -> Rows:
        """The motion rows of the freedoms `inner`, held at the freedoms `root`;
        `motions` `(r, m)`: each of `root` per motion of the port."""
        own = list(inner)
        return Rows(
            self.rows[:, list(root)] @ motions,
            self.rows[:, own],
            springs=self.springs[:, own],
            damping=self.damping[np.ix_(own, own)],
        )


def gravity_of(model: "mujoco.MjModel") -> Array:
    """`(3,)` the gravity that acts in a model [m/s^2]; zeros where its flag switches it off."""
    off = int(model.opt.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    return np.zeros(3) if off else np.array(model.opt.gravity)


def readings(model: "mujoco.MjModel") -> Readings:
    """Read bodies, springs and dampers off a compiled model without ball and free joints."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    nv = model.nv
    rows: list[Array] = []
    moves = np.zeros((3, nv))
    turns = np.zeros((3, nv))
    for i in range(1, model.nbody):
        mujoco.mj_jacBodyCom(model, data, moves, turns, i)
        inertia = np.sqrt(np.asarray(model.body_inertia[i]))[:, None] * (
            data.ximat[i].reshape(3, 3).T @ turns
        )
        rows += [np.sqrt(float(model.body_mass[i])) * moves, inertia]
    tendons = along_all(model)
    armatures = [*model.dof_armature, *model.tendon_armature]
    rows += [
        np.sqrt(float(armature)) * along[None]
        for armature, along in zip(armatures, [*np.eye(nv), *tendons], strict=True)
        if armature > 0.0
    ]
    own = zip(model.jnt_stiffness, np.eye(nv)[model.jnt_dofadr], strict=True)
    springs = [
        np.sqrt(k) * row
        for k, row in (*own, *zip(model.tendon_stiffness, tendons, strict=True))
        if k > 0.0
    ]
    dampers = zip(model.tendon_damping, tendons, strict=True)
    damping = np.diag(model.dof_damping) + sum(c * np.outer(t, t) for c, t in dampers)
    return Readings(np.vstack(rows), np.array(springs).reshape(-1, nv), damping)


def sprung(model: "mujoco.MjModel") -> list[int]:
    """Joints that a spring holds, their own or that of a fixed tendon over them."""
    held = set(np.flatnonzero(model.jnt_stiffness > 0.0).tolist())
    for i in np.flatnonzero(model.tendon_stiffness > 0.0).tolist():
        joint = int(mujoco.mjtWrap.mjWRAP_JOINT)
        held |= {
            int(model.wrap_objid[k]) for k in wraps(model, i) if int(model.wrap_type[k]) == joint
        }
    return sorted(held)


def wraps(model: "mujoco.MjModel", tendon: int) -> Sequence[int]:
    """The wrap objects of a tendon."""
    first = int(model.tendon_adr[tendon])
    return range(first, first + int(model.tendon_num[tendon]))


def along(model: "mujoco.MjModel", tendon: int) -> Array:
    """`(nv,)` coefficients of a fixed tendon."""
    out = np.zeros(model.nv)
    for k in wraps(model, tendon):
        if int(model.wrap_type[k]) == int(mujoco.mjtWrap.mjWRAP_JOINT):
            out[int(model.jnt_dofadr[int(model.wrap_objid[k])])] += float(model.wrap_prm[k])
    return out


def along_all(model: "mujoco.MjModel") -> Array:
    """`(ntendon, nv)` coefficients of all fixed tendons."""
    return np.array([along(model, i) for i in range(model.ntendon)]).reshape(
        model.ntendon, model.nv
    )
