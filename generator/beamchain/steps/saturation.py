"""Servos that chatter once they saturate: beyond its force range MuJoCo takes a servo's damping out
of what the implicit integrators solve for, so that it acts as it does under an explicit one."""

from collections.abc import Iterator

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS, dense_mass
from beamchain.engine.operating_point import poses
from beamchain.ports.motions import Array
from beamchain.steps.dominant_element import inertia_words
from beamchain.steps.elements import moments
from beamchain.steps.integrators import SCHEMES
from beamchain.warning_codes import Caution

EXPLICIT = 2.0  # kv h / I from which a damper that is taken at the start of the step swings up


def servos_that_chatter(model: "mujoco.MjModel") -> Iterator[str]:
    """A warning per servo on a joint that has a force range and more damping than the step lets an
    explicit integrator have.

    Where it saturates with h kv / I > 2, the limits reverse the joint's rate in every step; I is
    the inertia that the joint moves with all else loose, the smallest of rest and keyframes.
    Euler and RK4 are left out: with that damping they are unstable without saturation.
    """
    step = float(model.opt.timestep)
    if not SCHEMES[NUMBERS[int(model.opt.integrator)]].implicit_damping:
        return
    on_joint = np.asarray(model.actuator_trntype) == int(mujoco.mjtTrn.mjTRN_JOINT)
    damping = -np.asarray(model.actuator_biasprm)[:, 2]
    joints = np.where(on_joint, np.asarray(model.actuator_trnid)[:, 0], 0)
    clamped = np.asarray(model.actuator_forcelimited, dtype=bool)
    if model.njnt:
        clamped |= np.asarray(model.jnt_actfrclimited, dtype=bool)[joints]
    servos = np.flatnonzero(on_joint & clamped & (damping > 0.0))
    if not servos.size:
        return
    inertia = np.min([_inertias(model, qpos)[servos] for qpos in poses(model).values()], axis=0)
    for servo, moved in zip(servos.tolist(), inertia.tolist(), strict=True):
        gear = float(model.actuator_gear[servo, 0])
        kv = float(damping[servo]) * gear**2  # about the joint
        longest = EXPLICIT * moved / kv
        if step <= longest:
            continue
        held = int(model.actuator_trnid[servo, 0])
        joint = str(model.joint(held).name) or f"joint {held}"
        name = str(model.actuator(servo).name) or f"actuator {servo}"
        dof = int(model.jnt_dofadr[held])
        digit = 10.0 ** (np.floor(np.log10(longest)) - 1.0)
        yield Caution(
            "servo-saturates",
            f"servo {name!r} of joint {joint!r} has a force range and its kv acts on "
            f"{inertia_words(model, dof, moved)}: while it saturates, MuJoCo takes kv at the start "
            f"of the step, and above {np.floor(longest / digit) * digit:.2g} s it may go on "
            f'switching between its limits for ever. If it can saturate, write damping="{kv:g}" '
            "at the joint in place of kv, or take that step, even where a longer one keeps the "
            "tolerance.",
        )


def _inertias(model: "mujoco.MjModel", qpos: Array) -> Array:
    """`(nu,)` inertia about its joint that every actuator moves, all else loose."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    rows = moments(model, data)
    yields = np.einsum("ij,ji->i", rows, np.linalg.solve(dense_mass(model, data), rows.T))
    gears = np.asarray(model.actuator_gear)[:, 0]
    return gears**2 / np.maximum(yields, 1e-300)
