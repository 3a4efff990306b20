"""A straight appendage in finite elements: an independent truth for exact chains.

Displacement-based p-elements, assembled over nodes: cubic Hermite functions (Euler) or separate
linear fields for displacement and rotation (Timoshenko, torsion, axial motion), all enriched by
integrated Legendre polynomials that vanish at the nodes. The appendage is the plain dict of a
parsed SPEC.toml; nothing is imported from the package.

Stiffness and mass are never formed: both are kept as rows (square roots) at Gauss points, `K = S^T
S`, `M = E^T E`. With `S = Q R` the singular values of `E R^-1` are 1 / frequency of the appendage
with its root held, so no digits go to the stiffness of joints or to slenderness. A free or carried
root is condensed by projection, which splits the rigid motions off exactly.

Ports: "xy" (displacement y, rotation about +z), "xz" (displacement z, rotation about -y),
"torsion", "axial". Space: motions (x, y, z, rotations about x, y, z) of the root.
"""

import contextlib
import json
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander
from scipy.linalg import solve_triangular
from scipy.special import zeta

PORTS = ("xy", "xz", "torsion", "axial")
BENDING = ("xy", "xz")
#: Motions in space (index, sign) of each port's own motions.
COLUMNS = {
    "xy": ((1, 1.0), (5, 1.0)),
    "xz": ((2, 1.0), (4, -1.0)),
    "torsion": ((3, 1.0),),
    "axial": ((0, 1.0),),
}
SAME = 1e-9  # of the length: two stations closer than that are one
CONVERGED = 3e-13
MOST = 60  # bubbles in an element


def into_space(port):
    """`(6, m)` motion in space per unit of each motion of the port."""
    out = np.zeros((6, len(COLUMNS[port])))
    for column, (row, sign) in enumerate(COLUMNS[port]):
        out[row, column] = sign
    return out


# -- sections --------------------------------------------------------------------------------------
def section_properties(segment, fraction):
    """Stiffness and inertia per length of a segment at `fraction` of its length;
    a taper is linear in the dimensions.

    Returns:
        dict of arrays: bending_xy, bending_xz, torsion, axial (stiffness), shear_xy,
            shear_xz (k G A), mass, polar
        (inertia about x per length), rotary_xy, rotary_xz (rho I, of Timoshenko segments only).
    """
    fraction = np.asarray(fraction, dtype=float)
    start = dict(segment["section"])
    end = dict(segment.get("section_end") or segment["section"])
    shape = start.pop("shape")
    assert end.pop("shape") == shape
    for sides in (start, end):
        if shape == "custom":  # perpendicular axes
            sides["polar_moment"] = (
                sides.get("polar_moment") or sides["second_moment_y"] + sides["second_moment_z"]
            )
        if shape == "equivalent":
            sides["bending_stiffness_xz"] = (
                sides.get("bending_stiffness_xz") or sides["bending_stiffness_xy"]
            )
            for name in ("torsion_stiffness", "axial_stiffness", "polar_inertia"):
                sides.setdefault(name, 0.0)
    at = {name: start[name] + fraction * (end[name] - start[name]) for name in start}
    nothing = np.zeros_like(fraction)
    extra = segment.get("nonstructural_mass", 0.0)
    if shape == "equivalent":
        return {
            "bending_xy": at["bending_stiffness_xy"],
            "bending_xz": at["bending_stiffness_xz"],
            "torsion": at["torsion_stiffness"],
            "axial": at["axial_stiffness"],
            "shear_xy": nothing,
            "shear_xz": nothing,
            "mass": at["linear_mass"] + extra,
            "polar": at["polar_inertia"],
            "rotary_xy": nothing,
            "rotary_xz": nothing,
        }
    area, about_z, about_y, torsion, polar = _geometry(shape, at)
    young, shear, poisson, density = _material(segment["material"])
    stout = segment.get("theory", "euler") == "timoshenko"
    factor = {
        p: segment.get("shear_factor") or _shear_factor(shape, at, poisson, p) for p in BENDING
    }
    return {
        "bending_xy": young * about_z,
        "bending_xz": young * about_y,
        "torsion": shear * torsion,
        "axial": young * area,
        "shear_xy": factor["xy"] * shear * area,
        "shear_xz": factor["xz"] * shear * area,
        "mass": density * area + extra,
        "polar": density * polar,
        "rotary_xy": density * about_z * stout,
        "rotary_xz": density * about_y * stout,
    }


