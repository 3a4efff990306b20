"""Tables of time steps: what each integrator of MuJoCo allows."""

import math
from collections.abc import Iterable, Mapping
from operator import itemgetter
from typing import TYPE_CHECKING

from beamchain.report.formats import step_text
from beamchain.report.table import Rows, Table
from beamchain.steps.budget import HOST
from beamchain.steps.modal import TimingMark

if TYPE_CHECKING:
    from beamchain.steps.budget import Budget
    from beamchain.steps.limits import StepLimits


def step_table(limits: "Mapping[str, StepLimits | Budget]", title: str) -> Table:
    """The largest steps that are stable, and those that keep the slowest mode, of each model by its
    name; an only one may have none."""
    rows = [
        (model, integrator, largest, *each.accuracy.get(integrator, (None, None)))
        for model, each in limits.items()
        for integrator, largest in each.largest_step.items()
        if integrator != HOST
    ]
    column = Rows(rows).column
    columns = (
        *((column("model", itemgetter(0)),) if any(limits) else ()),
        column("integrator", itemgetter(1)),
        column("stable up to", itemgetter(2), "s", step_text),
        column("first mode within 1 % up to", itemgetter(3), "s", step_text),
        column("within 0.1 % up to", itemgetter(4), "s", step_text),
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
