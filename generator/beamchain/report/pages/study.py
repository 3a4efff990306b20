"""The page of `study`: what each second of computing buys."""

import math
from typing import TYPE_CHECKING

from beamchain.report import study_plots
from beamchain.report.formats import short
from beamchain.report.page import Verdict, page_text
from beamchain.report.svg import to_svg
from beamchain.report.tables.study import reach_table
from beamchain.studies.pareto import TARGETS, power, recommended_name

if TYPE_CHECKING:
    from beamchain.studies.study import Study


def study_page(study: "Study") -> tuple[str, dict[str, str]]:
    """The text of study.html, and the SVG files to stand beside it, by name."""
    pictures = {"error_against_run_time.svg": to_svg(study_plots.pareto_figure(study), "pareto")}
    machine = ", ".join(f"{key} {value}" for key, value in study.as_dict()["machine"].items())
    page = page_text(
        "study.html",
        name=study.spec.name,
        verdict=Verdict(
            study.best(1e-3, "error") is not None and not study.warnings, answer(study)
        ),
        versions=f"Measured in {study.seconds:.0f} s. {machine}",
        study=study,
        pictures=pictures,
        scenario=scenario_sentence(study),
        to_reach=reach_table(study),
        commands=commands(study),
        feeding=how_to_feed(study),
    )
    return page, pictures


def scenario_sentence(study: "Study") -> str:
    """What was simulated."""
    scenario = study.scenario
    names = [f"{axis} {kind}" for kind in ("displacement", "rotation") for axis in "xyz"]
    watched = ", ".join(names[i] for i in scenario.watched)
    size = float(abs(scenario.profile.wrench).max())
    reference = "; how much large motion changes could not be simulated."
    if math.isfinite(scenario.nonlinear):
        share = f"{max(scenario.nonlinear, 1e-12):.1g} of the largest elastic part."
        reference = f", from which large motion differs by about {share}"
    return (
        f"{scenario.duration:g} s; a wrench of up to {size:.3g} (N, N m) on the hub until "
        f"{scenario.profile.times[-1]:g} s; compared: the hub's {watched}, against the exact "
        f"linear motion of hub and beam{reference}"
    )


def answer(study: "Study") -> str:
    """The answer in one sentence."""
    target = 1e-3 if study.best(1e-3, "error") else 1e-2
    best = study.best(target, "error")
    if best is None:
        point = study.nearest("error")
        if point is None:
            return "No setting of ours was measured within the budget: raise --budget."
        notes = [ladder.note for ladder in study.ladders if ladder.entry == point.entry]
        cut = any(note.startswith("stopped") for note in notes)
        cure = "raise --budget" if cut else "study more modes, by larger numbers in [modes]"
        return (
            f"No setting of ours reached an error of 1e-2; {point.model} with n = {point.n} comes "
            f"to {point.error:.2g}: {cure}."
        )
    point = best.point
    text = (
        f"For an error of {target:g}, take {point.model} with n = {point.n}, {point.integrator}, "
        f"step {point.timestep:.4g} s: {1e3 * best.seconds:.3g} ms for {study.scenario.duration:g} "
        "s."
    )
    if rivals := study.rivals(target, "error").values():
        near = min(rivals, key=lambda rival: rival.seconds)
        longer = short(near.seconds / best.seconds)
        text += f" The nearest rival, {near.model}, takes {longer} times as long."
    return text


def commands(study: "Study") -> list[str]:
    """Command lines that make the recommended chains from the specs written beside the report."""
    return [
        f"beamchain fit {recommended_name(target)} -o {study.spec.name}_{power(target)}"
        for target in TARGETS
        if study.best(target, "error") is not None
    ]


def how_to_feed(study: "Study") -> list[str]:
    """What to know before a recommended chain is run:
    one that is exact in time is so for its step and its input."""
    bests = [study.best(target, "error") for target in TARGETS]
    if not any(best is not None and best.entry.timed for best in bests):
        return []
    return [
        "A chain exact in time is made for one step and Euler, and measured under the mean of each "
        "step's wrench and the one before (beamchain.HeldInput); give it its inputs so, or its "
        "whole motion is half a step early."
    ]
