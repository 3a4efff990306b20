"""Coupled modes of a whole spacecraft as motions that a film can show: every body, the hub too,
over one oscillation."""

from typing import NamedTuple

import numpy as np

from beamchain.craft.linear_craft import linear_craft
from beamchain.engine.drawn import drawn_points
from beamchain.engine.library import mujoco
from beamchain.errors import InputError
from beamchain.ports.motions import Array, locked

SWING = 0.05  # of the size that MuJoCo gives the spacecraft: the largest displacement shown


class MovingMode(NamedTuple):
    """One mode, named after the cantilever mode or joint with most of its strain energy;
    `omega` [rad/s].

    `positions` `(k, nq)` over one oscillation, from rest; `body`: the spacecraft's.
    """

    name: str
    omega: float
    positions: Array
    rest: Array
    body: str


def moving_modes(
    model: "mujoco.MjModel", count: int, frames: int, exaggerate: float = 1.0
) -> list[MovingMode]:
    """The first `count` coupled modes of a model at rest, in `frames` positions each,
    `exaggerate` times as large."""
    craft = linear_craft(model, None, None, None, None)
    modes, rest = craft.modes, craft.point.qpos
    if count > modes.frequency.size:
        raise InputError(
            f"--modes = {count}: the spacecraft has {modes.frequency.size} coupled modes; give at "
            "most as many."
        )
    free = np.flatnonzero(model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE))
    body = model.body(int(model.jnt_bodyid[free[0]]) if free.size else 1).name
    swing = np.sin(2.0 * np.pi * np.arange(frames) / frames)
    out: list[MovingMode] = []
    for k in range(count):
        shape = modes.shapes[:, k]
        size = exaggerate * SWING * model.stat.extent / _reach(model, rest, shape)
        positions = np.array([_moved(model, rest, size * s * shape) for s in swing])
        out.append(
            MovingMode(
                craft.mode_names[k],
                float(modes.frequency[k]),
                locked(positions),
                locked(rest),
                body,
            )
        )
    return out


def _moved(model: "mujoco.MjModel", rest: Array, motion: Array) -> Array:
    out = rest.copy()
    mujoco.mj_integratePos(model, out, motion, 1.0)
    return out


def _reach(model: "mujoco.MjModel", rest: Array, shape: Array) -> float:
    """The largest displacement of what is drawn, or of a body's centre, per unit of a mode [m]."""
    data = mujoco.MjData(model)
    places: list[Array] = []
    small = 1e-6 / float(np.abs(shape).max())
    for sign in (1.0, -1.0):
        data.qpos[:] = _moved(model, rest, sign * small * shape)
        mujoco.mj_kinematics(model, data)
        places.append(np.vstack([data.xipos, data.site_xpos, drawn_points(model, data)]))
    return float(np.linalg.norm(places[0] - places[1], axis=1).max()) / (2.0 * small)
