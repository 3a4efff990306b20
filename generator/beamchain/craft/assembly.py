"""The whole spacecraft, proved: coupled modes and hub accelerance of the MuJoCo model against
the exact assembly.

The reference knows nothing of chains: the spacecraft's own mass and stiffness, and on it every
appendage as the beam it is, all its cantilever modes hung on the port's Jacobian,

    M = [[M_craft + sum J^T M_rigid J, J^T L^T], [L J, 1]],   K = diag(K_craft, W^2).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.optimize import linear_sum_assignment

from beamchain.engine.library import mujoco
from beamchain.engine.linear import Linear, linear_at
from beamchain.engine.linearise import linearise
from beamchain.engine.mount import Mount, motion
from beamchain.engine.operating_point import OperatingPoint, quiet_copy, rest_point
from beamchain.ports.compare import DEFAULT_RATIO, relative_error, with_damping
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
STILLEST = 1e-12  # of the largest squared frequency, below which a motion is rigid


@dataclass(frozen=True, eq=False)
class Carried:
    """One appendage on the spacecraft: `whole`: the beam in space, all its modes, damped.

    `kept` `(n,)`: which of them the chain was asked to keep; `dofs`: its degrees of freedom in the
    MuJoCo model; `band`: last kept cantilever frequency of each kept port [rad/s].
    """

    mount: Mount
    whole: PortModel
    kept: NDArray[np.bool_]
    dofs: list[int]
    band: dict[str, float]


@dataclass(frozen=True)
class Mode:
    """A coupled mode: exact and MuJoCo's frequency [rad/s], None where the other has no partner.

    `kept`: most of its strain energy is in modes that the chains were asked to keep, or in the
    craft's own springs; `words`: what moves.
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
        band: up to here kept modes are judged: what was asked for,
            or the highest kept cantilever frequency [rad/s].
        common: end of the in-band error: what was asked for,
            or where the first kept port has no more modes [rad/s].
        omega: `(k,)` [rad/s].
        exact, achieved: `(m, m, k)` accelerance of the hub's moving motions.
        motions: which of the six motions of the hub (x, y, z, rotations) those are:
            what was asked for.
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
            first = next(
                (m for m in self.modes if m.kept and m.exact is not None and m.error is not None),
                None,
            )
            beyond = (
                ""
                if first is None
                else f"; the first, at {first.exact:.4g} rad/s, is off by {first.error:.1e}"
            )
            return f"no kept mode lies up to {self.band:.4g} rad/s{beyond}"
        return f"worst of the kept modes up to {self.band:.4g} rad/s: {self.worst:.1e}"

    @property
    def judged(self) -> tuple[Mode, ...]:
        """The kept modes within the band."""
        return tuple(
            m for m in self.modes if m.kept and m.exact is not None and m.exact <= self.band
        )


def comparable(
    linear: Linear, carried: Sequence[Carried], old: Sequence[int], extra: Array
) -> Linear:
    """The compiled craft with the damping of the exact answer: `extra` in its `old` degrees of
    freedom, the bare craft's own, and that of undamped modes."""
    damping = linear.damping.copy()
    damping[np.ix_(old, old)] += extra
    for item in carried:
        # the ratio that undamped cantilever modes are given
        if not np.any(item.whole.damping > 0.0) and item.dofs:
            dofs = np.ix_(item.dofs, item.dofs)
            damping[dofs] += default_damping(linear.stiffness[dofs], linear.mass[dofs])
    return replace(linear, damping=damping)


def default_damping(stiffness: Array, mass: Array) -> Array:
    """`(nv, nv)` 0.5 % of damping in all that is sprung."""
    values, shapes = eigh(stiffness, mass)
    moving = values > STILLEST * max(float(np.max(values, initial=0.0)), 1e-300)
    push = mass @ shapes[:, moving]
    return push @ np.diag(2.0 * DEFAULT_RATIO * np.sqrt(values[moving])) @ push.T


def extra_damping(bare: Linear) -> Array:
    """`(nv, nv)` what the bare craft gets so that no peak is infinite: none where it is damped."""
    if np.max(np.abs(bare.damping), initial=0.0) > 0.0:
        return np.zeros_like(bare.damping)
    return default_damping(bare.stiffness, bare.mass)


