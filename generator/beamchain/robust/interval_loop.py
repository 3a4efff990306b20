"""The closed loop N of an uncertain plant over an interval of frequencies, as a complex state
space: dead times by their expansion about the middle, what that leaves as an error that is bounded.
"""

from typing import Any, NamedTuple

import control
import numpy as np
from msgspec import structs
from scipy.linalg import block_diag

from beamchain.robust.multipliers import ComplexSystem
from beamchain.robust.search import Loops
from beamchain.spec import Controller
from beamchain.toolkit import Array, Complex, close_feedback, realise, subsystem

ORDER = 4  # of the expansion of a dead time
# half width of an interval times the dead time, to which the expansion is used: its error is 2e-5
EXPANDED = 2.0


class Delay(NamedTuple):
    """`e^(-s T)` over an interval: `system` in the state space, and within `error` of it."""

    system: tuple[Complex, Complex, Complex, Complex]
    error: float


class LocalLoop(NamedTuple):
    """N over an interval with one more channel per dead time, behind those of the deltas.

    Args:
        system: its channels, scaled so that every delta is in [-1, 1] and every error of a dead
            time is a complex number of a size of at most 1; then d and e.
        blocks: number of the delta of each channel of a delta.
        errors: of the dead times, relative.
    """

    system: ComplexSystem
    blocks: list[int]
    errors: Array


def delay_near(delay: float, low: float, high: float) -> Delay:
    """A dead time [s] from `low` to `high` [rad/s].

    About the middle c, `e^(-s T) = e^(-j c T) e^(-(s - j c) T)`, the second by Pade, q(-x)/q(x). At
    `x = j y` that has the size 1 and a phase whose error grows with |y|, since its slope, 1 less
    the group delay, is `c^2 y^(2 n) / |q(j y)|^2`: the numerator is an even polynomial of degree
    2 n that vanishes to the order 2 n. So the error is largest at the ends. Where the interval is
    too wide for that, all that is used is that the size is 1.
    """
    centre = (low + high) / 2.0
    half = (high - low) / 2.0 * delay
    if not half <= EXPANDED:
        states = np.zeros((0, 0), np.complex128)
        driven = np.zeros((0, 1), np.complex128)
        return Delay((states, driven, driven.T, np.zeros((1, 1), np.complex128)), 1.0)
    top, bottom = control.pade(1.0, ORDER)
    phase = -half - float(np.angle(np.polyval(top, 1j * half) / np.polyval(bottom, 1j * half)))
    phase = float(np.angle(np.exp(1j * phase)))
    error = 2.0 * abs(np.sin(phase / 2.0)) + 1e-15
    # in x = (s - j c) T
    expansion = control.ss(control.tf(top, bottom))
    a, b, c, d = (np.asarray(getattr(expansion, name), dtype=np.complex128) for name in "ABCD")
    turned = np.exp(-1j * centre * delay)
    a = a / delay + 1j * centre * np.eye(ORDER)
    return Delay((a, b / delay, turned * c, turned * d), error)


def local_loop(loops: Loops, low: float, high: float) -> LocalLoop:
    """N from `low` to `high` [rad/s], the latter perhaps infinite.

    `u = -(P + E eps) R y`: R the loop without its dead time, P the expansion of that, E its error.
    """
    parts = loops.controller.loop
    undelayed = Controller(loop=tuple(structs.replace(loop, delay=0.0) for loop in parts))
    delays = [delay_near(loop.delay, low, high) for loop in parts if loop.delay]
    late = [i for i, loop in enumerate(parts) if loop.delay]
    count = len(late)
    plant = loops.plant
    filters = realise(undelayed)
    systems = zip(*(delay.system for delay in delays), strict=True)
    pades = [block_diag(*same) for same in systems] if count else [np.zeros((0, 0))] * 4
    a, b, c, d = (
        np.asarray(block_diag(p, q, r), dtype=np.complex128)
        for p, q, r in zip(plant, filters, pades, strict=True)
    )
    seen, driven = plant[3].shape
    # signals of R behind those of M, then those of P
    after = seen + len(parts), driven + len(parts)
    gain = np.zeros(d.T.shape)
    for i, (row, column) in enumerate(zip(loops.rows, loops.columns, strict=True)):
        gain[driven + i, row] = 1.0
        if i in late:
            k = late.index(i)
            gain[after[1] + k, seen + i] = 1.0
            gain[column, after[0] + k] = -1.0
        else:
            gain[column, seen + i] = -1.0
    errors = np.array([delay.error for delay in delays])
    whole: Any = (a, b, c, d)
    whole = close_feedback(whole, gain)
    channels = loops.blocks.size
    rows = [*loops.seen[:channels], *(seen + i for i in late), loops.seen[-1]]
    columns = [*loops.driven[:channels], *(loops.columns[i] for i in late), loops.driven[-1]]
    a, b, c, d = (part.astype(np.complex128) for part in subsystem(whole, rows, columns))
    d[-1, -1] += loops.offset
    of_errors = np.s_[channels : channels + count]
    b[:, of_errors] *= -1.0
    d[:, of_errors] *= -1.0
    c[of_errors] *= errors[:, None]
    d[of_errors] *= errors[:, None]
    return LocalLoop(ComplexSystem(a, b, c, d), loops.blocks.tolist(), errors)


def in_box(loop: LocalLoop, centre: Array, half: Array) -> ComplexSystem:
    """The loop's state space with deltas `centre + half d` `(blocks,)`, every d in [-1, 1]."""
    size = loop.system.d.shape[0]
    channels = len(loop.blocks)
    gain = np.zeros((size, size))
    np.fill_diagonal(gain[:channels, :channels], centre[loop.blocks])
    whole: Any = tuple(loop.system)
    a, b, c, d = (np.asarray(part, np.complex128) for part in close_feedback(whole, gain))
    scale = np.ones(size)
    scale[:channels] = half[loop.blocks]
    return ComplexSystem(a, b, c * scale[:, None], d * scale[:, None])
