"""The bare spacecraft with what ports carry loose on them: six joints in front of every carried
body, so that MuJoCo itself says what the ports' motion p does to inputs, outputs and springs.

Of the coordinates `(q, p)` of `craft/loads.py`: q the spacecraft's own, p the motion of every port
against the root of its appendage, in the axes of the root.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from lxml import etree
from lxml.etree import _Element as Element
from scipy.spatial.transform import Rotation

from beamchain.craft.documents import open_places, with_probes, without_keys
from beamchain.craft.embedded import Embedded
from beamchain.craft.loads import Root
from beamchain.engine.library import mujoco
from beamchain.engine.linear import Linear, Signal, linear_at
from beamchain.engine.linearise import compile_model
from beamchain.engine.mount import Mount
from beamchain.engine.operating_point import OperatingPoint, quiet_copy
from beamchain.engine.signals import Input, Output
from beamchain.errors import InputError
from beamchain.mjcf.compatibility import default_attributes, shield_from_defaults
from beamchain.mjcf.place import find_target
from beamchain.mjcf.text import Edit
from beamchain.ports.motions import Array, locked

LOOSE = "beamchain loose "  # names of what is put in begin with it
TRACE = "1e-12"  # kg, kg m^2
# a hinge of the spacecraft may have the axis of a loose one; taken out of the mass matrix again
ARMATURE = 1.0


class LooseCraft(NamedTuple):
    """The bare spacecraft with its ports loose.

    Args:
        model: compiled.
        own: its degrees of freedom that are the spacecraft's own, in order.
        ports: `(nv, 6 l)` its degrees of freedom by the motion p of the ports.
    """

    model: "mujoco.MjModel"
    own: list[int]
    ports: Array

    def point(self, bare: OperatingPoint) -> OperatingPoint:
        """A point of the bare spacecraft, the ports where they are at rest."""
        model = quiet_copy(self.model)
        joints = [int(model.dof_jntid[dof]) for dof in self.own]
        qpos = np.array(model.qpos0)
        parts = np.split(bare.qpos, bare.model.jnt_qposadr[1:])
        for part, joint in zip(parts, dict.fromkeys(joints), strict=True):
            start = int(model.jnt_qposadr[joint])
            qpos[start : start + part.size] = part
        qvel = np.zeros(model.nv)
        qvel[self.own] = bare.qvel
        return OperatingPoint(model, qpos, qvel)

    def linear(
        self, point: OperatingPoint, inputs: Sequence[Input], outputs: Sequence[Output]
    ) -> Linear:
        """Linear at a point, in the coordinates (q, p)."""
        linear = linear_at(point, inputs, outputs)
        added = np.diag(ARMATURE * self.ports.any(axis=1))
        linear = replace(linear, mass=linear.mass - added)
        motion = np.hstack([np.eye(point.model.nv)[:, self.own], self.ports])
        names = [linear.coordinates[dof] for dof in self.own]
        ports = [Signal(f"port {k + 1}", "") for k in range(self.ports.shape[1])]
        return linear.in_coordinates(motion, [*names, *ports])


def loose_craft(embedded: Embedded, roots: Sequence[Root]) -> LooseCraft:
    """The bare spacecraft of a file with its ports loose; `roots`: of all its appendages."""
    if embedded.document is None:
        raise InputError(
            "the exact plant of a spacecraft whose appendages carry bodies needs the spacecraft's "
            "document, which a proof of a written file has not; give what bc.embed returns."
        )
    carries = {a.at: a.carries for a in embedded.appendages}
    bare, targets = open_places(embedded.document, list(carries), carries)
    document = without_keys(with_probes(bare, targets))
    ports = [(root.at, load.x) for root in roots for load in root.loads]
    rows = {
        body: ports.index((a.at, a.spec.further[port]))
        for a in embedded.appendages
        for port, bodies in a.carries.items()
        for body in bodies
    }
    mounts = {a.at: a.mount for a in embedded.appendages}
    defaults = default_attributes(document.parts())
    edits: list[Edit] = []
    for body, row in rows.items():
        at, x = ports[row]
        node = document.node(find_target(document, f"body:{body}").body)
        joints = _joints(mounts[at], x, body)
        shield_from_defaults(joints, defaults)
        start, end = etree.tostring(joints, encoding="unicode").rsplit("</", 1)
        edits += [Edit(node.start, node.start, start), Edit(node.end, node.end, f"</{end}")]
    model = compile_model(document.edit(edits).text)
    for body in rows:
        model.body(LOOSE + body).mass = 0.0
        model.body(LOOSE + body).inertia = 0.0
        for k in range(6):
            model.joint(_name(body, k)).armature = ARMATURE
    numbers = {str(model.joint(j).name): int(model.jnt_dofadr[j]) for j in range(model.njnt)}
    motion = np.zeros((model.nv, 6 * len(ports)))
    for body, row in rows.items():
        for k in range(6):
            motion[numbers[_name(body, k)], 6 * row + k] = 1.0
    loose = set(np.flatnonzero(motion.any(axis=1)).tolist())
    return LooseCraft(model, [i for i in range(model.nv) if i not in loose], locked(motion))


def _joints(mount: Mount, x: float, body: str) -> Element:
    """A body around a carried one, on slides along the axes of an appendage's root and hinges
    about them, at its port."""
    turn = Rotation.from_quat(mount.quaternion, scalar_first=True)
    place = _numbers(mount.position + turn.apply([x, 0.0, 0.0]))
    out = etree.Element("body", name=LOOSE + body)
    # as much as a moving body must have; taken out of the compiled model
    etree.SubElement(out, "inertial", pos="0 0 0", mass=TRACE, diaginertia=f"{TRACE} " * 3)
    for k in range(6):
        etree.SubElement(
            out,
            "joint",
            name=_name(body, k),
            type="slide" if k < 3 else "hinge",
            pos=place,
            axis=_numbers(turn.apply(np.eye(3)[k % 3])),
            stiffness="0",
            damping="0",
        )
    return out


def _name(body: str, k: int) -> str:
    return f"{LOOSE}{k} {body}"


def _numbers(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
