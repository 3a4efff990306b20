"""The test bench: an appendage's root driven in MuJoCo,
and the port models that A and B give back."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from lxml.etree import _Element as Element

from beamchain.chain.chain import Chain
from beamchain.engine.library import hangs_on, mujoco, rest
from beamchain.engine.linearise import Linearisation, compile_model, linearise
from beamchain.engine.model_rows import Readings, readings
from beamchain.errors import EngineError, InputError
from beamchain.mjcf import write
from beamchain.ports.compose import joined
from beamchain.ports.model import PortModel
from beamchain.ports.motions import (
    PORT_MOTION,
    Array,
    body_mass_matrix,
    first_moment,
    mean_mass,
    offset_matrix,
)
from beamchain.structure.settle_modes import near_groups, turn_into_planes

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
NO_RATIO = 1e-14  # damping ratios below are rounding
NOTHING = 1e-9  # relative, below which a number is printed as zero


@dataclass(frozen=True, eq=False)
class Measured:
    """What MuJoCo says of an appendage.

    Args:
        blocks: port model of each block of ports, labelled where it is a single port, and which of
            the six motions it has.
        rigid_mass: `(6, 6)` of the bodies.
        couplings: between any two blocks of ports, relative.
        linearisation: of the bench.
        lost: per port, how far A and B are from the direct reading, which is taken beyond 1e-11.
        coupled: where joints are damped, the appendage in the live motions with its whole damping
            matrix.
        live: motions in which the appendage has inertia (0 to 5).
    """

    blocks: tuple[tuple[PortModel, list[int]], ...]
    rigid_mass: Array
    couplings: dict[str, float]
    linearisation: Linearisation
    lost: dict[str, float] = field(default_factory=dict[str, float])
    coupled: PortModel | None = None
    live: tuple[int, ...] = tuple(range(6))

    @cached_property
    def space(self) -> PortModel:
        """The port model in six motions: the blocks do not couple."""
        mass = self.rigid_mass.copy()
        for model, motions in self.blocks:
            mass[np.ix_(motions, motions)] = model.rigid_mass
        models, motions = zip(*self.blocks, strict=True) if self.blocks else ((), ())
        return joined(models, [np.eye(6)[:, columns] for columns in motions], mass)

    @cached_property
    def ports(self) -> dict[str, PortModel]:
        """The view of each port that the appendage has, the other motions held."""
        return {port: self.space.port(port) for port in self.lost}

    @cached_property
    def motion(self) -> PortModel:
        """The port model in the live motions."""
        return self.space.in_motions(np.eye(6)[:, list(self.live)])

    @property
    def damped_motion(self) -> PortModel:
        """The same, with the whole damping matrix where joints are damped."""
        return self.motion if self.coupled is None else self.coupled

    def damped_port(self, port: str) -> PortModel:
        """The view of a port, with the whole damping matrix where joints are damped."""
        if self.coupled is None:
            return self.ports[port]
        return self.coupled.in_motions(PORT_MOTION[port][list(self.live)])

    def reading(self, port: str) -> str:
        """What the figures of a port come from: A and B, or mass and stiffness where these differ
        by more than 1e-11."""
        return "mjd_transitionFD" if self.lost[port] <= DIGITS else "mass and stiffness"

    def reading_sentence(self, port: str) -> str:
        """The same, and how far the two readings are apart."""
        return (
            f"{port}: read through {self.reading(port)}; mjd_transitionFD and MuJoCo's mass and "
            f"stiffness differ by {self.lost[port]:.1e}."
        )

    @property
    def coupling(self) -> float:
        """Largest coupling between two blocks, relative."""
        return max(self.couplings.values(), default=0.0)


class _Freedoms(NamedTuple):
    """Degrees of freedom of a block of ports on the bench: numbers of the `root` ones, which make
    the `motions` (0 to 5) of the root, and of the `inner` ones."""

    root: list[int]
    inner: list[int]
    motions: list[int]

    @property
    def signs(self) -> Array:
        """`(m, m)` of the bench's motions."""
        return np.diag(SIGNS[self.motions])


