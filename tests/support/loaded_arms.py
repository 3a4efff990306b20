"""Arms of `arms` under gravity or thrust in plain MuJoCo: every beam a row of many rigid cells with
three springs between each two, at rest where its own forces balance.

What is linearised is what MuJoCo computes of forces and accelerations, by differences, in the axes
of the world. Nothing is imported from the package.
"""

import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.linalg import eig, eigh

from arms import _words
from mechanics import mass_matrix, system_matrix
from solver import cross

MOVED = 1e-5  # rad or m of differences
SETTLED = 1e-11


@dataclass(frozen=True, eq=False)
class Loaded:
    """`M q'' + C q' + K q = f` about rest under a load; the base's motions are `rows` `(6, n)`.

    `tilt` `(6, n)`: what an accelerometer on the base reads less for a change of q.
    """

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    rows: np.ndarray
    tilt: np.ndarray

    def accelerance(self, omega):
        """`(k, 6, 6)` acceleration of the base in its own axes per wrench on it."""
        out = []
        for w in omega:
            dynamic = self.mass - self.stiffness / w**2 + self.damping / (1j * w)
            acceleration = np.linalg.solve(dynamic, self.rows.T.astype(complex))
            out.append(self.rows @ acceleration - self.tilt @ acceleration / -(w**2))
        return np.array(out)

    def peaks(self, top):
        """Poles up to `top` [rad/s] above the real axis, ascending, and residues `(k, 6, 6)`."""
        n = len(self.mass)
        flow = system_matrix(self.mass, self.damping, self.stiffness)
        values, left, right = eig(flow, left=True)
        found = np.flatnonzero((values.imag > 0.05) & (np.abs(values) < top))
        found = found[np.argsort(np.abs(values[found]))]
        push = np.vstack([np.zeros((n, 6)), np.linalg.solve(self.mass, self.rows.T)])
        residues = []
        for k in found:
            seen = (self.rows * values[k] ** 2 - self.tilt) @ right[:n, k]
            size = left[:, k].conj() @ right[:, k]
            residues.append(np.outer(seen, left[:, k].conj() @ push) / size)
        return values[found], np.array(residues)

    def frequencies(self, count):
        """The lowest above zero [rad/s]."""
        found = np.linalg.eigvals(np.linalg.solve(self.mass, self.stiffness))
        return np.sort(np.sqrt(found.real[found.real > 0.01]))[:count]


def in_band(file, truth, model):
    """The largest error of an accelerance `(k, 6, 6)` by its definition; `model`: of the truth."""
    moves = np.abs(model.rows).max(axis=0) > 0.0  # by the base's own joints, all others locked
    rows = model.rows[:, moves]
    rigid = rows @ np.linalg.solve(model.mass[np.ix_(moves, moves)], rows.T)
    sizes = np.linalg.norm(rows, axis=1)
    able = np.flatnonzero(sizes > 1e-9 * sizes.max())
    scale = np.sqrt(np.diag(np.linalg.pinv(rigid, rcond=1e-9, hermitian=True)))[able]
    weight = np.outer(scale, scale)
    floor = np.linalg.norm(rigid[np.ix_(able, able)] * weight, 2)

    def size(response):
        return np.linalg.norm(response[:, able][:, :, able] * weight, 2, axis=(1, 2))

    return float(np.max(size(file - truth) / np.maximum(size(truth), floor)))


def extrapolated(coarse, fine, ratio, omega, top):
    """`(k, 6, 6)` accelerance for cells without end, of two numbers of cells (`ratio`: of them):
    poles and residues, and the rest, have errors of second order."""
    further = ratio**2 / (ratio**2 - 1.0)

    def beyond(a, b):
        return a + further * (b - a)

    s = 1j * omega[:, None, None]

    def of_peaks(poles, residues):
        return sum(
            r / (s - p) + r.conj() / (s - p.conjugate())
            for p, r in zip(poles, residues, strict=True)
        )

    known = [model.peaks(top) for model in (coarse, fine)]
    rest = [
        model.accelerance(omega) - of_peaks(*peaks)
        for model, peaks in zip((coarse, fine), known, strict=True)
    ]
    (poles, residues), (more, others) = known
    return of_peaks(beyond(poles, more), beyond(residues, others)) + beyond(*rest)


def cells(link, count, inside):
    """A link as cells of equal length (half ones at the ends), and `inside` on its last."""
    step, section = link.length / count, link.section
    springs = {
        "x": section.torsion / step,
        "y": section.bending_y / step,
        "z": section.bending_z / step,
    }
    axes = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
    body = inside
    for k in reversed(range(count + 1)):
        long = step / 2.0 if k in (0, count) else step
        before = 0.0 if k == 0 else (step / 2.0 if k == 1 else step)
        weight = section.mass * long
        across = weight * long**2 / 12.0
        inertia = [section.polar * long, across, across]
        # in turn one way round and the other, so that no order of the three is preferred
        order = "xyz" if k % 2 else "zyx"
        joints = "".join(
            f'<joint name="{link.name}_{k}_{a}" axis="{axes[a]}" stiffness="{springs[a]}"/>'
            for a in order * (k > 0)
        )
        inertial = f'mass="{weight!r}" diaginertia="{_words(inertia)}"'
        body = f"""<body name="{link.name}_{k}" pos="{before!r} 0 0">{joints}
<inertial pos="{long / 2.0!r} 0 0" {inertial}/>{body}</body>"""
    return body


