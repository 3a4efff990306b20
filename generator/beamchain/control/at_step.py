"""A craft at the step of a sampled plant: made exact in time where it can be, its errors there,
and what forbids a step."""

from copy import copy

from beamchain.craft.appendage import carried
from beamchain.craft.embedded import Embedded
from beamchain.craft.error import Pose
from beamchain.craft.sampled import pose_sampled_error
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS
from beamchain.engine.operating_point import OperatingPoint, quiet_copy
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.steps.dominant_element import culprit, stable_step
from beamchain.steps.integrators import SCHEMES
from beamchain.steps.modal import modal_tendons
from beamchain.steps.retime import retime_by, time_sentence, without_timing
from beamchain.steps.step_map import TimeError, grows, time_error
from beamchain.warning_codes import Caution


def at_step(
    model: "mujoco.MjModel", timestep: float, qpos: Array, embedded: Embedded | None
) -> "tuple[mujoco.MjModel, list[str]]":
    """A copy of a model for a step [s], its appendages exact in time where they can be,
    and sentences on where not.

    The craft's coupling is looked at in the pose `qpos`.

    Raises:
        InputError: the step is unstable; the sentence names what carries the motion that grows.
    """
    out, said = retime_at(model, timestep, qpos)
    still = quiet_copy(out)
    if grows(still, qpos):
        shorter = stable_step(
            lambda h: grows(quiet_copy(retime_at(model, h, qpos)[0]), qpos), timestep
        )
        raise InputError(_unstable(still, timestep, qpos, shorter))
    off = _time_error(out, qpos, embedded)
    if not off.exact and NUMBERS[int(model.opt.integrator)] != "RK4":
        said.append(Caution("time-error", f"the discrete plant: {time_sentence(off)}"))
    return out, said


def retime_at(
    model: "mujoco.MjModel", timestep: float, qpos: Array
) -> "tuple[mujoco.MjModel, list[str]]":
    """A copy of a model with timing for a step [s] in the pose `qpos`,
    and sentences on what is slowed or cannot be made."""
    out = copy(model)
    out.opt.timestep = timestep
    name = NUMBERS[int(model.opt.integrator)]
    modal = modal_tendons(model)
    if modal.names and SCHEMES[name].exact:
        made = {
            None if mark is None else (mark.timestep, mark.integrator) for mark in modal.made_for
        }
        right = made == {(timestep, name)}
        return out, retime_by(4, copy(out) if right else out, timestep, name, qpos=qpos).slowed
    why = (
        f"{name} cannot be made exact in time"
        if modal.names
        else "its flexible parts have no modal tendons"
    )
    return out, [
        Caution("not-exact-in-time", f"the discrete plant has the step's own error: {why}.")
    ]


def step_errors(
    model: "mujoco.MjModel", point: OperatingPoint, timestep: float, embedded: Embedded | None
) -> tuple[TimeError, float | None]:
    """The largest error of a pole, and the in-band error of the base's response (None without exact
    appendages), at a point.

    `model` is what the plant was made from.
    """
    out, _ = retime_at(model, timestep, point.qpos)
    off = _time_error(out, point.qpos, embedded)
    if embedded is None:
        return off, None
    items = carried(embedded.model, embedded.appendages)
    bare = embedded.bare_qpos(point.qpos)
    motions = embedded.promise.motions
    pose = Pose(quiet_copy(embedded.craft), bare, items, embedded.band, motions)
    return off, pose_sampled_error(embedded.craft, quiet_copy(out), point.qpos, pose).error


def _time_error(model: "mujoco.MjModel", qpos: Array, embedded: Embedded | None) -> TimeError:
    band = None if embedded is None or embedded.tolerance is None else embedded.band
    plain = without_timing(model)
    return time_error(quiet_copy(model), quiet_copy(plain), {"this pose": qpos}, band)


def _unstable(model: "mujoco.MjModel", timestep: float, qpos: Array, step: float) -> str:
    """What is unstable about a step, and what helps; `step`: one that is stable [s], 0:
    none was found."""
    found = culprit(model, qpos)
    said = (
        f"discrete = {timestep:g} s is unstable: mode {found.name!r} grows by a factor "
        f"{found.growth:.6g} per step; {found.words} carries {found.share:.0%} of what grows, at "
        f"{found.frequency:.4g} rad/s"
    )
    shorter = f"give a step of {step:.2g} s or less" if step > 0.0 else "give a shorter step"
    if found.kind == "appendage" and not any(modal_tendons(model).made_for):
        return (
            f"{said}; {shorter}, or Euler, implicit or implicitfast, for which appendages can "
            "be made exact in time."
        )
    if found.kind == "appendage":
        return f"{said}; {shorter}."
    return (
        f"{said}, whatever the appendages do; {shorter}, or make it softer: only modes of "
        "appendages are made exact in time."
    )
