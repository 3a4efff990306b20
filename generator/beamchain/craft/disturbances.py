"""What in a compiled spacecraft disturbs its appendages' motion:
each with the figure and the cure."""

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from beamchain.engine.constraints import (
    beyond_limits,
    equalities,
    listed,
    touching,
    with_dry_friction,
)
from beamchain.engine.library import mujoco
from beamchain.engine.linearise import NUMBERS, euler_damps_implicitly
from beamchain.engine.model_rows import gravity_of
from beamchain.engine.operating_point import (
    base_body,
    pose_words,
    poses,
    quiet_copy,
    rest_point,
)
from beamchain.errors import InputError
from beamchain.steps.budget import linear_model
from beamchain.steps.cures import round_down
from beamchain.steps.dominant_element import Culprit, culprit
from beamchain.steps.limits import step_limits
from beamchain.steps.saturation import servos_that_chatter
from beamchain.steps.step_map import growing_poses
from beamchain.warning_codes import Caution

DAMPS = 0.5  # numerical damping is worth a word from this share of the structure's own
TENDON_DAMPING = "Euler treats the damping of tendons explicitly"


def check_flags(model: "mujoco.MjModel") -> None:
    """Refuse a model that switches its springs off."""
    for name in ("PASSIVE", "SPRING", "DAMPER"):
        bit = getattr(mujoco.mjtDisableBit, f"mjDSBL_{name}", None)
        if bit is not None and int(model.opt.disableflags) & int(bit):
            raise InputError(
                "the spacecraft switches off its passive forces (option flag "
                f'{name.lower()}="disable"), and so every hinge spring or damper of the appendage; '
                f'write {name.lower()}="enable".'
            )


def disturbances(
    model: "mujoco.MjModel",
    *,
    fastest: float,
    zeta: float,
    geoms: Sequence[int],
    bodies: Sequence[int],
) -> list[str]:
    """Warnings about what in a compiled spacecraft disturbs its appendages' motion.

    `fastest`: the largest of their cantilever frequencies [rad/s], 0 where there is none; `zeta`:
    their smallest damping ratio; `geoms`, `bodies`: ids of their shapes and bodies.
    """
    return [
        *_surroundings(model, geoms),
        *left_out(model, "the proof", bodies),
        *_unstable_step(model),
        *_integration(model, fastest, zeta),
        *servos_that_chatter(model),
    ]


def _surroundings(model: "mujoco.MjModel", geoms: Sequence[int]) -> Iterator[str]:
    """Forces on the appendages that are not in the proof."""
    option = model.opt
    disabled = int(option.disableflags)
    gravity = gravity_of(model)
    if np.any(gravity != 0.0):
        yield Caution(
            "gravity",
            f"gravity is {' '.join(f'{g:g}' for g in gravity)} m/s^2: it falls, and where it is "
            'held its appendages bend; in orbit write <option gravity="0 0 0">.',
        )
    if option.density > 0.0 or option.viscosity > 0.0:
        yield Caution(
            "medium",
            f"the medium (density {option.density:g}, viscosity {option.viscosity:g}) drags on the "
            "links as on all bodies; in space set both to 0.",
        )
    collide = [i for i in geoms if int(model.geom_contype[i]) or int(model.geom_conaffinity[i])]
    if collide and not disabled & int(mujoco.mjtDisableBit.mjDSBL_CONTACT):
        yield Caution(
            "collisions",
            f"{len(collide)} shapes of the appendages can touch others; contacts are left out of "
            "the proof.",
        )


def left_out(model: "mujoco.MjModel", where: str, bodies: Collection[int] = ()) -> Iterator[str]:
    """Warnings about what a compiled spacecraft has and a linear model has not, each in a sentence.

    `where` it is left out: "the plant"; `bodies`: ids of those of the appendages, for a proof of
    the base bodies that carry them, where the others are left out as well.
    """
    held = equalities(model)
    if held:
        yield Caution(
            "equality",
            f"{len(held)} equality constraint{'s' * (len(held) > 1)} of the spacecraft "
            f"({listed(held)}) {'are' if len(held) > 1 else 'is'} left out of {where}.",
        )
    rubbing = with_dry_friction(model)
    if rubbing:
        yield Caution(
            "dry-friction",
            f"dry friction (frictionloss) of {listed(rubbing)} is left out of {where}, as if "
            f"{'they' if len(rubbing) > 1 else 'it'} always slid.",
        )
    touches, beyond = _at_poses(model)
    if touches:
        yield Caution(
            "contacts",
            f"{listed(touches)}; contacts are left out of {where}, which is of free flight.",
        )
    if beyond:
        yield Caution(
            "limits",
            f"{listed(beyond)}; a limit pushes it back, which is left out of {where}: write a ref "
            "or a keyframe within the range.",
        )
    free = _other_bases(model, bodies)
    if free:
        yield Caution(
            "other-bases",
            f"{listed(free)} also {'move' if len(free) > 1 else 'moves'} in the world, without "
            f"appendages, and {'have' if len(free) > 1 else 'has'} no part in {where}.",
        )


