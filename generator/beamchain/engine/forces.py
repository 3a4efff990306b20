"""MuJoCo's own bodies, springs and dampers, read one by one: what A and B hold,
where those lose digits.

The mass matrix is never formed; its square root, the bodies' Jacobians,
keeps the precision of all modes.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.ports.coupled import CoupledPort
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array


class Readings(NamedTuple):
    """What a model is made of, about its rest pose.

    `rows` `(r, nv)`: velocities of bodies and tendons times the root of their inertia, `rows^T rows
    = M`; `springs` `(s, nv)`: `springs^T springs = K`; `damping` `(nv, nv)`.
    """

    rows: Array
    springs: Array
    damping: Array


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
    rows += [
        np.sqrt(float(a)) * t[None]
        for a, t in zip(model.tendon_armature, tendons, strict=True)
        if a > 0.0
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


def port_of(read: Readings, root: list[int], inner: list[int], ballast: Array) -> PortModel:
    """The port model at freedoms `root`, `inner` sprung; `ballast` `(m, m)` is taken off."""
    rigid = read.rows[:, root]
    if not inner:
        return PortModel(rigid.T @ rigid - ballast, np.zeros(0), np.zeros((0, len(root))))
    modes = _modes(read, inner)
    ratios = np.diag(modes.rates) / modes.frequencies / 2.0
    ratios = np.where(np.abs(ratios) < 1e-14, 0.0, ratios)
    return PortModel(rigid.T @ rigid - ballast, modes.frequencies, modes.momenta.T @ rigid, ratios)


def coupled_port(
    read: Readings, root: list[int], inner: list[int], motions: Array, rigid_mass: Array
) -> CoupledPort:
    """The port with its whole damping matrix.

    `motions` `(r, m)`: each freedom of `root` in the motions of the port; `rigid_mass` `(m, m)`
    without what carries the appendage.
    """
    modes = _modes(read, inner)
    rows = modes.momenta.T @ read.rows[:, root] @ motions
    return CoupledPort(rigid_mass, modes.frequencies, rows, modes.rates)


class _Modes(NamedTuple):
    """Modes of a model with its root held: `momenta` `(r, n)` weighted motion of unit mass,
    `rates` `(n, n)` the damping matrix in them [1/s]."""

    frequencies: Array
    momenta: Array
    rates: Array


def _modes(read: Readings, inner: list[int]) -> _Modes:
    springs = read.springs[:, inner]
    scale = np.linalg.inv(np.linalg.qr(springs[np.any(springs != 0.0, axis=1)], mode="r"))
    left, s, right = np.linalg.svd(read.rows[:, inner] @ scale, full_matrices=False)
    # mass-normalised: the strain energy of a unit of right is 1/2, its frequency 1 / s
    shapes = scale @ right.T / s
    rates = shapes.T @ read.damping[np.ix_(inner, inner)] @ shapes
    return _Modes(1.0 / s, left, rates)
