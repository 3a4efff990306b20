"""A wheel's disturbance in a plain MuJoCo run: the wheel turns, and what disturbs it acts on it."""

from copy import copy
from typing import NamedTuple

import numpy as np

from beamchain.errors import EngineError, InputError
from beamchain.toolkit import Array, Complex, LinearCraft, locked, mujoco, readings, roll

CONSTANTS = 5.0  # time constants of the mode until the error is measured
STEPS = 40  # of the shortest period: RK4 then changes damping ratios by less than 1e-6
FASTEST = 2.0  # |s h| of the craft's fastest pole s; RK4 takes up to 2.7
PERIODS = 20.0  # of the lowest order, over which the error is measured
MOST_STEPS = 2_000_000  # a few minutes


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
    craft: LinearCraft, omega: Array, amplitudes: Complex, output: int, settling: float
) -> tuple[Array, Array, list[float], float]:
    """Times and values of an output, its amplitude at every order, and the step [s].

    Of every order a row of `amplitudes` `(orders, inputs)` acts at its frequency in `omega`
    `(orders,)` [rad/s]. The run begins at rest but for the wheels, and takes five times `settling`
    [s] before it is measured.

    Raises:
        InputError: it would take too many steps.
        EngineError: it is unstable.
    """
    fastest = float(np.abs(np.linalg.eigvals(craft.linear.first_order()[0])).max(initial=0.0))
    timestep = min(2.0 * np.pi / (STEPS * omega.max()), FASTEST / max(fastest, 1e-300))
    before = int(np.ceil(CONSTANTS * settling / timestep))
    window = int(np.ceil(PERIODS * 2.0 * np.pi / omega.min() / timestep))
    if before + window > MOST_STEPS:
        raise InputError(
            f"the run would take {before + window} steps of {timestep:.2g} s until the mode has "
            f"settled, more than the {MOST_STEPS} taken; give speeds at which a mode of higher "
            "frequency or damping is the worst."
        )
    model = copy(craft.point.model)
    model.opt.timestep = timestep
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    balanced = craft.point.data()
    pushed = amplitudes @ craft.linear.inputs.force.T

    def forces(first: int, end: int) -> Array:
        middle = timestep * (np.arange(first, end) + 0.5)  # of the step over which each is held
        turning = np.real(np.exp(1j * np.outer(middle, omega)) @ pushed)
        return turning + balanced.qfrc_applied

    def read(data: "mujoco.MjData") -> Array:
        return np.concatenate([group.read(data) for group in craft.outputs])[output]

    values = np.empty(0)
    done = 0
    for states, _ in roll(model, before + window, forces, start=balanced):
        values = np.append(values, readings(model, states[max(before - done, 0) :], read))
        done += len(states)
    if done < before + window:
        raise EngineError(f"the run is unstable at its step of {timestep:.2g} s.")
    values -= read(balanced)
    times = timestep * np.arange(before + 1, before + window + 1, dtype=np.float64)
    found = _amplitudes(times, values, omega.tolist(), _nutation(craft))
    return locked(times), locked(values), found, timestep


def _nutation(craft: LinearCraft) -> list[float]:
    """Frequencies of a craft's nutation [rad/s], which nothing damps."""
    form = craft.form()
    names = [name for name in form.names if name.startswith("nutation_")]
    return [float(np.abs(form.poles_of(name)[0])) for name in form.oscillators(names)]


def _amplitudes(times: Array, values: Array, driven: list[float], free: list[float]) -> list[float]:
    """Amplitudes of driven frequencies [rad/s] in a record that holds free ones too, and drifts."""
    share = (times - times[0]) / (times[-1] - times[0])
    columns = [np.ones(times.size), share]
    for omega in (*driven, *free):
        columns += [np.cos(omega * times), np.sin(omega * times)]
    fitted = np.linalg.lstsq(np.column_stack(columns), values, rcond=None)[0]
    return [float(np.hypot(fitted[2 + 2 * i], fitted[3 + 2 * i])) for i in range(len(driven))]
