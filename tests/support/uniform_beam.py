"""The uniform Euler beam with L = EI = mass = 1 in one plane:
roots of its characteristic equations, and 50 digits."""

import mpmath
import numpy as np


def held_roots(count: int) -> np.ndarray:
    """beta L of the cantilever, cos cosh = -1, in double precision:
    a fixed point on cos z = -1 / cosh z."""
    z = (np.arange(count) + 0.5) * np.pi
    for _ in range(60):
        sign = np.where(np.arange(count) % 2, 1.0, -1.0)
        z = (np.arange(count) + 0.5) * np.pi - sign * np.arcsin(1.0 / np.cosh(np.minimum(z, 700.0)))
    return z


def free_roots(count: int) -> np.ndarray:
    """beta L of the free beam, cos cosh = 1 above zero."""
    n = np.arange(1, count + 1)
    z = (n + 0.5) * np.pi
    for _ in range(60):
        sign = np.where(n % 2, 1.0, -1.0)
        z = (n + 0.5) * np.pi + sign * np.arcsin(1.0 / np.cosh(np.minimum(z, 700.0)))
    return z


def dynamic_mass(z) -> np.ndarray:
    """`(2, 2)` at beta L = z in 50 digits, from the general solution with cosh and sinh."""
    with mpmath.workdps(50 + int(z)):
        z = mpmath.mpf(z)
        c = mpmath.cos(z)
        s = mpmath.sin(z)
        ch = mpmath.cosh(z)
        sh = mpmath.sinh(z)
        # w = a cos + b sin + c cosh + d sinh; rows: w(0), w'(0), w''(1), w'''(1)
        system = mpmath.matrix([[1, 0, 1, 0], [0, z, 0, z], [-c, -s, ch, sh], [s, -c, sh, ch]])
        out = np.empty((2, 2))
        for column in range(2):
            given = mpmath.zeros(4, 1)
            given[column] = 1
            a, b, c2, d = mpmath.lu_solve(system, given)
            force = z**3 * (d - b)
            moment = -(z**2) * (c2 - a)  # EI w''' and -EI w'' at the root
            out[0, column], out[1, column] = float(-force / z**4), float(-moment / z**4)
    return out


def are_coupled(frequencies: np.ndarray, hub: np.ndarray, tolerance: float) -> bool:
    """Whether these are the lowest frequencies on a hub `(2, 2)`, each within `tolerance`.

    det(hub + D) changes its sign there, and one lies between each frequency of the cantilever
    and of the free beam.
    """
    count = frequencies.size
    ends = [
        [
            np.linalg.det(hub + dynamic_mass(np.sqrt(w * (1.0 + side * tolerance))))
            for side in (-1.0, 1.0)
        ]
        for w in frequencies
    ]
    between = np.all(frequencies > held_roots(count) ** 2) and np.all(
        frequencies < free_roots(count) ** 2
    )
    return bool(between and all(left * right < 0.0 for left, right in ends))
