"""Long runs without damping: energy, phase and momenta as each integrator's order says.

`python tests/benchmarks/long_runs.py` prints the same for a million steps.
"""

from functools import cache

import numpy as np
import pytest

from mechanics import INTEGRATORS
from undisturbed import ringing as rung
from undisturbed import tumbling

STEPS = 20_000
BOUNDED = 1e-3  # of the energy: means over 200 periods that begin anywhere differ by some 1e-4
PHASE = 2e-5  # relative: some 400 periods counted between two crossings, each read to a hundredth
ORDER = 0.1  # of a measured order
ROUNDED = 1e-10  # what a step of order four leaves at 0.02 s


pytestmark = pytest.mark.slow
EACH = ("implicitfast", "RK4")


@cache
def ringing(integrator):
    """One long run."""
    return rung(integrator, STEPS)


@pytest.mark.parametrize("integrator", EACH)
def test_momenta_are_conserved_to_the_integrator_s_order(integrator):
    order = 4.0 if integrator == "RK4" else 1.0
    coarse = tumbling(integrator, 0.02)
    fine = tumbling(integrator, 0.01)
    for a, b in zip(coarse, fine, strict=True):
        assert abs(np.log2(a / b) - order) < ORDER
    assert max(coarse) < (ROUNDED if integrator == "RK4" else 1e-2)


@pytest.mark.parametrize("integrator", EACH)
def test_phase_is_what_the_step_s_matrix_says(integrator):
    row = ringing(integrator)
    assert abs(row.phase - row.predicted) < PHASE


def test_semi_implicit_steps_keep_the_energy():
    assert ringing("implicitfast").worst < BOUNDED


@pytest.mark.parametrize(("integrator", "left"), [("RK4", -0.1), ("discrete", -0.9)])
def test_the_others_lose_energy(integrator, left):
    if integrator not in INTEGRATORS:
        pytest.skip("this MuJoCo has no such integrator")
    assert ringing(integrator).last < left
