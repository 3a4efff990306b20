"""The whole spacecraft, proved: coupled modes and hub accelerance of the MuJoCo model against the exact assembly.

The reference knows nothing of chains: the spacecraft's own mass and stiffness, and on it every appendage as the beam it
is, all its cantilever modes hung on the port's Jacobian,

    M = [[M_craft + sum J^T M_rigid J, J^T L^T], [L J, 1]],   K = diag(K_craft, W^2).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import linear_sum_assignment

from beamchain.craft.mode_words import mode_words
from beamchain.engine.library import mujoco, rest
from beamchain.engine.linearise import linearise, mass_matrix
from beamchain.engine.mount import Mount
from beamchain.ports.compare import DEFAULT_RATIO, damped, relative
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array, square_root

Response = NDArray[np.complex128]
RANK = 1e-9  # relative, below which the base body is held in a motion


@dataclass(frozen=True, eq=False)
class Carried:
    """One appendage on the spacecraft.

    Args:
        mount: where.
        whole: the beam in space, all its modes, with damping ratios.
        kept: `(n,)` which of those modes the chain was asked to keep.
        dofs: its degrees of freedom in the MuJoCo model.
        band: last kept cantilever frequency of each kept port [rad/s].
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
class _System:
    """`M q'' + D q' + K q = J^T f` with the motion `J` of the hub."""

    mass: Array
    damping: Array
    stiffness: Array
    motion: Array

    def modes(self, reach: float) -> tuple[Array, Array]:
        """Frequencies above zero, ascending, and mass-normalised shapes; `reach`: a frequency of interest."""
        shift = (0.1 * reach) ** 2  # eigenvalues of the inverse, so that low frequencies keep their digits
        values, shapes = eigh(self.mass, self.stiffness + shift * self.mass)
        above = values > 0.0  # what is not is lost in the rounding of the slowest: far beyond any frequency of interest
        values, shapes = values[above], shapes[:, above]
        squares = 1.0 / values[::-1] - shift
        shapes = shapes[:, ::-1] * np.sqrt(1.0 / values[::-1])
        moving = squares > 1e-9 * shift
        return np.sqrt(squares[moving]), shapes[:, moving]

    def accelerance(self, omega: Array, carried: Sequence[Carried] = ()) -> Response:
        """`(m, m, k)` acceleration of the hub per wrench on it, `carried` hung on by its dynamic mass."""
        s = 1j * omega[:, None, None]
        dynamic = self.mass + self.damping / s + self.stiffness / s**2
        for item in carried:
            own = np.moveaxis(damped(item.whole).D(omega), -1, 0)
            dynamic = dynamic + item.mount.jacobian.T @ own @ item.mount.jacobian
        drive = np.broadcast_to(self.motion.T, (omega.size, *self.motion.T.shape))
        return np.moveaxis(self.motion @ np.linalg.solve(dynamic, drive), 0, -1)


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
    points: int = 400,
) -> Assembly:
    """Compare the MuJoCo model with the exact assembly.

    Args:
        craft: the bare spacecraft.
        model: the spacecraft with its chains.
        carried: the appendages.
        asked: frequencies that matter end here [rad/s]; None: where the kept modes end.
        wanted: motions of the hub that matter (0 to 5).
        points: of the even part of the frequency grid.
    """
    craft, model = quiet(craft), quiet(model)
    hub = int(craft.body_rootid[carried[0].mount.body])
    name = craft.body(hub).name or f"body {hub}"
    new = {dof for item in carried for dof in item.dofs}
    old = [i for i in range(model.nv) if i not in new]
    alone = _craft(craft, hub)
    exact = _exact(alone, carried)
    ours = _ours(craft, model, hub, old, carried)
    first = min(w for item in carried for w in item.band.values())
    band = asked or max(w for item in carried for w in item.band.values())
    common = asked or first
    exact_modes, ours_modes = exact.modes(first), ours.modes(first)
    rigid = _rigid(craft, hub, carried)
    words = _words(exact, exact_modes[1], carried, rigid)
    modes = _matched(exact, exact_modes, carried, ours_modes[0], ours_modes[1][old], band, words)
    peaks = np.concatenate([exact_modes[0], ours_modes[0]])
    peaks = peaks[peaks < 1.3 * band]
    width = 1.0 + DEFAULT_RATIO * np.concatenate([-np.geomspace(0.02, 40.0, 25), [0.0], np.geomspace(0.02, 40.0, 25)])
    grid = np.concatenate([np.geomspace(0.02 * common, 1.3 * band, points), np.outer(peaks, width).ravel()])
    omega = np.unique(grid[grid > 0.0])
    able = [int(i) for i in np.flatnonzero(np.diag(rigid) > 1e-9 * np.diag(rigid).max())]
    motions = tuple(i for i in able if i in wanted) or tuple(able)
    pick = np.ix_(motions, motions)
    ha, hb = ours.accelerance(omega)[pick], alone.accelerance(omega, carried)[pick]
    rigid = rigid[pick]
    full = np.linalg.matrix_rank(rigid) == len(motions)
    scale = np.sqrt(np.diag(np.linalg.inv(rigid))) if full else 1.0 / np.sqrt(np.diag(rigid))
    weight = np.outer(scale, scale)
    inside = omega <= common
    got, true = (np.moveaxis(h, -1, 0) * weight for h in (ha, hb))
    error = relative(got, true, float(np.linalg.norm(rigid * weight, 2)))
    return Assembly(modes, band, common, omega, hb, ha, motions, error, float(error[inside].max()), name)


