"""Long runs without damping: energy, phase and momenta as each integrator's order says.

`python tests/benchmarks/long_runs.py` prints the same for a million steps.
"""

import numpy as np
import pytest

from beamchain.engine.linearise import INTEGRATORS
from undisturbed import ringing, tumbling

STEPS = 20_000
BOUNDED = 1e-3  # of the energy: means over 200 periods that begin anywhere differ by some 1e-4
PHASE = 2e-5  # relative: some 400 periods counted between two crossings, each read to a hundredth
SEMI = ("Euler", "implicit", "implicitfast")
ORDER = 0.1  # of a measured order
ROUNDED = 1e-10  # what a step of order four leaves at 0.02 s


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_momenta_are_conserved_to_the_integrator_s_order(integrator):
    order = 4.0 if integrator == "RK4" else 1.0
    coarse, fine = tumbling(integrator, 0.02), tumbling(integrator, 0.01)
    for a, b in zip(coarse, fine, strict=True):
        assert abs(np.log2(a / b) - order) < ORDER
    assert max(coarse) < (ROUNDED if integrator == "RK4" else 1e-2)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_phase_is_what_the_step_s_matrix_says(integrator):
    row = ringing(integrator, STEPS)
    assert abs(row.phase - row.predicted) < PHASE


@pytest.mark.parametrize("integrator", SEMI)
def test_semi_implicit_steps_keep_the_energy(integrator):
    assert ringing(integrator, STEPS).worst < BOUNDED


def test_the_others_lose_energy():
    assert ringing("RK4", STEPS).last < -0.1
    if "discrete" in INTEGRATORS:
        assert ringing("discrete", STEPS).last < -0.9
