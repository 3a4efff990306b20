"""How fast a body turns and accelerates in the states that a model's keyframes hold."""

from typing import NamedTuple

import numpy as np

from beamchain.engine.library import mujoco

PLANES = {"xy": (2, 1), "xz": (1, 2)}  # per bending plane: axis it turns about, axis it moves along


class Driven(NamedTuple):
    """What a root is put through: largest values, in its own axes.

    Args:
        spin: rate across its x axis [rad/s].
        acceleration: per bending plane, across its x axis, free fall being none [m/s^2].
        slew: per bending plane, angular acceleration [rad/s^2].
    """

    spin: float
    acceleration: dict[str, float]
    slew: dict[str, float]


def keyframes(model: "mujoco.MjModel", body: str) -> dict[str, Driven]:
    """What each keyframe that moves or pushes does to a body, at its start, by the keyframe's name or number.

    Args:
        model: compiled.
        body: its name.
    """
    out: dict[str, Driven] = {}
    data, ident = mujoco.MjData(model), model.body(body).id
    for k in range(model.nkey):
        if not np.any(model.key_qvel[k]) and not np.any(model.key_ctrl[k]):
            continue
        mujoco.mj_resetDataKeyframe(model, data, k)
        mujoco.mj_forward(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        rate, change = np.zeros(6), np.zeros(6)
        kind = mujoco.mjtObj.mjOBJ_XBODY
        mujoco.mj_objectVelocity(model, data, kind, ident, rate, 1)
        mujoco.mj_objectAcceleration(model, data, kind, ident, change, 1)
        out[model.key(k).name or f"number {k}"] = Driven(
            float(np.hypot(rate[1], rate[2])),
            {port: abs(float(change[3 + along])) for port, (_, along) in PLANES.items()},
            {port: abs(float(change[about])) for port, (about, _) in PLANES.items()},
        )
    return out
