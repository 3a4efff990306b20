"""MuJoCo moves the written chain exactly as the paper's nonlinear equations say,
at any angle and rate.

The planar equations of motion of N links are derived here by Lagrange's method (sympy), in the
paper's coordinates: root position x0, y0 and absolute angles phi_i, with the root's force and
moment and the hinge springs (1). They are solved for the accelerations and compared with MuJoCo's
for exported files. For N = 3 the accelerations are put into the equations (5) of P. P. Belonozhko
(2008) as printed, external forces T*, M* zero.

A misprint: the fifth of (5) has `l_1 l_2` in its phi_1'' term; units, the velocity term beside it
and the linear equations (7) all need `l_1 l_3`.
"""

from functools import cache, lru_cache

import mujoco
import numpy as np
import pytest
import sympy as sp

import readback as rb
from appendages import close, drawn_rods, modes_of_rods, seed_boom
from beamchain import fit
from beamchain.spec import FitOptions
from planar_truth import Plane
from written_chain import read_chain

# one solve with a mass matrix of condition 1e2 .. 1e4 on either side, relative to the largest
ACCELERATION = 1e-10
RESIDUAL = 1e-10  # of each printed equation, relative to the sum of its terms' magnitudes

STATES = 2


@lru_cache
def equations(count):
    """Mass matrix and right-hand side of N links as functions of (l, k, m, I, c, q,
    q', T0x, T0y, M0)."""
    n = count
    length, k, m, j = (sp.symbols(f"{name}1:{n + 1}") for name in "lkmj")
    c = sp.symbols(f"c1:{n}")
    x0, y0, *phi = q = sp.symbols(f"x0 y0 phi1:{n + 1}")
    rates = sp.symbols(f"dx0 dy0 dphi1:{n + 1}")
    fx, fy, moment = sp.symbols("T0x T0y M0")
    kinetic = sp.Integer(0)
    root = sp.Matrix([x0, y0])
    for i in range(n):
        axis = sp.Matrix([sp.cos(phi[i]), sp.sin(phi[i])])
        centre = root + k[i] * length[i] * axis
        velocity = centre.jacobian(sp.Matrix(q)) * sp.Matrix(rates)
        kinetic += m[i] * velocity.dot(velocity) / 2 + j[i] * rates[2 + i] ** 2 / 2
        root = root + length[i] * axis
    potential = sum((c[i] * (phi[i + 1] - phi[i]) ** 2 / 2 for i in range(n - 1)), sp.Integer(0))
    momenta = sp.Matrix([sp.diff(kinetic, v) for v in rates])
    mass = momenta.jacobian(sp.Matrix(rates))
    # d/dt dT/dq' = M q'' + (d momenta / dq) q'; the root force works on (x0, y0),
    # the moment on phi1
    forces = sp.Matrix([fx, fy, moment] + [0] * (n - 1))
    rest = sp.Matrix([sp.diff(kinetic - potential, v) for v in q]) + forces
    rest -= momenta.jacobian(sp.Matrix(q)) * sp.Matrix(rates)
    arguments = [*length, *k, *m, *j, *c, *q, *rates, fx, fy, moment]
    return sp.lambdify(arguments, [mass, rest], modules="numpy", cse=True)


def accelerations(result, q, rates, wrench):
    """`(N + 2,)` x0'', y0'', phi'' by Lagrange."""
    values = parameters(result)
    mass, rest = equations(len(values["m"]))(*np.concatenate([*values.values(), q, rates, wrench]))
    return np.linalg.solve(np.asarray(mass, dtype=float), np.ravel(rest).astype(float))


@cache
def chain_of(result):
    """Bodies and hinges of the exported file."""
    return read_chain(result.to_mjcf())


def parameters(result):
    """The paper's letters: lengths between hinges, relative mass centres, masses,
    inertias, springs."""
    chain = chain_of(result)
    ends = [hinge.x for hinge in chain.hinges] + [chain.length]
    starts = [0.0, *ends[:-1]]
    lengths = np.subtract(ends, starts)
    return {
        "l": lengths,
        "k": (np.array([body.com for body in chain.bodies]) - starts) / lengths,
        "m": np.array([body.mass for body in chain.bodies]),
        "I": np.array([body.inertia[2, 2] for body in chain.bodies]),
        "c": np.array([hinge.stiffness["xy"] for hinge in chain.hinges]),
    }


@cache
def random_chain(count, seed):
    """N links drawn at random, stiff and soft, by way of the modes that they have."""
    masses, lengths, stiffness = drawn_rods(seed, count - 1)
    data = modes_of_rods(masses, lengths, 10.0 ** (2.0 * stiffness - 3.0))
    return fit(data, name="chain", modes={"xy": count - 1}, options=FitOptions(springs="hinges"))


