"""The whole spacecraft, proved: coupled modes and hub accelerance of the MuJoCo model against the exact assembly.

The reference knows nothing of chains: the spacecraft's own mass and stiffness, and on it every appendage as the beam it
is, all its cantilever modes hung on the port's Jacobian,

    M = [[M_craft + sum J^T M_rigid J, J^T L^T], [L J, 1]],   K = diag(K_craft, W^2).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import linear_sum_assignment

from beamchain.engine.library import mujoco, rest
from beamchain.engine.linearise import linearise, mass_matrix
from beamchain.engine.mount import Mount, motion
from beamchain.ports.compare import DEFAULT_RATIO, damped, relative
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, PORTS, Array, square_root

Response = NDArray[np.complex128]
SHARE = 0.1  # of the strain energy, above which an appendage is named
STILL = 1e-4  # of the kinetic energy, below which the bus is called still
ALONG = 0.5  # cosine between the momenta of two appendages, above which they move in phase
WORDS = {"xy": "bending xy", "xz": "bending xz", "torsion": "torsion", "axial": "axial"}
AXIS = ("along x", "along y", "along z", "about x", "about y", "about z")
POINTS = 400  # of the even part of the frequency grid
RANK = 1e-9  # relative, below which the base body is held in a motion


@dataclass(frozen=True, eq=False)
class Carried:
    """One appendage on the spacecraft: `whole`: the beam in space, all its modes, damped.

    `kept` `(n,)`: which of them the chain was asked to keep; `dofs`: its degrees of freedom in the MuJoCo model;
    `band`: last kept cantilever frequency of each kept port [rad/s].
    """

    mount: Mount
    whole: PortModel
    kept: NDArray[np.bool_]
    dofs: list[int]
    band: dict[str, float]


@dataclass(frozen=True)
class Mode:
    """A coupled mode: exact and MuJoCo's frequency [rad/s], None where the other has no partner.

    `kept`: most of its strain energy is in modes that the chains were asked to keep, or in the craft's own springs;
    `words`: what moves.
    """

    exact: float | None
    mujoco: float | None
    kept: bool
    words: str = ""

    @property
    def error(self) -> float | None:
        """Relative."""
        return None if self.exact is None or self.mujoco is None else self.mujoco / self.exact - 1.0


@dataclass(frozen=True, eq=False)
class Assembly:
    """What the proof found.

    Args:
        modes: coupled modes, ascending; exact ones that the chains leave out only up to `band`.
        band: up to here kept modes are judged: what was asked for, or the highest kept cantilever frequency [rad/s].
        common: end of the in-band error: what was asked for, or where the first kept port has no more modes [rad/s].
        omega: `(k,)` [rad/s].
        exact, achieved: `(m, m, k)` accelerance of the hub's moving motions.
        motions: which of the six motions of the hub (x, y, z, rotations) those are: what was asked for.
        error: `(k,)` the in-band error before its maximum is taken.
        in_band: the in-band error up to `common`.
        hub: name of the body.
    """

    modes: tuple[Mode, ...]
    band: float
    common: float
    omega: Array
    exact: Response
    achieved: Response
    motions: tuple[int, ...]
    error: Array
    in_band: float
    hub: str

    @property
    def worst(self) -> float:
        """Largest relative frequency error of the kept modes within the band."""
        return max((abs(m.error) for m in self.judged if m.error is not None), default=0.0)

    @property
    def worst_told(self) -> str:
        """`worst` in words, and where no kept mode lies within the band."""
        if not self.judged:
            first = next((m for m in self.modes if m.kept and m.exact is not None and m.error is not None), None)
            beyond = "" if first is None else f"; the first, at {first.exact:.4g} rad/s, is off by {first.error:.1e}"
            return f"no kept mode lies up to {self.band:.4g} rad/s{beyond}"
        return f"worst of the kept modes up to {self.band:.4g} rad/s: {self.worst:.1e}"

    @property
    def judged(self) -> tuple[Mode, ...]:
        """The kept modes within the band."""
        return tuple(m for m in self.modes if m.kept and m.exact is not None and m.exact <= self.band)


@dataclass(frozen=True, eq=False)
class Matrices:
    """A model at a pose, at rest: `M q'' + D q' + K q = f`, and the base body's motion `(6, nv)` in its own axes."""

    mass: Array
    damping: Array
    stiffness: Array
    base: Array

    def slow_modes(self, reach: float) -> tuple[Array, Array]:
        """Frequencies above zero, ascending, and mass-normalised shapes; `reach`: a frequency of interest."""
        shift = (0.1 * reach) ** 2  # eigenvalues of the inverse, so that low frequencies keep their digits
        values, shapes = eigh(self.mass, self.stiffness + shift * self.mass)
        above = values > 0.0  # what is not is lost in the rounding of the slowest: far beyond any frequency of interest
        values, shapes = values[above], shapes[:, above]
        squares = 1.0 / values[::-1] - shift
        shapes = shapes[:, ::-1] * np.sqrt(1.0 / values[::-1])
        moving = squares > 1e-9 * shift
        return np.sqrt(squares[moving]), shapes[:, moving]

    def dynamic(self, omega: Array, models: Sequence[PortModel] = (), roots: Sequence[Array] = ()) -> Response:
        """`(k, nv, nv)` dynamic mass at `omega` [rad/s], with that of appendages on Jacobians `roots` `(6, nv)`."""
        s = 1j * omega[:, None, None]
        out = self.mass + self.damping / s + self.stiffness / s**2
        for model, root in zip(models, roots, strict=True):
            out = out + root.T @ np.moveaxis(damped(model).D(omega), -1, 0) @ root
        return out

    def coupled(self, models: Sequence[PortModel], roots: Sequence[Array]) -> "Matrices":
        """The same with the cantilever modes of appendages as further coordinates."""
        nv = self.mass.shape[0]
        size = nv + sum(model.modes for model in models)
        mass, damping, stiffness = np.eye(size), np.zeros((size, size)), np.zeros((size, size))
        mass[:nv, :nv], damping[:nv, :nv], stiffness[:nv, :nv] = self.mass, self.damping, self.stiffness
        start = nv
        for model, root in zip(map(damped, models), roots, strict=True):
            mine = slice(start, start + model.modes)
            mass[:nv, :nv] += root.T @ model.rigid_mass @ root
            mass[mine, :nv] = model.participation @ root
            mass[:nv, mine] = mass[mine, :nv].T
            stiffness[mine, mine] = np.diag(model.frequencies**2)
            damping[mine, mine] = np.diag(2.0 * model.damping * model.frequencies)
            start += model.modes
        return Matrices(mass, damping, stiffness, np.hstack([self.base, np.zeros((6, size - nv))]))

    def comparable(self, carried: Sequence[Carried], old: Sequence[int], extra: Array) -> "Matrices":
        """The same with the damping of the exact answer: `extra` in the `old` freedoms, and that of undamped modes."""
        damping = self.damping.copy()
        damping[np.ix_(old, old)] += extra
        for item in carried:
            if not np.any(item.whole.damping > 0.0) and item.dofs:  # the ratio that undamped cantilever modes are given
                mine = np.ix_(item.dofs, item.dofs)
                damping[mine] += craft_damping(np.zeros_like(self.mass[mine]), self.stiffness[mine], self.mass[mine])
        return replace(self, damping=damping)


