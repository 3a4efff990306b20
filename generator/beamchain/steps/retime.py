"""Making a compiled model exact in time for a step, in place: armature and damping on its modal tendons.

**Form 2** gives every mode of the held appendage the mass and damping of `beamchain.steps.discrete`. Coefficients stay,
nothing is asked of the hub. The modes of the whole craft are then exact to fourth order in the step, and the nearer to
exact the heavier the hub.

**Form 3** is for one craft: with its coupled modes `v_i`, `a_i = K v_i/w_i^2`, stiffness and added inertia are
`K = sum w_i^2 a_i a_i^T` and `sum (m'_i - 1) a_i a_i^T`: diagonal in the same vectors. So every tendon becomes a coupled mode
of the craft, with coefficients `a_i`, and every one is exact. Damping becomes modal in the coupled modes: each has its
true pole, what couples two of them is left out and stated. Several appendages: tendons cannot reach from one
to the next (MuJoCo drops armature between branches), so that each keeps its own block, and the poles are near.

**Form 4** is form 2, tuned for one craft: armature and damping of the tendons are changed further until the craft's own
poles are exact (`beamchain.steps.tune`). Coefficients, stiffness and all of the damping stay, several appendages are exact too
unless two are alike, and taking it out is exact to the bit.

**Any step is stable**: modes beyond the phase limit are slowed. Where appendages couple through a light hub the limit is
lowered until `h^2 lambda_max` of the tendons' springs and dampers on the craft is below 3.8 (RK4: 7.6), of 4 (8) allowed.

Only `tendon_armature`, `tendon_damping`, `tendon_solimp_lim` (the mark) change, for form 3 `tendon_stiffness`,
`wrap_prm`, `tendon_length0` and `tendon_lengthspring` too; the model's own step and integrator (`opt`) are the caller's.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import linear_sum_assignment

from beamchain.checks import not_negative, one_of
from beamchain.engine.forces import wraps
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import INTEGRATORS, NUMBERS, mass_matrix
from beamchain.errors import EngineError, InputError
from beamchain.ports.motions import Array
from beamchain.steps import discrete
from beamchain.steps.modal import (
    FORMS,
    JOINT,
    UNMARKED,
    MadeFor,
    Modal,
    condensed,
    foreign,
    modal_tendons,
)
from beamchain.steps.tune import tune

T = TypeVar("T")
MARGIN = {"RK4": 7.6}  #: `h^2 lambda_max` allowed; of 8
SEMI_IMPLICIT_MARGIN = 3.8  #: the same for the others; of 4
EXACT = 1e-6  # pole error below which tuning is taken to have succeeded
LOWEST = 0.05  # [rad] phase below which the limit is not lowered
UNIT_MASS = 1e-4  # by which the modal mass of a held appendage's mode may miss 1 before the tendon is not ours
ARRAYS = (
    "tendon_armature",
    "tendon_damping",
    "tendon_solimp_lim",
    "tendon_stiffness",
    "tendon_length0",
    "tendon_lengthspring",
    "wrap_prm",
)


@dataclass(frozen=True)
class ModeTime:
    """One mode made exact in time.

    Args:
        name: of its tendon; `coupled<k>` where form 3 laid no mode on one tendon alone.
        frequency: [rad/s] that it should show; form 2: of the held appendage, form 3: of the craft.
        ratio: of damping.
        mass: `m'`, its tendon's armature and 1.
        damping: `c'` of its tendon [1/s].
        pole: that its mass and damping place [1/s], `log(z)/h`; of several appendages' blocks only nearly that of the craft.
        slowed: it is beyond the phase limit.
        clamped: the integrator would need negative armature; its pole is only near.
    """

    name: str
    frequency: float
    ratio: float
    mass: float
    damping: float
    pole: complex
    slowed: bool
    clamped: bool


@dataclass(frozen=True, eq=False)
class Retimed:
    """What `retime` did to a model.

    Args:
        timestep: [s]; 0: the timing was taken out.
        integrator: MuJoCo's name.
        form: 2, 3 or 4.
        phase: [rad] per step, the limit beyond which modes were slowed.
        lambda_max: `h^2 lambda_max` of the tendons' springs and dampers on the craft; stable below 4 (RK4: 8).
        left_out: largest part of the damping that couples two coupled modes and was left out, against the geometric mean of
            their own; 0 with form 2.
        modes: one per modal tendon.
        before: the arrays as they were, for `undo`.
    """

    timestep: float
    integrator: str
    form: int
    phase: float
    lambda_max: float
    left_out: float
    modes: tuple[ModeTime, ...]
    before: Mapping[str, Array]

    @property
    def lowered(self) -> bool:
        """The phase limit had to be lowered for this craft."""
        return self.phase < discrete.SCHEMES[self.integrator].phase

    def undo(self, model: "mujoco.MjModel") -> None:
        """Every array back as it was before the call, bit for bit.

        Args:
            model: the one that was given, or one with the same tendons.
        """
        for name, values in self.before.items():
            getattr(model, name)[:] = values


def retime(
    model: "mujoco.MjModel", timestep: float, integrator: str | None = None, *, form: int = 2, qpos: Array | None = None
) -> Retimed:
    """Make the appendages of a model exact in time for a step, in place.

    Whatever it was made for before is taken out first, so that calls do not add up. `model.opt` is not touched: run the model
    at this step, and give the input as `HeldInput` does.

    Args:
        model: compiled; arrays change, its topology does not.
        timestep: [s]; 0 takes the timing out: the model is as before, bit for bit (after form 3: to rounding; its
            `Retimed.undo` is exact).
        integrator: MuJoCo's name; the model's own where left out. RK4: only modes beyond its limit are slowed;
            "discrete": nothing is changed, it is stable at every step and cannot be made exact.
        form: 2, 3 or 4, see above. 4 needs Euler, implicit or implicitfast; otherwise it is 2.
        qpos: pose in which the craft's coupling is looked at; the initial one where left out.

    Raises:
        InputError: the model has no modal tendons, or they do not allow form 3.

    Example:
        >>> model.opt.timestep = 0.25
        >>> done = retime(model, model.opt.timestep)
        >>> [mode.slowed for mode in done.modes]
        [False, False, False]
    """
    h = not_negative("timestep", float(timestep), "s")
    one_of("form", str(form), [str(f) for f in FORMS])
    name = NUMBERS[int(model.opt.integrator)] if integrator is None else integrator
    one_of("integrator", name, tuple(discrete.SCHEMES))
    modal = modal_tendons(model)
    if not modal.names:
        raise foreign("retiming")
    before = {array: np.array(getattr(model, array), dtype=np.float64) for array in ARRAYS}
    _take_out(model, modal, qpos)
    if h == 0.0:
        return Retimed(0.0, name, form, discrete.SCHEMES[name].phase, 0.0, 0.0, (), MappingProxyType(before))
    if name not in INTEGRATORS:
        raise InputError(f"this MuJoCo has no integrator {name!r}.")
    modal = modal_tendons(model)
    try:
        c = _coupled_mass(model, modal, qpos)
        plan = _form3(model, modal, c, name, h) if form == 3 else _form2(modal, c, name, h)
        if form == 4:
            plan = _form4(modal, c, name, h, plan)
    except BaseException:
        for array, values in before.items():
            getattr(model, array)[:] = values
        raise
    _write(model, modal, plan, MadeFor(h, name, form))
    return Retimed(
        h, name, form, plan.phase, plan.lambda_max, plan.left_out, plan.modes, MappingProxyType(before)
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Plan:
    """Numbers for the tendons; `turn` `(n, n)`: new coefficients are `turn @ rows`, None: as they are."""

    stiffness: Array
    damping: Array
    armature: Array
    turn: Array | None
    phase: float
    lambda_max: float
    left_out: float
    modes: tuple[ModeTime, ...]


def _coupled_mass(model: "mujoco.MjModel", modal: Modal, qpos: Array | None) -> Array:
    """`(n, n)` what the modal coordinates weigh with the craft following; the tendons' names are checked by their masses."""
    mass = mass_matrix(model, qpos)
    for i, name in enumerate(modal.names):
        span = np.flatnonzero(modal.rows[i])
        own = float(
            modal.rows[i, span] @ np.linalg.solve(mass[np.ix_(span.tolist(), span.tolist())], modal.rows[i, span])
        )
        if abs(own - 1.0) > UNIT_MASS:
            raise InputError(
                f"tendon {name!r} has the name of a modal tendon, but the mass {1.0 / own:.6g} of its mode is not 1; rename "
                "it if it is not an appendage's, or write the appendage again."
            )
    return condensed(mass, modal.rows)[0]


