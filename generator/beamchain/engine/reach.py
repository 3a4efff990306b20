"""How far joints move what is seen of a model, and which body is its spacecraft."""

import numpy as np

from beamchain.engine.drawn import drawn_points
from beamchain.engine.library import mujoco
from beamchain.ports.motions import Array

SMALL = 1e-6  # rad or m: of a motion taken as linear


def moved(model: "mujoco.MjModel", rest: Array, motion: Array) -> Array:
    """`(nq,)` positions a motion `(nv,)` away from others."""
    out = rest.copy()
    mujoco.mj_integratePos(model, out, motion, 1.0)
    return out


def reach(model: "mujoco.MjModel", rest: Array, motion: Array) -> float:
    """The largest displacement of what is drawn, a site or a body per unit of a motion [m]."""
    largest = float(np.abs(motion).max(initial=0.0))
    if largest == 0.0:
        return 0.0
    data = mujoco.MjData(model)
    small = SMALL / largest
    places: list[Array] = []
    for sign in (1.0, -1.0):
        data.qpos[:] = moved(model, rest, sign * small * motion)
        mujoco.mj_kinematics(model, data)
        places.append(np.vstack([data.xipos, data.site_xpos, drawn_points(model, data)]))
    return float(np.linalg.norm(places[0] - places[1], axis=1).max()) / (2.0 * small)


def spacecraft_body(model: "mujoco.MjModel") -> str:
    """The name of the first body that flies freely, or of the first there is."""
    free = np.flatnonzero(model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE))
    return str(model.body(int(model.jnt_bodyid[free[0]]) if free.size else 1).name)
