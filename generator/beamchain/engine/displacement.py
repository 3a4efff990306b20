"""How far joints move what is seen of a model, and which body is its spacecraft."""

from collections.abc import Callable

import numpy as np

from beamchain.engine.geometry import drawn_points
from beamchain.engine.library import mujoco
from beamchain.ports.motions import Array

SMALL = 1e-6  # rad or m: of a motion taken as linear


def moved_positions(model: "mujoco.MjModel", rest: Array, motion: Array) -> Array:
    """`(nq,)` positions a motion `(nv,)` away from others."""
    out = rest.copy()
    mujoco.mj_integratePos(model, out, motion, 1.0)
    return out


def reach(model: "mujoco.MjModel", rest: Array, motion: Array) -> float:
    """The largest displacement of what is drawn, a site or a body per unit of a motion [m]."""
    return _largest(model, rest, motion, _places)


def turn(model: "mujoco.MjModel", rest: Array, motion: Array) -> float:
    """The largest rotation of a body per unit of a motion [rad]."""
    # of axes that turn by a small angle, |R - 1| = sqrt(2) times the angle
    return _largest(model, rest, motion, lambda _, data: data.xmat) / np.sqrt(2.0)


def _places(model: "mujoco.MjModel", data: "mujoco.MjData") -> Array:
    return np.vstack([data.xipos, data.site_xpos, drawn_points(model, data)])


def _largest(
    model: "mujoco.MjModel",
    rest: Array,
    motion: Array,
    rows: Callable[["mujoco.MjModel", "mujoco.MjData"], Array],
) -> float:
    """The largest change of a row per unit of a motion."""
    largest = float(np.abs(motion).max(initial=0.0))
    if largest == 0.0:
        return 0.0
    data = mujoco.MjData(model)
    small = SMALL / largest
    found: list[Array] = []
    for sign in (1.0, -1.0):
        data.qpos[:] = moved_positions(model, rest, sign * small * motion)
        mujoco.mj_kinematics(model, data)
        found.append(np.array(rows(model, data)))
    return float(np.linalg.norm(found[0] - found[1], axis=1).max()) / (2.0 * small)


def spacecraft_body(model: "mujoco.MjModel") -> int:
    """The first body that flies freely, or the first there is."""
    free = np.flatnonzero(model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE))
    return int(model.jnt_bodyid[free[0]]) if free.size else 1
