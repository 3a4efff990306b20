"""A tree with an overdamped drive and a wheel; its motion as the compiled file has it, differenced
here with numpy: accelerations that MuJoCo returns.
"""

import mujoco
import numpy as np

import beamchain as bc
from beamchain.fitting.options import Port

DIFFERENCE = 1e-6  # step of the differences, whose own error is some 1e-8
CRAFT = """<mujoco><option gravity="0 0 0" timestep="0.01"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0.02" mass="60" diaginertia="9 12 14"/>
<site name="boom_root" pos="0 0.4 0" xyaxes="0 1 0 -1 0 0"/>
<body name="wheel" pos="0.2 0.1 0.2" euler="0 40 10"><joint name="rw" axis="0 0 1"/>
<inertial pos="0 0 0" mass="4" diaginertia="0.02 0.02 0.03"/></body>
<body name="yoke" pos="0 2.4 0" xyaxes="0 1 0 -1 0 0"><joint name="drive" axis="1 0 0"
stiffness="150" damping="80"/><inertial pos="0.05 0 0" mass="2" diaginertia="0.1 0.1 0.1"/>
<site name="panel_root" pos="0.1 0 0"/></body></body></worldbody></mujoco>"""


def beam(length, xy, xz, mass, **more):
    section = bc.Equivalent(bending_stiffness_xy=xy, bending_stiffness_xz=xz, linear_mass=mass)
    return bc.Spec(
        segment=(bc.Segment(length=length, section=section),),
        damping=bc.Damping(ratio=0.02),
        modes=bc.Modes(xy=1, xz=1),
        **more,
    )


def made(kind, folder):
    """The craft "in memory", or its file in a folder, "from a file"."""
    carrying = (Port(name="end", x=2.0, carries=("yoke",)),)
    made = bc.embed(
        CRAFT,
        {
            "boom_root": beam(2.0, 900.0, 1100.0, 1.0, port=carrying),
            "panel_root": beam(1.5, 40.0, 60.0, 1.2),
        },
    )
    if kind == "in memory":
        return made
    path = folder / "tree.xml"
    made.write(path)
    return path


class Truth:
    """The compiled file at a speed of its wheel, without timing: `qacc = -K q - D q' + G u`."""

    def __init__(self, craft, rate):
        text = craft.read_text() if hasattr(craft, "read_text") else craft.to_mjcf()
        model = mujoco.MjModel.from_xml_string(text)
        bc.retime(model, 0)
        model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
        self.model, self.data = model, mujoco.MjData(model)
        self.start = self.data.qpos.copy()
        self.speed = np.zeros(model.nv)
        self.speed[model.joint("rw").dofadr[0]] = rate
        count = model.nv
        self.matrix = np.zeros((2 * count, 2 * count))
        self.matrix[:count, count:] = np.eye(count)
        for i, step in enumerate(DIFFERENCE * np.eye(count)):
            zero = np.zeros(count)
            moved = self._acceleration(step, zero) - self._acceleration(-step, zero)
            faster = self._acceleration(zero, step) - self._acceleration(zero, -step)
            self.matrix[count:, i] = moved / (2.0 * DIFFERENCE)
            self.matrix[count:, count + i] = faster / (2.0 * DIFFERENCE)

    def _acceleration(self, position, rate, body=0, wrench=None):
        data = self.data
        data.qpos[:] = self.start
        mujoco.mj_integratePos(self.model, data.qpos, position, 1.0)
        data.qvel[:] = self.speed + rate
        data.xfrc_applied[:] = 0.0
        if wrench is not None:
            data.xfrc_applied[body] = wrench
        mujoco.mj_forward(self.model, data)
        return data.qacc.copy()

    def pushed(self, name, wrench):
        """`(nv,)` acceleration by a force and torque on a body, in the axes of the world."""
        zero = np.zeros(self.model.nv)
        body = self.model.body(name).id
        return self._acceleration(zero, zero, body, wrench) - self._acceleration(zero, zero)

    def attitude(self, acceleration, omega):
        """`(3,)` amplitude of the bus's attitude."""
        count = self.model.nv
        right = np.concatenate([np.zeros(count), acceleration]).astype(complex)
        return np.linalg.solve(1j * omega * np.eye(2 * count) - self.matrix, right)[3:6]
