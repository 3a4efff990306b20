"""A spacecraft under a load that does not change: gravity where it is held, or a constant thrust.

A free spacecraft is pushed by the field of its own acceleration: its motion is expressed in axes
that accelerate with it, in which an accelerometer on it reads. Its joints stay where the pose has
them, and what holds them is taken as in balance; its appendages sag.
"""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from beamchain.engine.bench import composite
from beamchain.engine.library import mujoco
from beamchain.engine.linear import POSITION, Linear, slopes
from beamchain.engine.linearise import dense_mass
from beamchain.engine.model_rows import gravity_of
from beamchain.engine.operating_point import Pose, keyframe_names, still_copy
from beamchain.errors import EngineError, InputError
from beamchain.ports.motions import Array
from beamchain.warning_codes import Caution

ROUNDS = 30  # of the search for the sag
SETTLED = 1e-12  # rad: a change of the sag that is rounding
NOTHING = 1e-12  # m/s^2
BESIDE = 1e-3  # of the radius of gyration: a thrust nearer to the centre of mass is not told


@dataclass(frozen=True, eq=False)
class Loading:
    """What acts on a spacecraft at a pose.

    Args:
        gravity: `(3,)` of its `<option>` [m/s^2].
        ctrl, act: `(nu,)`, `(na,)` of its actuators.
        field: `(3,)` what is felt in its own axes: gravity less its acceleration [m/s^2].
        free: first of the six degrees of freedom of its base, where it is free.
        pushed: `(nv, nv)` stiffness of the bare spacecraft that constant forces of actuators add.
    """

    gravity: Array
    ctrl: Array
    act: Array
    field: Array
    free: int | None
    pushed: Array

    @property
    def acceleration(self) -> Array:
        """`(3,)` of a free base [m/s^2]."""
        return self.gravity - self.field

    def in_own_axes(self, stiffness: Array) -> Array:
        """A stiffness that a load adds, told in axes that a free base takes along, in which its own
        motions change no force."""
        if self.free is None:
            return (stiffness + stiffness.T) / 2.0
        out = stiffness.copy()
        out[:, self.free : self.free + 6] = 0.0
        return out

    @property
    def words(self) -> str:
        """The load, for a sentence."""
        size = float(np.linalg.norm(self.field))
        if self.free is not None:
            return f"under a thrust that accelerates it by {size:.4g} m/s^2"
        parts = [f"{size:.4g} m/s^2 of gravity"] if size > NOTHING else []
        if np.any(self.ctrl != 0.0):
            parts.append("the ctrl of its keyframe")
        return f"under {' and '.join(parts)}"


def loading_at(
    craft: "mujoco.MjModel", still: "mujoco.MjModel", key: int | None, body: int, mass: float
) -> Loading | None:
    """What acts on the bare spacecraft at a keyframe, or at rest; None for nothing.

    Args:
        craft: with its gravity; `still`: a still copy.
        key: number of the keyframe; None: at rest, where actuators do nothing.
        body: the base.
        mass: of all that moves with it [kg].
    """
    gravity = gravity_of(craft)
    ctrl = np.zeros(craft.nu) if key is None else np.array(craft.key_ctrl[key])
    act = np.zeros(craft.na) if key is None else np.array(craft.key_act[key])
    qpos = np.array(craft.qpos0 if key is None else craft.key_qpos[key])
    joint = int(craft.body_jntadr[body])
    is_free = joint >= 0 and int(craft.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_FREE)
    free = int(craft.jnt_dofadr[joint]) if is_free else None
    data = mujoco.MjData(still)
    push = partial(_push, still, data, ctrl, act)
    pushes = bool(np.any(ctrl != 0.0) or np.any(act != 0.0))
    pushed = np.zeros((still.nv, still.nv))
    field = gravity
    if free is not None:
        thrust = push(qpos)
        field = -thrust[free : free + 3] / mass
    if pushes:

        def moved(i: int, by: float) -> Array:
            at = qpos.copy()
            mujoco.mj_integratePos(still, at, np.eye(still.nv)[i], by)
            return push(at)

        pushed = -slopes(moved, still.nv, POSITION)
    if np.linalg.norm(field) <= NOTHING and np.max(np.abs(pushed), initial=0.0) <= NOTHING:
        return None
    return Loading(gravity, ctrl, act, field, free, pushed)


def _push(
    still: "mujoco.MjModel", data: "mujoco.MjData", ctrl: Array, act: Array, qpos: Array
) -> Array:
    """`(nv,)` what actuators push with at positions `(nq,)` beyond what they do without ctrl and
    act."""
    forces: list[Array] = []
    for part in (1.0, 0.0):
        data.qpos[:], data.ctrl[:], data.act[:] = qpos, part * ctrl, part * act
        mujoco.mj_fwdPosition(still, data)
        mujoco.mj_fwdVelocity(still, data)
        mujoco.mj_fwdActuation(still, data)
        forces.append(np.array(data.qfrc_actuator))
    return forces[0] - forces[1]


