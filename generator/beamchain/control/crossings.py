"""Where a function of frequency crosses zero between two points of a grid."""

from collections.abc import Callable
from typing import Any

from scipy.optimize import brentq

CLOSE = 1e-13  # relative, to which a crossing is found


def crossing(function: Callable[[float], float], low: float, high: float) -> float:
    """The zero of a function between two frequencies at which its signs differ; where rounding
    makes them alike, the end that is nearer to zero."""
    ends = function(low), function(high)
    if ends[0] * ends[1] >= 0.0:
        return float(low if abs(ends[0]) < abs(ends[1]) else high)
    root: Any = brentq(function, low, high, xtol=CLOSE * high, rtol=CLOSE)
    return float(root)
