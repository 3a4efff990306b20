"""Fine chains converged in links and step: the reference of a study in large motion, and where it is needed."""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from beamchain.engine.rollout import simulate
from beamchain.errors import BeamchainError, EngineError
from beamchain.ports.motions import Array
from beamchain.studies import field
from beamchain.studies.field import Entry, Task
from beamchain.studies.front import TARGETS
from beamchain.studies.scenario import SMALL, Figures, LargeReference, Scenario, at_zero, between

COARSE = 7  # links of the chain that tells whether the motion is large
LINKS = (10, 14, 20, 28, 40, 57, 80)  # each twice the last but one; error falls with the square of the number
TOGETHER = 3  # chains that an extrapolation takes
WANTED = min(TARGETS) / 10.0  # relative change at which links and step count as converged
LINEAR = min(TARGETS) / 10.0  # relative change of the motion up to which the linear response is the reference
LONGEST = 40.0  # no chain is simulated that would take longer [s]
MOST_STEPS = 200_000  # of the coarse chain: beyond, whether the motion is large stays unknown
MOMENTS = 1000  # per slowest period, at which chains are read, at most
SHRINK = 0.1  # a small motion is at most this share of the real one: what changes with its square is 1 % of it
GROWTH = 4.0  # time to simulate grows as links to this power: step by its square, time per step up to its square


class _Grid(NamedTuple):
    """Moments at which chains are read: every few steps where a chain needs shorter ones."""

    spacing: float  # [s]
    number: int
    shrink: float  # the wrench of a small motion, relative

    @property
    def at(self) -> Array:
        """`(t,)` [s]."""
        return self.spacing * np.arange(1.0, self.number + 1.0)


class _Read(NamedTuple):
    """One chain's motion, large and small."""

    moved: Array  # (t, 6) what large motion adds to its own small one
    small: Array  # (t, 6) the small one, scaled up
    seconds: float  # both took


def nonlinear(task: Task, scenario: Scenario) -> float:
    """What large motion changes, relative to the largest elastic motion, as a coarse chain shows it.

    0 where nothing bends, not a number where no such chain can be simulated in a sensible time.
    """
    if not task.planes:
        return 0.0
    coarse = Entry("equal links, midpoint", COARSE, "Euler")
    try:
        grid = _grid(task, scenario, coarse)
        steps = _steps(task, grid, coarse)
        field.model_of(task, coarse)
    except (BeamchainError, np.linalg.LinAlgError):
        return float("nan")  # there is no chain of so many links
    if grid.number * steps > MOST_STEPS:
        return float("nan")
    return scenario.size(_pair(task, scenario, grid, coarse, steps).moved)


def large_reference(task: Task, scenario: Scenario) -> LargeReference:
    """The reference in large motion: links refined and steps halved until little changes."""
    grid = _grid(task, scenario, _chain(LINKS[0]))
    reads: dict[int, _Read] = {}
    best: Array | None = None
    change = float("inf")
    for links in LINKS:
        used = list(reads)
        if len(used) >= TOGETHER and reads[used[-1]].seconds * (links / used[-1]) ** GROWTH > LONGEST:
            break
        reads[links] = _pair(task, scenario, grid, _chain(links), _steps(task, grid, _chain(links)))
        if len(reads) < TOGETHER:
            continue
        now = _extrapolated(reads, "moved", TOGETHER)
        change = scenario.size(now - (_extrapolated(reads, "moved", TOGETHER - 1) if best is None else best))
        best = now
        if change <= WANTED:
            break
    assert best is not None
    first = LINKS[0]
    halved = _pair(task, scenario, grid, _chain(first), 2 * _steps(task, grid, _chain(first)))
    exact = scenario.motion(grid.at)
    figures = Figures(
        nonlinear=scenario.size(best), links=tuple(reads)[-TOGETHER:], change=change,
        step_change=scenario.size(halved.moved - reads[first].moved),
        small_motion=scenario.size(_extrapolated(reads, "small", TOGETHER) - exact), wanted=WANTED,
    )  # fmt: skip
    rigid = _pair(task, scenario, grid, Entry(field.RIGID_HUB, 0, "RK4"), 1)
    return LargeReference(scenario.response, scenario.profile, _spline(grid, best), _spline(grid, rigid.moved), figures)


def _grid(task: Task, scenario: Scenario, entry: Entry) -> _Grid:
    slowest = scenario.response.slowest
    spacing = max(field.largest_step(task, entry) / 2.0, slowest / MOMENTS)
    if scenario.beat > spacing:
        spacing = scenario.beat / np.ceil(scenario.beat / spacing)
    beyond = max(scenario.beat, slowest / 4.0)  # an integrator's own clock runs half a step beyond the end
    moments = np.arange(1.0, 401.0) / 400.0 * scenario.duration
    motion = scenario.motion(moments)
    motion[:, :3] /= task.beam.length
    number = int(np.ceil((scenario.duration + beyond) / spacing))
    return _Grid(float(spacing), number, min(SMALL / float(np.max(abs(motion))), SHRINK))


def _chain(links: int) -> Entry:
    return Entry("equal links, midpoint", links, "RK4")


def _steps(task: Task, grid: _Grid, entry: Entry) -> int:
    """Steps that a chain takes from one moment to the next."""
    return int(np.ceil(grid.spacing / field.largest_step(task, entry) * (1.0 - 1e-9)))


def _pair(task: Task, scenario: Scenario, grid: _Grid, entry: Entry, steps: int) -> _Read:
    """A model's motion under the profile and under a small share of it, `steps` steps per moment."""
    model = field.model_of(task, entry)
    h = grid.spacing / steps
    wrench = scenario.profile.mean(h, grid.number * steps)
    large = simulate(model, entry.integrator, h, wrench)
    small = simulate(model, entry.integrator, h, wrench * grid.shrink)
    if not np.all(np.isfinite(large.motion)):
        raise EngineError(
            f"under this load a chain of {entry.n} links cannot be simulated with {entry.integrator} at {h:.3g} s, a step "
            "that is stable in small motion: the appendage is thrown about; give a smaller load."
        )
    read = small.motion[steps - 1 :: steps] / grid.shrink
    return _Read(between(read, large.motion[steps - 1 :: steps]), read, large.seconds + small.seconds)


def _extrapolated(reads: dict[int, _Read], what: str, count: int) -> Array:
    """To infinitely many links, from the last `count` chains."""
    used = list(reads)[-count:]
    return at_zero([1.0 / n**2 for n in used], [getattr(reads[n], what) for n in used])


def _spline(grid: _Grid, moved: Array) -> CubicSpline:
    start = np.zeros((1, moved.shape[1]))
    return CubicSpline(np.concatenate([[0.0], grid.at]), np.vstack([start, moved]))
