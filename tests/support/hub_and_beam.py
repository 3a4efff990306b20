"""A rigid hub with a uniform beam in a plane, in finite elements, under a smooth torque: the exact
answer in time. Nothing is imported from the package.

Cubic Hermite elements, consistent mass. Freedoms: displacement and rotation of the root, which
moves with the hub, then of every node outwards. Loads at a node are those of what lies beyond it
on what lies before it, from the element that begins there: `-(K u + M u'')`.

The torque is `T sin(w t)^3 = T (3 sin w t - sin 3 w t) / 4`, so that each mode has a closed form.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import eigh


@dataclass(frozen=True)
class HubAndBeam:
    """SI; the hub's centre is `offset` behind the root; a body sits on the tip."""

    length: float
    bending_stiffness: float
    linear_mass: float
    hub_mass: float
    hub_inertia: float
    offset: float
    elements: int = 100
    tip_mass: float = 0.0
    tip_inertia: float = 0.0

    @cached_property
    def element(self):
        """Stiffness and mass of one element."""
        h = self.length / self.elements
        k = np.array(
            [
                [12.0, 6.0 * h, -12.0, 6.0 * h],
                [6.0 * h, 4.0 * h**2, -6.0 * h, 2.0 * h**2],
                [-12.0, -6.0 * h, 12.0, -6.0 * h],
                [6.0 * h, 2.0 * h**2, -6.0 * h, 4.0 * h**2],
            ]
        )
        m = np.array(
            [
                [156.0, 22.0 * h, 54.0, -13.0 * h],
                [22.0 * h, 4.0 * h**2, 13.0 * h, -3.0 * h**2],
                [54.0, 13.0 * h, 156.0, -22.0 * h],
                [-13.0 * h, -3.0 * h**2, -22.0 * h, 4.0 * h**2],
            ]
        )
        return k * self.bending_stiffness / h**3, m * self.linear_mass * h / 420.0

    @cached_property
    def beam(self):
        """Stiffness and mass of the beam alone."""
        size = 2 * (self.elements + 1)
        stiffness = np.zeros((size, size))
        mass = np.zeros((size, size))
        for e in range(self.elements):
            own = slice(2 * e, 2 * e + 4)
            stiffness[own, own] += self.element[0]
            mass[own, own] += self.element[1]
        mass[-2:, -2:] += np.diag([self.tip_mass, self.tip_inertia])
        return stiffness, mass

    @property
    def hub(self):
        """`(2, 2)` mass of the hub about the root."""
        moved = self.hub_mass * self.offset
        return np.array([[self.hub_mass, -moved], [-moved, self.hub_inertia + moved * self.offset]])

    @cached_property
    def rigid(self):
        """`(size, 2)` motion of all freedoms with the root."""
        x = np.linspace(0.0, self.length, self.elements + 1)
        out = np.zeros((2 * x.size, 2))
        out[0::2, 0] = 1.0
        out[0::2, 1] = x
        out[1::2, 1] = 1.0
        return out

    def cantilever(self, count):
        """Frequencies and mass-normalised shapes `(size, count)` with the root held."""
        stiffness, mass = self.beam
        squares, shapes = eigh(stiffness[2:, 2:], mass[2:, 2:], subset_by_index=(0, count - 1))
        out = np.vstack([np.zeros((2, count)), shapes])
        signs = np.sign(self.rigid[:, 0] @ mass @ out)
        return np.sqrt(squares), out * signs

    def motion(self, basis, torque, omega, time):
        """Freedoms and accelerations `(size, t)` of the hub and beam on a basis `(size, k)`."""
        stiffness, mass = self.beam
        mass = mass.copy()
        mass[:2, :2] += self.hub
        squares, modes = eigh(basis.T @ stiffness @ basis, basis.T @ mass @ basis)
        modes = basis @ modes
        squares[:2] = 0.0  # rigid
        squares = squares[:, None]
        w = np.sqrt(squares)
        q = np.zeros((squares.size, time.size))
        a = np.zeros_like(q)
        for part, rate in ((0.75, omega), (-0.25, 3.0 * omega)):
            drive = np.sin(rate * time)
            with np.errstate(divide="ignore", invalid="ignore"):
                own = np.where(w > 0.0, np.sin(w * time) / w, time)
            shape = (drive - rate * own) / (squares - rate**2)
            q += part * shape
            a += part * (drive - squares * shape)
        force = torque * modes[1][:, None]
        return modes @ (q * force), modes @ (a * force)

    def held(self, basis, inputs, step):
        """Freedoms `(size, t)` at the starts of steps over which torques `(t,)` are held, and
        accelerations there just before and just behind."""
        stiffness, mass = self.beam
        mass = mass.copy()
        mass[:2, :2] += self.hub
        squares, modes = eigh(basis.T @ stiffness @ basis, basis.T @ mass @ basis)
        modes = basis @ modes
        squares[:2] = 0.0  # rigid
        w = np.sqrt(squares)
        cosine = np.cos(w * step)
        with np.errstate(divide="ignore", invalid="ignore"):
            sine = np.where(w > 0.0, np.sin(w * step) / w, step)
            rest = np.where(w > 0.0, (1.0 - cosine) / squares, step**2 / 2.0)
        q, v = np.zeros_like(w), np.zeros_like(w)
        states, before, behind = [], [], []
        last = 0.0
        for value in inputs:
            states.append(q)
            before.append(modes[1] * last - squares * q)
            behind.append(modes[1] * value - squares * q)
            force = modes[1] * value
            q, v = (
                cosine * q + sine * v + rest * force,
                cosine * v - squares * sine * q + sine * force,
            )
            last = value
        return tuple(modes @ np.array(rows).T for rows in (states, before, behind))

    @property
    def whole(self):
        """The basis of all freedoms."""
        return np.eye(2 * (self.elements + 1))

    def node(self, x):
        """Number of the node at x."""
        number = round(x / self.length * self.elements)
        assert abs(number * self.length / self.elements - x) < 1e-9 * self.length
        return number

    def load(self, x, moved, accelerated):
        """`(2, t)` shear force and moment at a node."""
        first = 2 * self.node(x)
        own = slice(first, first + 4)
        stiffness, mass = self.element
        return -(stiffness @ moved[own] + mass @ accelerated[own])[:2]

    def strain_load(self, x, frequencies, shapes):
        """`(2, count)` shear force and moment at a node by the strain of cantilever modes."""
        return self.load(x, shapes, -shapes * frequencies**2)