def mujoco_accelerations(result, q, rates, wrench):
    """The same accelerations from MuJoCo; its hinge angles are differences of the absolute ones."""
    host = mujoco.MjSpec()
    host.option.gravity = [0.0, 0.0, 0.0]
    root = host.worldbody.add_body(name="root")
    for name, kind, axis in (
        ("x0", mujoco.mjtJoint.mjJNT_SLIDE, [1.0, 0.0, 0.0]),
        ("y0", mujoco.mjtJoint.mjJNT_SLIDE, [0.0, 1.0, 0.0]),
        ("phi1", mujoco.mjtJoint.mjJNT_HINGE, [0.0, 0.0, 1.0]),
    ):
        root.add_joint(name=name, type=kind, axis=axis)
    root.add_site(name="mount")
    result.attach(host, "mount")
    model = host.compile()
    data = mujoco.MjData(model)
    # x0, y0, phi1, phi2 - phi1, ...
    to_joints = np.eye(q.size) - np.diag(np.r_[0.0, 0.0, np.ones(q.size - 3)], -1)
    data.qpos[:], data.qvel[:] = to_joints @ q, to_joints @ rates
    data.qfrc_applied[:3] = wrench
    mujoco.mj_forward(model, data)
    return np.linalg.solve(to_joints, data.qacc)


def random_state(count, seed):
    """Any angle, spinning, pushed."""
    rng = np.random.default_rng(1000 * count + seed)
    q = np.concatenate([rng.normal(size=2), rng.uniform(-np.pi, np.pi, count)])
    rates = np.concatenate([rng.normal(size=2), rng.uniform(-5.0, 5.0, count)])
    return q, rates, rng.normal(size=3) * [3.0, 3.0, 2.0]


@pytest.mark.parametrize("seed", range(STATES))
@pytest.mark.slow
@pytest.mark.parametrize("count", [3, 4])
def test_mujoco_has_lagrange_s_accelerations(count, seed):
    chain = random_chain(count, seed)
    state = random_state(count, seed)
    ours = accelerations(chain, *state)
    mujocos = mujoco_accelerations(chain, *state)
    assert np.max(np.abs(ours - mujocos)) < ACCELERATION * np.max(np.abs(ours))


@pytest.mark.slow
def test_the_exact_chain_of_the_seed_boom_too():
    chain = fit(seed_boom(), name="chain", modes={"xy": 2, "xz": 0})
    for seed in range(STATES):
        state = random_state(3, seed)
        ours = accelerations(chain, *state)
        mujocos = mujoco_accelerations(chain, *state)
        assert np.max(np.abs(ours - mujocos)) < ACCELERATION * np.max(np.abs(ours))


# -- the paper's equations (5) ---------------------------------------------------------------------
def printed(p, q, rates, acc, wrench, *, misprint=False):
    """Terms of the five equations (5), all on one side,
    without the external forces on the links."""
    (l1, l2, l3), (k1, k2, k3), (m1, m2, m3), (i1, i2, i3), (c12, c23) = (
        p["l"],
        p["k"],
        p["m"],
        p["I"],
        p["c"],
    )
    f1, f2, f3 = q[2:]
    w1, w2, w3 = rates[2:]
    ax, ay, a1, a2, a3 = acc
    tx, ty, m0 = wrench
    sin, cos = np.sin, np.cos
    return [
        [
            (m1 + m2 + m3) * ax,
            -(m1 * k1 + m2 + m3) * l1 * a1 * sin(f1),
            -(m2 * k2 + m3) * l2 * a2 * sin(f2),
            -m3 * k3 * l3 * a3 * sin(f3),
            -(m1 * k1 + m2 + m3) * l1 * w1**2 * cos(f1),
            -(m2 * k2 + m3) * l2 * w2**2 * cos(f2),
            -m3 * k3 * l3 * w3**2 * cos(f3),
            -tx,
        ],
        [
            (m1 + m2 + m3) * ay,
            (m1 * k1 + m2 + m3) * l1 * a1 * cos(f1),
            (m2 * k2 + m3) * l2 * a2 * cos(f2),
            m3 * k3 * l3 * a3 * cos(f3),
            -(m1 * k1 + m2 + m3) * l1 * w1**2 * sin(f1),
            -(m2 * k2 + m3) * l2 * w2**2 * sin(f2),
            -m3 * k3 * l3 * w3**2 * sin(f3),
            -ty,
        ],
        [
            m1 * (1 - k1) * l1 * ax * sin(f1),
            -m1 * (1 - k1) * l1 * ay * cos(f1),
            (i1 - m1 * k1 * (1 - k1) * l1**2) * a1,
            -m0,
            c12 * (f1 - f2),
            -l1 * tx * sin(f1),
            l1 * ty * cos(f1),
        ],
        [
            (m1 + m2 * (1 - k2)) * l2 * ax * sin(f2),
            -(m1 + m2 * (1 - k2)) * l2 * ay * cos(f2),
            -(m1 * k1 + m2 * (1 - k2)) * l1 * l2 * a1 * cos(f2 - f1),
            (i2 - m2 * k2 * (1 - k2) * l2**2) * a2,
            -c12 * (f1 - f2),
            c23 * (f2 - f3),
            -(m1 * k1 + m2 * (1 - k2)) * l1 * l2 * w1**2 * sin(f2 - f1),
            -l2 * tx * sin(f2),
            l2 * ty * cos(f2),
        ],
        [
            (m1 + m2) * k3 * l3 * ax * sin(f3),
            -(m1 + m2) * k3 * l3 * ay * cos(f3),
            -(m1 * k1 + m2) * k3 * l1 * (l2 if misprint else l3) * a1 * cos(f3 - f1),
            -m2 * k2 * k3 * l2 * l3 * a2 * cos(f3 - f2),
            i3 * a3,
            -c23 * (f2 - f3),
            -(m1 * k1 + m2) * k3 * l1 * l3 * w1**2 * sin(f3 - f1),
            -m2 * k2 * k3 * l2 * l3 * w2**2 * sin(f3 - f2),
            -k3 * l3 * tx * sin(f3),
            k3 * l3 * ty * cos(f3),
        ],
    ]


