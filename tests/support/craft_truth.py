"""The in-band error of a whole craft by its definition: matrices by hand,
and an adaptive search for the largest value.

The exact side is `Truth` of `plant_truth` (hub, drives, finite elements), the other side a compiled
file as plain MuJoCo has it. Nothing is imported from the package, and no grid is shared with it: an
even grid, points about the damped poles of both sides, and bisection until straight lines between
points are good enough.
"""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

import finite_elements as fe
from mechanics import by_differences, system_matrix
from plant_truth import Truth
from solver import Craft, Frame

AXES = {"tx": 0, "ty": 1, "tz": 2, "x": 3, "y": 4, "z": 5}
MODES = 30  # of every port in finite elements
EVEN = 1500  # points of the even grid
BENT = 0.02  # of the value: how far the middle may lie off the straight line between its neighbours
NEAR = 0.2  # of the largest value: what lies lower is not looked at any closer
ROUNDS = 30  # of bisection
AT_ONCE = 500  # frequencies: memory
ROUNDED = 2e-3  # of a value: rounding above which it is not looked at, where motion is slow
SLOW = 1e-2  # of the band: there the base's acceleration is a small difference of large forces


@dataclass(frozen=True, eq=False)
class Side:
    """`M q'' + C q' + K q = f`, the base's six motions first;
    all freedoms from `body` on are modes with unit mass."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    body: int

    def accelerance(self, omega):
        """`(k, 6, 6)` acceleration of the base per wrench on it."""
        s = 1j * omega
        n = self.body
        rows = self.mass[n:, :n]
        w2 = np.diag(self.stiffness)[n:]
        weight = s[:, None] ** 2 / (s[:, None] ** 2 + s[:, None] * np.diag(self.damping)[n:] + w2)
        felt = weight @ (rows[:, :, None] * rows[:, None, :]).reshape(len(rows), n * n)
        own = (self.mass[:n, :n], self.damping[:n, :n], self.stiffness[:n, :n])
        total = (
            own[0]
            + own[1] / s[:, None, None]
            + own[2] / s[:, None, None] ** 2
            - felt.reshape(-1, n, n)
        )
        return np.linalg.solve(total, np.broadcast_to(np.eye(n, 6), (omega.size, n, 6)))[:, :6]

    def poles(self, first):
        """Damped poles of the freedoms from `first` on: 0 all free, 6 the base held."""
        return damped_poles(*(a[first:, first:] for a in (self.mass, self.damping, self.stiffness)))


def damped_poles(mass, damping, stiffness):
    return np.linalg.eigvals(system_matrix(mass, damping, stiffness)) if len(mass) else np.zeros(0)


def assembled(craft, angles=None):
    """The exact side; undamped modes get 0.5 %, as the definition says."""
    truth = Truth(craft, lambda a: dict.fromkeys(fe.PORTS, MODES), angles)
    assert all(a["spec"]["damping"]["ratio"] > 0.0 for a in craft["appendages"].values())
    return Side(truth.m, truth.c, truth.k, 6 + len(truth.names))


def hung(model, own, qpos=None, step=1e-3):
    """Mass, damping and stiffness of a bare craft at a pose as plain MuJoCo has them, with `Modes`
    at sites or bodies by their names."""
    data = mujoco.MjData(model)
    data.qpos[:] = model.qpos0 if qpos is None else qpos
    mujoco.mj_forward(model, data)
    whole, kinds = Craft(), ("mass", "damping", "stiffness")
    whole.size = model.nv
    for kind, matrix in zip(kinds, by_differences(model, data.qpos.copy(), step), strict=True):
        whole.add(kind, np.eye(model.nv), matrix)
    for place, modes in own.items():
        site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, place)
        body = model.site_bodyid[site] if site >= 0 else model.body(place).id
        at = data.site(site) if site >= 0 else data.body(body)
        rows = np.zeros((6, model.nv))
        mujoco.mj_jac(model, data, rows[:3], rows[3:], at.xpos, body)
        whole.modes(Frame(rows, at.xpos, at.xmat.reshape(3, 3)), modes)
    return whole.matrices()


def compiled(model, qpos):
    """A compiled file at a pose: forces are differentiated, the mass matrix is MuJoCo's."""
    mass, damping, stiffness = by_differences(model, qpos)
    stiffness[:, :6] = 0.0  # of the base, which is free
    return Side(mass, (damping + damping.T) / 2.0, (stiffness + stiffness.T) / 2.0, model.nv)


