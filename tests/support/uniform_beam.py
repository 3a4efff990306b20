"""Frequencies of the uniform Euler beam from its characteristic functions: an independent truth for the elements."""

import numpy as np
from scipy.optimize import brentq

from beamchain.structure import exact


class UniformBeam(exact.UniformBeam):
    """With its frequencies."""

    def coupled_frequencies(self, hub_mass, count):
        """`(count,)` frequencies [rad/s] of the beam on a free hub with mass matrix `(2, 2)` at the port.

        Zero gives the free-free beam. Roots of `det(M_hub + D)` by bracketing between the poles of D.

        Args:
            hub_mass: `(2, 2)` about the port [kg, kg m, kg m^2].
            count: how many, from the lowest.
        """
        m, length = self.linear_mass * self.length, self.length
        unit = np.array([[m, m * length], [m * length, m * length**2]])
        hub = np.asarray(hub_mass, dtype=np.float64) / unit
        if not np.any(hub):
            return _roots(_loose, count) * self.unit_frequency
        return (
            _roots(lambda z: float(np.linalg.det(hub + self._unit_dynamic_mass(z))) * _held(z), count)
            * self.unit_frequency
        )

    def cantilever_frequencies(self, count):
        """`(count,)` frequencies [rad/s] of the clamped-free beam: `1 + cos cosh = 0`."""
        return _roots(_held, count) * self.unit_frequency


def _held(z):
    """The cantilever's characteristic function over cosh z."""
    return float(1.0 / np.cosh(min(z, 700.0)) + np.cos(z))


def _loose(z):
    """The free-free beam's characteristic function over cosh z, its double root at 0 left out."""
    return float(1.0 / np.cosh(min(z, 700.0)) - np.cos(z)) if z > 1.0 else 1.0


def _roots(function, count):
    """Squares of the first `count` positive roots in z, none double."""
    found = []
    grid = np.linspace(0.02, np.pi * (count + 3), 400 * (count + 3))
    values = [function(float(z)) for z in grid]
    for a, b, fa, fb in zip(grid[:-1], grid[1:], values[:-1], values[1:], strict=True):
        if fa * fb < 0.0:
            found.append(float(brentq(function, a, b, xtol=1e-15, rtol=1e-15)))
        if len(found) == count:
            break
    return np.array(found) ** 2
