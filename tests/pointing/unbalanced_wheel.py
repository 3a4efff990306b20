"""A craft whose wheel carries masses off its axis, in plain MuJoCo: what a pointing budget is held
against. The budgets come from a model whose wheel is balanced.
"""

import mujoco
import numpy as np

import beamchain as bc
from beamchain import pointing

RATIO = 0.005  # damping ratio of the beam's modes, with the root held
MASS, OFF, APART = 2e-3, 0.05, 0.04  # of what unbalances [kg, m], and distance of a pair [m]
SPEEDS = (4.0, 40.0)
CRAFT = """<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="40" diaginertia="4 7 7.2"/><site name="mount" pos="0.4 0 0"/>
<body name="wheel" pos="-0.2 0.1 0.15" euler="0 75 10"><joint name="rw"/>
<inertial pos="0 0 0" mass="20" diaginertia="0.6 0.6 1.1"/></body></body></worldbody></mujoco>"""
SECTION = bc.Equivalent(bending_stiffness_xy=150.0, bending_stiffness_xz=154.0, linear_mass=2.0)
BEAM = bc.Spec(segment=(bc.Segment(length=2.0, section=SECTION),), damping=bc.Damping(ratio=RATIO))
#: places of the masses on the wheel: from its axis, and along it
PLACES = {
    "static": ((OFF, 0.0),),
    "dynamic": ((OFF, APART), (-OFF, -APART)),
}
#: the same as the budget is told it
STATED = {
    "static": {"static": MASS * OFF},
    "dynamic": {"dynamic": 2.0 * MASS * OFF * APART},
}


def budget_of(craft, kind):
    """The budget of the wheel's imbalance."""
    wheel = pointing.WheelDisturbance(joint="rw", speeds=SPEEDS, **STATED[kind])
    return pointing.budget(craft, pointing.Disturbances(wheel=(wheel,)))


def unbalanced(craft, kind):
    """The craft's file with masses on its wheel, as an independent model."""
    masses = "".join(
        f'<body pos="{x} 0 {z}"><inertial pos="0 0 0" mass="{MASS}" '
        'diaginertia="1e-9 1e-9 1e-9"/></body>'
        for x, z in PLACES[kind]
    )
    text = craft.to_mjcf()
    assert text.count('name="rw"') == 1
    end = text.index("</body>", text.index('name="rw"'))
    return mujoco.MjModel.from_xml_string(text[:end] + masses + text[end:])


def attitude(data, body):
    """Rotation vector of a body."""
    turn = np.zeros(3)
    mujoco.mju_quat2Vel(turn, data.xquat[body], 1.0)
    return turn


def simulated_amplitude(model, speed, axis, settling, step):
    """Amplitude of the bus's attitude at the wheel's speed, five times `settling` [s] after the
    wheel was set in motion, and the wheel's speed at the end."""
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.opt.timestep = step
    data = mujoco.MjData(model)
    data.joint("rw").qvel[:] = speed
    body = model.body("bus").id
    for _ in range(int(5.0 * settling / step)):
        mujoco.mj_step(model, data)
    count = int(20.0 * 2.0 * np.pi / speed / step)
    times, values = np.zeros(count), np.zeros(count)
    for k in range(count):
        mujoco.mj_step(model, data)
        times[k], values[k] = data.time, attitude(data, body)[axis]
    columns = [np.ones(count), times - times[0], np.cos(speed * times), np.sin(speed * times)]
    fitted = np.linalg.lstsq(np.column_stack(columns), values, rcond=None)[0]
    return float(np.hypot(*fitted[2:])), float(data.joint("rw").qvel[0])
