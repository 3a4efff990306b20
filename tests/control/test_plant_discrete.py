"""`bc.plant(discrete=h)` against the sampled continuous plant, and against MuJoCo itself."""

import copy
import sys

import control
import mujoco
import numpy as np
import pytest
from scipy.linalg import expm

import beamchain as bc
from mechanics import compiled
from plant_truth import CRAFTS, Truth, embedded, kept, motors, text, wheel_rates

EXACT = 1e-9  # the continuous plant held over the step, against the truth held the same way
#: one undamped appendage, by the phase of its fastest mode: poles exact, residues of fourth order
ALONE = {0.1: 1e-8, 2.0: 2e-3}
#: the same craft with all its appendages; damped: the one input weight
FIGURES = {0.1: 2e-4, 2.0: 3e-3}
RUN = 1e-4  # of a run of MuJoCo, for what is not linear in it: 5e-5 where a light drive turns most
OFF = 0.02
NAMES = [name for name in CRAFTS if not name.startswith("four wheels")]


def held(truth, h, z, inputs):
    """Exact transfer of an input held over the step to the attitude, `(3, m, k)`."""
    a, inverse = truth.system()
    n = truth.size
    g = np.vstack([np.zeros((n, n)), inverse]) @ truth.inputs(inputs)
    both = expm(np.block([[a, g], [np.zeros((g.shape[1], 2 * n + g.shape[1]))]]) * h)
    f = both[: 2 * n, : 2 * n]
    g = both[: 2 * n, 2 * n :]
    return np.stack([np.linalg.solve(v * np.eye(2 * n) - f, g)[3:6] for v in z], -1)


def distance(found, true, s, rigid):
    """Largest difference, relative to the response or to that of the rigid craft `1/(J
    s^2)`, the larger."""
    size = np.maximum(np.linalg.norm(true, axis=(0, 1)), np.linalg.norm(rigid) / np.abs(s) ** 2)
    return float(np.max(np.abs(found - true).max((0, 1)) / size))


@pytest.mark.parametrize("phase", ALONE)
@pytest.mark.slow
def test_one_undamped_appendage_is_sampled_within_the_figures(phase):
    name = "one undamped boom"
    made = embedded(name, retime=True)
    model = copy.copy(made.untimed)
    fastest = bc.plant(made).frequency.max()
    h = phase / fastest
    model.opt.timestep = h
    bc.retime(model, h)
    plant = bc.plant(model, ["torque:hub"], ["attitude", "rate"], discrete=h)
    s = np.geomspace(0.05, min(fastest, 3.0 / h), 60) * (OFF + 1j)
    z = np.exp(s * h)
    continuous = bc.plant(made, ["torque:hub"], ["attitude"])
    true = control.c2d(
        control.ss(continuous.A, continuous.B, continuous.C, continuous.D), h, "zoh"
    )(z, squeeze=False)
    truth = Truth(CRAFTS[name], kept)
    rigid = np.linalg.inv(truth.m[:6, :6])[3:, 3:]
    assert distance(true, held(truth, h, z, ["torque:hub"]), s, rigid) < EXACT
    found = plant(z, squeeze=False)
    mean = (1.0 - 1.0 / z) / h  # rate: the mean over the step
    said = distance(found[:3], true, s, rigid), distance(found[3:] / mean, true, s, rigid)
    sys.stdout.write(f"phase {phase:g}: {said[0]:.1e}, {said[1]:.1e}" + "\n")
    assert max(said) < ALONE[phase]


@pytest.mark.parametrize("phase", FIGURES)
@pytest.mark.parametrize("name", NAMES[:2])
@pytest.mark.slow
def test_embedded_craft_stay_within_the_figures(name, phase):
    craft = CRAFTS[name]
    made = embedded(name, retime=True)
    fastest = bc.plant(made).frequency.max()
    h = phase / fastest
    still = copy.deepcopy(
        {**craft, "wheels": {n: {**w, "rate": 0.0} for n, w in craft.get("wheels", {}).items()}}
    )
    inputs = [*motors(craft), "torque:hub"]
    s = np.geomspace(0.05, min(fastest, 3.0 / h), 60) * (OFF + 1j)
    z = np.exp(s * h)
    truth = Truth(still, kept)
    rigid = np.linalg.inv(truth.m[:6, :6])[3:, 3:]
    plant = bc.plant(made, inputs, ["attitude"], discrete=h)
    found = distance(plant(z, squeeze=False), held(truth, h, z, inputs), s, rigid)
    sys.stdout.write(f"{name}, phase {phase:g}: {found:.1e}" + "\n")
    assert found < FIGURES[phase]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.slow
def test_it_is_what_mujoco_runs(name):
    craft = CRAFTS[name]
    made = embedded(name, retime=True)
    h = 0.01
    names = motors(craft)
    plant = bc.plant(
        made, names or ["torque:hub"], ["attitude", "rate"], rates=wheel_rates(craft), discrete=h
    )
    data = mujoco.MjData(made.model)
    held_input = bc.HeldInput()
    for wheel, rate in wheel_rates(craft).items():
        data.joint(wheel).qvel = rate
    mujoco.mj_forward(made.model, data)
    balance = -data.qfrc_smooth.copy()
    start = data.body("hub").xmat.reshape(3, 3).copy()
    given = 1e-3 * np.random.default_rng(5).standard_normal((plant.ninputs, 300))
    seen = []
    for u in given.T:
        turn = start.T @ data.body("hub").xmat.reshape(3, 3)
        seen.append(
            [(turn - turn.T)[i, j] / 2.0 for i, j in ((2, 1), (0, 2), (1, 0))]
            + list(data.qvel[3:6])
        )
        data.qfrc_applied[:] = balance
        if names:
            data.ctrl[:] = held_input(u)
        else:
            data.qfrc_applied[3:6] += held_input(u)
        mujoco.mj_step(made.model, data)
        mujoco.mj_forward(made.model, data)
    told, seen = (
        np.asarray(control.forced_response(plant, np.arange(300) * h, given).outputs),
        np.array(seen).T,
    )
    # of the attitude's axes, and of the rate's
    size = np.abs(seen).max(1).reshape(2, 3).max(1).repeat(3)
    sys.stdout.write(f"{name}: {np.max(np.abs(told - seen).max(1) / size):.1e}" + "\n")
    assert np.all(np.abs(told - seen).max(1) < RUN * size)


def test_an_unstable_step_names_the_mode():
    craft = text(CRAFTS["a sprung drive and worn bearings"]).replace(
        'stiffness="4000.0"', 'stiffness="4000000.0"'
    )
    with pytest.raises(bc.InputError, match=r"0\.1 s is unstable: mode 'drive'"):
        bc.plant(compiled(craft), discrete=0.1)


def test_turning_wheels_under_euler_are_warned_of():
    name = "a tilted bus with two booms"
    plant = bc.plant(embedded(name, retime=True), rates=wheel_rates(CRAFTS[name]), discrete=0.05)
    assert ["implicit does not" in w for w in plant.warnings if w.code == "turn-error"] == [True]