def _material(given):
    young = given["youngs_modulus"]
    shear = given.get("shear_modulus")
    poisson = given.get("poissons_ratio")
    if poisson is None:
        poisson = 0.3 if shear is None else young / (2.0 * shear) - 1.0
    return young, shear or young / (2.0 * (1.0 + poisson)), poisson, given["density"]


def _geometry(shape, at):
    """Area, second moments about z and y, Saint-Venant constant, polar moment."""
    if shape == "round":
        r = at["diameter"] / 2.0
        i = np.pi / 4.0 * r**4
        return np.pi * r**2, i, i, 2.0 * i, 2.0 * i
    if shape == "tube":
        outer = at["outer_diameter"] / 2.0
        inner = outer - at["wall"]
        i = np.pi / 4.0 * (outer - inner) * (outer + inner) * (outer**2 + inner**2)
        return np.pi * (outer - inner) * (outer + inner), i, i, 2.0 * i, 2.0 * i
    if shape == "rectangle":
        b, h = at["width_y"], at["width_z"]
        return (
            b * h,
            h * b**3 / 12.0,
            b * h**3 / 12.0,
            _rectangle_torsion(b, h),
            b * h * (b**2 + h**2) / 12.0,
        )
    if shape == "box":
        b = at["width_y"]
        h = at["width_z"]
        t = at["wall"]
        bi, hi = b - 2.0 * t, h - 2.0 * t
        about_z = (h * b**3 - hi * bi**3) / 12.0
        about_y = (b * h**3 - bi * hi**3) / 12.0
        enclosed = (b - t) * (h - t)
        around = 2.0 * ((b - t) + (h - t))  # of the middle line
        # Bredt
        return b * h - bi * hi, about_z, about_y, 4.0 * enclosed**2 * t / around, about_z + about_y
    assert shape == "custom"
    return (
        at["area"],
        at["second_moment_z"],
        at["second_moment_y"],
        at["torsion_constant"],
        at["polar_moment"],
    )


def _rectangle_torsion(b, h):
    """Torsion constant of a solid rectangle (Timoshenko and Goodier, Theory of
    Elasticity, art. 109)."""
    wide = np.maximum(b, h)
    thin = np.minimum(b, h)
    n = np.arange(1, 22, 2).reshape(-1, *([1] * np.ndim(wide)))
    total = 31.0 / 32.0 * zeta(5) + np.sum(
        (np.tanh(n * np.pi * wide / (2.0 * thin)) - 1.0) / n**5, axis=0
    )
    return wide * thin**3 / 3.0 * (1.0 - 192.0 / np.pi**5 * thin / wide * total)


def _shear_factor(shape, at, nu, plane):
    """G. R. Cowper, The shear coefficient in Timoshenko's beam theory, J. Appl. Mech.
    33 (1966) 335."""
    if shape == "round":
        return 6.0 * (1.0 + nu) / (7.0 + 6.0 * nu)
    if shape == "tube":
        m = (1.0 - 2.0 * at["wall"] / at["outer_diameter"]) ** 2
        return (
            6.0
            * (1.0 + nu)
            * (1.0 + m) ** 2
            / ((7.0 + 6.0 * nu) * (1.0 + m) ** 2 + (20.0 + 12.0 * nu) * m)
        )
    if shape == "rectangle":
        return 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu)
    # thin walls of equal thickness; n: flange (across the plane) over web (in it)
    if shape == "box":
        n = at["width_z"] / at["width_y"] if plane == "xy" else at["width_y"] / at["width_z"]
        below = 12.0 + 72.0 * n + 150.0 * n**2 + 90.0 * n**3
        below += nu * (11.0 + 66.0 * n + 135.0 * n**2 + 90.0 * n**3) + 10.0 * n**2 * (
            (3.0 + nu) * n + 3.0 * n**2
        )
        return 10.0 * (1.0 + nu) * (1.0 + 3.0 * n) ** 2 / below
    return 1.0


