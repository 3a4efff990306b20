"""Runs under given forces, and what is read of their states: a mass on a spring."""

import mujoco
import numpy as np

from beamchain.toolkit import readings, roll

RATE = 3.0  # rad/s
FORCE = 0.6  # N
ROUNDING = 1e-6  # Runge and Kutta's, at 600 steps a period
SPRING = """<mujoco><option gravity="0 0 0" timestep="0.0035" integrator="RK4"/><worldbody>
<body name="mass"><joint name="slide" type="slide" axis="1 0 0" stiffness="18"/>
<inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body></worldbody></mujoco>"""


def test_a_run_begins_where_it_is_told_to_and_what_it_passes_is_read():
    """`x = x0 cos(w t) + v0 sin(w t) / w + F (1 - cos(w t)) / k`, and its acceleration."""
    model = mujoco.MjModel.from_xml_string(SPRING)
    start = mujoco.MjData(model)
    start.qpos[:], start.qvel[:] = 0.4, -0.9
    run = roll(model, 900, lambda first, end: np.full((end - first, 1), FORCE), start=start)
    t = 0.0035 * np.arange(1, 901)
    wanted = 0.4 * np.cos(RATE * t) - 0.3 * np.sin(RATE * t)
    wanted += FORCE / 18.0 * (1.0 - np.cos(RATE * t))
    states = np.concatenate([piece for piece, _ in run])
    found = readings(model, states, lambda data: [data.time, *data.qpos, *data.qacc])
    np.testing.assert_allclose(found[:, 0], t)
    np.testing.assert_allclose(found[:, 1], wanted, atol=ROUNDING)
    # no force acts while it is read
    np.testing.assert_allclose(found[:, 2], -9.0 * wanted, atol=20.0 * ROUNDING)
