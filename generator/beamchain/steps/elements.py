"""Springs, dampers and servos of a compiled model, one by one: what holds and damps its motion."""

from typing import NamedTuple

import numpy as np

from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS, euler_damps_implicitly
from beamchain.engine.model_rows import along
from beamchain.ports.motions import Array
from beamchain.steps.integrators import SCHEMES
from beamchain.steps.modal import modal_tendons


class Element(NamedTuple):
    """What holds or damps.

    Args:
        row: `(nv,)`.
        stiffness: of its spring.
        damping: of its damper.
        explicit: the share of it that the integrator takes at the start of the step.
        name: of its joint or tendon.
        kind: "spring", "servo" or "appendage".
        words: the element in words.
    """

    row: Array
    stiffness: float
    damping: float
    explicit: float
    name: str
    kind: str
    words: str


def elements(model: "mujoco.MjModel", qpos: Array) -> list[Element]:
    """Everything that holds or damps."""
    out: list[Element] = []
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    integrator = NUMBERS[int(model.opt.integrator)]
    at_start = 0.0 if SCHEMES[integrator].implicit_damping else 1.0
    at_end = integrator == "Euler" and euler_damps_implicitly(model)
    of_joints = 0.0 if at_end else at_start
    for j in range(model.njnt):
        dof = int(model.jnt_dofadr[j])
        joint = str(model.joint(j).name) or f"joint {j}"
        stiffness = float(model.jnt_stiffness[j])
        damping = float(model.dof_damping[dof])
        if int(model.jnt_type[j]) > 1 and (stiffness > 0.0 or damping > 0.0):
            row = np.eye(model.nv)[dof]
            words = f"the {'spring' if stiffness > 0.0 else 'damping'} of joint {joint!r}"
            out.append(Element(row, stiffness, damping, of_joints, joint, "spring", words))
    modal = set(modal_tendons(model).index.tolist())
    for i in range(model.ntendon):
        name = str(model.tendon(i).name)
        kind = "appendage" if i in modal else "spring"
        words = f"the modal tendon {name!r}" if i in modal else f"the spring of tendon {name!r}"
        stiffness = float(model.tendon_stiffness[i])
        damping = float(model.tendon_damping[i])
        row = along(model, i)
        out.append(Element(row, stiffness, damping, at_start, name, kind, words))
    moment = moments(model, data)
    for i in range(model.nu):
        kp, kv = -float(model.actuator_biasprm[i, 1]), -float(model.actuator_biasprm[i, 2])
        if kp > 0.0 or kv > 0.0:
            servo = str(model.actuator(i).name) or f"actuator {i}"
            held = int(model.actuator_trnid[i, 0])
            on_joint = int(model.actuator_trntype[i]) == int(mujoco.mjtTrn.mjTRN_JOINT)
            joint = (str(model.joint(held).name) or servo) if on_joint else servo
            words = f"the servo {servo!r}" + (f" of joint {joint!r}" if on_joint else "")
            kp, kv = max(kp, 0.0), max(kv, 0.0)
            out.append(Element(moment[i], kp, kv, at_start, joint, "servo", words))
    return out


def moments(model: "mujoco.MjModel", data: "mujoco.MjData") -> Array:
    """`(nu, nv)` of actuators."""
    out = np.zeros((model.nu, model.nv))
    if model.nu:
        mujoco.mju_sparse2dense(
            out, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
        )
    return out
