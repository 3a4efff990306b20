"""Closed forms beside margins of plants, and the modes that they are named after."""

from types import SimpleNamespace

import control
import numpy as np
import pytest

from formulas import limiting_modes
from loops import loop_of


def test_gain_margin_at_rest_is_that_of_the_static_gain():
    """L(0) = -0.4: unstable from 2.5 on, at frequency 0."""
    (loop,) = loop_of(control.tf([-0.4], [1.0, 1.0])).loops
    assert loop.gain == pytest.approx(2.5, rel=1e-9)


def test_gain_and_phase_margin_of_three_lags():
    """k / (s + 1)^3 is -k / 8 at sqrt(3); with k = 2 sqrt(2) its size is 1 at 1."""
    (loop,) = loop_of(control.tf([2.0 * np.sqrt(2.0)], [1.0, 3.0, 3.0, 1.0])).loops
    assert loop.gain == pytest.approx(8.0 / (2.0 * np.sqrt(2.0)), rel=1e-7)
    assert abs(loop.phase) == pytest.approx(45.0, rel=1e-7)


def test_curves_of_both_sensitivities_and_the_poles():
    """L = 2 / (s + 1): S = (s + 1) / (s + 3), T = 2 / (s + 3)."""
    found = loop_of(control.tf([2.0], [1.0, 1.0]))
    s = 1j * found.omega
    np.testing.assert_allclose(found.sensitivity, np.abs((s + 1.0) / (s + 3.0)))
    np.testing.assert_allclose(found.complementary, np.abs(2.0 / (s + 3.0)))
    np.testing.assert_allclose(found.loops[0].response, 2.0 / (s + 1.0))
    assert found.poles == pytest.approx([-3.0])
    assert found.peak_complementary.value == pytest.approx(2.0 / 3.0, rel=1e-4)


@pytest.mark.parametrize(("delay", "told"), [(3.5, True), (3.0, False)])
def test_a_dead_time_longer_than_a_period_of_the_crossover_is_told(delay, told):
    """4 / (s + 2 sqrt(3)) is 1 at 2 rad/s, a period of 3.14 s."""
    found = loop_of(control.tf([4.0], [1.0, 2.0 * np.sqrt(3.0)]), delay)
    assert told == any(getattr(one, "code", "") == "long-delay" for one in found.warnings)


def test_a_limit_is_named_after_the_mode_that_answers_most_near_it():
    plant = SimpleNamespace(
        frequency=np.array([2.0, 2.1, 9.0]),
        damping_ratio=np.array([0.02, 0.001, 0.01]),
        gain=np.array([[[1.0]], [[0.8]], [[0.001]]]),
        modes=("array_mode1", "array_mode2", "array_mode3"),
        output_names=["angle"],
        input_names=["torque"],
    )
    loop = SimpleNamespace(outputs=("angle",), input="torque", limited={"gain": 2.1, "phase": 9.0})
    assert limiting_modes(plant, loop, 0.0) == {"gain": "array_mode2"}
    loop.limited = {"gain": 2.0}
    assert limiting_modes(plant, loop, 0.0) == {"gain": "array_mode1"}
    # sampled at 2 pi / 5: 9 rad/s is seen at 1, and 2.1 where it is
    plant.gain[2] = 3.0
    loop.limited = {"gain": 1.0}
    assert limiting_modes(plant, loop, 2.0 * np.pi / 5.0) == {"gain": "array_mode3"}
