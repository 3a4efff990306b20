"""A spacecraft's appendages made exact in time for its own step and integrator, where that step would be felt."""

import copy
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from beamchain.caution import Caution
from beamchain.chain.tendons import springs_as_modes
from beamchain.craft.appendage import Appendage
from beamchain.craft.error import base_body
from beamchain.engine.bench import composite
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS
from beamchain.errors import EngineError
from beamchain.fitting.result import Fit
from beamchain.fitting.warnings import turn_warning
from beamchain.steps.integrators import SCHEMES
from beamchain.steps.modal import made_for
from beamchain.steps.poles import PoleRow, pole_rows
from beamchain.steps.retime import retime
from beamchain.steps.turn import turn_error

SHARE = 0.1  # of the scenes' tolerance: what the step's own error may take before the appendages are made exact in time
UNASKED = 1e-4  # the same where no scene states a tolerance


def step_error(model: "mujoco.MjModel", appendages: Sequence[Appendage]) -> tuple[float, float]:
    """Worst relative error of a pole in the band asked for by the model's own step, and the largest that is left alone.

    The error is infinite where the step is unstable; `model` is without timing.
    """
    asked = [s for a in appendages if (s := a.fit.spec.scene) is not None and s.bandwidth is not None]
    band = max((float(scene.bandwidth or 0.0) for scene in asked), default=np.inf)
    allowed = SHARE * min((scene.tolerance for scene in asked), default=UNASKED / SHARE)
    rows = _rows(model)
    if any(row.grows for row in rows):
        return float("inf"), allowed
    return max((row.error for row in rows if row.frequency <= band), default=0.0), allowed


def worth_it(model: "mujoco.MjModel", appendages: Sequence[Appendage], wanted: bool | None) -> tuple[bool, str]:
    """Whether to make the appendages exact in time, and why; `wanted`: the user's word, None: by the step's error."""
    name = NUMBERS[int(model.opt.integrator)]
    step = f"{name} at {float(model.opt.timestep):g} s"
    scheme = SCHEMES[name]
    if wanted is False or not any(a.fit.chain.hinges for a in appendages):
        return False, ""
    if not scheme.exact and name != "RK4":
        text = f"{step} cannot be made exact in time, and is stable at any step; its own error is the user's."
        return False, Caution("not-exact-in-time", text)
    error, allowed = step_error(model, appendages)
    if name == "RK4":
        text = f"{step} would be unstable: the modes beyond it are slowed."
        return (True, Caution("slowed-modes", text)) if error == float("inf") else (False, "")
    if wanted or error > allowed:
        own = f"its own error would be {error:.2g}, above {allowed:.2g}"
        why = "as asked" if wanted else "it would be unstable by itself" if error == float("inf") else own
        text = (
            f"the appendages are exact in time for {step} ({why}); give actuators the mean of this and the last input "
            "(in Python bc.HeldInput)."
        )
        return True, Caution("exact-in-time", text)
    return False, ""  # what the step does is within what was asked for


def turned(model: "mujoco.MjModel", appendages: Sequence[Appendage]) -> list[str]:
    """What the step does to the rigid spacecraft at the rates that scenes state, where that is above a tolerance."""
    name = NUMBERS[int(model.opt.integrator)]
    step, out = float(model.opt.timestep), list[str]()
    for a in appendages:
        scene = a.fit.spec.scene
        if scene is not None and scene.rates is not None:
            base = base_body(model, model.body(f"{a.prefix}link1").id)
            error = turn_error(composite(model, base).inertia, scene.rates, step, name)
            out += turn_warning(error, scene, name, step)
    return list(dict.fromkeys(out))


def _rows(model: "mujoco.MjModel") -> list[PoleRow]:
    try:
        return pole_rows(model)
    except EngineError:
        return []


def on_tendons(fit: Fit) -> Fit:
    """The fit with a tendon per mode, on the same bodies."""
    chain = fit.chain
    if chain.tendons and any(t.stiffness > 0.0 for t in chain.tendons):
        return fit
    ratios = {
        port: chain.damped(port).damping * (not any(port in hinge.damping for hinge in chain.hinges))
        for port in chain.ports
    }
    return replace(fit, chain=springs_as_modes(chain, ratios))


def timed(model: "mujoco.MjModel") -> "tuple[mujoco.MjModel, list[str]]":
    """A copy of a model whose appendages are exact in time for its own step and integrator, and what was slowed for it."""
    out = copy.copy(model)
    name = NUMBERS[int(model.opt.integrator)]
    done = retime(out, float(model.opt.timestep), name, form=4)
    return out, [] if name == "RK4" else done.slowed  # of RK4 it is said already


def without_time(model: "mujoco.MjModel") -> "mujoco.MjModel":
    """A copy of a model with timing taken out of its appendages; the same numbers where there is none."""
    out = copy.copy(model)
    if made_for(out):
        retime(out, 0.0)
    return out