def _jacobian(model: "mujoco.MjModel", body: int) -> Array:
    """`(6, nv)` motion of a body's frame, in its own axes."""
    data = rest(model)
    translation, rotation = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jac(model, data, translation, rotation, data.xpos[body], body)
    axes = data.xmat[body].reshape(3, 3)
    return np.vstack([axes.T @ translation, axes.T @ rotation])


def _matrices(model: "mujoco.MjModel") -> tuple[Array, Array, Array]:
    """Mass, damping and stiffness at rest, the latter two from A of `mjd_transitionFD`."""
    mass, linear = mass_matrix(model), linearise(model)
    stiffness = mass @ linear.stiffness
    return mass, mass @ linear.damping, (stiffness + stiffness.T) / 2.0


def craft_damping(damping: Array, stiffness: Array, mass: Array) -> Array:
    """The spacecraft's own damping; 0.5 % in its sprung joints where it has none, so that no peak is infinite."""
    values, shapes = eigh(stiffness, mass)
    moving = values > 1e-12 * max(float(np.max(values, initial=0.0)), 1e-300)
    if not np.any(moving) or np.max(np.abs(damping)) > 0.0:
        return damping
    push = mass @ shapes[:, moving]
    return push @ np.diag(2.0 * DEFAULT_RATIO * np.sqrt(values[moving])) @ push.T


def _craft(craft: "mujoco.MjModel", hub: int) -> _System:
    """The bare spacecraft."""
    mass, damping, stiffness = _matrices(craft)
    return _System(mass, craft_damping(damping, stiffness, mass), stiffness, _jacobian(craft, hub))


def _exact(craft: _System, carried: Sequence[Carried]) -> _System:
    """The spacecraft and all cantilever modes of its beams, undamped: for the coupled modes."""
    nv = craft.mass.shape[0]
    total = nv + sum(item.whole.modes for item in carried)
    m, k = np.eye(total), np.zeros((total, total))
    m[:nv, :nv], k[:nv, :nv] = craft.mass, craft.stiffness
    start = nv
    for item in carried:
        jacobian, whole = item.mount.jacobian, item.whole
        mine = slice(start, start + whole.modes)
        m[:nv, :nv] += jacobian.T @ whole.rigid_mass @ jacobian
        m[mine, :nv] = whole.participation @ jacobian
        m[:nv, mine] = m[mine, :nv].T
        k[mine, mine] = np.diag(whole.frequencies**2)
        start += whole.modes
    return _System(m, np.zeros_like(m), k, np.hstack([craft.motion, np.zeros((6, total - nv))]))


def _ours(
    craft: "mujoco.MjModel", model: "mujoco.MjModel", hub: int, old: list[int], carried: Sequence[Carried]
) -> _System:
    mass, damping, stiffness = _matrices(model)
    own_mass, own_damping, own_stiffness = _matrices(craft)
    extra = craft_damping(own_damping, own_stiffness, own_mass) - own_damping
    damping[np.ix_(old, old)] += extra
    for item in carried:
        if not np.any(item.whole.damping > 0.0) and item.dofs:  # the ratio that undamped cantilever modes are given
            mine = np.ix_(item.dofs, item.dofs)
            values, shapes = eigh(stiffness[mine], mass[mine])
            push = mass[mine] @ shapes
            damping[mine] += push @ np.diag(2.0 * DEFAULT_RATIO * np.sqrt(np.clip(values, 0.0, None))) @ push.T
    name = craft.body(hub).name
    body = model.body(name).id if name else hub
    return _System(mass, damping, stiffness, _jacobian(model, int(body)))


def _rigid(craft: "mujoco.MjModel", hub: int, carried: Sequence[Carried]) -> Array:
    """`(6, 6)` accelerance of the hub with every appendage frozen."""
    mass = mass_matrix(craft)
    for item in carried:
        mass += item.mount.jacobian.T @ item.whole.rigid_mass @ item.mount.jacobian
    motion = _jacobian(craft, hub)
    return motion @ np.linalg.solve(mass, motion.T)


def _words(exact: _System, shapes: Array, carried: Sequence[Carried], rigid: Array) -> list[str]:
    """What moves in each exact mode; `rigid` `(6, 6)`: accelerance of the base body, every appendage frozen."""
    nv = shapes.shape[0] - sum(item.whole.modes for item in carried)
    ends = nv + np.cumsum([item.whole.modes for item in carried])
    bus = np.sqrt(np.diag(np.linalg.pinv(rigid, rcond=RANK, hermitian=True)).clip(0.0))[:, None] * (
        exact.motion @ shapes
    )
    own = np.einsum("ik,ij,jk->k", shapes[:nv], exact.stiffness[:nv, :nv], shapes[:nv])
    return [
        mode_words(
            [item.mount.at for item in carried], [item.whole for item in carried], [item.mount.axes for item in carried],
            np.split(shapes[nv:, k], ends[:-1] - nv), float(own[k]), bus[:, k],
        )
        for k in range(shapes.shape[1])
    ]  # fmt: skip


def _matched(
    exact: _System,
    exact_modes: tuple[Array, Array],
    carried: Sequence[Carried],
    ours: Array,
    shapes: Array,
    band: float,
    words: Sequence[str],
) -> tuple[Mode, ...]:
    """Modes paired by frequency and by the direction in which they move the spacecraft, the kept ones first.

    Args:
        exact, exact_modes: the exact assembly.
        carried: the appendages.
        ours: `(n,)` MuJoCo's frequencies.
        shapes: `(nv, n)` the spacecraft's part of MuJoCo's modes.
        band: exact modes without a partner are listed up to here.
        words: what moves in each exact mode.
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
