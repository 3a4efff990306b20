"""Comparison of two port models: one comparison and one in-band error for the whole package.

Theory: docs/theory.md, section 6.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from beamchain.errors import InputError
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array, locked

DEFAULT_RATIO = 0.005  # damping ratio of every cantilever mode where none is given
UNDAMPED = 1e-9  # ratios up to here are rounding
NARROWEST = 1e-6  # least ratio with which a peak is resolved
NEAR = 0.05  # of the ratio: peaks that close need one cluster of points
WIDER = 1.5  # times the ratio: the points of a wider peak do not resolve a narrower one
REACH = 1.3  # times the bandwidth: peaks up to here are resolved as far as they reach into the band
STANDARD_HUBS = (0.1, 1.0, 10.0)  # times the appendage's rigid mass, where no hub is given

Response = Callable[[Array], NDArray[np.complex128]]


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two port models, mode by mode.

    Args:
        matches: `(k, 2)` mode numbers (from 0) of the first and of the second model.
        frequency_errors: `(k,)` relative, first against second.
        participation_errors: `(k,)` relative: norm of the difference over the norm, each motion scaled by the
            rigid mass.
        mass_error: relative, of the rigid mass matrix.
        accelerance_in_band: the in-band error; None if it was not requested.

    Example:
        >>> import beamchain as bc
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> full = bc.Beam(segments=(bc.Segment(length=8.0, section=section),)).port("xy")
        >>> error = bc.compare(full.truncated(2), full)
        >>> error.matches.tolist(), error.frequency
        ([[0, 0], [1, 1]], 0.0)
    """

    matches: NDArray[np.int64]
    frequency_errors: Array
    participation_errors: Array
    mass_error: float
    accelerance_in_band: float | None = None

    @property
    def frequency(self) -> float:
        """Worst relative frequency error."""
        return float(np.max(np.abs(self.frequency_errors), initial=0.0))

    @property
    def participation(self) -> float:
        """Worst relative participation error."""
        return float(np.max(self.participation_errors, initial=0.0))


def compare(
    a: PortModel, b: PortModel, hub_mass: ArrayLike | None = None, bandwidth: float | None = None
) -> Comparison:
    """Compare `a` with the reference `b`.

    Modes are matched by frequency and by the direction of their participation. With `bandwidth` the in-band error is
    computed too, on the hub or, without one, as the worst of three (0.1, 1, 10 times the rigid mass).

    Args:
        a, b: port models with the same motions.
        hub_mass: `(m, m)`.
        bandwidth: [rad/s].

    Raises:
        InputError: the models have different numbers of motions.

    Example:
        >>> import beamchain as bc
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> full = bc.Beam(segments=(bc.Segment(length=8.0, section=section),)).port("xy")
        >>> error = bc.compare(full.truncated(2), full, bandwidth=3.0)
        >>> f"{error.accelerance_in_band:.1e}"
        '2.0e-03'
    """
    if a.motions != b.motions:
        raise InputError(
            f"port models with {a.motions} and {b.motions} motions cannot be compared; compare like ports."
        )
    scale = np.sqrt(np.diag(b.rigid_mass))
    la, lb = a.participation / scale, b.participation / scale
    count = min(a.modes, b.modes)
    if count:
        na, nb = np.linalg.norm(la, axis=1), np.linalg.norm(lb, axis=1)
        aligned = np.abs(la @ lb.T) / np.clip(np.outer(na, nb), 1e-300, None)
        cost = np.abs(np.log(a.frequencies[:, None] / b.frequencies[None, :])) + 0.05 * (
            1.0 - np.clip(aligned, 0.0, 1.0)
        )
        first, second = linear_sum_assignment(cost)
    else:
        first = second = np.zeros(0, dtype=np.int64)
    signs = np.where(np.sum(la[first] * lb[second], axis=1) < 0.0, -1.0, 1.0)
    difference = np.linalg.norm(la[first] * signs[:, None] - lb[second], axis=1)
    return Comparison(
        matches=np.column_stack([first, second]).astype(np.int64),
        frequency_errors=locked(a.frequencies[first] / b.frequencies[second] - 1.0),
        participation_errors=locked(difference / np.clip(np.linalg.norm(lb[second], axis=1), 1e-300, None)),
        mass_error=float(np.max(np.abs((a.rigid_mass - b.rigid_mass) / np.outer(scale, scale)))),
        accelerance_in_band=None if bandwidth is None else in_band_error(a, b, hub_mass, bandwidth),
    )


def in_band_error(
    a: PortModel, b: PortModel, hub_mass: ArrayLike | None, bandwidth: float, keep: Sequence[int] | None = None
) -> float:
    """The in-band error of `a` against `b`, frequency by frequency; see `Reference`.

    Args:
        a, b: models; a model without damping gets 0.5 % in every cantilever mode.
        hub_mass: `(m, m)`; none: the worst of three hubs, 0.1, 1 and 10 times the rigid mass of `b`.
        bandwidth: [rad/s].
        keep: motions of the hub that matter; all where left out.
    """
    if hub_mass is None:
        return max(in_band_error(a, b, factor * b.rigid_mass, bandwidth, keep) for factor in STANDARD_HUBS)
    pick = range(b.motions) if keep is None else keep
    return Reference([Block(np.asarray(hub_mass, dtype=np.float64), b, tuple(pick))], bandwidth).error(0, a)