def residuals(terms):
    return np.array([abs(sum(row)) / sum(abs(v) for v in row) for row in terms])


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(STATES))
@pytest.mark.parametrize("solver", [accelerations, mujoco_accelerations])
def test_the_paper_s_equations_5_hold(solver, seed):
    chain = random_chain(3, seed)
    q, rates, wrench = random_state(3, seed)
    acc = solver(chain, q, rates, wrench)
    assert np.max(residuals(printed(parameters(chain), q, rates, acc, wrench))) < RESIDUAL


@pytest.mark.slow
def test_the_fifth_of_5_is_misprinted():
    chain = random_chain(3, 0)
    q, rates, wrench = random_state(3, 0)
    left = residuals(
        printed(
            parameters(chain),
            q,
            rates,
            accelerations(chain, q, rates, wrench),
            wrench,
            misprint=True,
        )
    )
    assert np.max(left[:4]) < RESIDUAL
    assert left[4] > 1e-3  # l_1 l_2 where l_1 l_3 belongs


@pytest.mark.parametrize("seed", range(STATES))
def test_the_paper_s_linear_equations_7_hold(seed):
    # (7) from the port: at frequency w, with the motion that a unit wrench causes
    chain = random_chain(3, seed)
    p = parameters(chain)
    (l1, l2, l3), (k1, k2, k3), (m1, m2, m3), (i1, i2, i3), (c12, c23) = (
        p["l"],
        p["k"],
        p["m"],
        p["I"],
        p["c"],
    )
    mass = np.array(
        [
            [m1 + m2 + m3, (m1 * k1 + m2 + m3) * l1, (m2 * k2 + m3) * l2, m3 * k3 * l3],
            [-m1 * (1 - k1) * l1, i1 - m1 * k1 * (1 - k1) * l1**2, 0.0, 0.0],
            [
                -(m1 + m2 * (1 - k2)) * l2,
                -(m1 * k1 + m2 * (1 - k2)) * l1 * l2,
                i2 - m2 * k2 * (1 - k2) * l2**2,
                0.0,
            ],
            [-(m1 + m2) * k3 * l3, -(m1 * k1 + m2) * k3 * l1 * l3, -m2 * k2 * k3 * l2 * l3, i3],
        ]
    )
    spring = np.zeros((4, 4))
    spring[1:, 1:] = [[c12, -c12, 0.0], [-c12, c12 + c23, -c23], [0.0, -c23, c23]]
    forces = np.array([[1.0, 0.0], [-l1, 1.0], [-l2, 0.0], [-k3 * l3, 0.0]])  # of T0y, M0
    reading = rb.read(chain.to_mjcf())
    turn = rb.into_space("xy")
    frequencies, rows, _ = reading.port("xy")
    plane = Plane(turn.T @ reading.rigid @ turn, frequencies, rows)
    poles = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(mass, spring)).real)[2:])
    assert poles == close(plane.free_frequencies(), rel=1e-8)
    for w in (0.4 * poles[0], 0.5 * (poles[0] + poles[1]), 3.0 * poles[1]):
        motion = np.linalg.solve(spring - w**2 * mass, forces)
        accelerance = -(w**2) * motion[:2]  # y0 and phi1
        held = plane.rigid + (rows.T * (w**2 / (frequencies**2 - w**2))) @ rows
        expected = np.linalg.inv(held)
        assert accelerance == close(expected, abs=1e-8 * np.max(np.abs(expected)))
