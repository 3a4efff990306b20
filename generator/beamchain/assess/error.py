"""How far one port model is from another: one comparison and one in-band error for the whole package."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from beamchain.errors import InputError
from beamchain.motion import Array, locked
from beamchain.port import PortModel

DEFAULT_RATIO = 0.005  # damping ratio of every cantilever mode where none is given
SAME_PEAK = 1e-7  # relative; far below the width of any peak that is resolved
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
        accelerance_in_band: the in-band error; None where it was not asked for.
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
    """The in-band error of `a` against `b`.

    `H(w) = (M_hub + D(w))^-1`, `S = sqrt(diag(M_hub + M_rigid))`: the maximum over 0 < w <= bandwidth of
    `||S (H_a - H_b) S||`, over the larger of the maxima of `||S H_b S||` and `||S H_rigid S||`, spectral norms.

    Args:
        a, b: models; a model without damping gets 0.5 % in every cantilever mode.
        hub_mass: `(m, m)`; none: the worst of three hubs, 0.1, 1 and 10 times the rigid mass of `b`.
        bandwidth: [rad/s].
        keep: motions of the hub that matter; all where left out.
    """
    if hub_mass is None:
        return max(in_band_error(a, b, factor * b.rigid_mass, bandwidth, keep) for factor in STANDARD_HUBS)
    hub = np.asarray(hub_mass, dtype=np.float64)
    a, b = damped(a), damped(b)
    omega = band_grid([a.with_hub(hub), b.with_hub(hub)], bandwidth)
    s = np.sqrt(np.diag(hub + b.rigid_mass))
    pick = list(range(s.size)) if keep is None else list(keep)
    scaled = np.outer(s, s)[np.ix_(pick, pick)]

    def response(model: PortModel) -> NDArray[np.complex128]:
        h = np.linalg.inv(np.moveaxis(hub[:, :, None] + model.D(omega), -1, 0))
        return (h[:, pick][:, :, pick] * scaled).astype(np.complex128, copy=False)

    ha, hb = response(a), response(b)
    rigid = np.linalg.inv(hub + b.rigid_mass)[np.ix_(pick, pick)] * scaled
    below = max(float(spectral_norms(hb).max()), float(np.linalg.norm(rigid, 2)))
    return float(spectral_norms(ha - hb).max()) / below


def damped(model: PortModel) -> PortModel:
    """The model with its own damping, or 0.5 % in every cantilever mode where it has none."""
    if model.modes == 0 or np.any(model.damping > 0.0):
        return model
    return model.replaced(damping=np.full(model.modes, DEFAULT_RATIO))


def band_grid(models: Sequence[PortModel], bandwidth: float) -> Array:
    """`(k,)` frequencies up to `bandwidth`, dense at every peak of the given models (hub included) [rad/s]."""
    points = [np.linspace(bandwidth / 400.0, bandwidth, 400)]
    offsets = np.concatenate([[0.0], np.geomspace(0.02, 60.0, 40)])
    seen = np.zeros(0)
    for model in models:
        peaks = np.concatenate([model.free_frequencies, model.frequencies])
        if seen.size:  # a peak that another model has too needs no second cluster of points
            peaks = peaks[np.min(np.abs(peaks[:, None] / seen - 1.0), axis=1) > SAME_PEAK]
        seen = np.concatenate([seen, peaks])
        width = float(np.max(model.damping, initial=DEFAULT_RATIO))
        narrow = max(float(np.min(model.damping, initial=1.0)), 1e-6)
        for peak in peaks[peaks < 1.2 * bandwidth]:
            for ratio in {narrow, width}:
                points += [peak * (1.0 + ratio * offsets), peak * (1.0 - ratio * offsets)]
    grid = np.unique(np.concatenate(points))
    return grid[(grid > 0.0) & (grid <= bandwidth)]


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
