"""One step of a compiled file as a matrix, at a pose,
and how far its poles are from those of exact motion.

The matrices of motion are those of `engine.linear`. What the integrator makes of them is its own
formula, which differences of `mj_step` confirm (tests/steps/test_time_error.py); the step of
"discrete" is taken by such differences.

Theory: docs/theory.md, section 5; the definition of the error: docs/time.md.
"""

import copy
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.linalg import eigh, solve_triangular
from scipy.optimize import linear_sum_assignment

from beamchain.engine.library import mujoco
from beamchain.engine.linear import STENCIL, linear_at
from beamchain.engine.linearise import INTEGRATORS, NUMBERS, euler_damps_implicitly
from beamchain.engine.operating_point import pose_words, rest_point, still_copy
from beamchain.ports.compare import compared_ratios
from beamchain.ports.motions import Array
from beamchain.steps.elements import elements
from beamchain.steps.integrators import PHASE, SCHEMES, Complex, StepMap
from beamchain.steps.modal import FILLER, modal_tendons

# rad or m by which the step of "discrete" is differenced: it is not linear in the pose
MOVED = 1e-3
SLACK = 3e-14  # of the largest eigenvalue of the stiffness: below it, rounding
UNDAMPED = 1e-12  # of the largest damping: below it, rounding
GROWN = 1e-6  # by which |z| may exceed 1, or a damping ratio 0: rounding
RIGID = 1e-5  # |s h| below which a pole is rigid motion
EXACT = 1e-6  # error of a pole below which a file is called exact in time
WRONG = 1e-3  # error of a pole above which a mode is called wrong
MOSTLY = 0.5  # share of the strain energy that makes a mode one of those kept


@dataclass(frozen=True, eq=False)
class Motion:
    """`y'' + D y' + diag(squares) y = shapes^T f` of a compiled model at a pose, `q = shapes y`.

    Args:
        shapes: `(nv, nv)`; rigid motions that nothing damps come first.
        squares: `(nv,)` eigenvalues of the stiffness [1/s^2]; 0: rigid.
        damping: `(nv, nv)` all of it [1/s].
        implicit: `(nv, nv)` the share of the damping that the integrator takes at
            the end of the step.
        loose: number of rigid motions that nothing damps.
        timestep: [s].
        integrator: MuJoCo's name.
        difference: `(2 nv, 2 nv)` one step less the unit matrix, over the states (y, h y').
        drive: `(2 nv, nv)` what a force on each y, held over the step, makes of the states.
    """

    shapes: Array
    squares: Array
    damping: Array
    implicit: Array
    loose: int
    timestep: float
    integrator: str
    difference: Array
    drive: Array

    def flow(self) -> Array:
        """`(2 nv, 2 nv)` of the continuous motion times the step, over the states (y, h y')."""
        h = self.timestep
        n = self.squares.size
        return np.block(
            [[np.zeros((n, n)), np.eye(n)], [-(h**2) * np.diag(self.squares), -h * self.damping]]
        )

    def continuous_poles(self) -> Complex:
        """`(2 nv,)` poles times the step, `s h`."""
        return self._poles(self.flow())

    def step_poles(self) -> Complex:
        """`(2 nv,)` poles of the step, less one."""
        return self._poles(self.difference)

    def with_tendons(
        self, rows: Array, stiffness: Array, damping: Array, armature: Array
    ) -> StepMap:
        """The step by formula, with so much more stiffness, damping and armature `(n,)` on tendons
        that have the `rows` `(n, nv)` by these coordinates."""
        more, damped, heavier = (
            rows.T @ (values[:, None] * rows) for values in (stiffness, damping, armature)
        )
        late = SCHEMES[self.integrator].implicit_damping
        return StepMap(
            self.integrator,
            np.diag(self.squares) + more,
            self.implicit + damped * late,
            self.damping - self.implicit + damped * (not late),
            self.timestep,
            mass=np.eye(self.squares.size) + heavier,
        )

    @property
    def growth(self) -> float:
        """The largest |z| of the step; above 1 it is unstable."""
        return float(np.max(np.abs(1.0 + self.step_poles()), initial=0.0))

    @property
    def grows(self) -> bool:
        """Whether the step is unstable by more than rounding."""
        return self.growth > 1.0 + GROWN

    def _poles(self, matrix: Array) -> Complex:
        # positions in units of the rates they go with
        phase = self.timestep * np.sqrt(np.abs(self.squares))
        scale = np.concatenate([np.where(phase > 0.0, phase, 1.0), np.ones(phase.size)])
        return np.linalg.eigvals(scale[:, None] * matrix / scale).astype(np.complex128)


