"""A second opinion beside A and B: MuJoCo's own mass matrix, spring forces and damper forces, read one by one.

A and B hold `M^-1 K`. Where the mass matrix is badly conditioned (a light link behind a soft joint, a taper of 1:100),
MuJoCo's solve with it costs digits that no care in reading A and B brings back. `M`, `K` and `D` by themselves have
them all: `mj_mulM` and the passive forces are sums of products.
"""

from typing import NamedTuple

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.port import Array, PortModel


class Matrices(NamedTuple):
    """Mass `(nv, nv)`, stiffness and damping of a model about its rest pose, no joint of which is a ball or free."""

    mass: Array
    stiffness: Array
    damping: Array


def matrices(model: "mujoco.MjModel") -> Matrices:
    """Read `M`, `K` and `D` off a compiled model, one unit displacement and one unit rate at a time."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    nv = model.nv
    mass, stiffness, damping = np.zeros((nv, nv)), np.zeros((nv, nv)), np.zeros((nv, nv))
    row, rest, eye = np.zeros(nv), data.qpos.copy(), np.eye(nv)
    for i in range(nv):
        mujoco.mj_mulM(model, data, row, eye[i])
        mass[i] = row
    for i in range(nv):
        data.qpos[:] = rest + eye[i]  # springs are linear: a whole radian will do
        data.qvel[:] = 0.0
        mujoco.mj_forward(model, data)
        stiffness[:, i] = -data.qfrc_spring
        data.qpos[:] = rest
        data.qvel[:] = eye[i]
        mujoco.mj_forward(model, data)
        damping[:, i] = -data.qfrc_damper
    return Matrices(mass, stiffness, damping)


def port_of(read: Matrices, root: list[int], inner: list[int], ballast: Array) -> PortModel:
    """The port model seen at the degrees of freedom `root`, with the sprung ones `inner`.

    Args:
        read: from `matrices`.
        root: one per motion of the port.
        inner: sprung hinges and slides.
        ballast: `(m, m)` mass matrix on the port that is not the appendage's.
    """
    rigid = read.mass[np.ix_(root, root)] - ballast
    if not inner:
        return PortModel(rigid, np.zeros(0), np.zeros((0, len(root))))
    scale = 1.0 / np.sqrt(np.diag(read.stiffness)[inner])
    # scaled by the springs and solved for 1 / w^2, so that the slowest mode keeps all digits
    squares, modes = np.linalg.eigh(read.mass[np.ix_(inner, inner)] * np.outer(scale, scale))
    squares, modes = squares[::-1], modes[:, ::-1]
    w = 1.0 / np.sqrt(squares)
    shapes = scale[:, None] * modes * w
    participation = (read.mass[np.ix_(root, inner)] @ shapes).T
    ratios = np.einsum("ik,ij,jk->k", shapes, read.damping[np.ix_(inner, inner)], shapes) / (2.0 * w)
    return PortModel(rigid, w, participation, np.where(np.abs(ratios) < 1e-14, 0.0, ratios))