# -- elements --------------------------------------------------------------------------------------
def _bubbles(count, xi):
    """`(q, count)` integrals of P_1, P_2, ... and the polynomials themselves;
    the integrals vanish at both ends."""
    p = legvander(xi, count + 1)
    k = np.arange(1, count + 1)
    return (p[:, k + 1] - p[:, k - 1]) / (2 * k + 1), p[:, k]


def _double_bubbles(count, xi):
    """`(q, count)` twice integrated P_2, P_3, ..., their slopes and curvatures;
    value and slope vanish at both ends."""
    p = legvander(xi, count + 3)
    k = np.arange(2, count + 2)
    upper = (p[:, k + 2] - p[:, k]) / (2 * k + 3)
    lower = (p[:, k] - p[:, k - 2]) / (2 * k - 1)
    return (upper - lower) / (2 * k + 1), (p[:, k + 1] - p[:, k - 1]) / (2 * k + 1), p[:, k]


@dataclass(frozen=True)
class _Element:
    """Shape functions of one stretch: columns are its own freedoms,
    listed in `freedoms` (-1: held)."""

    start: float
    half: float
    kind: str  # "euler", "timoshenko" or "rod"
    freedoms: np.ndarray
    bubbles: int

    def motion(self, xi):
        """Displacement and rotation (rod: one motion) and strains (curvature, shear) at `xi`."""
        h = self.half
        left = (1.0 - xi) / 2.0
        right = (1.0 + xi) / 2.0
        none = np.zeros((xi.size, 1))
        if self.kind == "rod":
            values, slopes = _bubbles(self.bubbles, xi)
            u = np.column_stack([left, right, values])
            return (u,), (np.column_stack([none - 0.5, none + 0.5, slopes]) / h,)
        if self.kind == "euler":
            values, slopes, curves = _double_bubbles(self.bubbles, xi)
            a = (2.0 + xi) * (1.0 - xi) ** 2 / 4.0
            b = (1.0 + xi) * (1.0 - xi) ** 2 / 4.0
            c = (2.0 - xi) * (1.0 + xi) ** 2 / 4.0
            d = -(1.0 - xi) * (1.0 + xi) ** 2 / 4.0
            v = np.column_stack([a, h * b, c, h * d, h**2 * values])
            bend = 0.75 * (1.0 - xi**2)
            turn = np.column_stack(
                [
                    -bend / h,
                    (3.0 * xi**2 - 2.0 * xi - 1.0) / 4.0,
                    bend / h,
                    (3.0 * xi**2 + 2.0 * xi - 1.0) / 4.0,
                    h * slopes,
                ]
            )
            curve = np.column_stack(
                [
                    1.5 * xi / h**2,
                    (3.0 * xi - 1.0) / 2.0 / h,
                    -1.5 * xi / h**2,
                    (3.0 * xi + 1.0) / 2.0 / h,
                    curves,
                ]
            )
            return (v, turn), (curve,)
        values, slopes = _bubbles(self.bubbles + 1, xi)
        blank = np.zeros_like(values)
        short = np.zeros_like(values[:, :-1])
        v = np.column_stack([left, none, right, none, values, short])
        turn = np.column_stack([none, left, none, right, blank, values[:, :-1]])
        curve = np.column_stack([none, none - 0.5, none, none + 0.5, blank, slopes[:, :-1]]) / h
        rise = np.column_stack([none - 0.5, none, none + 0.5, none, slopes, short]) / h
        return (v, turn), (curve, rise - turn)


