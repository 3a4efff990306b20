"""The budget of a wheel that turns on a tree with an overdamped drive: what damps the drive leaves
fewer oscillators than modes, and the craft's slow nutation is none of them.

Against the compiled file, differenced with numpy: accelerations that MuJoCo returns.
"""

import numpy as np
import pytest

from beamchain import pointing
from overdamped_drive import Truth, made

STATIC, DYNAMIC = 2e-5, 3e-6  # imbalance [kg m, kg m^2]
CLOSE = 1e-5  # of a response
RUN = 0.02  # of an amplitude after five time constants, of which exp(-5) = 0.7 % is left


@pytest.fixture(scope="module")
def craft(tmp_path_factory):
    return made("from a file", tmp_path_factory.mktemp("tree"))


def wheel_error(truth):
    """`(3,)` largest attitude by the wheel's static and dynamic imbalance together."""
    speed = truth.speed.max()
    turn = truth.data.body("wheel").xmat.reshape(3, 3)
    static, dynamic = (
        [truth.pushed("wheel", np.kron(place, turn[:, k])) for k in range(2)] for place in np.eye(2)
    )
    amplitudes = [
        truth.attitude(size * speed**2 * (first - 1j * second), speed)
        for size, (first, second) in ((STATIC, static), (DYNAMIC, dynamic))
    ]
    return np.abs(amplitudes).sum(axis=0)


@pytest.mark.slow
def test_the_budget_of_its_wheel(craft):
    wheel = pointing.WheelDisturbance(
        joint="rw", speeds=(2.0, 12.0), static=STATIC, dynamic=DYNAMIC
    )
    budget = pointing.budget(craft, pointing.Disturbances(wheel=(wheel,)))
    source = budget["wheel rw"]
    for number, shares in enumerate(source.shares):
        assert np.isclose(sum(shares.values()), 1.0)
        truth = Truth(craft, source.speed[number])
        assert np.isclose(source.ape.peak[number], wheel_error(truth)[number], rtol=CLOSE)
    worst = max(budget.worst, key=lambda error: error.peak)
    assert worst.mode == "appendage_panel_root_mode1_xz"
    assert worst.share > 0.5


@pytest.mark.slow
def test_a_run_waits_for_the_leading_mode(craft):
    wheel = pointing.WheelDisturbance(
        joint="rw", speeds=(2.0, 12.0), static=STATIC, dynamic=DYNAMIC
    )
    run = pointing.budget(craft, pointing.Disturbances(wheel=(wheel,))).simulate()
    poles = np.linalg.eigvals(Truth(craft, run.speed).matrix)
    nearest = poles[np.argmin(np.abs(poles - 1j * run.speed))]
    assert run.times[0] > 4.9 / -nearest.real
    assert abs(run.difference) < RUN