def accelerance(dynamic: Response, base: Array) -> Response:
    """`(k, m, m)` acceleration of the base body per wrench on it, in motions `base` `(m, nv)`."""
    drive = np.broadcast_to(base.T, (dynamic.shape[0], *base.T.shape))
    return base @ np.linalg.solve(dynamic, drive)


def quiet(model: "mujoco.MjModel") -> "mujoco.MjModel":
    """A copy for linearising: no gravity, no medium, no contacts, no constraints, springs slack in the pose of rest."""
    import copy

    out = copy.deepcopy(model)
    out.opt.gravity[:] = 0.0
    out.opt.density = out.opt.viscosity = 0.0
    out.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    out.qpos_spring[:] = out.qpos0
    out.tendon_lengthspring[:] = out.tendon_length0[:, None]
    if hasattr(mujoco.mjtEnableBit, "mjENBL_SLEEP"):
        out.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    return out


def prove(
    craft: "mujoco.MjModel",
    model: "mujoco.MjModel",
    carried: Sequence[Carried],
    asked: float | None = None,
    wanted: Sequence[int] = tuple(range(6)),
) -> Assembly:
    """Compare the MuJoCo model with the exact assembly of the bare `craft` and what it carries.

    `asked`: frequencies that matter end here [rad/s], else where the kept modes end; `wanted`: motions of the hub that
    matter (0 to 5).
    """
    craft, model = quiet(craft), quiet(model)
    hub = int(craft.body_rootid[carried[0].mount.body])
    own = craft.body(hub).name
    name = own or f"body {hub}"
    new = {dof for item in carried for dof in item.dofs}
    old = [i for i in range(model.nv) if i not in new]
    wholes, roots = [item.whole for item in carried], [item.mount.jacobian for item in carried]
    bare = _matrices(craft, hub)
    alone = replace(bare, damping=craft_damping(bare.damping, bare.stiffness, bare.mass))
    exact = alone.coupled(wholes, roots)
    there = int(model.body(own).id) if own else hub
    ours = _matrices(model, there).comparable(carried, old, alone.damping - bare.damping)
    first = min(w for item in carried for w in item.band.values())
    band = asked or max(w for item in carried for w in item.band.values())
    common = asked or first
    exact_modes, ours_modes = exact.slow_modes(first), ours.slow_modes(first)
    frozen = sum((root.T @ whole.rigid_mass @ root for whole, root in zip(wholes, roots, strict=True)), bare.mass)
    rigid = bare.base @ np.linalg.solve(frozen, bare.base.T)  # accelerance of the hub with every appendage frozen
    words = _words(exact, exact_modes[1], carried, rigid)
    modes = _matched(exact, exact_modes, carried, ours_modes[0], ours_modes[1][old], band, words)
    peaks = np.concatenate([exact_modes[0], ours_modes[0]])
    peaks = peaks[peaks < 1.3 * band]
    width = 1.0 + DEFAULT_RATIO * np.concatenate([-np.geomspace(0.02, 40.0, 25), [0.0], np.geomspace(0.02, 40.0, 25)])
    grid = np.concatenate([np.geomspace(0.02 * common, 1.3 * band, POINTS), np.outer(peaks, width).ravel()])
    omega = np.unique(grid[grid > 0.0])
    able = [int(i) for i in np.flatnonzero(np.diag(rigid) > 1e-9 * np.diag(rigid).max())]
    motions = tuple(i for i in able if i in wanted) or tuple(able)
    pick = np.ix_(motions, motions)
    both = accelerance(ours.dynamic(omega), ours.base), accelerance(alone.dynamic(omega, wholes, roots), alone.base)
    ha, hb = (np.moveaxis(h, 0, -1)[pick] for h in both)
    rigid = rigid[pick]
    full = np.linalg.matrix_rank(rigid) == len(motions)
    scale = np.sqrt(np.diag(np.linalg.inv(rigid))) if full else 1.0 / np.sqrt(np.diag(rigid))
    weight = np.outer(scale, scale)
    inside = omega <= common
    got, true = (np.moveaxis(h, -1, 0) * weight for h in (ha, hb))
    error = relative(got, true, float(np.linalg.norm(rigid * weight, 2)))
    return Assembly(modes, band, common, omega, hb, ha, motions, error, float(error[inside].max()), name)