@dataclass(frozen=True)
class _Rows:
    """One discretisation: rows of mass over strain coordinates y (strain energy |y|^2 / 2) and
    over root motions."""

    elastic: np.ndarray
    rigid: np.ndarray
    elements: list
    back: np.ndarray  # freedoms per strain coordinate

    def at(self, x):
        """`(m, N)` motion at `x` per strain coordinate, root held;
        before the joint where one stands there."""
        if x <= 0.0:
            return np.zeros((self.rigid.shape[1], self.elastic.shape[1]))
        element = next(e for e in self.elements if x <= e.start + 2.0 * e.half * (1.0 + SAME))
        motion, _ = element.motion(np.array([min((x - element.start) / element.half - 1.0, 1.0)]))
        return (
            np.vstack([_spread(rows, element.freedoms, self.back.shape[0]) for rows in motion])
            @ self.back
        )


def strained(stretch, heavy):
    """Rows of mass over strain coordinates y (strain energy |y|^2 / 2), and freedoms per strain
    coordinate."""
    scale = np.linalg.norm(stretch, axis=0)
    triangle = np.linalg.qr(stretch / scale, mode="r")
    back = solve_triangular(triangle, np.eye(scale.size)) / scale[:, None]
    return solve_triangular(triangle, (heavy / scale).T, trans="T").T, back


def freed(elastic, rigid, hub=None):
    """Elastic rows that are left when the root is free on a rigid hub `(m, m)`; None: nothing."""
    values, vectors = np.linalg.eigh(np.zeros((rigid.shape[1],) * 2) if hub is None else hub)
    top = np.vstack([rigid, np.sqrt(np.clip(values, 0.0, None))[:, None] * vectors.T])
    scale = np.linalg.norm(top, axis=0)
    keep = scale > 0.0
    basis, _ = np.linalg.qr(top[:, keep] / scale[keep])
    rows = np.vstack([elastic, np.zeros((len(values), elastic.shape[1]))])
    rows = rows - basis @ (basis.T @ rows)
    return rows - basis @ (basis.T @ rows)


def _spread(rows, freedoms, size):
    out = np.zeros((rows.shape[0], size))
    live = freedoms >= 0
    out[:, freedoms[live]] = rows[:, live]
    return out


def length(spec):
    """Root to tip [m]."""
    return float(sum(segment["length"] for segment in spec["segment"]))


def _bodies(spec, payload):
    """Lumps and payload as (x, mass, inertia); payload:
    (mass, inertia) at the tip or (mass, inertia, x)."""
    out = [
        (b["x"], b["mass"], tuple(b.get("inertia", (0.0, 0.0, 0.0)))) for b in spec.get("lump", ())
    ]
    if payload is not None:
        mass, inertia, *x = payload
        out.append((x[0] if x else length(spec), mass, tuple(inertia)))
    return out


def _stations(spec, bodies):
    """Elements' ends: segments, bodies, and inside tapers so that no dimension changes
    by more than half."""
    total = length(spec)
    x = 0.0
    for segment in spec["segment"]:
        first = segment["section"]
        last = segment.get("section_end") or segment["section"]
        ratio = max(
            [1.0]
            + [
                max(first[k] / last[k], last[k] / first[k])
                for k in first
                if k != "shape" and first[k] and last.get(k)
            ]
        )
        inner = [
            b[0] for b in bodies if x + SAME * total < b[0] < x + segment["length"] - SAME * total
        ]
        pieces = max(1, int(np.ceil(np.log(ratio) / np.log(1.5) - 1e-9)))
        if pieces > 1:  # a ratio per piece, fine at the slender end
            grown = (ratio ** (np.arange(1, pieces) / pieces) - 1.0) / (ratio - 1.0)
            slender = sum(first[k] for k in first if k != "shape") > sum(
                last.get(k, 0) for k in last if k != "shape"
            )
            inner += [x + segment["length"] * (1.0 - g if slender else g) for g in grown]
        ends = sorted([x, *inner, x + segment["length"]])
        ends = [a for a, b in pairwise(ends) if b - a > SAME * total] + [ends[-1]]
        yield segment, x, ends
        x += segment["length"]


