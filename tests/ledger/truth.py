"""What the ledger holds the package against: finite elements, plain MuJoCo and sampled responses.

Nothing is imported from the package. Beams are p-elements (cubic Hermite functions, for twist and
stretch linear ones, with polynomials that vanish at the nodes), a spacecraft is its rigid bodies
and the modes of its appendages, a file is what differences of MuJoCo's forces and of `mj_step` say.
SI units and radians throughout.
"""

import itertools
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.polynomial import Legendre, Polynomial
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.special import jnp_zeros

BUBBLES, ELEMENTS = 6, 3  # in an element, and elements in a stretch
FASTEST = 1e-8  # slowest over fastest mode, squared: beyond, an appendage is rigid
LEAST, UNSTATED = 1e-5, 0.005  # ratios at which modes are compared: at least; where none is stated
GROWS = 1.0 + 1e-6  # size of a pole of a step that grows
AXES = ("tx", "ty", "tz", "x", "y", "z")
#: motions in space of a port's displacement and rotation, with their signs
PORTS = {"xy": ((1, 5), (1.0, 1.0)), "xz": ((2, 4), (1.0, -1.0))}
PORTS |= {"torsion": ((3,), (1.0,)), "axial": ((0,), (1.0,))}


class Appendage(NamedTuple):
    """Modes `w` `(n,)` of a damping `ratio`, participation `(6, n)` at the root, rigid mass matrix
    `(6, 6)`, and motion `(6, n)` in them of its tip, which is at `(length, 0, 0)`."""

    w: np.ndarray
    ratio: float | None
    participation: np.ndarray
    mass: np.ndarray
    tip: np.ndarray
    length: float


# -- beams -----------------------------------------------------------------------------------------
def _section(segment, s):
    """Stiffness by port, mass and polar inertia per length at the shares `s` of a segment."""
    start = segment["section"]
    end = segment.get("section_end", start)
    d = {k: v + s * (end[k] - v) for k, v in start.items() if isinstance(v, float)}
    extra = segment.get("nonstructural_mass", 0.0) + 0.0 * s
    names = [*PORTS, "mass", "polar"]
    if start["shape"] == "equivalent":
        keys = ["bending_stiffness_xy", "bending_stiffness_xz", "torsion_stiffness"]
        values = [d.get(k) for k in [*keys, "axial_stiffness"]]
        return dict(
            zip(names, [*values, d["linear_mass"] + extra, d["polar_inertia"]], strict=True)
        )
    if start["shape"] == "tube":
        outer = d["outer_diameter"] / 2.0
        inner = outer - d["wall"]
        area, about_z = np.pi * (outer**2 - inner**2), np.pi / 4.0 * (outer**4 - inner**4)
        about_y, twist = about_z, 2.0 * about_z
    else:  # Timoshenko and Goodier, Theory of Elasticity, art. 109
        b, h = d["width_y"], d["width_z"]
        area, about_z, about_y = b * h, h * b**3 / 12.0, b * h**3 / 12.0
        thin, wide = np.minimum(b, h), np.maximum(b, h)
        odd = np.arange(1, 60, 2)[:, None]
        series = np.sum(np.tanh(odd * np.pi * wide / (2.0 * thin)) / odd**5, axis=0)
        twist = wide * thin**3 / 3.0 * (1.0 - 192.0 / np.pi**5 * thin / wide * series)
    young, density = segment["material"]["youngs_modulus"], segment["material"]["density"]
    shear = young / (2.0 + 2.0 * segment["material"]["poissons_ratio"])
    values = [young * about_z, young * about_y, shear * twist, young * area]
    values += [density * area + extra, density * (about_y + about_z)]
    return dict(zip(names, values, strict=True))


_INSIDE = [Legendre.basis(k).convert(kind=Polynomial) for k in range(BUBBLES)]
_HERMITE = [[2, -3, 0, 1], [1, -1, -1, 1], [2, 3, 0, -1], [-1, -1, 1, 1]]
_C1 = [Polynomial(c) / 4.0 for c in _HERMITE] + [Polynomial([1, 0, -1]) ** 2 * p for p in _INSIDE]
_C0 = [Polynomial([0.5, -0.5]), Polynomial([0.5, 0.5])]
_C0 += [Polynomial([1, 0, -1]) * p for p in _INSIDE]
_XI, _WEIGHT = np.polynomial.legendre.leggauss(BUBBLES + 8)