def slow_modes(linear: Linear, reach: float) -> tuple[Array, Array]:
    """Frequencies above zero, ascending, and mass-normalised shapes.

    `reach`: a frequency of interest. The matrices may be those of `mjd_transitionFD`, whose
    rounding holds even rigid motions a little.
    """
    # eigenvalues of the inverse, so that low frequencies keep their digits
    shift = (0.1 * reach) ** 2
    values, shapes = eigh(linear.mass, linear.stiffness + shift * linear.mass)
    # what is not is lost in the rounding of the slowest: far beyond any frequency of interest
    above = values > 0.0
    values = values[above]
    shapes = shapes[:, above]
    squares = 1.0 / values[::-1] - shift
    shapes = shapes[:, ::-1] * np.sqrt(1.0 / values[::-1])
    moving = squares > 1e-9 * shift
    return np.sqrt(squares[moving]), shapes[:, moving]


def prove(
    craft: "mujoco.MjModel",
    model: "mujoco.MjModel",
    carried: Sequence[Carried],
    asked: float | None = None,
    wanted: Sequence[int] = tuple(range(6)),
) -> Assembly:
    """Compare the MuJoCo model with the exact assembly of the bare `craft` and what it carries.

    `asked`: frequencies that matter end here [rad/s], else where the kept modes end; `wanted`:
    motions of the hub that matter (0 to 5).
    """
    craft = quiet_copy(craft)
    model = quiet_copy(model)
    hub = int(craft.body_rootid[carried[0].mount.body])
    label = craft.body(hub).name
    new = {dof for item in carried for dof in item.dofs}
    old = [i for i in range(model.nv) if i not in new]
    wholes = [with_damping(item.whole) for item in carried]
    roots = [item.mount.jacobian for item in carried]
    point = rest_point(craft)
    bare = on_base(linear_at(point), point, hub)
    extra = extra_damping(bare)
    alone = replace(bare, damping=bare.damping + extra)
    exact = alone.with_appendages(wholes, roots)
    there = int(model.body(label).id) if label else hub
    ours = comparable(_transition(model, there), carried, old, extra)
    first = min(w for item in carried for w in item.band.values())
    band = asked or max(w for item in carried for w in item.band.values())
    common = asked or first
    exact_modes = slow_modes(exact, first)
    ours_modes = slow_modes(ours, first)
    frozen = sum(
        (root.T @ whole.rigid_mass @ root for whole, root in zip(wholes, roots, strict=True)),
        bare.mass,
    )
    base = bare.outputs.acceleration
    # accelerance of the hub with every appendage frozen
    rigid = base @ np.linalg.solve(frozen, base.T)
    words = _words(exact, exact_modes[1], carried, rigid)
    modes = _matched(exact, exact_modes, carried, ours_modes[0], ours_modes[1][old], band, words)
    peaks = np.concatenate([exact_modes[0], ours_modes[0]])
    peaks = peaks[peaks < 1.3 * band]
    width = 1.0 + DEFAULT_RATIO * np.concatenate(
        [-np.geomspace(0.02, 40.0, 25), [0.0], np.geomspace(0.02, 40.0, 25)]
    )
    grid = np.concatenate(
        [np.geomspace(0.02 * common, 1.3 * band, POINTS), np.outer(peaks, width).ravel()]
    )
    omega = np.unique(grid[grid > 0.0])
    able = [int(i) for i in np.flatnonzero(np.diag(rigid) > 1e-9 * np.diag(rigid).max())]
    motions = tuple(i for i in able if i in wanted) or tuple(able)
    pick = np.ix_(motions, motions)
    achieved = ours.response(omega)[pick]
    true = alone.response(omega, wholes, roots)[pick]
    rigid = rigid[pick]
    full = np.linalg.matrix_rank(rigid) == len(motions)
    scale = np.sqrt(np.diag(np.linalg.inv(rigid))) if full else 1.0 / np.sqrt(np.diag(rigid))
    weight = np.outer(scale, scale)
    inside = omega <= common
    error = relative_error(
        np.moveaxis(achieved, -1, 0) * weight,
        np.moveaxis(true, -1, 0) * weight,
        float(np.linalg.norm(rigid * weight, 2)),
    )
    return Assembly(
        modes,
        band,
        common,
        omega,
        exact=true,
        achieved=achieved,
        motions=motions,
        error=error,
        in_band=float(error[inside].max()),
        hub=label or f"body {hub}",
    )


