"""Error and run time of an entry over a ladder of steps."""

import statistics
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from beamchain.engine.rollout import seconds_of, simulate
from beamchain.errors import BeamchainError
from beamchain.ports.motions import Array
from beamchain.studies import field
from beamchain.studies.field import RIGID_HUB, Entry, Task
from beamchain.studies.scenario import Scenario

#: Divisors of the beat (the common measure of all switching times): the ladder of steps,
#: the next octaves alike.
LADDER = (*range(1, 21), *range(22, 29, 2), *range(32, 57, 4))
OFTEN = 40.0  # switching times per slowest period beyond which steps no longer divide them
RUNGS = 28  # steps tried below the stability limit, at most
FLOOR = 0.01  # two steps whose errors differ by less, relative, stand on the model's floor
FINE_ENOUGH = 1e-5  # error below which no finer step is of interest
REPEATS = 3
SHORT = 0.02  # simulations shorter than this are repeated [s]
# a single step of the ladder may take this many budgets, so that slow rivals show one point
FIRST = 30.0
HUB_STEPS = 2000  # of the rigid hub beside each simulation, at most
PROBE = 300  # steps simulated to foresee the cost of the first

#: Where an integrator's own clock stands after a step:
#: the semi-implicit steps show motion half a step early.
CLOCK = {"Euler": 0.5, "implicit": 0.5, "implicitfast": 0.5, "discrete": 0.5, "RK4": 0.0}


class Point(NamedTuple):
    """One setting, measured."""

    model: str  #: its name, such as "exact, hub"
    n: int  #: modes, or links of a rival
    integrator: str  #: MuJoCo's name
    timestep: float  #: [s]
    error: float  #: of the hub's motion, relative to its largest elastic part
    #: the same without the integrator's rigid-hub error, on its own clock; in study.json only
    error_appendage: float
    seconds: float  #: median time to simulate the scenario [s]
    seconds_per_step: float  #: [s]
    spread: float  #: half the range of the middle half of the repetitions, relative
    over_rigid_hub: float  #: time per step relative to the rigid hub's, measured in turns with it
    repeats: int  #: of the timing

    @property
    def entry(self) -> Entry:
        """What was measured, at whatever step."""
        return Entry(*self[:3])


class Ladder(NamedTuple):
    """All points of an entry, largest step first, and why it ended."""

    entry: Entry
    points: list[Point]
    note: str


class Run(NamedTuple):
    """One simulation to be timed: model, integrator, step and `(t, 6)` wrench on the hub."""

    model: Any
    integrator: str
    timestep: float
    wrench: Array


class _Rung(NamedTuple):
    run: Run
    error: float
    appendage_error: float  # with the integrator's rigid-hub error taken off
    seconds: float


def steps_below(scenario: Scenario, limit: float) -> list[tuple[float, int]]:
    """Steps and their number, largest first: the beat over whole numbers,
    the scenario in whole steps."""
    beat = scenario.beat
    period = scenario.response.slowest
    # switching too often to step by: the mean wrench of each step is applied instead
    if beat < period / OFTEN:
        beat = scenario.duration / np.ceil(scenario.duration / (period / 4.0))
    # the largest stable step is tried, whatever the ladder
    first = max(int(np.ceil(beat / limit * (1.0 - 1e-9))), 1)
    octaves = [m * 2**k for k in range(1, 40) for m in (32, 40, 48, 56)]
    finer = [divisor for divisor in (*LADDER, *octaves) if divisor > first]
    divisors = [first, *finer][:RUNGS]
    return [(beat / d, round(scenario.duration / beat * d)) for d in divisors]