def stability(integrator: str, c: Array, stiffness: Array, damping: Array, armature: Array, timestep: float) -> float:
    """`h^2 lambda_max` of modal springs and dampers on a craft: the step is stable below 4, RK4's below 8.

    The pencil is `(h^2 K + 2 h D, C + mu)` where tendon damping is explicit, `(h^2 K - 2 h D, C + mu)` where it is
    implicit (a pole leaves the unit circle at z = -1). For RK4 it is `(h^2 K, C + mu)` undamped; damped, 8 times the squared
    ratio of the step to the largest one that its polynomial takes.

    Args:
        integrator: MuJoCo's name.
        c: `(n, n)` condensed mass of the modal coordinates.
        stiffness: `(n, n)` K in modal coordinates.
        damping: `(n, n)` D.
        armature: `(n, n)` mu.
        timestep: h [s].
    """
    h = float(timestep)
    if integrator == "RK4" and np.any(damping):
        return _explicit(c + armature, stiffness, damping, h)
    sign = 0.0 if integrator == "RK4" else -1.0 if discrete.SCHEMES[integrator].implicit_damping else 1.0
    return float(np.max(eigh(h**2 * stiffness + 2.0 * sign * h * damping, c + armature, eigvals_only=True)))


def _explicit(mass: Array, stiffness: Array, damping: Array, h: float) -> float:
    n = mass.shape[0]
    root = np.linalg.inv(np.linalg.cholesky(mass))
    k, d = root @ stiffness @ root.T, root @ damping @ root.T
    poles = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-(h**2) * k, -h * d]])).astype(np.complex128)
    return 8.0 * max(1.0 / discrete.runge_kutta_limit(complex(p)) ** 2 for p in poles if p.imag >= 0.0)


