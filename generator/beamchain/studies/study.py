"""`study`: error against run time of every sensible model of an appendage on its hub, measured on the spot."""

import statistics
import time
import tomllib
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from msgspec import structs

from beamchain import report
from beamchain.caution import at
from beamchain.engine.jobs import Progress, run_jobs, stamp
from beamchain.errors import InputError
from beamchain.files import to_json, write_files
from beamchain.fitting.choose import make_plan, whole_beam
from beamchain.fitting.hub import default_hub
from beamchain.fitting.options import FitOptions, Modes, Root, Scene
from beamchain.fitting.spec import Spec, read_spec, spec_from_dict
from beamchain.fitting.spec_text import spec_toml
from beamchain.steps.driven import driven, exceeded
from beamchain.steps.large_motion import large_motion
from beamchain.studies import field, front
from beamchain.studies.field import Entry, Task
from beamchain.studies.fine_chain import LINEAR, large_reference, nonlinear
from beamchain.studies.front import TARGETS, Metric, Reach, recommended_name
from beamchain.studies.run_time import Growth, Ladder, Point, Run, climb, growth, in_turns
from beamchain.studies.scenario import Scenario, make_scenario, parse_profile

FULL_MODES = 30  # of the beam on the hub: one mode fewer changes the reference by less than 1e-9
BUDGET = 0.1  # [s] for the errors of one entry
DUEL_ROUNDS = 15
DUEL_NEAR = 2.0  # our settings that take up to this many times the best's time to a target are repeated beside it
DUEL_LONGEST = 0.6  # a finalist that simulates longer is not repeated in the duel [s]
STORE = ".study_points.jsonl"


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

    Below, `target` is an error, relative to the largest elastic part of the motion, and `metric` which one: "error", of the hub's
    motion, or "error_appendage", the same without what the integrator makes of the rigid hub.

    Example:
        >>> import beamchain as bc
        >>> from importlib.resources import files
        >>> spec = bc.read_spec(files("beamchain") / "examples" / "seed_boom.toml")
        >>> measured = bc.study(spec, models=["exact, clamped"], duration=2.0, budget=0.01)
        >>> measured.best(1e-9, "error") is None  # else a `Reach`: seconds, and the `Point` with n, integrator and step
        True
        >>> nearest = measured.nearest("error")  # the `Point` with the least error
    """

    spec: Spec  #: what was studied
    options: Options
    kept: dict[str, int]  #: modes per port of the spec; the planes' numbers were varied
    scenario: Scenario
    ladders: tuple[Ladder, ...]  #: per entry, its points
    growth: Growth  #: time against n
    seconds: float  #: taken by the study
    warnings: tuple[str, ...] = ()  #: where the load drives a recommended chain beyond what it is right for

    @property
    def points(self) -> list[Point]:
        """Every setting measured, the rigid hub left out."""
        return [p for ladder in self.ladders if ladder.entry.model != field.RIGID_HUB for p in ladder.points]

    @cached_property
    def rigid_hub(self) -> dict[str, float]:
        """Per integrator, time per step of the rigid hub alone [s]."""
        return _rigid_hub(self.ladders)

    @property
    def models(self) -> list[str]:
        """Names of the models measured, ours first."""
        return list(dict.fromkeys(p.model for p in self.points))

    def reach(self, target: float, metric: Metric) -> dict[str, Reach]:
        """Per model, the cheapest setting for a `target` in a `metric`."""
        found = {model: front.reach(self.ladders, model, target, metric) for model in self.models}
        return {model: reach for model, reach in found.items() if reach is not None}

    def best(self, target: float, metric: Metric) -> Reach | None:
        """The cheapest measured setting for a `target` in a `metric` among our chains, which keep their geometry."""
        ours = [r for r in self.reach(target, metric).values() if r.model in field.OURS and not r.extrapolated]
        return min(ours, key=lambda r: r.seconds, default=None)

    def nearest(self, metric: Metric) -> Point | None:
        """The most accurate of our own chains in a `metric`, whatever it takes."""
        found = front.front([x for x in self.ladders if x.entry.ours], metric)
        return found[-1][1] if found else None

    def rivals(self, target: float, metric: Metric) -> dict[str, Reach]:
        """The rivals' cheapest settings for a `target` in a `metric`, extrapolated where they did not reach it."""
        return {model: r for model, r in self.reach(target, metric).items() if model not in field.OURS}

    def short_of(self, target: float, metric: Metric) -> dict[str, float]:
        """Rivals that do not reach the `target` and cannot be extrapolated, with the best error of each in that `metric`."""
        reached = self.reach(target, metric)
        fronts = {m: front.front([x for x in self.ladders if x.entry.model == m], metric) for m in self.models}
        return {m: f[-1][0] for m, f in fronts.items() if f and m not in reached and m not in field.OURS}

    def recommended(self, target: float, metric: Metric) -> Spec | None:
        """The spec that gives the best setting for a `target` in a `metric`; one exact in time is for that step and Euler."""
        best = self.best(target, metric)
        if best is None:
            return None
        entry, timestep = best.entry, best.point.timestep
        fit = FitOptions(method="least_squares" if entry.model == "least squares" else "exact")
        damping = self.spec.damping
        if entry.timed:
            fit = FitOptions(springs="modes", timestep=timestep)
            damping = None if damping is None else structs.replace(damping, form="modal")
        return structs.replace(
            self.spec,
            modes=Modes(**field.sizes(self.kept, entry.n)),
            root=Root(target=field.target_of(entry.model), hub=self.spec.root.hub),
            scene=structs.replace(self.spec.scene or Scene(), integrator=entry.integrator, timestep=timestep),
            fit=fit,
            damping=damping,
        )

    def as_dict(self) -> dict[str, Any]:
        """What study.json holds."""
        return report.study_record(self)

    def write(self, folder: Path, *, force: bool = False) -> list[Path]:
        """Write study.html, the picture, the recommended specs and study.json (last) into `folder`; all or none.

        Raises:
            OutputError: a file exists and `force` is False, or the folder cannot be written.
        """
        page, pictures = report.study_page(self)
        files: dict[Path, str | bytes] = {folder / name: content for name, content in pictures.items()}
        for target in TARGETS:
            spec = self.recommended(target, "error")
            if spec is not None:
                files[folder / recommended_name(target)] = spec_toml(spec)
        files[folder / "study.html"] = page
        files[folder / "study.json"] = to_json(self.as_dict())
        write_files(files, force=force)
        (folder / STORE).unlink(missing_ok=True)
        return list(files)