def _discretise(spec, port, payload, bubbles):
    bending = port in BENDING
    bodies = _bodies(spec, payload)
    hinges = {
        j["after_segment"]: j[f"stiffness_{port}"]
        for j in spec.get("joint", ())
        if f"stiffness_{port}" in j
    }
    xi, weight = leggauss(bubbles + 8)
    total = length(spec)
    count = 0

    def new(k):
        nonlocal count
        count += k
        return np.arange(count - k, count)

    # freedoms at the current node: displacement and rotation before and after the joint; -1: held
    displacement, before, after = -1, -1, -1
    elements, strains, masses = [], [], []
    nodes = []  # x, displacement and rotation before the joint
    turning = "polar" if port == "torsion" else "mass"
    for number, (segment, x0, ends) in enumerate(_stations(spec, bodies)):
        c = hinges.get(number)
        nodes.append((ends[0], displacement, before))
        if c is not None:
            if bending:
                after = int(new(1)[0])
                strains.append(_jump(c, before, after))
            else:
                before, displacement = displacement, int(new(1)[0])
                strains.append(_jump(c, before, displacement))
        for a, b in pairwise(ends):
            half = (b - a) / 2.0
            at = section_properties(segment, (a + half * (1.0 + xi) - x0) / segment["length"])
            kind = segment.get("theory", "euler") if bending else "rod"
            own = new(
                {"rod": bubbles + 1, "euler": bubbles + 2, "timoshenko": 2 * bubbles + 3}[kind]
            )
            if bending:
                freedoms = np.array([displacement, after, *own])
                displacement = int(own[0])
                before = int(own[1])
                after = before
            else:
                freedoms = np.array([displacement, *own])
                displacement = int(own[0])
            element = _Element(a, half, kind, freedoms, bubbles)
            elements.append(element)
            motion, strain = element.motion(xi)
            stiffness = [at[f"bending_{port}"], at[f"shear_{port}"]] if bending else [at[port]]
            inertia = [at["mass"], at[f"rotary_{port}"]] if bending else [at[turning]]
            for rows, value in zip(strain, stiffness, strict=False):
                if np.any(value <= 0.0):
                    raise ValueError(f"{port}: a segment states no stiffness")
                strains.append((np.sqrt(half * weight * value)[:, None] * rows, freedoms))
            place = _rigid(port, a + half * (1.0 + xi))
            for rows, rigid, value in zip(motion, place, inertia, strict=False):
                root = np.sqrt(half * weight * value)[:, None]
                if np.any(root > 0.0):
                    masses.append((root * rows, freedoms, root * rigid))
            nodes.append((b, displacement, before))
    for x, mass, turn in bodies:
        place = _rigid(port, np.array([x]))
        # of the nodes at one station the first in the list stands before the joint
        _, v, r = next(node for node in nodes if abs(node[0] - x) <= SAME * total)
        about = {"xy": 2, "xz": 1, "torsion": 0}.get(port)
        size = turn[0] if port == "torsion" else mass
        masses.append((np.array([[np.sqrt(size)]]), np.array([v]), np.sqrt(size) * place[0]))
        if bending and turn[about] > 0.0:
            masses.append(
                (np.array([[np.sqrt(turn[about])]]), np.array([r]), np.sqrt(turn[about]) * place[1])
            )
    if not masses or not any(np.any(rows) for rows, *_ in masses):
        raise ValueError(f"{port}: the appendage has no inertia")
    stretch = np.vstack([_spread(rows, freedoms, count) for rows, freedoms in strains])
    heavy = np.vstack([_spread(rows, freedoms, count) for rows, freedoms, _ in masses])
    elastic, back = strained(stretch, heavy)
    return _Rows(elastic, np.vstack([rigid for *_, rigid in masses]), elements, back)


