"""What the points say: the Pareto front, and the cheapest setting for a target error."""

import math
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Literal

from beamchain.studies.field import Entry
from beamchain.studies.run_time import Ladder, Point

Metric = Literal["error", "error_appendage"]

TARGETS = (1e-2, 1e-3, 1e-4)  # errors that a study answers for
SLOPE_POINTS = 3  # sizes n that an extrapolation takes, from the accurate end
STEEPEST = 3.0  # decades of time per decade of error that an extrapolation believes


@dataclass(frozen=True)
class Reach:
    """The cheapest way to a target error with one model."""

    model: str  #: its name
    seconds: float  #: time for the scenario [s]
    point: Point  #: the setting; the last measured one where extrapolated
    #: the target lies beyond what was measured; time follows the front's measured slope
    extrapolated: bool
    slope: float | None = None  #: decades of time per decade of error, where extrapolated

    @property
    def entry(self) -> Entry:
        """The competitor."""
        return self.point.entry


def trusted_points(ladder: Ladder, metric: Metric) -> list[tuple[float, Point]]:
    """Each point with the error it can be trusted for:
    the worst of its own and of every finer step."""
    points = sorted(ladder.points, key=lambda point: point.timestep)
    errors = [float(getattr(point, metric)) for point in points]
    return list(zip(accumulate(errors, max), points, strict=True))


def front(ladders: Iterable[Ladder], metric: Metric) -> list[tuple[float, Point]]:
    """The points that no other beats in both trusted error and time, slowest last."""
    points = sorted(
        (pair for ladder in ladders for pair in trusted_points(ladder, metric)),
        key=lambda p: p[1].seconds,
    )
    out: list[tuple[float, Point]] = []
    for error, point in points:
        if not out or error < out[-1][0]:
            out.append((error, point))
    return out


def reach(ladders: Sequence[Ladder], model: str, target: float, metric: Metric) -> Reach | None:
    """The cheapest setting of a model for a target error; beyond its points,
    along the slope of its front."""
    model_front = front([ladder for ladder in ladders if ladder.entry.model == model], metric)
    for error, point in model_front:
        if error <= target:
            return Reach(model, seconds=point.seconds, point=point, extrapolated=False)
    if not model_front:
        return None
    error, point = model_front[-1]
    slope = _slope(_sizes(ladders, point, metric))
    if slope is None:
        return None
    seconds = point.seconds * (error / target) ** slope
    return Reach(model, seconds=seconds, point=point, extrapolated=True, slope=slope)


def _sizes(ladders: Sequence[Ladder], last: Point, metric: Metric) -> list[tuple[float, Point]]:
    """The most accurate point of each size n with the model and integrator of `last`, up to it."""
    out: list[tuple[float, Point]] = []
    for ladder in sorted(ladders, key=lambda each: each.entry.n):
        if (
            ladder.entry.model == last.model
            and ladder.entry.integrator == last.integrator
            and ladder.points
        ):
            error, point = max(
                trusted_points(ladder, metric), key=lambda pair: (-pair[0], -pair[1].seconds)
            )
            if point.n <= last.n and (not out or error < out[-1][0]):
                out.append((error, point))
    return out[-SLOPE_POINTS:]


def _slope(points: Sequence[tuple[float, Point]]) -> float | None:
    """Least-squares slope of log time over log 1/error; None where the front does not fall."""
    if len(points) < 2:
        return None
    x = [-math.log(error) for error, _ in points]
    # less than half a natural unit of error gained: no slope to speak of
    if statistics.pvariance(x) * len(x) < 0.25:
        return None
    slope = statistics.linear_regression(x, [math.log(point.seconds) for _, point in points]).slope
    return slope if 0.0 < slope <= STEEPEST else None


def recommended_name(target: float) -> str:
    """Name of the spec recommended for a target error."""
    return f"recommended_{power(target)}.toml"


def power(target: float) -> str:
    """1e-2, 1e-3, ..."""
    return f"1e{round(math.log10(target))}"
