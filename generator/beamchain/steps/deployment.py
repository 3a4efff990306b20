"""A run of a spacecraft from a keyframe, under commands of its actuators and with hinges that latch
at their stops stage by stage, in positions that a film shows."""

import copy
from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from beamchain.checks import unknown
from beamchain.engine.library import mujoco
from beamchain.engine.model_rows import sprung
from beamchain.engine.operating_point import keyframe_names
from beamchain.engine.runs import film, held_columns
from beamchain.engine.signals import actuator_names
from beamchain.errors import InputError
from beamchain.ports.motions import Array, locked
from beamchain.steps.latch import Latched, latch, unlatch


class Run(NamedTuple):
    """A simulated run.

    `times` `(k,)` [s]; `positions` `(k, nq)`; `start` `(k, nq)`: the shape at the start, on the
    spacecraft where it is; `rigid` `(k, nq)`: the positions with sprung joints at rest; `latched`:
    the hinges in the order in which they latched; `waiting`: those that had not at the end.
    """

    times: Array
    positions: Array
    start: Array
    rigid: Array
    latched: tuple[Latched, ...]
    waiting: tuple[str, ...]


class Commands(NamedTuple):
    """Commands `(k, n)` of actuators, each held from its time `(k,)` [s] until the next."""

    actuators: tuple[str, ...]
    times: Array
    values: Array

    def at(self, time: float) -> Array:
        """`(n,)` the commands at a time; the last ones after their time."""
        return self.values[np.searchsorted(self.times, time, "right") - 1]


def commands(model: "mujoco.MjModel", content: str, source: str) -> Commands:
    """The commands of CSV text with a column `time` [s] and columns named after actuators.

    Raises:
        InputError: the text is no such table, or asks for more than an actuator's `ctrlrange`.
    """
    known = actuator_names(model)
    if not known:
        motor = '<actuator><motor name="z" site="SITE" gear="0 0 0 0 0 1"/></actuator>'
        raise InputError(
            f"{source}: the spacecraft has no actuator of these commands; give its file one, such "
            f"as {motor}, or leave --torque out."
        )
    names, times, values = held_columns(content, source, known)
    for name, column in zip(names, values.T, strict=True):
        low, high = model.actuator_ctrlrange[known.index(name)]
        beyond = column[(column < low) | (column > high)]
        if bool(model.actuator_ctrllimited[known.index(name)]) and beyond.size:
            raise InputError(
                f"{source}: {name} = {beyond[0]:g} is beyond its ctrlrange [{low:g}, {high:g}]; "
                "give commands within it."
            )
    return Commands(tuple(names), locked(times), locked(values))


def hinge_stages(model: "mujoco.MjModel", patterns: Sequence[str]) -> list[list[str]]:
    """The hinges of each stage; a pattern is names with `*` and `?`, separated by commas."""
    kind = int(mujoco.mjtJoint.mjJNT_HINGE)
    hinges = [str(model.joint(int(j)).name) for j in np.flatnonzero(model.jnt_type == kind)]
    stages: list[list[str]] = []
    for pattern in patterns:
        stage: list[str] = []
        for part in pattern.split(","):
            found = [name for name in hinges if name and fnmatchcase(name, part)]
            if not found:
                raise unknown("hinge of --latch", part, hinges)
            stage += found
        stages.append(stage)
    every = [name for stage in stages for name in stage]
    twice = sorted({name for name in every if every.count(name) > 1})
    if twice:
        raise InputError(f"--latch names {twice[0]!r} twice; a hinge latches once.")
    return stages


def simulate_run(
    model: "mujoco.MjModel",
    key: str | None,
    seconds: float,
    frames: int,
    stages: Sequence[Sequence[str]] = (),
    given: Commands | None = None,
) -> Run:
    """Simulate from a keyframe (None: the pose of the file) with MuJoCo's own steps.

    Args:
        model: stays as it is.
        key: name of the keyframe.
        seconds: how long [s].
        frames: how many positions are kept, evenly spaced in time.
        stages: hinges that latch at their stops. The first stage moves from the start; the hinges
            of later ones are held as they are until all of the stage before have latched.
        given: commands of actuators over the run; the others keep those of the keyframe, or none.
    """
    model = copy.copy(model)
    data = mujoco.MjData(model)
    if key is not None:
        names = keyframe_names(model)
        if key not in names:
            raise unknown("--pose", key, names)
        mujoco.mj_resetDataKeyframe(model, data, model.key(key).id)
    mujoco.mj_forward(model, data)
    for stage in stages[1:]:
        for name in stage:
            latch(model, data, name, angle=float(data.joint(name).qpos[0]))
    start, step = float(data.time), float(model.opt.timestep)
    known = actuator_names(model)
    commanded = [] if given is None else [known.index(name) for name in given.actuators]
    ahead = [list(stage) for stage in stages]
    latched: list[Latched] = []

    def advance() -> None:
        """One step, in which waiting hinges may latch."""
        while ahead and not ahead[0]:
            ahead.pop(0)
            for name in ahead[0] if ahead else ():
                unlatch(model, data, name)
        for name in list(ahead[0]) if ahead else ():
            if (done := latch(model, data, name)) is not None:
                latched.append(done)
                ahead[0].remove(name)
        if given is not None:
            data.ctrl[commanded] = given.at(float(data.time) - start + step / 2.0)
        mujoco.mj_step(model, data)

    times = np.linspace(0.0, seconds, frames)
    positions = film(model, data, data.time + times, advance)
    waiting = tuple(name for stage in ahead for name in stage)
    shape = positions[[0]].repeat(frames, 0)
    free = model.jnt_qposadr[model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE)]
    base = (free[:, None] + np.arange(7)).ravel()
    shape[:, base] = positions[:, base]
    rigid = positions.copy()
    bent = model.jnt_qposadr[sprung(model)]
    rigid[:, bent] = model.qpos0[bent]
    return Run(
        locked(times), locked(positions), locked(shape), locked(rigid), tuple(latched), waiting
    )