def _jump(stiffness, before, after):
    root = np.sqrt(stiffness)
    return np.array([[-root, root]]), np.array([before, after])


def _rigid(port, x):
    """Rows of displacement and rotation (one motion where not bending) at `x` per
    motion of the root."""
    if port not in BENDING:
        return (np.ones((x.size, 1)),)
    return np.column_stack([np.ones_like(x), x]), np.column_stack(
        [np.zeros_like(x), np.ones_like(x)]
    )


# -- one port --------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Port:
    """A port of the appendage in finite elements; `n` modes with the root held are converged.

    Attributes:
        frequencies: `(n,)` with the root held [rad/s].
        participation: `(n, m)` `L_k = R^T M phi_k`, mass normalised, force positive.
        tip: `(n, m)` motion of the tip in each mode.
        rigid: `(m, m)` rigid mass matrix about the root.
        rows: the discretisation.
    """

    port: str
    frequencies: np.ndarray
    participation: np.ndarray
    tip: np.ndarray
    rigid: np.ndarray
    rows: _Rows = field(repr=False)
    shapes: np.ndarray = field(repr=False)
    key: str = field(repr=False)
    payload: tuple | None = None

    def motion(self, x):
        """`(n, m)` motion at `x` in each mass-normalised mode, root held."""
        return (self.rows.at(x) @ self.shapes).T

    def flexibility(self, x):
        """`(m, m)` motion at `x` per unit force and moment there, root held;
        the curvature may jump at `x`."""
        spec = json.loads(self.key)
        cut = json.dumps({**spec, "lump": [*spec.get("lump", ()), {"x": x, "mass": 0.0}]})
        at = _converged(cut, self.port, self.frequencies.size, self.payload).rows.at(x)
        return at @ at.T

    def coupled(self, hub=None, modes=8):
        """Lowest elastic frequencies with the root free and a rigid hub `(m, m)` on it;
        None: nothing."""
        free = freed(self.rows.elastic, self.rows.rigid, hub)
        return 1.0 / np.linalg.svd(free, compute_uv=False)[:modes]


def port(spec, name, modes=8, payload=None):
    """The port `name` of a spec (dict), its lowest `modes` converged, held and free.

    Args:
        spec: parsed SPEC.toml.
        name: "xy", "xz", "torsion" or "axial".
        modes: converged to about 1e-12.
        payload: (mass, inertia) of a rigid body at the tip, or (mass, inertia, x).
    """
    key = json.dumps({k: spec[k] for k in ("segment", "joint", "lump") if k in spec})
    return _converged(
        key, name, modes, None if payload is None else (payload[0], tuple(payload[1]), *payload[2:])
    )


@lru_cache(maxsize=128)
def _converged(key, name, modes, payload):
    spec = json.loads(key)
    elements = sum(len(ends) - 1 for *_, ends in _stations(spec, _bodies(spec, payload)))
    bubbles = 8 + int(np.ceil(1.6 * modes / elements))
    before, last = None, np.inf
    while True:
        rows = _discretise(spec, name, payload, bubbles)
        left, values, right = np.linalg.svd(rows.elastic, full_matrices=False)
        free = np.linalg.svd(freed(rows.elastic, rows.rigid), compute_uv=False)
        now = np.concatenate([values[:modes], free[:modes]])
        change = (
            np.inf
            if before is None or before.size != now.size
            else np.max(np.abs(now / before - 1.0))
        )
        stands = change < 1e-10 and change > 0.3 * last
        if change < CONVERGED or stands or bubbles > MOST:
            break
        before, last, bubbles = now, change, bubbles + 4
    n = min(modes, values.size)
    participation = left[:, :n].T @ rows.rigid
    shapes = right[:n].T / values[:n]
    size = np.linalg.norm(rows.rigid, axis=0)
    signs = np.array([first_sign(row / np.where(size > 0.0, size, 1.0)) for row in participation])
    participation, shapes = participation * signs[:, None], shapes * signs
    tip = (rows.at(length(spec)) @ shapes).T
    return Port(
        name,
        1.0 / values[:n],
        participation,
        tip,
        rows.rigid.T @ rows.rigid,
        rows,
        shapes,
        key,
        payload,
    )


