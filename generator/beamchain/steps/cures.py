"""What mends a missed tolerance: found by trying, and the cheapest in run time that was tried."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from beamchain.ports.compare import keeps_tolerance, tolerance_statement
from beamchain.steps.limits import RELATIVE_COST

RUINED = 0.1  # error at a step from which on the step is no success, whatever was asked for
TRIED = ("Euler", "implicitfast", "RK4")
MORE = 1.2  # run time of a step with a mode more, against that without
SHORTEST = 1e-4  # of the step: no shorter one is tried
SHRUNK = (0.03, 0.5)  # of the step: how much shorter the next one is at least and at most
BISECTIONS = 3  # of the last shortening


class Setting(NamedTuple):
    """What may be changed of a run: its integrator, its step [s] (0: the motion in continuous
    time), timing (None: where it is worth it), and modes or damping of an appendage, in words."""

    integrator: str
    timestep: float
    timing: bool | None = None
    change: str = ""

    @property
    def cost(self) -> float:
        """Run time per simulated second, against that of Euler's step of 1 s."""
        more = MORE if self.change else 1.0
        return RELATIVE_COST[self.integrator] * more / (self.timestep or 1.0)


class Names(NamedTuple):
    """How the user changes an integrator and a step, `{}` in place of the value, and timing."""

    integrator: str
    timestep: str
    timing: str = ""


@dataclass(frozen=True)
class Cure:
    """A setting that was tried and keeps the tolerance.

    Args:
        setting: what was tried.
        error: with it.
        words: the cure in a sentence, which begins with what to do.
    """

    setting: Setting
    error: float
    words: str

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {**self.setting._asdict(), "error": self.error}


def find_cure(
    now: Setting,
    error: Callable[[Setting], float],
    changes: Iterable[str],
    names: Names,
    tolerance: float | None,
) -> Cure | None:
    """The cheapest setting that keeps a tolerance (None: an error of 0.1) which `now` misses.

    Tried are, in this order, and the cheapest of the first that helps is taken: the other
    integrators and one of the `changes` at the same step; shorter steps with each integrator; both
    together. `error` of a setting is what is held against the tolerance.
    """
    search = _Search(now, error, RUINED if tolerance is None else tolerance)
    listed = list(changes)
    stepped = now.timestep > 0.0 and search.keeps(now._replace(timestep=0.0))
    changed = [now._replace(change=change) for change in listed]
    found = search.first([*(search.integrators(now) if stepped else ()), *changed])
    if found is None and stepped:
        found = search.shorter(now)
    for other in changed if found is None and now.timestep > 0.0 else ():
        if search.keeps(other._replace(timestep=0.0)):
            found = search.first(search.integrators(other)) or search.shorter(other)
        if found is not None:
            break
    if found is None:
        return None
    off = search.known[found]
    within = f"below {RUINED:g}" if tolerance is None else tolerance_statement(off, tolerance)
    how = _how(now, found, names)
    return Cure(found, off, f"{how}: tried, the motion is then off by {off:.2e}, {within}.")


def _how(now: Setting, cure: Setting, names: Names) -> str:
    """What to do, beginning with a capital."""
    parts = [cure.change] if cure.change else []
    if cure.integrator != now.integrator:
        parts.append(names.integrator.format(cure.integrator))
    if cure.timestep != now.timestep:
        parts.append(names.timestep.format(f"{cure.timestep:g}"))
    if cure.timing != now.timing:
        parts.append(names.timing)
    how = " and ".join(parts)
    return f"{how[0].upper()}{how[1:]}"


class _Search:
    """Settings that were tried, each once."""

    def __init__(self, now: Setting, error: Callable[[Setting], float], tolerance: float) -> None:
        self.now = now
        self.error = error
        self.tolerance = tolerance
        self.known: dict[Setting, float] = {}

    def keeps(self, setting: Setting) -> bool:
        """Whether a setting keeps the tolerance."""
        if setting not in self.known:
            self.known[setting] = self.error(setting)
        return keeps_tolerance(self.known[setting], self.tolerance)

    def first(self, settings: Iterable[Setting]) -> Setting | None:
        """The cheapest that keeps it."""
        return next((s for s in sorted(settings, key=lambda s: s.cost) if self.keeps(s)), None)

    def integrators(self, setting: Setting) -> list[Setting]:
        """The same with each integrator; where timing was refused, without it and with it."""
        timings = (False, None) if setting.timing is False else (setting.timing,)
        return [
            setting._replace(integrator=name, timing=timing)
            for timing in timings
            for name in dict.fromkeys((setting.integrator, *TRIED))
            if (name, timing) != (self.now.integrator, self.now.timing) or setting.change
        ]

    def shorter(self, setting: Setting) -> Setting | None:
        """The cheapest with a shorter step."""
        best: Setting | None = None
        every = [setting, *self.integrators(setting)]
        for one in sorted(dict.fromkeys(every), key=lambda s: s.cost):
            top = one.timestep
            if best is not None:  # a step that would be cheaper
                top = min(top, round_down(1.02 * one.cost * one.timestep / best.cost))
                if not self.keeps(one._replace(timestep=top)):
                    continue
            found = self._largest(one, top)
            if found is not None and (best is None or found.cost < best.cost):
                best = found
        return best

    def _largest(self, setting: Setting, top: float) -> Setting | None:
        """The largest step up to `top`, and below that of now, that keeps the tolerance, to 9 %."""
        low, high = top, self.now.timestep
        while not self.keeps(setting._replace(timestep=low)):
            off = self.known[setting._replace(timestep=low)]
            # the error falls with the square of the step
            share = np.sqrt(0.5 * self.tolerance / off) if np.isfinite(off) else SHRUNK[1]
            high, low = low, round_down(low * float(np.clip(share, *SHRUNK)))
            if low < SHORTEST * self.now.timestep:
                return None
        for _ in range(BISECTIONS):
            middle = round_down((low * high) ** 0.5)
            if not low < middle < high:
                break
            kept = self.keeps(setting._replace(timestep=middle))
            low, high = (middle, high) if kept else (low, middle)
        return setting._replace(timestep=low)


def round_down(value: float) -> float:
    """A step with two digits."""
    digit = 10.0 ** (np.floor(np.log10(value)) - 1.0)
    return float(f"{np.floor(value / digit * (1.0 + 1e-12)) * digit:.2g}")
