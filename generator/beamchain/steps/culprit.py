"""What makes a step unstable: the spring, servo or tendon that carries the pole which grows."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from beamchain.engine.forces import along
from beamchain.engine.library import mujoco
from beamchain.ports.motions import Array
from beamchain.steps.modal import modal_tendons
from beamchain.steps.step_map import motion_at

SAFE = 0.9  # of a largest stable step
HALVINGS = 6
LEAST = 1e-6  # of the step that was tried: no shorter one is looked for


class Culprit(NamedTuple):
    """The element that carries most of a growing pole.

    Args:
        name: of its joint or tendon.
        kind: "spring", "servo" or "appendage".
        words: the element in words.
        share: of the energy of the motion that grows.
        growth: factor per step.
        frequency: of that motion, in continuous time [rad/s].
    """

    name: str
    kind: str
    words: str
    share: float
    growth: float
    frequency: float


def culprit(model: "mujoco.MjModel", qpos: Array) -> Culprit:
    """What carries the pole of the model's step at a pose that grows most."""
    motion = motion_at(model, qpos)
    n, h = motion.squares.size, motion.timestep
    values, vectors = np.linalg.eig(motion.difference)
    k = int(np.argmax(np.abs(1.0 + values)))
    shape = motion.shapes @ vectors[:n, k]
    rate = motion.shapes @ vectors[n:, k] / h
    found = [
        (
            stiffness * np.abs(row @ shape) ** 2 + h * damping * np.abs(row @ rate) ** 2,
            name,
            kind,
            words,
        )
        for row, stiffness, damping, name, kind, words in _elements(model, qpos)
    ]
    total = max(sum(energy for energy, *_ in found), 1e-300)
    energy, name, kind, words = max(
        found, default=(0.0, "of the spacecraft", "spring", "the spacecraft")
    )
    moved = vectors[:n, k]
    frequency = np.sqrt(
        np.abs(motion.squares) @ np.abs(moved) ** 2 / max(float(np.sum(np.abs(moved) ** 2)), 1e-300)
    )
    return Culprit(
        name, kind, words, float(energy / total), float(np.abs(1.0 + values[k])), float(frequency)
    )


def stable_step(grows: Callable[[float], bool], step: float) -> float:
    """A step below one that is unstable at which nothing grows,
    close to the largest and rounded down [s]; 0 without one."""
    low = step / 2.0
    while low > LEAST * step and grows(low):
        low /= 2.0
    if low <= LEAST * step:
        return 0.0
    top = 2.0 * low
    for _ in range(HALVINGS):
        middle = (low + top) / 2.0
        low, top = (low, middle) if grows(middle) else (middle, top)
    digit = 10.0 ** (np.floor(np.log10(SAFE * low)) - 1.0)
    return float(np.floor(SAFE * low / digit) * digit)


def _elements(
    model: "mujoco.MjModel", qpos: Array
) -> list[tuple[Array, float, float, str, str, str]]:
    """Row `(nv,)`, stiffness, damping, name, kind and words of everything that holds or damps."""
    out: list[tuple[Array, float, float, str, str, str]] = []
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    for j in range(model.njnt):
        dof = int(model.jnt_dofadr[j])
        joint = str(model.joint(j).name) or f"joint {j}"
        stiffness = float(model.jnt_stiffness[j])
        damping = float(model.dof_damping[dof])
        if int(model.jnt_type[j]) > 1 and (stiffness > 0.0 or damping > 0.0):
            out.append(
                (
                    np.eye(model.nv)[dof],
                    stiffness,
                    0.0,
                    joint,
                    "spring",
                    f"the spring of joint {joint!r}",
                )
            )
    modal = set(modal_tendons(model).index.tolist())
    for i in range(model.ntendon):
        name = str(model.tendon(i).name)
        kind = "appendage" if i in modal else "spring"
        words = f"the modal tendon {name!r}" if i in modal else f"the spring of tendon {name!r}"
        row = along(model, i)
        out.append(
            (
                row,
                float(model.tendon_stiffness[i]),
                float(model.tendon_damping[i]),
                name,
                kind,
                words,
            )
        )
    moment = _moments(model, data)
    for i in range(model.nu):
        kp, kv = -float(model.actuator_biasprm[i, 1]), -float(model.actuator_biasprm[i, 2])
        if kp > 0.0 or kv > 0.0:
            servo = str(model.actuator(i).name) or f"actuator {i}"
            held = int(model.actuator_trnid[i, 0])
            on_joint = int(model.actuator_trntype[i]) == int(mujoco.mjtTrn.mjTRN_JOINT)
            joint = (str(model.joint(held).name) or servo) if on_joint else servo
            words = f"the servo {servo!r}" + (f" of joint {joint!r}" if on_joint else "")
            out.append((moment[i], max(kp, 0.0), max(kv, 0.0), joint, "servo", words))
    return out


def _moments(model: "mujoco.MjModel", data: "mujoco.MjData") -> Array:
    """`(nu, nv)` of actuators."""
    out = np.zeros((model.nu, model.nv))
    if model.nu:
        mujoco.mju_sparse2dense(
            out, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
        )
    return out