def motion_at(model: "mujoco.MjModel", qpos: Array | None = None) -> Motion:
    """The motion of a model about a pose, the initial one where left out, without gravity, medium,
    contacts, constraints."""
    still = still_copy(model)
    point = rest_point(still, qpos)
    linear = linear_at(point)
    # M = L L^T, so that L^-1 K L^-T is symmetric
    root = np.linalg.cholesky(linear.mass)
    unrooted = solve_triangular(root, linear.stiffness, lower=True)
    squares, turn = eigh(solve_triangular(root, unrooted.T, lower=True))
    squares = np.where(
        np.abs(squares) <= SLACK * np.max(np.abs(squares), initial=0.0), 0.0, squares
    )
    shapes = solve_triangular(root.T, turn, lower=False)
    rigid = np.flatnonzero(squares == 0.0)
    values, turned = np.linalg.eigh(shapes[:, rigid].T @ linear.damping @ shapes[:, rigid])
    shapes[:, rigid] = shapes[:, rigid] @ turned
    order = np.concatenate([rigid, np.flatnonzero(squares != 0.0)])
    shapes = shapes[:, order]
    squares = squares[order]
    whole = shapes.T @ linear.damping @ shapes
    loose = int(np.sum(values <= UNDAMPED * np.max(np.abs(whole), initial=1e-300)))
    whole[:loose] = 0.0
    whole[:, :loose] = 0.0
    name = NUMBERS[int(still.opt.integrator)]
    h = float(still.opt.timestep)
    implicit = _implicit(still, name, whole, shapes)
    if name == "discrete":
        difference, drive = _by_differences(still, point.qpos, shapes)
    else:
        step = StepMap(name, np.diag(squares), implicit, whole - implicit, h, np.eye(squares.size))
        difference, drive = step.matrices()
    return Motion(
        shapes,
        squares,
        damping=whole,
        implicit=implicit,
        loose=loose,
        timestep=h,
        integrator=name,
        difference=difference,
        drive=drive,
    )


def motion_for(
    model: "mujoco.MjModel", timestep: float, integrator: str, qpos: Array | None
) -> Motion:
    """The motion of a model at another step than its own."""
    out = copy.copy(model)
    out.opt.timestep, out.opt.integrator = timestep, INTEGRATORS[integrator]
    return motion_at(out, qpos)


def grows(model: "mujoco.MjModel", qpos: Array) -> bool:
    """Whether the model's own step makes a motion about a pose grow."""
    return motion_at(model, qpos).grows


def growing_poses(model: "mujoco.MjModel", places: Mapping[str, Array]) -> list[str]:
    """The poses in which the model's own step makes a motion grow, the worst first."""
    motions = {pose: motion_at(model, qpos) for pose, qpos in places.items()}
    growing = [pose for pose in places if motions[pose].grows]
    return sorted(growing, key=lambda pose: motions[pose].growth, reverse=True)


def _implicit(model: "mujoco.MjModel", integrator: str, damping: Array, shapes: Array) -> Array:
    """The damping taken at the end of the step: all of it,
    or under Euler that of joints unless it is switched off."""
    if SCHEMES[integrator].implicit_damping:
        return damping
    if not euler_damps_implicitly(model):
        return np.zeros_like(damping)
    return shapes.T @ (model.dof_damping[:, None] * shapes)


def _by_differences(model: "mujoco.MjModel", qpos: Array, shapes: Array) -> tuple[Array, Array]:
    """The same by differences of `mj_step`."""
    n = model.nv
    h = float(model.opt.timestep)
    data = mujoco.MjData(model)
    back = np.linalg.inv(shapes)
    size = MOVED / np.abs(shapes).max(axis=0)

    def moved(position: Array, rate: Array, push: Array) -> Array:
        mujoco.mj_resetData(model, data)
        data.qpos[:] = qpos
        mujoco.mj_integratePos(model, data.qpos, position, 1.0)
        before = np.array(data.qpos)
        along = np.zeros(n)
        data.qvel[:], data.qfrc_applied[:] = rate, push
        mujoco.mj_step(model, data)
        mujoco.mj_differentiatePos(model, along, 1.0, before, data.qpos)
        return np.concatenate([back @ along, h * (back @ (data.qvel - rate))])

    nothing = np.zeros(n)
    columns: list[Array] = []
    for kind in range(3):
        for i in range(n):
            # a force of one on y alone is its row
            push = size[i] * (shapes[:, i] if kind < 2 else back[i])
            slope = np.zeros(2 * n)
            for place, weight in STENCIL:
                state = [nothing, nothing, nothing]
                state[kind] = place * push / (1.0, h, h**2)[kind]
                slope += weight / size[i] * moved(*state)
            columns.append(slope * (1.0, 1.0, h**2)[kind])
    table = np.array(columns).T
    return table[:, : 2 * n], table[:, 2 * n :]


