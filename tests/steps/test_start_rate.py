"""Tests an internal, `steps.integrators.start_rate`:
the mean rate that starts a mode damped critically or more.

`bc.start_velocity`, the public name, is held to the same in test_discrete.py for oscillating modes;
from a damping ratio of 1 on it takes the mode for a critically damped one and is not exact.
"""

import numpy as np
import pytest
from scipy.linalg import expm
from test_discrete import Timed, step_by_hand

from beamchain.steps.integrators import start_rate


@pytest.mark.parametrize("ratio", [1.0, 2.0])
@pytest.mark.parametrize("x", [1e-9, 0.05, 0.6])
def test_a_mode_started_with_the_mean_rate_is_exact_at_every_sample(x, ratio):
    h, w = 0.25, x / 0.25
    got = Timed("Euler", w, ratio, h)
    step = step_by_hand("Euler", got.mass[0], got.damping[0], w**2, h)
    exact = expm(np.array([[0.0, 1.0], [-(w**2), -2 * ratio * w]]) * h)
    q0 = 0.7
    v0 = -0.4 * max(w, 1e-3)
    state = np.array([q0, start_rate(q0, v0, w, ratio, h)])
    truth = np.array([q0, v0])
    for _ in range(40):
        before = truth[0]
        state, truth = step @ state, exact @ truth
        assert state[0] == pytest.approx(truth[0], abs=3e-12)
        assert state[1] * h == pytest.approx(truth[0] - before, abs=3e-12)
