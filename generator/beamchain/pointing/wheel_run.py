"""A wheel's disturbance in a plain MuJoCo run: the wheel turns, and what disturbs it acts on it."""

from copy import copy
from typing import NamedTuple

import numpy as np

from beamchain.errors import InputError
from beamchain.toolkit import Array, Complex, Input, LinearCraft, locked, mujoco

CONSTANTS = 5.0  # time constants of the mode until the error is measured
STEPS = 40  # of the shortest period: RK4 then changes damping ratios by less than 1e-6
FASTEST = 2.0  # |s h| of the craft's fastest pole s; RK4 takes up to 2.7
PERIODS = 20.0  # of the lowest order, over which the error is measured
MOST_STEPS = 2_000_000  # a few minutes


class Acting(NamedTuple):
    """One order of a disturbance in a run.

    Args:
        omega: its frequency [rad/s].
        amplitudes: `(inputs,)` complex, of every input.
        expected: amplitude of the output that is predicted.
    """

    omega: float
    amplitudes: Complex
    expected: float


class WheelRun(NamedTuple):
    """A pointing error in a plain MuJoCo run, beside the stated one.

    Args:
        source: whose disturbance acted.
        output: that is looked at.
        speed: of the wheel [rad/s].
        stated, simulated: amplitude of the error, all orders together.
        orders: predicted and simulated amplitude of every order.
        times, values: `(k,)` [s] and the output, of the part of the run that was measured.
        timestep: of the run [s], with RK4.
    """

    source: str
    output: str
    speed: float
    stated: float
    simulated: float
    orders: tuple[tuple[float, float], ...]
    times: Array
    values: Array
    timestep: float

    @property
    def difference(self) -> float:
        """Relative, of the simulated from the stated amplitude."""
        return self.simulated / self.stated - 1.0 if self.stated else float("nan")


def run_wheel(
    craft: LinearCraft, inputs: list[Input], acting: list[Acting], output: int, settling: float
) -> tuple[Array, Array, list[float], float]:
    """Times and values of an output, its amplitude at every order, and the step [s].

    The run begins at rest but for the wheels, and takes five times `settling` [s] before it is
    measured.

    Raises:
        InputError: it would take too many steps.
    """
    highest = max(order.omega for order in acting)
    lowest = min(order.omega for order in acting)
    fastest = float(np.abs(np.linalg.eigvals(craft.linear.first_order()[0])).max(initial=0.0))
    timestep = min(2.0 * np.pi / (STEPS * highest), FASTEST / max(fastest, 1e-300))
    before = int(np.ceil(CONSTANTS * settling / timestep))
    window = int(np.ceil(PERIODS * 2.0 * np.pi / lowest / timestep))
    if before + window > MOST_STEPS:
        raise InputError(
            f"the run would take {before + window} steps of {timestep:.2g} s until the mode has "
            f"settled, more than the {MOST_STEPS} taken; give speeds at which a mode of higher "
            "frequency or damping is the worst."
        )
    model = copy(craft.point.model)
    model.opt.timestep = timestep
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    data.qpos[:] = craft.point.qpos
    data.qvel[:] = craft.point.qvel
    # what drags on turning wheels is made up for
    data.qfrc_applied[:] = craft.point.data().qfrc_applied
    number, place = _place(craft, output)
    seen = craft.outputs[number]
    mujoco.mj_forward(model, data)
    at_rest = float(seen.read(data)[place])
    values = np.zeros(window)
    for k in range(before + window):
        # held over the step: the value at its middle
        now = (k + 0.5) * timestep
        data.xfrc_applied[:] = 0.0
        for order in acting:
            force = np.real(order.amplitudes * np.exp(1j * order.omega * now))
            for signal, value in zip(inputs, force, strict=True):
                signal.apply(data, float(value))
        mujoco.mj_step(model, data)
        if k >= before:
            mujoco.mj_forward(model, data)
            values[k - before] = float(seen.read(data)[place]) - at_rest
    times = timestep * np.arange(before + 1, before + window + 1, dtype=np.float64)
    found = _amplitudes(times, values, [order.omega for order in acting], _nutation(craft))
    return locked(times), locked(values), found, timestep


def _place(craft: LinearCraft, output: int) -> tuple[int, int]:
    """Which group of outputs a number belongs to, and its place there."""
    for number, group in enumerate(craft.outputs):
        if output < len(group.labels):
            return number, output
        output -= len(group.labels)
    raise IndexError(output)


def _nutation(craft: LinearCraft) -> list[float]:
    """Frequencies of a craft's nutation [rad/s], which nothing damps."""
    form = craft.form()
    names = [name for name in form.names if name.startswith("nutation_")]
    places = [
        [form.names.index(word) for word in (name, f"{name}_rate")]
        for name in form.oscillators(names)
    ]
    return [float(np.sqrt(np.linalg.det(form.a[np.ix_(at, at)]))) for at in places]


def _amplitudes(times: Array, values: Array, driven: list[float], free: list[float]) -> list[float]:
    """Amplitudes of driven frequencies [rad/s] in a record that holds free ones too, and drifts."""
    share = (times - times[0]) / (times[-1] - times[0])
    columns = [np.ones(times.size), share]
    for omega in (*driven, *free):
        columns += [np.cos(omega * times), np.sin(omega * times)]
    fitted = np.linalg.lstsq(np.column_stack(columns), values, rcond=None)[0]
    return [float(np.hypot(fitted[2 + 2 * i], fitted[3 + 2 * i])) for i in range(len(driven))]
