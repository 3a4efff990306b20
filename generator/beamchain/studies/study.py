"""`study`: error against run time of every sensible model of an appendage on its hub,
measured on the spot."""

import statistics
import time
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from msgspec import structs

from beamchain import report
from beamchain.checks import list_of_names, number, positive
from beamchain.engine.jobs import Progress, check_workers, run_jobs
from beamchain.engine.library import one_thread
from beamchain.errors import InputError
from beamchain.files import to_json, write_files
from beamchain.fitting.body import body_of
from beamchain.fitting.hub import default_hub
from beamchain.fitting.options import FitOptions, Modes, Root, Scene
from beamchain.fitting.select import select
from beamchain.fitting.spec import Spec, read_spec, spec_from_dict
from beamchain.fitting.spec_text import spec_toml
from beamchain.steps.driven import driven, limit_sentences
from beamchain.steps.large_motion import large_motion
from beamchain.studies import field, pareto
from beamchain.studies.field import Entry, Task
from beamchain.studies.large_motion import LINEAR, nonlinear_share
from beamchain.studies.pareto import TARGETS, Metric, Reach, recommended_name
from beamchain.studies.run_time import Ladder, Point, climb
from beamchain.studies.scenario import Scenario, make_scenario, parse_profile
from beamchain.warning_codes import Caution, at

FULL_MODES = 30  # of the beam on the hub: one mode fewer changes the reference by less than 1e-9
BUDGET = 0.1  # [s] for the errors of one entry


class Options(NamedTuple):
    """What a study may be told; see `study`."""

    profile: str | None = None
    duration: float | None = None
    budget: float = BUDGET
    models: tuple[str, ...] = ()
    amplitude: float | None = None


@dataclass(frozen=True, eq=False)
class Study:
    """Everything measured.

    Below, `target` is an error, relative to the largest elastic part of the motion, and `metric`
    which one: "error", of the hub's motion, or "error_appendage", the same without what the
    integrator makes of the rigid hub.

    Args:
        spec: what was studied.
        options: how it was studied.
        kept: modes per port of the spec; the planes' numbers were varied.
        scenario: the load and the motion that it makes.
        ladders: per entry, its points.
        seconds: taken by the study [s].
        warnings: where the load drives a recommended chain beyond what it is right for.

    Example:
        >>> import beamchain as bc
        >>> from importlib.resources import files
        >>> spec = bc.read_spec(files("beamchain") / "examples" / "seed_boom.toml")
        >>> measured = bc.study(spec, models=["exact, clamped"], duration=2.0, budget=0.01)
        >>> measured.best(
        ...     1e-9, "error"
        ... ) is None  # else a `Reach`: seconds, and the `Point` with n, integrator and step
        True
        >>> nearest = measured.nearest("error")  # the `Point` with the least error
    """

    spec: Spec
    options: Options
    kept: dict[str, int]
    scenario: Scenario
    ladders: tuple[Ladder, ...]
    seconds: float
    warnings: tuple[str, ...] = ()

    @property
    def points(self) -> list[Point]:
        """Every setting measured, the rigid hub left out."""
        return [
            p
            for ladder in self.ladders
            if ladder.entry.model != field.RIGID_HUB
            for p in ladder.points
        ]

    @cached_property
    def rigid_hub(self) -> dict[str, float]:
        """Per integrator, time per step of the rigid hub alone [s]."""
        return {
            ladder.entry.integrator: statistics.median(p.seconds_per_step for p in ladder.points)
            for ladder in self.ladders
            if ladder.entry.model == field.RIGID_HUB and ladder.points
        }

    @property
    def models(self) -> list[str]:
        """Names of the models measured, ours first."""
        return list(dict.fromkeys(p.model for p in self.points))

    def reach(self, target: float, metric: Metric) -> dict[str, Reach]:
        """Per model, the cheapest setting for a `target` in a `metric`."""
        found = {model: pareto.reach(self.ladders, model, target, metric) for model in self.models}
        return {model: reach for model, reach in found.items() if reach is not None}

    def best(self, target: float, metric: Metric) -> Reach | None:
        """The cheapest measured setting for a `target` in a `metric` among our chains,
        which keep their geometry."""
        ours = [r for r in self.reach(target, metric).values() if r.model in field.OURS]
        return min(ours, key=lambda r: r.seconds, default=None)

    def nearest(self, metric: Metric) -> Point | None:
        """The most accurate of our own chains in a `metric`, whatever it takes."""
        found = pareto.front([x for x in self.ladders if x.entry.ours], metric)
        return found[-1][1] if found else None

    def rivals(self, target: float, metric: Metric) -> dict[str, Reach]:
        """The rivals' cheapest settings for a `target` in a `metric`, of those that reach it."""
        return {
            model: r for model, r in self.reach(target, metric).items() if model not in field.OURS
        }

    def short_of(self, target: float, metric: Metric) -> dict[str, float]:
        """Rivals that do not reach the `target`, with the best error of each in that `metric`."""
        reached = self.reach(target, metric)
        fronts = {
            m: pareto.front([x for x in self.ladders if x.entry.model == m], metric)
            for m in self.models
        }
        return {
            m: f[-1][0] for m, f in fronts.items() if f and m not in reached and m not in field.OURS
        }

    def recommended(self, target: float, metric: Metric) -> Spec | None:
        """The spec that gives the best setting for a `target` in a `metric`;
        one exact in time is for that step and Euler."""
        best = self.best(target, metric)
        if best is None:
            return None
        entry = best.entry
        timestep = best.point.timestep
        fit = FitOptions()
        damping = self.spec.damping
        if entry.timed:
            fit = FitOptions(springs="modes")
            damping = None if damping is None else structs.replace(damping, form="modal")
        return structs.replace(
            self.spec,
            modes=Modes(**field.sizes(self.kept, entry.n)),
            root=Root(target=field.target_of(entry.model), hub=self.spec.root.hub),
            scene=structs.replace(
                self.spec.scene or Scene(), integrator=entry.integrator, timestep=timestep
            ),
            fit=fit,
            damping=damping,
        )

    def as_dict(self) -> dict[str, Any]:
        """What study.json holds."""
        return report.study_record(self)

    def write(self, folder: Path, *, force: bool = False) -> list[Path]:
        """Write study.html, the picture, the recommended specs and study.json (last) into
        `folder`; all or none.

        Raises:
            OutputError: a file exists and `force` is False, or the folder cannot be written.
        """
        page, pictures = report.study_page(self)
        files: dict[Path, str | bytes] = {
            folder / name: content for name, content in pictures.items()
        }
        for target in TARGETS:
            spec = self.recommended(target, "error")
            if spec is not None:
                files[folder / recommended_name(target)] = spec_toml(spec)
        files[folder / "study.html"] = page
        files[folder / "study.json"] = to_json(self.as_dict())
        write_files(files, force=force)
        return list(files)


