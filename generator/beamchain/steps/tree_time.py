"""Timing of appendages that carry bodies: a rule for each appendage alone that keeps every craft,
pose and payload stable.

A tendon of stiffness k and damping d gets the armature `c h^2 k + h d / 2`. With `c = 1/12` the
coupled poles of any tree are right to fourth order in the step. Under a semi-implicit step the tree
is stable if for every appendage alone, its root free,

    S + diag((c - 1/4) x^2) > 0,    S = condensed M_hh - P^T R^-1 P,    x = h sqrt(k)

since the matrices of the tree are a congruence of those of its parts and what they carry only adds
mass. Of all c that meet it those are taken whose armature stores the least kinetic energy where
root and load accelerate slowly: `minimise sum_k f_k^2/k^2 c_k x_k^2`, f the force on a mode.

Theory: docs/theory.md, section 9.
"""

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, eigh

from beamchain.engine.bench import mass_of_bodies
from beamchain.engine.library import hangs_on, mujoco
from beamchain.engine.linearise import mass_matrix
from beamchain.engine.mount import motion
from beamchain.engine.operating_point import quiet_copy, rest_point
from beamchain.ports.motions import Array, offset_matrix
from beamchain.steps.forms import ModeTime, TendonValues
from beamchain.steps.integrators import SCHEMES, continuous_poles
from beamchain.steps.modal import Modal, condensed_mass

EXACT = 1.0 / 12.0  # of h^2 k: the poles are right to fourth order
LIMIT = 0.25  # of h^2 k: stable by itself, whatever the mass; RK4: 1/8
ROOM = 0.02  # of S that is left over at least
NOTHING = 1e-12  # of the mass of other bodies: none at all would be singular
START = 0.3  # above the limit, where the search begins
GAP = 1e-3  # of the objective at which the search ends
NEWTON_STEPS = 40
NAME = re.compile(r"(?:mode|filler)\d+(?:_(?:xy|xz|torsion|axial)\d*)?$")


class Alone(NamedTuple):
    """The modal tendons of one appendage.

    Args:
        tendons: `(n,)` their places in `Modal`.
        held, free: `(n, n)` condensed mass of their lengths, the root held, and free, without what
            the appendage carries.
        force: `(n, 6)` on each mode per unit acceleration of the root, what it carries included,
            over the square root of the mass that moves so.
    """

    tendons: NDArray[np.intp]
    held: Array
    free: Array
    force: Array


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
        held, spread = condensed_mass(mass, rows)
        condensed = condensed_mass((free + free.T) / 2.0, rows)[0]
        load, felt = _load(model, data, first, bodies, dofs)
        size = np.sqrt(np.maximum(np.diag(rigid + load), 1e-300))
        out.append(Alone(tendons, held, condensed, ((momentum + felt) @ spread / size[:, None]).T))
    return out


def _load(
    model: "mujoco.MjModel",
    data: "mujoco.MjData",
    root: int,
    bodies: list[int],
    dofs: NDArray[np.intp],
) -> tuple[Array, Array]:
    """As `_root`, of what hangs on the links of an appendage, taken as frozen to them."""
    origin = data.xpos[root]
    rigid = np.zeros((6, 6))
    momentum = np.zeros((6, dofs.size))
    for child in range(1, model.nbody):
        if child in bodies or int(model.body_parentid[child]) not in bodies:
            continue
        carried = [i for i in range(model.nbody) if hangs_on(model, i, child)]
        link = int(model.body_parentid[child])
        mass = mass_of_bodies(model, data, carried, data.xpos[child], np.eye(3))
        shift = offset_matrix(data.xpos[child] - origin)
        rigid += shift.T @ mass @ shift
        axes = np.eye(3)
        by_link = motion(model, data, link, data.xpos[child], axes)[:, dofs]
        momentum += shift.T @ mass @ by_link
    return rigid, momentum


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
        by_dofs = np.vstack([translation, rotation])[:, dofs]
        axes = data.ximat[body].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
        mass = block_diag(float(model.body_mass[body]) * np.eye(3), inertia)
        momentum += offset_matrix(data.xipos[body] - origin).T @ mass @ by_dofs
    return rigid, momentum


