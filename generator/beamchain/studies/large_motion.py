"""How much large motion changes of what a study compares:
a coarse chain under the load and under a small share of it."""

import numpy as np

from beamchain.engine.rollout import simulate
from beamchain.errors import BeamchainError, EngineError
from beamchain.studies import field
from beamchain.studies.field import Entry, Task
from beamchain.studies.pareto import TARGETS
from beamchain.studies.scenario import SMALL, Scenario, relative_motion

COARSE = Entry("equal links, midpoint", 7, "Euler")
# relative change of the motion up to which the linear response is the reference
LINEAR = min(TARGETS) / 10.0
MOST_STEPS = 200_000  # of the coarse chain: beyond, whether the motion is large stays unknown
MOMENTS = 1000  # per slowest period, at which the chain is read, at most
# a small motion is at most this share of the real one: what changes with its square is 1 % of it
SHRINK = 0.1


def nonlinear_share(task: Task, scenario: Scenario) -> float:
    """What large motion changes, relative to the largest elastic motion,
    as a coarse chain shows it.

    0 where nothing bends, not a number where no such chain can be simulated in a sensible time.

    Raises:
        EngineError: the load throws the appendage about.
    """
    if not task.planes:
        return 0.0
    try:
        largest = field.largest_step(task, COARSE)
        model = field.model_of(task, COARSE)
    except (BeamchainError, np.linalg.LinAlgError):
        return float("nan")  # there is no chain of so many links
    spacing = max(largest / 2.0, scenario.response.slowest / MOMENTS)
    number = int(np.ceil(scenario.duration / spacing))
    steps = int(np.ceil(spacing / largest * (1.0 - 1e-9)))  # from one moment to the next
    if number * steps > MOST_STEPS:
        return float("nan")
    timestep = spacing / steps
    wrench = scenario.profile.mean(timestep, number * steps)
    shrink = _small_share(task, scenario)
    large = simulate(model, COARSE.integrator, timestep, wrench).motion
    small = simulate(model, COARSE.integrator, timestep, shrink * wrench).motion / shrink
    if not np.all(np.isfinite(large)):
        raise EngineError(
            f"under this load a chain of {COARSE.n} links cannot be simulated with "
            f"{COARSE.integrator} at {timestep:.3g} s, a step that is stable in small motion: the "
            "appendage is thrown about; give a smaller load."
        )
    return scenario.size(relative_motion(small[steps - 1 :: steps], large[steps - 1 :: steps]))


def _small_share(task: Task, scenario: Scenario) -> float:
    """Factor on the wrench with which the motion is small."""
    moments = np.arange(1.0, 401.0) / 400.0 * scenario.duration
    motion = scenario.motion(moments)
    motion[:, :3] /= task.beam.length
    return min(SMALL / float(np.max(np.abs(motion))), SHRINK)
