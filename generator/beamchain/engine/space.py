"""The bench with all six motions of the root free, and the port model in space that A and B give back."""

from collections.abc import Sequence

import numpy as np
from lxml.etree import _Element as Element

from beamchain.engine.bench import DIGITS, STRAIGHT, Measured, distance, rigid_mass
from beamchain.engine.forces import port_of, readings
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import Linearisation, compile_model, linearise
from beamchain.errors import EngineError, InputError
from beamchain.mjcf import write
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, PORTS, Array
from beamchain.structure.planes import into_planes, near_groups

ROOT = (
    "root_axial",
    "root_xy_displacement",
    "root_xz_displacement",
    "root_torsion",
    "root_xz_rotation",
    "root_xy_rotation",
)
SIGNS = np.array([1.0, 1.0, 1.0, 1.0, -1.0, 1.0])  # the bench turns about -y
TOGETHER = 1e-6  # relative: frequencies this close are taken together, as their eigenvectors are not their own


def measure_in_space(
    appendage: Element, *, timestep: float, ballast: Array | None = None, live: Sequence[int] = tuple(range(6))
) -> tuple[Measured, PortModel]:
    """Put the appendage on the bench, linearise, and read the port model in space back.

    Args:
        appendage: from `mjcf.write.appendage`.
        timestep: [s].
        ballast: `(4,)` mass and principal inertias at the root; see `mjcf.write.bench`.
        live: motions in which the appendage has inertia; the others are left out of the port model.

    Returns:
        what MuJoCo says (its ports are the blocks of the port model in space), and the port model.
    """
    model = compile_model(write.text(write.bench(appendage, PORTS, timestep, ballast)))
    linear = linearise(model, epsilon=STRAIGHT)
    extra = np.zeros((6, 6)) if ballast is None else np.diag([ballast[0]] * 3 + list(ballast[1:]))
    keep = list(live)
    space = _direct(model, linear, extra, keep)
    try:
        seen = _port(linear, extra, keep)
        lost = distance(seen, space)
    except (InputError, EngineError, np.linalg.LinAlgError):
        seen, lost = space, 1.0
    space = seen if lost <= DIGITS else space
    ports: dict[str, PortModel] = {}
    for port in PORTS:
        motion = PORT_MOTION[port][keep]
        if np.all(np.abs(PORT_MOTION[port]).sum(axis=1)[[i for i in range(6) if i not in keep]] == 0.0):
            ports[port] = block(space, motion)
    return Measured(ports, rigid_mass(model, "bench") - extra, {}, linear, dict.fromkeys(ports, lost)), space


def block(space: PortModel, motion: Array) -> PortModel:
    """The port model of some motions of the root, the others held: `motion` `(m, k)` in the motions of `space`."""
    return space.replaced(
        rigid_mass=motion.T @ space.rigid_mass @ motion, participation=space.participation @ motion, tip=None
    )


def _direct(model: "mujoco.MjModel", linear: Linearisation, extra: Array, live: list[int]) -> PortModel:
    """The same from MuJoCo's own bodies, springs and dampers."""
    root = [linear.joints.index(joint) for joint in ROOT]
    inner = [i for i in range(len(linear.joints)) if i not in set(root)]
    read = readings(model)
    signed = read._replace(rows=read.rows * _signs(root, len(linear.joints)))
    own = port_of(signed, root, inner, extra)
    mass = own.rigid_mass
    scale = np.sqrt(np.where(np.diag(mass) > 0.0, np.diag(mass), 1.0))
    rows = into_planes(own.frequencies, own.participation, scale, near_groups(own.frequencies, TOGETHER)).participation
    return PortModel(mass[np.ix_(live, live)], own.frequencies, rows[:, live], own.damping)


def _signs(root: list[int], size: int) -> Array:
    out = np.ones(size)
    out[root] = SIGNS
    return out


def _port(linear: Linearisation, extra: Array, live: list[int]) -> PortModel:
    root = [linear.joints.index(joint) for joint in ROOT]
    inner = [i for i in range(len(linear.joints)) if i not in set(root)]
    columns = [linear.driven.index(dof) for dof in root]
    held = linear.held(root, inner, columns, np.diag(SIGNS))
    apparent, w = (held.apparent + held.apparent.T) / 2.0, np.sqrt(held.squares)
    rows = np.zeros((w.size, 6))
    groups = near_groups(w, TOGETHER)
    singles = [[k] for k in range(w.size) if not any(k in group for group in groups)]
    for group in [*singles, *groups]:
        # the sum over a group of W^2 L L^T is its own, whatever its eigenvectors: the leading eigenpairs are the rows
        both = (held.reaction[:, group] / held.squares[group]) @ held.drive[group]
        values, vectors = np.linalg.eigh((both + both.T) / 2.0)
        top = max(values.size - len(group), 0)  # more modes than motions: those left over move nothing
        rows[group[: values.size - top]] = (vectors[:, top:] * np.sqrt(np.clip(values[top:], 0.0, None))).T[::-1]
    mass = apparent + rows.T @ rows - extra
    scale = np.sqrt(np.where(np.diag(mass) > 0.0, np.diag(mass), 1.0))
    rows = into_planes(w, rows, scale, groups).participation
    return PortModel(mass[np.ix_(live, live)], w, rows[:, live], held.ratios)
