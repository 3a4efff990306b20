"""Comparison of two port models: one comparison and one in-band error for the whole package.

Theory: docs/theory.md, section 6.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from beamchain.checks import of_type, positive
from beamchain.errors import InputError
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array, locked, system_matrix

DEFAULT_RATIO = 0.005  # damping ratio of every cantilever mode where none is given
UNDAMPED = 1e-9  # ratios up to here are rounding
# least ratio at which errors are compared: the frequency of a narrower peak is beyond a model in
# double precision
LEAST_RATIO = 1e-5
NEAR = 0.05  # of the ratio: peaks that close need one cluster of points
WIDER = 1.5  # times the ratio: the points of a wider peak do not resolve a narrower one
REACH = 1.3  # times the bandwidth: peaks up to here are resolved as far as they reach into the band
STANDARD_HUBS = (0.1, 1.0, 10.0)  # times the appendage's rigid mass, where no hub is given
SLOWEST = 1e-6  # of the bandwidth: slower poles are rigid motion
# ratios up to here, none above twice another, couple the free modes too little to matter
EVEN = 0.1
CREST = 0.7  # of the largest value: lower crests of a curve are not followed between its points
# of a tolerance: where the largest value on a grid is lower, the curve keeps it between its points
OPEN = 0.8
CRESTS = 6  # most crests that are followed
ZOOMS = 2  # rounds in which a crest is followed, each on points six times as close
SAFETY = 1.01  # times the stated error must be within the tolerance

Response = Callable[[Array], NDArray[np.complex128]]


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two port models, mode by mode.

    Args:
        matches: `(k, 2)` mode numbers (from 0) of the first and of the second model.
        frequency_errors: `(k,)` relative, first against second.
        participation_errors: `(k,)` relative: norm of the difference over the norm,
            each motion scaled by the rigid mass.
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

    Modes are matched by frequency and by the direction of their participation. With `bandwidth` the
    in-band error is computed too, on the hub or, without one, as the worst of three (0.1, 1, 10
    times the rigid mass).

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
    for name, model in (("a", a), ("b", b)):
        of_type(
            name,
            model,
            PortModel,
            "a PortModel, for example what Beam.port or ModalData.port returns",
        )
    if bandwidth is not None:
        bandwidth = positive("bandwidth", bandwidth, "rad/s")
    if a.motions != b.motions:
        raise InputError(
            f"port models with {a.motions} and {b.motions} motions cannot be compared; compare "
            "like ports."
        )
    scale = np.sqrt(np.diag(b.rigid_mass))
    rows_a = a.participation / scale
    rows_b = b.participation / scale
    first, second = _match_modes(a.frequencies, rows_a, b.frequencies, rows_b)
    rows_a = rows_a[first]
    rows_b = rows_b[second]
    # the sign of a mode is arbitrary
    signs = np.where(np.sum(rows_a * rows_b, axis=1) < 0.0, -1.0, 1.0)
    differences = np.linalg.norm(rows_a * signs[:, None] - rows_b, axis=1)
    sizes = np.linalg.norm(rows_b, axis=1)
    mass_difference = (a.rigid_mass - b.rigid_mass) / np.outer(scale, scale)
    return Comparison(
        matches=np.column_stack([first, second]).astype(np.int64),
        frequency_errors=locked(a.frequencies[first] / b.frequencies[second] - 1.0),
        participation_errors=locked(differences / np.clip(sizes, 1e-300, None)),
        mass_error=float(np.max(np.abs(mass_difference))),
        accelerance_in_band=None if bandwidth is None else in_band_error(a, b, hub_mass, bandwidth),
    )


def _match_modes(
    frequencies_a: Array, rows_a: Array, frequencies_b: Array, rows_b: Array
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers `(k,)` of the modes of two models that belong together.

    Of modes `i` and `j` with scaled participation `L_i` and `L_j` the pairing costs
    `|ln(W_i / W_j)| - 0.05 |cos(L_i, L_j)|`; the sum over all pairs is least.
    """
    sizes_a = np.linalg.norm(rows_a, axis=1)
    sizes_b = np.linalg.norm(rows_b, axis=1)
    cosines = np.abs(rows_a @ rows_b.T) / np.clip(np.outer(sizes_a, sizes_b), 1e-300, None)
    distances = np.abs(np.log(frequencies_a[:, None] / frequencies_b[None, :]))
    first, second = linear_sum_assignment(distances - 0.05 * cosines)
    return first.astype(np.int64), second.astype(np.int64)


