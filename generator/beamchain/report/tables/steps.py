"""Tables of time steps: what each integrator of MuJoCo allows."""

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

from beamchain.report.formats import step_text
from beamchain.report.table import Column, Table
from beamchain.steps.modal import TimingMark

if TYPE_CHECKING:
    from beamchain.steps.budget import Budget
    from beamchain.steps.limits import StepLimits


def step_table(limits: "StepLimits | Budget", title: str = "Largest time step") -> Table:
    """The largest steps that are stable, and those that keep the slowest mode."""
    accuracy = [limits.accuracy.get(name, (None, None)) for name in limits.largest_step]
    columns = (
        Column("integrator", list(limits.largest_step)),
        Column("stable up to", list(limits.largest_step.values()), "s", step_text),
        Column("first mode within 1 % up to", [one for one, _ in accuracy], "s", step_text),
        Column("within 0.1 % up to", [tenth for _, tenth in accuracy], "s", step_text),
    )
    return Table(title, columns)


def timing_sentences(made_for: Iterable[TimingMark], without: str) -> list[str]:
    """What appendages have timing for, and what of the tables is `without` it."""
    return [
        f"the appendages have timing for {made.integrator} at {made.timestep:g} s; {without}"
        for made in made_for
    ]


def step_sentence(limits: "StepLimits") -> str:
    """The largest stable steps on one line."""
    steps = (
        f"{integrator} {step_text(largest)}{' s' * math.isfinite(largest)}"
        for integrator, largest in limits.largest_step.items()
    )
    return f"largest stable step: {', '.join(steps)}"
