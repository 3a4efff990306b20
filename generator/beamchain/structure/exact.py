"""The transcendental solution of the uniform Euler beam, against which the elements are tested.

Initial parameters with Krylov-Duncan functions for short waves, decaying exponentials from both
ends for long beams in short waves, so that neither cancellation nor overflow costs digits.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from beamchain.checks import positive
from beamchain.ports.motions import Array


def krylov(z: float) -> tuple[float, float, float, float]:
    """Krylov-Duncan functions `S, T, U, V` of z: `S = (cosh z + cos z) / 2`,
    each the integral of the one before."""
    if abs(z) < 1.5:
        s, t, u, v = (_krylov_series(z, start) for start in range(4))
        return s, t, u, v
    c = np.cos(z)
    s = np.sin(z)
    ch = np.cosh(z)
    sh = np.sinh(z)
    return float((ch + c) / 2), float((sh + s) / 2), float((ch - c) / 2), float((sh - s) / 2)


def _krylov_series(z: float, start: int) -> float:
    """`z^k / k!` summed over `k = start, start + 4, ...`, where the closed form cancels."""
    term = z**start / float(np.prod(np.arange(1, start + 1)))
    total = 0.0
    k = start
    while abs(term) > 1e-20 * abs(total) and term != 0.0:
        total += term
        term *= z**4 / ((k + 1) * (k + 2) * (k + 3) * (k + 4))
        k += 4
    return total


@dataclass(frozen=True)
class UniformBeam:
    """A uniform Euler beam in one bending plane: [m], EI [N m^2], [kg/m]."""

    length: float
    bending_stiffness: float
    linear_mass: float

    def __post_init__(self) -> None:
        positive("length", self.length, "m")
        positive("bending_stiffness", self.bending_stiffness, "N m^2")
        positive("linear_mass", self.linear_mass, "kg/m")

    @property
    def unit_frequency(self) -> float:
        """`sqrt(EI / (m L^4))` [rad/s]: frequencies are (beta L)^2 times this."""
        return float(np.sqrt(self.bending_stiffness / self.linear_mass) / self.length**2)

    def D(self, omega: ArrayLike) -> Array:  # noqa: N802 (the field's letter)
        """Dynamic mass `(2, 2, k)` at `omega` `(k,)` [rad/s], free tip, no damping."""
        omega = np.atleast_1d(np.asarray(omega, dtype=np.float64))
        out = np.empty((2, 2, omega.size))
        for k, w in enumerate(omega):
            z = float(np.sqrt(w / self.unit_frequency))
            out[:, :, k] = self._unit_masses * self._unit_dynamic_mass(z)
        return out

    @property
    def _unit_masses(self) -> Array:
        """`(2, 2)` mass, `m L` and `m L^2` of the beam: units of its mass matrix."""
        m = self.linear_mass * self.length
        length = self.length
        return np.array([[m, m * length], [m * length, m * length**2]])

    def W(self, omega: ArrayLike) -> Array:  # noqa: N802
        """Accelerance `(2, 2, k)` at `omega` `(k,)` [rad/s]."""
        inverse = np.linalg.inv(np.moveaxis(self.D(omega), -1, 0))
        return np.moveaxis(np.asarray(inverse, dtype=np.float64), 0, -1)

    @staticmethod
    def _unit_dynamic_mass(z: float) -> Array:
        """Dynamic mass of the beam with L = m = EI = 1 at `z = beta L`."""
        if z == 0.0:
            return np.array([[1.0, 0.5], [0.5, 1.0 / 3.0]])
        if z < 6.0:
            # w(x) = w0 S + t0 T / z + M0 U / z^2 + Q0 V / z^3 with w'' = M0, w''' = Q0 at the root;
            # zero moment and shear at the tip give M0, Q0
            s, t, u, v = krylov(z)
            from_load = np.array([[s, t / z], [z * v, s]])  # w'', w''' at the tip from M0, Q0
            from_motion = np.array([[z**2 * u, z * v], [z**3 * t, z**2 * u]])  # from w0, t0
            moment_shear = -np.linalg.solve(from_load, from_motion)
        else:
            # w = a cos z x + b sin z x + c e^(-z x) + d e^(-z (1 - x)); w and w' are given at the
            # root, w'' and w''' vanish at the tip
            e = np.exp(-z)
            c = np.cos(z)
            s = np.sin(z)
            root = [[1.0, 0.0, 1.0, e], [0.0, z, -z, z * e]]
            tip = [[-c, -s, e, 1.0], [s, -c, -e, 1.0]]
            shape = np.linalg.solve(np.array(root + tip, dtype=np.float64), np.eye(4)[:, :2])
            root_moment = [-(z**2), 0.0, z**2, z**2 * e]
            root_shear = [0.0, -(z**3), -(z**3), z**3 * e]
            moment_shear = np.array([root_moment, root_shear]) @ shape
        # wrench on the root for unit displacement: force = EI w''' , moment = -EI w'';
        # acceleration = -omega^2
        wrench = np.vstack([moment_shear[1], -moment_shear[0]])
        out = wrench / -(z**4)
        return (out + out.T) / 2.0

    def coupled_frequencies(self, hub_mass: ArrayLike, count: int) -> Array:
        """`(count,)` frequencies [rad/s] of the beam on a free hub with mass matrix `(2, 2)`
        about the port.

        Zero gives the free-free beam. Roots of `det(M_hub + D)` by bracketing
        between the poles of D.
        """
        hub = np.asarray(hub_mass, dtype=np.float64) / self._unit_masses
        if not np.any(hub):
            return _roots(_free_function, count) * self.unit_frequency

        def characteristic(z: float) -> float:
            # the cantilever's function takes the poles of D away
            determinant = float(np.linalg.det(hub + self._unit_dynamic_mass(z)))
            return determinant * _cantilever_function(z)

        return _roots(characteristic, count) * self.unit_frequency

    def cantilever_frequencies(self, count: int) -> Array:
        """`(count,)` frequencies [rad/s] of the clamped-free beam: `1 + cos cosh = 0`."""
        return _roots(_cantilever_function, count) * self.unit_frequency


def _cantilever_function(z: float) -> float:
    """The cantilever's characteristic function over cosh z."""
    return float(1.0 / np.cosh(min(z, 700.0)) + np.cos(z))


def _free_function(z: float) -> float:
    """The free-free beam's characteristic function over cosh z, its double root at 0 left out."""
    if z <= 1.0:
        return 1.0
    return float(1.0 / np.cosh(min(z, 700.0)) - np.cos(z))


def _roots(function: Callable[[float], float], count: int) -> Array:
    """Squares of the first `count` positive roots in z, none double."""
    roots: list[float] = []
    grid = np.linspace(0.02, np.pi * (count + 3), 400 * (count + 3))
    values = [function(float(z)) for z in grid]
    for i in range(grid.size - 1):
        if values[i] * values[i + 1] < 0.0:
            roots.append(float(brentq(function, grid[i], grid[i + 1], xtol=1e-15, rtol=1e-15)))
        if len(roots) == count:
            break
    return np.array(roots) ** 2