def _limit(integrator: str) -> float:
    return MARGIN.get(integrator, SEMI_IMPLICIT_MARGIN)


def _form2(modal: Modal, c: Array, integrator: str, h: float) -> _Plan:
    w = modal.frequency
    zeta = modal.damping / (2.0 * w)

    def at(phase: float) -> tuple[discrete.Timed, float]:
        t = discrete.timed(integrator, w, zeta, h, phase=phase)
        return t, stability(
            integrator, c, np.diag(modal.stiffness), np.diag(t.damping), np.diag(t.mass - 1.0), h
        )  # fmt: skip

    (t, largest), phase = _lowered(integrator, at)
    return _Plan(
        modal.stiffness, t.damping, t.mass - 1.0, None, phase, largest, 0.0,
        _modes(modal.names, integrator, w, zeta, modal.stiffness, t, h),
    )  # fmt: skip


def _form4(modal: Modal, c: Array, integrator: str, h: float, plan: _Plan) -> _Plan:
    """Form 2's plan, tuned; or itself where the integrator cannot be exact or tuning would cost stability."""
    if not discrete.SCHEMES[integrator].exact:
        return plan
    _, _, poles = coupled_modes(c, modal.stiffness, modal.damping)
    first, second = poles.T
    turn = np.maximum(np.abs(first), np.abs(second)) * h
    for phase in dict.fromkeys((discrete.SCHEMES[integrator].phase, plan.phase)):
        # tuned to the craft's own poles, the usual limit may do where form 2 had to lower it
        wanted = np.exp(first * h * np.where(turn > phase, phase / turn, 1.0))
        if np.any(np.imag(wanted) <= 0.0):  # overdamped
            return plan
        found = tune(integrator, c, modal.stiffness, plan.armature, plan.damping, wanted, h)
        largest = stability(integrator, c, np.diag(modal.stiffness), np.diag(found.damping), np.diag(found.armature), h)
        if largest <= _limit(integrator) and (found.error < EXACT or phase == plan.phase):
            t = discrete.Timed(
                1.0 + found.armature,
                found.damping,
                np.array([mode.slowed for mode in plan.modes]),
                np.array([mode.clamped for mode in plan.modes]),
            )
            w = modal.frequency
            modes = _modes(modal.names, integrator, w, modal.damping / (2.0 * w), modal.stiffness, t, h)
            return replace(
                plan, armature=found.armature, damping=found.damping, lambda_max=largest, phase=phase, modes=modes
            )
    return plan