def climb(task: Task, scenario: Scenario, entry: Entry, budget: float) -> Ladder:
    """Errors and times of an entry, step by step downwards until its floor,
    or until `budget` seconds are spent.

    Timing takes about as long again.
    """
    try:
        limit = field.largest_step(task, entry)
        steps = steps_below(scenario, limit)
    except (BeamchainError, np.linalg.LinAlgError) as error:
        return Ladder(entry, [], str(error))
    rungs: list[_Rung] = []
    spent = 0.0
    still = 0
    note = "every step of the ladder measured"
    for h, count in steps:
        try:
            model = field.model_of(task, entry, h)
        except BeamchainError as error:
            note = str(error)
            continue
        if rungs:
            cost = rungs[-1].seconds * count / len(rungs[-1].run.wrench)
        else:
            probe = min(PROBE, count)
            first = entry.fed(scenario.profile.mean(h, probe))
            begun = simulate(model, entry.integrator, h, first)
            if not np.all(np.isfinite(begun.motion)):
                continue  # beyond the stability limit after all
            cost = begun.seconds * count / probe
        if spent + cost > (budget if rungs else FIRST * budget):
            note = f"stopped before a step of {h:.3g} s, which would take {cost:.2g} s"
            break
        wrench = entry.fed(scenario.profile.mean(h, count))
        course = simulate(model, entry.integrator, h, wrench)
        spent += course.seconds
        error = scenario.error(course.motion, h)
        rigid = rigid_motion(task, entry.integrator, h, wrench)
        appendage_error = scenario.error(course.motion, h, rigid, clock(entry))
        if not np.isfinite(error):
            continue  # as above, later in the run
        rungs.append(
            _Rung(Run(model, entry.integrator, h, wrench), error, appendage_error, course.seconds)
        )
        if len(rungs) > 1:
            before = rungs[-2]
            same = (
                max(
                    abs(error / before.error - 1.0),
                    abs(appendage_error / before.appendage_error - 1.0),
                )
                < FLOOR
            )
            still = still + 1 if same or error < FINE_ENOUGH else 0
            if still == 2:
                note = "finer steps change nothing: the model's own floor"
                break
    return Ladder(entry, _measure_times(task, entry, rungs), note)


def clock(entry: Entry) -> float:
    """Where the simulated time stands after a step, in steps from its end;
    a model exact in time shows its end."""
    return 0.0 if entry.timed else CLOCK[entry.integrator]


def rigid_motion(task: Task, integrator: str, timestep: float, wrench: Array) -> Array:
    """`(t, 6)` motion of the hub with the appendage frozen, by the same integrator and step."""
    model = field.model_of(task, Entry(RIGID_HUB, 0, integrator))
    return simulate(model, integrator, timestep, wrench).motion


def _measure_times(task: Task, entry: Entry, rungs: Sequence["_Rung"]) -> list[Point]:
    """Repetitions of all short simulations in turns, each with the rigid hub beside it."""
    known = [[] if rung.seconds < SHORT else [rung.seconds] for rung in rungs]
    hub = field.model_of(task, Entry(RIGID_HUB, 0, entry.integrator))
    times = measure_in_turns([rung.run for rung in rungs], hub, REPEATS, known)
    points: list[Point] = []
    for rung, duration in zip(rungs, times, strict=True):
        point = Point(
            *entry,
            timestep=rung.run.timestep,
            error=rung.error,
            error_appendage=rung.appendage_error,
            seconds=duration.seconds,
            seconds_per_step=duration.seconds / len(rung.run.wrench),
            spread=duration.spread,
            over_rigid_hub=duration.over_rigid_hub,
            repeats=duration.repeats,
        )
        points.append(point)
    return points


class Time(NamedTuple):
    """Median time [s], spread (half the range of the middle half, relative),
    per step over the rigid hub's, repeats."""

    seconds: float
    spread: float
    over_rigid_hub: float
    repeats: int


def measure_in_turns(
    runs: Sequence[Run], hub: Any, repeats: int, known: Sequence[Sequence[float]]
) -> list[Time]:
    """Time simulations in turns, `repeats` rounds, the rigid hub alone before each.

    A run with times that are `known` is not timed again.
    """
    times = [list(t) for t in known]
    ratios: list[list[float]] = [[] for _ in runs]
    fixed = [bool(t) for t in known]
    for turn in range(repeats):
        for i, run in enumerate(runs):
            if fixed[i] and turn:
                continue
            few = run.wrench[:HUB_STEPS]
            alone = seconds_of(hub, run.integrator, run.timestep, few) / few.shape[0]
            if not fixed[i]:
                times[i].append(seconds_of(*run))
            ratios[i].append(times[i][-1] / run.wrench.shape[0] / alone)
    out: list[Time] = []
    for taken, ratio in zip(times, ratios, strict=True):
        middle = statistics.median(taken)
        low, high = np.quantile(taken, [0.25, 0.75])
        out.append(
            Time(
                middle,
                spread=float(high - low) / 2.0 / middle,
                over_rigid_hub=statistics.median(ratio),
                repeats=len(taken),
            )
        )
    return out
