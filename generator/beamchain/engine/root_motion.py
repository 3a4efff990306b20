"""Motion and loads of roots of appendages along a run, as MuJoCo has them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.ports.motions import Array

#: what makes up a state of a run: all that the next step and the accelerations follow from
STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
TIME = int(mujoco.mjtState.mjSTATE_TIME)


class Root(NamedTuple):
    """Where an appendage is looked at in a compiled model.

    Args:
        body: its first link, whose frame is that of the root.
        carried: per body that one of its ports carries, that body and the port's site.
    """

    body: int
    carried: tuple[tuple[int, int], ...]


class RootMotion(NamedTuple):
    """Motion and loads of a root at t instants, all in its axes.

    Args:
        acceleration: `(t, 6)` of the root, linear [m/s^2] and angular [rad/s^2].
        gravity: `(t, 3)` [m/s^2].
        spin: `(t, 3)` rate of the root [rad/s].
        load: `(t, 6)` force [N] and moment [N m] that the appendage puts on what carries it.
        carried: `(t, c, 6)` those that bodies put on its ports.
    """

    acceleration: Array
    gravity: Array
    spin: Array
    load: Array
    carried: Array


@dataclass(frozen=True, eq=False)
class Run:
    """Instants of a run of a model.

    Args:
        time: `(t,)` [s].
        states: `(t, size)` complete states; None where there are arrays only.
        arrays: by name of a field of MjData, `(t, ...)` each; with "qacc" accelerations as given.
    """

    time: Array
    states: Array | None
    arrays: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Motion:
    """Coordinates of a run `(t, nq)`, `(t, nv)`, `(t, nv)`, and the motion of roots."""

    qpos: Array
    qvel: Array
    qacc: Array
    roots: tuple[RootMotion, ...]


def motion_of(model: "mujoco.MjModel", run: Run, roots: Sequence[Root]) -> Motion:
    """Motion and loads of roots along a run.

    Accelerations are those of MuJoCo's equations of motion in each state, where they are not given.
    """
    count = run.time.size
    data = mujoco.MjData(model)
    qpos = np.empty((count, model.nq))
    qvel = np.empty((count, model.nv))
    qacc = np.empty((count, model.nv))
    out = [_empty(count, len(root.carried)) for root in roots]
    for t in range(count):
        if run.states is not None:
            mujoco.mj_setState(model, data, run.states[t], STATE)
        for name, values in run.arrays.items():
            getattr(data, name)[:] = values[t]
        mujoco.mj_setState(model, data, run.time[t : t + 1], TIME)
        if "qacc" in run.arrays:
            given = data.qacc.copy()
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            data.qacc[:] = given
        else:
            mujoco.mj_forward(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        qpos[t], qvel[t], qacc[t] = data.qpos, data.qvel, data.qacc
        for root, motion in zip(roots, out, strict=True):
            _read(model, data, root, motion, t)
    return Motion(qpos, qvel, qacc, tuple(out))


def _empty(count: int, carried: int) -> RootMotion:
    return RootMotion(
        np.empty((count, 6)),
        np.empty((count, 3)),
        np.empty((count, 3)),
        np.empty((count, 6)),
        np.empty((count, carried, 6)),
    )


def _read(
    model: "mujoco.MjModel", data: "mujoco.MjData", root: Root, motion: RootMotion, t: int
) -> None:
    """One instant of a root."""
    kind = mujoco.mjtObj.mjOBJ_XBODY
    axes = data.xmat[root.body].reshape(3, 3)
    spatial = np.zeros(6)
    gravity_on = not int(model.opt.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    gravity = axes.T @ model.opt.gravity if gravity_on else np.zeros(3)
    mujoco.mj_objectAcceleration(model, data, kind, root.body, spatial, 1)
    # MuJoCo's acceleration is against free fall
    motion.acceleration[t] = np.concatenate([spatial[3:] + gravity, spatial[:3]])
    motion.gravity[t] = gravity
    mujoco.mj_objectVelocity(model, data, kind, root.body, spatial, 1)
    motion.spin[t] = spatial[:3]
    motion.load[t] = _load_on_parent(model, data, root.body, data.xpos[root.body], axes)
    for i, (body, site) in enumerate(root.carried):
        motion.carried[t, i] = _load_on_parent(model, data, body, data.site_xpos[site], axes)


def _load_on_parent(
    model: "mujoco.MjModel", data: "mujoco.MjData", body: int, point: Array, axes: Array
) -> Array:
    """`(6,)` force and moment about a point that a body, with all that it carries, puts on what
    carries it."""
    # cfrc_int: moment and force of the parent on the body, about the tree's centre of mass
    moment, force = np.split(-data.cfrc_int[body], 2)
    arm = data.subtree_com[int(model.body_rootid[body])] - point
    return np.concatenate([axes.T @ force, axes.T @ (moment + np.cross(arm, force))])
