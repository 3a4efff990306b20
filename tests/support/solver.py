"""A spacecraft at a pose in finite elements: rigid bodies, hinges, beams, delivered modes, wheels.

`Craft` collects mass, damping and stiffness of what is put on it, over coordinates that begin with
the six motions of its base: displacement of the base's origin and rotation, in the base's axes.
Everything is linear about the pose, at rest but for wheels and for the tension of beams. A beam is
a row of elements of 12 freedoms after Euler and Bernoulli with consistent mass and geometric
stiffness; an appendage of `finite_elements` or of another program comes as modes. Nothing is
imported from the package. SI units, radians.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.linalg import eigh

from finite_elements import section_properties

GAUSS = leggauss(4)  # exact for the products of cubic shape functions


def cross(v):
    """`(3, 3)` with `cross(v) @ w` the cross product of v and w."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation(axis, angle):
    """`(3, 3)` about an axis of length 1 [rad]."""
    k = cross(axis)
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def moved(rows, arm):
    """Motion `(6, k)` of a point that lies `arm` from one that moves by `rows`, on one body."""
    out = np.array(rows)
    out[:3] -= cross(arm) @ rows[3:]
    return out


def body_mass(mass, centre=(0.0, 0.0, 0.0), inertia=(0.0, 0.0, 0.0)):
    """`(6, 6)` mass matrix of a rigid body, its inertia (three numbers or a matrix) about its
    centre."""
    inertia = np.asarray(inertia, dtype=float)
    inertia = np.diag(inertia) if inertia.ndim == 1 else inertia
    away = cross(centre)
    return np.block([[mass * np.eye(3), -mass * away], [mass * away, inertia - mass * away @ away]])


def normal_modes(mass, stiffness, shift=0.0):
    """Frequencies `(n,)`, ascending, and shapes of unit modal mass; of the inverse, so that slow
    modes keep their digits. `shift` [rad^2/s^2]: where something moves freely, which gets exactly
    zero; motions without mass are left out."""
    inverse, shapes = eigh(mass, stiffness + shift * mass)
    kept = np.flatnonzero(inverse > 1e-12 * inverse[-1])[::-1]
    squares = 1.0 / inverse[kept] - shift
    squares = np.where(squares < 1e-6 * shift, 0.0, squares)
    return np.sqrt(squares), shapes[:, kept] / np.sqrt(inverse[kept])


class Section(NamedTuple):
    """Stiffness and inertia per length of a prismatic member along its own x."""

    axial: float
    torsion: float
    bending_y: float  # about its own y axis
    bending_z: float
    mass: float
    polar: float


def section_of(segment):
    """The section of a uniform segment of a SPEC.toml."""
    at = section_properties(segment, 0.0)
    names = ("axial", "torsion", "bending_xz", "bending_xy", "mass", "polar")
    return Section(*(float(at[name]) for name in names))


class Modes(NamedTuple):
    """An appendage held at its root: `(n,)`, damping ratios (one or `(n,)`), force and moment
    `(n, 6)` at the root per modal acceleration, rigid mass `(6, 6)`, motion `(n, 6)` of the tip,
    which lies `length` along x."""

    frequencies: np.ndarray
    ratio: float | np.ndarray
    participation: np.ndarray
    rigid: np.ndarray
    tip: np.ndarray
    length: float = 0.0


@dataclass(frozen=True, eq=False)
class Frame:
    """Axes on a body: its motion `(6, k)` in the base's axes per coordinate so far, where it is,
    and its axes as columns `(3, 3)`."""

    rows: np.ndarray
    place: np.ndarray
    turn: np.ndarray

    def at(self, offset, turn=None):
        """A frame on the same body, its offset and axes in those of this one."""
        away = self.turn @ np.asarray(offset, dtype=float)
        axes = self.turn if turn is None else self.turn @ turn
        return Frame(moved(self.rows, away), self.place + away, axes)

    @property
    def own(self):
        """Its motion in its own axes."""
        return np.kron(np.eye(2), self.turn.T) @ self.rows


