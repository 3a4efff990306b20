"""What a compiled model does, from MuJoCo's own numbers: masses, springs, one step, marks of time;
nothing of the package."""

import copy
from pathlib import Path

import mujoco
import numpy as np

#: MuJoCo's numbers of the integrators that the installed version has
INTEGRATORS = {
    name: int(getattr(mujoco.mjtIntegrator, f"mjINT_{name.upper()}"))
    for name in ("Euler", "implicit", "implicitfast", "discrete", "RK4")
    if hasattr(mujoco.mjtIntegrator, f"mjINT_{name.upper()}")
}
NAMES = {number: name for name, number in INTEGRATORS.items()}
UNMARKED = (0.9, 0.95, 0.001, 0.5, 2.0)  # MuJoCo's own solimplimit
EPSILON = 1e-6  # of central differences


def compiled(source) -> mujoco.MjModel:
    """A model from MJCF text or a path."""
    if isinstance(source, str) and source.lstrip().startswith("<"):
        return mujoco.MjModel.from_xml_string(source)
    return mujoco.MjModel.from_xml_path(str(Path(source)))


def first(values) -> np.ndarray:
    """Springs and dampers of MuJoCo: the linear term,
    also where a version keeps polynomials beside it."""
    values = np.asarray(values, dtype=float)
    return values if values.ndim == 1 else values[:, 0]


def mass_matrix(model, qpos=None) -> np.ndarray:
    """`(nv, nv)` with the armatures of joints and tendons, at a pose,
    the initial one where left out."""
    data = mujoco.MjData(model)
    if qpos is not None:
        data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    column = np.zeros(model.nv)
    for i, unit in enumerate(np.eye(model.nv)):
        mujoco.mj_mulM(model, data, column, unit)
        mass[:, i] = column
    return (mass + mass.T) / 2.0


def quiet(model):
    """A copy in which only springs, dampers and actuators act, springs slack at rest."""
    model = copy.copy(model)
    flags = mujoco.mjtDisableBit
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= int(
        flags.mjDSBL_CONTACT | flags.mjDSBL_CONSTRAINT | flags.mjDSBL_CLAMPCTRL
    )
    model.qpos_spring[:] = model.qpos0
    model.tendon_lengthspring[:] = model.tendon_length0[:, None]
    return model


def by_differences(model, qpos=None, step=1e-3):
    """Mass, damping and stiffness matrix at a pose, the initial one where left out, from
    differences of all passive and actuator forces."""
    data, still = mujoco.MjData(model), np.zeros(model.nv)

    def force(moved, rate):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = model.qpos0 if qpos is None else qpos
        mujoco.mj_integratePos(model, data.qpos, moved, 1.0)
        data.qvel[:] = rate
        mujoco.mj_forward(model, data)
        return data.qfrc_passive + data.qfrc_actuator

    steps = step * np.eye(model.nv)
    damping = [force(still, -e) - force(still, e) for e in steps]
    stiffness = [force(-e, still) - force(e, still) for e in steps]
    return (mass_matrix(model, qpos), *(np.array([damping, stiffness]).swapaxes(1, 2) / 2.0 / step))


def tendon_rows(model) -> np.ndarray:
    """`(ntendon, nv)` coefficients of fixed tendons over the velocities."""
    rows = np.zeros((model.ntendon, model.nv))
    for t in range(model.ntendon):
        for w in range(model.tendon_adr[t], model.tendon_adr[t] + model.tendon_num[t]):
            rows[t, model.jnt_dofadr[model.wrap_objid[w]]] += model.wrap_prm[w]
    return rows


def stiffness_matrix(model) -> np.ndarray:
    """`(nv, nv)` of hinges, slides and fixed tendons."""
    rows = tendon_rows(model)
    out = rows.T @ (first(model.tendon_stiffness)[:, None] * rows)
    plain = np.asarray(model.jnt_type) >= int(mujoco.mjtJoint.mjJNT_SLIDE)
    dofs = model.jnt_dofadr[plain]
    out[dofs, dofs] += first(model.jnt_stiffness)[plain]
    return out


def damping_matrix(model) -> np.ndarray:
    """`(nv, nv)` likewise."""
    rows = tendon_rows(model)
    return np.diag(first(model.dof_damping)) + rows.T @ (
        first(model.tendon_damping)[:, None] * rows
    )


