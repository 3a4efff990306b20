"""What a run puts an appendage's root through, against how far its chain may be driven."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from beamchain.engine.library import mujoco
from beamchain.ports.motions import Array
from beamchain.steps.large_motion import LargeMotion

PLANES = {"xy": (2, 1), "xz": (1, 2)}  # per bending plane: axis it turns about, axis it moves along


class Driven(NamedTuple):
    """Largest spin across x [rad/s]; per bending plane acceleration and slew of a root."""

    spin: float
    acceleration: dict[str, float]
    slew: dict[str, float]


def _driven(spin: float, acceleration: Array, slew: Array) -> Driven:
    """Of a root's acceleration `(3,)` and angular acceleration `(3,)`, in its axes."""
    return Driven(
        float(spin),
        {port: abs(float(acceleration[along])) for port, (_, along) in PLANES.items()},
        {port: abs(float(slew[about])) for port, (about, _) in PLANES.items()},
    )


def keyframes(model: "mujoco.MjModel", body: str) -> dict[str, Driven]:
    """What each keyframe that moves or pushes does to a body, by name or number."""
    out: dict[str, Driven] = {}
    data = mujoco.MjData(model)
    ident = model.body(body).id
    for k in range(model.nkey):
        if not np.any(model.key_qvel[k]) and not np.any(model.key_ctrl[k]):
            continue
        mujoco.mj_resetDataKeyframe(model, data, k)
        mujoco.mj_forward(model, data)
        mujoco.mj_rnePostConstraint(model, data)
        rate = np.zeros(6)
        change = np.zeros(6)
        kind = mujoco.mjtObj.mjOBJ_XBODY
        mujoco.mj_objectVelocity(model, data, kind, ident, rate, 1)
        mujoco.mj_objectAcceleration(model, data, kind, ident, change, 1)
        out[model.key(k).name or f"number {k}"] = _driven(
            np.hypot(rate[1], rate[2]), change[3:], change[:3]
        )
    return out


def driven(motion: Array, spacing: float, offset: Array) -> Driven:
    """Largest rates and accelerations of a root at `offset` `(3,)` [m] from the hub's centre.

    `motion` `(t, 6)`: of the hub's centre, displacement [m] and rotation vector [rad],
    every `spacing` [s].
    """
    attitude = Rotation.from_rotvec(motion[:, 3:])
    rate = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / spacing  # in the hub's axes
    turning = np.diff(rate, axis=0) / spacing
    moved = attitude[1:-1].inv().apply(np.diff(motion[:, :3], n=2, axis=0)) / spacing**2
    mean = (rate[:-1] + rate[1:]) / 2.0
    root = moved + np.cross(turning, offset) + np.cross(mean, np.cross(mean, offset))
    largest = (np.max(np.abs(values), axis=0) for values in (root, turning))
    return _driven(np.max(np.hypot(rate[:, 1], rate[:, 2])), *largest)


def run_of_turn(
    rate: float, acceleration: float, axis: Array, offset: "Sequence[float] | Array"
) -> Driven:
    """The same for a turn of the hub about a unit vector `(3,)`, in the root's axes as the offset,
    by its rate and acceleration."""
    about = acceleration * axis
    return _driven(rate * float(np.hypot(axis[1], axis[2])), np.cross(about, offset), about)


def limit_sentences(limits: Mapping[str, LargeMotion], run: Driven) -> list[str]:
    """Sentences for what a run exceeded, over all planes."""
    out: list[str] = []
    for port, limit in limits.items():
        out += limit.exceeded(
            spin=run.spin, acceleration=run.acceleration[port], slew=run.slew[port]
        )
    return out