def fine_mjcf(arm, count, base, quaternion="1 0 0 0", actuators=""):
    """The arm with its beams cut into `count` cells; `base`: joints of the bus."""
    hand = f'mass="{arm.hand!r}" diaginertia="{_words(arm.hand_inertia)}"'
    end = f'pos="{arm.links[-1].length / count / 2.0!r} 0 0"'
    body = f"""<body name="hand" {end}>
<inertial pos="{_words(arm.hand_at)}" {hand}/></body>"""
    for number, link in reversed(list(enumerate(arm.links))):
        beam = cells(link, count, body)
        if number == 0:
            body = f'<body pos="{_words(arm.at)}" quat="{quaternion}">{beam}</body>'
            continue
        joint = ""
        if link.axis is not None:
            joint = (
                f'<joint name="hinge_{link.name}" axis="{_words(link.axis)}" '
                f'stiffness="{link.stiffness + link.kp!r}" damping="{link.damping + link.kv!r}"/>'
            )
        inertial = f'mass="{link.mass!r}" diaginertia="{_words(link.inertia)}"'
        before = arm.links[number - 1].length / count / 2.0
        body = f"""<body name="joint_{link.name}" pos="{before!r} 0 0">{joint}
<inertial pos="0 0 0" {inertial}/>{beam}</body>"""
    return f"""<mujoco><option gravity="{_words(arm.gravity)}"/><worldbody><body name="bus">{base}
<inertial pos="0 0 0" mass="{arm.bus!r}" diaginertia="{_words(arm.bus_inertia)}"/>
<site name="thruster" pos="{_words(arm.at)}"/>{body}</body></worldbody>{actuators}</mujoco>"""


def loaded(arm, count, base, angles=None, ctrl=0.0, **craft):
    """The arm in cells at rest under its load, its hinges held at `angles`."""
    model = mujoco.MjModel.from_xml_string(fine_mjcf(arm, count, base, **craft))
    names = [f"{link.name}_" for link in arm.links]
    qpos = np.array(model.qpos0)
    for name, angle in (angles or {}).items():
        qpos[model.joint(f"hinge_{name}").qposadr[0]] = angle
    data = mujoco.MjData(model)
    damping = np.zeros((model.nv, model.nv))
    for name in names:
        dofs = dofs_of(model, [name])
        own = [i for i in range(model.nbody) if model.body(i).name.startswith(name)]
        block = np.ix_(dofs, dofs)
        mass = _mass_of(model, data, qpos, own)[block]
        springs = np.reshape(model.jnt_stiffness, (model.njnt, -1))[:, 0]
        values, shapes = eigh(np.diag(springs[model.dof_jntid[dofs]]), mass)
        push = mass @ shapes
        damping[block] = push @ np.diag(2.0 * arm.ratio * np.sqrt(values)) @ push.T
    return at_rest(model, qpos, dofs_of(model, names), ctrl, damping)


def dofs_of(model, names):
    """Degrees of freedom of joints whose names begin with some words."""
    owner = [model.joint(int(model.dof_jntid[i])).name for i in range(model.nv)]
    return [i for i in range(model.nv) if owner[i].startswith(tuple(names))]


def at_rest(model, qpos, bend, ctrl=0.0, damping=0.0):
    """Any model about the rest that its freedoms `bend` find under its gravity and `ctrl`, all
    others held at `qpos`; what is added to its own damping."""
    model = copy.copy(model)
    data = mujoco.MjData(model)
    nv = model.nv
    qpos = np.array(qpos)
    model.qpos_spring[:] = qpos  # what holds the pose is constant
    acceleration = np.zeros(nv)
    pushed = np.zeros(nv)

    def forces(at, rate=None):
        data.qpos[:] = at
        data.qvel[:] = 0.0 if rate is None else rate
        data.ctrl[:] = ctrl
        mujoco.mj_forward(model, data)
        mujoco.mj_mulM(model, data, pushed, acceleration)
        return pushed + data.qfrc_bias - data.qfrc_passive - data.qfrc_actuator

    if int(model.jnt_type[0]) == 0:
        acceleration[:3] = -forces(qpos)[:3] / float(model.body_mass.sum())

    def stiffness(at, columns):
        out = np.zeros((nv, len(columns)))
        for k, i in enumerate(columns):
            ends = []
            for sign in (1.0, -1.0):
                moved = at.copy()
                mujoco.mj_integratePos(model, moved, sign * MOVED * np.eye(nv)[i], 1.0)
                ends.append(forces(moved))
            out[:, k] = (ends[0] - ends[1]) / (2.0 * MOVED)
        return out

    for _ in range(12):
        change = np.zeros(nv)
        change[bend] = -np.linalg.solve(stiffness(qpos, bend)[bend], forces(qpos)[bend])
        mujoco.mj_integratePos(model, qpos, change, 1.0)
        if np.abs(change).max() < SETTLED:
            break
    slope = stiffness(qpos, range(nv))
    step = 1e-3
    drag = np.array([forces(qpos, e) - forces(qpos, -e) for e in step * np.eye(nv)]).T / (
        2.0 * step
    )
    data.qpos[:] = qpos
    data.qvel[:] = 0.0
    mujoco.mj_forward(model, data)
    rows = np.zeros((6, nv))
    mujoco.mj_jacBody(model, data, rows[:3], rows[3:], model.body("bus").id)
    tilt = np.zeros((6, nv))
    # of R^T a for a turn t of R: - t x a = a x t
    tilt[:3] = -cross(acceleration[:3]) @ rows[3:]
    return Loaded(mass_matrix(model, qpos), drag + damping, slope, rows, tilt)


def _mass_of(model, data, qpos, bodies):
    """`(nv, nv)` mass matrix of some bodies at a pose."""
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    nv = model.nv
    out = np.zeros((nv, nv))
    linear, angular = np.zeros((3, nv)), np.zeros((3, nv))
    for body in bodies:
        mujoco.mj_jacBodyCom(model, data, linear, angular, body)
        axes = data.ximat[body].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
        out += model.body_mass[body] * linear.T @ linear + angular.T @ inertia @ angular
    return out