# -- poles -----------------------------------------------------------------------------------------
@dataclass(frozen=True, eq=False)
class PolePairs:
    """The poles of a file with timing taken out, and those that its step has for them.

    Args:
        wanted: `(k,)` s [1/s].
        shown: `(k,)` `z - 1` of the step.
        error: `(k,)` `|z - exp(s h)| / |exp(s h) - 1|`.
    """

    wanted: Complex
    shown: Complex
    error: Array


def pole_pairs(timed: Motion, plain: Motion) -> PolePairs:
    """The poles of a step and those wanted, rigid ones left out; `plain`:
    the same file with timing taken out."""
    x = plain.continuous_poles()
    stepped = timed.step_poles()
    # a mode that turns by more than PHASE per step is slowed to it,
    # and must not be taken for a slow one
    aim = np.expm1(x * PHASE / np.maximum(np.abs(x.imag), PHASE))
    near = np.abs(stepped[None, :] - aim[:, None]) / np.maximum(np.abs(aim), RIGID)[:, None]
    rows, columns = linear_sum_assignment(np.minimum(near, 1e8) ** 2)
    moving = np.abs(x[rows]) >= RIGID
    rows = rows[moving]
    columns = columns[moving]
    order = np.argsort(np.abs(x[rows]), kind="stable")
    wanted = x[rows][order]
    shown = stepped[columns][order]
    exact = np.expm1(wanted)
    return PolePairs(wanted / plain.timestep, shown, np.abs(shown - exact) / np.abs(exact))


def last_kept(
    model: "mujoco.MjModel", motion: Motion, hinges: Collection[int] | None = None
) -> float:
    """Frequency of the last coupled mode whose strain energy is mostly in modes that are kept
    [rad/s]; 0 without one.

    Kept are the modal tendons but fillers; without any,
    the springs of the degrees of freedom `hinges` (None: all).
    """
    modal = modal_tendons(model)
    kept = [i for i, name in enumerate(modal.names) if not FILLER.search(name)]
    energy = (modal.stiffness[kept, None] * (modal.rows[kept] @ motion.shapes) ** 2).sum(axis=0)
    if not kept:
        joints = [j for j in range(model.njnt) if float(model.jnt_stiffness[j]) > 0.0]
        dofs = [int(model.jnt_dofadr[j]) for j in joints]
        springs = {dof: float(model.jnt_stiffness[j]) for dof, j in zip(dofs, joints, strict=True)}
        taken = [dof for dof in springs if hinges is None or dof in hinges]
        stiffness = np.array([springs[dof] for dof in taken])
        energy = (stiffness[:, None] * motion.shapes[taken] ** 2).sum(axis=0)
    of_kept = motion.squares[energy > MOSTLY * np.maximum(motion.squares, 1e-300)]
    return float(np.sqrt(np.max(of_kept, initial=0.0)))


