"""Coupled modes of a whole spacecraft as motions that a film can show: every body, the hub too,
over one oscillation."""

from typing import NamedTuple

import numpy as np

from beamchain.craft.mode_names import cantilever_names, mode_names
from beamchain.engine.displacement import moved_positions, reach, turn
from beamchain.engine.library import mujoco
from beamchain.engine.linear import linear_at
from beamchain.engine.operating_point import quiet_copy, rest_point
from beamchain.errors import InputError
from beamchain.ports.motions import Array, locked
from beamchain.steps.retime import without_timing

SWING = 0.05  # of the size that MuJoCo gives the spacecraft: the largest displacement shown
MOST_TURNED = 0.4  # rad of a link, beyond which a mode's shape would not be that of small motion


class MovingMode(NamedTuple):
    """One mode, named after the cantilever mode or joint with most of its strain energy;
    `omega` [rad/s].

    `positions` `(k, nq)` over one oscillation, from rest; `swing`: the largest displacement [m].
    """

    name: str
    omega: float
    positions: Array
    rest: Array
    swing: float


def moving_modes(
    model: "mujoco.MjModel", count: int, frames: int, exaggerate: float = 1.0
) -> list[MovingMode]:
    """The first `count` coupled modes of a model at rest and without timing, in `frames` positions
    each, `exaggerate` times as large."""
    model = without_timing(model)
    point = rest_point(quiet_copy(model))
    linear, rest = linear_at(point), point.qpos
    modes = linear.modes()
    names = mode_names(modes.shapes, *cantilever_names(model, linear.mass, linear.stiffness))
    if count > modes.frequency.size:
        raise InputError(
            f"--modes = {count}: the spacecraft has {modes.frequency.size} coupled modes; give at "
            "most as many."
        )
    swing = np.sin(2.0 * np.pi * np.arange(frames) / frames)
    out: list[MovingMode] = []
    for k in range(count):
        shape = modes.shapes[:, k]
        positions, moves = oscillation(model, rest, shape, exaggerate * swing)
        moves *= exaggerate
        out.append(
            MovingMode(
                names[k],
                float(modes.frequency[k]),
                locked(positions),
                locked(rest),
                moves,
            )
        )
    return out


def oscillation(
    model: "mujoco.MjModel", rest: Array, shape: Array, swing: Array
) -> tuple[Array, float]:
    """Positions `(k, nq)` of a mode `(nv,)` at parts `(k,)` of an amplitude at which it is seen
    well, and how far that moves what moves most [m]."""
    moves, turns = reach(model, rest, shape), turn(model, rest, shape)
    size = min(SWING * float(model.stat.extent) / moves, MOST_TURNED / turns)
    return np.array([moved_positions(model, rest, size * s * shape) for s in swing]), size * moves
