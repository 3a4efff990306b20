"""Closed forms beside the formulas of an identification."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from beamchain.identification.likelihood import Found, Likelihood
from beamchain.identification.structure import Parts
from identification_doors import resolution

NOISE = 1e-4  # of what is measured of each mode
SAMPLES = 100  # complex


@dataclass(frozen=True)
class Modes:
    """Modes of which a log measures the frequency times the participation, each by itself."""

    live: np.ndarray
    given: list

    @property
    def modes(self):
        return self.live.shape[0]

    @property
    def places(self):
        return (slice(0, 0),) * 5

    def delay(self, theta):
        return 0.0

    def theta(self, parts, rest, delay):
        self.given[:] = [parts]
        return parts.frequencies

    def parts(self, theta):
        return self.given[0]._replace(frequencies=theta)

    def raw(self, theta):
        rows = self.given[0].participation[:, 0]
        return SimpleNamespace(flat=lambda: theta * rows)


class Log:
    output, omega = 0, np.zeros(SAMPLES)

    def assess(self, raw, weights, slopes, lags):
        information = slopes.T @ slopes / NOISE**2
        return (np.ones(1), information, np.zeros(len(information)), information), None


def test_two_halves_of_a_mode_are_told_apart_by_their_distance_s_own_deviation():
    w, ratio, moment = np.array([3.0, 8.0]), np.array([0.02, 0.01]), np.array([[0.5], [0.8]])
    parts = Parts(w, ratio, moment, np.eye(6), np.eye(6))
    modes = Modes(np.ones((2, 1), dtype=bool), [parts])
    found = Found(w, 0.0, np.ones(1), np.array([2.0 * SAMPLES]))
    got = resolution(modes, found, Likelihood([Log()], modes.raw, np.ones(1)), 1)
    # each half has the moment 0.8 / sqrt 2, so that its frequency has the deviation
    # NOISE sqrt 2 / 0.8 and the distance of both sqrt 2 times that; the trial is 8 * 0.01 apart,
    # and information on a distance d grows with d^2: d^2 = 2 sqrt(6 ln N) deviation * trial
    deviation = 2.0 * NOISE / 0.8
    wanted = np.sqrt(2.0 * np.sqrt(6.0 * np.log(2.0 * SAMPLES)) * deviation * 0.08)
    assert got == pytest.approx(wanted, rel=1e-6)