@dataclass(frozen=True)
class TimeError:
    """The largest error of a pole that the step of a compiled file makes.

    Args:
        error: `|z - exp(s h)| / |exp(s h) - 1|` of the worst pole in the band.
        frequency: its `|s|` [rad/s]; None where no pole lies in the band.
        pose: "rest" or a keyframe.
        step: [s].
        integrator: MuJoCo's name.
        damped_by: the joint of the spacecraft whose damper or servo takes most of the energy that
            the pole loses; empty where the appendages do.
    """

    error: float
    frequency: float | None
    pose: str
    step: float
    integrator: str
    damped_by: str = ""

    @property
    def exact(self) -> bool:
        """Whether the file may be called exact in time."""
        return self.error < EXACT

    @property
    def words(self) -> str:
        """The pole that is off most, and by how much."""
        if self.frequency is None:
            return "no pole lies in the band"
        return (
            f"the pole at {self.frequency:.4g} rad/s"
            f"{', damped by ' + repr(self.damped_by) + ',' if self.damped_by else ''} is off by "
            f"{self.error:.2g} of |z - 1| in {pose_words(self.pose)}"
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


def time_error(
    model: "mujoco.MjModel",
    plain: "mujoco.MjModel",
    poses: Mapping[str, Array],
    band: float | None = None,
    hinges: Collection[int] | None = None,
) -> TimeError:
    """The error of the poles of a file's own step in a band [rad/s], at the worst of its poses.

    `plain`: the same file with timing taken out; without a band:
    up to the last kept coupled mode (`last_kept`).
    """
    name = NUMBERS[int(model.opt.integrator)]
    h = float(model.opt.timestep)
    worst = TimeError(0.0, None, next(iter(poses)), h, name)
    for pose, qpos in poses.items():
        timed = motion_at(model, qpos)
        still = motion_at(at_step_of(plain, model), qpos)
        top = last_kept(plain, still, hinges) * (1.0 + 1e-9) if band is None else band
        pairs = pole_pairs(timed, still)
        inside = np.flatnonzero(np.abs(pairs.wanted) <= top)
        if not inside.size:
            continue
        k = int(inside[np.argmax(pairs.error[inside])])
        if float(pairs.error[k]) > worst.error:
            wanted = complex(pairs.wanted[k])
            by = damped_by(plain, qpos, still, wanted)
            worst = TimeError(float(pairs.error[k]), abs(wanted), pose, h, name, by)
    return worst


def damped_by(model: "mujoco.MjModel", qpos: Array, motion: Motion, pole: complex) -> str:
    """The joint whose damper or servo takes more than half of the energy that a pole [1/s] of the
    continuous motion loses; empty where the appendages do, or nothing does."""
    values, vectors = np.linalg.eig(motion.flow())
    k = int(np.argmin(np.abs(values / motion.timestep - pole)))
    rate = motion.shapes @ vectors[motion.squares.size :, k]
    lost = [
        (one.damping * np.abs(one.row @ rate) ** 2, "" if one.kind == "appendage" else one.name)
        for one in elements(model, qpos)
    ]
    total = sum(power for power, _ in lost)
    name = max(lost, default=(0.0, ""))[1]
    return name if total > 0.0 and sum(p for p, n in lost if n == name) > MOSTLY * total else ""


@dataclass(frozen=True)
class WrongPole:
    """A pole that a step has off by more than 1e-3.

    Args:
        frequency: its `|s|` [rad/s].
        error: `|z - exp(s h)| / |exp(s h) - 1|`.
        damped_by: as of `TimeError`.
    """

    frequency: float
    error: float
    damped_by: str


def lowest_wrong(
    model: "mujoco.MjModel", plain: "mujoco.MjModel", places: Mapping[str, Array]
) -> WrongPole | None:
    """The lowest coupled pole of all poses that the step has off by more than 1e-3;
    None without one."""
    found: list[WrongPole] = []
    for qpos in places.values():
        still = motion_at(at_step_of(plain, model), qpos)
        pairs = pole_pairs(motion_at(model, qpos), still)
        wrong = np.flatnonzero(pairs.error > WRONG)
        if wrong.size:
            k = int(wrong[np.argmin(np.abs(pairs.wanted[wrong]))])
            wanted = complex(pairs.wanted[k])
            by = damped_by(plain, qpos, still, wanted)
            found.append(WrongPole(abs(wanted), float(pairs.error[k]), by))
    return min(found, key=lambda pole: pole.frequency, default=None)


@dataclass(frozen=True)
class ShiftedPeak:
    """A resonance that a step shifts.

    Args:
        frequency: of the mode without the step, `|s|` [rad/s].
        ratio: its damping ratio.
        shift: of its frequency by the step, relative.
        damped: change of its damping ratio by the step, relative.
        change: of the response there, relative to the mode's own.
        mode: what is called so, or moves in it; empty where that is not known.
    """

    frequency: float
    ratio: float
    shift: float
    damped: float
    change: float
    mode: str = ""

    def explains(self, error: float, untimed: float) -> bool:
        """Whether it makes at least half of an error at the step, of which `untimed` is there in
        continuous time."""
        return min(self.change, error - untimed) >= error / 2.0


def shifted_peak(timed: Motion, plain: Motion, omega: float, undamped: float) -> ShiftedPeak | None:
    """The mode nearest to `omega` [rad/s], and what the step makes of its response there.

    Of a mode with the pole s, which the step shows at s', the response `1/(j w - s)` changes by
    `|s' - s| / |j w - s'|`, its damping as it is compared; `plain`: without timing; `undamped`: as
    of `ports.compare.compared_ratios`.
    """
    pairs = pole_pairs(timed, plain)
    ringing = pairs.wanted.imag > 0.0
    if not np.any(ringing):
        return None
    wanted = pairs.wanted[ringing]
    shown = np.log(1.0 + pairs.shown[ringing]) / plain.timestep
    shown = shown.real + 1j * np.abs(shown.imag)
    k = int(np.argmin(np.minimum(np.abs(np.abs(wanted) - omega), np.abs(np.abs(shown) - omega))))
    size = float(np.abs(wanted[k]))
    ratio = float(-wanted[k].real) / size
    size_shown = float(np.abs(shown[k]))
    compared = float(compared_ratios(np.array(ratio), undamped))
    damped = float(-shown[k].real) / size_shown / ratio - 1.0 if compared == ratio else 0.0
    drag = (compared - ratio) * size
    change = np.abs(shown[k] - wanted[k]) / np.abs(1j * omega + drag - shown[k])
    return ShiftedPeak(size, max(ratio, 0.0), size_shown / size - 1.0, damped, float(change))


def at_step_of(plain: "mujoco.MjModel", model: "mujoco.MjModel") -> "mujoco.MjModel":
    """The untimed model with the step of the timed one."""
    out = copy.copy(plain)
    out.opt.timestep, out.opt.integrator = model.opt.timestep, model.opt.integrator
    return out
