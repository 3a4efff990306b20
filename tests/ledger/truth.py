"""What the ledger holds the package against: finite elements, plain MuJoCo and sampled responses.

Nothing is imported from the package. Beams are those of `finite_elements`, a spacecraft is one of
`solver`, a file is what differences of MuJoCo's forces and of `mj_step` say.
"""

import mujoco
import numpy as np
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import jnp_zeros

import finite_elements as fe
from solver import Craft, Modes, body_mass

MODES = 8  # of every port of a beam that its mesh has right
LEAST, UNSTATED = 1e-5, 0.005  # ratios at which modes are compared: at least; where none is stated
GROWS = 1.0 + 1e-6  # size of a pole of a step that grows
AXES = ("tx", "ty", "tz", "x", "y", "z")


# -- appendages ------------------------------------------------------------------------------------
def beam(spec):
    """An appendage of segments, joints and lumps, as the dict of its SPEC.toml."""
    found = fe.every_mode(spec, MODES)
    return Modes(
        found.frequencies,
        damping(spec),
        found.participation,
        found.rigid,
        found.tip,
        fe.length(spec),
    )


def damping(spec):
    """The ratio that a specification states, or None."""
    return spec.get("damping", {"ratio": None})["ratio"]


def delivered(spec):
    """An appendage given as a table of modes."""
    table = spec["table"]
    w = 2.0 * np.pi * np.array(table["frequencies_hz"])
    rows, mass = np.array(table["participation"]).T, np.array(table["mass"])
    return Modes(w, damping(spec), rows, mass, 0.0 * rows)


def tank(spec, modes=12):
    """The liquid in an upright cylinder (NASA SP-106, 1966): its axis is x, from the bottom."""
    s = spec["slosh"]
    r, h, a = s["radius"], s["height"], s["acceleration"]
    m = s["density"] * np.pi * r**2 * h
    xi = jnp_zeros(1, 1000)
    half = np.tanh(xi * h / (2.0 * r))
    across = h**2 / 12.0 - 0.75 * r**2 + 16.0 * r**3 / h * np.sum(half / (xi**3 * (xi**2 - 1.0)))
    mass = body_mass(m, [h / 2.0, 0.0, 0.0], [0.0, m * across, m * across])
    xi, half = xi[:modes], half[:modes]
    deep = np.tanh(xi * h / r)
    w = np.sqrt(a * xi * deep / r)
    root = np.sqrt(m * 2.0 * r * deep / (xi * h * (xi**2 - 1.0)))
    rows = np.zeros((2 * modes, 6))
    rows[:modes, 1], rows[:modes, 5] = root, root * (h - 2.0 * r / xi * half)
    rows[modes:, 2], rows[modes:, 4] = root, -rows[:modes, 5]
    return Modes(np.tile(w, 2), s["ratio"], rows, mass, 0.0 * rows, h)


# -- a spacecraft ----------------------------------------------------------------------------------
def assemble(hub, parts, angles):
    """A spacecraft with exact appendages, `M q'' + C q' + K q = f`, the hub's six motions first:
    `(M, C, K)`, and the damping with which it is compared in place of C.

    `hub`: mass and inertia; `parts`: a tree of (offset, axes, appendage, carried body or None), the
    body a dict with mass, inertia, axis, kp, kv, parts; `angles`: of its joints, root first.
    """

    def matrices(ratio_of):
        craft, turned = Craft(), iter(angles)

        def body(frame, mass, inertia, parts):
            craft.body(frame, mass, inertia=inertia)
            for offset, axes, item, rider in parts:
                damped = item._replace(ratio=ratio_of(item.ratio))
                end, _ = craft.modes(frame.at(offset, axes), damped)
                if rider is None:
                    continue
                if rider["axis"]:
                    angle = next(turned, 0.0)
                    end = craft.hinge(end, rider["axis"], angle, rider["kp"], rider["kv"])
                body(end, rider["mass"], rider["inertia"], rider["parts"])

        body(craft.base, *hub, parts)
        return craft.matrices()

    stated = matrices(lambda ratio: ratio or 0.0)
    return *stated, matrices(lambda r: UNSTATED if r is None else max(r, LEAST))[1]


# -- a file ----------------------------------------------------------------------------------------
def _differences(function, count, eps):
    """Derivatives of a function by each of `count` numbers about zero, a column each, from
    differences of fourth order."""
    columns = [
        8.0 * (function(x) - function(-x)) - (function(2.0 * x) - function(-2.0 * x))
        for x in eps * np.eye(count)
    ]
    return np.array(columns).T / (12.0 * eps)


