"""The test bench: an appendage's root driven in MuJoCo,
and the port models that A and B give back."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from lxml.etree import _Element as Element

from beamchain.chain.chain import Chain
from beamchain.engine.forces import Readings, coupled_port, port_of, readings
from beamchain.engine.library import hangs_on, mujoco, rest
from beamchain.engine.linearise import Linearisation, compile_model, linearise
from beamchain.errors import EngineError, InputError
from beamchain.mjcf import write
from beamchain.ports.coupled import CoupledPort
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, PORTS, Array, body_mass_matrix, offset_matrix
from beamchain.structure.planes import near_groups, turn_into_planes

STRAIGHT = 1e-8  # perturbation: of a straight chain at rest only curvature is lost
LEAST_ROW = 1e-9  # of the root of the rigid mass: less participation is none
DIGITS = 1e-11  # relative: beyond this A and B have lost digits
ROOT = tuple(
    f"root_{motion}"
    for motion in (
        "axial",
        "xy_displacement",
        "xz_displacement",
        "torsion",
        "xz_rotation",
        "xy_rotation",
    )
)
SIGNS = np.array([1.0, 1.0, 1.0, 1.0, -1.0, 1.0])  # the bench turns about -y
TOGETHER = 1e-6  # relative: frequencies this close are taken together
NOTHING = 1e-9  # relative, below which a number is printed as zero


@dataclass(frozen=True, eq=False)
class Measured:
    """What MuJoCo says: port models, rigid mass `(6, 6)`, couplings, digits lost.

    `coupled`: where joints are damped, the appendage in six motions with its whole damping matrix.
    """

    ports: dict[str, PortModel]
    rigid_mass: Array
    couplings: dict[str, float]
    linearisation: Linearisation
    lost: dict[str, float] = field(default_factory=dict[str, float])
    coupled: CoupledPort | None = None

    @property
    def coupling(self) -> float:
        """Largest coupling between two ports, relative."""
        return max(self.couplings.values(), default=0.0)


def _compiled(
    appendage: Element, ports: Sequence[str], timestep: float, ballast: Array | None
) -> "tuple[mujoco.MjModel, Linearisation, Array]":
    """The bench, its linearisation, and the mass matrix `(6, 6)` of the ballast."""
    model = compile_model(
        write.document_text(write.bench_document(appendage, ports, timestep, ballast))
    )
    extra = np.zeros((6, 6)) if ballast is None else np.diag([ballast[0]] * 3 + list(ballast[1:]))
    return model, linearise(model, epsilon=STRAIGHT), extra


def _surer(seen: Callable[[], PortModel], direct: PortModel) -> tuple[PortModel, float]:
    """What A and B hold, or the direct reading where they have lost digits,
    and how far the two are apart."""
    try:
        found = seen()
        lost = distance(found, direct)
    except (InputError, EngineError, np.linalg.LinAlgError):
        return direct, 1.0
    return found if lost <= DIGITS else direct, lost


def measure(
    appendage: Element, ports: Sequence[str], *, timestep: float, ballast: Array | None = None
) -> Measured:
    """Linearise the appendage on the bench; `ballast` `(4,)`: see `mjcf.write.bench_document`."""
    model, linear, extra = _compiled(appendage, ports, timestep, ballast)
    groups: dict[str, tuple[int, ...]] = {}
    for port in ports:
        groups[port] = tuple(
            i
            for i, joint in enumerate(linear.joints)
            if joint in write.ROOT_JOINTS[port] or joint.endswith(f"_{port}")
        )
    models: dict[str, PortModel] = {}
    lost: dict[str, float] = {}
    read = readings(model)
    for port, dofs in groups.items():
        ballast_mass = PORT_MOTION[port].T @ extra @ PORT_MOTION[port]
        root = [i for i in dofs if linear.joints[i] in write.ROOT_JOINTS[port]]
        try:
            direct = port_of(read, root, [i for i in dofs if i not in root], ballast_mass)
        except InputError:
            raise EngineError(
                f"the chain's modes in {port} lie too far apart for double precision, so that "
                f"MuJoCo's mass matrix does not hold them; keep fewer modes in {port}."
            ) from None
        models[port], lost[port] = _surer(partial(linear.port, dofs, ballast_mass), direct)
    pairs = {
        f"{a}, {b}": linear.coupling([groups[a], groups[b]]) for a, b in combinations(groups, 2)
    }
    rigid = rigid_mass(model, "bench") - extra
    return Measured(
        models, rigid, pairs, linear, lost, _with_whole_damping(read, linear.joints, rigid)
    )


def measure_in_space(
    appendage: Element,
    *,
    timestep: float,
    ballast: Array | None = None,
    live: Sequence[int] = tuple(range(6)),
) -> tuple[Measured, PortModel]:
    """The same with six motions free, and the port model of the `live` ones."""
    model, linear, extra = _compiled(appendage, PORTS, timestep, ballast)
    root = [linear.joints.index(joint) for joint in ROOT]
    inner = [i for i in range(len(linear.joints)) if i not in root]
    keep = list(live)
    direct = _direct(model, root, inner, extra, keep)
    space, lost = _surer(partial(_port, linear, root, inner, extra, keep), direct)
    ports: dict[str, PortModel] = {}
    for port in PORTS:
        motion = PORT_MOTION[port]
        if np.all(np.delete(motion, keep, axis=0) == 0.0):
            ports[port] = block(space, motion[keep])
    rigid = rigid_mass(model, "bench") - extra
    whole = _with_whole_damping(readings(model), linear.joints, rigid)
    return Measured(ports, rigid, {}, linear, dict.fromkeys(ports, lost), whole), space


def _with_whole_damping(read: Readings, joints: Sequence[str], rigid: Array) -> CoupledPort | None:
    """The appendage with its whole damping matrix, `rigid` `(6, 6)`;
    None where no joint is damped."""
    root = [i for i, joint in enumerate(joints) if joint in ROOT]
    inner = [i for i in range(len(joints)) if i not in root]
    if not any(read.damping[i, i] > 0.0 for i in inner):
        return None
    motions = np.diag(SIGNS)[[ROOT.index(joints[i]) for i in root]]
    return coupled_port(read, root, inner, motions, rigid)


def block(space: PortModel, motion: Array) -> PortModel:
    """The port model of some motions `(m, k)` of the root, the others held."""
    return space.replaced(
        rigid_mass=motion.T @ space.rigid_mass @ motion,
        participation=space.participation @ motion,
        tip=None,
    )


def _direct(
    model: "mujoco.MjModel", root: list[int], inner: list[int], extra: Array, live: list[int]
) -> PortModel:
    """The same from MuJoCo's own bodies, springs and dampers."""
    read = readings(model)
    signs = np.ones(read.rows.shape[1])
    signs[root] = SIGNS
    own = port_of(read._replace(rows=read.rows * signs), root, inner, extra)
    groups = near_groups(own.frequencies, TOGETHER)
    return _in_planes(own.rigid_mass, own.frequencies, own.participation, own.damping, groups, live)


