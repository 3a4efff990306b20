"""The shipped array of three panels a side in three-dimensional finite elements, its panels rigid
in their own plane and along it.

Every panel is a row of elements of `solver`. Their nodes move across the panel and turn with it;
what they do in its plane follows from its root. Both sides share the bus. The numbers are those of
wing_unfolds.xml and panel.toml, written by hand. Nothing is imported from the package.
"""

import numpy as np

from arms import ELEMENTS, REACH, reduced
from solver import Craft, Frame, Section

LENGTH = 2.0
# stretch and bending in the panel's plane are motions that no node has
SECTION = Section(axial=1e5, torsion=2400.0, bending_y=1600.0, bending_z=1e5, mass=2.0, polar=0.24)
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


def side(band, angles, stiffness=DRIVE, damping=DRAG, armature=0.0, rigid=False):
    """The array at three angles [rad], the same on both sides, as a `Side`: the bus's six motions
    first. Stiffness, damping and armature of its hinges: one number or three. `rigid`: the panels
    do not bend."""
    craft = Craft()
    craft.body(craft.base, BUS, inertia=BUS_INERTIA)
    stiffness, damping, armature = (
        np.broadcast_to(values, PANELS) for values in (stiffness, damping, armature)
    )
    for start in TURNS:
        frame = craft.base.at(AT * start[:, 0], start)
        for k in range(PANELS):
            frame = craft.hinge(
                frame, (0.0, 1.0, 0.0), angles[k], stiffness[k], damping[k], armature[k]
            )
            craft.body(frame, HINGE, inertia=HINGE_INERTIA)
            nodes = [frame]
            for node in range(ELEMENTS):
                there = frame.at((LENGTH * (node + 1) / ELEMENTS, 0.0, 0.0))
                if not rigid:  # across, twist and slope
                    own = craft.coordinates(3)
                    there = Frame(craft.wide(there.rows), there.place, there.turn)
                    there.rows[:3, own[0]] += frame.turn[:, 2]
                    there.rows[3:, own[1:]] += frame.turn[:, :2]
                nodes.append(there)
            craft.elements(nodes, LENGTH, SECTION, RATIO)
            frame = nodes[-1]
    return reduced(craft, REACH * band)