def _matrices(model: "mujoco.MjModel", body: int) -> Matrices:
    """A model at rest, damping and stiffness from A of `mjd_transitionFD`, with the motion of `body`."""
    mass, linear, data = mass_matrix(model), linearise(model), rest(model)
    stiffness = mass @ linear.stiffness
    base = motion(model, data, body, data.xpos[body], data.xmat[body].reshape(3, 3))
    return Matrices(mass, mass @ linear.damping, (stiffness + stiffness.T) / 2.0, base)


def craft_damping(damping: Array, stiffness: Array, mass: Array) -> Array:
    """The damping itself; where there is none 0.5 % of all that is sprung, so that no peak is infinite."""
    values, shapes = eigh(stiffness, mass)
    moving = values > 1e-12 * max(float(np.max(values, initial=0.0)), 1e-300)
    if not np.any(moving) or np.max(np.abs(damping)) > 0.0:
        return damping
    push = mass @ shapes[:, moving]
    return push @ np.diag(2.0 * DEFAULT_RATIO * np.sqrt(values[moving])) @ push.T


def _words(exact: Matrices, shapes: Array, carried: Sequence[Carried], rigid: Array) -> list[str]:
    """What moves in each exact mode; `rigid` `(6, 6)`: accelerance of the base body, every appendage frozen."""
    nv = shapes.shape[0] - sum(item.whole.modes for item in carried)
    ends = nv + np.cumsum([item.whole.modes for item in carried])
    bus = np.sqrt(np.diag(np.linalg.pinv(rigid, rcond=RANK, hermitian=True)).clip(0.0))[:, None] * (exact.base @ shapes)
    own = np.einsum("ik,ij,jk->k", shapes[:nv], exact.stiffness[:nv, :nv], shapes[:nv])
    return [
        mode_words(
            [item.mount.at for item in carried], [item.whole for item in carried], [item.mount.axes for item in carried],
            np.split(shapes[nv:, k], ends[:-1] - nv), float(own[k]), bus[:, k],
        )
        for k in range(shapes.shape[1])
    ]  # fmt: skip


