"""The worst sample in MuJoCo: its equations of motion under a sine at the worst frequency, the controller in the loop.

The periodic motion is found by shooting: integrate one period, correct the start by the linear loop, until MuJoCo's motion
closes. What the correction assumes does not matter for the motion that is found.
"""

from collections.abc import Sequence
from itertools import count as count_from

import numpy as np
from scipy.integrate import solve_ivp

from beamchain.craft.plants.controllers import Controller, realised
from beamchain.craft.plants.craft_modes import LinearCraft
from beamchain.craft.robust.systems import looped
from beamchain.engine.library import mujoco
from beamchain.ports.motions import Array

SMALL = 1e-4  # largest of all displacements [m, rad] that the sine is to make: small enough to be linear to 1e-4
CLOSED = 1e-5  # relative to the motion, by which a period may fail to close over what the slowest mode forgets in it
ROUNDS = 8
MOST = 300_000  # evaluations of the motion, a minute or so
SAMPLES = 64  # of a period, of which the output's amplitude is taken


def amplitude(
    craft: LinearCraft, controller: Controller, signals: Sequence[Sequence[int]], ends: tuple[int, int], omega: float
) -> float:
    """Amplitude of an output per amplitude of a sine on an input in MuJoCo, dead times as Pade approximations.

    NaN where no periodic motion was found. `signals` are outputs and inputs that the loops take, `ends` the input that is
    driven and the output that is read; of the craft's linear part only the corrections of the start are made.
    """
    point, model = craft.point, craft.point.model
    data, nv, na, own = point.data(), model.nv, model.na, realised(controller)
    balance, start = np.array(data.qfrc_applied), np.zeros(sum(len(one.labels) for one in craft.outputs))
    rows, columns = signals
    n, m = 2 * nv + na, len(craft.inputs)
    whole = looped(craft.linear.first_order, own, rows, columns)
    through = craft.linear.first_order[3][np.ix_(rows, columns)]
    solve = np.linalg.inv(np.eye(len(rows)) + through @ own[3])  # y = y without u - D u, u = -(C x + D y)
    push = np.linalg.solve(1j * omega * np.eye(whole[0].shape[0]) - whole[0], whole[1][:, ends[0]])
    size = SMALL / float(np.abs(push[:nv]).max())

    def read() -> Array:
        return np.concatenate([one.read(data) for one in craft.outputs]) - start

    def set_up(x: Array, u: Array) -> None:
        data.qpos[:], data.qvel[:], data.act[:] = point.qpos, point.qvel + x[nv : 2 * nv], x[2 * nv : n]
        mujoco.mj_integratePos(model, data.qpos, x[:nv], 1.0)
        data.ctrl[:], data.xfrc_applied[:], data.qfrc_applied[:] = 0.0, 0.0, balance
        for value, one in zip(u, craft.inputs, strict=True):
            one.apply(data, value)
        mujoco.mj_forward(model, data)

    def run(t: float, x: Array) -> tuple[Array, Array]:
        """Slopes and outputs, the sine on."""
        if next(evaluations) > MOST:
            raise StopIteration
        u = np.zeros(m)
        u[ends[0]] = size * np.sin(omega * t)
        set_up(x, u)
        before = read()
        if through.any():  # what the loops' own inputs do to their outputs at once
            before[rows] = solve @ (before[rows] - through @ (own[2] @ x[n:]))
        np.subtract.at(u, columns, own[2] @ x[n:] + own[3] @ before[rows])
        set_up(x, u)
        slopes = np.concatenate([x[nv : 2 * nv], data.qacc, data.act_dot, own[0] @ x[n:] + own[1] @ before[rows]])
        return slopes, read()

    set_up(np.zeros(n), np.zeros(m))
    start = read()
    period, x = 2.0 * np.pi / omega, size * (push.imag)
    back = _correction(whole[0], period)
    evaluations = count_from(1)
    times = np.linspace(0.0, period, SAMPLES, endpoint=False)
    for _ in range(ROUNDS):
        scale = np.abs(x).max()
        try:
            found = solve_ivp(lambda t, x: run(t, x)[0], (0.0, period), x, "Radau", [*times, period], rtol=1e-7,
                              atol=1e-9 * scale, jac=whole[0])  # fmt: skip
        except StopIteration:
            return float("nan")
        if not found.success:
            return float("nan")
        change = back @ (found.y[:, -1] - x)
        seen = np.array([run(t, y)[1][ends[1]] for t, y in zip(times, found.y.T, strict=False)])
        if np.abs(change).max() < CLOSED * scale:
            return float(2.0 / SAMPLES * np.abs(seen @ np.exp(-1j * omega * times)) / size)
        x = x + change
    return float("nan")


def _correction(a: Array, period: float) -> Array:
    """`(1 - exp(a period))^-1` on what decays; by eigenvalues, for a period may hold a million turns of the fastest mode."""
    poles, vectors = (np.asarray(part, dtype=np.complex128) for part in np.linalg.eig(a))
    gap = 1.0 - np.exp((np.minimum(poles.real, 0.0) + 1j * poles.imag) * period)
    still = np.abs(gap) < 1e-9
    return np.asarray((vectors * np.where(still, 0.0, 1.0 / np.where(still, 1.0, gap)) @ np.linalg.pinv(vectors)).real)