def system_matrix(mass, damping, stiffness) -> np.ndarray:
    """`(2 nv, 2 nv)` of `M q'' + D q' + K q = 0` in the states (q, q')."""
    n = mass.shape[0]
    below = np.hstack([-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)])
    return np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), below])


def step_matrix(model, epsilon=EPSILON) -> np.ndarray:
    """`(2 nv, 2 nv)` one step of the model's own integrator, states (position, velocity).

    MuJoCo's own `mjd_transitionFD`; RK4, for which that has no answer, by its polynomial of M, D
    and K. "discrete" does not see forces of 1e-9, and wants a larger perturbation.
    """
    size = 2 * model.nv
    if int(model.opt.integrator) == INTEGRATORS["RK4"]:
        f = (
            system_matrix(mass_matrix(model), damping_matrix(model), stiffness_matrix(model))
            * model.opt.timestep
        )
        return np.eye(size) + f @ (
            np.eye(size) + f / 2.0 @ (np.eye(size) + f / 3.0 @ (np.eye(size) + f / 4.0))
        )
    a = np.zeros((size + model.na, size + model.na))
    mujoco.mjd_transitionFD(model, mujoco.MjData(model), epsilon, True, a, None, None, None)
    return a[:size, :size]


def modal_tendons(model) -> list[int]:
    """Numbers of the sprung tendons that stand for a mode or a filler, by their names."""
    named = [
        i
        for i in range(model.ntendon)
        if any(w in model.tendon(i).name for w in ("mode", "filler"))
    ]
    return [i for i in named if first(model.tendon_stiffness)[i] > 0.0]


def made_for(model) -> list[tuple[float, str, int] | None]:
    """Step [s], integrator and form that the modal tendons say they were made exact for,
    each answer once; None: for none.

    The mark is `solimplimit = "timestep integrator form damping stiffness"`,
    which MuJoCo reads for limited tendons only.
    """
    marks = [tuple(model.tendon_solimp_lim[i]) for i in modal_tendons(model)]
    answers = [
        None if mark == UNMARKED else (mark[0], NAMES[int(mark[1])], int(mark[2])) for mark in marks
    ]
    return list(dict.fromkeys(answers))


def with_integrator(model, name, timestep=None):
    """A copy of a model with another integrator and step."""
    out = copy.copy(model)
    out.opt.integrator = INTEGRATORS[name]
    if timestep is not None:
        out.opt.timestep = timestep
    return out


def momentum(model, data) -> np.ndarray:
    """`(6,)` linear and angular momentum about the origin of the world, body by body."""
    mujoco.mj_forward(model, data)
    total = np.zeros(6)
    for body in range(1, model.nbody):
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
        axes = data.ximat[body].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
        linear = model.body_mass[body] * velocity[3:]
        total[:3] += linear
        total[3:] += inertia @ velocity[:3] + np.cross(data.xipos[body], linear)
    return total


def kinetic_energy(model, data) -> float:
    """[J], armatures included."""
    column = np.zeros(model.nv)
    mujoco.mj_forward(model, data)
    mujoco.mj_mulM(model, data, column, data.qvel)
    return 0.5 * float(data.qvel @ column)


def spring_energy(model, data) -> float:
    """[J] of hinges, and of fixed tendons slack at length zero."""
    hinges = np.flatnonzero(model.jnt_type == int(mujoco.mjtJoint.mjJNT_HINGE))
    at = model.jnt_qposadr[hinges]
    stretch = data.qpos[at] - model.qpos_spring[at]
    energy = first(model.jnt_stiffness)[hinges] @ stretch**2
    mujoco.mj_forward(model, data)
    return 0.5 * float(energy + first(model.tendon_stiffness) @ data.ten_length**2)


def total_energy(model, data) -> float:
    """[J] without gravity."""
    return kinetic_energy(model, data) + spring_energy(model, data)


def after_a_step(model, data, seconds):
    """Copies of a model and its data after one plain step of some length."""
    plain, there = copy.copy(model), copy.copy(data)
    plain.opt.timestep = seconds
    mujoco.mj_step(plain, there)
    return plain, there
