"""The transcendental solution of the uniform Euler beam, with exponentials where hyperbolic functions lose digits."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from beamchain.checks import positive
from beamchain.ports.motions import Array


def krylov(z: float) -> tuple[float, float, float, float]:
    """Krylov-Duncan functions `S, T, U, V` of z: `S = (cosh z + cos z) / 2`."""
    if abs(z) < 1.5:
        out: list[float] = []
        for start in range(4):
            term = z**start / float(np.prod(np.arange(1, start + 1)))
            total, k = 0.0, start
            while abs(term) > 1e-20 * abs(total) and term != 0.0:
                total += term
                term *= z**4 / ((k + 1) * (k + 2) * (k + 3) * (k + 4))
                k += 4
            out.append(total)
        return out[0], out[1], out[2], out[3]
    c, s, ch, sh = np.cos(z), np.sin(z), np.cosh(z), np.sinh(z)
    return float((ch + c) / 2), float((sh + s) / 2), float((ch - c) / 2), float((sh - s) / 2)


@dataclass(frozen=True)
class UniformBeam:
    """A uniform Euler beam in one bending plane.

    Args:
        length: [m].
        bending_stiffness: EI [N m^2].
        linear_mass: [kg/m].
    """

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
        m, length = self.linear_mass * self.length, self.length
        unit = np.array([[m, m * length], [m * length, m * length**2]])
        for k, w in enumerate(omega):
            out[:, :, k] = unit * self._unit_dynamic_mass(float(np.sqrt(w / self.unit_frequency)))
        return out

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
            tip = np.array([[s, t / z], [z * v, s]])  # w'', w''' from M0, Q0 (divided by their own)
            given = np.array([[z**2 * u, z * v], [z**3 * t, z**2 * u]])  # from w0, t0
            moment_shear = -np.linalg.solve(tip, given)
        else:
            # w = a cos + b sin + c e^(-z x) + d e^(-z (1 - x))
            e = np.exp(-z)
            c, s = np.cos(z), np.sin(z)
            system = np.array([[1, 0, 1, e], [0, z, -z, z * e], [-c, -s, e, 1], [s, -c, -e, 1]], dtype=np.float64)
            shape = np.linalg.solve(system, np.eye(4)[:, :2])
            moment_shear = np.array([[-(z**2), 0, z**2, z**2 * e], [0, -(z**3), -(z**3), z**3 * e]]) @ shape
        # wrench on the root for unit displacement: force = EI w''' , moment = -EI w''; acceleration = -omega^2
        wrench = np.vstack([moment_shear[1], -moment_shear[0]])
        out = wrench / -(z**4)
        return (out + out.T) / 2.0
