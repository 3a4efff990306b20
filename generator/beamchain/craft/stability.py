"""`beamchain inspect --steps`: step limits, large motion, and their record."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from beamchain.checks import path_of
from beamchain.craft.slews import SlewRow, slews
from beamchain.engine.library import mujoco, one_thread
from beamchain.engine.linearise import NUMBERS, compile_model
from beamchain.errors import EngineError, InputError
from beamchain.fitting.fit import fit
from beamchain.fitting.result import Fit
from beamchain.fitting.spec import Spec, read_spec
from beamchain.steps.budget import HOST, Budget, budget, preload_sentence
from beamchain.steps.large_motion import LargeMotion
from beamchain.steps.modal import timing_marks
from beamchain.warning_codes import Caution, warnings_record

Say = Callable[[str], None]


def silent(_: str) -> None:
    """Say nothing."""


@dataclass(frozen=True)
class StepRow:
    """The largest stable step of a model [s]; infinity: none."""

    name: str  #: of the model
    integrator: str  #: MuJoCo's name
    largest: float


@dataclass(frozen=True, eq=False)
class StabilityStudy:
    """Everything `stability.json` holds.

    Args:
        rows: largest stable steps, per model and integrator.
        budgets: per model: on its hub, then alone.
        large: large-motion limits per bending plane; empty for a foreign model.
        warnings: sentences with codes.
        own_step: whether the file's own integrator is stable at the file's own step, in a sentence.
        slews: of the hinges between bodies of a file that `embed` wrote, empty for others.
        is_retimable: whether `beamchain retime` can make the appendages exact at longer steps.

    Example:
        >>> import beamchain as bc
        >>> oscillator = '''<mujoco model="rod"><option timestep="0.01"/><worldbody><body>
        ... <joint type="slide" stiffness="16"/>
        ... <inertial pos="0 0 0" mass="4" diaginertia="1 1 1"/></body></worldbody></mujoco>'''
        >>> from pathlib import Path
        >>> _ = Path("rod.xml").write_text(oscillator)
        >>> bc.stability("rod.xml").own_step
        'rod: stable as it is, with Euler at 0.01 s; Euler is stable up to 1 s.'
    """

    rows: list[StepRow]
    budgets: list[Budget]
    large: dict[str, LargeMotion]
    warnings: list[str]
    own_step: str
    slews: list[SlewRow] = field(default_factory=list[SlewRow])
    is_retimable: bool = False

    def as_dict(self) -> dict[str, Any]:
        """For stability.json."""
        import beamchain

        return {
            "beamchain": beamchain.__version__,
            "mujoco": mujoco.__version__,
            "budgets": [b.as_dict() for b in self.budgets],
            "large_motion": [limit.as_dict() for limit in self.large.values()],
            "slews": [row.as_dict() for row in self.slews],
            "warnings": warnings_record(self.warnings),
        }


def step_rows(limits: Budget) -> list[StepRow]:
    """The limits of a model, one row per integrator of MuJoCo."""
    return [
        StepRow(limits.name, integrator, largest)
        for integrator, largest in limits.largest_step.items()
        if integrator != HOST
    ]


@one_thread()
def stability(
    source: Spec | str | Path, say: Say = silent, joints: Sequence[str] = ()
) -> StabilityStudy:
    """Step limits, damping that steps add, large motion,
    as `beamchain inspect --steps` does.

    A file that `embed` wrote is also slewed at the spacecraft's own hinges, one by one, by 90
    degrees in 5 and 10 periods of its slowest mode and by 180 degrees in 10: what the chains are
    off in such large motion, and what the file's own step is.

    Args:
        source: a specification, or the path of a SPEC.toml or of any MuJoCo model (.xml).
        say: told what is being worked out.
        joints: names of the hinges to slew; the first six where it is empty.

    Returns:
        The limits (`rows`), a step budget per model (`budgets`),
        large-motion limits per plane (`large`), `slews` and warnings.

    Raises:
        InputError: the file cannot be used; a joint is no hinge that is slewed.
        EngineError: MuJoCo refuses the model, or nothing oscillates in it.

    Example:
        >>> import beamchain as bc
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> limits = bc.stability(spec)
        >>> sorted({row.integrator for row in limits.rows})[:2]
        ['Euler', 'RK4']
    """
    if isinstance(source, Spec):
        return study_fit(_fit(source), say)
    source = path_of("source", source, "a Spec, or the path of a SPEC.toml or MJCF (.xml) file")
    if joints and source.suffix.lower() != ".xml":
        raise InputError(f"joints = {joints[0]!r}: {source} has no hinges; give a file of embed.")
    if source.suffix.lower() == ".xml":
        model = compile_model(source)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        if said := preload_sentence(model, data):  # it would be simulated as it moves off
            raise EngineError(said)
        limits = budget(model)
        name = NUMBERS[int(model.opt.integrator)]
        warnings = _warnings(limits, limits.timestep, name)
        rows = step_rows(limits)
        own_step = _own_step(limits, name)
        turned: list[SlewRow] = []
        if not warnings and limits.frequencies.size:
            found = slews(source, model, float(limits.frequencies[0]), say, joints)
            turned = found.rows
            warnings += found.warnings
        retimable = bool(timing_marks(model))
        return StabilityStudy(rows, [limits], {}, warnings, own_step, turned, retimable)
    say("fitting the chain")
    return study_fit(_fit(read_spec(source)), say)


def _fit(spec: Spec) -> Fit:
    """The fit of a specification whose appendage is stiff by itself."""
    if spec.slosh is not None:
        raise InputError(
            f"the appendage {spec.name!r} is the liquid in a tank, which has no stiffness without "
            "an acceleration; beamchain fit prints its step limits at the stated one."
        )
    return fit(spec)


def study_fit(result: Fit, say: Say = silent) -> StabilityStudy:
    """Step limits of a fit, on its hub and on the bench, and its large-motion limits."""
    rows: list[StepRow] = []
    budgets: list[Budget] = []
    overdamped: list[str] = []
    name = result.spec.name
    for label, text in (
        (f"{name} on its hub", result.scene_mjcf()),
        (f"{name} alone", result.bench_mjcf()),
    ):
        model = compile_model(text)
        try:
            limits = budget(model, name=label)
        except EngineError as error:
            if not budgets:
                raise
            overdamped.append(Caution("overdamped", f"{label}: {error}"))  # without its hub
            continue
        budgets.append(limits)
        rows += step_rows(limits)
    say("comparing with a chain of 60 links in large motion")
    large, reasons = result.large_motion
    scene = result.spec.scene
    unstable = [] if scene is None else _warnings(budgets[0], result.step, scene.integrator)
    own_step = _own_step(budgets[0], result.spec.integrator)
    return StabilityStudy(
        rows,
        budgets,
        large,
        [*reasons, *overdamped, *unstable],
        own_step,
        is_retimable=bool(result.chain.tendons),
    )


def _own_step(limits: Budget, integrator: str) -> str:
    """Whether a model is stable with its own integrator at its own step,
    and from which step on it is not."""
    largest = limits.largest_step[integrator]
    own = f"{integrator} at {limits.timestep:g} s"
    if limits.timestep >= largest:
        return f"{limits.name}: unstable as it is, with {own}; take a step below {largest:.4g} s."
    most = "at every step" if largest == float("inf") else f"up to {largest:.4g} s"
    return f"{limits.name}: stable as it is, with {own}; {integrator} is stable {most}."


def _warnings(limits: Budget, timestep: float, integrator: str) -> list[str]:
    """The step that the model asks for, where its integrator cannot take it."""
    step = limits.largest_step[integrator]
    text = (
        f"{limits.name}: the step asked for, {timestep:g} s, is beyond {integrator}'s limit of "
        f"{step:.4g} s."
    )
    return [Caution("unstable-step", text)] if timestep >= step else []
