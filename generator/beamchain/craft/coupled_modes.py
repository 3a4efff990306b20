"""Coupled modes of a craft at a pose: the exact ones and MuJoCo's in pairs,
and what moves in each."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig, eigh
from scipy.optimize import linear_sum_assignment

from beamchain.craft.error import RANK, Pose
from beamchain.engine.linear import Linear
from beamchain.engine.model_rows import along_all
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, PORTS, Array, square_root

FAR = 0.5  # logarithm of frequencies that do not belong together, and what else is unlike
SHARE = 0.1  # of the strain energy, above which an appendage is named
CLUSTER = 1e-3  # relative gap of frequencies, below which modes may mix their shapes
STILL = 1e-4  # of the kinetic energy, below which the bus is called still
ALONG = 0.5  # cosine between the momenta of two appendages, above which they move in phase
WORDS = {"xy": "bending xy", "xz": "bending xz", "torsion": "torsion", "axial": "axial"}
AXIS = ("along x", "along y", "along z", "about x", "about y", "about z")


@dataclass(frozen=True)
class Mode:
    """A coupled mode: exact and MuJoCo's frequency [rad/s], None where the other has no partner.

    `kept`: most of its strain energy is in modes that the chains were asked to keep, or in the
    craft's own springs; `words`: what moves; `moved`: what it adds to each motion of the base body
    under a load there, whose square is the share of the mode.
    """

    exact: float | None
    mujoco: float | None
    kept: bool
    words: str = ""
    moved: tuple[float, ...] = (0.0,) * 6

    @property
    def error(self) -> float | None:
        """Relative."""
        return None if self.exact is None or self.mujoco is None else self.mujoco / self.exact - 1.0


class _Modes(NamedTuple):
    """Flexible modes of a craft: `frequency` `(n,)` ascending [rad/s], mass-normalised `shapes`
    `(nv, n)` in the craft's own degrees of freedom, and `share` `(1 + appendages, n)` of the
    strain energy in the craft's own springs and in each appendage."""

    frequency: Array
    shapes: Array
    share: Array


def coupled_modes(pose: Pose, compiled: Linear, band: float) -> tuple[Mode, ...]:
    """Modes of the exact craft at a pose and of the compiled one, in pairs, ascending.

    Exact modes without a partner are listed up to `band` [rad/s], and modes up to there get words.
    """
    reach = min(w for item in pose.carried for w in item.band.values())
    craft = pose.with_exact
    nv = len(pose.bare.mass)
    frequency, shapes = slow_modes(craft, reach)
    energy = shapes * (craft.stiffness @ shapes)
    exact_parts = [np.arange(nv), *pose.modal_coordinates]
    exact = _Modes(frequency, shapes[:nv], _shares(energy, exact_parts))

    frequency, compiled_shapes = slow_modes(compiled, reach)
    compiled_energy = compiled_shapes * (compiled.stiffness @ compiled_shapes)
    own = pose.own_dofs(len(compiled.mass))
    compiled_parts = [own, *(np.array(item.dofs, dtype=np.intp) for item in pose.carried)]
    ours = _Modes(frequency, compiled_shapes[own], _shares(compiled_energy, compiled_parts))

    asked_for = np.concatenate([np.ones(nv, np.bool_), *pose.kept])
    kept = energy[asked_for].sum(axis=0) > 0.5 * energy.sum(axis=0)
    partner = _pairs(exact, ours, kept, pose.bare.mass)
    moved = bus_motion(pose, shapes[:nv]) / exact.frequency
    modes = [
        Mode(
            exact=float(w),
            mujoco=float(ours.frequency[partner[j]]) if j in partner else None,
            kept=bool(kept[j]),
            words=mode_words(pose, shapes[:, j]) if w <= band or kept[j] else "",
            moved=tuple(moved[:, j].tolist()),
        )
        for j, w in enumerate(exact.frequency)
        if j in partner or w <= band
    ]
    alone = set(range(ours.frequency.size)) - set(partner.values())
    modes += [Mode(None, float(ours.frequency[i]), False) for i in sorted(alone)]
    return tuple(sorted(modes, key=lambda mode: mode.exact or mode.mujoco or 0.0))


def _shares(energy: Array, parts: Sequence[NDArray[np.intp]]) -> Array:
    """`(parts, n)` share of each part's coordinates in the strain energy `(nv, n)` of modes."""
    return np.array([energy[part].sum(axis=0) for part in parts]) / energy.sum(axis=0)