def _port(spec, port):
    """One port of a beam: frequencies, participation `(m, n)`, tip motion `(m, n)` of its modes
    held at the root, and rigid mass matrix `(m, m)`."""
    order, each, functions = (2, 2, _C1) if port in ("xy", "xz") else (1, 1, _C0)
    per = "polar" if port == "torsion" else "mass"
    value = np.array([p(_XI) for p in functions])
    strain = np.array([p.deriv(order)(_XI) for p in functions])

    def node(x):
        return [[1.0, x], [0.0, 1.0]] if each == 2 else [[1.0]]

    springs = {j["after_segment"]: j.get(f"stiffness_{port}") for j in spec.get("joint", ())}
    rigid, here = node(0.0), list(range(each))  # motion of each freedom as the root moves
    terms, stiff, start = [], True, 0.0
    for number, segment in enumerate(spec["segment"]):
        if springs.get(number):
            pull = springs[number] * np.array([[1.0, -1.0], [-1.0, 1.0]])
            terms.append(([here[-1], len(rigid)], 0.0, pull))
            rigid.append(rigid[here[-1]])
            here = [*here[:-1], len(rigid) - 1]
        end = round(start + segment["length"], 9)
        lumps = {p["x"]: p for p in spec.get("lump", ()) if start < p["x"] <= end}
        marks = sorted({start, *lumps, end})
        for a, b in itertools.pairwise(marks):
            for left, right in itertools.pairwise(np.linspace(a, b, ELEMENTS + 1)):
                half = (right - left) / 2.0
                at = _section(segment, (left + half * (1.0 + _XI) - start) / segment["length"])
                scale = np.ones((len(functions), 1))
                scale[[1, 3] if each == 2 else []] = half  # rotations, not slopes in xi
                f, g = value * scale, strain * scale / half**order
                stiff = stiff and at[port] is not None
                k = g * (at[port] * _WEIGHT * half) @ g.T if stiff else 0.0
                own = [*here, *range(len(rigid), len(rigid) + len(functions) - each)]
                terms.append((own, f * (at[per] * _WEIGHT * half) @ f.T, k))
                rigid += node(right) + [[0.0] * each] * BUBBLES
                here = own[each : 2 * each]
            if b in lumps:
                m, turned = lumps[b]["mass"], lumps[b].get("inertia", (0.0, 0.0, 0.0))
                own = {"xy": [m, turned[2]], "xz": [m, turned[1]], "torsion": [turned[0]]}
                terms.append((here, np.diag(own.get(port, [m])), 0.0))
        start = end
    mass, stiffness = np.zeros((2, len(rigid), len(rigid)))
    for own, m, k in terms:
        mass[np.ix_(own, own)] += m
        stiffness[np.ix_(own, own)] += k
    push = mass @ np.array(rigid)
    whole = np.array(rigid).T @ push
    if not stiff:
        return np.zeros(0), np.zeros((each, 0)), np.zeros((each, 0)), whole
    # the slowest modes are the largest of this problem, and lose no digits to the fastest
    flexible, shapes = eigh(mass[each:, each:], stiffness[each:, each:])
    sound = flexible > FASTEST * flexible[-1]
    w = 1.0 / np.sqrt(flexible[sound])
    shapes = shapes[:, sound] * w
    return w, push[each:].T @ shapes, shapes[[i - each for i in here]], whole


def beam(spec):
    """An appendage of segments, joints and lumps, as the dict of its SPEC.toml."""
    parts = {port: _port(spec, port) for port in PORTS}
    mass, rows, tips = np.zeros((6, 6)), [], []
    for port, (_, felt, end, whole) in parts.items():
        into = np.zeros((6, len(felt)))
        into[PORTS[port][0], range(len(felt))] = PORTS[port][1]
        mass += into @ whole @ into.T
        rows.append(into @ felt)
        tips.append(into @ end)
    w = np.concatenate([part[0] for part in parts.values()])
    length = sum(segment["length"] for segment in spec["segment"])
    return Appendage(w, damping(spec), np.hstack(rows), mass, np.hstack(tips), length)


def damping(spec):
    """The ratio that a specification states, or None."""
    return spec.get("damping", {"ratio": None})["ratio"]


