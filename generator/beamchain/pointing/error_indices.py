"""Indices of a pointing error, ECSS-E-ST-60-10C (2008): the error itself (APE), and its deviation
from the mean over a window that contains the instant (RPE)."""

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from beamchain.toolkit import Array, Complex

ZOOMS, ZOOM = 3, 41  # rounds in which a peak is refined, and points of each
SIGMAS = 3.0  # of a Gaussian error: 99.7 % of the time it is smaller


class ErrorIndex(NamedTuple):
    """One index of a pointing error, per output.

    Args:
        rms: `(outputs,)` root of its mean square; NaN for a transient, which has none.
        peak: `(outputs,)` what it does not exceed: always where it is periodic or transient,
            99.7 % of the time (three sigma) where it is random.
    """

    rms: Array
    peak: Array


def mean_share(omega: Array, window: float) -> Array:
    """`sin(x)/x`, `x = omega window / 2`: what the mean over a window keeps of an amplitude."""
    return np.sinc(omega * window / (2.0 * np.pi))


def deviation_share(omega: Array, window: float) -> Array:
    """Largest deviation of a harmonic of unit amplitude from its mean over a window.

    Of `cos(phi + omega t)` with the window about t = 0 that is the maximum, over all |t| up to half
    a window, of `|exp(j omega t) - sin(x)/x|`.
    """
    mean = mean_share(omega, window)
    farthest = np.where(mean > 0.0, np.minimum(omega * window / 2.0, np.pi), 0.0)
    return np.abs(np.exp(1j * farthest) - mean)


def windowed_variance(omega: Array, window: float) -> Array:
    """`1 - (sin(x)/x)^2`: share of a variance that is deviation from the mean over a window."""
    return 1.0 - mean_share(omega, window) ** 2


def largest_deviation(
    values: Array, mean: Array, reach: int, mode: Literal["wrap", "nearest"]
) -> Array:
    """`(outputs,)` largest deviation of samples `(k, outputs)` from the mean over the window about
    sample k, anywhere in that window.

    `reach`: samples from the middle of a window to its end; `mode` "wrap": periodic, "nearest":
    not.
    """
    size = min(2 * reach + 1, values.shape[0])
    highest = maximum_filter1d(values, size, axis=0, mode=mode)
    lowest = minimum_filter1d(values, size, axis=0, mode=mode)
    return np.maximum(highest - mean, mean - lowest).max(axis=0)


def mean_squares(parts: Complex, omega: Array, window: float) -> tuple[Array, Array, Array]:
    """Mean squares `(outputs,)` of an error `e = H a` and of its deviation from the mean over a
    window, and of them the share `(names, outputs)` of each contribution.

    Of lines at frequencies omega, with `x = omega window / 2`,

        sigma^2 = sum of |e|^2 / 2,    of the deviation: sum of |e|^2 / 2 (1 - (sin(x)/x)^2).

    `parts` `(names, k, outputs)`: what the lines, which are not correlated, contribute.
    """
    error = parts.sum(axis=0)
    power = np.abs(error) ** 2 / 2.0
    shares = np.real(parts * error.conj()).sum(axis=1) / 2.0
    return power.sum(axis=0), windowed_variance(omega, window) @ power, shares


def closed_in(size: Callable[[Array], Array], samples: Array, place: int) -> float:
    """Where a function has the local maximum that was sampled at a place, between its neighbours.

    It is looked at where points are equally spaced.
    """
    low, high = samples[max(place - 1, 0)], samples[min(place + 1, samples.size - 1)]
    at = samples[place]
    for _ in range(ZOOMS):
        near = np.linspace(low, high, ZOOM)
        best = int(np.argmax(size(near)))
        low, high = near[max(best - 1, 0)], near[min(best + 1, ZOOM - 1)]
        at = near[best]
    return float(at)
