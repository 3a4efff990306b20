"""A bare craft with uniform rods on it, put together by hand: the craft's matrices from plain
MuJoCo, the rods' modes in closed form; nothing of the package."""

import copy

import mujoco
import numpy as np
from scipy.integrate import quad

from mechanics import mass_matrix
from uniform_beam import held_roots

ROD = """name = "rod"
[[segment]]
length = 2.0
[segment.section]
shape = "equivalent"
bending_stiffness_xy = 30.0
bending_stiffness_xz = 55.0
torsion_stiffness = 12.0
linear_mass = 0.4
polar_inertia = 0.01
[damping]
ratio = 0.005
[modes]
xy = 2
xz = 2
torsion = 1
"""
LENGTH, MASS, POLAR, TORSION = 2.0, 0.4, 0.01, 12.0
BENDING = {"xy": 30.0, "xz": 55.0}


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


def forces(model, qpos, qvel):
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = qpos, qvel
    mujoco.mj_forward(model, data)
    return data.qfrc_passive + data.qfrc_actuator


def stiffness_matrix(model, step=1e-4):
    """`(nv, nv)` from differences of all passive and actuator forces about the rest pose."""
    out = np.zeros((model.nv, model.nv))
    still = np.zeros(model.nv)
    for i, unit in enumerate(np.eye(model.nv)):
        ends = []
        for sign in (1.0, -1.0):
            moved = np.array(model.qpos0)
            mujoco.mj_integratePos(model, moved, sign * step * unit, 1.0)
            ends.append(forces(model, moved, still))
        out[:, i] = (ends[1] - ends[0]) / (2.0 * step)
    return (out + out.T) / 2.0


def damping_matrix(model, step=1e-4):
    """`(nv, nv)` likewise."""
    columns = [
        (forces(model, model.qpos0, -step * unit) - forces(model, model.qpos0, step * unit))
        / (2.0 * step)
        for unit in np.eye(model.nv)
    ]
    return np.array(columns).T


def frequencies(mass, stiffness):
    """Above zero, ascending [rad/s]."""
    squares = np.linalg.eigvals(np.linalg.solve(mass, stiffness)).real
    return np.sqrt(np.sort(squares[squares > 1e-9 * squares.max()]))


def _rod_modes():
    """Frequencies [rad/s] and participations `(n, 6)` of the clamped rod's five kept modes."""
    rows, omega = [], []
    for plane, stiffness in BENDING.items():
        for z in held_roots(2):
            ratio = (np.sinh(z) - np.sin(z)) / (np.cosh(z) + np.cos(z))

            def shape(x, z=z, ratio=ratio):
                return np.cosh(z * x) - np.cos(z * x) - ratio * (np.sinh(z * x) - np.sin(z * x))

            norm = np.sqrt(MASS * LENGTH * quad(lambda x: shape(x) ** 2, 0.0, 1.0)[0])
            force = MASS * LENGTH * quad(shape, 0.0, 1.0)[0] / norm
            moment = MASS * LENGTH**2 * quad(lambda x: x * shape(x), 0.0, 1.0)[0] / norm
            row = np.zeros(6)
            if plane == "xy":
                row[1], row[5] = force, moment
            else:
                row[2], row[4] = force, -moment
            rows.append(row)
            omega.append((z / LENGTH) ** 2 * np.sqrt(stiffness / MASS))
    # torsion: sin(pi x / 2), integral 2 / pi, of its square 1 / 2
    rows.append(np.array([0, 0, 0, np.sqrt(2.0 * POLAR * LENGTH) * 2.0 / np.pi, 0, 0]))
    omega.append(np.pi / 2.0 / LENGTH * np.sqrt(TORSION / POLAR))
    return np.array(omega), np.array(rows)


def _rigid_rod():
    """`(6, 6)` about its root."""
    mass = MASS * LENGTH
    out = np.diag([mass, mass, mass, POLAR * LENGTH, mass * LENGTH**2 / 3, mass * LENGTH**2 / 3])
    out[1, 5] = out[5, 1] = mass * LENGTH / 2.0
    out[2, 4] = out[4, 2] = -mass * LENGTH / 2.0
    return out


def with_rods(model, places):
    """Mass and stiffness matrix of a bare craft with a rod at each place, a site or a body."""
    model = quiet(model)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    omega, rows = _rod_modes()
    n, k = model.nv, omega.size
    mass = np.zeros((n + k * len(places), n + k * len(places)))
    stiffness = np.zeros_like(mass)
    mass[:n, :n], stiffness[:n, :n] = mass_matrix(model), stiffness_matrix(model)
    for i, place in enumerate(places):
        site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, place)
        if site >= 0:
            body = model.site_bodyid[site]
            origin, axes = data.site_xpos[site], data.site_xmat[site].reshape(3, 3)
        else:
            body = model.body(place).id
            origin, axes = data.xpos[body], data.xmat[body].reshape(3, 3)
        moves, turns = np.zeros((3, n)), np.zeros((3, n))
        mujoco.mj_jac(model, data, moves, turns, origin, body)
        jacobian = np.vstack([axes.T @ moves, axes.T @ turns])
        at = slice(n + i * k, n + (i + 1) * k)
        mass[:n, :n] += jacobian.T @ _rigid_rod() @ jacobian
        mass[:n, at] = jacobian.T @ rows.T
        mass[at, :n] = mass[:n, at].T
        mass[at, at] = np.eye(k)
        stiffness[at, at] = np.diag(omega**2)
    return mass, stiffness
