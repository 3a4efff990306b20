"""A spinning chain stiffens as a spinning beam does, without any term for it:
rigid links do it by themselves.

The hub turns about z with a huge inertia; MuJoCo is linearised in that state. Flap (out of the
plane of rotation) is plane xz, lag is plane xy.
"""

from functools import cache

import numpy as np
import pytest

from appendages import close
from arrays import space_beam
from beamchain import fit
from spinning import FLAP, spinning

PRINTED = 2e-5  # four decimals of 3.5


@cache
def chain_with(n):
    return fit(space_beam(), name="blade", modes={"xy": n, "xz": n})


@cache
def errors(n, eta):
    flap, lag = spinning(chain_with(n), eta)
    wanted = np.array(FLAP[eta])
    k = min(n, 3)
    return flap[:k] / wanted[:k] - 1.0, lag[:k] / np.sqrt(wanted[:k] ** 2 - eta**2) - 1.0


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_at_rest_both_planes_are_the_cantilever(n):
    flap, lag = errors(n, 0)
    assert np.max(np.abs(flap)) < PRINTED
    assert np.max(np.abs(lag)) < PRINTED


def test_theory_s_figure_at_eta_one():
    flap, _ = spinning(chain_with(3), 1)
    assert flap[0] == close(3.6827, abs=1e-4)


@pytest.mark.parametrize("eta", [1, 2, 5, 10])
def test_the_error_falls_with_every_mode(eta):
    found = [errors(n, eta) for n in (1, 2, 3, 4, 5)]
    for plane in (0, 1):
        first = np.array([e[plane][0] for e in found])
        assert np.all(first > 0.0)  # rigid links cannot bend between the hinges: always from above
        assert np.all(np.diff(first) < 0.0)


def test_the_error_is_second_order_in_the_spin():
    first = {eta: errors(3, eta)[0][0] - errors(3, 0)[0][0] for eta in (1, 2)}
    assert np.log2(first[2] / first[1]) == close(2.0, abs=0.5)


def test_the_error_grows_with_the_spin():
    for n in (2, 3, 5):
        assert np.all(np.diff([errors(n, eta)[0][0] for eta in (0, 1, 2, 5, 10)]) > 0.0)


@pytest.mark.parametrize("eta", [1, 5])
def test_lag_is_flap_less_the_spin(eta):
    # lag^2 = flap^2 - eta^2 holds for the chain itself too: the centrifugal field turns with it
    flap, lag = spinning(chain_with(3), eta)
    assert lag**2 == close(flap**2 - eta**2, rel=1e-3)