def first_sign(row, small=1e-9):
    """+1 or -1: makes the first number of the row that is not negligible positive."""
    for value in row:
        if abs(value) > small * np.max(np.abs(row)):
            return np.sign(value)
    return 1.0


# -- two ports: normal modes and what a force and a moment at a second place bend ------------------
@dataclass(frozen=True)
class TwoPort:
    """`n` normal modes with the root held and the static shapes of unit loads at `x`:
    the model of a carried payload.

    Attributes:
        frequencies: `(n + m,)` the first n are the appendage's own,
            the last m belong to the static shapes.
        participation: `(n + m, m)` about the root, force positive.
        motion: `(n + m, m)` at `x` in each mode.
        rigid: `(m, m)` about the root.
    """

    port: str
    x: float
    frequencies: np.ndarray
    participation: np.ndarray
    motion: np.ndarray
    rigid: np.ndarray
    elastic: np.ndarray = field(repr=False)
    carried: np.ndarray = field(repr=False)
    at: np.ndarray = field(repr=False)

    def coupled(self, payload, modes, hub=None):
        """Lowest frequencies with a payload (mass, inertia) at `x`; root held,
        or free on a hub `(m, m)`."""
        mass, inertia = payload
        about = {"xy": 2, "xz": 1, "torsion": 0}.get(self.port)
        sizes = (
            [mass, inertia[about]]
            if self.port in BENDING
            else [mass if about is None else inertia[about]]
        )
        root = np.sqrt(sizes)[:, None]
        place = np.vstack(_rigid(self.port, np.array([self.x])))
        elastic = np.vstack([self.elastic, root * self.at])
        carried = np.vstack([self.carried, root * place])
        if hub is not None:
            elastic = freed(elastic, carried, hub)
        return 1.0 / np.linalg.svd(elastic, compute_uv=False)[:modes]


def two_port(spec, name, modes, x=None):
    """The model that keeps `modes` normal modes and is statically exact at `x` (the
    tip where left out)."""
    x = length(spec) if x is None else x
    cut = {**spec, "lump": [*spec.get("lump", ()), {"x": x, "mass": 0.0}]}
    whole = port(cut, name, modes + 4)
    at = whole.rows.at(x)
    strains = whole.shapes[:, :modes] * whole.frequencies[:modes]
    basis, _ = np.linalg.qr(np.hstack([strains, at.T / np.linalg.norm(at, axis=1)]))
    elastic = whole.rows.elastic @ basis
    left, values, right = np.linalg.svd(elastic, full_matrices=False)
    participation = left.T @ whole.rows.rigid
    motion = (at @ basis @ right.T / values).T
    size = np.sqrt(np.diag(whole.rigid))
    signs = np.array([first_sign(row / size) for row in participation])[:, None]
    return TwoPort(
        name,
        x,
        1.0 / values,
        participation * signs,
        motion * signs,
        whole.rigid,
        elastic,
        whole.rows.rigid,
        at @ basis,
    )


# -- space -----------------------------------------------------------------------------------------
def rigid_mass(spec, payload=None):
    """`(6, 6)` mass matrix of the frozen appendage about its root;
    no rotary inertia of Euler sections in bending."""
    out = np.zeros((6, 6))
    xi, weight = leggauss(12)
    blocks = []
    bodies = _bodies(spec, payload)
    for segment, x0, ends in _stations(spec, bodies):
        for a, b in pairwise(ends):
            half = (b - a) / 2.0
            x = a + half * (1.0 + xi)
            at = section_properties(segment, (x - x0) / segment["length"])
            w = half * weight
            blocks.append(
                (
                    w @ at["mass"],
                    w @ (at["mass"] * x),
                    w @ (at["mass"] * x**2),
                    w @ at["polar"],
                    w @ at["rotary_xz"],
                    w @ at["rotary_xy"],
                )
            )
    blocks += [(mass, mass * x, mass * x**2, *inertia) for x, mass, inertia in bodies]
    mass, first, second, about_x, about_y, about_z = (
        float(sum(v)) for v in zip(*blocks, strict=True)
    )
    out[[0, 1, 2], [0, 1, 2]] = mass
    out[[3, 4, 5], [3, 4, 5]] = about_x, second + about_y, second + about_z
    out[1, 5] = out[5, 1] = first
    out[2, 4] = out[4, 2] = -first
    return out


