"""Arms of `arms` under gravity or thrust in plain MuJoCo: every beam a row of many rigid cells with
three springs between each two, at rest where its own forces balance.

What is linearised is what MuJoCo computes of forces and accelerations, by differences, in the axes of
the world. Nothing is imported from the package.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.linalg import eig, eigh

from arms import DENSITY, POISSON, YOUNG, _words
from finite_elements import _rectangle_torsion

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
        """Poles up to `top` [rad/s] above the real axis, ascending, and their residues `(k, 6, 6)`."""
        n = len(self.mass)
        rates = -np.linalg.solve(self.mass, np.hstack([self.stiffness, self.damping]))
        flow = np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), rates])
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
    step = link.length / count
    area = link.width_y * link.width_z
    about_y = link.width_y * link.width_z**3 / 12.0
    about_z = link.width_z * link.width_y**3 / 12.0
    shear = YOUNG / (2.0 * (1.0 + POISSON))
    springs = {
        "x": shear * _rectangle_torsion(link.width_y, link.width_z) / step,
        "y": YOUNG * about_y / step,
        "z": YOUNG * about_z / step,
    }
    axes = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
    body = inside
    for k in reversed(range(count + 1)):
        long = step / 2.0 if k in (0, count) else step
        before = 0.0 if k == 0 else (step / 2.0 if k == 1 else step)
        weight = DENSITY * area * long
        across = weight * long**2 / 12.0
        inertia = [DENSITY * (about_y + about_z) * long, across, across]
        # in turn one way round and the other, so that no order of the three is preferred
        order = "xyz" if k % 2 else "zyx"
        joints = "".join(
            f'<joint name="{link.name}_{k}_{a}" axis="{axes[a]}" stiffness="{float(springs[a])!r}"/>'
            for a in order * (k > 0)
        )
        body = f"""<body name="{link.name}_{k}" pos="{before!r} 0 0">{joints}
<inertial pos="{long / 2.0!r} 0 0" mass="{weight!r}" diaginertia="{_words(inertia)}"/>{body}</body>"""
    return body.replace(
        f'<body name="{link.name}_0" pos="0.0 0 0">', f'<body name="{link.name}_0">'
    )


def fine_mjcf(arm, count, base, quaternion="1 0 0 0", actuators=""):
    """The arm with its beams cut into `count` cells; `base`: joints of the bus."""
    end = f'pos="{arm.links[-1].length / count / 2.0!r} 0 0"'
    body = f"""<body name="hand" {end}>
<inertial pos="{_words(arm.hand_at)}" mass="{arm.hand!r}" diaginertia="{_words(arm.hand_inertia)}"/></body>"""
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
    """The arm at rest under its load, its hinges held at `angles`."""
    model = mujoco.MjModel.from_xml_string(fine_mjcf(arm, count, base, **craft))
    data = mujoco.MjData(model)
    nv = model.nv
    names = [f"{link.name}_" for link in arm.links]
    bend = [
        i for i in range(nv) if model.joint(int(model.dof_jntid[i])).name.startswith(tuple(names))
    ]
    own = np.setdiff1d(np.arange(nv), bend)
    qpos = np.array(model.qpos0)
    for name, angle in (angles or {}).items():
        qpos[model.joint(f"hinge_{name}").qposadr[0]] = angle
    start = qpos.copy()
    model.qpos_spring[:] = start
    acceleration = np.zeros(nv)
    is_free = int(model.jnt_type[0]) == 0
    pushed = np.zeros(nv)

    def forces(at):
        data.qpos[:] = at
        data.ctrl[:] = ctrl
        mujoco.mj_forward(model, data)
        mujoco.mj_mulM(model, data, pushed, acceleration)
        return pushed + data.qfrc_bias - data.qfrc_passive - data.qfrc_actuator

    if is_free:
        acceleration[:3] = -forces(start)[:3] / float(model.body_mass.sum())

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
    # what holds the hinges is constant; a free base turns out of the thrust's way
    mass = _mass(model, data, qpos)
    damping = np.diag(np.asarray(model.dof_damping, dtype=float).reshape(nv, -1)[:, 0])
    for name in names:
        alone = _mass(
            model, data, start, [i for i in range(model.nbody) if _is_beam(model, i, name)]
        )
        dofs = [i for i in bend if model.joint(int(model.dof_jntid[i])).name.startswith(name)]
        block = np.ix_(dofs, dofs)
        springs = np.diag([model.jnt_stiffness[int(model.dof_jntid[i])] for i in dofs])
        values, shapes = eigh(springs.reshape(len(dofs), len(dofs), -1)[..., 0], alone[block])
        push = alone[block] @ shapes
        damping[block] += push @ np.diag(2.0 * arm.ratio * np.sqrt(values)) @ push.T
    rows = np.zeros((6, nv))
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    body = model.body("bus").id
    mujoco.mj_jacBody(model, data, rows[:3], rows[3:], body)
    x, y, z = acceleration[:3]
    tilt = np.zeros((6, nv))
    # of R^T a for a turn t of R: - t x a = a x t
    tilt[:3] = -np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) @ rows[3:]
    assert own.size + len(bend) == nv
    return Loaded(mass, damping, slope, rows, tilt), model


def _is_beam(model, body, name):
    return model.body(body).name.startswith(name)


def _mass(model, data, qpos, only=None):
    """`(nv, nv)` at a pose; `only`: of some bodies."""
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    nv = model.nv
    out = np.zeros((nv, nv))
    if only is None:
        column = np.zeros(nv)
        for i, unit in enumerate(np.eye(nv)):
            mujoco.mj_mulM(model, data, column, unit)
            out[:, i] = column
        return out
    linear, angular = np.zeros((3, nv)), np.zeros((3, nv))
    for body in only:
        mujoco.mj_jacBodyCom(model, data, linear, angular, body)
        axes = data.ximat[body].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[body]) @ axes.T
        out += model.body_mass[body] * linear.T @ linear + angular.T @ inertia @ angular
    return out
