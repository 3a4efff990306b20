"""Pointing budgets against plain MuJoCo: a wheel with masses that really are off its axis, spun up
to the speed of the largest stated error; a snap that moves springs; random torques.

The budgets come from models whose wheel is balanced; what runs is another model.
"""

import mujoco
import numpy as np
import pytest

import beamchain as bc
from beamchain import pointing
from unbalanced_wheel import (
    BEAM,
    CRAFT,
    PLACES,
    attitude,
    budget_of,
    simulated_amplitude,
    unbalanced,
)

RUN = 0.02  # of an amplitude after five time constants, of which exp(-5) = 0.7 % is left
STEP_ERROR = 0.1  # of the damping ratio: the step's own error of the mode


@pytest.fixture(scope="module")
def craft():
    return bc.embed(CRAFT, {"mount": BEAM})


@pytest.mark.parametrize("kind", sorted(PLACES))
@pytest.mark.slow
def test_an_unbalanced_wheel_at_the_worst_speed(craft, kind):
    budget = budget_of(craft, kind)
    worst = max(budget.worst, key=lambda error: error.peak)
    plant = bc.plant(craft, ["torque:bus"], ["attitude"], rates={"rw": worst.speed})
    number = plant.modes.index(worst.mode)
    mode, ratio = plant.frequency[number], plant.damping_ratio[number]
    # whirl matters: at rest the nearest mode is two half widths away
    still = bc.plant(craft, ["torque:bus"], ["attitude"]).frequency
    assert np.abs(still / mode - 1.0).min() > 2.0 * ratio
    step = min(1.8 / max(plant.frequency.max(), still.max()), 2.0 * np.pi / (30.0 * worst.speed))
    # RK4: the size of a step is off by (w h)^6/144, its phase by (w h)^5/120
    assert (mode * step) ** 5 / 144.0 < STEP_ERROR * ratio
    assert (mode * step) ** 4 / 120.0 < STEP_ERROR * ratio
    axis = "xyz".index(worst.output[-1])
    settling = 1.0 / (ratio * mode)
    model = unbalanced(craft, kind)
    found, speed = simulated_amplitude(model, worst.speed, axis, settling, step)
    assert abs(speed / worst.speed - 1.0) < 0.02 * ratio  # it still turns as fast
    assert abs(found / worst.peak - 1.0) < RUN

    run = budget.simulate()
    assert (run.source, run.output, run.speed) == ("wheel rw", worst.output, worst.speed)
    assert run.stated == worst.peak
    assert abs(run.difference) < RUN


@pytest.mark.slow
def test_a_snap_that_moves_the_springs(craft):
    """A uniform thermal moment is a torque on every hinge of its plane."""
    moment, tau = 0.05, 0.3
    snap = pointing.ThermalSnap(appendage="appendage_", port="xz", moment=moment, time_constant=tau)
    budget = pointing.budget(craft, pointing.Disturbances(snap=(snap,)))
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
    noise = pointing.NoiseDisturbance(
        input="torque:bus", frequency=(1.0, 2.0), density=(1e-8, 1e-8)
    )
    budget = pointing.budget(craft, pointing.Disturbances(psd=(noise,)))
    with pytest.raises(bc.InputError, match="no source is a wheel"):
        budget.simulate()
    with pytest.raises(bc.InputError, match="no source is a wheel"):
        budget.plot()