def study(
    spec: Spec | str | Path,
    *,
    models: Sequence[str] = (),
    duration: float | None = None,
    budget: float = BUDGET,
    profile: str | None = None,
    amplitude: float | None = None,
    executor: Executor | None = None,
    folder: Path | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> Study:
    """Measure error against run time for models of an appendage on its hub, as `beamchain study` does.

    Args:
        spec: the appendage and hub, or the path of a SPEC.toml; without a hub, one of ten times the appendage's mass.
        models: names of the models to run, such as "exact, hub", "exact, clamped" or "equal links, classical"; all where
            empty, which takes minutes.
        duration: simulated time [s]; default: four periods of the slowest mode.
        budget: simulation time spent per model, size and integrator [s].
        profile: CSV text of the wrench on the hub, columns time [s], fx fy fz [N], mx my mz [N m]; default: a doublet.
        amplitude: of the doublet [N, N m]; small enough to stay linear where left out.
        executor: runs the entries; default: one after the other in this process.
        folder: folder in which measurements are kept until `Study.write` is done, for `resume`.
        resume: continue from the measurements in `folder`.
        progress: called after every entry with the number of finished entries and the total.

    Returns:
        The study: every point measured (`points`), the cheapest setting for an error (`best`), its rivals (`rivals`),
        what large motion changes, files (`write`).

    Raises:
        InputError: a model's name is unknown, the profile cannot be used, or profile and amplitude are both given.
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
    options = Options(profile, duration, budget, tuple(models), amplitude)
    if profile is not None and amplitude is not None:
        raise InputError("--profile and --amplitude are both given; the amplitude is the doublet's: leave one out.")
    text = spec_toml(spec)
    task, scenario = prepare(text, options)
    wanted = field.entries(task)
    known = dict.fromkeys(e.model for e in wanted)
    for name in options.models:
        if name not in known:
            raise InputError(f"model {name!r} is not in the field; choose from {', '.join(map(repr, known))}.")
    if options.models:
        wanted = [e for e in wanted if e.model in (*options.models, field.RIGID_HUB)]
    own = stamp(text, options)
    jobs = {f"{own} {e.model} {e.n} {e.integrator}": (text, scenario, options.budget, tuple(e)) for e in wanted}
    store = None if folder is None else folder / STORE
    results = run_jobs(measure_entry, jobs, executor=executor, store=store, resume=resume, progress=progress)
    ladders = [
        Ladder(Entry(*value["entry"]), [Point(*p) for p in value["points"]], value["note"])
        for value in results.values()
    ]
    if executor is not None:
        ladders = _one_clock(ladders)
    found = Study(spec, options, task.kept, scenario, tuple(ladders), growth(task), 0.0)
    found = replace(found, ladders=tuple(_duel(task, scenario, found)))
    return replace(found, warnings=_too_far(task, found), seconds=time.perf_counter() - start)


def _too_far(task: Task, found: Study) -> tuple[str, ...]:
    """What the load drives the recommended chains through, beyond where they stay near a fine one."""
    scenario = found.scenario
    moments = np.linspace(0.0, scenario.duration, 4001)
    run = driven(scenario.motion(moments), float(moments[1]), np.asarray(task.hub.offset))
    best = {r.point[:2]: r.point for target in TARGETS if (r := found.best(target, "error")) is not None}
    nearest = found.nearest("error")
    if not best and nearest is not None:
        best = {nearest[:2]: nearest}
    out: list[str] = []
    for point in best.values():
        chain = field.chain_of(task, point.entry)
        radius = max(float(task.hub.offset[0]), 0.0)
        limits = {port: large_motion(chain, task.beam, port, modes=point.n, radius=radius) for port in task.planes}
        out += [at(f"{point.model}, n = {point.n}", sentence) for sentence in exceeded(limits, run)]
    return tuple(out)


def measure_entry(text: str, scenario: Scenario, budget: float, entry: Sequence[Any]) -> dict[str, Any]:
    """One job: all points of one entry, as plain data. A worker builds the task once."""
    ladder = climb(make_task(text), scenario, Entry(*entry), budget)
    return {"entry": list(entry), "points": [list(p) for p in ladder.points], "note": ladder.note}


@lru_cache(maxsize=4)
def make_task(text: str) -> Task:
    """The task of a spec, given as the text of its TOML so that workers can share it."""
    spec = spec_from_dict(tomllib.loads(text))
    beam, hub = spec.beam, spec.root.hub or default_hub(spec.beam)
    kept = spec.kept
    if spec.chooses:
        kept = make_plan(spec, whole_beam(spec, beam), beam.rigid_mass(), hub.mass_matrix()).kept
    if not kept:
        raise InputError(
            f"the scene needs no mode of {spec.name!r}: a rigid body keeps its promise, and there is nothing to study; "
            "give a wider scene.bandwidth or a smaller scene.tolerance."
        )
    full = {port: spec.with_ratios(port, beam.port(port, FULL_MODES)) for port in kept}
    return Task(beam, full, kept, hub, spec.damping is None or spec.damping.form == "modal")


@lru_cache(maxsize=4)
def prepare(text: str, options: Options) -> tuple[Task, Scenario]:
    """Task and scenario of a spec's TOML text.

    A default doublet that moves the appendage so far that it shows is made smaller; a profile or amplitude of the
    user's is compared with fine chains in large motion instead.
    """
    task = make_task(text)
    profile = None if options.profile is None else parse_profile(options.profile, "--profile")
    scenario = make_scenario(task, profile, options.duration, options.amplitude)
    changed = nonlinear(task, scenario)
    while profile is None and options.amplitude is None and changed > LINEAR:
        scenario = scenario.scaled(0.1)  # a heavy hub hardly moves while its appendage bends far
        changed = nonlinear(task, scenario)
    if changed > LINEAR:
        return task, scenario.in_large_motion(large_reference(task, scenario))
    return task, replace(scenario, nonlinear=changed)


def _rigid_hub(ladders: Sequence[Ladder]) -> dict[str, float]:
    return {
        ladder.entry.integrator: statistics.median(p.seconds_per_step for p in ladder.points)
        for ladder in ladders
        if ladder.entry.model == field.RIGID_HUB and ladder.points
    }


def _one_clock(ladders: Sequence[Ladder]) -> list[Ladder]:
    """Times of several machines on one clock: the ratio to the rigid hub beside each, times the hub's own median."""
    hub = _rigid_hub(ladders)

    def moved(p: Point) -> Point:
        each = p.over_rigid_hub * hub[p.integrator]
        return p._replace(seconds=p.seconds / p.seconds_per_step * each, seconds_per_step=each)

    return [x if x.entry.model == field.RIGID_HUB else x._replace(points=[moved(p) for p in x.points]) for x in ladders]


def _duel(task: Task, scenario: Scenario, found: Study) -> list[Ladder]:
    """Every setting that the table names, and ours nearly as quick, timed once more in turns in this process."""
    named: dict[tuple[Any, ...], Point] = {}
    for target in TARGETS:
        for reach in found.reach(target, "error").values():
            named[reach.point[:4]] = reach.point
        best = found.best(target, "error")
        for ladder in found.ladders if best is not None else ():
            met = [p for error, p in front.honest(ladder, "error") if error <= target and ladder.entry.ours]
            near = max(met, key=lambda p: p.timestep, default=None)  # the fewest steps
            if best is not None and near is not None and near.seconds < DUEL_NEAR * best.seconds:
                named[near[:4]] = near
    points = [p for p in named.values() if p.seconds < DUEL_LONGEST]
    fresh: dict[tuple[Any, ...], Point] = {}
    for integrator in dict.fromkeys(p.integrator for p in points):
        group = [p for p in points if p.integrator == integrator]
        runs: list[Run] = []
        for p in group:
            entry, h = p.entry, p.timestep
            wrench = entry.fed(scenario.profile.mean(h, round(p.seconds / p.seconds_per_step)))
            runs.append(Run(field.model_of(task, entry, h), integrator, h, wrench))
        hub = field.model_of(task, Entry(field.RIGID_HUB, 0, integrator))
        for p, run, t in zip(group, runs, in_turns(runs, hub, DUEL_ROUNDS, [[] for _ in runs]), strict=True):
            fresh[p[:4]] = p._replace(seconds_per_step=t.seconds / run.wrench.shape[0], **t._asdict())
    return [ladder._replace(points=[fresh.get(p[:4], p) for p in ladder.points]) for ladder in found.ladders]