@one_thread()
def study(
    spec: Spec | str | Path,
    *,
    models: Sequence[str] = (),
    duration: float | None = None,
    budget: float = BUDGET,
    profile: str | None = None,
    amplitude: float | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> Study:
    """Measure error against run time for models of an appendage on its hub,
    as `beamchain study` does.

    Args:
        spec: the appendage and hub, or the path of a SPEC.toml; without a hub,
            one of ten times the appendage's mass.
        models: names of the models to run, such as "exact, hub", "exact, clamped" or "equal links,
            classical"; all where empty, which takes minutes.
        duration: simulated time [s]; default: four periods of the slowest mode.
        budget: simulation time spent per model, size and integrator [s].
        profile: CSV text of the wrench on the hub, columns time [s], fx fy fz [N], mx my mz [N m];
            default: a doublet.
        amplitude: of the doublet [N, N m]; small enough to stay linear where left out.
        workers: processes, with which timings are less accurate; default: as
            `joblib.parallel_config` says, else this one.
        progress: called after every entry with the number of finished entries and the total.

    Returns:
        The study: every point measured (`points`), the cheapest setting for an error (`best`),
        its rivals (`rivals`), files (`write`).

    Raises:
        InputError: a model's name is unknown, the profile cannot be used,
            or profile and amplitude are both given.
        EngineError: no chain can be simulated under the load, or a worker process died.

    Example:
        >>> import beamchain as bc
        >>> from importlib.resources import files
        >>> spec = bc.read_spec(files("beamchain") / "examples" / "seed_boom.toml")
        >>> measured = bc.study(spec, models=["exact, clamped"], duration=2.0, budget=0.01)
        >>> measured.points[0].model
        'exact, clamped'
    """
    start = time.perf_counter()
    spec = spec if isinstance(spec, Spec) else read_spec(spec)
    duration = None if duration is None else number("duration", duration, "s")
    amplitude = None if amplitude is None else positive("amplitude", amplitude, "N, N m")
    budget = number("budget", budget, "s")
    check_workers(workers)
    options = Options(profile, duration, budget, tuple(list_of_names("models", models)), amplitude)
    if profile is not None and amplitude is not None:
        raise InputError(
            "profile and amplitude are both given; the amplitude is the doublet's: leave one out."
        )
    text = spec_toml(spec)
    task, scenario = prepare(text, options)
    wanted = field.entries(task)
    known = dict.fromkeys(e.model for e in wanted)
    for name in options.models:
        if name not in known:
            raise InputError(
                f"model {name!r} is not in the field; choose from {', '.join(map(repr, known))}."
            )
    if options.models:
        wanted = [e for e in wanted if e.model in (*options.models, field.RIGID_HUB)]
    jobs = [(text, scenario, options.budget, entry) for entry in wanted]
    ladders = run_jobs(measure_entry, jobs, workers=workers, progress=progress)
    found = Study(spec, options, task.kept, scenario, tuple(ladders), 0.0)
    return replace(found, warnings=_load_warnings(task, found), seconds=time.perf_counter() - start)


def _load_warnings(task: Task, found: Study) -> tuple[str, ...]:
    """What the load drives the recommended chains through,
    beyond where they stay near a fine one."""
    scenario = found.scenario
    moments = np.linspace(0.0, scenario.duration, 4001)
    run = driven(scenario.motion(moments), float(moments[1]), np.asarray(task.hub.offset))
    best = {
        r.point[:2]: r.point for target in TARGETS if (r := found.best(target, "error")) is not None
    }
    nearest = found.nearest("error")
    if not best and nearest is not None:
        best = {nearest[:2]: nearest}
    out: list[str] = []
    if scenario.nonlinear > LINEAR:
        text = (
            "errors are against the linear motion, from which large motion differs by "
            f"{scenario.nonlinear:.2g} of the largest elastic part: errors below that are not to "
            "be relied on; give a smaller load."
        )
        out.append(Caution("large-motion", text))
    for point in best.values():
        chain = field.chain_of(task, point.entry)
        radius = max(float(task.hub.offset[0]), 0.0)
        limits = {
            port: large_motion(chain, task.beam, port, modes=point.n, radius=radius)
            for port in task.planes
        }
        out += [
            at(f"{point.model}, n = {point.n}", sentence)
            for sentence in limit_sentences(limits, run)
        ]
    return tuple(out)


def measure_entry(text: str, scenario: Scenario, budget: float, entry: Entry) -> Ladder:
    """One job: all points of one entry. A worker builds the task once."""
    return climb(make_task(text), scenario, entry, budget)


@lru_cache(maxsize=4)
def make_task(text: str) -> Task:
    """The task of a spec, given as the text of its TOML so that workers can share it."""
    spec = spec_from_dict(tomllib.loads(text))
    beam = spec.beam
    hub = spec.root.hub or default_hub(spec.beam.line)
    kept = dict(select(body_of(spec.replace(hub=hub))).counts) if spec.chooses else spec.kept
    if not kept:
        raise InputError(
            f"the scene needs no mode of {spec.name!r}: a rigid body keeps its promise, and there "
            "is nothing to study; give a wider scene.bandwidth or a smaller scene.tolerance."
        )
    full = {port: spec.with_ratios(port, beam.port(port, FULL_MODES)) for port in kept}
    return Task(beam, full, kept, hub, spec.damping is None or spec.damping.form == "modal")


@lru_cache(maxsize=4)
def prepare(text: str, options: Options) -> tuple[Task, Scenario]:
    """Task and scenario of a spec's TOML text.

    A default doublet that moves the appendage so far that it shows is made smaller; with a profile
    or amplitude of the user's, the study warns of it.
    """
    task = make_task(text)
    profile = None if options.profile is None else parse_profile(options.profile, "--profile")
    scenario = make_scenario(task, profile, options.duration, options.amplitude)
    changed = nonlinear_share(task, scenario)
    while profile is None and options.amplitude is None and changed > LINEAR:
        scenario = scenario.scaled(0.1)  # a heavy hub hardly moves while its appendage bends far
        changed = nonlinear_share(task, scenario)
    return task, replace(scenario, nonlinear=changed)
