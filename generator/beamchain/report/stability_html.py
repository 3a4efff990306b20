"""The report of `stability`: steps that hold, what they do to the modes, how far a chain may be driven."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from beamchain.fitting.spec import read_spec
from beamchain.fitting.spec_text import spec_toml
from beamchain.report.page import Block, Lines, Picture, Section, Table, Text, begun, inline, page_text, versions
from beamchain.report.plots import percent, short, to_svg
from beamchain.report.sections import step_words
from beamchain.report.stability_plots import damping_figure, steps_figure
from beamchain.report.verdict import Verdict

if TYPE_CHECKING:
    from beamchain.steps.budget import Budget
    from beamchain.steps.large_motion import LargeMotion
    from beamchain.studies.stability import StabilityStudy

AGREE = 0.01  # predicted and measured limits; the command's own bound


def stability_report(study: "StabilityStudy", source: Path) -> str:
    """The text of the page.

    Args:
        study: what is told.
        source: SPEC.toml or MODEL.xml.
    """
    budgets = study.budgets
    parts = [Section("What was asked", [_asked(study, source)])]
    own = {budget.name.split()[0] for budget in budgets if budget.name}
    if study.warnings:
        parts.append(Section("Before you use it", [Lines([begun(t, own) for t in study.warnings])]))
    parts.append(
        Section("Largest stable step", [_limits(study), *(_steps(study, b, i) for i, b in enumerate(budgets))])
    )
    parts.append(Section("Steps for an accuracy", [_accuracy(b) for b in budgets]))
    parts.append(
        Section("Damping that the step adds", [block for i, b in enumerate(budgets) for block in _damping(b, i)])
    )
    if study.large:
        parts.append(Section("Large motion", [_large(study.large)]))
    parts.append(Section("To reproduce", _reproduce(source)))
    return page_text("stability.html", name=source.stem, sections=parts, verdict=_verdict(study), versions=versions())


def _verdict(study: "StabilityStudy") -> Verdict:
    limits = study.budgets[0]
    largest = {k: v for k, v in limits.largest_step.items() if math.isfinite(v)}
    safest = min(largest, key=lambda name: largest[name])
    text = f"{limits.name}: every integrator is stable up to a step of {short(largest[safest])} s"
    others = [
        f"{name} up to {short(v)} s" for name, v in largest.items() if v > 1.05 * largest[safest] and name == "RK4"
    ]
    text += f" ({', '.join(others)})" if others else ""
    worst = max((abs(row.difference) for row in study.rows), default=0.0)
    text += f"; simulations agree with the prediction within {percent(worst)}."
    return Verdict(worst <= AGREE and not study.warnings, text)


def _asked(study: "StabilityStudy", source: Path) -> Table:
    rows = [("file", source.name)]
    rows += [
        (b.name, f"{len(b.frequencies)} modes, {b.frequencies[0]:.6g} to {b.frequencies[-1]:.6g} rad/s")
        for b in study.budgets
    ]
    return Table(rows, words=True)


def _limits(study: "StabilityStudy") -> Table:
    rows = [
        [
            row.name, row.integrator, step_words(row.predicted), step_words(row.measured),
            percent(row.difference) if math.isfinite(row.predicted) else "",
        ]
        for row in study.rows
    ]  # fmt: skip
    note = (
        "Predicted: from the model's own mass, stiffness and damping at rest. Measured: the step at which simulated "
        "motion starts to grow, found by bisection with no theory in it. A host that integrates MuJoCo's "
        "accelerations with its own Runge-Kutta 4 has RK4's limit."
    )
    return Table(rows, ["model", "integrator", "predicted, s", "measured, s", "difference"], note=note, named=True)


def _steps(study: "StabilityStudy", limits: "Budget", number: int) -> Picture:
    rows = [row for row in study.rows if row.name == limits.name]
    svg = to_svg(steps_figure(limits, rows), f"steps{number}")
    label = f"{limits.name}: largest stable step and steps for an accuracy, per integrator."
    return Picture(inline(svg, label), f"{limits.name}. Thick stroke: first mode within 0.1 %; thin: within 1 %.")


def _accuracy(limits: "Budget") -> Table:
    rows = [[name, step_words(one), step_words(tenth)] for name, (one, tenth) in limits.accuracy.items()]
    head = ["integrator", "within 1 % up to, s", "within 0.1 % up to, s"]
    note = f"Of the frequency of the slowest mode, {limits.frequencies[0]:.6g} rad/s; never beyond the stable step."
    return Table(rows, head, caption=limits.name, note=note)


def _damping(limits: "Budget", number: int) -> list[Block]:
    rows = [
        [
            f"{w:.6g}", f"{z:.4g}",
            *("unstable" if math.isnan(v[i, 1]) else _ratio(float(v[i, 1])) for v in limits.shown.values()),
        ]
        for i, (w, z) in enumerate(zip(limits.frequencies, limits.ratios, strict=True))
    ]  # fmt: skip
    head = ["mode, rad/s", "the structure's own", *limits.shown]
    caption = f"{limits.name}: damping ratio shown at a step of {short(limits.timestep)} s"
    drawn = to_svg(damping_figure(limits), f"damping{number}")
    label = f"{limits.name}: damping ratio of every mode, the structure's own and as each integrator shows it."
    told = f"{limits.name}. What stands above the structure's own is the integrator's."
    return [Table(rows, head, caption=caption), Picture(inline(drawn, label), told, "zoom")]


def _ratio(value: float) -> str:
    return "0" if abs(value) < 1e-12 else f"{value:.4g}"


def _large(found: Mapping[str, "LargeMotion"]) -> Table:
    def told(value: float) -> str:
        return "beyond" if math.isinf(value) else short(value)

    rows = [[port, told(v.spin), told(v.acceleration), told(v.slew)] for port, v in found.items()]
    head = ["plane", "spin, rad/s", "root acceleration, m/s²", "slew, rad/s²"]
    note = (
        "Up to here the chain stays within 1 % of a chain of 60 links of the same beam: its frequencies in spin, the "
        "displacement of its mass centre and the moment at its root under acceleration and slew. Beyond: not "
        "before the mass centre is displaced by half the length, or 30 first frequencies of spin."
    )
    return Table(rows, head, note=note)


def _reproduce(source: Path) -> list[Block]:
    command = Text(f"beamchain stability {source.name} -o {source.stem}-stability", "code")
    if source.suffix.lower() == ".xml":
        return [command]
    return [Text(f"Save the lines below as {source.name}, then:"), command, Text(spec_toml(read_spec(source)), "code")]
