"""Timing of appendages that carry bodies: a rule for each appendage alone that keeps every craft,
pose and payload stable.

A tendon of stiffness k and damping d gets the armature `c h^2 k + h d / 2`. With `c = 1/12` the
coupled poles of any tree are right to fourth order in the step. Under a semi-implicit step the tree
is stable if for every appendage alone, its root free,

    S + diag(c x^2) - diag(x^2) / 4 > 0,    S = C of M_hh - P^T R^-1 P,    x = h sqrt(k)

since the matrices of the tree are a congruence of those of its parts and what they carry only adds
mass. The stiffest tendons get as much more than 1/12 as that takes.

Theory: docs/theory.md, section 9.
"""

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, eigh

from beamchain.engine.bench import mass_of_bodies
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import mass_matrix
from beamchain.engine.operating_point import quiet_copy, rest_point
from beamchain.ports.motions import Array, offset_matrix
from beamchain.steps.forms import ModeTime, TendonValues
from beamchain.steps.integrators import SCHEMES, continuous_poles
from beamchain.steps.modal import Modal, condensed_mass

EXACT = 1.0 / 12.0  # of h^2 k: the poles are right to fourth order
STABLE = {"RK4": 1.0 / 7.0}  # of h^2 k: stable by itself; RK4's limit is 1/8
SEMI_IMPLICIT = 0.25 * 1.02  # the same of the others, whose limit is 1/4
ROOM = 0.02  # of S: what is left of it at least
NOTHING = 1e-9  # of the mass of other bodies: none at all would be singular
BISECTIONS = 20
NAME = re.compile(r"(?:mode|filler)\d+(?:_(?:xy|xz|torsion|axial)\d*)?$")


class Alone(NamedTuple):
    """The modal tendons of one appendage: their places in `Modal`; `held` and `free` `(n, n)`:
    condensed mass of their lengths, the root held, and free, without what the appendage carries."""

    tendons: NDArray[np.intp]
    held: Array
    free: Array


def appendages_alone(model: "mujoco.MjModel", modal: Modal) -> list[Alone]:
    """Every appendage of a model that is not timed, alone."""
    prefixes = [NAME.sub("", name) for name in modal.names]
    data = rest_point(quiet_copy(model)).data()
    out: list[Alone] = []
    for prefix in dict.fromkeys(prefixes):
        tendons = np.array([i for i, name in enumerate(prefixes) if name == prefix], dtype=np.intp)
        dofs = np.flatnonzero(np.any(modal.rows[tendons] != 0.0, axis=0))
        rows = modal.rows[np.ix_(tendons, dofs)]
        first = int(model.body_parentid[int(model.dof_bodyid[dofs[0]])])
        bodies = list(dict.fromkeys([first, *model.dof_bodyid[dofs].tolist()]))
        mass = _mass_of(model, bodies)[np.ix_(dofs, dofs)]
        rigid, momentum = _root(model, data, first, bodies, dofs)
        free = mass - momentum.T @ np.linalg.lstsq(rigid, momentum, rcond=1e-12)[0]
        held = condensed_mass(mass, rows)[0]
        out.append(Alone(tendons, held, condensed_mass((free + free.T) / 2.0, rows)[0]))
    return out


def _mass_of(model: "mujoco.MjModel", bodies: list[int]) -> Array:
    """`(nv, nv)` with no other mass than that of some bodies, and armatures."""
    alone = quiet_copy(model)
    others = np.setdiff1d(np.arange(model.nbody), bodies)
    alone.body_mass[others] *= NOTHING
    alone.body_inertia[others] *= NOTHING
    return mass_matrix(alone)


def _root(
    model: "mujoco.MjModel",
    data: "mujoco.MjData",
    root: int,
    bodies: list[int],
    dofs: NDArray[np.intp],
) -> tuple[Array, Array]:
    """Rigid mass `(6, 6)` about the root body, and the momentum `(6, n)` of unit rates of its
    degrees of freedom, in the world's axes."""
    origin = data.xpos[root]
    rigid = mass_of_bodies(model, data, bodies, origin, np.eye(3))
    momentum = np.zeros((6, dofs.size))
    for body in bodies:
        translation = np.zeros((3, model.nv))
        rotation = np.zeros((3, model.nv))
        mujoco.mj_jacBodyCom(model, data, translation, rotation, body)
        # of what turns against the root only
        motion = np.vstack([translation, rotation])[:, dofs]
        axes = data.ximat[body].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
        mass = block_diag(float(model.body_mass[body]) * np.eye(3), inertia)
        momentum += offset_matrix(data.xipos[body] - origin).T @ mass @ motion
    return rigid, momentum


def tree_form(
    model: "mujoco.MjModel", modal: Modal, integrator: str, timestep: float
) -> TendonValues:
    """Armature of every modal tendon of a model that is not timed; dampings stay."""
    h = float(timestep)
    low = 0.0 if integrator == "RK4" else EXACT
    high = STABLE.get(integrator, SEMI_IMPLICIT)
    limit = 1.0 / 8.0 if integrator == "RK4" else 0.25
    squares = h**2 * modal.stiffness
    factors = np.full(squares.size, low)
    largest = 0.0
    for alone in appendages_alone(model, modal):
        x2 = squares[alone.tendons]
        own = _least_factors(alone.free, x2, low, high, limit)
        factors[alone.tendons] = own
        pencil = eigh(np.diag(x2), alone.free + np.diag(own * x2), eigvals_only=True)
        largest = max(largest, float(pencil[-1]))
    late = h * modal.damping / 2.0
    if integrator == "RK4":
        late = np.zeros_like(late)
    elif SCHEMES[integrator].implicit_damping:
        late = -late
    armature = np.maximum(factors * squares + late, 0.0)
    zeta = modal.damping / (2.0 * modal.frequency)
    poles = continuous_poles(modal.frequency, zeta)[0]
    modes = tuple(
        ModeTime(
            name=modal.names[i],
            frequency=float(modal.frequency[i]),
            ratio=float(zeta[i]),
            mass=1.0 + float(armature[i]),
            damping=float(modal.damping[i]),
            pole=complex(poles[i]),
            slowed=bool(factors[i] > low),
            clamped=False,
        )
        for i in range(len(modal.names))
    )
    phase = float(np.sqrt(np.max(squares[factors <= low], initial=0.0)))
    return TendonValues(modal.damping, armature, phase, largest, modes)


def _least_factors(free: Array, x2: Array, low: float, high: float, limit: float) -> Array:
    """The factor of every tendon: `low`, and up to `high` for as few of the stiffest as leave room.

    `x2` `(n,)`: squared phase per step of the tendons.
    """

    def has_room(factors: Array) -> bool:
        room = (1.0 - ROOM) * free + np.diag((factors - limit) * x2)
        return bool(np.linalg.eigvalsh(room)[0] > 0.0)

    order = np.argsort(-x2, kind="stable")
    factors = np.full(x2.size, low)
    for i in order:
        if has_room(factors):
            break
        a, b = low, high
        factors[i] = high
        if not has_room(factors):
            continue
        for _ in range(BISECTIONS):
            factors[i] = (a + b) / 2.0
            a, b = (a, factors[i]) if has_room(factors) else (factors[i], b)
        factors[i] = b
    return factors