def _matched(
    exact: Matrices,
    exact_modes: tuple[Array, Array],
    carried: Sequence[Carried],
    ours: Array,
    shapes: Array,
    band: float,
    words: Sequence[str],
) -> tuple[Mode, ...]:
    """Modes paired by frequency and by the direction in which they move the spacecraft, the kept ones first.

    `ours` `(n,)`, `shapes` `(nv, n)`: MuJoCo's, the spacecraft's part; exact modes alone are listed up to `band`.
    """
    frequencies, whole = exact_modes
    nv = shapes.shape[0]
    mask = np.concatenate([np.ones(nv, dtype=bool), *(item.kept for item in carried)])
    energy = np.vstack(
        [whole[:nv] * (exact.stiffness[:nv, :nv] @ whole[:nv]), (np.diag(exact.stiffness)[nv:, None] * whole[nv:] ** 2)]
    )
    kept = energy[mask].sum(axis=0) > 0.5 * energy.sum(axis=0)
    weigh = square_root(exact.mass[:nv, :nv])
    a, b = weigh @ shapes, weigh @ whole[:nv]
    norms = np.outer(np.linalg.norm(a, axis=0), np.linalg.norm(b, axis=0))
    aligned = np.abs(a.T @ b) / np.clip(norms, 1e-300, None)
    # neighbours in frequency may mix their shapes, strangers may not be paired
    cost = np.abs(np.log(ours[:, None] / frequencies[None, :])) + np.clip(0.5 - aligned, 0.0, None)
    pairs: dict[int, int] = {}
    for group in (np.flatnonzero(kept), np.flatnonzero(~kept)):
        free = np.array([i for i in range(ours.size) if i not in pairs.values()], dtype=np.int64)
        first, second = linear_sum_assignment(cost[free][:, group])
        pairs |= {int(group[j]): int(free[i]) for i, j in zip(first, second, strict=True)}
    modes = [
        Mode(float(w), float(ours[pairs[j]]) if j in pairs else None, bool(kept[j]), words[j])
        for j, w in enumerate(frequencies)
        if j in pairs or w <= band
    ]
    modes += [Mode(None, float(w), False) for i, w in enumerate(ours) if i not in pairs.values()]
    return tuple(sorted(modes, key=lambda mode: mode.mujoco or mode.exact or 0.0))


def mode_words(
    names: Sequence[str],
    models: Sequence[PortModel],
    axes: Sequence[Array],
    coordinates: Sequence[Array],
    own_energy: float,
    bus: Array,
) -> str:
    """One coupled mode in words, such as "left and right opposed, bending xz; bus about y".

    Per appendage: name of its place, model in space, axes `(3, 3)` of its root in the world (columns), and modal
    `coordinates` `(n,)` in the mass-normalised mode. `own_energy`: twice the strain energy in the spacecraft's own
    springs; `bus` `(6,)`: motion of the base body times the square root of the inertia that it feels.
    """
    energies = [float(np.sum((m.frequencies * q) ** 2)) for m, q in zip(models, coordinates, strict=True)]
    total = max(sum(energies) + own_energy, 1e-300)
    moving = [i for i, energy in enumerate(energies) if energy > SHARE * total]
    parts: list[str] = []
    if moving:
        phase = _phase([axes[i] @ models[i].participation[:, :3].T @ coordinates[i] for i in moving])
        first = max(moving, key=lambda i: energies[i])
        port = WORDS[_port(models[first], coordinates[first])]
        parts.append(f"{' and '.join(names[i] for i in moving)}{phase}, {port}")
    if own_energy > SHARE * total:
        parts.append("springs of the spacecraft")
    k = int(np.argmax(np.abs(bus)))
    parts.append(f"bus {AXIS[k]}" if float(np.sum(bus**2)) > STILL else "bus still")
    return "; ".join(parts)


def _phase(momenta: Sequence[Array]) -> str:
    """Whether two appendages move the same way."""
    if len(momenta) != 2:
        return ""
    a, b = momenta
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    cosine = float(a @ b) / size if size > 0.0 else 0.0
    return " in phase" if cosine > ALONG else " opposed" if cosine < -ALONG else ""


def _port(model: PortModel, coordinates: Array) -> str:
    """The port in which the cantilever mode with the most strain energy participates most."""
    k = int(np.argmax((model.frequencies * coordinates) ** 2))
    scale = np.sqrt(np.where(np.diag(model.rigid_mass) > 0.0, np.diag(model.rigid_mass), np.inf))
    row = model.participation[k] / scale
    return max(PORTS, key=lambda port: float(np.sum((np.abs(PORT_MOTION[port]).T @ np.abs(row)) ** 2)))
