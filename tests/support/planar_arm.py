"""A planar arm of two flexible links on a free bus, geometrically exact, and its slew at the elbow.

Each link is an inextensible rod without rotary inertia whose curvature is a polynomial, so that the
angle of its sections is one too; places are integrals of the angle's sine and cosine, by Gauss
points. Nothing is expanded for small motion: foreshortening and centrifugal terms are there. With
`e(a) = (cos a, sin a)` every mass point is `c_j = C + sum_k L_jk e(a_k)`, C the centre of mass, at
rest, and with `A = L^T m L` the equations over the angles, `a = B z`, are

    B^T [(A * cos(a_k - a_l) + J) B z'' + (A * sin(a_k - a_l)) a'^2] + K z = Q

Nothing is imported from the package.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

POINTS = 14  # Gauss points of a link
GRID = 4000  # points of the torque over a slew


@dataclass(frozen=True)
class Rod:
    """A uniform link: length [m], bending stiffness [N m^2], mass per length [kg/m]."""

    length: float
    stiffness: float
    linear_mass: float


@dataclass(frozen=True)
class PlanarArm:
    """Bus, upper link, elbow, fore link and hand.

    Attributes:
        degree: of the curvature's polynomial; -1: rigid links.
        masses, inertias: of bus, elbow and hand.
        shoulder: distance from the bus's centre to the root [m].
    """

    upper: Rod
    fore: Rod
    masses: tuple
    inertias: tuple
    shoulder: float
    degree: int = 5

    @cached_property
    def _parts(self):
        """Rows of B, and L, masses, inertias, K; angles: bus, upper's points and end, elbow's
        body, fore's points and end."""
        n = self.degree + 1
        x, w = legendre.leggauss(POINTS)
        # integral from -1 to each point and to 1, of what has values at the points
        basis = legendre.legvander(x, POINTS - 1)
        up = np.array(
            [
                legendre.legval(np.append(x, 1.0), legendre.legint(row, lbnd=-1.0))
                for row in np.eye(POINTS)
            ]
        ).T
        fit = (basis * w[:, None]).T * (2.0 * np.arange(POINTS)[:, None] + 1.0) / 2.0
        integral = up @ fit  # (points + 1, points)
        bends = np.array(
            [
                legendre.legval(np.append(x, 1.0), legendre.legint(row, lbnd=-1.0))
                for row in np.eye(max(n, 1))[:n]
            ]
        ).reshape(n, POINTS + 1)
        size = 2 + 2 * n
        angles = 2 * POINTS + 4
        first, elbow, second = 1, POINTS + 2, POINTS + 3
        b = np.zeros((angles, size))
        b[:, 0] = 1.0
        for at, rod, start in ((first, self.upper, 1), (second, self.fore, 2 + n)):
            rows = slice(at, at + POINTS + 1)
            b[rows, start : start + n] = rod.length / 2.0 * bends.T
            if at == first:  # what follows turns with the end
                b[elbow:, start : start + n] = b[at + POINTS, start : start + n]
                b[elbow:, 1 + n] = 1.0
        stiffness = np.zeros(size)
        for rod, start in ((self.upper, 1), (self.fore, 2 + n)):
            shares = rod.length / (2.0 * np.arange(n) + 1.0)
            stiffness[start : start + n] = rod.stiffness * shares
        # mass points from the bus's centre: bus, upper's, elbow, fore's, hand
        rows, masses = [np.zeros(angles)], [self.masses[0]]
        root = np.zeros(angles)
        root[0] = self.shoulder
        for at, rod, body in ((first, self.upper, 1), (second, self.fore, 2)):
            for k in range(POINTS + 1):
                row = root.copy()
                row[at : at + POINTS] += rod.length / 2.0 * integral[k]
                rows.append(row)
                masses.append(
                    rod.linear_mass * rod.length / 2.0 * w[k] if k < POINTS else self.masses[body]
                )
            root = rows[-1]
        masses, rows = np.array(masses), np.array(rows)
        inertia = np.zeros(angles)
        inertia[[0, elbow, angles - 1]] = self.inertias
        relative = rows - masses @ rows / masses.sum()
        return b, relative, masses, inertia, stiffness

    def _equations(self, z, rate):
        """Mass over z, and what stands on the left beside it without stiffness."""
        b, _, _, inertia, _ = self._parts
        a, turning = b @ z, b @ rate
        pair = self._pair
        apart = a[:, None] - a[None, :]
        mass = b.T @ ((pair * np.cos(apart) + np.diag(inertia)) @ b)
        return mass, b.T @ ((pair * np.sin(apart)) @ turning**2)

    @cached_property
    def _pair(self):
        _, rows, masses, _, _ = self._parts
        return rows.T @ (masses[:, None] * rows)

    @property
    def elbow(self):
        """Number of the elbow's angle in z."""
        return self.degree + 2

    def accelerations(self, z, rate, torque):
        """z'' under a torque on the elbow."""
        mass, left = self._equations(z, rate)
        load = -left - self._parts[4] * z
        load[self.elbow] += torque
        return np.linalg.solve(mass, load)

    def seen(self, z):
        """Angles of bus and hand, and places of bus and hand from where the bus was."""
        b, rows, *_ = self._parts
        a = b @ z
        places = rows @ np.column_stack([np.cos(a), np.sin(a)])
        shift = np.array([-np.sum(rows[0]), 0.0])
        return a[0], a[-1], places[0] + shift, places[-1] + shift


