"""Runs of a model: under given forces in one go, without Python between the steps, or step by step
under what its state asks for."""

import csv
import io
import math
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from beamchain.engine.library import mujoco, quiet, rollout_engine
from beamchain.errors import EngineError, InputError
from beamchain.ports.motions import Array

STATE = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)
FORCES = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)
LONGEST = 1_000_000  # rows of a history
LARGEST = 4_000_000  # numbers held at once; longer runs go in pieces


def state_of(data: "mujoco.MjData") -> Array:
    """`(size,)` the physical state of data: time, positions, velocities, ..."""
    state = np.zeros(mujoco.mj_stateSize(data.model, STATE))
    mujoco.mj_getState(data.model, data, state, STATE)
    return state


def readings(
    model: "mujoco.MjModel", states: Array, read: Callable[["mujoco.MjData"], Array]
) -> Array:
    """`(k, ...)` what is read of states `(k, size)`, `mj_forward` done."""
    data = mujoco.MjData(model)
    out: list[Array] = []
    for state in states:
        mujoco.mj_setState(model, data, state, STATE)
        mujoco.mj_forward(model, data)
        out.append(np.array(read(data)))
    return np.array(out)


def roll(
    model: "mujoco.MjModel",
    steps: int,
    forces: Callable[[int, int], Array],
    multiple: int = 1,
    start: "mujoco.MjData | None" = None,
) -> Iterator[tuple[Array, float]]:
    """States `(k, size)` after each of many steps, piece by piece, and the time that a piece took
    [s]: by `mujoco.rollout` on the calling thread. Ends before its time where MuJoCo warns, or a
    state is not finite.

    Args:
        model: at its own step and integrator.
        steps: how many.
        forces: generalised forces `(k, nv)` of the steps from one to before another, each held
            over its step.
        multiple: of so many steps every piece consists.
        start: data in the state in which the run begins; the model's initial one where left out.
    """
    data = mujoco.MjData(model)
    state = state_of(data if start is None else start)[None]
    piece = max(LARGEST // ((state.size + model.nv) * multiple), 1) * multiple
    for first in range(0, steps, piece):
        given = forces(first, min(first + piece, steps))[None]
        out = np.empty((1, given.shape[1], state.size))
        with quiet(), rollout_engine() as engine:
            clock = time.thread_time()
            engine.rollout(
                [model],
                [data],
                state,
                given,
                control_spec=FORCES,
                skip_checks=True,
                nstep=given.shape[1],
                state=out,
            )
            seconds = time.thread_time() - clock
        if int(np.sum(data.warning.number)) > 0 or not np.all(np.isfinite(out[0, -1])):
            return
        yield out[0], seconds
        state = out[:, -1].copy()


def film(
    model: "mujoco.MjModel", data: "mujoco.MjData", times: Array, advance: Callable[[], None]
) -> Array:
    """`(k, nq)` positions at some times `(k,)` [s], each reached by steps that `advance` takes."""
    step = float(model.opt.timestep)
    positions = np.empty((len(times), model.nq))
    for k, moment in enumerate(times):
        while data.time < moment - step / 2.0:
            before = data.time
            advance()
            if data.time < before:  # MuJoCo starts anew where a state is not finite
                raise EngineError(
                    f"the simulation is unstable at the scene's step of {step:g} s; beamchain "
                    "inspect states the largest one, and a fast spin needs RK4 or less torque."
                )
        positions[k] = data.qpos
    return positions


def held_columns(
    content: str, source: str, allowed: Sequence[str]
) -> tuple[list[str], Array, Array]:
    """Of CSV text with a column `time` [s] and some of the columns `allowed`, of which a row holds
    until the next: names of these, times `(k,)` and values `(k, n)`."""
    try:
        rows = [
            row
            for row in csv.reader(io.StringIO(content))
            if row and not row[0].lstrip().startswith("#")
        ]
    except csv.Error as error:
        raise InputError(f"{source} is no CSV ({error}); give numbers between commas.") from None
    head = [cell.strip() for cell in rows[0]] if rows else []
    names = [name for name in head if name != "time"]
    right = "time" in head and names and len({*head}) == len(head) and {*names} <= {*allowed}
    if not right or not 3 <= len(rows) <= LONGEST:
        below = max(len(rows) - 1, 0)
        raise InputError(
            f"{source} has the head {', '.join(head) or 'nothing'} and {below} "
            f"{'row' if below == 1 else 'rows'}; give a column time, one or more of "
            f"{', '.join(allowed)}, and at least two rows."
        )
    table: list[list[float]] = []
    for number, row in enumerate(rows[1:], 1):
        if len(row) != len(head):
            raise InputError(
                f"{source}: row {number} has {len(row)} numbers for {len(head)} columns; give one "
                "number per column in every row."
            )
        try:
            values = [float(cell) for cell in row]
        except ValueError:
            values = [math.nan]
        if not all(map(math.isfinite, values)):
            raise InputError(
                f"{source}: row {number} is {', '.join(row)}; give one finite number per column."
            )
        table.append(values)
    numbers = np.array(table)
    times = numbers[:, head.index("time")]
    late = np.flatnonzero(np.diff(times, prepend=-np.inf) <= 0.0)
    if times[0] != 0.0 or late.size:
        at = int(late[0]) if late.size else 0
        raise InputError(
            f"{source}: row {at + 1} has the time {times[at]:g}; give times that start at 0 and "
            "ascend."
        )
    return names, times, numbers[:, [head.index(name) for name in names]]