def _pairs(exact: _Modes, ours: _Modes, kept: NDArray[np.bool_], mass: Array) -> dict[int, int]:
    """The mode of MuJoCo that belongs to an exact one, by their numbers; the kept ones first.

    Modes belong together by frequency, of those that are not kept only near ones, as chains have
    modes of their own (fillers); `mass` `(nv, nv)`: of the bare craft. Modes of one cluster
    may mix their shapes, so it is clusters that are alike: what moves the craft along the same
    direction and strains the appendages half alike.
    """
    if not ours.frequency.size or not exact.frequency.size:
        return {}
    root = square_root(mass)
    ours_of, exact_of = _clusters(ours.frequency), _clusters(exact.frequency)
    a, b = _spans(root @ ours.shapes, ours_of), _spans(root @ exact.shapes, exact_of)
    aligned = np.array(
        [[np.linalg.norm(p.T @ q, 2) if p.size and q.size else 0.0 for q in b] for p in a]
    )
    still = [np.array([not span.size for span in spans]) for spans in (a, b)]
    aligned[np.ix_(*still)] = 1.0
    mean = [
        np.array([m.share[:, of == k].mean(axis=1) for k in range(of[-1] + 1)])
        for m, of in ((ours, ours_of), (exact, exact_of))
    ]
    alike = 1.0 - np.abs(mean[0][:, None] - mean[1][None]).sum(axis=2) / 2.0
    unlike = np.clip(0.5 - aligned, 0.0, None) + np.clip(0.5 - alike, 0.0, None)
    apart = np.abs(np.log(ours.frequency[:, None] / exact.frequency[None, :]))
    cost = apart + unlike[np.ix_(ours_of, exact_of)]
    partner: dict[int, int] = {}
    for group in (np.flatnonzero(kept), np.flatnonzero(~kept)):
        free = np.setdiff1d(np.arange(ours.frequency.size), list(partner.values()))
        rows, columns = linear_sum_assignment(cost[free][:, group])
        partner |= {
            int(group[j]): int(free[i])
            for i, j in zip(rows, columns, strict=True)
            if kept[group[j]] or cost[free[i], group[j]] < FAR
        }
    return partner


def _clusters(frequency: Array) -> NDArray[np.intp]:
    """Number of the cluster of each ascending frequency."""
    apart = np.diff(np.log(frequency), prepend=np.log(frequency[:1])) > CLUSTER
    return np.cumsum(apart, dtype=np.intp)


def _spans(motion: Array, cluster: NDArray[np.intp]) -> list[Array]:
    """Orthonormal directions in which the modes of each cluster move the craft; none of still
    ones. `motion` `(nv, n)`: squared norms are kinetic energies."""
    spans: list[Array] = []
    for k in range(cluster[-1] + 1):
        u, size, _ = np.linalg.svd(motion[:, cluster == k], full_matrices=False)
        spans.append(u[:, size**2 >= STILL])
    return spans


def slow_modes(linear: Linear, reach: float) -> tuple[Array, Array]:
    """Frequencies above zero, ascending, and mass-normalised shapes.

    `reach`: a frequency of interest. The matrices may be those of `mjd_transitionFD`, whose
    rounding holds even rigid motions a little.
    """
    # eigenvalues of the inverse, so that low frequencies keep their digits
    shift = (0.1 * reach) ** 2
    if np.max(np.abs(linear.stiffness - linear.stiffness.T)) > 0.0:
        return _modes_under_thrust(linear, shift)
    values, shapes = eigh(linear.mass, linear.stiffness + shift * linear.mass)
    # what is not is lost in the rounding of the slowest: far beyond any frequency of interest
    above = values > 0.0
    values = values[above]
    shapes = shapes[:, above]
    squares = 1.0 / values[::-1] - shift
    shapes = shapes[:, ::-1] * np.sqrt(1.0 / values[::-1])
    moving = squares > 1e-9 * shift
    return np.sqrt(squares[moving]), shapes[:, moving]