def tree_form(
    model: "mujoco.MjModel", modal: Modal, integrator: str, timestep: float
) -> TendonValues:
    """Armature of every modal tendon of a model that is not timed; dampings stay."""
    h = float(timestep)
    is_rk4 = integrator == "RK4"
    low, limit = (0.0, LIMIT / 2.0) if is_rk4 else (EXACT, LIMIT)
    squares = h**2 * modal.stiffness
    factors = np.full(squares.size, low)
    largest = 0.0
    for alone in appendages_alone(model, modal):
        x2 = squares[alone.tendons]
        price = np.sum(alone.force**2, axis=1) / x2
        own = least_factors(alone.free, x2, price, low, limit)
        factors[alone.tendons] = own
        values = eigh(np.diag(x2), alone.free + np.diag(own * x2), eigvals_only=True)
        largest = max(largest, float(values[-1]))
    late = h * modal.damping / 2.0
    if is_rk4:
        late = np.zeros_like(late)
    elif SCHEMES[integrator].implicit_damping:
        late = -late
    armature = np.maximum(factors * squares + late, 0.0)
    zeta = modal.damping / (2.0 * modal.frequency)
    poles = continuous_poles(modal.frequency, zeta)[0]
    slowed = factors > low + 0.01
    modes = tuple(
        ModeTime(
            name=modal.names[i],
            frequency=float(modal.frequency[i]),
            ratio=float(zeta[i]),
            mass=1.0 + float(armature[i]),
            damping=float(modal.damping[i]),
            pole=complex(poles[i]),
            slowed=bool(slowed[i]),
            clamped=False,
        )
        for i in range(len(modal.names))
    )
    phase = float(np.sqrt(np.max(squares[~slowed], initial=0.0)))
    return TendonValues(modal.damping, armature, phase, largest, modes)


def least_factors(free: Array, x2: Array, price: Array, low: float, limit: float) -> Array:
    """The factors `c >= low` of least `sum price c` with `free + diag((c - limit) x2) > 0`.

    A convex program, by Newton's method on a barrier (S. Boyd and L. Vandenberghe, Convex
    Optimization, 2004, section 11.3). `x2` `(n,)`: squared phase per step of the tendons.
    """
    spare = (1.0 - ROOM) * free
    if np.linalg.eigvalsh(spare - np.diag((limit - low) * x2))[0] > 0.0:
        return np.full(x2.size, low)
    price = np.asarray(price / price.sum() + 1e-12, dtype=np.float64)
    c: Array = np.full(x2.size, limit + START)
    weight = 1.0

    def value(at: Array) -> float:
        gap = at - low
        if np.any(gap <= 0.0):
            return float("inf")
        try:
            root = np.linalg.cholesky(spare + np.diag((at - limit) * x2))
        except np.linalg.LinAlgError:
            return float("inf")
        barrier = 2.0 * np.sum(np.log(np.diag(root))) + np.sum(np.log(gap))
        return float(price @ at - weight * barrier)

    while 2.0 * x2.size * weight > GAP * float(price @ (c - low)):
        for _ in range(NEWTON_STEPS):
            inverse = np.linalg.inv(spare + np.diag((c - limit) * x2))
            gap = c - low
            slope = price - weight * (np.diag(inverse) * x2 + 1.0 / gap)
            curve = weight * (np.outer(x2, x2) * inverse**2 + np.diag(1.0 / gap**2))
            step = np.asarray(-np.linalg.solve(curve, slope), dtype=np.float64)
            decrease = float(-slope @ step)
            if decrease < 1e-9 * weight:
                break
            length = 1.0
            while value(c + length * step) > value(c) - 0.1 * length * decrease and length > 1e-9:
                length /= 2.0
            c = np.asarray(c + length * step, dtype=np.float64)
        weight *= 0.2
    return c