@dataclass(frozen=True)
class Modes:
    """Modes in space with the root held, by frequency: `(n,)`, `(n, 6)`,
    `(n, 6)` and the port of each."""

    frequencies: np.ndarray
    participation: np.ndarray
    tip: np.ndarray
    ports: tuple
    rigid: np.ndarray


def cantilever(spec, modes, payload=None):
    """The lowest modes of several ports in space.

    Args:
        spec: parsed SPEC.toml.
        modes: {"xy": 3, "xz": 2, ...}.
        payload: see `port`.
    """
    found = []
    for name, count in modes.items():
        if count:
            p = port(spec, name, count, payload)
            turn = into_space(name)
            found += [
                (w, turn @ row, turn @ tip, name)
                for w, row, tip in zip(p.frequencies, p.participation, p.tip, strict=True)
            ]
    found.sort(key=lambda mode: mode[0])
    w, rows, tips, names = zip(*found, strict=True)
    return Modes(np.array(w), np.array(rows), np.array(tips), names, rigid_mass(spec, payload))


def every_mode(spec, converged=12):
    """All modes of the mesh that has the lowest of every port right: together they are the mesh,
    with whatever is fixed to its tip. Ports in which the appendage is rigid have none."""
    found = []
    for name in PORTS:
        with contextlib.suppress(ValueError):
            p = port(spec, name, converged)
            left, values, right = np.linalg.svd(p.rows.elastic, full_matrices=False)
            tip = (p.rows.at(length(spec)) @ (right.T / values)).T
            turn = into_space(name).T
            found.append(
                (1.0 / values, left.T @ p.rows.rigid @ turn, tip @ turn, [name] * len(tip))
            )
    w, rows, tips, names = (np.concatenate(each) for each in zip(*found, strict=True))
    return Modes(w, rows, tips, tuple(names), rigid_mass(spec))


def coupled(spec, hub=None, modes=8, payload=None, ports=PORTS):
    """Lowest elastic frequencies in space with the root free and a hub on it.

    Args:
        spec: parsed SPEC.toml.
        hub: `(6, 6)` mass matrix about the root; None: nothing there.
        modes: how many.
        payload: rigid body at the tip, (mass, inertia) or (mass, inertia, x).
        ports: those in which the appendage is flexible; it is rigid in the others.
    """
    columns, rigid = [], []
    for name in ports:
        p = port(spec, name, modes, payload)
        columns.append(p.rows.elastic)
        rigid.append(p.rows.rigid @ into_space(name).T)
    stiff = rigid_mass(spec, payload)
    for name in ports:  # the inertia of the other ports goes to the hub
        turn = into_space(name)
        stiff = stiff - turn @ (turn.T @ stiff @ turn) @ turn.T
    sizes = [c.shape for c in columns]
    elastic = np.zeros((sum(s[0] for s in sizes), sum(s[1] for s in sizes)))
    i = j = 0
    for block in columns:
        elastic[i : i + block.shape[0], j : j + block.shape[1]] = block
        i, j = i + block.shape[0], j + block.shape[1]
    rest = stiff + (np.zeros((6, 6)) if hub is None else np.asarray(hub, dtype=float))
    return 1.0 / np.linalg.svd(freed(elastic, np.vstack(rigid), rest), compute_uv=False)[:modes]