def in_band_error(
    a: PortModel,
    b: PortModel,
    hub_mass: ArrayLike | None,
    bandwidth: float,
    keep: Sequence[int] | None = None,
    undamped: float = DEFAULT_RATIO,
) -> float:
    """The in-band error of `a` against `b`, frequency by frequency; see `Reference`.

    Without `hub_mass` `(m, m)` the worst of three hubs, 0.1, 1 and 10 times the rigid mass of `b`;
    `keep`: motions of the hub that matter; `undamped`: as of `compared_ratios`.
    """
    if hub_mass is None:
        hubs = [factor * b.rigid_mass for factor in STANDARD_HUBS]
        return max(in_band_error(a, b, hub, bandwidth, keep, undamped) for hub in hubs)
    kept_motions = tuple(range(b.motions) if keep is None else keep)
    block = Block(np.asarray(hub_mass, dtype=np.float64), b, kept_motions)
    return Reference([block], bandwidth, undamped).error(0, a)


def keeps_tolerance(error: float, tolerance: float) -> bool:
    """Whether a stated error keeps a tolerance: 1.01 times the error must not exceed it.

    Example:
        >>> keeps_tolerance(0.98e-3, 1e-3), keeps_tolerance(0.995e-3, 1e-3)
        (True, False)
    """
    return SAFETY * error <= tolerance


def tolerance_statement(error: float, tolerance: float) -> str:
    """How a stated error stands to a tolerance, as the end of a sentence.

    Example:
        >>> tolerance_statement(0.98e-3, 1e-3)
        'within the tolerance 0.001'
        >>> tolerance_statement(0.995e-3, 1e-3)
        'too near the tolerance 0.001: 1.01 times the error exceeds it'
        >>> tolerance_statement(2e-3, 1e-3)
        'above the tolerance 0.001'
    """
    if keeps_tolerance(error, tolerance):
        return f"within the tolerance {tolerance:g}"
    if error <= tolerance:
        return f"too near the tolerance {tolerance:g}: {SAFETY} times the error exceeds it"
    return f"above the tolerance {tolerance:g}"


@dataclass(frozen=True, eq=False)
class Block:
    """Motions that a hub `(m, m)` and `exact` couple; `keep`: those that matter."""

    hub: Array
    exact: PortModel
    keep: tuple[int, ...]

    @cached_property
    def scale(self) -> Array:
        """`(k, k)`, `sqrt(m_i m_j)` of the rigid whole: makes the accelerance dimensionless."""
        masses = np.diag(self.hub + self.exact.rigid_mass)[list(self.keep)]
        roots = np.sqrt(masses)
        return np.outer(roots, roots)

    def response(self, model: PortModel, omega: Array) -> NDArray[np.complex128]:
        """`(k, n, n)` dimensionless accelerance of hub and `model`, the motions that matter."""
        pick = list(self.keep)
        dynamic_mass = self.hub[:, :, None] + model.D(omega)
        accelerance = small_inverse(np.moveaxis(dynamic_mass, -1, 0))
        return accelerance[:, pick][:, :, pick] * self.scale

    @cached_property
    def frozen(self) -> float:
        """Norm of the dimensionless accelerance of the rigid whole."""
        pick = list(self.keep)
        accelerance = np.linalg.inv(self.hub + self.exact.rigid_mass)
        return spectral_norm(accelerance[np.ix_(pick, pick)] * self.scale)