def offset_cautions(
    model: "mujoco.MjModel", key: int | None, body: int, qpos: Array, name: str
) -> list[str]:
    """That the thrust at a keyframe passes beside the centre of mass, by more than a thousandth of
    the radius of gyration.

    Args:
        model: the spacecraft with its appendages, unbent.
        key: number of the keyframe; None: no thrust.
        body: the base.
        qpos: `(nq,)` the pose.
        name: of the pose.
    """
    joint = int(model.body_jntadr[body])
    if key is None or joint < 0 or int(model.jnt_type[joint]) != int(mujoco.mjtJoint.mjJNT_FREE):
        return []
    still = still_copy(model)
    data = mujoco.MjData(still)
    free = int(model.jnt_dofadr[joint])
    wrench = _push(still, data, model.key_ctrl[key], model.key_act[key], qpos)[free : free + 6]
    thrust = wrench[:3]
    size = float(np.linalg.norm(thrust))
    mass = float(model.body_subtreemass[body])
    if size <= NOTHING * mass:
        return []
    mujoco.mj_comPos(still, data)
    # a free joint's torque is in the axes of the body, about its origin
    arm = data.subtree_com[body] - data.xpos[body]
    moment = data.xmat[body].reshape(3, 3) @ wrench[3:] - np.cross(arm, thrust)
    beside = float(np.linalg.norm(np.cross(thrust, moment))) / size**2
    gyration = float(np.sqrt(np.trace(composite(model, body).inertia) / 2.0 / mass))
    if beside <= BESIDE * gyration:
        return []
    text = (
        f"the thrust at {name} passes {beside * 1e3:.3g} mm beside the centre of mass: "
        f"{beside * size:.3g} N m, which is taken as balanced; cancel it in a run."
    )
    return [Caution("thrust-offset", text)]


def key_number(model: "mujoco.MjModel", pose: Pose) -> int | None:
    """Number of the keyframe that `pose` of `plant` names; None for none."""
    if isinstance(pose, str):
        return keyframe_names(model).index(pose) if pose in keyframe_names(model) else None
    return int(pose) if isinstance(pose, int | np.integer) and not isinstance(pose, bool) else None


def load_at(model: "mujoco.MjModel", pose: Pose, body: int, mass: float) -> Loading:
    """What acts on a model at a pose that `pose` of `plant` names.

    `body`: its base; `mass`: of all that moves with it [kg].
    """
    found = loading_at(model, still_copy(model), key_number(model, pose), body, mass)
    if found is None:
        where = "in the pose of rest" if pose is None else f"at {pose!r:.60}"
        raise InputError(
            f"loaded: nothing acts on the spacecraft {where}: its gravity is zero or its base is "
            "free and falls with it, and no ctrl pushes it; hold its base, or name a keyframe with "
            'the thrust (<key name="burn" ctrl="22"/>).'
        )
    return found


def check_pushes(craft: "mujoco.MjModel", key: int, carried: Sequence[int], name: str) -> None:
    """Refuse a constant force of which the exact spacecraft does not know where it goes: one on a
    body that a port carries."""
    for i in np.flatnonzero(np.asarray(craft.key_ctrl[key])):
        kind = int(craft.actuator_trntype[i])
        known = mujoco.mjtTrn
        label = craft.actuator(int(i)).name or f"actuator {i}"
        if kind in (int(known.mjTRN_JOINT), int(known.mjTRN_JOINTINPARENT)):
            continue
        site = int(craft.actuator_trnid[i, 0])
        if kind == int(known.mjTRN_SITE) and int(craft.site_bodyid[site]) not in carried:
            continue
        raise InputError(
            f"keyframe {name!r}: {label!r} pushes with ctrl = {craft.key_ctrl[key, i]:g} on what "
            "an appendage carries, or on neither a joint nor a site; a load is proved for joints "
            "and for sites on the spacecraft itself: set that ctrl to 0."
        )


def loaded_linear(
    linear: Linear, model: "mujoco.MjModel", qpos: Array, dofs: Sequence[int], loading: Loading
) -> Linear:
    """A compiled, quiet model at a pose under a load, of which `linear` is the model without it.

    `dofs`: of the appendages, which sag.
    """
    model = _with_gravity(model, loading.gravity)
    data = mujoco.MjData(model)
    nv = model.nv
    acceleration = np.zeros(nv)
    if loading.free is not None:
        start = loading.free
        acceleration[start : start + 3] = loading.acceleration
    inertial = np.zeros(nv)

    def unbalanced(at: Array) -> Array:
        """What would have to push the model along for it to accelerate as it does, at rest in its
        own axes."""
        data.qpos[:] = at
        data.ctrl[:] = loading.ctrl
        data.act[:] = loading.act
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_fwdActuation(model, data)
        mujoco.mj_mulM(model, data, inertial, acceleration)
        return inertial + data.qfrc_bias - data.qfrc_passive - data.qfrc_actuator

    def moved(at: Array, i: int, by: float) -> Array:
        there = at.copy()
        mujoco.mj_integratePos(model, there, np.eye(nv)[i], by)
        return unbalanced(there)

    sagged = qpos.copy()
    some = list(dofs)
    if some:
        for _ in range(ROUNDS):
            bent = partial(moved, sagged.copy())
            stiffness = slopes(bent, nv, POSITION)[np.ix_(some, some)]
            change = np.zeros(nv)
            try:
                change[some] = -np.linalg.solve(stiffness, unbalanced(sagged)[some])
            except np.linalg.LinAlgError:  # nothing holds a pendulum that the load pulls aside
                raise _no_rest(loading) from None
            mujoco.mj_integratePos(model, sagged, change, 1.0)
            if np.max(np.abs(change)) < SETTLED:
                break
        else:
            raise _no_rest(loading)
    stiffness = slopes(lambda i, by: moved(sagged, i, by), nv, POSITION)
    unbalanced(sagged)
    return replace(linear, mass=dense_mass(model, data), stiffness=loading.in_own_axes(stiffness))


def _with_gravity(model: "mujoco.MjModel", gravity: Array) -> "mujoco.MjModel":
    out = copy.copy(model)
    out.opt.gravity[:] = gravity
    return out


def _no_rest(loading: Loading) -> EngineError:
    return EngineError(
        f"the appendages find no rest {loading.words}; give them more stiffness, or a smaller load."
    )
