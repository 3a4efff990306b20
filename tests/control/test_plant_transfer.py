"""`bc.plant` against craft assembled by hand from finite elements: every input and output,
drive angles, wheels at speed."""

import copy
import sys

import mujoco
import numpy as np
import pytest

import beamchain as bc
from mechanics import mass_matrix
from plant_truth import CRAFTS, Truth, band, embedded, error, kept, motors, wheel_rates

# relative, kept modes against finite elements cut to the same modes; measured 3e-8 at most
KEPT = 1e-6
# `exact` against finite elements with MANY modes of bending, TURNS of torsion; measured below
EXACT = 1e-6
MANY, TURNS = 60, 150
PROOF = 1e-6  # against mjd_transitionFD, whose own perturbation is 1e-6
# the same with wheels at speed: rounding of their centripetal forces over that perturbation
NOISY = 1e-4
# damping of the frequencies at which responses are compared, so that no undamped peak is met
OFF = 0.003
INPUTS = ["torque:hub", "force:hub", "wrench:unit"]
OUTPUTS = ["attitude", "rate", "motion:unit", "gyro", "accelerometer", "star"]
LARGE = ("four wheels, two drives with arrays, a boom", "a tilted bus with two booms")
NAMES = [pytest.param(name, marks=[pytest.mark.slow] if name in LARGE else []) for name in CRAFTS]


def signals(craft):
    drives = craft.get("drives", {})
    wheels = craft.get("wheels", {})
    return motors(craft) + INPUTS, [
        *OUTPUTS,
        *(f"{n}_angle" for n in drives),
        *(f"{n}_rate" for n in wheels),
    ]


def pose(craft):
    return dict.fromkeys(craft.get("drives", {}), np.pi / 2.0)


def at_speed(name):
    craft = CRAFTS[name]
    return bc.plant(embedded(name), *signals(craft), pose(craft), rates=wheel_rates(craft))


@pytest.mark.parametrize("name", NAMES)
def test_the_plant_is_the_craft_with_its_kept_modes(name):
    craft = CRAFTS[name]
    s = np.geomspace(0.05, band(craft), 80) * (OFF + 1j)
    true = Truth(craft, kept, pose(craft)).transfer(s, *signals(craft))
    found = error(at_speed(name)(s, squeeze=False), true)
    sys.stdout.write(f"{name}: {found:.1e}" + "\n")
    assert found < KEPT


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES[1:])  # the largest craft in test_engineer
def test_the_exact_plant_is_the_craft_in_finite_elements(name):
    craft = CRAFTS[name]
    plant = at_speed(name)
    omega = np.geomspace(0.05, band(craft), 40)
    counts = {"xy": MANY, "xz": MANY, "torsion": TURNS, "axial": MANY}
    truth = Truth(craft, lambda a: counts, pose(craft))
    s = omega * (OFF + 1j)
    true = truth.transfer(s, *signals(craft))
    found = error(plant.exact(s, squeeze=False), true)
    sys.stdout.write(f"{name}: {found:.1e}" + "\n")
    assert found < EXACT
    on_axis = truth.transfer(1j * omega, *signals(craft))
    left_out = np.abs(plant(1j * omega, squeeze=False) - on_axis) / np.maximum(
        np.abs(on_axis), 1e-300
    )
    seen = np.abs(on_axis) > 1e-3 * np.abs(on_axis).max((0, 1), keepdims=True)
    told = plant.truncation(omega)
    assert np.all(np.abs(told - left_out)[seen & (left_out < 1.0)] < 1e-4)


@pytest.mark.parametrize(
    ("speed", "start", "limit"), [(0.0, 0.05, PROOF), (1.0, 3.0, NOISY)], ids=["rest", "turning"]
)
@pytest.mark.parametrize("name", NAMES)
def test_mujocos_own_linearisation_agrees(name, speed, start, limit):
    craft = CRAFTS[name]
    made = embedded(name)
    names = motors(craft) or ["torque:hub"]
    rates = {n: speed * rate for n, rate in wheel_rates(craft).items()}
    plant = bc.plant(made, names, ["attitude", "rate"], rates=rates)
    model = copy.copy(made.untimed)
    # v+ = v + h (M + h D)^-1 f, gyroscopic moments in D
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICIT
    data = mujoco.MjData(model)
    nv = model.nv
    h = model.opt.timestep
    for wheel, rate in rates.items():
        data.joint(wheel).qvel = rate
    mujoco.mj_forward(model, data)
    data.qfrc_applied[:] = -data.qfrc_smooth  # what drags on the wheels is made up for
    a = np.zeros((2 * nv, 2 * nv))
    b = np.zeros((2 * nv, model.nu))
    mujoco.mjd_transitionFD(
        model, data, 1e-4 if speed else 1e-6, True, a, b if model.nu else None, None, None
    )
    x = np.linalg.inv(a[nv:, nv:])
    stiffness = -x @ a[nv:, :nv] / h
    damping = (x - np.eye(nv)) / h
    inputs = x @ b[nv:] / h
    if not model.nu:  # torque on the hub: through the inverse mass
        inputs = np.linalg.inv(mass_matrix(model))[:, 3:6]
    s = np.geomspace(start, band(craft), 40) * (0.01 + 1j)
    q = np.stack(
        [np.linalg.solve(v**2 * np.eye(nv) + v * damping + stiffness, inputs)[3:6] for v in s], -1
    )
    assert error(plant(s, squeeze=False), np.concatenate([q, s * q])) < limit


def test_turning_wheels_make_the_craft_nutate():
    name = "a tilted bus with two booms"
    rest = bc.plant(embedded(name))
    turning = bc.plant(embedded(name), rates=wheel_rates(CRAFTS[name]))
    assert not [state for state in rest.state_labels if "nutation" in state]
    at = [i for i, state in enumerate(turning.state_labels) if "nutation" in state]
    pole = np.abs(np.linalg.eigvals(turning.A[np.ix_(at, at)]))
    poles = np.abs(np.linalg.eigvals(Truth(CRAFTS[name], kept).system()[0]))
    assert np.min(np.abs(poles - pole[0])) < 1e-6 * pole[0]