def _lowered(integrator: str, at: Callable[[float], tuple[T, float]]) -> tuple[tuple[T, float], float]:
    """What `at` gives at the largest phase limit at which the craft is stable."""
    phase = discrete.SCHEMES[integrator].phase
    best = at(phase)
    if not np.isfinite(phase) or best[1] <= _limit(integrator):
        return best, phase
    low, high = LOWEST, phase
    best = at(low)
    for _ in range(14):
        middle = float(np.sqrt(low * high))
        found = at(middle)
        if found[1] <= _limit(integrator):
            low, best = middle, found
        else:
            high = middle
    return best, low


def _modes(
    names: tuple[str, ...], integrator: str, w: Array, zeta: Array, stiffness: Array, t: discrete.Timed, h: float
) -> tuple[ModeTime, ...]:
    z = discrete.step_pole(integrator, t.mass, t.damping, stiffness, h)
    s = np.log(z) / h
    return tuple(
        ModeTime(n, float(a), float(b), float(m), float(c), complex(p), bool(slow), bool(clamp))
        for n, a, b, m, c, p, slow, clamp in zip(names, w, zeta, t.mass, t.damping, s, t.slowed, t.clamped, strict=True)
    )


def coupled_modes(c: Array, stiffness: Array, damping: Array) -> tuple[Array, Array, "discrete.Complex"]:
    """Undamped coupled modes, and the pole of each with all of the damping.

    Args:
        c: `(n, n)` condensed mass of the modal coordinates.
        stiffness: `(n,)` of the tendons.
        damping: `(n,)` of the tendons.

    Returns:
        `(n,)` frequencies [rad/s], `(n, n)` modes in columns, `y^T C y = 1`, and `(n, 2)` both poles [1/s].
    """
    n = stiffness.size
    # for 1/w^2: the slow modes keep all their digits beside very fast ones
    inverse, shapes = eigh(c, np.diag(stiffness))
    w = 1.0 / np.sqrt(inverse[::-1])
    y = shapes[:, ::-1] * w
    own = np.einsum("ki,k,ki->i", y, damping, y)
    first, second = discrete.continuous_poles(w, own / (2.0 * w))
    poles = np.stack([first, second], axis=1)
    if np.any(damping > 0.0):
        d = y.T @ (damping[:, None] * y)
        f = np.block([[np.zeros((n, n)), np.diag(w)], [-np.diag(w), -d]])  # balanced: states w q, q'
        s = np.linalg.eigvals(f).astype(np.complex128)
        upper = s[s.imag > 1e-9 * np.abs(s)]
        if upper.size == n:
            order = linear_sum_assignment(np.abs(first[:, None] - upper[None, :]) / w[:, None])[1]
            poles = np.stack([upper[order], np.conj(upper[order])], axis=1)
    return w, y, poles


