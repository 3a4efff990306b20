"""A spacecraft's appendages made exact in time for its own step and integrator,
where that step would be felt."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamchain.chain.tendons import springs_as_modes
from beamchain.craft.appendage import Appendage, carried
from beamchain.craft.liquid import with_liquids_sprung
from beamchain.engine.bench import composite
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS
from beamchain.engine.operating_point import base_body, pose_words, poses, quiet_copy
from beamchain.fitting.result import Fit
from beamchain.fitting.warnings import turn_warning
from beamchain.ports.compare import compared_ratios, keeps_tolerance
from beamchain.steps.integrators import SCHEMES
from beamchain.steps.modal import modal_tendons
from beamchain.steps.poles import pole_rows
from beamchain.steps.retime import retime_by, time_reason
from beamchain.steps.step_map import TimeError, growing_poses, time_error
from beamchain.steps.turn import turn_error
from beamchain.warning_codes import Caution

# of the scenes' tolerance: what the step's own error may take before the appendages are
# made exact in time
SHARE = 0.1
LEAST_GAIN = 1.0 / 3.0  # of the stated error, that timing must take off unless it is asked for
UNASKED = 1e-4  # the same where no scene states a tolerance


@dataclass(frozen=True)
class TimingDecision:
    """Whether the appendages need timing for the craft's own step, and the warnings where they do
    not get it."""

    needed: bool
    warnings: tuple[str, ...] = ()


def step_error(model: "mujoco.MjModel", appendages: Sequence[Appendage]) -> tuple[float, float]:
    """Worst error of a response in the band asked for by the model's own step in any of its poses,
    and the largest left alone.

    A pole that is off by d shifts its peak, which is as wide as its damping: the response there is
    off by about `|d| / |Re s|`, and below a peak beyond the band, by less. Where no scene
    asks for a response it is the error of the pole. The error is infinite where the step is
    unstable; `model` is without timing.
    """
    scenes = [
        s for a in appendages if (s := a.fit.spec.scene) is not None and s.bandwidth is not None
    ]
    band = max((scene.bandwidth for scene in scenes if scene.bandwidth), default=np.inf)
    allowed = SHARE * min((scene.tolerance for scene in scenes), default=UNASKED / SHARE)
    undamped = min(a.spec.undamped_ratio for a in appendages)
    places = poses(model)
    if growing_poses(model, places):
        return float("inf"), allowed
    errors: list[float] = []
    for qpos in places.values():
        poles = pole_rows(model, qpos=qpos)
        ratios = compared_ratios(np.array([pole.ratio for pole in poles]), undamped)
        off = (
            pole.error * (response_change(pole.frequency, ratio, band) if scenes else 1.0)
            for pole, ratio in zip(poles, ratios.tolist(), strict=True)
        )
        errors += off
    return max(errors, default=0.0), allowed


def response_change(frequency: float, ratio: float, band: float) -> float:
    """By how much a response up to `band` [rad/s] changes at most per relative error of a pole.

    In the band that is at the peak, 1/ratio. A peak at p beyond adds (w/p)^2/(1 - (w/p)^2) to the
    rigid response, relative to its share in that, and changes it by 2 (w/p)^2/(1 - (w/p)^2)^2.
    """
    if frequency <= band:
        return 1.0 / ratio
    share = (band / frequency) ** 2
    return 2.0 * share / max(1.0 - share, 2.0 * ratio)


def decide_timing(
    model: "mujoco.MjModel", appendages: Sequence[Appendage], wanted: bool | None
) -> TimingDecision:
    """Whether to make the appendages exact in time; `wanted`: what the user asked for;
    None: by the step's error. Liquids have no timing."""
    name = NUMBERS[int(model.opt.integrator)]
    step = f"{name} at {float(model.opt.timestep):g} s"
    scheme = SCHEMES[name]
    if wanted is False or all(a.fit.chain.hung or not a.fit.chain.hinges for a in appendages):
        return TimingDecision(False)
    if not scheme.exact and name != "RK4":
        text = (
            f"{step} cannot be made exact in time, and is stable at any step; its own error is "
            "the user's."
        )
        return TimingDecision(False, warnings=(Caution("not-exact-in-time", text),))
    error, allowed = step_error(model, appendages)
    if name == "RK4":
        return TimingDecision(error == float("inf"))
    return TimingDecision(wanted is True or error > allowed)


