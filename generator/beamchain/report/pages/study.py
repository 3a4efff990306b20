"""The page of `study`: what each second of computing buys."""

import math
from typing import TYPE_CHECKING

from beamchain.report import study_plots
from beamchain.report.formats import short
from beamchain.report.page import Verdict, page_text
from beamchain.report.svg import to_svg
from beamchain.report.tables.study import point_table, reach_table
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
        points=point_table(study),
        commands=commands(study),
        feeding=how_to_feed(study),
    )
    return page, pictures


def scenario_sentence(study: "Study") -> str:
    """What was simulated."""
    scenario = study.scenario
    names = (
        "x displacement",
        "y displacement",
        "z displacement",
        "x rotation",
        "y rotation",
        "z rotation",
    )
    watched = ", ".join(names[i] for i in scenario.watched)
    size = float(abs(scenario.profile.wrench).max())
    return (
        f"{scenario.duration:g} s; a wrench of up to {size:.3g} (N, N m) on the hub until "
        f"{scenario.profile.times[-1]:g} s; compared: the hub's {watched}, against "
        f"{reference_sentence(study)}"
    )


def reference_sentence(study: "Study") -> str:
    """What the motions are compared with, and how good that is."""
    text = "the exact linear motion of hub and beam"
    share = study.scenario.nonlinear
    if not math.isfinite(share):
        return f"{text}; how much large motion changes could not be simulated."
    return (
        f"{text}, from which large motion differs by about {max(share, 1e-12):.1g} of the "
        "largest elastic part."
    )


def answer(study: "Study") -> str:
    """The answer in one sentence."""
    best = study.best(1e-3, "error") or study.best(1e-2, "error")
    if best is None:
        nearest = study.nearest("error")
        near = (
            ""
            if nearest is None
            else f"; {nearest.model} with n = {nearest.n} comes to {nearest.error:.2g}"
        )
        return (
            f"No setting of ours reached an error of 1e-2 within the budget{near}: raise --budget."
        )
    target = 1e-3 if study.best(1e-3, "error") else 1e-2
    point = best.point
    rivals = study.rivals(target, "error")
    near = min(rivals.values(), key=lambda r: r.seconds, default=None)
    text = (
        f"For an error of {target:g}, take {point.model} with n = {point.n}, {point.integrator}, "
        f"step {point.timestep:.4g} s: {1e3 * best.seconds:.3g} ms for {study.scenario.duration:g} "
        "s."
    )
    if near is None:
        return text
    return (
        f"{text} The nearest rival, {near.model}, takes {short(near.seconds / best.seconds)} "
        f"times as long."
    )


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
