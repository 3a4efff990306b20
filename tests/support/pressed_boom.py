"""A uniform boom with a mass at its tip, held or on a free bus that is pushed along it, in one
bending plane: finite elements with geometric stiffness. Nothing is imported from the package."""

import numpy as np
from scipy.linalg import eigh

GAUSS = np.polynomial.legendre.leggauss(4)


def elements(length, bending, line, tip, acceleration, count=40):
    """Mass, stiffness and what is lost of it while the root accelerates along x, outwards, over the
    deflection and slope of `count + 1` nodes."""
    h = length / count
    size = 2 * count + 2
    mass, stiffness, lost = np.zeros((3, size, size))
    hermite = [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]]
    hermite += [[-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]
    weight = [[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2]]
    weight += [[54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]
    for e in range(count):
        block = np.ix_(range(2 * e, 2 * e + 4), range(2 * e, 2 * e + 4))
        stiffness[block] += bending / h**3 * np.array(hermite)
        mass[block] += line * h / 420 * np.array(weight)
        for point, share in zip((GAUSS[0] + 1) / 2, GAUSS[1] / 2, strict=True):
            pressed = acceleration * (tip + line * (length - (e + point) * h))
            bow = (6 * point**2 - 6 * point) / h
            slope = np.array([bow, 1 - 4 * point + 3 * point**2, -bow, 3 * point**2 - 2 * point])
            lost[block] += share * h * pressed * np.outer(slope, slope)
    mass[-2, -2] += tip
    return mass, stiffness, lost


def clamped(length, bending, line, tip, acceleration=0.0):
    """First frequency with the root held [rad/s]."""
    mass, stiffness, lost = (
        part[2:, 2:] for part in elements(length, bending, line, tip, acceleration)
    )
    return float(np.sqrt(eigh(stiffness - lost, mass, eigvals_only=True)[0]))


def along(length, bending, line, tip, share):
    """Acceleration along the boom that lowers the first frequency by a share of it [m/s^2]."""
    goal = (1.0 - share) * clamped(length, bending, line, tip)
    mass, stiffness, lost = (part[2:, 2:] for part in elements(length, bending, line, tip, 1.0))
    # (K - w^2 M) x = a G x at the frequency w that is left
    return float(1.0 / eigh(lost, stiffness - goal**2 * mass, eigvals_only=True)[-1])


def squares(length, bending, line, tip, bus, inertia, root, thrust):
    """Squares of the frequencies of the free whole, ascending; the thrust stays with the bus.

    `bus`, `inertia`: about its mass centre, where it is pushed; `root`: from there [m].
    """
    acceleration = thrust / (bus + line * length + tip)
    mass, stiffness, lost = elements(length, bending, line, tip, acceleration)
    size = len(mass)
    moved = np.eye(size)  # motion of the bus, and of the nodes against it
    moved[0::2, 0] = 1.0
    moved[0::2, 1] = root + np.linspace(0.0, length, size // 2)
    moved[1::2, 1] = 1.0
    mass, stiffness, lost = (moved.T @ part @ moved for part in (mass, stiffness, lost))
    stiffness[:2] = stiffness[:, :2] = 0.0
    mass[0, 0] += bus
    mass[1, 1] += inertia
    lost[1, 1] += acceleration * (tip + line * length) * root
    lost[0, 1] += thrust
    found = np.linalg.eigvals(np.linalg.solve(mass, stiffness - lost))
    elastic = np.delete(found, np.argsort(np.abs(found))[:2])
    return elastic[np.argsort(elastic.real)]