def measure(
    appendage: Element,
    blocks: Sequence[Sequence[str]],
    *,
    timestep: float,
    integrator: str = "implicitfast",
    ballast: Array | None = None,
    live: Sequence[int] = tuple(range(6)),
) -> Measured:
    """Linearise an appendage on the bench, block by block.

    Args:
        appendage: its drop-in element.
        blocks: ports that modes or mass couple stand together; ports of no block are held.
        timestep: of the bench [s].
        integrator: of the bench, MuJoCo's name.
        ballast: `(4,)`, see `mjcf.write.bench_document`.
        live: motions in which the appendage has inertia (0 to 5).

    Raises:
        EngineError: the modes of a block lie too far apart for double precision.
    """
    ports = [port for block in blocks for port in block]
    document = write.bench_document(appendage, ports, timestep, ballast, integrator)
    model = compile_model(write.document_text(document))
    linear = linearise(model, epsilon=STRAIGHT)
    extra = np.zeros((6, 6)) if ballast is None else np.diag([ballast[0]] * 3 + list(ballast[1:]))
    read = readings(model)
    rigid = rigid_mass(model, "bench") - extra
    parts: list[tuple[PortModel, list[int]]] = []
    lost: dict[str, float] = {}
    freedoms = {tuple(block): _freedoms(linear.joints, block) for block in blocks}
    for block, dofs in freedoms.items():
        model_of_block, difference = _block_model(linear, read, block, dofs, extra, live)
        motions = [motion for motion in dofs.motions if motion in live]
        label = block[0] if len(block) == 1 else ""
        labels = (label,) * model_of_block.modes
        parts.append((model_of_block.replaced(labels=labels), motions))
        for port in block:
            if np.all(np.delete(PORT_MOTION[port], motions, axis=0) == 0.0):
                lost[port] = difference
    couplings = {
        f"{' and '.join(a)}, {' and '.join(b)}": linear.coupling(
            [tuple(freedoms[x].root + freedoms[x].inner) for x in (a, b)]
        )
        for a, b in combinations(freedoms, 2)
    }
    return Measured(
        blocks=tuple(parts),
        rigid_mass=rigid,
        couplings=couplings,
        linearisation=linear,
        lost=lost,
        coupled=_with_whole_damping(read, linear.joints, rigid, list(live)),
        live=tuple(live),
    )


def _freedoms(joints: Sequence[str], block: Sequence[str]) -> _Freedoms:
    """The degrees of freedom of a block, by the names of their joints."""
    of_root = {joint for port in block for joint in write.ROOT_JOINTS[port]}
    motions = [motion for motion, joint in enumerate(ROOT) if joint in of_root]
    root = [joints.index(ROOT[motion]) for motion in motions]
    ends = tuple(f"_{port}" for port in block)
    inner = [i for i, joint in enumerate(joints) if joint not in ROOT and joint.endswith(ends)]
    return _Freedoms(root, inner, motions)


def _block_model(
    linear: Linearisation,
    read: Readings,
    block: Sequence[str],
    dofs: _Freedoms,
    extra: Array,
    live: Sequence[int],
) -> tuple[PortModel, float]:
    """The port model of a block in its `live` motions as A and B hold it, or the direct reading
    where they have lost digits; and how far the two are apart. `extra` `(6, 6)`: the ballast."""
    ballast = extra[np.ix_(dofs.motions, dofs.motions)]
    try:
        rows = read.held_at(dofs.root, dofs.inner, dofs.signs)
        direct = PortModel.from_rows(rows, rigid_mass=rows.rigid.T @ rows.rigid - ballast)
    except InputError:
        names = " and ".join(block)
        raise EngineError(
            f"the chain's modes in {names} lie too far apart for double precision, so that "
            f"MuJoCo's mass matrix does not hold them; keep fewer modes in {names}."
        ) from None
    keep = [i for i, motion in enumerate(dofs.motions) if motion in live]
    groups = near_groups(direct.frequencies, TOGETHER)
    turn = _in_planes(direct.participation, direct.rigid_mass, dofs.motions, groups)
    ratios = np.diag(turn @ direct.damping @ turn.T)
    direct = direct.replaced(
        participation=turn @ direct.participation,
        damping=np.where(np.abs(ratios) < NO_RATIO, 0.0, ratios),
    )
    if len(keep) < len(dofs.motions):
        direct = direct.in_motions(np.eye(len(dofs.motions))[:, keep])
    try:
        found = _from_linearisation(linear, dofs, ballast, keep)
        lost = distance(found, direct)
    except (InputError, EngineError, np.linalg.LinAlgError):
        return direct, 1.0
    return found if lost <= DIGITS else direct, lost