def profile(time, angle, duration):
    """Angle, rate and acceleration of a turn along the polynomial of degree 7."""
    s = np.clip(time / duration, 0.0, 1.0)
    curve = np.polynomial.Polynomial([0, 0, 0, 0, 35.0, -84.0, 70.0, -20.0])
    slope = curve.deriv()
    return (
        angle * curve(s),
        angle / duration * slope(s),
        angle / duration**2 * slope.deriv()(s),
    )


def torque(rigid, time, bus, bus_rate, angle, duration):
    """Torque on the elbow that turns the rigid arm along the profile; acceleration of the bus."""
    place, rate, acceleration = profile(time, angle, duration)
    mass, left = rigid._equations(np.array([bus, place]), np.array([bus_rate, rate]))
    bus_acceleration = (-left[0] - mass[0, 1] * acceleration) / mass[0, 0]
    return mass[1, 0] * bus_acceleration + mass[1, 1] * acceleration + left[1], bus_acceleration


class Push:
    """The torque on the elbow at any time of a slew, and the rigid arm under it."""

    def __init__(self, arm, angle, duration, end):
        self.turn = angle, duration
        self.rigid = replace(arm, degree=-1)
        self._bus = solve_ivp(
            lambda t, s: [s[1], torque(self.rigid, t, *s, *self.turn)[1]],
            (0.0, end),
            [0.0, 0.0],
            "DOP853",
            dense_output=True,
            rtol=1e-11,
            atol=1e-13,
        ).sol
        times = np.linspace(0.0, end, GRID)
        self._torque = CubicSpline(
            times, [torque(self.rigid, t, *self._bus(t), *self.turn)[0] for t in times]
        )

    def __call__(self, time):
        return float(self._torque(time))

    def means(self, timestep, count):
        """Of the torque over steps."""
        return np.diff(self._torque.antiderivative()(timestep * np.arange(count + 1))) / timestep

    def seen(self, time):
        """As `PlanarArm.seen`, of the rigid arm."""
        return self.rigid.seen(np.array([self._bus(time)[0], profile(time, *self.turn)[0]]))


def slew(arm, push, times):
    """The arm seen at `times`, its elbow driven by the torques of the rigid one."""
    n = arm._parts[0].shape[1]

    def slope(time, state):
        return np.concatenate([state[n:], arm.accelerations(state[:n], state[n:], push(time))])

    done = solve_ivp(
        slope, (0.0, times[-1]), np.zeros(2 * n), "DOP853", times, rtol=1e-9, atol=1e-11
    )
    assert done.success, done.message
    return [arm.seen(z) for z in done.y[:n].T]