def _still(model, qpos):
    """Data at rest at a pose, whatever pulls there balanced."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    data.qfrc_applied[:] = -data.qfrc_smooth
    return data


def compiled(model, qpos):
    """`(M, C, K)` of a compiled file at a pose, from differences of its forces."""
    data, nv, mass = _still(model, qpos), model.nv, np.zeros((model.nv, model.nv))
    for column, unit in zip(mass, np.eye(nv), strict=True):
        mujoco.mj_mulM(model, data, column, unit)

    def pull(moved, rate):
        data.qpos[:], data.qvel[:] = qpos, rate
        mujoco.mj_integratePos(model, data.qpos, moved, 1.0)
        mujoco.mj_forward(model, data)
        return -data.qfrc_passive - data.qfrc_actuator

    none = np.zeros(nv)
    c = _differences(lambda x: pull(none, x), nv, 1e-4)
    k = _differences(lambda x: pull(x, none), nv, 1e-4)
    k[:, :6] = 0.0
    return mass, (c + c.T) / 2.0, (k + k.T) / 2.0


def lacking(m, c, k, dofs, least):
    """`(nv, nv)` what the held modes of an appendage's degrees of freedom lack of a ratio."""
    out, own = np.zeros_like(m), np.ix_(dofs, dofs)
    if dofs:
        squares, shapes = eigh(k[own], m[own])
        wanted = 2.0 * least * np.sqrt(squares) - np.einsum("ik,ij,jk->k", shapes, c[own], shapes)
        push = m[own] @ shapes
        out[own] = push * wanted @ push.T
    return out


def step_map(model, qpos):
    """`(A, B)` of `mj_step` at a pose: tangents of positions, rates; wrenches on the hub."""
    data = _still(model, qpos)
    hold, nv = data.qfrc_applied.copy(), model.nv

    def after(x):
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = qpos, x[nv : 2 * nv]
        mujoco.mj_integratePos(model, data.qpos, x[:nv], 1.0)
        data.qfrc_applied[:], data.xfrc_applied[model.jnt_bodyid[0]] = hold, 100.0 * x[2 * nv :]
        mujoco.mj_step(model, data)
        moved = np.zeros(nv)
        mujoco.mj_differentiatePos(model, moved, 1.0, qpos, data.qpos)
        return np.concatenate([moved, data.qvel])

    a = _differences(after, 2 * nv + 6, 1e-3)  # MuJoCo ignores turns below 1e-15
    a[:, :6] = np.eye(2 * nv, 6)  # where the hub is makes no difference
    return a[:, : 2 * nv], a[:, 2 * nv :] / 100.0


def largest_step(model):
    """The step at which a file begins to grow at rest; infinite where it does not within a
    thousand times its own."""
    own = low = model.opt.timestep

    def grows(h):
        model.opt.timestep = h
        a, _ = step_map(model, model.qpos0)
        return np.max(np.abs(np.linalg.eigvals(a[6:, 6:]))) > GROWS

    while grows(low):
        low /= 1.2
    high = 1.2 * low
    while not grows(high):
        low, high = high, 1.2 * high
        if high > 1e3 * own:
            return np.inf
    for _ in range(14):
        middle = (low + high) / 2.0
        low, high = (low, middle) if grows(middle) else (middle, high)
    return low


# -- responses and errors --------------------------------------------------------------------------
class Poles:
    """A linear craft as poles and residues of the hub's position per wrench on it."""

    def __init__(self, m, c, k):
        held = np.diag(k) > 1e-7 * np.diag(m)
        shift = np.min(np.diag(k)[held] / np.diag(m)[held])
        periods, shapes = eigh(m, k + shift * m)  # the slowest keep their digits
        order = np.argsort(-periods)
        shapes, squares = shapes[:, order] / np.sqrt(periods[order]), 1.0 / periods[order] - shift
        elastic = np.arange(squares.size) >= np.count_nonzero(~held)
        self.free = shapes[:6, ~elastic] @ shapes[:6, ~elastic].T
        w, seen = np.sqrt(squares[elastic]), shapes[:, elastic]
        n = w.size
        flow = np.block([[np.zeros((n, n)), np.diag(w)], [-np.diag(w), -seen.T @ c @ seen]])
        self.poles, vectors = np.linalg.eig(flow)
        back = np.linalg.inv(vectors)
        self.out = (seen[:6] / w) @ vectors[:n]
        self.into = back[:, n:] @ seen[:6].T
        rates = np.linalg.solve(m[6:, 6:], np.hstack([-k[6:, 6:], -c[6:, 6:]]))
        rows = np.eye(len(rates), 2 * len(rates), len(rates))
        self.peaks = np.concatenate([self.poles, np.linalg.eigvals(np.vstack([rows, rates]))])

    def _summed(self, weights):
        table = np.einsum("ik,kj->kij", self.out, self.into).reshape(-1, 36)
        return self.free + (weights @ table).reshape(-1, 6, 6)

    def accelerance(self, omega):
        """`(k, 6, 6)` of the hub."""
        s = 1j * omega[:, None]
        return self._summed(s**2 / (s - self.poles))

    def held(self, z, h):
        """The same of a wrench held over steps of `h` and of positions at the samples."""
        grown, ahead = np.expm1(self.poles * h), z[:, None] - 1.0
        each = grown / self.poles / (ahead - grown)
        return self._summed(2.0 * ahead**2 / (h**2 * (ahead + 2.0)) * each)


