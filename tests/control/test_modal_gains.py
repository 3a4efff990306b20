"""Modal gains of `bc.plant` against the response of the plant's own matrices,
and against a craft assembled by hand."""

import copy

import numpy as np
import pytest
from scipy.linalg import eig

import beamchain as bc
from plant_truth import CRAFTS, Truth, embedded, kept, wheel_rates

ROUNDING = 1e-9  # of a mode's largest gain
AGREE = 1e-6  # of a mode's largest gain: the finite elements' own precision, and that of the chains
SPUN = "a tilted bus with two booms"
STEP = 0.01


def transfer(a, b, c, d, at):
    """C (at - A)^-1 B + D."""
    return c @ np.linalg.solve(at * np.eye(a.shape[0]) - a, b.astype(complex)) + d


def gains_of(plant):
    """What each mode adds to the response at its frequency, times |s^2 + 2 zeta w s + w^2|;
    by taking the mode out."""
    a, b, c, d = (np.asarray(getattr(plant, name)) for name in "ABCD")
    out = []
    for name, w, zeta in zip(plant.modes, plant.frequency, plant.damping_ratio, strict=True):
        s = 1j * w
        z = np.exp(s * plant.dt) if plant.dt else s
        others = [
            i for i, state in enumerate(plant.state_labels) if state not in (name, f"{name}_rate")
        ]
        without = transfer(a[np.ix_(others, others)], b[others], c[:, others], d, z)
        out.append(
            np.abs(transfer(a, b, c, d, z) - without) * abs(s**2 + 2.0 * zeta * w * s + w**2)
        )
    return np.array(out)


def distance(found, true):
    return float(np.max(np.abs(found - true) / true.max(axis=(1, 2), keepdims=True)))


@pytest.mark.slow
@pytest.mark.parametrize("discrete", [None, STEP], ids=["continuous", "discrete"])
@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_gains_are_those_of_the_matrices(speed, discrete):
    rates = {wheel: speed * rate for wheel, rate in wheel_rates(CRAFTS[SPUN]).items()}
    inputs = ["torque:hub", "wrench:unit"]
    outputs = ["attitude", "rate"]
    plant = bc.plant(embedded(SPUN), inputs, outputs, {}, rates=rates, discrete=discrete)
    assert distance(plant.gain, gains_of(plant)) < ROUNDING


@pytest.mark.slow
def test_gains_are_those_of_a_craft_assembled_by_hand():
    """Residues R of the gyroscopic system at its poles p:
    the mode's numerator is R (s - p*) + R* (s - p)."""
    craft, inputs = CRAFTS[SPUN], ["torque:hub"]
    plant = bc.plant(embedded(SPUN), inputs, ["attitude"], {}, rates=wheel_rates(craft))
    truth = Truth(craft, kept)
    a, inverse = truth.system()
    values, left, right = eig(a, left=True)
    drive = np.vstack([np.zeros((truth.size, 3)), inverse @ truth.inputs(inputs)])
    poles = plant.frequency * (1j * np.sqrt(1.0 - plant.damping_ratio**2) - plant.damping_ratio)
    for k, (w, pole) in enumerate(zip(plant.frequency, poles, strict=True)):
        j = int(np.argmin(np.abs(values - pole)))
        assert abs(abs(values[j]) / w - 1.0) < AGREE
        seen = right[3:6, j] / (left[:, j].conj() @ right[:, j])
        residue = np.outer(seen, left[:, j].conj() @ drive)
        s = 1j * w
        numerator = residue * (s - values[j].conj()) + residue.conj() * (s - values[j])
        assert np.max(np.abs(plant.gain[k] - np.abs(numerator))) < AGREE * np.abs(numerator).max()


@pytest.mark.slow
def test_gains_of_a_discrete_plant_tend_to_those_of_the_continuous_one():
    made = embedded(SPUN)
    model = copy.copy(made.untimed)
    true = bc.plant(model, ["torque:hub"], ["attitude"]).gain
    errors = [
        distance(bc.plant(model, ["torque:hub"], ["attitude"], discrete=h).gain, true)
        for h in (2e-4, 1e-4)
    ]
    assert errors[1] < 0.55 * errors[0] < 0.01
