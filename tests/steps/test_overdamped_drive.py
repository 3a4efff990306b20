"""A tree with an overdamped drive, whose wheel turns: what damps the drive leaves fewer oscillators
than modes, and the craft's slow nutation is none of them.

Against the compiled file, differenced here with numpy: accelerations that MuJoCo returns.
"""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain import pointing
from beamchain.fitting.options import Port

RATE = 9.0  # of the wheel [rad/s]
STATIC, DYNAMIC = 2e-5, 3e-6  # imbalance [kg m, kg m^2]
DIFFERENCE = 1e-6  # step of the differences, whose own error is some 1e-8
CLOSE = 1e-5  # of a response
RUN = 0.02  # of an amplitude after five time constants, of which exp(-5) = 0.7 % is left
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


@pytest.fixture(scope="module", params=["in memory", "from a file"])
def craft(request, tmp_path_factory):
    carrying = (Port(name="end", x=2.0, carries=("yoke",)),)
    made = bc.embed(
        CRAFT,
        {
            "boom_root": beam(2.0, 900.0, 1100.0, 1.0, port=carrying),
            "panel_root": beam(1.5, 40.0, 60.0, 1.2),
        },
    )
    if request.param == "in memory":
        return made
    path = tmp_path_factory.mktemp("tree") / "tree.xml"
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

    def wheel_error(self):
        """`(3,)` largest attitude by the wheel's static and dynamic imbalance together."""
        speed = self.speed.max()
        turn = self.data.body("wheel").xmat.reshape(3, 3)
        static, dynamic = (
            [self.pushed("wheel", np.kron(place, turn[:, k])) for k in range(2)]
            for place in np.eye(2)
        )
        amplitudes = [
            self.attitude(size * speed**2 * (first - 1j * second), speed)
            for size, (first, second) in ((STATIC, static), (DYNAMIC, dynamic))
        ]
        return np.abs(amplitudes).sum(axis=0)


def test_the_plant_with_its_wheel_at_speed(craft):
    plant = bc.plant(craft, ["torque:bus"], ["attitude"], rates={"rw": RATE})
    truth = Truth(craft, RATE)
    poles = np.linalg.eigvals(truth.matrix)
    nutation = poles.imag[poles.imag > 1e-3].min()
    assert nutation < 0.1 * plant.frequency.min()
    assert np.sum((np.abs(poles.imag) < 1e-6) & (np.abs(poles) > 1e-3)) == 2  # of the drive
    for omega in (0.5, 3.0, 8.0, 20.0):
        found = plant(1j * omega)
        for axis in range(3):
            wrench = np.concatenate([np.zeros(3), np.eye(3)[axis]])
            wanted = truth.attitude(truth.pushed("bus", wrench), omega)
            assert np.allclose(found[:, axis], wanted, rtol=0.0, atol=CLOSE * np.abs(wanted).max())


def test_the_budget_of_its_wheel(craft):
    wheel = pointing.WheelDisturbance(
        joint="rw", speeds=(2.0, 12.0), static=STATIC, dynamic=DYNAMIC
    )
    budget = pointing.budget(craft, pointing.Disturbances(wheel=(wheel,)))
    source = budget["wheel rw"]
    for number, shares in enumerate(source.shares):
        assert np.isclose(sum(shares.values()), 1.0)
        truth = Truth(craft, source.speed[number])
        assert np.isclose(source.ape.peak[number], truth.wheel_error()[number], rtol=CLOSE)
    worst = max(budget.worst, key=lambda error: error.peak)
    assert worst.mode == "appendage_panel_root_mode1_xz"
    assert worst.share > 0.5


@pytest.mark.slow
def test_a_run_waits_for_the_leading_mode(craft):
    wheel = pointing.WheelDisturbance(
        joint="rw", speeds=(2.0, 12.0), static=STATIC, dynamic=DYNAMIC
    )
    run = pointing.budget(craft, pointing.Disturbances(wheel=(wheel,))).simulate()
    poles = np.linalg.eigvals(Truth(craft, run.speed).matrix)
    nearest = poles[np.argmin(np.abs(poles - 1j * run.speed))]
    assert run.times[0] > 4.9 / -nearest.real
    assert abs(run.difference) < RUN


def test_a_wrong_joint_lists_the_spacecrafts_own(craft):
    with pytest.raises(bc.InputError, match=r"'gimbal'.* from rw, drive\.$"):
        bc.plant(craft, rates={"gimbal": RATE})