def _from_linearisation(
    linear: Linearisation, dofs: _Freedoms, ballast: Array, keep: list[int]
) -> PortModel:
    """The port model of a block, in those of its motions that are kept, as A and B hold it."""
    columns = [linear.driven.index(dof) for dof in dofs.root]
    held = linear.held(dofs.root, dofs.inner, columns, dofs.signs)
    apparent = (held.apparent + held.apparent.T) / 2.0
    frequencies = np.sqrt(held.squares)
    groups = near_groups(frequencies, TOGETHER)
    singles = [[k] for k in range(frequencies.size) if not any(k in group for group in groups)]
    participation = held.rows([*singles, *groups])
    mass = apparent + participation.T @ participation - ballast
    rows = _in_planes(participation, mass, dofs.motions, groups) @ participation
    return PortModel(mass[np.ix_(keep, keep)], frequencies, rows[:, keep], held.ratios)


def _in_planes(
    participation: Array, mass: Array, motions: list[int], groups: list[list[int]]
) -> Array:
    """`(n, n)` turn of modes of equal frequency into the planes."""
    rows = np.zeros((len(participation), 6))
    rows[:, motions] = participation
    scale = np.ones(6)
    scale[motions] = np.sqrt(np.where(np.diag(mass) > 0.0, np.diag(mass), 1.0))
    turn, _ = turn_into_planes(rows, scale, groups)
    return turn


def _with_whole_damping(
    read: Readings, joints: Sequence[str], rigid: Array, live: list[int]
) -> PortModel | None:
    """The appendage with its whole damping matrix in its `live` motions, `rigid` `(6, 6)`;
    None where no joint is damped."""
    root = [i for i, joint in enumerate(joints) if joint in ROOT]
    inner = [i for i in range(len(joints)) if i not in root]
    if not any(read.damping[i, i] > 0.0 for i in inner):
        return None
    motions = np.diag(SIGNS)[[ROOT.index(joints[i]) for i in root]][:, live]
    rows = read.held_at(root, inner, motions)
    return PortModel.from_rows(rows, rigid_mass=rigid[np.ix_(live, live)])


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


def rigid_mass(model: "mujoco.MjModel", body: str | int) -> Array:
    """`(6, 6)` mass matrix of a body's frozen subtree at rest, in its own frame."""
    data = rest(model)
    root = model.body(body).id
    return frozen_mass(model, data, root, data.xpos[root], data.xmat[root].reshape(3, 3))


def frozen_mass(
    model: "mujoco.MjModel", data: "mujoco.MjData", root: int, origin: Array, frame: Array
) -> Array:
    """The same about a point `(3,)` in axes `(3, 3)`, in columns."""
    bodies = [i for i in range(model.nbody) if hangs_on(model, i, root)]
    return mass_of_bodies(model, data, bodies, origin, frame)


def mass_of_bodies(
    model: "mujoco.MjModel",
    data: "mujoco.MjData",
    bodies: Sequence[int],
    origin: Array,
    frame: Array,
) -> Array:
    """`(6, 6)` mass matrix of frozen bodies about a point `(3,)`, in axes `(3, 3)` in columns."""
    out = np.zeros((6, 6))
    for i in bodies:
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


def composite(model: "mujoco.MjModel", body: int, qpos: Array | None = None) -> Composite:
    """Mass properties of a body, by its id, and all that hangs on it, in a pose, at rest where left
    out."""
    data = rest(model, qpos)
    matrix = frozen_mass(model, data, body, data.xpos[body], data.xmat[body].reshape(3, 3))
    mass = mean_mass(matrix)
    centre = first_moment(matrix) / max(mass, 1e-300)
    cross = offset_matrix(centre)[:3, 3:]
    inertia = matrix[3:, 3:] + mass * cross @ cross
    return Composite(
        model.body(body).name or f"body {body}", mass, centre, (inertia + inertia.T) / 2.0
    )