def delivered(spec):
    """An appendage given as a table of modes."""
    table = spec["table"]
    w = 2.0 * np.pi * np.array(table["frequencies_hz"])
    rows, mass = np.array(table["participation"]), np.array(table["mass"])
    return Appendage(w, damping(spec), rows, mass, 0.0 * rows, 0.0)


def tank(spec, modes=12):
    """The liquid in an upright cylinder (NASA SP-106, 1966): its axis is x, from the bottom."""
    s = spec["slosh"]
    r, h, a = s["radius"], s["height"], s["acceleration"]
    m = s["density"] * np.pi * r**2 * h
    xi = jnp_zeros(1, 1000)
    half = np.tanh(xi * h / (2.0 * r))
    across = h**2 / 12.0 - 0.75 * r**2 + 16.0 * r**3 / h * np.sum(half / (xi**3 * (xi**2 - 1.0)))
    lift = transport([h / 2.0, 0.0, 0.0], np.eye(3))
    mass = lift.T @ body_mass(m, [0.0, m * across, m * across]) @ lift
    xi, half = xi[:modes], half[:modes]
    deep = np.tanh(xi * h / r)
    w = np.sqrt(a * xi * deep / r)
    root = np.sqrt(m * 2.0 * r * deep / (xi * h * (xi**2 - 1.0)))
    rows = np.zeros((6, 2 * modes))
    rows[1, :modes], rows[5, :modes] = root, root * (h - 2.0 * r / xi * half)
    rows[2, modes:], rows[4, modes:] = root, -rows[5, :modes]
    return Appendage(np.tile(w, 2), s["ratio"], rows, mass, 0.0 * rows, h)


# -- a spacecraft ----------------------------------------------------------------------------------
def body_mass(mass, inertia):
    """`(6, 6)` of a rigid body at its centre."""
    return np.diag([mass, mass, mass, *inertia]).astype(float)


def _cross(v):
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def transport(offset, axes):
    """`(6, 6)` motion of a frame at `offset` with `axes` (columns), per motion of the body."""
    return np.block([[axes.T, -axes.T @ _cross(offset)], [np.zeros((3, 3)), axes.T]])


def about(axis, angle):
    """`(3, 3)` rotation about a unit vector."""
    k = _cross(axis)
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def assemble(hub, parts, angles):
    """A spacecraft with exact appendages, `M q'' + C q' + K q = f`, the hub's six motions first:
    `(M, C, K)`, and the damping with which it is compared in place of C.

    `hub`: mass and inertia; `parts`: a tree of (offset, axes, appendage, carried body or None), the
    body a dict with mass, inertia, axis, kp, kv, parts; `angles`: of its joints, root first.
    """

    def size(parts):
        riders = [p[3] for p in parts if p[3]]
        return sum(p[2].w.size for p in parts) + sum(
            bool(r["axis"]) + size(r["parts"]) for r in riders
        )

    n = 6 + size(parts)
    m, c, k, compared = np.zeros((4, n, n))
    free, angles = itertools.count(6), iter(angles)

    def body(jacobian, mass, inertia, parts):
        m[:] += jacobian.T @ body_mass(mass, inertia) @ jacobian
        for offset, axes, item, rider in parts:
            root = transport(offset, axes) @ jacobian
            own = np.array([next(free) for _ in item.w], dtype=int)
            m[:] += root.T @ item.mass @ root
            push = root.T @ item.participation
            m[:, own] += push
            m[own, :] += push.T
            m[own, own] += 1.0
            k[own, own] = item.w**2
            least = UNSTATED if item.ratio is None else max(item.ratio, LEAST)
            c[own, own] = 2.0 * (item.ratio or 0.0) * item.w
            compared[own, own] = 2.0 * least * item.w
            if rider is None:
                continue
            end = transport([item.length, 0.0, 0.0], np.eye(3)) @ root
            end[:, own] += item.tip
            if rider["axis"]:
                at = next(free)
                end = transport(np.zeros(3), about(rider["axis"], next(angles, 0.0))) @ end
                end[3:, at] += rider["axis"]
                k[at, at], c[at, at], compared[at, at] = (rider[key] for key in ("kp", "kv", "kv"))
            body(end, rider["mass"], rider["inertia"], rider["parts"])

    body(np.eye(6, n), *hub, parts)
    return m, c, k, compared


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