@dataclass(frozen=True, eq=False)
class Pair:
    """A file against the exact craft at one pose, in some motions of the base,
    up to a band [rad/s]."""

    exact: Side
    file: Side
    keep: list
    band: float

    @cached_property
    def scale(self):
        size = np.sqrt(np.diag(self.exact.mass)[:6])[self.keep]  # all else locked
        return np.outer(size, size)

    @cached_property
    def floor(self):
        frozen = np.linalg.inv(self.exact.mass[:6, :6])
        return float(np.linalg.norm(frozen[np.ix_(self.keep, self.keep)] * self.scale, 2))

    def curve(self, omega):
        """The error at each frequency, before its maximum is taken."""
        parts = np.array_split(omega, max(1, omega.size // AT_ONCE))
        return np.concatenate([self._curve(part) for part in parts])

    def _curve(self, omega):
        exact, file = (
            side.accelerance(omega)[:, self.keep][:, :, self.keep] * self.scale
            for side in (self.exact, self.file)
        )
        size = np.linalg.norm(exact, 2, axis=(1, 2))
        return np.linalg.norm(file - exact, 2, axis=(1, 2)) / np.maximum(size, self.floor)

    def even(self, points):
        """The largest value on an even grid and where it is: no poles, no search."""
        best = 0.0, 0.0
        for part in np.array_split(np.arange(1, points + 1), max(points // 5000, 1)):
            omega = part * (self.band / points)
            values = self.curve(omega)
            best = max(best, (float(values.max()), float(omega[values.argmax()])))
        return best

    def search(self):
        """The largest value and where it is, by bisection."""
        grid = [
            np.linspace(self.band / EVEN, self.band, EVEN),
            np.geomspace(self.band / 300.0, self.band, 500),
        ]
        for side in (self.exact, self.file):
            for pole in np.concatenate([side.poles(0), side.poles(6)]):
                if pole.imag >= 0.0 and abs(pole) < 1.5 * self.band:
                    width = max(-pole.real, 1e-7 * abs(pole))
                    offset = np.concatenate(
                        [np.linspace(0.0, 4.0, 21), np.geomspace(4.2, 300.0, 20)]
                    )
                    centre = pole.imag or abs(pole)
                    grid += [centre + width * offset, centre - width * offset]
        omega = np.concatenate(grid)
        omega = np.unique(omega[(omega > 0.0) & (omega <= self.band)])
        values = self.curve(omega)
        # rounding grows with the square of the period
        rounding = np.abs(self.curve(omega * (1.0 + 1e-9)) - values)
        lost = omega[(rounding > ROUNDED * values) & (omega < SLOW * self.band)]
        sound = omega > 2.0 * lost.max(initial=0.0)
        omega, values = omega[sound], values[sound]
        for _ in range(ROUNDS):
            middle = (omega[1:] + omega[:-1]) / 2.0
            slope = np.diff(values)
            bend = np.abs(np.diff(slope, prepend=slope[:1])) + np.abs(
                np.diff(slope, append=slope[-1:])
            )
            high = np.maximum(values[1:], values[:-1])
            wide = np.diff(omega) > 1e-9 * omega[1:]
            pick = (high > NEAR * values.max()) & (bend > BENT * high) & wide
            top = int(values.argmax())
            for side in (top - 1, top):  # the largest one always
                if 0 <= side < pick.size:
                    pick[side] = wide[side]
            if not pick.any():
                break
            more = middle[pick]
            order = np.argsort(np.concatenate([omega, more]), kind="stable")
            values = np.concatenate([values, self.curve(more)])[order]
            omega = np.concatenate([omega, more])[order]
        top = int(values.argmax())
        return float(values[top]), float(omega[top])


def craft_error(craft, file, band, axes, angles=None):
    """The largest in-band error of a compiled file,
    over the rest pose and the keyframe `run` with its `angles`."""
    model = mujoco.MjModel.from_xml_path(str(file))
    keep = sorted({AXES[a] for a in axes})
    worst = 0.0, 0.0
    for qpos, turned in ((model.qpos0, {}), (model.key("run").qpos, angles or {})):
        pair = Pair(assembled(craft, turned), compiled(model, qpos), keep, band)
        worst = max(worst, pair.search())
    return worst