def _in_planes(
    mass: Array, w: Array, rows: Array, ratios: Array, groups: list[list[int]], live: list[int]
) -> PortModel:
    """The model of the `live` motions, its modes of equal frequency turned into the planes."""
    scale = np.sqrt(np.where(np.diag(mass) > 0.0, np.diag(mass), 1.0))
    turned = turn_into_planes(rows, scale, groups)[0] @ rows
    return PortModel(mass[np.ix_(live, live)], w, turned[:, live], ratios)


def _port(
    linear: Linearisation, root: list[int], inner: list[int], extra: Array, live: list[int]
) -> PortModel:
    columns = [linear.driven.index(dof) for dof in root]
    held = linear.held(root, inner, columns, np.diag(SIGNS))
    apparent = (held.apparent + held.apparent.T) / 2.0
    w = np.sqrt(held.squares)
    groups = near_groups(w, TOGETHER)
    singles = [[k] for k in range(w.size) if not any(k in group for group in groups)]
    rows = held.rows([*singles, *groups])
    return _in_planes(apparent + rows.T @ rows - extra, w, rows, held.ratios, groups, live)


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
    data = rest(model)
    root = model.body(body).id
    return frozen_mass(model, data, root, data.xpos[root], data.xmat[root].reshape(3, 3))


def frozen_mass(
    model: "mujoco.MjModel", data: "mujoco.MjData", root: int, origin: Array, frame: Array
) -> Array:
    """The same about a point `(3,)` in axes `(3, 3)`, in columns."""
    out = np.zeros((6, 6))
    for i in range(model.nbody):
        if hangs_on(model, i, root):
            turn = frame.T @ data.ximat[i].reshape(3, 3)
            inertia = turn @ np.diag(model.body_inertia[i]) @ turn.T
            out += body_mass_matrix(
                float(model.body_mass[i]), frame.T @ (data.xipos[i] - origin), inertia
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
    # about x its own: torsion is far lighter
    out = np.array([rigid[0], max(rigid[3], write.SMALLEST), across, across])
    if np.min(out) < write.SMALLEST:
        raise EngineError(
            f"the appendage has mass {rigid[0]:.3g} kg and inertia {across:.3g} kg m^2 about its "
            f"root; MuJoCo takes nothing below {write.SMALLEST:g}. {write.UNITS}"
        )
    return out


class Composite(NamedTuple):
    """Mass properties of a body with all that hangs on it.

    Args:
        body: its name.
        mass: [kg].
        centre: `(3,)` centre of mass from the body's origin, in its axes [m].
        inertia: `(3, 3)` about the centre of mass, in its axes [kg m^2].
    """

    body: str
    mass: float
    centre: Array
    inertia: Array

    @property
    def sentence(self) -> str:
        """The numbers in a line."""
        largest = float(np.max(np.abs(self.inertia)))
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = np.where(
            np.abs(self.inertia) > NOTHING * largest, self.inertia, 0.0
        )
        size = np.sqrt(largest / self.mass)
        centre = ", ".join(
            f"{value:.5g}"
            for value in np.where(np.abs(self.centre) > NOTHING * size, self.centre, 0.0)
        )
        return (
            f"{self.body} with all that it carries: {self.mass:.6g} kg, centre of mass at "
            f"({centre}) m, inertia about it Ixx {xx:.5g}, Iyy {yy:.5g}, Izz {zz:.5g}, Ixy "
            f"{xy:.3g}, Ixz {xz:.3g}, Iyz {yz:.3g} kg m^2"
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return self._asdict()


def composite(model: "mujoco.MjModel", body: int) -> Composite:
    """Mass properties of a body, by its id, and all that hangs on it, at rest."""
    data = rest(model)
    matrix = frozen_mass(model, data, body, data.xpos[body], data.xmat[body].reshape(3, 3))
    mass = float(np.trace(matrix[:3, :3])) / 3.0
    centre = np.array([matrix[1, 5], matrix[2, 3], matrix[0, 4]]) / max(mass, 1e-300)
    cross = offset_matrix(centre)[:3, 3:]
    inertia = matrix[3:, 3:] + mass * cross @ cross
    return Composite(
        model.body(body).name or f"body {body}", mass, centre, (inertia + inertia.T) / 2.0
    )