def _at_poses(model: "mujoco.MjModel") -> tuple[list[str], list[str]]:
    """What touches, and what is outside its range, at the rest pose and at every keyframe."""
    data = mujoco.MjData(model)
    touches: dict[tuple[str, str], str] = {}
    beyond: dict[str, str] = {}
    for k in range(-1, model.nkey):
        pose = "rest"
        if k >= 0:
            mujoco.mj_resetDataKeyframe(model, data, k)
            pose = f"keyframe {model.key(k).name or k}"
        mujoco.mj_forward(model, data)
        for pair in touching(model, data):
            touches.setdefault(pair, pose)
        for name in beyond_limits(model, data):
            beyond.setdefault(name, pose)
    return (
        [f"{one!r} touches {two!r} at {pose}" for (one, two), pose in touches.items()],
        [f"{name} is outside its range at {pose}" for name, pose in beyond.items()],
    )


def _other_bases(model: "mujoco.MjModel", bodies: Collection[int]) -> list[str]:
    """Bodies that move in the world by themselves and carry none of some bodies."""
    bases = dict.fromkeys(base_body(model, int(body)) for body in model.dof_bodyid)
    carrying = {base_body(model, body) for body in bodies}
    return [
        repr(model.body(base).name) if model.body(base).name else f"body {base}"
        for base in bases
        if carrying and base not in carrying
    ]


def _unstable_step(model: "mujoco.MjModel") -> Iterator[str]:
    """Where a motion grows at the model's own step: the pose that allows the shortest, and why."""
    integrator = NUMBERS[int(model.opt.integrator)]
    still = quiet_copy(model)
    places = poses(still)
    limits = {
        pose: step_limits(linear_model(still, rest_point(still, places[pose]).data()))
        for pose in growing_poses(still, places)
    }
    if not limits:
        return
    pose = min(limits, key=lambda pose: limits[pose].largest_step[integrator])
    worst = limits[pose]
    largest = worst.largest_step[integrator]
    where = "" if pose == "rest" else f" in {pose_words(pose)}"
    found = culprit(still, places[pose])
    fastest_motion = "coupled mode" if worst.ratio < 1.0 else "motion, overdamped,"
    unit = "rad/s" if worst.ratio < 1.0 else "1/s"
    shorter = f'<option timestep="{round_down(0.5 * largest):g}">'
    yield Caution(
        "unstable-step",
        f"timestep {float(model.opt.timestep):g} s is above the {largest:.4g} s at which "
        f"{integrator} becomes unstable{where} (fastest {fastest_motion} {worst.omega_max:.5g} "
        f"{unit}{_held_by(found)}); {_cure(found, integrator, shorter)}.",
    )


def _integration(model: "mujoco.MjModel", fastest: float, zeta: float) -> Iterator[str]:
    """What the integrator at its step makes of the appendages."""
    integrator = NUMBERS[int(model.opt.integrator)]
    step = float(model.opt.timestep)
    if integrator == "discrete":
        allowed = DAMPS * max(zeta, 1e-3)
        added = step * fastest / 2.0
        if added > allowed:
            yield Caution(
                "discrete-damping",
                f"the integrator discrete adds a damping ratio of {added:.2g} to the fastest kept "
                f"mode at timestep {step:g} s (the structure has {zeta:g}); below "
                f"{round_down(allowed * 2.0 / fastest):g} s it is less than half of that.",
            )
    has_tendon_damping = bool(model.ntendon) and bool(np.any(np.asarray(model.tendon_damping) > 0))
    is_explicit = not euler_damps_implicitly(model)
    if integrator == "Euler" and (has_tendon_damping or is_explicit) and zeta > 0.0:
        yield Caution("tendon-damping", f"{TENDON_DAMPING}, which shifts it by about w h.")


def _held_by(found: Culprit) -> str:
    """Words for what makes a step unstable, where a name tells which it is."""
    if not found.share:
        return ""
    if not found.damps:
        return f", held mostly by {found.words}"
    damper = f"the kv of {found.words}" if found.kind == "servo" else found.words
    size = f" on {found.moves}" if found.moves else ""
    return f", held by {damper}{size}"


def _cure(found: Culprit, integrator: str, step: str) -> str:
    """What helps against an unstable step."""
    if not found.damps or found.kind == "appendage":
        return f"write {step}"
    at_joint = "write the damping at its joint, " if integrator == "Euler" else ""
    return (
        f"{integrator} takes that damping at the start of the step: take implicitfast, {at_joint}"
        f"state the inertia of motor and gear as armature of the joint, or write {step}"
    )