def coupling_error(model: PortModel, damping: Array, hub_mass: Array | None, bandwidth: float) -> float:
    """In-band error of leaving out couplings in `damping` `(n, n)` [1/s]."""
    if model.modes < 2 or not np.any(damping - np.diag(np.diag(damping))):
        return 0.0
    if hub_mass is None:
        return max(coupling_error(model, damping, f * model.rigid_mass, bandwidth) for f in STANDARD_HUBS)
    block = Block(hub_mass, model, tuple(range(model.motions)))
    omega = grid_of([peaks_of(model, hub_mass)], bandwidth)
    s = 1j * omega[:, None, None]
    inner = s**2 * np.eye(model.modes) + s * damping + np.diag(model.frequencies**2)
    felt = model.participation.T @ np.linalg.solve(inner, s**2 * model.participation)
    coupled = small_inverse(hub_mass + model.rigid_mass - felt) * block.scale
    return float(relative(coupled, block.response(model, omega), block.frozen).max())


@dataclass(frozen=True, eq=False)
class Block:
    """Motions that a hub `(m, m)` and `exact` couple; `keep`: those that matter."""

    hub: Array
    exact: PortModel
    keep: tuple[int, ...]

    @cached_property
    def scale(self) -> Array:
        """`(k, k)` what makes the accelerance dimensionless."""
        s = np.sqrt(np.diag(self.hub + self.exact.rigid_mass))[list(self.keep)]
        return np.outer(s, s)

    def response(self, model: PortModel, omega: Array) -> NDArray[np.complex128]:
        """`(k, n, n)` dimensionless accelerance of hub and `model`, the motions that matter."""
        pick = list(self.keep)
        inverse = small_inverse(np.moveaxis(self.hub[:, :, None] + model.D(omega), -1, 0))
        return inverse[:, pick][:, :, pick] * self.scale

    @cached_property
    def frozen(self) -> float:
        """Norm of the dimensionless accelerance of the rigid whole."""
        pick = list(self.keep)
        inverse = np.linalg.inv(self.hub + self.exact.rigid_mass)
        return float(np.linalg.norm(inverse[np.ix_(pick, pick)] * self.scale, 2))


class Reference:
    """Exact appendages on a hub, against which models are measured: the one in-band error of the package.

    `H(w) = (M_hub + D(w))^-1`, `S = sqrt(diag(M_hub + M_rigid))`. The error is the maximum over 0 < w <= bandwidth [rad/s]
    of `||S (H_model - H_exact) S||` over the larger of `||S H_exact S||` and `||S H_rigid S||`, on a grid that resolves
    every peak to a tenth of its damping ratio. Independent blocks do not couple.
    """

    def __init__(self, blocks: Sequence[Block], bandwidth: float) -> None:
        self.blocks: list[Block] = [replace(block, exact=damped(block.exact)) for block in blocks]
        self.bandwidth: float = bandwidth
        self._peaks = [peaks_of(block.exact, block.hub) for block in self.blocks]
        self._floor = max((block.frozen for block in self.blocks), default=1.0)
        self._own: dict[int, tuple[Array, NDArray[np.complex128], Array]] = {}

    def size(self, omega: Array, number: int = -1, own: NDArray[np.complex128] | None = None) -> Array:
        """`(k,)` the denominator at `omega`; `own`: known response of block `number`."""
        out = np.full(omega.size, self._floor)
        for i, block in enumerate(self.blocks):
            exact = own if i == number and own is not None else block.response(block.exact, omega)
            np.maximum(out, spectral_norms(exact), out=out)
        return out

    def error(self, number: int, model: PortModel) -> float:
        """In-band error that `model` in place of the exact one of block `number` makes."""
        block, model = self.blocks[number], damped(model)
        if number not in self._own:
            omega = grid_of([self._peaks[number]], self.bandwidth)
            exact = block.response(block.exact, omega)
            self._own[number] = omega, exact, self.size(omega, number, exact)
        omega, exact, below = self._own[number]
        worst = largest(block.response(model, omega) - exact, below)
        more = clusters(unlike(peaks_of(model, block.hub), self._peaks[number]), self.bandwidth)
        return max(worst, float(self.curve(number, model, more).max(initial=0.0)))

    def curve(self, number: int, model: PortModel, omega: Array) -> Array:
        """`(k,)` the error at each of `omega`, before its maximum is taken."""
        block, model = self.blocks[number], damped(model)
        if omega.size == 0:
            return np.zeros(0)
        exact = block.response(block.exact, omega)
        return spectral_norms(block.response(model, omega) - exact) / self.size(omega, number, exact)

    def grid(self, number: int, models: Sequence[PortModel]) -> Array:
        """`(k,)` where the error of `models` in a block is looked at [rad/s]."""
        peaks = [peaks_of(damped(model), self.blocks[number].hub) for model in models]
        return grid_of([self._peaks[number], *peaks], self.bandwidth)


