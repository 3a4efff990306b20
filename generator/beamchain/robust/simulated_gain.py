"""The worst sample run in MuJoCo: `mj_step` under a sine, the controller in the loop at every step.

The run begins in the steady motion that the linear loop predicts, and lasts until any other steady
motion would have shown: what is left of a start decays meanwhile to `FORGOTTEN` of the gain.
"""

import copy
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain.spec import Controller
from beamchain.toolkit import Array, LinearCraft, System, close_loop, mujoco, place, places, realise

# largest of all displacements [m, rad] that the sine is to make: small enough to be linear to 1e-4
SMALL = 1e-4
FORGOTTEN = 0.02  # of the gain: what is left of a start where the amplitude is measured
STEPS = 400  # of a period at least: what extrapolates the controller's torque is then right to 1e-4
FASTEST = 2.0  # |s h| of the craft's fastest pole s; RK4 takes up to 2.7
MOST_STEPS = 300_000  # about half a minute
STILL = 1e-2  # rad that a sine turns until a start is forgotten, below which it is not waited for


class Run(NamedTuple):
    """How a run goes: `omega` of the cosine [rad/s], whether it is `still` in the whole run,
    `timestep` [s], the number of `steps`, and of the last of them, in which the output is measured.
    """

    omega: float
    still: bool
    timestep: float
    steps: int
    window: int


class SteppedController:
    """The loops of a controller, `u = -(C x + D y)`, stepped by the trapezoidal rule.

    Of the present outputs, `u = -(free + gain y)`.

    Args:
        system: A, B, C, D of all loops side by side.
        timestep: [s].
        state: `(n,)` x at the first step.
        measured: `(loops,)` y at the first step.
    """

    def __init__(self, system: System, timestep: float, state: Array, measured: Array) -> None:
        a, b, self._c, d = system
        half = timestep / 2.0 * a
        eye = np.eye(a.shape[0])
        # (1 - h A/2) x_(k+1) = (1 + h A/2) x_k + h/2 B (y_k + y_(k+1))
        inverse = np.linalg.inv(eye - half)
        self._keep = inverse @ (eye + half)
        self._take = timestep / 2.0 * inverse @ b
        self.gain = self._c @ self._take + d
        self._without = state - self._take @ measured  # x_k less the share of y_k

    @property
    def free(self) -> Array:
        """`(loops,)` what the loops give without the present outputs."""
        return self._c @ self._without

    def advance(self, measured: Array) -> None:
        """To the next step, from the outputs `(loops,)` of the present one."""
        state = self._without + self._take @ measured
        self._without = self._keep @ state + self._take @ measured


def simulated_gain(
    craft: LinearCraft, controller: Controller, ends: tuple[str, str], omega: float, settling: float
) -> float:
    """Amplitude of an output per amplitude of a sine on an input, in a run of `mj_step` with RK4.

    Args:
        craft: of the sample; its linear part says where the run begins and how short a step is.
        controller: its loops; dead times as Pade approximations.
        ends: names of the input that is driven and of the output that is read.
        omega: of the sine [rad/s]; one that hardly turns in `settling` is run no longer than it.
        settling: how long a start takes to be forgotten [s].

    Returns:
        NaN where the run would take more than `MOST_STEPS`, or blows up.
    """
    run = _plan(craft, omega, settling)
    if run.steps > MOST_STEPS:
        return float("nan")
    times, seen = _measure(craft, controller, ends, run)
    if not np.all(np.isfinite(seen)):
        return float("nan")
    phase = run.omega * times
    if run.still:
        return float(np.abs(np.mean(seen)) / np.mean(np.cos(phase)))
    # a cos(omega t) + b sin(omega t) + c + d t: what turns steadily drifts
    share = (times - times[0]) / (times[-1] - times[0])
    basis = np.column_stack([np.cos(phase), np.sin(phase), np.ones(run.window), share])
    cosine, sine, *_ = np.linalg.lstsq(basis, seen, rcond=None)[0]
    return float(np.hypot(cosine, sine))


def _plan(craft: LinearCraft, omega: float, settling: float) -> Run:
    """Steps that resolve the sine and keep the craft's fastest pole stable."""
    fastest = float(np.abs(np.linalg.eigvals(craft.linear.first_order()[0])).max(initial=0.0))
    still = 0.0 < omega * settling < STILL
    span = settling if still else 2.0 * np.pi / omega
    window = _whole(max(float(STEPS), span * fastest / FASTEST))
    timestep = span / window
    steps = _whole(settling / timestep) + window
    return Run(omega, still, timestep, steps, window)


def _whole(count: float) -> int:
    """Rounded up; anything beyond `MOST_STEPS` is too many."""
    return int(np.ceil(min(count, MOST_STEPS + 1.0)))


