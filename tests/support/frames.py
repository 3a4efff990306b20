"""Frames of beams out of one axis (L-shapes, skew legs),
and modes files as another program would deliver them.

Elements of `solver` in any direction, bodies at nodes. As in `finite_elements`, stiffness and mass
are kept as rows. Nothing is imported from the package.
"""

import json
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from finite_elements import strained
from solver import Section, element_rows, moved

SAME = 1e-6  # of a length's unit: two nodes closer than that are one


@dataclass(frozen=True)
class Leg:
    """A prismatic member between two points, cut into `elements`."""

    start: tuple
    end: tuple
    elements: int
    section: Section


@dataclass(frozen=True)
class Body:
    """A rigid body at a point: mass and inertia about its centre, in the axes of the frame."""

    at: tuple
    mass: float
    inertia: tuple = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class FrameModes:
    """Modes about the port in SI: `(n,)`, `(n, 6)`, `(n, 6)` motion of the tip,
    `(6, 6)` rigid mass, length along x."""

    frequencies: np.ndarray
    participation: np.ndarray
    tip: np.ndarray
    rigid: np.ndarray
    length: float
    everything: np.ndarray  # `(6, 6)` effective mass of all modes of the mesh


def _axes(direction):
    """Rows: a member's own x, y, z; its z lies as near the frame's z as can be (the frame's y
    for upright members)."""
    x = direction / np.linalg.norm(direction)
    up = np.array([0.0, 0.0, 1.0]) if abs(x[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    y = np.cross(up, x)
    y /= np.linalg.norm(y)
    return np.array([x, y, np.cross(x, y)])


def element(a, b, leg):
    """Rows of mass `(16, 12)`, the same of rigid motion about the origin `(16, 6)`, and rows of
    stiffness `(6, 12)`."""
    heavy, strain, _ = element_rows(float(np.linalg.norm(b - a)), leg.section)
    own = np.kron(np.eye(4), _axes(b - a))
    still = np.vstack([moved(np.eye(6), a), moved(np.eye(6), b)])
    return heavy @ own, heavy @ own @ still, strain @ own


def nodes_of(legs, first):
    """Nodes of members, those at some places first, and the elements: (node, node, leg)."""
    nodes = [np.asarray(place, dtype=float) for place in first]
    elements = []
    for leg in legs:
        a, b = np.asarray(leg.start, dtype=float), np.asarray(leg.end, dtype=float)
        places = [a + (b - a) * k / leg.elements for k in range(leg.elements + 1)]
        for place in places:
            if node_at(nodes, place) is None:
                nodes.append(place)
        ends = [node_at(nodes, place) for place in places]
        elements += [(i, j, leg) for i, j in pairwise(ends)]
    return nodes, elements


def node_at(nodes, place):
    """Its number; None: there is none."""
    apart = np.linalg.norm(np.array(nodes) - place, axis=1)
    return int(np.argmin(apart)) if apart.min() < SAME else None


def frame_modes(legs, bodies=(), modes=8, port=(0.0, 0.0, 0.0), tip=None):
    """Modes of a frame held at its port.

    Args:
        legs: members; ends at the same place are joined rigidly.
        bodies: rigid bodies at ends of members.
        modes: how many.
        port: where it is held; all results are about that point, in the frame's axes.
        tip: where the motion is read; the end of the last leg where left out.
    """
    port = np.asarray(port, dtype=float)
    nodes, members = nodes_of(legs, [port])
    size = 6 * len(nodes)

    def wide(rows, *at):
        out = np.zeros((rows.shape[0], size))
        for k, i in enumerate(at):
            out[:, 6 * i : 6 * i + 6] = rows[:, 6 * k : 6 * k + 6]
        return out

    mass, rigid, stiff = [], [], []
    for i, j, leg in members:
        m, r, s = element(nodes[i] - port, nodes[j] - port, leg)
        mass.append(wide(m, i, j))
        rigid.append(r)
        stiff.append(wide(s, i, j))
    for body in bodies:
        i = node_at(nodes, body.at)
        root = np.diag(np.sqrt([body.mass] * 3 + list(body.inertia)))
        mass.append(wide(root, i))
        rigid.append(root @ moved(np.eye(6), nodes[i] - port))
    moving = np.vstack(mass)[:, 6:]
    carried = np.vstack(rigid)
    strain = np.vstack(stiff)[:, 6:]
    elastic, back = strained(strain, moving)
    left, values, right = np.linalg.svd(elastic, full_matrices=False)
    shapes = back @ right.T / values
    participation = left.T @ carried
    far = node_at(nodes, legs[-1].end if tip is None else tip) - 1
    motion = shapes[6 * far : 6 * far + 6].T
    n = min(modes, values.size)
    return FrameModes(
        1.0 / values[:n],
        participation[:n],
        motion[:n],
        carried.T @ carried,
        float(max(p[0] for p in nodes) - port[0]),
        participation.T @ participation,
    )


# -- the frames that are tried ---------------------------------------------------------------------
def tube(start, end, elements, diameter=0.05, wall=0.002, young=7e10, density=2700.0, poisson=0.33):
    """A round tube as a leg."""
    inner = diameter - 2.0 * wall
    area = np.pi / 4.0 * (diameter**2 - inner**2)
    i = np.pi / 64.0 * (diameter**4 - inner**4)
    shear = young / 2.0 / (1.0 + poisson)
    bending = young * i
    section = Section(
        young * area, 2.0 * shear * i, bending, bending, density * area, 2.0 * density * i
    )
    return Leg(tuple(start), tuple(end), elements, section)


def strip(
    start, end, elements, width=0.1, thickness=0.01, young=7e10, density=2700.0, poisson=0.33
):
    """A flat strip, soft about its own y axis (its normal lies near the frame's z)."""
    area = width * thickness
    soft = width * thickness**3 / 12.0
    hard = thickness * width**3 / 12.0
    twist = width * thickness**3 / 3.0 * (1.0 - 0.63 * thickness / width)
    shear = young / 2.0 / (1.0 + poisson)
    section = Section(
        young * area,
        shear * twist,
        young * soft,
        young * hard,
        density * area,
        density * (soft + hard),
    )
    return Leg(tuple(start), tuple(end), elements, section)


def l_frame(seed, modes):
    """An L or a skew three-legged frame: the first leg along x, then out of the axis;
    bodies at corner and end."""
    rng = np.random.default_rng(7000 + seed)
    first = rng.uniform(1.0, 4.0)
    corner = np.array([first, 0.0, 0.0])
    way = (
        np.array([0.0, 1.0, 0.0]),
        np.array([0.0, 0.0, 1.0]),
        np.array([0.0, -0.8, 0.6]),
        rng.normal(size=3),
    )[seed % 4]
    end = corner + rng.uniform(0.3, 1.2) * first * way / np.linalg.norm(way)
    legs = [
        tube((0.0, 0.0, 0.0), corner, 6, rng.uniform(0.03, 0.08), rng.uniform(0.001, 0.003)),
        (tube if seed % 2 else strip)(corner, end, 6),
    ]
    if seed % 3 == 2:
        legs.append(strip(end, end + np.array([rng.uniform(0.2, 0.8), 0.0, 0.1]), 3, 0.06, 0.008))
    bodies = [Body(tuple(end), rng.uniform(0.2, 3.0), tuple(rng.uniform(0.02, 0.04, 3)))]
    if seed % 2:
        bodies.append(Body(tuple(corner), rng.uniform(0.1, 1.0)))
    return frame_modes(legs, bodies, modes)


def turned_axes(seed):
    """A right-handed orthonormal set of axes, rows."""
    q, r = np.linalg.qr(np.random.default_rng(9000 + seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0.0 else q[[1, 0, 2]]


# -- files -----------------------------------------------------------------------------------------
def as_delivered(found, length=1.0, mass=1.0, axes=None, reference=(0.0, 0.0, 0.0)):
    """The modes in a file's units and axes, about a file's reference point.

    Args:
        found: FrameModes in SI, the appendage's axes, about the port.
        length, mass: metres per unit of length, kilograms per unit of mass (mm, tonnes: 1e-3, 1e3).
        axes: rows: appendage x, y, z in the file's axes.
        reference: the port from the file's reference point, in the file's axes and units.
    """
    turn = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    away = np.asarray(reference, dtype=float) * length
    both = np.block([[turn, np.zeros((3, 3))], [np.zeros((3, 3)), turn]])
    # motion of the port (appendage axes) per motion of the reference point (file axes):
    # v + omega x away
    move = both @ moved(np.eye(6), away)
    unit = np.array([1.0] * 3 + [length] * 3)
    rigid = move.T @ found.rigid @ move
    return {
        "frequencies": found.frequencies,
        "participation": (found.participation @ move) / unit / np.sqrt(mass),
        "mass": rigid / np.outer(unit, unit) / mass,
        "tip": (found.tip @ both) * unit * np.sqrt(mass),
        "length": found.length / length,
    }


def write_modes(
    path,
    found,
    length=1.0,
    mass=1.0,
    axes=None,
    reference=(0.0, 0.0, 0.0),
    damping=0.005,
    hertz=False,
):
    """Write a modes file (.toml or .json) and return the `[imported]` table that takes it back
    to SI and the port."""
    given = as_delivered(found, length, mass, axes, reference)
    w = given["frequencies"]
    keys = {
        "frequencies_hz" if hertz else "frequencies": (w / 2.0 / np.pi if hertz else w).tolist(),
        "participation": given["participation"].T.tolist(),
        "mass": given["mass"].tolist(),
        "damping": [damping] * len(w),
        "digits": 17,
        "tip": given["tip"].T.tolist(),
        "length": given["length"],
    }
    path = Path(path)
    if path.suffix == ".json":
        path.write_text(json.dumps(keys))
    else:
        path.write_text("".join(f"{key} = {json.dumps(value)}\n" for key, value in keys.items()))
    turn = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    return {
        "file": path.name,
        "reference": [float(v) for v in reference],
        "axes": turn.tolist(),
        "units": {"length": length, "mass": mass},
    }