class Reference:
    """Exact appendages on a hub, against which models are measured:
    the one in-band error of the package.

    `H(w) = (M_hub + D(w))^-1`, `S = sqrt(diag(M_hub + M_rigid))`. The error is the maximum over 0 <
    w <= bandwidth [rad/s] of `||S (H_model - H_exact) S||` over the larger of `||S H_exact S||` and
    `||S H_rigid S||`: on a grid that resolves every peak to a tenth of its damping ratio, and
    between its points where it is highest. Independent blocks do not couple. `undamped`: as of
    `compared_ratios`.
    """

    def __init__(
        self, blocks: Sequence[Block], bandwidth: float, undamped: float = DEFAULT_RATIO
    ) -> None:
        self.undamped: float = undamped
        self.blocks: list[Block] = [
            replace(block, exact=with_damping(block.exact, undamped)) for block in blocks
        ]
        self.bandwidth: float = bandwidth
        self._peaks = [peaks_of(block.exact, block.hub) for block in self.blocks]
        self._floor = max((block.frozen for block in self.blocks), default=1.0)
        # of a block alone: frequencies, exact response, denominator
        self._exact: dict[int, tuple[Array, NDArray[np.complex128], Array]] = {}

    def size(
        self, omega: Array, number: int = -1, known: NDArray[np.complex128] | None = None
    ) -> Array:
        """`(k,)` the denominator at `omega`; `known`: response of block `number`, if known."""
        out = np.full(omega.size, self._floor)
        for i, block in enumerate(self.blocks):
            if i == number and known is not None:
                exact = known
            else:
                exact = block.response(block.exact, omega)
            np.maximum(out, spectral_norms(exact), out=out)
        return out

    def error(self, number: int, model: PortModel, tolerance: float | None = None) -> float:
        """In-band error that `model` in place of the exact one of block `number` makes;
        `tolerance` as of `maximum_of`."""
        block, model = self.blocks[number], with_damping(model, self.undamped)
        omega, values = self._on_grid(number, model)
        new_peaks = unresolved_peaks(peaks_of(model, block.hub), self._peaks[number])
        more_omega = peak_clusters(new_peaks, self.bandwidth)
        more_values = self.curve(number, model, more_omega)
        return maximum_of(
            partial(self.curve, number, model),
            np.concatenate([omega, more_omega]),
            values=np.concatenate([values, more_values]),
            tolerance=tolerance,
        )

    def highest(self, number: int, model: PortModel, most: int) -> NDArray[np.int64]:
        """`(k,)` numbers of up to `most` points at which the error of a model is highest, of those
        that resolve the exact peaks."""
        _, values = self._on_grid(number, with_damping(model, self.undamped))
        return crests(values)[:most]

    def error_at(self, number: int, model: PortModel, points: NDArray[np.int64]) -> float:
        """The largest error of a model at some points of `highest`."""
        omega, exact, size = self._exact[number]
        block, model = self.blocks[number], with_damping(model, self.undamped)
        off = block.response(model, omega[points]) - exact[points]
        return float(np.max(norm_ratios(off, size[points]), initial=0.0))

    def _on_grid(self, number: int, model: PortModel) -> tuple[Array, Array]:
        """Frequencies that resolve the exact peaks, and the error of a damped model there."""
        block = self.blocks[number]
        if number not in self._exact:
            omega = grid_of([self._peaks[number]], self.bandwidth)
            exact = block.response(block.exact, omega)
            self._exact[number] = omega, exact, self.size(omega, number, exact)
        omega, exact, size = self._exact[number]
        return omega, norm_ratios(block.response(model, omega) - exact, size)

    def curve(self, number: int, model: PortModel, omega: Array) -> Array:
        """`(k,)` the error at each of `omega`, before its maximum is taken."""
        block, model = self.blocks[number], with_damping(model, self.undamped)
        exact = block.response(block.exact, omega)
        difference = block.response(model, omega) - exact
        return spectral_norms(difference) / self.size(omega, number, exact)

    def grid(self, number: int, models: Sequence[PortModel]) -> Array:
        """`(k,)` where the error of `models` in a block is looked at [rad/s]."""
        peaks = [
            peaks_of(with_damping(model, self.undamped), self.blocks[number].hub)
            for model in models
        ]
        return grid_of([self._peaks[number], *peaks], self.bandwidth)


