"""Error and run time of one entry of the field over a ladder of steps."""

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

#: Divisors of the beat (the common measure of all switching times): the ladder of steps, the next octaves alike.
LADDER = (
    1,
    2,
    3,
    4,
    5,
    6,
    7,
    8,
    9,
    10,
    11,
    12,
    13,
    14,
    15,
    16,
    17,
    18,
    19,
    20,
    22,
    24,
    26,
    28,
    32,
    36,
    40,
    44,
    48,
    52,
    56,
)
OFTEN = 40.0  # switching times per slowest period beyond which steps no longer divide them
RUNGS = 28  # steps tried below the stability limit, at most
FLOOR = 0.01  # two steps whose errors differ by less, relative, stand on the model's floor
FINE_ENOUGH = 1e-5  # error below which no finer step is of interest
REPEATS = 3
SHORT = 0.02  # simulations shorter than this are repeated [s]
FIRST = 30.0  # a single step of the ladder may take this many budgets, so that slow rivals show one point
HUB_STEPS = 2000  # of the rigid hub beside each simulation, at most
PROBE = 300  # steps simulated to foresee the cost of the first

#: Where an integrator's own clock stands after a step: the semi-implicit steps show motion half a step early.
CLOCK = {"Euler": 0.5, "implicit": 0.5, "implicitfast": 0.5, "discrete": 0.5, "RK4": 0.0}


class Point(NamedTuple):
    """One setting, measured.

    Args:
        model, n, integrator, timestep: the setting.
        error: of the hub's motion, relative to its largest elastic part.
        error_appendage: the same with the integrator's rigid-hub error taken off, on its own clock; kept for readers of
            study.json, asked no more.
        seconds: median time to simulate the scenario [s].
        seconds_per_step: the same over the number of steps.
        spread: half the range of the middle half of the repetitions, relative.
        over_rigid_hub: time per step relative to the rigid hub alone, measured in turns with it.
        repeats: simulations timed.
    """

    model: str
    n: int
    integrator: str
    timestep: float
    error: float
    error_appendage: float
    seconds: float
    seconds_per_step: float
    spread: float
    over_rigid_hub: float
    repeats: int


class Ladder(NamedTuple):
    """All points of an entry, largest step first, and why it ended."""

    entry: Entry
    points: list[Point]
    note: str


def steps_below(scenario: Scenario, limit: float) -> list[tuple[float, int]]:
    """Steps and their number, largest first: the beat over whole numbers, the scenario in whole steps."""
    beat = scenario.beat
    period = 2.0 * np.pi / float(np.min(np.abs(scenario.response.poles)))
    if beat < period / OFTEN:  # switching too often to step by: the mean wrench of each step is applied instead
        beat = scenario.duration / np.ceil(scenario.duration / (period / 4.0))
    first = max(int(np.ceil(beat / limit * (1.0 - 1e-9))), 1)  # the largest stable step is tried, whatever the ladder
    divisors = [d for d in (*LADDER, *(m * 2**k for k in range(1, 40) for m in (32, 40, 48, 56))) if d > first]
    return [(beat / d, round(scenario.duration / beat * d)) for d in [first, *divisors][:RUNGS]]


def climb(task: Task, scenario: Scenario, entry: Entry, budget: float) -> Ladder:
    """Errors and times of an entry, step by step downwards until its floor, or until `budget` seconds are spent.

    Args:
        task: appendage and hub.
        scenario: what is simulated.
        entry: which model and integrator.
        budget: time for the errors of this entry [s]; timing takes about as long again.
    """
    try:
        limit = field.largest_step(task, entry)
        steps = steps_below(scenario, limit)
    except (BeamchainError, np.linalg.LinAlgError) as error:
        return Ladder(entry, [], str(error))
    found: list[tuple[float, int, float, float, float, Any]] = []
    spent, still, note = 0.0, 0, "every step of the ladder measured"
    for h, count in steps:
        try:
            model = field.model_of(task, entry, h)
        except BeamchainError as error:
            note = str(error)
            continue
        wrench = entry.fed(scenario.profile.mean(h, count))
        probe = min(PROBE, count)
        cost = (
            found[-1][4] * count / found[-1][1]
            if found
            else simulate(model, entry.integrator, h, wrench[:probe]).seconds * count / probe
        )
        if spent + cost > (budget if found else FIRST * budget):
            note = f"stopped before a step of {h:.3g} s, which would take {cost:.2g} s"
            break
        course = simulate(model, entry.integrator, h, wrench)
        spent += course.seconds
        error = scenario.error(course.motion, h)
        rigid = rigid_motion(task, entry.integrator, h, wrench)
        own = scenario.error(course.motion, h, rigid, clock(entry))
        if not np.isfinite(error):
            continue  # this step was beyond the stability limit after all
        found.append((h, count, error, own, course.seconds, model))
        if len(found) > 1:
            before = found[-2]
            same = max(abs(error / before[2] - 1.0), abs(own / before[3] - 1.0)) < FLOOR
            still = still + 1 if same or error < FINE_ENOUGH else 0
            if still == 2:
                note = "finer steps change nothing: the model's own floor"
                break
    return Ladder(entry, _timed(task, scenario, entry, found), note)


def clock(entry: Entry) -> float:
    """Where the simulated time stands after a step, in steps from its end; a model exact in time shows its end."""
    return 0.0 if entry.timed else CLOCK[entry.integrator]


def rigid_motion(task: Task, integrator: str, timestep: float, wrench: Array) -> Array:
    """`(t, 6)` motion of the hub with the appendage frozen, by the same integrator and step."""
    model = field.model_of(task, Entry(RIGID_HUB, 0, integrator))
    return simulate(model, integrator, timestep, wrench).motion


def _timed(
    task: Task, scenario: Scenario, entry: Entry, found: list[tuple[float, int, float, float, float, Any]]
) -> list[Point]:
    """Repetitions of all short simulations in turns, each with the rigid hub beside it."""
    runs = [
        Run(model, entry.integrator, h, entry.fed(scenario.profile.mean(h, count))) for h, count, *_, model in found
    ]
    known = [[] if seconds < SHORT else [seconds] for *_, seconds, _ in found]
    hub = field.model_of(task, Entry(RIGID_HUB, 0, entry.integrator))
    times = in_turns(runs, hub, REPEATS, known)
    return [
        Point(*entry, h, error, own, t.seconds, t.seconds / count, t.spread, t.over_rigid_hub, t.repeats)
        for (h, count, error, own, *_), t in zip(found, times, strict=True)
    ]


class Run(NamedTuple):
    """One simulation to be timed: model, integrator, step and `(t, 6)` wrench on the hub."""

    model: Any
    integrator: str
    timestep: float
    wrench: Array


class Time(NamedTuple):
    """Median time [s], spread (half the range of the middle half, relative), per step over the rigid hub's, repeats."""

    seconds: float
    spread: float
    over_rigid_hub: float
    repeats: int


def in_turns(runs: Sequence[Run], hub: Any, repeats: int, known: Sequence[Sequence[float]]) -> list[Time]:
    """Time simulations in turns, `repeats` rounds, the rigid hub alone before each.

    Args:
        runs: what to time.
        hub: the rigid hub's model.
        repeats: rounds.
        known: per run, times already taken; a run with one is not timed again.
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
        out.append(Time(middle, float(high - low) / 2.0 / middle, statistics.median(ratio), len(taken)))
    return out
