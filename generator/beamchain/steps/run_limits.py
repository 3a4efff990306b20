"""What a run puts an appendage through, against how far its chain may be driven."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from beamchain.engine.driven import PLANES, Driven
from beamchain.ports.motions import Array
from beamchain.steps.large_motion import LargeMotion


def driven(motion: Array, spacing: float, offset: Array) -> Driven:
    """Largest rates and accelerations of an appendage's root, from the motion of its hub.

    Args:
        motion: `(t, 6)` of the hub's centre: displacement [m], rotation vector [rad].
        spacing: of the moments [s].
        offset: `(3,)` from the hub's centre to the root [m].
    """
    attitude = Rotation.from_rotvec(motion[:, 3:])
    rate = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / spacing  # in the hub's axes
    turning = np.diff(rate, axis=0) / spacing
    moved = attitude[1:-1].inv().apply(np.diff(motion[:, :3], n=2, axis=0)) / spacing**2
    mean = (rate[:-1] + rate[1:]) / 2.0
    root = moved + np.cross(turning, offset) + np.cross(mean, np.cross(mean, offset))
    return Driven(
        float(np.max(np.hypot(rate[:, 1], rate[:, 2]))),
        {port: float(np.max(np.abs(root[:, along]))) for port, (_, along) in PLANES.items()},
        {port: float(np.max(np.abs(turning[:, about]))) for port, (about, _) in PLANES.items()},
    )


def turned(rate: float, acceleration: float, axis: int, offset: Sequence[float]) -> Driven:
    """What a turn of the hub about one of its axes puts an appendage's root through.

    Args:
        rate: largest [rad/s].
        acceleration: largest [rad/s^2].
        axis: 0, 1, 2.
        offset: `(3,)` from the hub's centre to the root [m].
    """
    about = acceleration * np.eye(3)[axis]
    across = np.cross(about, offset)
    return Driven(
        0.0 if axis == 0 else rate,
        {port: abs(float(across[along])) for port, (_, along) in PLANES.items()},
        {port: abs(float(about[turns])) for port, (turns, _) in PLANES.items()},
    )


def exceeded(limits: Mapping[str, LargeMotion], run: Driven) -> list[str]:
    """Sentences for what a run exceeded, over all planes; empty where the chain is within 1 % of a fine one."""
    out: list[str] = []
    for port, limit in limits.items():
        out += limit.exceeded(spin=run.spin, acceleration=run.acceleration[port], slew=run.slew[port])
    return out