# -- beams -----------------------------------------------------------------------------------------
def element_rows(length, section):
    """Rows of an element whose squares sum to its energies: mass `(16, 12)`, stiffness `(6, 12)`,
    and slopes `(8, 12)`, whose squares are the geometric stiffness of a tension of 1.

    Freedoms: displacement and rotation of the first end, then of the second, in its own axes. The
    six natural strains are stretch, twist and in each plane symmetric and antisymmetric bending.
    """
    u, v, w, twist, v_turn, w_turn = (np.arange(12)[[i, i + 6]] for i in (0, 1, 2, 3, 5, 4))
    # slope of plane xy: rotation about z; of plane xz: less the rotation about y
    planes = ((v, v_turn, 1.0, section.bending_z), (w, w_turn, -1.0, section.bending_y))
    strain = np.zeros((6, 12))
    strain[0, u] = np.sqrt(section.axial / length) * np.array([-1.0, 1.0])
    strain[1, twist] = np.sqrt(section.torsion / length) * np.array([-1.0, 1.0])
    for k, (place, angle, sign, bending) in enumerate(planes):
        root = np.sqrt(bending / length)
        strain[2 + 2 * k, angle] = root * np.array([-1.0, 1.0])
        strain[3 + 2 * k, angle] = np.sqrt(3.0) * root * sign
        strain[3 + 2 * k, place] = np.sqrt(3.0) * root * 2.0 / length * np.array([1.0, -1.0])
    heavy = np.sqrt([section.mass, section.mass, section.mass, section.polar])
    mass, slope = [], []
    for xi, weight in zip(*GAUSS, strict=True):
        s = (1.0 + xi) / 2.0
        rows, slopes = np.zeros((4, 12)), np.zeros((2, 12))
        rows[0, u] = rows[3, twist] = 1.0 - s, s
        for k, (place, angle, sign, _) in enumerate(planes):
            rows[1 + k, place] = 1.0 - 3.0 * s**2 + 2.0 * s**3, 3.0 * s**2 - 2.0 * s**3
            rows[1 + k, angle] = sign * length * np.array([s - 2.0 * s**2 + s**3, s**3 - s**2])
            slopes[k, place] = np.array([-6.0, 6.0]) * (s - s**2) / length
            slopes[k, angle] = sign * np.array([1.0 - 4.0 * s + 3.0 * s**2, 3.0 * s**2 - 2.0 * s])
        share = np.sqrt(weight * length / 2.0)
        mass.append(share * heavy[:, None] * rows)
        slope.append(share * slopes)
    return np.vstack(mass), strain, np.vstack(slope)


def mesh(length, elements, section, tension=0.0):
    """Mass and stiffness `(6 n + 6,)` squared of a beam over the motions of its nodes, in its own
    axes, root first; `tension` [N], a number or a function of the distance from the root."""
    size, h = 6 * elements + 6, length / elements
    mass, stiffness = np.zeros((2, size, size))
    heavy, strain, slope = element_rows(h, section)
    points = h / 2.0 * np.repeat(1.0 + GAUSS[0], 2)
    for k in range(elements):
        both = slice(6 * k, 6 * k + 12)
        force = tension(h * k + points) if callable(tension) else tension
        mass[both, both] += heavy.T @ heavy
        stiffness[both, both] += strain.T @ strain + slope.T * force @ slope
    return mass, stiffness


