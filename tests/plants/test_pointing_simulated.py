"""Pointing budgets against plain MuJoCo: a wheel with masses that really are off its axis, spun up
to the speed of the largest stated error; a snap that moves springs; random torques.

The budgets come from models whose wheel is balanced; what runs is another model.
"""

import mujoco
import numpy as np
import pytest

import beamchain as bc

RUN = 0.02  # of an amplitude after five time constants, of which exp(-5) = 0.7 % is left
STEP_ERROR = 0.1  # of the damping ratio: the step's own error of the mode
RATIO = 0.005
MASS, OFF, APART = 2e-3, 0.05, 0.04  # of what unbalances [kg, m], and distance of a pair [m]
SPEEDS = (4.0, 40.0)
WHEEL = 'mass="20" diaginertia="0.6 0.6 1.1"'
CRAFT = f"""<mujoco><option gravity="0 0 0"/><worldbody><body name="bus"><freejoint/>
<inertial pos="0 0 0" mass="40" diaginertia="4 7 7.2"/><site name="mount" pos="0.4 0 0"/>
<body name="wheel" pos="-0.2 0.1 0.15" euler="0 75 10"><joint name="rw"/>
<inertial pos="0 0 0" {WHEEL}/></body></body></worldbody></mujoco>"""
BEAM = bc.Spec(
    segment=(
        bc.Segment(
            length=2.0,
            section=bc.Equivalent(
                bending_stiffness_xy=150.0, bending_stiffness_xz=154.0, linear_mass=2.0
            ),
        ),
    ),
    damping=bc.Damping(ratio=RATIO),
)
UNBALANCED = {
    "static": ((OFF, 0.0),),
    "dynamic": ((OFF, APART), (-OFF, -APART)),
}


@pytest.fixture(scope="module")
def craft():
    return bc.embed(CRAFT, {"mount": BEAM})


def unbalanced(craft, kind):
    """The craft's file with masses on its wheel, as an independent model."""
    masses = "".join(
        f'<body pos="{x} 0 {z}"><inertial pos="0 0 0" mass="{MASS}" '
        'diaginertia="1e-9 1e-9 1e-9"/></body>'
        for x, z in UNBALANCED[kind]
    )
    text = craft.to_mjcf()
    assert text.count('name="rw"') == 1
    end = text.index("</body>", text.index('name="rw"'))
    return mujoco.MjModel.from_xml_string(text[:end] + masses + text[end:])


def attitude(data, body):
    turn = np.zeros(3)
    mujoco.mju_quat2Vel(turn, data.xquat[body], 1.0)
    return turn


@pytest.mark.parametrize("kind", sorted(UNBALANCED))
def test_an_unbalanced_wheel_at_the_worst_speed(craft, kind):
    static = MASS * OFF if kind == "static" else 0.0
    dynamic = 2.0 * MASS * OFF * APART if kind == "dynamic" else 0.0
    wheel = bc.WheelDisturbance(joint="rw", speeds=SPEEDS, static=static, dynamic=dynamic)
    budget = bc.pointing(craft, bc.Disturbances(wheel=(wheel,)))
    worst = max(budget.worst, key=lambda error: error.peak)
    axis = "xyz".index(worst.output[-1])
    plant = bc.plant(craft, ["torque:bus"], ["attitude"], rates={"rw": worst.speed})
    mode = plant.frequency[plant.modes.index(worst.mode)]
    ratio = plant.damping_ratio[plant.modes.index(worst.mode)]
    # whirl matters: without it the error would be less than half as large
    still = bc.plant(craft, ["torque:bus"], ["attitude"]).frequency
    assert np.abs(still / mode - 1.0).min() > 2.0 * ratio

    model = unbalanced(craft, kind)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    highest = max(plant.frequency.max(), bc.plant(craft).frequency.max())
    step = min(1.8 / highest, 2.0 * np.pi / (30.0 * worst.speed))
    # RK4: |R| = 1 - (w h)^6/144, the phase is off by (w h)^5/120
    assert (mode * step) ** 5 / 144.0 < STEP_ERROR * ratio
    assert (mode * step) ** 4 / 120.0 < STEP_ERROR * ratio
    model.opt.timestep = step
    data = mujoco.MjData(model)
    data.joint("rw").qvel[:] = worst.speed
    body = model.body("bus").id
    for _ in range(int(5.0 / (ratio * mode) / step)):
        mujoco.mj_step(model, data)
    count = int(20.0 * 2.0 * np.pi / worst.speed / step)
    times, values = np.zeros(count), np.zeros(count)
    for k in range(count):
        mujoco.mj_step(model, data)
        times[k], values[k] = data.time, attitude(data, body)[axis]
    turned = float(data.joint("rw").qvel[0])
    assert abs(turned / worst.speed - 1.0) < 0.02 * ratio  # it still turns as fast
    t = times - times[0]
    columns = [np.ones(count), t, np.cos(worst.speed * times), np.sin(worst.speed * times)]
    fitted = np.linalg.lstsq(np.column_stack(columns), values, rcond=None)[0]
    assert abs(np.hypot(*fitted[2:]) / worst.peak - 1.0) < RUN

    run = budget.simulate()
    assert (run.source, run.output, run.speed) == ("wheel rw", worst.output, worst.speed)
    assert run.stated == worst.peak
    assert abs(run.difference) < RUN


def test_a_snap_that_moves_the_springs(craft):
    """A uniform thermal moment is a torque on every hinge of its plane."""
    moment, tau = 0.05, 0.3
    snap = bc.ThermalSnap(appendage="appendage_", port="xz", moment=moment, time_constant=tau)
    budget = bc.pointing(craft, bc.Disturbances(snap=(snap,)))
    model = craft.model
    model = mujoco.MjModel.from_xml_string(craft.to_mjcf())
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.opt.timestep = 0.002
    data = mujoco.MjData(model)
    hinges = [
        model.joint(j).dofadr[0] for j in range(model.njnt) if model.joint(j).name.endswith("_xz")
    ]
    largest = np.zeros(3)
    for _ in range(10_000):
        middle = data.time + model.opt.timestep / 2.0
        data.qfrc_applied[hinges] = moment * -np.expm1(-middle / tau)
        mujoco.mj_step(model, data)
        largest = np.maximum(largest, np.abs(attitude(data, model.body("bus").id)))
    main = int(np.argmax(budget.ape.peak))
    assert np.isclose(largest[main], budget.ape.peak[main], rtol=2e-3)


def test_a_run_says_why_there_is_none(craft):
    noise = bc.NoiseDisturbance(input="torque:bus", frequency=(1.0, 2.0), density=(1e-8, 1e-8))
    budget = bc.pointing(craft, bc.Disturbances(psd=(noise,)))
    with pytest.raises(bc.InputError, match="no source is a wheel"):
        budget.simulate()
    with pytest.raises(bc.InputError, match="no source is a wheel"):
        budget.plot()
