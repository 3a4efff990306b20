"""Delay margin of a sampled loop on a continuous plant: a dead time between samples turns each mode
at its own frequency, those beyond pi/T too, which samples show as slower ones."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment, root

from beamchain.control.closed_loop import ClosedLoop
from beamchain.control.sampling import sampled
from beamchain.control.systems import Complex, System, response
from beamchain.ports.motions import Array

PER_TURN = 24  # dead times at which a loop is looked at, per period of the plant's fastest mode
MOST = 4000  # of them within a sample
TURNS = 50  # of a crossing, within which it meets a whole number of samples
REFINED = 4  # of the shortest dead times found, which are polished
UNLIKE = 1e3  # distance of crossings of which one rises and one falls, in place of a logarithm
HELD = 1e-8  # left of |1 + L| at a dead time that is polished


class _Crossings(NamedTuple):
    """Where an open loop has the size one: frequencies [rad/s], what it lacks to -1 [rad, 0 to
    2 pi) and whether its size rises there, each `(k,)`."""

    omega: Array
    lacks: Array
    rises: NDArray[np.bool_]


def sampled_delay_margin(closed: ClosedLoop, held: System, i: int) -> float:
    """The shortest dead time at an input [s] beside which a sampled closed loop, all others closed,
    is not stable; `held` is its plant in continuous time, whose inputs are held over the samples.
    """
    step = closed.step
    fastest = float(np.abs(np.linalg.eigvals(held[0]).imag).max(initial=0.0))
    count = min(MOST, PER_TURN + int(PER_TURN * fastest * step / (2.0 * np.pi)))
    parts = np.linspace(0.0, step, count + 1)
    driven = _driven(held, i, parts)
    left, direct, z = _by_state(closed, i, closed.omega)
    found: list[tuple[float, float]] = []
    before = None
    last = np.zeros(count + 1)
    for k in range(count + 1):
        # inputs of this sample act over T - f, those of the one before over the rest
        now = driven[count - k]
        loop = left @ now + (left @ (driven[count] - now) + direct) / z
        after = _crossings(closed.omega, loop)
        if before is not None:
            found += _between(before, after, parts[k - 1 : k + 1], step)
        before, last[k] = after, loop[-1].real
    for whole in (0, 1):  # through z = -1
        there = 1.0 + (-1.0) ** whole * last
        for k in np.flatnonzero(there[1:] * there[:-1] < 0.0):
            share = there[k] / (there[k] - there[k + 1])
            found.append((whole * step + parts[k] + share * (parts[1] - parts[0]), np.pi / step))

    def at(omega: float, delay: float) -> complex:
        whole = int(delay // step)
        left, direct, z = _by_state(closed, i, np.array([omega]))
        now, both = _driven(held, i, np.array([step - (delay - whole * step), step]))
        loop = left @ now + (left @ (both - now) + direct) / z
        return complex(1.0 + loop[0] / z[0] ** whole)

    return min((_polished(at, *one, step) for one in sorted(found)[:REFINED]), default=float("inf"))


def _driven(held: System, i: int, times: Array) -> Array:
    """`(k, n)` states after times for which an input was one, from rest; of more than two times
    evenly from 0 on."""
    a, b, c, d = held
    one = a, b[:, [i]], c, d[:, [i]]
    if times.size == 2:
        return np.array([sampled(one, 0.0, float(t))[1][:, 0] for t in times])
    a, b, *_ = sampled(one, 0.0, float(times[1] - times[0]))
    out = np.zeros((times.size, a.shape[0]))
    for k in range(1, times.size):
        out[k] = a @ out[k - 1] + b[:, 0]
    return out


def _by_state(closed: ClosedLoop, i: int, omega: Array) -> tuple[Complex, Complex, Complex]:
    """`(k, n)` open loop at an input, the others closed, by the states that the input drives in a
    sample; `(k,)` by the input itself, and z."""
    z = closed.to_point(omega)
    a, _, c, d = closed.plant
    controller = closed.fed.response(z)
    loop = controller @ response(closed.plant, z)
    rest = [j for j in range(loop.shape[1]) if j != i]
    row = np.zeros(loop.shape[:2], dtype=np.complex128)
    row[:, i] = 1.0
    if rest:
        # L_i = L_ii - L_ir (1 + L_rr)^-1 L_ri
        others = np.eye(len(rest)) + loop[:, rest][:, :, rest]
        across = loop[:, i, rest][:, :, None]
        row[:, rest] = -np.linalg.solve(np.swapaxes(others, 1, 2), across)[:, :, 0]
    seen = np.einsum("ki,kij->kj", row, controller)
    inner = z[:, None, None] * np.eye(a.shape[0]) - a.T
    left = np.linalg.solve(inner, (seen @ c)[:, :, None])[:, :, 0]
    return left.astype(np.complex128), (seen @ d[:, i]).astype(np.complex128), z


def _crossings(omega: Array, loop: Complex) -> _Crossings:
    size = np.log(np.maximum(np.abs(loop), 1e-300))
    at = np.flatnonzero((size[1:] > 0.0) != (size[:-1] > 0.0))
    share = size[at] / (size[at] - size[at + 1])
    value = loop[at] + share * (loop[at + 1] - loop[at])
    lacks = np.mod(np.angle(-value), 2.0 * np.pi)
    return _Crossings(omega[at] + share * (omega[at + 1] - omega[at]), lacks, size[at + 1] > 0.0)


def _between(
    before: _Crossings, after: _Crossings, parts: Array, step: float
) -> list[tuple[float, float]]:
    """Dead times [s] between two parts of a sample at which a crossing is at -1, the shortest of
    each, and its frequency [rad/s]."""
    out: list[tuple[float, float]] = []
    far = np.abs(np.log(before.omega[:, None] / after.omega))
    alike = before.rises[:, None] == after.rises
    for one, other in zip(*linear_sum_assignment(np.where(alike, far, UNLIKE)), strict=True):
        if not alike[one, other]:
            continue
        omega = np.array([before.omega[one], after.omega[other]])
        turn = float(after.lacks[other] - before.lacks[one])
        turn -= 2.0 * np.pi * round(turn / (2.0 * np.pi))
        lacks = before.lacks[one] + np.array([0.0, turn])
        # whole samples d turn by w d T: the real number of them that would do, each turn more
        turns = np.arange(-1, TURNS)
        samples = (lacks + 2.0 * np.pi * turns[:, None]) / (omega * step)
        low, high = samples.min(axis=1), samples.max(axis=1)
        whole = np.ceil(low)
        there = (whole <= high) & (whole >= 0.0) & (high > low)
        if there.any():
            first = int(np.flatnonzero(there)[0])
            pair = samples[first]
            share = (whole[first] - pair[0]) / (pair[1] - pair[0])
            delay = whole[first] * step + parts[0] + share * (parts[1] - parts[0])
            if delay > 0.0:
                out.append((float(delay), float(omega[0] + share * (omega[1] - omega[0]))))
    return out


def _polished(
    at: Callable[[float, float], complex], delay: float, omega: float, step: float
) -> float:
    """A dead time at which `1 + L` is zero, from one near it."""

    def rest(x: Array) -> Array:
        value = at(float(x[0]) * omega, max(float(x[1]), 0.0) * step)
        return np.array([value.real, value.imag])

    found: Any = root(rest, [1.0, delay / step], tol=1e-12)
    near = abs(found.x[1] * step - delay) < 0.1 * step
    return float(found.x[1]) * step if near and float(np.linalg.norm(found.fun)) < HELD else delay