def _form3(model: "mujoco.MjModel", modal: Modal, c: Array, integrator: str, h: float) -> _Plan:
    groups = modal.groups()
    _check_groups(model, modal, groups)
    n = modal.stiffness.size
    k = np.diag(modal.stiffness)
    w, y, poles = coupled_modes(c, modal.stiffness, modal.damping)
    a = c @ y  # rows of its transpose: the coupled coordinates over the modal ones
    couples = y.T @ (modal.damping[:, None] * y)
    own = np.sqrt(np.maximum(np.diag(couples), 1e-300))
    left_out = float(np.max(np.abs(couples - np.diag(np.diag(couples))) / np.outer(own, own), initial=0.0))
    flexible = np.linalg.inv(c)

    def at(phase: float) -> tuple[tuple[discrete.Timed, Array, Array, Array, Array], float]:
        t = discrete.placed(
            integrator, w**2, poles[:, 0], poles[:, 1], h, phase=phase, damping=np.diag(couples)
        )  # fmt: skip
        mu, d = (a * (t.mass - 1.0)) @ a.T, (a * t.damping) @ a.T
        turn = np.zeros((n, n))
        stiffness, damping, armature = np.zeros(n), np.zeros(n), np.zeros(n)
        for group in groups:
            g = np.ix_(group.tolist(), group.tolist())
            if len(groups) == 1:
                rows, scale = a.T, w**2
                stiff, drag, extra = w**2, t.damping, t.mass - 1.0
            else:
                # u = V^T K y: springs of 1 each; scaled to unit mass with everything else free
                v = eigh((mu[g] + mu[g].T) / 2.0, k[g])[1]
                rows = v.T @ k[g]
                scale = np.einsum("ij,jk,ik->i", rows, flexible[g], rows)
                rows = rows / np.sqrt(scale)[:, None]
                stiff = scale
                drag = scale * np.einsum("ji,jk,ki->i", v, d[g], v)
                extra = scale * np.einsum("ji,jk,ki->i", v, mu[g], v)
            order = np.argsort(scale)  # ascending, laid on the tendons by ascending frequency
            place = group[np.argsort(modal.stiffness[group])]
            signs = np.sign(np.einsum("ij,ji->i", rows[order], flexible[np.ix_(group.tolist(), place.tolist())]))
            turn[np.ix_(place.tolist(), group.tolist())] = rows[order] * np.where(signs == 0.0, 1.0, signs)[:, None]
            stiffness[place], damping[place] = stiff[order], np.maximum(drag[order], 0.0)
            armature[place] = np.maximum(extra[order], 0.0)
        back = turn.T
        return (t, turn, stiffness, damping, armature), stability(
            integrator, c, k, (back * damping) @ turn, (back * armature) @ turn, h
        )

    ((t, turn, stiffness, damping, armature), largest), phase = _lowered(integrator, at)
    zeta = -np.real(poles[:, 0]) / np.abs(poles[:, 0])
    names = (
        tuple(modal.names[i] for i in np.argsort(modal.stiffness))
        if len(groups) == 1
        else tuple(f"coupled{i + 1}" for i in range(n))
    )
    modes = _modes(names, integrator, np.abs(poles[:, 0]), zeta + 0.0, w**2, t, h)
    return _Plan(stiffness, damping, armature, turn, phase, largest, left_out, modes)


def _check_groups(model: "mujoco.MjModel", modal: Modal, groups: "list[NDArray[np.intp]]") -> None:
    """Tendons may exchange coefficients where they hold the same joints, each once, and groups share none."""
    seen = np.zeros(model.nv, dtype=np.intp)
    for group in groups:
        seen += modal.rows[group[0]] != 0.0
        counts = {int(model.tendon_num[modal.index[i]]) for i in group}
        if counts != {int(np.count_nonzero(modal.rows[group[0]]))}:
            raise InputError(
                f"form 3 needs tendons that hold every joint once; {modal.names[group[0]]!r} does not. Take form 2."
            )
    if np.any(seen > 1):
        raise InputError(
            "form 3 needs tendons that hold either the same joints or none in common; those of "
            f"{modal.names[0]!r} and others overlap. Take form 2."
        )


