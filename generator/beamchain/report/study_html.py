"""The pages of studies: what each second of computing buys; steps that hold, and how far a chain may be driven."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

from beamchain.fitting.spec import read_spec
from beamchain.fitting.spec_text import spec_toml
from beamchain.report import study_plots
from beamchain.report.page import Table, Verdict, page_text
from beamchain.report.plots import percent, short
from beamchain.report.svg import to_svg
from beamchain.studies.front import TARGETS, Metric, Reach, power, recommended_name

if TYPE_CHECKING:
    from beamchain.studies.stability import StabilityStudy
    from beamchain.studies.study import Study

AGREE = 0.01  # predicted and measured limits; the command's own bound
HEAD = ("to reach", "model", "n", "integrator", "step, s", "time, ms", "per step over the rigid hub")


def study_page(study: "Study") -> tuple[str, dict[str, str]]:
    """The text of study.html, and the SVG files to stand beside it, by name."""
    pictures = {
        "error_against_run_time.svg": to_svg(study_plots.pareto_figure(study), "pareto"),
        "growth.svg": to_svg(study_plots.growth_figure(study.growth), "growth"),
    }
    machine = ", ".join(f"{key} {value}" for key, value in study.as_dict()["machine"].items())
    page = page_text(
        "study.html",
        name=study.spec.name,
        verdict=Verdict(study.best(1e-3, "error") is not None and not study.warnings, answer(study)),
        versions=f"Measured in {study.seconds:.0f} s. {machine}",
        study=study,
        pictures=pictures,
        scenario=scenario_sentence(study),
        to_reach=table(study, "error"),
        commands=commands(study),
        feeding=how_to_feed(study),
    )
    return page, pictures


def scenario_sentence(study: "Study") -> str:
    """What was simulated."""
    scenario = study.scenario
    names = ("x displacement", "y displacement", "z displacement", "x rotation", "y rotation", "z rotation")
    watched = ", ".join(names[i] for i in scenario.watched)
    size = float(abs(scenario.profile.wrench).max())
    return (
        f"{scenario.duration:g} s; a wrench of up to {size:.3g} (N, N m) on the hub until "
        f"{scenario.profile.times[-1]:g} s; compared: the hub's {watched}, against {reference_sentence(study)}"
    )


def reference_sentence(study: "Study") -> str:
    """What the motions are compared with, and how good that is."""
    scenario = study.scenario
    if scenario.large is None:
        text, share = "the exact linear motion of hub and beam", scenario.nonlinear
        if not math.isfinite(share):
            return f"{text}; how much large motion changes could not be simulated."
        return (
            f"{text}, from which large motion differs by less than {max(share, 1e-12):.1g} of the largest elastic part."
        )
    figures = scenario.large.figures
    text = (
        f"the motion in large motion, which differs from the linear one by {figures.nonlinear:.2g} of the largest "
        f"elastic part: chains of {', '.join(map(str, figures.links))} links, extrapolated. The last chain changed it "
        f"by {figures.change:.1g}, half the step by {figures.step_change:.1g}; in small motion these chains alone miss "
        f"the exact motion by {figures.small_motion:.1g}, which is taken off."
    )
    if not figures.met:
        text += f" It is no better than {figures.error:.1g}: errors below {10.0 * figures.error:.1g} are not to be relied on."
    return text


def answer(study: "Study") -> str:
    """The answer in one sentence."""
    best = study.best(1e-3, "error") or study.best(1e-2, "error")
    if best is None:
        nearest = study.nearest("error")
        near = "" if nearest is None else f"; {nearest.model} with n = {nearest.n} comes to {nearest.error:.2g}"
        cure = "raise --budget" if study.scenario.large is None else "give a smaller load, or raise --budget"
        return f"No setting of ours reached an error of 1e-2 within the budget{near}: {cure}."
    target = 1e-3 if study.best(1e-3, "error") else 1e-2
    point, rivals = best.point, study.rivals(target, "error")
    near = min(rivals.values(), key=lambda r: r.seconds, default=None)
    text = (
        f"For an error of {target:g}, take {point.model} with n = {point.n}, {point.integrator}, "
        f"step {point.timestep:.4g} s: {1e3 * best.seconds:.3g} ms for {study.scenario.duration:g} s."
    )
    if near is None:
        return text
    how = " (extrapolated along its measured slope)" if near.extrapolated else ""
    return f"{text} The nearest rival, {near.model}, takes {short(near.seconds / best.seconds)} times as long{how}."


def row(reach: Reach, label: str, best: float) -> list[str]:
    """One line of the table: measured, or extrapolated and said so."""
    p = reach.point
    ratio = reach.seconds / best
    slower = "" if ratio == 1.0 else f" ({short(ratio)} x)"
    if reach.extrapolated:
        time = f"{short(1e3 * reach.seconds)}{slower}, extrapolated"
        return [label, p.model, "more", p.integrator, "less", time, "-"]
    time = f"{1e3 * reach.seconds:.4g}{slower}"
    return [label, p.model, str(p.n), p.integrator, f"{p.timestep:.4g}", time, f"{p.over_rigid_hub:.2f}"]


def table(study: "Study", metric: Metric) -> Table:
    """What it takes to reach each target: our best, then the rivals."""
    rows: list[list[str]] = []
    for target in TARGETS:
        best = study.best(target, metric)
        rivals = sorted(study.rivals(target, metric).values(), key=lambda r: r.seconds)
        if best is None:
            rows.append([power(target), "none of ours within the budget", "", "", "", "", ""])
            rows += [row(r, "", r.seconds) for r in rivals if not r.extrapolated]
            continue
        rows.append(row(best, power(target), best.seconds))
        rows += [row(r, "", best.seconds) for r in rivals]
        for model, floor in study.short_of(target, metric).items():
            rows.append(["", model, "any", "any", "any", f"never: {floor:.2g} at best", "-"])
    return Table(rows, HEAD, caption=study_plots.TITLES[metric], style="named")


def commands(study: "Study") -> list[str]:
    """Command lines that make the recommended chains from the specs written beside the report."""
    return [
        f"beamchain fit {recommended_name(target)} -o {study.spec.name}_{power(target)}"
        for target in TARGETS
        if study.best(target, "error") is not None
    ]


def how_to_feed(study: "Study") -> list[str]:
    """What to know before a recommended chain is run: one that is exact in time is so for its step and its input."""
    bests = [study.best(target, "error") for target in TARGETS]
    if not any(best is not None and best.entry.timed for best in bests):
        return []
    return [
        "A chain exact in time is made for one step and Euler, and measured under the mean of each step's wrench and the "
        "one before (beamchain.HeldInput); give it its inputs so, or its whole motion is half a step early."
    ]


def stability_report(study: "StabilityStudy", source: Path) -> str:
    """The text of the page; `source` is the SPEC.toml or MODEL.xml."""
    drawn: dict[str, str] = {}
    for i, limits in enumerate(study.budgets):
        rows = [row for row in study.rows if row.name == limits.name]
        drawn[f"steps{i}"] = to_svg(study_plots.steps_figure(limits, rows), f"steps{i}")
        drawn[f"damping{i}"] = to_svg(study_plots.damping_figure(limits), f"damping{i}")
    return page_text(
        "stability.html",
        name=source.stem,
        verdict=_steps_hold(study),
        study=study,
        source=source,
        drawn=drawn,
        names={limits.name.split()[0] for limits in study.budgets if limits.name},
        spec="" if source.suffix.lower() == ".xml" else spec_toml(read_spec(source)),
    )


def _steps_hold(study: "StabilityStudy") -> Verdict:
    limits = study.budgets[0]
    largest = {k: v for k, v in limits.largest_step.items() if math.isfinite(v)}
    safest = min(largest, key=lambda name: largest[name])
    text = f"{study.own_step.rstrip('.')}; every integrator is stable up to a step of {short(largest[safest])} s"
    others = [
        f"{name} up to {short(v)} s" for name, v in largest.items() if v > 1.05 * largest[safest] and name == "RK4"
    ]
    text += f" ({', '.join(others)})" if others else ""
    worst = max((abs(row.difference) for row in study.rows), default=0.0)
    text += f"; simulations agree with the prediction within {percent(worst)}."
    return Verdict(worst <= AGREE and not study.warnings, text)
