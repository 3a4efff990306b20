"""Undamped models left to themselves: what an integrator does to energy, phase and momentum."""

from dataclasses import dataclass

import mujoco
import numpy as np

import beamchain as bc
from appendages import seed_boom
from beamchain import Hub
from beamchain.spec import Root
from mechanics import INTEGRATORS, momentum

SHARE = 0.5  # of the stable step
SMALL = 1e-5  # rad: linear motion
WHEEL = 0.1  # rad/s: how fast the craft tumbles


@dataclass(frozen=True)
class Ringing:
    """A mode left ringing.

    Args:
        timestep: [s].
        worst, last: mean energy of 200 periods over that of the first ones, less one:
            the largest, and the last.
        phase: frequency seen over the true one, less one.
        predicted: the same from the step's matrix.
    """

    timestep: float
    worst: float
    last: float
    phase: float
    predicted: float


def boom() -> mujoco.MjModel:
    """The seed's boom on a hub."""
    hub = Hub(mass=500.0, inertia=(400.0, 400.0, 500.0), offset=(1.0, 0.0, 0.0))
    return mujoco.MjModel.from_xml_string(
        bc.fit(seed_boom(), modes={"xy": 2}, root=Root(hub=hub)).scene_mjcf()
    )


def ringing(integrator: str, steps: int) -> Ringing:
    """Ring the first mode alone for `steps` steps at half the stable step (of Euler, where
    there is no limit)."""
    model = boom()
    model.opt.integrator = INTEGRATORS[integrator]
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    linear = bc.linearise(model)
    frequencies = linear.frequencies()
    # without damping: |x| < 2 for semi-implicit steps, 2 sqrt(2) for RK4, where x = w h;
    # `discrete` has no limit
    h = SHARE * (2.0 * np.sqrt(2.0) if integrator == "RK4" else 2.0) / float(frequencies[-1])
    model.opt.timestep = h
    data = mujoco.MjData(model)
    w = float(frequencies[0])
    values, shapes = np.linalg.eig(linear.stiffness)
    mode = np.argmin(np.abs(values - w**2))
    shape = shapes[:, mode].real
    shape *= SMALL / np.max(np.abs(shape))
    data.qvel[:] = shape * w
    hinge = int(np.argmax(np.abs(shape[6:]))) + 6
    place = int(model.jnt_qposadr[model.dof_jntid[hinge]])
    window = round(200.0 * 2.0 * np.pi / w / h)
    trace = np.zeros(steps)
    energy = np.zeros(steps)
    for i in range(steps):
        mujoco.mj_step(model, data)
        trace[i], energy[i] = data.qpos[place], data.energy[0] + data.energy[1]
    smooth = np.convolve(energy, np.ones(window) / window, mode="valid")
    seen = _frequency(trace, h)
    wanted = turn(integrator, w * h) / (w * h) - 1.0
    drift = smooth / smooth[0] - 1.0
    return Ringing(h, float(np.max(np.abs(drift))), float(drift[-1]), seen / w - 1.0, float(wanted))


def turn(integrator: str, x: float) -> float:
    """Angle of the step's eigenvalue [rad] for an undamped mode with `x = w h`."""
    if integrator == "RK4":
        z = 1j * x
        return float(np.angle(1.0 + z + z**2 / 2.0 + z**3 / 6.0 + z**4 / 24.0))
    if integrator == "discrete":  # v+ = (v - x^2 q) / (1 + x^2), q+ = q + v+
        share = 1.0 / (1.0 + x**2)
        return float(
            np.max(np.angle(np.linalg.eigvals([[share, share], [-(x**2) * share, share]])))
        )
    return 2.0 * float(np.arcsin(x / 2.0))


def _frequency(trace: np.ndarray, h: float) -> float:
    """[rad/s] from the first to the last upward zero crossing that is not lost in rounding."""
    loud = np.abs(trace) > 1e-9 * np.max(np.abs(trace))
    end = int(np.flatnonzero(loud)[-1])
    trace = trace[: end + 1]
    up = np.flatnonzero((trace[:-1] < 0.0) & (trace[1:] >= 0.0))
    at = up + trace[up] / (trace[up] - trace[up + 1])
    return 2.0 * np.pi * (len(at) - 1) / ((at[-1] - at[0]) * h)


def tumbling(integrator: str, timestep: float, seconds: float = 20.0) -> tuple[float, float]:
    """Worst drift of linear and angular momentum of a free craft in space,
    relative to their sizes."""
    hub = Hub(mass=40.0, inertia=(4.0, 6.0, 9.0), offset=(0.3, 0.1, 0.0))
    beam = bc.Beam(
        segments=(
            bc.Segment(
                length=3.0,
                section=bc.Equivalent(
                    bending_stiffness_xy=6.0,
                    bending_stiffness_xz=9.0,
                    torsion_stiffness=8.0,
                    linear_mass=0.8,
                    polar_inertia=0.02,
                ),
            ),
        )
    )
    result = bc.fit(beam, modes={"xy": 2, "xz": 2, "torsion": 1}, root=Root(hub=hub))
    model = mujoco.MjModel.from_xml_string(result.scene_mjcf())
    model.opt.integrator, model.opt.timestep = INTEGRATORS[integrator], timestep
    data = mujoco.MjData(model)
    data.qvel[:6] = [0.02, -0.01, 0.03, WHEEL, 2.0 * WHEEL, -WHEEL]
    moments = []
    for _ in range(round(seconds / timestep) + 1):
        moments.append(momentum(model, data))
        mujoco.mj_step(model, data)
    p, angular = np.hsplit(np.array(moments), 2)
    return tuple(
        float(np.max(np.linalg.norm(v - v[0], axis=1)) / np.linalg.norm(v[0])) for v in (p, angular)
    )  # type: ignore[return-value]
