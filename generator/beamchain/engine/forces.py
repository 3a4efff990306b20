"""A second opinion beside A and B: MuJoCo's own bodies, spring forces and damper forces, read one by one.

A and B hold `M^-1 K`. Where the mass matrix is badly conditioned (a light link behind a soft joint, a taper of 1:100),
MuJoCo's solve with it costs digits that no care in reading A and B brings back. The Jacobians of the bodies, their
masses and inertias, and the passive forces have them all. The mass matrix itself is never formed: its square root is
what the Jacobians are, so that the slowest and the fastest mode keep nearly the relative precision of the rows.
"""

from typing import NamedTuple

import numpy as np

from beamchain.engine.library import mujoco, quiet
from beamchain.motion import Array
from beamchain.port import PortModel


class Readings(NamedTuple):
    """What a model is made of, about its rest pose.

    Args:
        rows: `(6 bodies, nv)` velocities of the bodies' mass centres and their rates about their principal axes, times
            the square root of mass and inertia: `rows^T rows = M`.
        stiffness, damping: `(nv, nv)`.
    """

    rows: Array
    stiffness: Array
    damping: Array


def readings(model: "mujoco.MjModel") -> Readings:
    """Read bodies, springs and dampers off a compiled model without ball and free joints."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    nv = model.nv
    rows: list[Array] = []
    moves, turns = np.zeros((3, nv)), np.zeros((3, nv))
    for i in range(1, model.nbody):
        mujoco.mj_jacBodyCom(model, data, moves, turns, i)
        inertia = np.sqrt(np.asarray(model.body_inertia[i]))[:, None] * (data.ximat[i].reshape(3, 3).T @ turns)
        rows += [np.sqrt(float(model.body_mass[i])) * moves, inertia]
    stiffness, damping = np.zeros((nv, nv)), np.zeros((nv, nv))
    rest, eye = data.qpos.copy(), np.eye(nv)
    with quiet():  # of a pose far from rest
        for i in range(nv):
            data.qpos[:] = rest + eye[i]  # springs are linear: a whole radian will do
            data.qvel[:] = 0.0
            mujoco.mj_forward(model, data)
            stiffness[:, i] = -data.qfrc_spring
            data.qpos[:] = rest
            data.qvel[:] = eye[i]
            mujoco.mj_forward(model, data)
            damping[:, i] = -data.qfrc_damper
    return Readings(np.vstack(rows), stiffness, damping)


def port_of(read: Readings, root: list[int], inner: list[int], ballast: Array) -> PortModel:
    """The port model seen at the degrees of freedom `root`, with the sprung ones `inner`.

    Args:
        read: from `readings`.
        root: one per motion of the port.
        inner: sprung hinges and slides.
        ballast: `(m, m)` mass matrix on the port that is not the appendage's.
    """
    rigid = read.rows[:, root]
    if not inner:
        return PortModel(rigid.T @ rigid - ballast, np.zeros(0), np.zeros((0, len(root))))
    scale = 1.0 / np.sqrt(np.diag(read.stiffness)[inner])
    left, s, right = np.linalg.svd(read.rows[:, inner] * scale, full_matrices=False)
    shapes = scale[:, None] * right.T / s
    ratios = np.einsum("ik,ij,jk->k", shapes, read.damping[np.ix_(inner, inner)], shapes) * s / 2.0
    ratios = np.where(np.abs(ratios) < 1e-14, 0.0, ratios)
    return PortModel(rigid.T @ rigid - ballast, 1.0 / s, left.T @ rigid, ratios)
