"""What the step of a compiled spacecraft does, worked out apart from the package:
differences of `mj_step`, dense `expm`.

Craft are drawn at random: a hub with one to four tubes, damped, at a step from 0.3 to 30 times the
one at which plain Euler would become unstable.
"""

from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.linalg import expm
from scipy.optimize import linear_sum_assignment

import beamchain as bc
import finite_elements
from mechanics import by_differences, mass_matrix, system_matrix

RIGID = 1e-5
NAMES = ("first", "second", "third", "fourth")
TURNS = (0.0, 180.0, 90.0, 250.0)  # of the mounts about z [deg]
STENCIL = ((1.0, 8.0 / 12.0), (-1.0, -8.0 / 12.0), (2.0, -1.0 / 12.0), (-2.0, 1.0 / 12.0))
MODES = {"xy": 6, "xz": 6, "torsion": 2}


@dataclass(frozen=True)
class Drawn:
    """A spacecraft: text of its file, specification of what stands at each site, ratio,
    band [rad/s], step, integrator."""

    text: str
    specs: dict
    hub: float
    ratio: float
    band: float
    step: float
    integrator: str


def draw(seed):
    """A random craft."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 5))
    hub = float(np.exp(rng.uniform(np.log(4.0), np.log(4000.0))))
    ratio = float(np.exp(rng.uniform(np.log(1e-4), np.log(0.1))))
    integrator = ("Euler", "implicit", "implicitfast")[int(rng.integers(3))]
    specs = {}
    for name in NAMES[:count]:
        section = {"shape": "tube", "outer_diameter": float(rng.uniform(0.03, 0.06)), "wall": 0.002}
        material = {"youngs_modulus": 7e10, "density": 2700.0, "poissons_ratio": 0.33}
        specs[name] = {
            "segment": [
                {"length": float(rng.uniform(4.0, 9.0)), "section": section, "material": material}
            ]
        }
    size = 0.2 * hub * float(rng.uniform(0.5, 1.5))
    sites = "".join(
        f'<site name="{name}" pos="{0.4 * np.cos(np.radians(turn))} '
        f'{0.4 * np.sin(np.radians(turn))} 0" euler="0 0 {turn}"/>'
        for name, turn in zip(specs, TURNS, strict=False)
    )
    stiffest = max(finite_elements.port(spec, "xy", 3).frequencies[2] for spec in specs.values())
    step = float(np.exp(rng.uniform(np.log(0.3), np.log(30.0))) * 2.0 / (2.0 * stiffest))
    slowest = min(finite_elements.port(spec, "xy", 3).frequencies[0] for spec in specs.values())
    band = float(slowest * rng.uniform(1.5, 6.0))
    text = (
        f'<mujoco><option gravity="0 0 0" timestep="{step!r}" '
        f'integrator="{integrator}"/><worldbody><body name="bus">'
        f'<freejoint/><inertial pos="0 0 0" mass="{hub!r}" diaginertia="{size!r} {1.1 * size!r} '
        f'{1.3 * size!r}"/>{sites}'
        "</body></worldbody></mujoco>"
    )
    return Drawn(text, specs, hub, ratio, band, step, integrator)


def embedded(drawn, **options):
    """The craft with its appendages, as a user would embed them."""
    aluminium = bc.Material(youngs_modulus=7e10, density=2700.0, poissons_ratio=0.33)
    scene = bc.Scene(bandwidth=drawn.band, tolerance=0.01)
    at = {}
    for name, spec in drawn.specs.items():
        (segment,) = spec["segment"]
        tube = bc.Tube(
            outer_diameter=segment["section"]["outer_diameter"], wall=segment["section"]["wall"]
        )
        parts = (bc.Segment(length=segment["length"], section=tube, material=aluminium),)
        at[name] = bc.Spec(
            name=name, segment=parts, damping=bc.Damping(ratio=drawn.ratio), scene=scene
        )
    return bc.embed(drawn.text, at, **options)


# -- one step, by differences ----------------------------------------------------------------------
def stepped(model, qpos=None, moved=1e-3):
    """A and B of `mj_step` over (position tangent, rate),
    forces on every degree of freedom held."""
    data = mujoco.MjData(model)
    nv = model.nv
    h = model.opt.timestep
    start = np.array(model.qpos0 if qpos is None else qpos)

    def after(state):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = start
        mujoco.mj_integratePos(model, data.qpos, state[:nv], 1.0)
        data.qvel[:], data.qfrc_applied[:] = state[nv : 2 * nv], state[2 * nv :]
        mujoco.mj_step(model, data)
        out = np.zeros(nv)
        mujoco.mj_differentiatePos(model, out, 1.0, start, data.qpos)
        return np.concatenate([out, data.qvel])

    mass = mass_matrix(model, start)
    sizes = np.concatenate(
        [np.full(nv, moved), np.full(nv, moved / h), moved / h**2 * np.diag(mass)]
    )
    columns = [
        sum(weight * after(place * size * unit) for place, weight in STENCIL) / size
        for size, unit in zip(sizes, np.eye(3 * nv), strict=True)
    ]
    table = np.array(columns).T
    return table[:, : 2 * nv], table[:, 2 * nv :]


def continuous(model, qpos=None):
    """Poles [1/s] of a model from its mass matrix and the slopes of its passive
    and actuator forces."""
    return np.linalg.eigvals(system_matrix(*by_differences(model, qpos)))


def time_error(model, plain, band, qpos=None):
    """Largest `|z - exp(s h)| / |exp(s h) - 1|` of the poles up to the band,
    and the frequency of that pole."""
    h = model.opt.timestep
    z = np.linalg.eigvals(stepped(model, qpos)[0])
    s = continuous(plain, qpos)
    z, s = z[np.abs(z - 1.0) > 0.3 * RIGID], s[np.abs(s * h) >= RIGID]
    turn = np.abs(s.imag * h)
    aim = np.exp(s * h * np.where(turn > 2.6, 2.6 / np.maximum(turn, 2.6), 1.0))
    rows, columns = linear_sum_assignment(
        (np.abs(z[None, :] - aim[:, None]) / np.abs(aim - 1.0)[:, None]) ** 2
    )
    error = np.abs(z[columns] - np.exp(s[rows] * h)) / np.abs(np.exp(s[rows] * h) - 1.0)
    inside = np.abs(s[rows]) <= band
    worst = int(np.argmax(np.where(inside, error, -1.0)))
    return (float(error[worst]), float(np.abs(s[rows][worst]))) if np.any(inside) else (0.0, None)


# -- the response at the samples -------------------------------------------------------------------
def exact_matrices(drawn, modes=None):
    """M, D, K of the hub (6 motions, at its centre) with every appendage by finite elements,
    and its frozen mass."""
    hub = np.zeros((6, 6))
    size = mujoco.MjModel.from_xml_string(drawn.text).body_inertia[1]
    hub[:3, :3], hub[3:, 3:] = drawn.hub * np.eye(3), np.diag(size)
    blocks = []
    rows = []
    frozen = hub.copy()
    for spec, turn in zip(drawn.specs.values(), TURNS, strict=False):
        own = finite_elements.cantilever(spec, modes or MODES)
        angle = np.radians(turn)
        axes = np.array(
            [[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]]
        )
        arm = 0.4 * np.array([np.cos(angle), np.sin(angle), 0.0])
        cross = np.array([[0, -arm[2], arm[1]], [arm[2], 0, -arm[0]], [-arm[1], arm[0], 0]])
        port = np.block([[axes, -axes @ cross], [np.zeros((3, 3)), axes]])
        frozen += port.T @ own.rigid @ port
        blocks.append(own.frequencies)
        rows.append(own.participation @ port)
    w = np.concatenate(blocks)
    coupling = np.vstack(rows)
    n = w.size
    mass = np.block([[frozen, coupling.T], [coupling, np.eye(n)]])
    zero = np.zeros(6)
    return mass, np.diag([*zero, *(2.0 * drawn.ratio * w)]), np.diag([*zero, *(w**2)]), frozen


def held(mass, damping, stiffness, h):
    """A and B of the exact motion over (q, q') under a wrench on the hub that is
    held over each step."""
    n = mass.shape[0]
    inverse = np.linalg.inv(mass)
    both = np.zeros((2 * n + 6, 2 * n + 6))
    both[:n, n : 2 * n] = np.eye(n)
    both[n : 2 * n, :n], both[n : 2 * n, n : 2 * n] = -inverse @ stiffness, -inverse @ damping
    both[n : 2 * n, 2 * n :] = inverse[:, :6]
    whole = expm(both * h)
    return whole[: 2 * n, : 2 * n], whole[: 2 * n, 2 * n :]


def response(a, b, z, motions):
    """`(k, 6, 6)` positions of the hub per wrench."""
    eye = np.eye(a.shape[0])
    return np.array([np.linalg.solve(v * eye - a, b)[motions] for v in z])


def sampled_error(drawn, model, points=300):
    """Largest in-band error of the positions at the samples, and where [rad/s];
    inputs as `HeldInput` forms them."""
    mass, damping, stiffness, frozen = exact_matrices(drawn)
    exact = held(mass, damping, stiffness, drawn.step)
    return response_error(exact, stepped(model), frozen, drawn.step, drawn.band, points)


def response_error(exact, ours, frozen, h, band, points=300):
    """Largest in-band error of a step A, B (`stepped`) against the exact one (`held`), and where
    [rad/s]; `frozen`: mass of the hub with all appendages frozen."""
    top = min(band, 2.6 / h)
    s = np.sqrt(np.diag(frozen))
    grid = [np.linspace(top / points, top, points)]
    for matrix in (exact[0], ours[0]):
        poles = np.linalg.eigvals(matrix)
        poles = poles[(poles.imag > 1e-7) & (np.abs(poles) > 0.1)]
        for pole in np.log(poles) / h:
            grid.append(abs(pole) + abs(pole.real) * np.linspace(-3.0, 3.0, 31))
    omega = np.unique(np.concatenate(grid))
    omega = omega[(omega > 0.0) & (omega <= top)]
    z = np.exp(1j * omega * h)
    mean = (1.0 + 1.0 / z) / 2.0
    true = response(*exact, z, slice(0, 6))
    found = response(ours[0], ours[1][:, :6], z, slice(0, 6)) * mean[:, None, None]
    scale = np.outer(s, s) * (2.0 * (z - 1.0) ** 2 / (h**2 * (z + 1.0)))[:, None, None]
    floor = float(np.linalg.norm(np.linalg.inv(frozen) * np.outer(s, s), 2))
    size = np.maximum(np.linalg.norm(true * scale, 2, axis=(1, 2)), floor)
    error = np.linalg.norm((found - true) * scale, 2, axis=(1, 2)) / size
    return float(error.max()), float(omega[int(np.argmax(error))])


def grows(model, steps=20_000, seed=0):
    """Largest deflection of the elastic degrees of freedom in a long free run,
    over that of its first thousandth."""
    data = mujoco.MjData(model)
    rng = np.random.default_rng(seed)
    data.qpos[7:] = 1e-6 * rng.standard_normal(model.nq - 7)
    early = late = 0.0
    for k in range(steps):
        mujoco.mj_step(model, data)
        size = float(np.max(np.abs(data.qpos[7:])))
        early, late = (max(early, size), late) if k < steps // 1000 else (early, max(late, size))
    return late / early
