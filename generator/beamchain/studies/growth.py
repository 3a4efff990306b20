"""How run time and fit time grow with the number of links."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np

from beamchain.engine.rollout import simulate
from beamchain.errors import BeamchainError
from beamchain.studies import field
from beamchain.studies.field import Entry, Task

COUNTS = (1, 2, 3, 5, 10, 20, 50, 100)
MODES = (1, 2, 3, 4, 5, 6)
LONG = 10  # exponents are fitted from here on: below it MuJoCo's own overhead rules
STEPS = 200
ROUNDS = 5


@dataclass(frozen=True)
class Growth:
    """Times against n.

    Args:
        step: `(n, seconds per Euler step)` of equal links.
        exponent: of that time in n, from n = 10 on.
        fit: `(n, seconds)` to find and write an exact chain with n modes.
        fit_exponent: of that time in n.
    """

    step: tuple[tuple[int, float], ...]
    exponent: float | None
    fit: tuple[tuple[int, float], ...]
    fit_exponent: float | None


def growth(task: Task) -> Growth:
    """Measure both, in turns."""
    if not task.planes:
        return Growth((), None, (), None)
    models = {n: field.model_of(task, Entry("equal links, midpoint", n, "Euler")) for n in COUNTS}
    wrench = np.zeros((STEPS, 6))
    times: dict[int, list[float]] = {n: [] for n in COUNTS}
    for _ in range(ROUNDS):
        for n, model in models.items():
            times[n].append(simulate(model, "Euler", 1e-5, wrench).seconds / STEPS)
    fits: dict[int, list[float]] = {}
    for _ in range(ROUNDS):
        for n in MODES:
            start = time.thread_time()
            try:
                field.model_of(task, Entry("exact, clamped", n, "Euler"))
            except BeamchainError:
                continue
            fits.setdefault(n, []).append(time.thread_time() - start)
    step = [(n, median(t)) for n, t in times.items()]
    fit = [(n, median(t)) for n, t in fits.items()]
    return Growth(tuple(step), _exponent([p for p in step if p[0] >= LONG]), tuple(fit), _exponent(fit))


def _exponent(points: Sequence[tuple[int, float]]) -> float | None:
    if len(points) < 2:
        return None
    n, seconds = np.array(points).T
    return float(np.polyfit(np.log(n), np.log(seconds), 1)[0])
