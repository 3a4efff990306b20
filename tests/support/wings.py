"""The shipped array of three panels a side in three-dimensional finite elements, its panels rigid
in their own plane and along it.

Every panel is a row of the elements of `arms`, whose nodes move across the panel and turn with it;
what they do in its plane follows from its root. Both sides share the bus. The numbers are those of
wing_unfolds.xml and panel.toml, written by hand. Nothing is imported from the package.
"""

from dataclasses import dataclass

import numpy as np

from arms import ELEMENTS, REACH, Link, _add_body, _beam, _moved, _reduced, _rotation

LENGTH, MASS, POLAR, BENDING, TORSION = 2.0, 2.0, 0.24, 1600.0, 2400.0
UNUSED = 1e5  # stiffness of motions that no node has
RATIO = 0.005
BUS, BUS_INERTIA, AT = 200.0, (40.0, 50.0, 60.0), 0.5
HINGE, HINGE_INERTIA = 0.5, (0.06, 0.02, 0.06)
DRIVE, DRAG = 0.8, 0.1
TURNS = (np.eye(3), np.diag([-1.0, -1.0, 1.0]))  # right, left
PANELS = 3
ANGLES = {
    "folded": (np.pi / 2.0, -np.pi, np.pi),
    "half": (np.pi / 4.0, -np.pi / 2.0, np.pi / 2.0),
    "deployed": (0.0, 0.0, 0.0),
}


@dataclass(frozen=True)
class Panel(Link):
    """A panel by its stiffness and mass per length."""

    ratio: float = RATIO  # of every mode with the root held
    elements: int = ELEMENTS

    def stiffness_and_mass(self):
        return {
            "axial": UNUSED,
            "torsion": TORSION,
            "bending_y": BENDING,
            "bending_z": UNUSED,
            "mass": MASS,
            "polar": POLAR,
        }


def side(band, angles, stiffness=DRIVE, damping=DRAG, armature=0.0, rigid=False):
    """The array at three angles [rad], the same on both sides, as a `Side`: the bus's six motions
    first. Stiffness, damping and armature of its hinges: one number or three. `rigid`: the panels
    do not bend."""
    own = 0 if rigid else PANELS * 3 * ELEMENTS
    hinges = 2 * PANELS
    size = 6 + hinges + 2 * own
    mass, dampers, springs = (np.zeros((size, size)) for _ in range(3))
    together = np.vstack([np.eye(6), np.zeros((size - 6, 6))])
    _add_body(mass, np.eye(6, size), BUS, np.diag(BUS_INERTIA))
    for number, start in enumerate(TURNS):
        turn = start
        place = AT * turn[:, 0]
        root = _moved(np.eye(6, size), place)
        for k in range(PANELS):
            hinge = 6 + number * PANELS + k
            root = root.copy()
            root[3:, hinge] += turn[:, 1]
            springs[hinge, hinge] += np.broadcast_to(stiffness, PANELS)[k]
            dampers[hinge, hinge] += np.broadcast_to(damping, PANELS)[k]
            mass[hinge, hinge] += np.broadcast_to(armature, PANELS)[k]
            turn = _rotation(turn[:, 1], angles[k]) @ turn
            _add_body(mass, root, HINGE, turn @ np.diag(HINGE_INERTIA) @ turn.T)
            first = 6 + hinges + number * own + 3 * ELEMENTS * k
            ends = [root]
            for node in range(ELEMENTS):
                away = LENGTH * (node + 1) / ELEMENTS * turn[:, 0]
                rows = _moved(root, away)
                here = first + 3 * node
                if not rigid:
                    rows[:3, here] += turn[:, 2]
                    rows[3:, here + 1] += turn[:, 0]
                    rows[3:, here + 2] += turn[:, 1]
                ends.append(rows)
            panel = Panel("panel", LENGTH, 0.0, 0.0)
            to_nodes = np.vstack(ends)
            beam = _beam(panel, panel, place, turn)
            for whole, part in zip((mass, springs, dampers), beam, strict=True):
                whole += to_nodes.T @ part @ to_nodes
            place = place + LENGTH * turn[:, 0]
            root = ends[-1]
    return _reduced(mass, dampers, springs, together, hinges, REACH * band)
