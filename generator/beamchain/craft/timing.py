"""A spacecraft's appendages made exact in time for its own step and integrator,
where that step would be felt."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from beamchain.caution import Caution
from beamchain.chain.tendons import springs_as_modes
from beamchain.craft.appendage import Appendage, carried
from beamchain.engine.bench import composite
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS
from beamchain.engine.operating_point import base_body, poses, quiet_copy
from beamchain.fitting.result import Fit
from beamchain.fitting.warnings import turn_warning
from beamchain.ports.compare import DEFAULT_RATIO, NARROWEST
from beamchain.steps.integrators import SCHEMES
from beamchain.steps.modal import made_for
from beamchain.steps.poles import pole_rows
from beamchain.steps.retime import retime, time_cure
from beamchain.steps.step_map import GROWN, TimeError, motion_at, time_error
from beamchain.steps.turn import turn_error

# of the scenes' tolerance: what the step's own error may take before the appendages are
# made exact in time
SHARE = 0.1
UNASKED = 1e-4  # the same where no scene states a tolerance


@dataclass(frozen=True)
class Decision:
    """Whether appendages get timing for the craft's own step, why,
    and what is to be said where they do not."""

    good: bool
    why: str = ""
    said: tuple[str, ...] = ()


def step_error(model: "mujoco.MjModel", appendages: Sequence[Appendage]) -> tuple[float, float]:
    """Worst error of a response at a pole in the band asked for by the model's own step,
    and the largest left alone.

    A pole that is off by d shifts its peak, which is as wide as its damping: the response there is
    off by about `|d| / |Re s|`. Where no scene asks for a response it is the error of the pole. The
    error is infinite where the step is unstable; `model` is without timing.
    """
    scenes = [
        s for a in appendages if (s := a.fit.spec.scene) is not None and s.bandwidth is not None
    ]
    band = max((float(scene.bandwidth or 0.0) for scene in scenes), default=np.inf)
    allowed = SHARE * min((scene.tolerance for scene in scenes), default=UNASKED / SHARE)
    if motion_at(model).growth > 1.0 + GROWN:
        return float("inf"), allowed
    inside = [row for row in pole_rows(model) if row.frequency <= band]
    if not scenes:
        return max((row.error for row in inside), default=0.0), allowed
    return max(
        (row.error / (row.ratio if row.ratio > NARROWEST else DEFAULT_RATIO) for row in inside),
        default=0.0,
    ), allowed


def worth_it(
    model: "mujoco.MjModel", appendages: Sequence[Appendage], wanted: bool | None
) -> Decision:
    """Whether to make the appendages exact in time; `wanted`: the user's word, None:
    by the step's error."""
    name = NUMBERS[int(model.opt.integrator)]
    step = f"{name} at {float(model.opt.timestep):g} s"
    scheme = SCHEMES[name]
    if wanted is False or not any(a.fit.chain.hinges for a in appendages):
        return Decision(False)
    if not scheme.exact and name != "RK4":
        text = (
            f"{step} cannot be made exact in time, and is stable at any step; its own error is "
            "the user's."
        )
        return Decision(False, said=(Caution("not-exact-in-time", text),))
    error, allowed = step_error(model, appendages)
    if name == "RK4":
        return Decision(error == float("inf"), "it would be unstable by itself")
    if wanted:
        return Decision(True, "as asked")
    if error == float("inf"):
        return Decision(True, "it would be unstable by itself")
    return Decision(error > allowed, f"its own error would be {error:.2g}, above {allowed:.2g}")


def time_notes(model: "mujoco.MjModel", why: str, off: TimeError, own: TimeError) -> list[str]:
    """What timing did to a craft: exact, or by how much each pole is off at most; `off` with it,
    `own` without."""
    name = NUMBERS[int(model.opt.integrator)]
    step = f"{name} at {float(model.opt.timestep):g} s"
    if name == "RK4":
        return []
    mean = "give actuators the mean of this and the last input (in Python bc.HeldInput)."
    if off.exact:
        return [
            Caution(
                "exact-in-time",
                f"the appendages are exact in time for {step} ({why}; {off.error:.1e}); {mean}",
            )
        ]
    text = (
        f"the appendages have timing for {step} ({why}), which does not keep every pole: "
        f"{off.words}; without timing {own.words}; {mean} {time_cure(name)}"
    )
    return [Caution("time-error", text)]


def craft_time_error(
    model: "mujoco.MjModel",
    plain: "mujoco.MjModel",
    appendages: Sequence[Appendage],
    band: float | None,
) -> TimeError:
    """The error of the craft's poles at its own step, worst of all poses;
    up to `band` [rad/s] or the last kept mode."""
    dofs = [dof for item in carried(plain, appendages) for dof in item.dofs]
    return time_error(quiet_copy(model), quiet_copy(plain), poses(model), band, dofs)


def turned(model: "mujoco.MjModel", appendages: Sequence[Appendage]) -> list[str]:
    """What the step does to the rigid spacecraft at the rates that scenes state,
    where that is above a tolerance."""
    name = NUMBERS[int(model.opt.integrator)]
    step = float(model.opt.timestep)
    out = list[str]()
    for a in appendages:
        scene = a.fit.spec.scene
        if scene is not None and scene.rates is not None:
            base = base_body(model, model.body(f"{a.prefix}link1").id)
            error = turn_error(composite(model, base).inertia, scene.rates, step, name)
            out += turn_warning(error, scene, name, step)
    return list(dict.fromkeys(out))


def on_tendons(fit: Fit) -> Fit:
    """The fit with a tendon per mode, on the same bodies."""
    chain = fit.chain
    if chain.tendons and any(t.stiffness > 0.0 for t in chain.tendons):
        return fit
    ratios = {
        port: chain.damped(port).damping
        * (not any(port in hinge.damping for hinge in chain.hinges))
        for port in chain.ports
    }
    return replace(fit, chain=springs_as_modes(chain, ratios))


def timed(model: "mujoco.MjModel") -> "tuple[mujoco.MjModel, list[str]]":
    """A copy of a model with timing for its own step and integrator in its appendages,
    and what was slowed for it."""
    out = copy.copy(model)
    name = NUMBERS[int(model.opt.integrator)]
    done = retime(out, float(model.opt.timestep), name, form=4)
    return out, done.slowed


def without_time(model: "mujoco.MjModel") -> "mujoco.MjModel":
    """A copy of a model with timing taken out of its appendages;
    the same numbers where there is none."""
    out = copy.copy(model)
    if made_for(out):
        retime(out, 0.0)
    return out