def on_base(linear: Linear, point: OperatingPoint, body: int) -> Linear:
    """The same with a wrench on a body, in its axes, for inputs, and the body's acceleration for
    outputs: its response is the accelerance."""
    data = point.data()
    rows = motion(point.model, data, body, data.xpos[body], data.xmat[body].reshape(3, 3))
    return linear.on_body(rows)


def _transition(model: "mujoco.MjModel", body: int) -> Linear:
    """A model at rest with the stiffness and damping that `mjd_transitionFD` gives: the proof."""
    point = rest_point(model)
    found = linearise(model)
    exact = linear_at(point)
    stiffness = exact.mass @ found.stiffness
    proof = replace(
        exact, damping=exact.mass @ found.damping, stiffness=(stiffness + stiffness.T) / 2.0
    )
    return on_base(proof, point, body)


def _words(
    exact: Linear, shapes: Array, carried: Sequence[Carried], rigid: Array
) -> Callable[[int], str]:
    """Says what moves in an exact mode, by its number from 0.

    `rigid` `(6, 6)`: accelerance of the base body, every appendage frozen.
    """
    nv = shapes.shape[0] - sum(item.whole.modes for item in carried)
    ends = nv + np.cumsum([item.whole.modes for item in carried])
    bus = np.sqrt(np.diag(np.linalg.pinv(rigid, rcond=RANK, hermitian=True)).clip(0.0))[:, None] * (
        exact.outputs.acceleration @ shapes
    )
    own = np.einsum("ik,ij,jk->k", shapes[:nv], exact.stiffness[:nv, :nv], shapes[:nv])
    names, models, axes = zip(
        *((item.mount.at, item.whole, item.mount.axes) for item in carried), strict=True
    )

    def words(k: int) -> str:
        coordinates = np.split(shapes[nv:, k], ends[:-1] - nv)
        return mode_words(names, models, axes, coordinates, own_energy=float(own[k]), bus=bus[:, k])

    return words


def _matched(
    exact: Linear,
    exact_modes: tuple[Array, Array],
    carried: Sequence[Carried],
    ours: Array,
    shapes: Array,
    band: float,
    words: Callable[[int], str],
) -> tuple[Mode, ...]:
    """Modes paired by frequency and by the direction in which they move the spacecraft,
    the kept ones first.

    `ours` `(n,)`, `shapes` `(nv, n)`: MuJoCo's, the spacecraft's part;
    exact modes alone are listed up to `band`.
    """
    frequencies, whole = exact_modes
    nv = shapes.shape[0]
    mask = np.concatenate([np.ones(nv, dtype=bool), *(item.kept for item in carried)])
    energy = np.vstack(
        [
            whole[:nv] * (exact.stiffness[:nv, :nv] @ whole[:nv]),
            (np.diag(exact.stiffness)[nv:, None] * whole[nv:] ** 2),
        ]
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
        Mode(float(w), float(ours[pairs[j]]) if j in pairs else None, bool(kept[j]), words(j))
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

    Per appendage: name of its place, model in space, axes `(3, 3)` of its root in the world
    (columns), and modal `coordinates` `(n,)` in the mass-normalised mode. `own_energy`: twice the
    strain energy in the spacecraft's own springs; `bus` `(6,)`: motion of the base body times the
    square root of the inertia that it feels.
    """
    energies = [
        float(np.sum((m.frequencies * q) ** 2)) for m, q in zip(models, coordinates, strict=True)
    ]
    total = max(sum(energies) + own_energy, 1e-300)
    moving = [i for i, energy in enumerate(energies) if energy > SHARE * total]
    parts: list[str] = []
    if moving:
        phase = _phase(
            [axes[i] @ models[i].participation[:, :3].T @ coordinates[i] for i in moving]
        )
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
    return max(
        PORTS, key=lambda port: float(np.sum((np.abs(PORT_MOTION[port]).T @ np.abs(row)) ** 2))
    )
