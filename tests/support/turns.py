"""How far what hangs on a turning spacecraft bends."""

import mujoco
import numpy as np


def bent(model, slew):
    """How far the last body of a branch turns out of its place on rigid appendages, at worst, in
    each frame of a turn [rad]."""
    leaves = sorted(set(range(1, model.nbody)) - set(model.body_parentid.tolist()))
    data = mujoco.MjData(model)
    out = []
    for pair in zip(slew.shown(1.0), slew.shown(0.0), strict=True):
        axes = []
        for data.qpos[:] in pair:
            mujoco.mj_kinematics(model, data)
            axes.append(data.xmat[leaves].reshape(-1, 3, 3).copy())
        cosine = (np.einsum("kij,kij->k", *axes) - 1.0) / 2.0
        out.append(np.arccos(np.clip(cosine, -1.0, 1.0)).max())
    return np.array(out)