def small_inverse(matrices: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Inverses of `(k, m, m)`; in closed form for m = 1 and 2."""
    size = matrices.shape[-1]
    if size == 1:
        return 1.0 / matrices
    if size == 2:
        a = matrices[:, 0, 0]
        b = matrices[:, 0, 1]
        c = matrices[:, 1, 0]
        d = matrices[:, 1, 1]
        out = np.empty_like(matrices)
        out[:, 0, 0] = d
        out[:, 0, 1] = -b
        out[:, 1, 0] = -c
        out[:, 1, 1] = a
        return out / (a * d - b * c)[:, None, None]
    return np.asarray(np.linalg.inv(matrices), dtype=np.complex128)


@lru_cache(maxsize=256)  # a search asks for the same models many times
def with_damping(model: PortModel, undamped: float = DEFAULT_RATIO) -> PortModel:
    """The model with the damping at which it is compared; `undamped`: as of `compared_ratios`."""
    if np.all(model.ratios >= LEAST_RATIO):
        return model
    return model.with_ratios(compared_ratios(model.ratios, undamped))


def compared_ratios(ratios: Array, undamped: float = DEFAULT_RATIO) -> Array:
    """Damping ratios at which modes are compared: none below the least ratio.

    `undamped`: that of modes without any, 0.5 % where no damping is stated, and the least ratio
    where none was stated to be there.

    Example:
        >>> compared_ratios(np.array([0.0, 1e-8, 0.02])).tolist()
        [0.005, 1e-05, 0.02]
    """
    return np.where(ratios > UNDAMPED, np.maximum(ratios, LEAST_RATIO), undamped)


def peaks_of(model: PortModel, hub: Array) -> Array:
    """`(k, 2)` frequency [rad/s] and ratio of every peak, coupled and held."""
    loaded = model.with_hub(hub)
    if model.damping.ndim == 2:
        stiffness = np.diag(model.frequencies**2)
        held = np.linalg.eigvals(system_matrix(stiffness, model.damping_matrix))
        return np.vstack([free_peaks(loaded), peaks_at(held.astype(np.complex128))])
    ratios = model.damping
    most_even = np.minimum(EVEN, 2.0 * ratios.min(initial=np.inf))
    if np.all(ratios <= most_even):
        coupled = np.column_stack([loaded.free_frequencies, loaded.free_damping])
    else:
        coupled = free_peaks(loaded)
    held = np.column_stack([model.frequencies, ratios])
    return np.vstack([coupled, held])


def free_peaks(model: PortModel) -> Array:
    """`(k, 2)` as of `peaks_of`: damped poles of a model whose root is free."""
    rows = model.participation
    # with the root free: (I - L M^-1 L^T) q'' + damping q' + W^2 q = 0
    mass = np.eye(model.modes) - rows @ np.linalg.solve(model.rigid_mass, rows.T)
    # in W q and 1 / s, where a motion without mass has a root 0 and not an infinite one
    squares = np.outer(model.frequencies, model.frequencies)
    inverse_poles = np.linalg.eigvals(system_matrix(mass / squares, model.damping_matrix / squares))
    inverse_poles = inverse_poles.astype(np.complex128)
    return peaks_at(1.0 / inverse_poles[np.abs(inverse_poles) > 0.0])


def peaks_at(poles: NDArray[np.complex128]) -> Array:
    """`(k, 2)` frequency [rad/s] and ratio of damped poles, one of each pair;
    ratio 1 where nothing oscillates."""
    poles = poles[(poles.imag >= 0.0) & (np.abs(poles) > 0.0)]
    frequencies = np.abs(poles)
    ratios = np.clip(-poles.real / frequencies, 0.0, 1.0)
    return np.column_stack([frequencies, ratios])


def unresolved_peaks(peaks: Array, known: Array) -> Array:
    """Those of `peaks` `(k, 2)` that the points at `known` peaks do not resolve."""
    if not known.size or not peaks.size:
        return peaks
    frequency, ratio = peaks.T[:, :, None]
    known_frequency, known_ratio = known.T[:, None, :]
    near = np.abs(frequency / known_frequency - 1.0) <= NEAR * np.minimum(ratio, known_ratio)
    alike = near & (known_ratio <= WIDER * ratio)
    return peaks[~alike.any(axis=1)]


def peak_clusters(peaks: Array, bandwidth: float) -> Array:
    """`(k,)` frequencies up to `bandwidth` around `peaks` `(n, 2)`."""
    points = [np.zeros(0)]
    matters = (peaks[:, 0] < REACH * bandwidth) & (peaks[:, 0] > SLOWEST * bandwidth)
    for peak, ratio in peaks[matters]:
        width = min(max(float(ratio), LEAST_RATIO), 1.0)
        close = width * np.arange(0.0, 2.05, 0.1)
        # from there in equal ratios; np.geomspace takes ten times as long
        start = 2.2 * width
        end = max(0.5, 3.0 * width)
        count = max(int(np.log(0.25 / width) / 0.14), 4)
        far = start * (end / start) ** np.linspace(0.0, 1.0, count)
        offsets = np.concatenate([close, far])
        points += [peak * (1.0 + offsets), peak * (1.0 - offsets)]
    grid = np.concatenate(points)
    return np.unique(grid[(grid > 0.0) & (grid <= bandwidth)])


def grid_of(peaks: Sequence[Array], bandwidth: float) -> Array:
    """`(k,)` frequencies up to `bandwidth` that resolve all `peaks` `(n, 2)`."""
    points = [np.linspace(bandwidth / 400.0, bandwidth, 400)]
    known = np.zeros((0, 2))
    for group in peaks:
        new = unresolved_peaks(group, known)
        points.append(peak_clusters(new, bandwidth))
        known = np.vstack([known, new])
    return np.unique(np.concatenate(points))


def band_grid(models: Sequence[PortModel], bandwidth: float) -> Array:
    """`(k,)` frequencies up to `bandwidth` that resolve every peak of `models`."""
    peaks = [peaks_of(model, np.zeros_like(model.rigid_mass)) for model in models]
    return grid_of(peaks, bandwidth)


def relative_error(
    responses: NDArray[np.complex128], exact: NDArray[np.complex128], frozen: float
) -> Array:
    """`(k,)` the in-band error of `responses` `(k, m, m)`, before its maximum."""
    return spectral_norms(responses - exact) / np.maximum(spectral_norms(exact), frozen)


def maximum_of(
    curve: Callable[[Array], Array], omega: Array, values: Array, tolerance: float | None = None
) -> float:
    """Maximum of a curve whose `values` at `omega` `(k,)` are known:
    its highest crests are followed between the points.

    With a `tolerance` only where the points leave open whether the maximum keeps it:
    above they are enough for a search.
    """
    most = float(values.max(initial=0.0))
    if tolerance is not None and not (
        most >= OPEN * tolerance and keeps_tolerance(most, tolerance)
    ):
        return most
    order = np.argsort(omega, kind="stable")
    omega = omega[order]
    values = values[order]
    highest = crests(values)[:CRESTS]
    if highest.size == 0:
        return most
    low = omega[np.maximum(highest - 1, 0)]
    middle = omega[highest]
    high = omega[np.minimum(highest + 1, omega.size - 1)]
    top = values[highest][:, None]
    fractions = np.arange(1, 6) / 6.0
    row = np.arange(highest.size)
    zero = np.zeros((highest.size, 1))
    for _ in range(ZOOMS):
        rising = low[:, None] + (middle - low)[:, None] * fractions
        falling = middle[:, None] + (high - middle)[:, None] * fractions
        points = np.hstack([low[:, None], rising, middle[:, None], falling, high[:, None]])
        new_values = curve(np.concatenate([rising.ravel(), falling.ravel()]))
        rising_values, falling_values = new_values.reshape(2, highest.size, fractions.size)
        # the ends are no crests: zero keeps them from being chosen
        point_values = np.hstack([zero, rising_values, top, falling_values, zero])
        best = point_values.argmax(axis=1)
        low = points[row, best - 1]
        middle = points[row, best]
        high = points[row, best + 1]
        top = point_values[row, best][:, None]
    return max(most, float(top.max()))


def crests(values: Array) -> NDArray[np.int64]:
    """Numbers of the points that are as high as both neighbours, from the highest down to `CREST`
    of it."""
    fence = np.concatenate([[-np.inf], values, [-np.inf]])
    is_high = values > CREST * values.max(initial=0.0)
    found = np.flatnonzero((values >= fence[:-2]) & (values >= fence[2:]) & is_high)
    return found[np.argsort(-values[found])]


def norm_ratios(matrices: NDArray[np.complex128], size: Array) -> Array:
    """`(k,)` spectral norms of `matrices` `(k, m, m)` over `size` `(k,)`;
    zero where that is known to be too low for a crest."""
    motions = matrices.shape[-1]
    if motions <= 2:
        return spectral_norms(matrices) / size
    # |A|_F / sqrt(m) <= |A|_2 <= |A|_F: the largest lies where the Frobenius norm is within sqrt(m)
    bounds = np.linalg.norm(matrices, axis=(1, 2)) / size
    near = ~(bounds < 0.999 * bounds.max(initial=0.0) / np.sqrt(motions))
    out = np.zeros(bounds.size)
    out[near] = spectral_norms(matrices[near]) / size[near]
    return out


def largest_norm_ratio(matrices: NDArray[np.complex128], size: Array) -> float:
    """Largest spectral norm of `matrices` `(k, m, m)` over `size` `(k,)`."""
    return float(np.max(norm_ratios(matrices, size)))


def spectral_norm(matrix: Array) -> float:
    """The spectral norm of one matrix `(m, m)`, as errors take it."""
    return float(spectral_norms(np.asarray(matrix, dtype=np.complex128)[None])[0])


def spectral_norms(matrices: NDArray[np.complex128]) -> Array:
    """Spectral norms `(k,)` of `(k, m, m)`; in closed form for m = 1 and 2."""
    motions = matrices.shape[-1]
    if motions == 1:
        return np.abs(matrices[:, 0, 0])
    if motions == 2:
        # |A|_2^2 = (f + sqrt(f^2 - 4 d^2)) / 2 with f = |A|_F^2 and d = |det A|
        a = matrices[:, 0, 0]
        b = matrices[:, 0, 1]
        c = matrices[:, 1, 0]
        d = matrices[:, 1, 1]
        total = np.sum(np.abs(matrices) ** 2, axis=(1, 2))
        determinant = np.abs(a * d - b * c)
        root = np.sqrt(np.clip(total**2 - 4.0 * determinant**2, 0.0, None))
        return np.sqrt((total + root) / 2.0)
    return np.linalg.norm(matrices, 2, axis=(1, 2))
