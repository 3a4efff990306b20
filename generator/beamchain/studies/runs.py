"""What the commands study, stability and sweep measure, for Python."""

from collections.abc import Callable, Sequence
from pathlib import Path

from beamchain.fitting.fit import fit
from beamchain.fitting.spec import Spec, read_spec
from beamchain.studies.jobs import Progress
from beamchain.studies.stability import StabilityStudy, study_fit
from beamchain.studies.stability import study as stability_of
from beamchain.studies.study import BUDGET, Options, Study, study
from beamchain.studies.sweep import Sweep, sweep


def run_study(
    spec: Spec | str | Path,
    *,
    models: Sequence[str] = (),
    duration: float | None = None,
    budget: float = BUDGET,
    profile: str | None = None,
    progress: Progress | None = None,
) -> Study:
    """Measure error against run time of models of an appendage on its hub, as `beamchain study` does.

    Args:
        spec: the appendage and hub, or the path of a SPEC.toml; without a hub, one of ten times the appendage's mass.
        models: names of the models to run, such as "exact, hub", "exact, clamped" or "equal links, classical"; all where
            empty, which takes minutes.
        duration: what is simulated [s]; four slow periods where left out.
        budget: simulation time spent per model, size and integrator [s].
        profile: CSV text of the wrench on the hub, columns time [s], fx fy fz [N], mx my mz [N m]; a doublet where left
            out.
        progress: told after every entry how many are done, and of how many.

    Returns:
        The study: every point measured (`points`), the cheapest setting for an error (`best`), its rivals (`rivals`),
        files (`write`).

    Raises:
        InputError: a model's name is unknown, or the profile cannot be used.
    """
    read = spec if isinstance(spec, Spec) else read_spec(spec)
    options = Options(profile=profile, duration=duration, budget=budget, models=tuple(models))
    return study(read, options, progress=progress)


def run_stability(source: Spec | str | Path, *, say: Callable[[str], None] = lambda _: None) -> StabilityStudy:
    """Step limits predicted and measured, damping that steps add, large motion, as `beamchain stability` does.

    Args:
        source: a spec, or the path of a SPEC.toml or of any MuJoCo model (.xml).
        say: told what is being measured.

    Returns:
        The limits (`rows`), a step budget per model (`budgets`), large-motion limits per plane (`large`) and warnings.

    Raises:
        InputError: the file cannot be used.
        EngineError: MuJoCo refuses the model, or nothing oscillates in it.
    """
    return study_fit(fit(source), say) if isinstance(source, Spec) else stability_of(Path(source), say)


def run_sweep(spec: Spec | str | Path, samples: int, *, seed: int = 0, progress: Progress | None = None) -> Sweep:
    """Draw variants of an appendage from its [uncertain] and fit each, as `beamchain sweep` does.

    Args:
        spec: with [uncertain], or the path of such a SPEC.toml.
        samples: how many are drawn.
        seed: of the draws; the same seed gives the same variants.
        progress: told after every ten.

    Returns:
        The variants' fields of MuJoCo's model (`fields`), their coupled frequencies [rad/s] (`coupled`), samples that
        could not be made and why (`left_out`), files (`write`).

    Raises:
        InputError: the spec has no [uncertain], or no sample could be made.
    """
    return sweep(spec if isinstance(spec, Spec) else read_spec(spec), samples, seed=seed, progress=progress)