def _measure(
    craft: LinearCraft, controller: Controller, ends: tuple[str, str], run: Run
) -> tuple[Array, Array]:
    """Times `(window,)` and the output per amplitude of the input, of the last steps of a run."""
    simulation = _LoopRun(craft, controller, ends, run)
    first = run.steps - run.window
    times = run.timestep * np.arange(first, run.steps, dtype=np.float64)
    seen = np.array([simulation.step(k, look=k >= first) for k in range(run.steps)])
    return times, seen[first:]


class _LoopRun:
    """A MuJoCo run of a craft with its controller in the loop, under a sine at an input.

    It starts on the predicted steady motion, whose amplitude is small.
    """

    def __init__(
        self, craft: LinearCraft, controller: Controller, ends: tuple[str, str], run: Run
    ) -> None:
        input_names, output_names, *_ = craft.signals
        self._rows, self._columns = places(controller, input_names, output_names)
        self._driven = place(ends[0], input_names, "input", "")
        self._read = place(ends[1], output_names, "output", "")
        self._craft = craft
        self._run = run
        self._model = copy.copy(craft.point.model)
        self._model.opt.timestep = run.timestep
        self._model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
        self._data = craft.point.data()
        loops = realise(controller)
        system = craft.linear.first_order()
        feedthrough = system[3]
        self._through = feedthrough[np.ix_(self._rows, self._columns)]
        self._direct = bool(np.any(self._through) or np.any(feedthrough[self._read]))
        motion, signals = self._steady(close_loop(system, loops, self._rows, self._columns))
        self._size = SMALL / float(np.abs(motion[: self._model.nv]).max())
        state = np.asarray(self._size * motion.real, dtype=np.float64)
        of_craft = 2 * self._model.nv + self._model.na
        measured = self._size * signals[self._rows].real
        self._controller = SteppedController(loops, run.timestep, state[of_craft:], measured)
        torque = self._size * signals[len(output_names) :]
        back = np.exp(-1j * run.omega * run.timestep)
        self._torque_before = -np.real(torque * back)
        # y = y0 + D u and u = -(free + gain y): y = (1 + D gain)^-1 (y0 - D free)
        self._solve = np.linalg.inv(np.eye(len(self._rows)) + self._through @ self._controller.gain)
        self._at_rest = self._outputs()
        self._set_state(state)

    def step(self, k: int, *, look: bool) -> float:
        """The output per amplitude of the input at step `k`, zero where it is not looked at; then
        the step."""
        run = self._run
        now = k * run.timestep
        if self._direct:
            self._drive(now, np.zeros(len(self._columns)))
        values = self._outputs() - self._at_rest
        controller = self._controller
        measured = self._solve @ (values[self._rows] - self._through @ controller.free)
        torque = -(controller.free + controller.gain @ measured)
        if look and self._direct:
            self._drive(now, torque)
            values = self._outputs() - self._at_rest
        # held over the step: the values at its middle, those of the loops extrapolated
        self._drive(now + run.timestep / 2.0, 1.5 * torque - 0.5 * self._torque_before)
        mujoco.mj_step(self._model, self._data)
        self._torque_before = torque
        controller.advance(measured)
        return float(values[self._read] / self._size) if look else 0.0

    def _steady(self, closed: System) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """States and signals of the steady motion, the real part of `motion e^(j omega t)`, of a
        unit disturbance."""
        a, b, c, d = closed
        resolvent = 1j * self._run.omega * np.eye(a.shape[0]) - a
        motion = np.asarray(np.linalg.solve(resolvent, b[:, self._driven]), dtype=np.complex128)
        return motion, np.asarray(c @ motion + d[:, self._driven], dtype=np.complex128)

    def _set_state(self, state: Array) -> None:
        nv = self._model.nv
        na = self._model.na
        mujoco.mj_integratePos(self._model, self._data.qpos, state[:nv], 1.0)
        self._data.qvel[:] += state[nv : 2 * nv]
        self._data.act[:] = state[2 * nv : 2 * nv + na]

    def _drive(self, time: float, torque: Array) -> None:
        """The disturbance at a time [s], and the controller's torque `(columns,)`."""
        data = self._data
        data.ctrl[:] = 0.0
        data.xfrc_applied[:] = 0.0
        inputs = self._craft.inputs
        inputs[self._driven].apply(data, self._size * float(np.cos(self._run.omega * time)))
        for column, value in zip(self._columns, torque, strict=True):
            inputs[column].apply(data, float(value))

    def _outputs(self) -> Array:
        mujoco.mj_forward(self._model, self._data)
        return np.concatenate([output.read(self._data) for output in self._craft.outputs])
