"""Curves over frequency: points that resolve a resonance, the largest value, and zeros."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from beamchain.ports.motions import Array

POLISHED = 4  # maxima on a grid that are polished, at least
LOW = 0.02  # of the largest value on the grid: of a maximum that is lower by less, too
TOP = 1e-10  # relative, of a frequency, to which they are
CLOSE = 1e-13  # relative, to which a crossing is found


class Extremum(NamedTuple):
    """A figure that is the least, or the largest, over all frequencies, and where [rad/s]."""

    value: float
    frequency: float


def half_widths(reach: float, count: int) -> Array:
    """`(count,)` half widths of a resonance at which it is looked at, close together at its top
    and up to `sinh(reach)` away."""
    return np.sinh(np.linspace(-reach, reach, count))


def around(frequencies: Array, widths: Array, steps: Array) -> Array:
    """`(n k,)` frequencies beside resonances of half widths `(n,)`, by `(k,)` of them."""
    return (frequencies[:, None] + widths[:, None] * steps).ravel()


def largest(
    omega: Array,
    values: Array,
    function: Callable[[float], float],
    limit: float | None = None,
) -> Extremum:
    """The largest of values on a grid, the highest maxima polished, and of their limit at infinite
    frequency."""
    before = np.concatenate([[-np.inf], values[:-1]])
    after = np.concatenate([values[1:], [-np.inf]])
    tops = np.flatnonzero((values >= before) & (values >= after))
    tops = tops[np.argsort(-values[tops])]
    close = np.count_nonzero(values[tops] > values[tops[0]] - LOW * abs(values[tops[0]]))
    tops = tops[: max(POLISHED, close)]
    best = Extremum(float(values[tops[0]]), float(omega[tops[0]]))
    for k in tops:
        low, high = float(omega[max(k - 1, 0)]), float(omega[min(k + 1, omega.size - 1)])
        found = minimize_scalar(
            lambda w: -function(float(w)),
            bounds=(low, high),
            method="bounded",
            options={"xatol": TOP * high},
        )
        if -float(found.fun) > best.value:
            best = Extremum(-float(found.fun), float(found.x))
    return best if limit is None or limit <= best.value else Extremum(limit, float("inf"))


def crossings(
    omega: Array, values: Array, function: Callable[[float], float]
) -> list[tuple[int, float]]:
    """Where a curve crosses zero: numbers of the points of its grid before, and frequencies."""
    changes = np.flatnonzero(np.sign(values[1:]) * np.sign(values[:-1]) < 0.0)
    return [(int(k), crossing(function, float(omega[k]), float(omega[k + 1]))) for k in changes]


def crossing(function: Callable[[float], float], low: float, high: float) -> float:
    """The zero of a function between two frequencies at which its signs differ; where rounding
    makes them alike, the end that is nearer to zero."""
    ends = function(low), function(high)
    if ends[0] * ends[1] >= 0.0:
        return float(low if abs(ends[0]) < abs(ends[1]) else high)
    root: Any = brentq(function, low, high, xtol=CLOSE * high, rtol=CLOSE)
    return float(root)
