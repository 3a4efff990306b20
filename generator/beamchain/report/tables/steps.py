"""Tables of time steps: what each integrator of MuJoCo allows."""

from collections.abc import Iterable, Mapping
from typing import Protocol

from beamchain.report.formats import step_text
from beamchain.report.table import Column, Table
from beamchain.steps.modal import TimingMark


class Limits(Protocol):
    """Step limits per integrator [s]."""

    @property
    def largest_step(self) -> Mapping[str, float]:
        """Stable up to here."""
        ...

    @property
    def accuracy(self) -> Mapping[str, tuple[float, float]]:
        """Within 1 % and 0.1 % of the slowest mode up to here."""
        ...


def step_table(limits: Limits, title: str = "Largest time step") -> Table:
    """The largest steps that are stable, and those that keep the slowest mode."""
    integrators = list(limits.largest_step)
    accuracy = [limits.accuracy.get(name, (None, None)) for name in integrators]
    largest = list(limits.largest_step.values())
    within_percent = [one_percent for one_percent, _ in accuracy]
    within_tenth = [tenth for _, tenth in accuracy]
    columns = (
        Column("integrator", integrators),
        Column("stable up to", largest, "s", step_text),
        Column("first mode within 1 % up to", within_percent, "s", step_text),
        Column("within 0.1 % up to", within_tenth, "s", step_text),
    )
    return Table(title, columns)


def timing_sentences(made_for: Iterable[TimingMark], without: str) -> list[str]:
    """What appendages have timing for, and what of the tables is `without` it."""
    return [
        f"the appendages have timing for {made.integrator} at {made.timestep:g} s; {without}"
        for made in made_for
    ]


def step_sentence(limits: Limits) -> str:
    """The largest stable steps on one line."""
    steps = []
    for integrator, largest in limits.largest_step.items():
        unit = "" if largest == float("inf") else " s"
        steps.append(f"{integrator} {step_text(largest)}{unit}")
    return f"largest stable step: {', '.join(steps)}"
