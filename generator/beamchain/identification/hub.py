"""What is known of the spacecraft: its mass properties about the mount,
and how the log's torques act on it."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beamchain.checks import unknown
from beamchain.errors import InputError
from beamchain.toolkit import (
    AXES,
    Array,
    actuator_names,
    base,
    compiled_model,
    frozen_mass,
    kinds_and_name,
    mujoco,
)


class Bare(NamedTuple):
    """A bare spacecraft.

    Args:
        mass: `(6, 6)` about the mount, in its axes;
            wheels that turn by themselves give no inertia about their axis.
        turn: `(3, 3)` rows: axes of the hub's body in the mount's axes.
        actuators: `(3,)` torque on the hub per unit of an actuator's control,
            in the hub's axes, by name.
    """

    mass: Array
    turn: Array
    actuators: dict[str, Array]


def bare(craft: "str | Path | mujoco.MjSpec | mujoco.MjModel", mount: str) -> Bare:
    """The spacecraft `craft`, at rest, seen from its site or body `mount`.

    Raises:
        InputError: no such place, or the hub does not float free.
    """
    model = compiled_model(craft)
    hub = base(model)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    kinds, name = kinds_and_name(mount)
    places = {kind: _names(model, kind) for kind in kinds}
    place = next((kind for kind, names in places.items() if name in names), None)
    if place is None:
        raise unknown(
            "mount",
            mount,
            [n for names in places.values() for n in names],
            "It is the appendage's place on the craft.",
        )
    there = getattr(data, place)(name)
    own = int(model.site(name).bodyid[0]) if place == "site" else int(model.body(name).id)
    while own not in (0, hub):
        own = int(model.body_parentid[own])
    free = (
        model.body_dofnum[hub] == 6
        and model.jnt_type[model.body_jntadr[hub]] == mujoco.mjtJoint.mjJNT_FREE
    )
    if own != hub or not free:
        raise InputError(
            f"mount = {mount!r}: the log is one of a spacecraft in free flight, but "
            f"{model.body(hub).name or 'its body'!r} has no <freejoint/> or does not carry that "
            "place; give the bare spacecraft with a free body."
        )
    frame = np.array(there.xmat).reshape(3, 3)
    back = data.xmat[hub].reshape(3, 3).T
    mass = frozen_mass(model, data, hub, np.array(there.xpos), frame)
    actuators = dict[str, Array]()
    for i, label in enumerate(actuator_names(model)):
        kind = int(model.actuator_trntype[i])
        target = int(model.actuator_trnid[i, 0])
        gear = np.asarray(model.actuator_gear[i]) * float(model.actuator_gainprm[i, 0])
        if kind == _transmission("SITE") and not np.any(gear[:3]):
            actuators[label] = back @ data.site_xmat[target].reshape(3, 3) @ gear[3:]
        elif kind in (_transmission("JOINT"), _transmission("JOINTINPARENT")):
            if int(model.jnt_type[target]) != int(mujoco.mjtJoint.mjJNT_HINGE):
                continue
            body = int(model.jnt_bodyid[target])
            axis = data.xmat[body].reshape(3, 3) @ model.jnt_axis[target]
            actuators[label] = -back @ axis * gear[0]
            spin = data.ximat[body].reshape(3, 3).T @ axis
            along = frame.T @ axis
            mass[3:, 3:] -= float(spin @ (model.body_inertia[body] * spin)) * np.outer(along, along)
    return Bare(mass, back @ frame, actuators)


def directions(known: Bare, names: Sequence[str]) -> Array:
    """`(channels, 3)` direction, in the mount's axes, of each column of a log by its name."""
    out = [
        known.actuators[n] if n in known.actuators else np.eye(3)[AXES.index(n[-1])] for n in names
    ]
    return np.array(out).reshape(-1, 3) @ known.turn


def _names(model: "mujoco.MjModel", kind: str) -> list[str]:
    count = model.nsite if kind == "site" else model.nbody
    return [str(getattr(model, kind)(i).name) for i in range(1 if kind == "body" else 0, count)]


def _transmission(kind: str) -> int:
    return int(getattr(mujoco.mjtTrn, f"mjTRN_{kind}"))
