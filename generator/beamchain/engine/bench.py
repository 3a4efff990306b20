"""The test bench: an appendage's root driven in MuJoCo, and the port models that A and B give back."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from lxml.etree import _Element as Element

from beamchain.chain.chain import Chain
from beamchain.engine.forces import port_of, readings
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import Linearisation, compile_model, linearise
from beamchain.errors import EngineError, InputError
from beamchain.mjcf import write
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, PORTS, Array, body_mass_matrix
from beamchain.structure.planes import into_planes, near_groups

STRAIGHT = 1e-8  # perturbation: of a straight chain at rest only curvature is lost
LEAST_ROW = 1e-9  # of the root of the rigid mass: less participation is none
DIGITS = 1e-11  # relative: beyond this A and B have lost digits
ROOT = (
    "root_axial",
    "root_xy_displacement",
    "root_xz_displacement",
    "root_torsion",
    "root_xz_rotation",
    "root_xy_rotation",
)
SIGNS = np.array([1.0, 1.0, 1.0, 1.0, -1.0, 1.0])  # the bench turns about -y
TOGETHER = 1e-6  # relative: frequencies this close are taken together


@dataclass(frozen=True, eq=False)
class Measured:
    """What MuJoCo says: port models, rigid mass `(6, 6)`, couplings, digits lost."""

    ports: dict[str, PortModel]
    rigid_mass: Array
    couplings: dict[str, float]
    linearisation: Linearisation
    lost: dict[str, float] = field(default_factory=dict[str, float])

    @property
    def coupling(self) -> float:
        """Largest coupling between two ports, relative."""
        return max(self.couplings.values(), default=0.0)


def measure(appendage: Element, ports: Sequence[str], *, timestep: float, ballast: Array | None = None) -> Measured:
    """Linearise the appendage on the bench; `ballast` `(4,)`: see `mjcf.write.bench`."""
    model = compile_model(write.text(write.bench(appendage, ports, timestep, ballast)))
    linear = linearise(model, epsilon=STRAIGHT)
    groups: dict[str, tuple[int, ...]] = {}
    for port in ports:
        groups[port] = tuple(
            i for i, joint in enumerate(linear.joints) if joint in write.ROOT_JOINTS[port] or joint.endswith(f"_{port}")
        )
    extra = np.zeros((6, 6)) if ballast is None else np.diag([ballast[0]] * 3 + list(ballast[1:]))
    models: dict[str, PortModel] = {}
    lost: dict[str, float] = {}
    read = readings(model)
    for port, dofs in groups.items():
        motion = PORT_MOTION[port]
        ballast_mass = motion.T @ extra @ motion
        root = [i for i in dofs if linear.joints[i] in write.ROOT_JOINTS[port]]
        try:
            direct = port_of(read, root, [i for i in dofs if i not in root], ballast_mass)
        except InputError:
            raise EngineError(
                f"the chain's modes in {port} lie too far apart for double precision, so that MuJoCo's mass matrix does "
                f"not hold them; keep fewer modes in {port}."
            ) from None
        try:
            models[port] = linear.port(dofs, ballast_mass)
            lost[port] = distance(models[port], direct)
        except (InputError, EngineError, np.linalg.LinAlgError):
            lost[port] = 1.0
        if lost[port] > DIGITS:
            models[port] = direct
    pairs = {f"{a}, {b}": linear.coupling([groups[a], groups[b]]) for a, b in combinations(groups, 2)}
    return Measured(models, rigid_mass(model, "bench") - extra, pairs, linear, lost)


def measure_in_space(
    appendage: Element, *, timestep: float, ballast: Array | None = None, live: Sequence[int] = tuple(range(6))
) -> tuple[Measured, PortModel]:
    """The same with six motions free, and the port model of the `live` ones."""
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
    """The port model of some motions `(m, k)` of the root, the others held."""
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
    rows = into_planes(own.participation, scale, near_groups(own.frequencies, TOGETHER))[0] @ own.participation
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
    rows = into_planes(rows, scale, groups)[0] @ rows
    return PortModel(mass[np.ix_(live, live)], w, rows[:, live], held.ratios)


def distance(a: PortModel, b: PortModel) -> float:
    """Worst relative difference of frequencies, participation and rigid mass."""
    if a.modes != b.modes:
        return 1.0
    size = np.sqrt(np.diag(b.rigid_mass))
    rows = np.maximum(np.linalg.norm(b.participation / size, axis=1), LEAST_ROW)
    differences = (
        np.abs(a.frequencies / b.frequencies - 1.0),
        np.linalg.norm((a.participation - b.participation) / size, axis=1) / rows,
        np.abs(a.rigid_mass - b.rigid_mass) / np.outer(size, size),
    )
    return max(float(np.max(d, initial=0.0)) for d in differences)


def rigid_mass(model: "mujoco.MjModel", body: str) -> Array:
    """`(6, 6)` mass matrix of a body's frozen subtree at rest, in its own frame."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    root = model.body(body).id
    return frozen_mass(model, data, root, data.xpos[root], data.xmat[root].reshape(3, 3))


def frozen_mass(model: "mujoco.MjModel", data: "mujoco.MjData", root: int, origin: Array, frame: Array) -> Array:
    """The same about a point `(3,)` in axes `(3, 3)`, in columns."""
    out = np.zeros((6, 6))
    for i in range(model.nbody):
        top = i
        while top not in (0, root):
            top = int(model.body_parentid[top])
        if top != root:
            continue
        turn = frame.T @ data.ximat[i].reshape(3, 3)
        out += body_mass_matrix(
            float(model.body_mass[i]),
            frame.T @ (data.xipos[i] - origin),
            turn @ np.diag(model.body_inertia[i]) @ turn.T,
        )
    return out


def ballast_for(chain: Chain) -> Array | None:
    """A root body where a hinge at the root leaves the bench massless."""
    first = chain.links[0]
    if min(first.mass, *first.inertia) >= write.SMALLEST:
        return None
    return root_body(chain)


def root_body(chain: Chain) -> Array:
    """`(4,)` mass and inertias of a root body as heavy as the chain."""
    rigid = np.diag(chain.rigid_mass())
    across = max(rigid[4:])
    out = np.array([rigid[0], max(rigid[3], write.SMALLEST), across, across])  # about x its own: torsion is far lighter
    if np.min(out) < write.SMALLEST:
        raise EngineError(
            f"the appendage has mass {rigid[0]:.3g} kg and inertia {across:.3g} kg m^2 about its root; MuJoCo takes "
            f"nothing below {write.SMALLEST:g}. {write.UNITS}"
        )
    return out
