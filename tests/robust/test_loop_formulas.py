"""Closed forms beside dead times near a frequency and the margins of a sample."""

import control
import numpy as np
import pytest

from loops import loop_of
from robust_doors import delay_near, figure_of_sample, smallness


def test_a_dead_time_near_a_frequency_is_a_rational_function_within_its_stated_error():
    for low, high in ((3.0, 5.0), (0.0, 4.0)):
        delay = delay_near(0.7, low, high)
        a, b, c, d = delay.system
        errors = []
        for w in np.linspace(low, high, 21):
            got = c @ np.linalg.solve(1j * w * np.eye(len(a)) - a, b) + d
            errors.append(abs(got[0, 0] - np.exp(-0.7j * w)))
        assert max(errors) <= delay.error * (1.0 + 1e-6) + 1e-13
        assert errors[0] == pytest.approx(delay.error, rel=1e-3, abs=1e-13)
    wide = delay_near(10.0, 0.0, 1e3)
    assert wide.error == 1.0
    assert wide.system[3] == 0.0


def test_figures_of_a_sample():
    found = loop_of(control.tf([2.0], [1.0, 3.0, 3.0, 1.0]))
    (loop,) = found.loops
    gain = figure_of_sample(found, loop.input, "gain up, factor")
    assert gain == pytest.approx((4.0, np.sqrt(3.0)), rel=1e-6)
    unstable = loop_of(control.tf([20.0], [1.0, 3.0, 3.0, 1.0]))
    kinds = {"gain up, factor": 1.0, "gain down, factor": 1.0, "phase": 0.0, "disk": 0.0}
    for kind, nothing in kinds.items():
        assert figure_of_sample(unstable, loop.input, kind).value == nothing
    # 2 / (s - 1): stable from the gain 1/2 up, at frequency 0
    slow = loop_of(control.tf([2.0], [1.0, -1.0]))
    lowest = figure_of_sample(slow, slow.loops[0].input, "gain down, factor")
    assert lowest == pytest.approx((0.5, 0.0), rel=1e-6, abs=1e-9)
    assert smallness("gain up, factor", 3.0) == 3.0
    assert smallness("phase", -30.0) == 30.0
    assert smallness("gain down, factor", 0.3) == -0.3