def time_notes(
    model: "mujoco.MjModel",
    untimed: "mujoco.MjModel",
    with_timing: TimeError,
    without_timing: TimeError,
) -> list[str]:
    """What timing did to a craft, `untimed` before: exact, or by how much each pole is off at most,
    with timing and without; nothing of a step that the craft's own springs make unstable."""
    name = NUMBERS[int(model.opt.integrator)]
    step = f"{name} at {float(model.opt.timestep):g} s"
    if name == "RK4" or growing_poses(model, poses(model)):
        return []
    grows = growing_poses(untimed, poses(untimed))
    without = f" (without, poles are off by up to {without_timing.error:.1e})"
    if grows:
        without = f" (unstable in {pose_words(grows[0])} without)"
    elif without_timing.frequency is None:
        without = ""
    said = ["feed each actuator the mean of its present and previous input (bc.HeldInput)"]
    if changed := _stiffness_change(model):
        said.insert(0, f"stiffnesses of modes changed by up to {changed:.2g}")
    if with_timing.frequency is None:
        code, reached = "exact-in-time", f"have timing for {step}, and no pole lies in the band"
    elif with_timing.exact:
        code, reached = "exact-in-time", f"are exact in time for {step}"
    else:
        code, reached = "time-error", f"have timing for {step}; at worst {with_timing.words}"
    text = (
        f"the appendages {reached}{without}; {'; '.join(said)}. "
        f"{'' if with_timing.exact else time_reason(with_timing)}".rstrip()
    )
    return [Caution(code, text)]


def _stiffness_change(model: "mujoco.MjModel") -> float:
    """The largest relative change of the stiffness of a mode by timing."""
    modal = modal_tendons(model)
    return float(np.max(np.abs(model.tendon_stiffness[modal.index] / modal.stiffness - 1.0)))


def craft_time_error(
    model: "mujoco.MjModel",
    plain: "mujoco.MjModel",
    appendages: Sequence[Appendage],
    band: float | None,
) -> TimeError:
    """The error of the craft's poles at its own step, worst of all poses;
    up to `band` [rad/s] or the last kept mode."""
    items = carried(plain, appendages)
    dofs = [dof for item in items for dof in item.dofs]
    model, plain = (with_liquids_sprung(quiet_copy(one), items) for one in (model, plain))
    return time_error(model, plain, poses(model), band, dofs)


def attitude_warnings(model: "mujoco.MjModel", appendages: Sequence[Appendage]) -> list[str]:
    """What the step does to the attitude of the rigid spacecraft at the rates that scenes state,
    where that is above a tolerance in one of its poses."""
    name = NUMBERS[int(model.opt.integrator)]
    step = float(model.opt.timestep)
    warnings: list[str] = []
    for a in appendages:
        scene = a.fit.spec.scene
        if scene is not None and scene.rates is not None:
            base = base_body(model, model.body(f"{a.prefix}link1").id)
            errors = {
                pose: turn_error(composite(model, base, qpos).inertia, scene.rates, step, name)
                for pose, qpos in poses(model).items()
            }
            pose = max(errors, key=lambda pose: errors[pose])
            where = "" if pose == "rest" else f" in {pose_words(pose)}"
            warnings += turn_warning(errors[pose], scene, name, step, where)
    return list(dict.fromkeys(warnings))


def fit_on_tendons(fit: Fit) -> Fit:
    """The fit with a tendon per mode, on the same bodies."""
    chain = fit.chain
    if chain.hung or (chain.tendons and any(t.stiffness > 0.0 for t in chain.tendons)):
        return fit
    ratios = {
        port: chain.damped(port).damping
        * (not any(port in hinge.damping for hinge in chain.hinges))
        for port in chain.ports
    }
    return replace(fit, chain=springs_as_modes(chain, ratios))


def is_worth_timing(plain: float, timed: float, tolerance: float | None) -> bool:
    """Whether timing lowers the error at the step enough for its price, changed stiffnesses and
    averaged inputs: by a third, or to within the tolerance. Where the step is unstable without it,
    always: what keeps it so is the craft's own."""
    lower = timed <= (1.0 - LEAST_GAIN) * plain
    return lower or (
        tolerance is not None
        and keeps_tolerance(timed, tolerance)
        and not keeps_tolerance(plain, tolerance)
    )


def with_timing(
    model: "mujoco.MjModel", band: float | None = None, *, joints: bool = False
) -> "tuple[mujoco.MjModel, list[str]]":
    """A copy of a model with timing for its own step and integrator in its appendages,
    and what was slowed for it; `band`, `joints` as of `retime`."""
    model = copy.copy(model)
    integrator = NUMBERS[int(model.opt.integrator)]
    plan = retime_by(4, model, float(model.opt.timestep), integrator, band=band, joints=joints)
    return model, plan.slowed
