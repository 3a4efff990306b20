"""A rigid hub with a uniform beam of `solver` in a plane, under a smooth torque: the exact answer
in time. Nothing is imported from the package.

Freedoms: displacement and rotation of the root, which moves with the hub, then of every node
outwards. Loads at a node are those of what lies beyond it on what lies before it, from the element
that begins there: `-(K u + M u'')`.

The torque is `T sin(w t)^3 = T (3 sin w t - sin 3 w t) / 4`, so that each mode has a closed form.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from solver import Section, body_mass, mesh, normal_modes

PLANE = [1, 5]  # of the motions of a node: displacement y, rotation about z


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

    def _mesh(self, elements):
        """Stiffness and mass of the first elements."""
        bending = self.bending_stiffness
        section = Section(0.0, 0.0, bending, bending, self.linear_mass, 0.0)
        mass, stiffness = mesh(self.length * elements / self.elements, elements, section)
        own = np.flatnonzero(np.isin(np.arange(len(mass)) % 6, PLANE))
        return stiffness[np.ix_(own, own)], mass[np.ix_(own, own)]

    @cached_property
    def beam(self):
        """Stiffness and mass of the beam alone."""
        stiffness, mass = self._mesh(self.elements)
        mass[-2:, -2:] += np.diag([self.tip_mass, self.tip_inertia])
        return stiffness, mass

    @cached_property
    def rigid(self):
        """`(size, 2)` motion of all freedoms with the root."""
        x = np.linspace(0.0, self.length, self.elements + 1)
        return np.column_stack([np.tile([1.0, 0.0], x.size), np.stack([x, x**0.0], 1).ravel()])

    def cantilever(self, count):
        """Frequencies and mass-normalised shapes `(size, count)` with the root held."""
        stiffness, mass = self.beam
        w, shapes = normal_modes(mass[2:, 2:], stiffness[2:, 2:])
        out = np.vstack([np.zeros((2, count)), shapes[:, :count]])
        signs = np.sign(self.rigid[:, 0] @ mass @ out)
        return w[:count], out * signs

    def modes(self, basis):
        """Frequencies and mass-normalised shapes `(size, k)` of the hub and beam on a basis."""
        stiffness, mass = self.beam
        mass = mass.copy()
        hub = body_mass(self.hub_mass, (-self.offset, 0.0, 0.0), (0.0, 0.0, self.hub_inertia))
        mass[:2, :2] += hub[np.ix_(PLANE, PLANE)]
        w, modes = normal_modes(basis.T @ mass @ basis, basis.T @ stiffness @ basis, 1.0)
        return w, basis @ modes

    def motion(self, basis, torque, omega, time):
        """Freedoms and accelerations `(size, t)` of the hub and beam on a basis `(size, k)`."""
        w, modes = self.modes(basis)
        w = w[:, None]
        q, a = np.zeros((2, w.size, time.size))
        for part, rate in ((0.75, omega), (-0.25, 3.0 * omega)):
            drive = np.sin(rate * time)
            with np.errstate(divide="ignore", invalid="ignore"):
                own = np.where(w > 0.0, np.sin(w * time) / w, time)
            shape = (drive - rate * own) / (w**2 - rate**2)
            q += part * shape
            a += part * (drive - w**2 * shape)
        force = torque * modes[1][:, None]
        return modes @ (q * force), modes @ (a * force)

    def held(self, basis, inputs, step):
        """Freedoms `(size, t)` at the starts of steps over which torques `(t,)` are held, and
        accelerations there just before and just behind."""
        w, modes = self.modes(basis)
        cosine = np.cos(w * step)
        with np.errstate(divide="ignore", invalid="ignore"):
            sine = np.where(w > 0.0, np.sin(w * step) / w, step)
            rest = np.where(w > 0.0, (1.0 - cosine) / w**2, step**2 / 2.0)
        q, v = np.zeros_like(w), np.zeros_like(w)
        states, before, behind = [], [], []
        last = 0.0
        for value in inputs:
            states.append(q)
            before.append(modes[1] * last - w**2 * q)
            behind.append(modes[1] * value - w**2 * q)
            force = modes[1] * value
            q, v = cosine * q + sine * v + rest * force, cosine * v - w**2 * sine * q + sine * force
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
        stiffness, mass = self._mesh(1)
        return -(stiffness @ moved[own] + mass @ accelerated[own])[:2]

    def strain_load(self, x, frequencies, shapes):
        """`(2, count)` shear force and moment at a node by the strain of cantilever modes."""
        return self.load(x, shapes, -shapes * frequencies**2)