# -- the craft -------------------------------------------------------------------------------------
class Craft:
    """What a spacecraft consists of, put on it piece by piece, carriers first.

    Example:
        >>> craft = Craft()
        >>> craft.body(craft.base, 300.0, inertia=(90.0, 90.0, 90.0))
        >>> elbow = craft.hinge(craft.base.at((0.5, 0.0, 0.0)), (0.0, 0.0, 1.0), angle=0.3)
        >>> tip = craft.beam(elbow, 4.0, 20, section, ratio=0.005)[-1]
        >>> mass, damping, stiffness = craft.matrices()
    """

    def __init__(self):
        self.size = 6
        self.base = Frame(np.eye(6), np.zeros(3), np.eye(3))
        self.hinges = []  # their coordinates
        self._terms = {"mass": [], "damping": [], "stiffness": []}
        self._locked = {}  # motion with the base of coordinates that are not relative

    def coordinates(self, count):
        """Their numbers."""
        self.size += count
        return np.arange(self.size - count, self.size)

    @property
    def locked(self):
        """`(size, 6)` motion of all coordinates with the base where nothing turns or bends."""
        out = np.eye(self.size, 6)
        for number, row in self._locked.items():
            out[number] = row
        return out

    def add(self, kind, rows, matrix):
        """`rows.T @ matrix @ rows` to "mass", "damping" or "stiffness"."""
        self._terms[kind].append((rows, np.asarray(matrix, dtype=float)))

    def body(self, frame, mass, centre=(0.0, 0.0, 0.0), inertia=(0.0, 0.0, 0.0)):
        """A rigid body, its centre and inertia in the axes of a frame."""
        self.add("mass", frame.own, body_mass(mass, centre, inertia))

    def hinge(self, frame, axis, angle=0.0, stiffness=0.0, damping=0.0, armature=0.0):
        """The frame behind a hinge about an axis of the frame before it."""
        number = self.coordinates(1)[0]
        self.hinges.append(number)
        rows = self.wide(frame.rows)
        rows[3:, number] += frame.turn @ np.asarray(axis, dtype=float)
        for kind, value in (("mass", armature), ("damping", damping), ("stiffness", stiffness)):
            self.add(kind, np.eye(1, self.size, number), [[value]])
        return Frame(rows, frame.place, frame.turn @ rotation(axis, angle))

    def links(self, frame, bodies, hinges):
        """Rigid bodies `(mass, x, inertia)` along x of a frame, and hinges `(x, stiffness)` about z
        between them."""
        start = 0.0
        for i, (mass, centre, inertia) in enumerate(bodies):
            if i:
                at, stiffness = hinges[i - 1]
                place = frame.at((at - start, 0.0, 0.0))
                frame, start = self.hinge(place, (0.0, 0.0, 1.0), stiffness=stiffness), at
            self.body(frame, mass, (centre - start, 0.0, 0.0), (0.0, 0.0, inertia))

    def wheel(self, frame, axis, mass, spin, across, rate=0.0, damping=0.0):
        """A wheel with its centre in a frame: inertia `spin` about its axis and `across`; `rate`
        [rad/s] against the frame's body."""
        axis = np.asarray(axis, dtype=float)
        number = self.coordinates(1)[0]
        rows = self.wide(frame.own)
        inertia = across * np.eye(3) + (spin - across) * np.outer(axis, axis)
        self.add("damping", rows[3:], -cross(axis * spin * rate))  # w x h
        self.add("damping", np.eye(1, self.size, number), [[damping]])
        rows = rows.copy()
        rows[3:, number] += axis
        self.add("mass", rows, body_mass(mass, inertia=inertia))

    def beam(self, frame, length, elements, section, ratio=0.0, tension=0.0):
        """The frames of a beam's nodes along x, its root first."""
        nodes = [frame]
        numbers = self.coordinates(6 * elements).reshape(elements, 6)
        for k, own in enumerate(numbers, 1):
            place = frame.place + frame.turn[:, 0] * (length * k / elements)
            self._locked.update(zip(own.tolist(), moved(np.eye(6), place), strict=True))
            nodes.append(Frame(np.eye(self.size)[own], place, frame.turn))
        self.elements(nodes, length, section, ratio, tension)
        return nodes

    def elements(self, nodes, length, section, ratio=0.0, tension=0.0):
        """A beam between the frames of its nodes, which lie evenly along x; `ratio` of critical
        damping in every mode of its free nodes with the root held."""
        count = len(nodes) - 1
        mass, stiffness = mesh(length, count, section, tension)
        rows = np.vstack([self.wide(node.own) for node in nodes])
        self.add("mass", rows, mass)
        self.add("stiffness", rows, stiffness)
        if ratio:
            squares, shapes = eigh(stiffness[6:, 6:], mass[6:, 6:])
            rigid = [moved(np.eye(6), (length * k / count, 0.0, 0.0)) for k in range(count + 1)]
            bent = rows - np.vstack(rigid) @ rows[:6]
            into = shapes.T @ mass[6:, 6:] @ bent[6:]
            self.add("damping", into, np.diag(2.0 * ratio * np.sqrt(squares)))

    def modes(self, frame, found):
        """The frame at the tip of an appendage given by its modes, and their coordinates."""
        w = np.asarray(found.frequencies, dtype=float)
        numbers = self.coordinates(w.size)
        root = self.wide(frame.own)
        own = np.eye(self.size)[numbers]
        across = np.block(
            [[found.rigid, found.participation.T], [found.participation, np.eye(w.size)]]
        )
        self.add("mass", np.vstack([root, own]), across)
        self.add("stiffness", own, np.diag(w**2))
        self.add("damping", own, np.diag(2.0 * np.asarray(found.ratio) * w))
        tip = frame.at((found.length, 0.0, 0.0))
        rows = self.wide(tip.rows)
        rows[:, numbers] += np.kron(np.eye(2), frame.turn) @ np.transpose(found.tip)
        return Frame(rows, tip.place, tip.turn), numbers

    def wide(self, rows):
        """Rows over all coordinates so far."""
        out = np.zeros((len(rows), self.size))
        out[:, : rows.shape[1]] = rows
        return out

    def matrices(self):
        """Mass, damping and stiffness over all coordinates."""
        out = []
        for terms in self._terms.values():
            total = np.zeros((self.size, self.size))
            for rows, matrix in terms:
                total[: rows.shape[1], : rows.shape[1]] += rows.T @ matrix @ rows
            out.append(total)
        return tuple(out)
