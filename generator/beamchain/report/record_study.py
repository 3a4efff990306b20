"""study.json: every point, what it takes to reach a target, the machine."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from beamchain.caution import warnings_record
from beamchain.studies.front import Metric, Reach
from beamchain.studies.scenario import Scenario

if TYPE_CHECKING:
    from beamchain.studies.study import Study


def study_record(study: "Study") -> dict[str, Any]:
    """What study.json holds; `points`, `rigid_hub` and `to_reach` are the contract, the rest is added."""
    import beamchain
    from beamchain.engine.library import machine

    scenario = study.scenario
    return {
        "name": study.spec.name,
        "beamchain": beamchain.__version__,
        "machine": machine(),
        "scenario": {
            "duration": scenario.duration,
            "times": scenario.profile.times,
            "wrench": scenario.profile.wrench,
            "watched": scenario.watched,
            "largest_elastic_motion": scenario.largest,
        },
        "reference": _reference(scenario),
        "points": [point._asdict() for point in study.points],
        "notes": [
            {
                "model": ladder.entry.model,
                "n": ladder.entry.n,
                "integrator": ladder.entry.integrator,
                "note": ladder.note,
            }
            for ladder in study.ladders
        ],
        "rigid_hub": study.rigid_hub,
        "to_reach": _to_reach(study, "error"),
        "to_reach_appendage": _to_reach(study, "error_appendage"),
        "growth": {
            "step": study.growth.step,
            "step_exponent": study.growth.exponent,
            "fit": study.growth.fit,
            "fit_exponent": study.growth.fit_exponent,
        },
        **warnings_record(study.warnings),
        "seconds": study.seconds,
    }


def _reference(scenario: Scenario) -> dict[str, Any]:
    """What the motions were compared with, and how good it is."""
    if scenario.large is None:
        return {"kind": "linear", "nonlinear": scenario.nonlinear}
    figures = scenario.large.figures
    return {"kind": "large motion", **asdict(figures), "error": figures.error}


def _to_reach(study: "Study", metric: Metric) -> dict[str, Any]:
    from beamchain.studies.front import TARGETS, power

    out: dict[str, Any] = {}
    for target in TARGETS:
        best = study.best(target, metric)
        if best is None:
            out[power(target)] = None
            continue
        rivals = study.rivals(target, metric)
        out[power(target)] = {
            **best.point._asdict(),
            "rivals": {model: reach.seconds / best.seconds for model, reach in rivals.items()},
            "rival_points": {model: _reach(reach) for model, reach in rivals.items()},
        }
    return out


def _reach(reach: Reach) -> dict[str, Any]:
    point = reach.point
    return {
        "n": point.n,
        "integrator": point.integrator,
        "timestep": point.timestep,
        "seconds": reach.seconds,
        "extrapolated": reach.extrapolated,
        "slope": reach.slope,
    }
