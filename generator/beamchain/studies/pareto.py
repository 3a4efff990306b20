"""What the points say: the Pareto front, and the cheapest setting for a target error."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Literal

from beamchain.studies.field import Entry
from beamchain.studies.run_time import Ladder, Point

Metric = Literal["error", "error_appendage"]

TARGETS = (1e-2, 1e-3, 1e-4)  # errors that a study answers for


@dataclass(frozen=True)
class Reach:
    """The cheapest way to a target error with one model."""

    model: str  #: its name
    seconds: float  #: time for the scenario [s]
    point: Point  #: the setting

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
    """The cheapest setting of a model for a target error; None where it was not reached."""
    model_front = front([ladder for ladder in ladders if ladder.entry.model == model], metric)
    for error, point in model_front:
        if error <= target:
            return Reach(model, seconds=point.seconds, point=point)
    return None


def recommended_name(target: float) -> str:
    """Name of the spec recommended for a target error."""
    return f"recommended_{power(target)}.toml"


def power(target: float) -> str:
    """1e-2, 1e-3, ..."""
    return f"1e{round(math.log10(target))}"