def _grid(peaks, band):
    grid = [np.linspace(band / 1200.0, band, 1200)]
    for pole in np.concatenate(peaks):
        if pole.imag > 0.0 and abs(pole) < 1.5 * band:
            width = max(-pole.real, 1e-7 * abs(pole))
            offset = width * np.concatenate(
                [np.linspace(0.0, 3.0, 13), np.geomspace(3.5, 200.0, 12)]
            )
            grid += [pole.imag + offset, pole.imag - offset]
    omega = np.unique(np.concatenate(grid))
    return omega[(omega > band / 300.0) & (omega <= band)]


def _maximum(curve, omega):
    """The largest value: the highest crests of the grid are followed between its points."""
    values = np.concatenate([curve(part) for part in np.array_split(omega, omega.size // 400 + 1)])
    for _ in range(5):
        fence = np.concatenate([[-np.inf], values, [-np.inf]])
        crests = np.flatnonzero((values >= fence[:-2]) & (values >= fence[2:]))
        crests = crests[np.argsort(values[crests])[-6:]]
        ends = [(omega[max(k - 1, 0)], omega[min(k + 1, omega.size - 1)]) for k in crests]
        more = np.concatenate([np.linspace(*each, 9)[1:-1] for each in ends])
        omega, values = np.concatenate([omega, more]), np.concatenate([values, curve(more)])
        order = np.argsort(omega, kind="stable")
        omega, values = omega[order], values[order]
    return float(np.max(values))


class Judge:
    """The hub's motions `axes` up to a band [rad/s]: the exact craft against a file."""

    def __init__(self, exact, axes, band):
        self.band, self.keep = band, [AXES.index(a) for a in axes]
        m, c, k, compared = exact
        size = np.sqrt(np.diag(m)[self.keep])
        self.scale = np.outer(size, size)
        rigid = np.linalg.inv(m[:6, :6])[np.ix_(self.keep, self.keep)]
        self.floor = np.linalg.norm(rigid * self.scale, 2)
        self.stated = Poles(m, c, k)
        self.truth = Poles(m, compared, k) if np.any(compared != c) else self.stated

    def _off(self, file, exact):
        file, exact = ((x[:, self.keep][:, :, self.keep]) * self.scale for x in (file, exact))
        size = np.linalg.norm(exact, 2, axis=(1, 2))
        return np.linalg.norm(file - exact, 2, axis=(1, 2)) / np.maximum(size, self.floor)

    def craft_error(self, m, c, k):
        """In continuous time."""
        file = Poles(m, c, k)
        omega = _grid([self.truth.peaks, file.peaks], self.band)
        return _maximum(lambda w: self._off(file.accelerance(w), self.truth.accelerance(w)), omega)

    def sampled_error(self, a, b, h, *, mean):
        """At the step; `mean`: whether the file is given the mean of two inputs."""
        own = np.linalg.eigvals(a[6:, 6:]).astype(complex)
        if np.max(np.abs(own)) > GROWS:
            return np.inf
        own = np.log(own[np.abs(own) > 1e-9]) / h
        ringing, compared = (p.poles[p.poles.imag > 0.0] for p in (self.stated, self.truth))
        near = compared[np.argmin(np.abs(ringing.imag[:, None] - compared.imag), axis=1)]
        short = np.maximum(ringing.real - near.real, 0.0) / ringing.imag  # damping that is lacking
        short[short < 1e-9] = 0.0
        unit = np.eye(len(a))

        def curve(w):
            lack = short[np.argmin(np.abs(w[:, None] - ringing.imag), axis=1)]
            z = np.exp((1j + lack) * w * h)
            factor = 2.0 * (z - 1.0) ** 2 / (h**2 * (z + 1.0))
            factor = factor * (z + 1.0) / (2.0 * z) if mean else factor
            moved = np.linalg.solve(z[:, None, None] * unit - a, factor[:, None, None] * b)
            return self._off(moved[:, :6], self.stated.held(z, h))

        top = min(self.band, 2.6 / h)
        omega = _grid([self.truth.poles, own[np.abs(own) * h > 1e-3]], top)
        return _maximum(curve, omega[omega > top / 100.0])

    def margins(self, controller, axis):
        """Gain margin and least phase margin [degrees] of a loop about an axis in continuous time;
        `controller`: what it makes of `s`."""
        row = AXES.index(axis)
        omega = np.geomspace(self.band / 3000.0, 20.0 * self.band, 4000)
        omega = np.union1d(omega, _grid([self.stated.peaks], 5.0 * self.band))

        def loop(w):
            s = 1j * np.atleast_1d(w)
            return controller(s) * self.stated.accelerance(s.imag)[:, row, row] / s**2

        def crossings(size):
            values = size(loop(omega))
            for i in np.flatnonzero(values[1:] * values[:-1] < 0.0):
                yield loop(brentq(lambda w: size(loop(w))[0], omega[i], omega[i + 1]))[0]

        turned = [np.degrees(abs(np.angle(-v))) for v in crossings(lambda v: abs(v) - 1.0)]
        raised = [-1.0 / v.real for v in crossings(np.imag) if -1.0 < v.real < 0.0]
        return min(raised, default=np.inf), min(turned, default=np.inf)
