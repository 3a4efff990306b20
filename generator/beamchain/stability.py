"""`beamchain stability`: the walk through step limits, large motion and extremes, and its record."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from beamchain.assess.budget import HOST, Budget, available, budget, preloaded
from beamchain.assess.large_motion import LargeMotion, large_motion
from beamchain.assess.measured_limit import measured_limit
from beamchain.caution import Caution, warnings_record
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import compile_model
from beamchain.errors import BeamchainError, EngineError
from beamchain.result import Fit
from beamchain.spec import Spec, read_spec
from beamchain.workflow import fit

LONGEST = 10.0  # slowest periods: where the search for a limit of "discrete" starts


@dataclass(frozen=True)
class StepRow:
    """A step limit, predicted from the linearised model and measured in simulations [s]; infinity: none."""

    name: str
    integrator: str
    predicted: float
    measured: float

    @property
    def difference(self) -> float:
        """Measured over predicted, less 1; 0 where both say that there is no limit."""
        return 0.0 if self.measured == self.predicted else self.measured / self.predicted - 1.0


@dataclass(frozen=True, eq=False)
class StabilityStudy:
    """Everything `stability.json` holds.

    Args:
        rows: limits predicted and measured.
        budgets: step budget per model.
        large: large-motion limits per plane; empty for a foreign model.
        warnings: what could not be done, and why.
    """

    rows: list[StepRow]
    budgets: list[Budget]
    large: dict[str, LargeMotion]
    warnings: list[str]

    def as_dict(self, extremes: Mapping[str, Any]) -> dict[str, Any]:
        """For stability.json.

        Args:
            extremes: record of the extremes suite.
        """
        import beamchain

        return {
            "beamchain": beamchain.__version__,
            "mujoco": mujoco.__version__,
            "models": [
                {"name": r.name, "integrator": r.integrator, "predicted": r.predicted, "measured": r.measured}
                for r in self.rows
            ],
            "budgets": [b.as_dict() for b in self.budgets],
            "large_motion": [limit.as_dict() for limit in self.large.values()],
            **warnings_record(self.warnings),
            "extremes": dict(extremes),
        }


def step_rows(model: "mujoco.MjModel", limits: Budget, say: Callable[[str], None] = lambda _: None) -> list[StepRow]:
    """Predicted and measured limits of a compiled model, one row per integrator.

    Args:
        model: compiled.
        limits: its budget.
        say: told what is being measured.
    """
    out: list[StepRow] = []
    for integrator in available():
        say(f"measuring {limits.name} with {integrator}")
        predicted = limits.largest_step[integrator]
        measured = measured_limit(model, integrator, min(predicted, LONGEST / float(limits.frequencies[0])))
        out.append(StepRow(limits.name, integrator, predicted, measured))
    return out


def study(source: Path, say: Callable[[str], None] = lambda _: None) -> StabilityStudy:
    """Step limits and large-motion limits of a spec's appendage on its hub and alone, or of any MuJoCo model.

    Args:
        source: SPEC.toml or MODEL.xml.
        say: told what is being done.

    Raises:
        InputError: the file cannot be used.
        EngineError: MuJoCo refuses the model, or nothing oscillates in it.
    """
    if source.suffix.lower() == ".xml":
        model = compile_model(source)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        if said := preloaded(model, data):  # it would be simulated as it moves off
            raise EngineError(said)
        limits = budget(model)
        return StabilityStudy(
            step_rows(model, limits, say), [limits], {}, _warnings([limits], float(model.opt.timestep))
        )
    say("fitting the chain")
    return study_fit(fit(read_spec(source)), say)


def study_fit(result: Fit, say: Callable[[str], None] = lambda _: None) -> StabilityStudy:
    """Step limits of a fit, on its hub and on the bench, and its large-motion limits."""
    rows: list[StepRow] = []
    budgets: list[Budget] = []
    silent: list[str] = []
    name = result.spec.name
    for label, text in ((f"{name} on its hub", result.scene_mjcf()), (f"{name} alone", result.bench_mjcf())):
        model = compile_model(text)
        try:
            limits = budget(model, name=label)
        except EngineError as error:
            if not budgets:
                raise
            silent.append(Caution("overdamped", f"{label}: {error}"))  # overdamped without its hub
            continue
        budgets.append(limits)
        rows += step_rows(model, limits, say)
    say("comparing with a chain of 60 links in large motion")
    large, warnings = large_limits(result)
    warnings += silent
    scene = result.spec.scene
    warnings += _warnings(budgets[:1], 0.0 if scene is None else scene.step, scene.integrator if scene else None)
    return StabilityStudy(rows, budgets, large, warnings)


def large_limits(result: Fit) -> tuple[dict[str, LargeMotion], list[str]]:
    """Large-motion limits of a fit's chain per bending plane, and why one could not be had."""
    spec: Spec = result.spec
    radius = spec.root.hub.offset[0] if spec.root.hub else 0.0
    if spec.imported is not None:
        text = "large motion is compared with a chain of 60 links of the beam, which imported modes do not have."
        return {}, [Caution("large-motion-unknown", text)]
    out: dict[str, LargeMotion] = {}
    warnings: list[str] = []
    for port in ("xy", "xz"):
        if port in result.target and port in result.chain.ports:
            try:
                out[port] = large_motion(
                    result.chain, spec.beam, port, modes=result.target[port].modes, radius=max(radius, 0.0)
                )
            except BeamchainError as error:
                text = f"large motion in {port} could not be compared: {error}"
                warnings.append(Caution("large-motion-unknown", text))
    return out, warnings


def _warnings(budgets: list[Budget], timestep: float, integrator: str | None = None) -> list[str]:
    """Steps that the model asks for and cannot take."""
    out: list[str] = []
    for limits in budgets:
        for name, step in limits.largest_step.items():
            if name != HOST and timestep >= step and integrator in (None, name):
                text = f"{limits.name}: the step asked for, {timestep:g} s, is beyond {name}'s limit of {step:.4g} s."
                out.append(Caution("unstable-step", text))
    return out