def small_inverse(matrices: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Inverses of `(k, m, m)`; in closed form for m = 1 and 2."""
    size = matrices.shape[-1]
    if size == 1:
        return 1.0 / matrices
    if size == 2:
        a, b, c, d = matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 0], matrices[:, 1, 1]
        out = np.empty_like(matrices)
        out[:, 0, 0], out[:, 0, 1], out[:, 1, 0], out[:, 1, 1] = d, -b, -c, a
        return out / (a * d - b * c)[:, None, None]
    return np.asarray(np.linalg.inv(matrices), dtype=np.complex128)


def damped(model: PortModel) -> PortModel:
    """The model with its own damping, or 0.5 % in every mode where it has none."""
    if np.all(model.damping >= NARROWEST):
        return model
    if np.any(model.damping > UNDAMPED):
        return model.replaced(damping=np.maximum(model.damping, NARROWEST))
    return model.replaced(damping=np.full(model.modes, DEFAULT_RATIO))


def peaks_of(model: PortModel, hub: Array) -> Array:
    """`(k, 2)` frequency [rad/s] and ratio of every peak, coupled and held."""
    loaded = model.with_hub(hub)
    coupled = np.column_stack([loaded.free_frequencies, loaded.free_damping])
    return np.vstack([coupled, np.column_stack([model.frequencies, model.damping])])


def unlike(peaks: Array, known: Array) -> Array:
    """Those of `peaks` `(k, 2)` that the points at `known` peaks do not resolve."""
    if not known.size or not peaks.size:
        return peaks
    near = np.abs(peaks[:, None, 0] / known[None, :, 0] - 1.0) <= NEAR * np.minimum(
        peaks[:, None, 1], known[None, :, 1]
    )
    alike = near & (known[None, :, 1] <= WIDER * peaks[:, None, 1])
    return peaks[~alike.any(axis=1)]


def clusters(peaks: Array, bandwidth: float) -> Array:
    """`(k,)` frequencies up to `bandwidth` around `peaks` `(n, 2)`."""
    points = [np.zeros(0)]
    for peak, ratio in peaks[peaks[:, 0] < REACH * bandwidth]:
        width = min(max(float(ratio), NARROWEST), 1.0)
        close = width * np.arange(0.0, 2.05, 0.1)
        count, end = max(int(np.log(0.25 / width) / 0.14), 4), max(0.5, 3.0 * width)
        far = 2.2 * width * (end / (2.2 * width)) ** np.linspace(0.0, 1.0, count)  # geomspace takes ten times as long
        offsets = np.concatenate([close, far])
        points += [peak * (1.0 + offsets), peak * (1.0 - offsets)]
    grid = np.concatenate(points)
    return np.unique(grid[(grid > 0.0) & (grid <= bandwidth)])


def grid_of(peaks: Sequence[Array], bandwidth: float) -> Array:
    """`(k,)` frequencies up to `bandwidth` that resolve all `peaks` `(n, 2)`."""
    points = [np.linspace(bandwidth / 400.0, bandwidth, 400)]
    seen = np.zeros((0, 2))
    for some in peaks:
        new = unlike(some, seen)
        points.append(clusters(new, bandwidth))
        seen = np.vstack([seen, new])
    return np.unique(np.concatenate(points))


def band_grid(models: Sequence[PortModel], bandwidth: float) -> Array:
    """`(k,)` frequencies up to `bandwidth` that resolve every peak of `models`."""
    return grid_of([peaks_of(model, np.zeros_like(model.rigid_mass)) for model in models], bandwidth)


def relative(ours: NDArray[np.complex128], exact: NDArray[np.complex128], frozen: float) -> Array:
    """`(k,)` the in-band error of responses `(k, m, m)`, before its maximum."""
    return spectral_norms(ours - exact) / np.maximum(spectral_norms(exact), frozen)


def largest(matrices: NDArray[np.complex128], below: Array) -> float:
    """Largest spectral norm of `matrices` `(k, m, m)` over `below` `(k,)`."""
    rough = np.linalg.norm(matrices, axis=(1, 2)) / below
    near = ~(rough < 0.999 * rough.max() / np.sqrt(matrices.shape[-1]))
    return float(np.max(spectral_norms(matrices[near]) / below[near]))


def spectral_norms(matrices: NDArray[np.complex128]) -> Array:
    """Spectral norms `(k,)` of `(k, m, m)`; in closed form for m = 1 and 2."""
    size = matrices.shape[-1]
    if size == 1:
        return np.abs(matrices[:, 0, 0])
    if size == 2:
        total = np.sum(np.abs(matrices) ** 2, axis=(1, 2))
        product = np.abs(matrices[:, 0, 0] * matrices[:, 1, 1] - matrices[:, 0, 1] * matrices[:, 1, 0])
        return np.sqrt((total + np.sqrt(np.clip(total**2 - 4.0 * product**2, 0.0, None))) / 2.0)
    return np.linalg.norm(matrices, 2, axis=(1, 2))