def _take_out(model: "mujoco.MjModel", modal: Modal, qpos: Array | None) -> None:
    """The tendons as they were before they were made exact in time."""
    forms = [None if mark is None else mark.form for mark in modal.made_for]
    for i, mark in zip(modal.index, modal.made_for, strict=True):
        if mark is not None:
            model.tendon_damping[i] = model.tendon_solimp_lim[i, 3]
            model.tendon_armature[i] = 0.0
    if 3 in forms:
        mass = mass_matrix(model, qpos)
        for group in modal.groups():
            if forms[group[0]] == 3:
                _held_modes(model, modal, group, mass)
    for i, mark in zip(modal.index, modal.made_for, strict=True):
        if mark is not None:
            model.tendon_solimp_lim[i] = UNMARKED


def _held_modes(model: "mujoco.MjModel", modal: Modal, group: "NDArray[np.intp]", mass: Array) -> None:
    """Coefficients of the held appendage's modes, worked out from its springs and masses."""
    span = np.flatnonzero(modal.rows[group[0]])
    rows = modal.rows[np.ix_(group.tolist(), span.tolist())]
    flexible = rows @ np.linalg.solve(mass[np.ix_(span.tolist(), span.tolist())], rows.T)  # B Q^-1 B^T
    root = np.linalg.cholesky((flexible + flexible.T) / 2.0)
    stiffness, u = np.linalg.eigh(root.T @ (modal.stiffness[group][:, None] * root))
    new: Array = np.asarray(u.T @ np.linalg.solve(root, rows), dtype=np.float64)  # unit masses, then along the modes
    wanted = model.tendon_solimp_lim[modal.index[group], 4]
    order = np.argsort(np.argsort(wanted))  # ascending, as the eigenvalues are
    if np.max(np.abs(stiffness[order] / wanted - 1.0)) > 1e-5:
        raise EngineError(
            f"tendons of {modal.names[group[0]]!r} no longer have the modes they had before form 3 was applied: stiffness, "
            "masses or joints were changed since; compile the model again."
        )
    metric = np.linalg.solve(mass[np.ix_(span.tolist(), span.tolist())], rows.T)
    for j, i in enumerate(group):
        row = new[order[j]]
        _coefficients(model, int(modal.index[i]), span, row if row @ metric[:, j] >= 0.0 else -row)
        model.tendon_stiffness[modal.index[i]] = wanted[j]


def _coefficients(model: "mujoco.MjModel", tendon: int, dofs: "NDArray[np.intp]", values: Array) -> None:
    """New coefficients of a fixed tendon; its resting length stays the length at rest."""
    at = {int(d): float(v) for d, v in zip(dofs, values, strict=True)}
    length = 0.0
    for wrap in wraps(model, tendon):
        joint = int(model.wrap_objid[wrap])
        assert int(model.wrap_type[wrap]) == JOINT
        model.wrap_prm[wrap] = at[int(model.jnt_dofadr[joint])]
        length += float(model.wrap_prm[wrap]) * float(model.qpos0[int(model.jnt_qposadr[joint])])
    model.tendon_length0[tendon] = length
    model.tendon_lengthspring[tendon] = length


def _write(model: "mujoco.MjModel", modal: Modal, plan: _Plan, mark: MadeFor) -> None:
    for j, i in enumerate(modal.index):
        model.tendon_solimp_lim[i] = (
            mark.timestep, INTEGRATORS[mark.integrator], mark.form, modal.damping[j], modal.stiffness[j],
        )  # fmt: skip
    model.tendon_armature[modal.index] = plan.armature
    model.tendon_damping[modal.index] = plan.damping
    if plan.turn is None:
        return
    model.tendon_stiffness[modal.index] = plan.stiffness
    rows = plan.turn @ modal.rows
    for j, i in enumerate(modal.index):
        span = np.flatnonzero(modal.rows[j])
        _coefficients(model, int(i), span, rows[j, span])