def _modes_under_thrust(linear: Linear, shift: float) -> tuple[Array, Array]:
    """As `slow_modes`; a thrust that stays with the craft makes the stiffness unsymmetric."""
    turned, shapes = eig(linear.stiffness, linear.mass)
    order = np.argsort(turned.real)
    squares = turned.real[order]
    shapes = np.asarray(shapes[:, order].real, dtype=np.float64)
    moving = squares > 1e-9 * shift
    shapes = shapes[:, moving]
    mass = np.einsum("ik,ij,jk->k", shapes, linear.mass, shapes)
    return np.sqrt(squares[moving]), shapes / np.sqrt(mass)


def mode_words(pose: Pose, shape: Array) -> str:
    """One coupled mode in words, such as "left and right opposed, bending xz; bus about y".

    `shape`: mass-normalised, over the craft's own degrees of freedom and the modal coordinates of
    the exact appendages.
    """
    nv = len(pose.bare.mass)
    models = pose.models
    coordinates = [shape[part] for part in pose.modal_coordinates]
    # twice the strain energies
    own_energy = float(shape[:nv] @ pose.bare.stiffness @ shape[:nv])
    stiffness = pose.with_exact.stiffness
    energies = [
        float(shape[part] @ stiffness[np.ix_(part, part)] @ shape[part])
        for part in pose.modal_coordinates
    ]
    total = max(sum(energies) + own_energy, 1e-300)
    moving = [i for i, energy in enumerate(energies) if energy > SHARE * total]
    parts: list[str] = []
    if moving:
        first = max(moving, key=lambda i: energies[i])
        port = _port(models[first], coordinates[first])
        momenta = [pose.roots[i].axes @ _momentum(models[i], coordinates[i], port) for i in moving]
        names = " and ".join(pose.carried[i].mount.at for i in moving)
        parts.append(f"{names}{_phase(momenta)}, {WORDS[port]}")
    if own_energy > SHARE * total:
        parts.append(f"{_holders(pose, shape[:nv])} of the spacecraft")
    bus = bus_motion(pose, shape[:nv])
    k = int(np.argmax(np.abs(bus)))
    parts.append(f"bus {AXIS[k]}" if float(np.sum(bus**2)) > STILL else "bus still")
    return "; ".join(parts)


def bus_motion(pose: Pose, shape: Array) -> Array:
    """`(6,)` or `(6, n)` motion of the base body in a mode `(nv,)` of the craft or in several
    `(nv, n)`, times the square root of the inertia that it feels."""
    felt = np.diag(np.linalg.pinv(pose.rigid_accelerance, rcond=RANK, hermitian=True))
    return (np.sqrt(felt.clip(0.0)) * (pose.bare.outputs.acceleration @ shape).T).T


def _holders(pose: Pose, shape: Array) -> str:
    """What of the spacecraft itself holds a shape `(nv,)`: springs, servos, or both."""
    model = pose.bare_model
    dofs = model.jnt_dofadr[model.jnt_stiffness > 0.0]
    by_joints = float(np.sum(model.jnt_stiffness[model.jnt_stiffness > 0.0] * shape[dofs] ** 2))
    lengths = along_all(model) @ shape
    springs = by_joints + float(np.sum(model.tendon_stiffness * lengths**2))
    servos = float(shape @ pose.bare.stiffness @ shape) - springs
    most = max(springs, servos)
    kinds = (("springs", springs), ("servos", servos))
    return " and ".join(word for word, energy in kinds if energy > SHARE * most)


def _momentum(model: PortModel, coordinates: Array, port: str) -> Array:
    """`(3,)` momentum per rate of a mode in the root's axes: linear, or in torsion angular."""
    columns = slice(3, 6) if port == "torsion" else slice(0, 3)
    return model.participation[:, columns].T @ coordinates


def _phase(momenta: Sequence[Array]) -> str:
    """Whether two appendages move the same way."""
    if len(momenta) != 2:
        return ""
    a, b = momenta
    along = float(a @ b)
    if abs(along) <= ALONG * float(np.linalg.norm(a) * np.linalg.norm(b)):
        return ""
    return " in phase" if along > 0.0 else " opposed"


def _port(model: PortModel, coordinates: Array) -> str:
    """The port in which the cantilever mode with the most strain energy participates most."""
    k = int(np.argmax((model.frequencies * coordinates) ** 2))
    scale = np.sqrt(np.where(np.diag(model.rigid_mass) > 0.0, np.diag(model.rigid_mass), np.inf))
    row = model.participation[k] / scale
    return max(
        PORTS, key=lambda port: float(np.sum((np.abs(PORT_MOTION[port]).T @ np.abs(row)) ** 2))
    )
