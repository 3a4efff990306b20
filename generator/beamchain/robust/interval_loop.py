"""The closed loop N of an uncertain plant over an interval of frequencies, as a complex state
space: dead times by their expansion about the middle, what that leaves as an error that is bounded.
"""

from typing import Any, NamedTuple

import control
import numpy as np
from msgspec import structs
from scipy.linalg import block_diag

from beamchain.robust.multipliers import ComplexSystem
from beamchain.robust.uncertain_loop import UncertainLoop
from beamchain.spec import Controller
from beamchain.toolkit import (
    Array,
    Complex,
    close_feedback,
    places,
    realise,
    subsystem,
)

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
    half = (high - low) / 2.0 * delay if delay else 0.0
    if not delay or half > EXPANDED:
        driven = np.zeros((0, 1), np.complex128)
        passed = np.full((1, 1), 0.0 if delay else 1.0, np.complex128)
        return Delay((driven @ driven.T, driven, driven.T, passed), 1.0 if delay else 0.0)
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


def local_loop(loops: UncertainLoop, low: float, high: float) -> LocalLoop:
    """N from `low` to `high` [rad/s], the latter perhaps infinite.

    `u = -(P + E eps) R y`: R the loop without its dead time, P the expansion of that, E its error.
    """
    controller = loops.controller
    assert isinstance(controller, Controller)
    delays = [delay_near(loop.delay, low, high) for loop in controller.loop]
    late = [i for i, loop in enumerate(controller.loop) if loop.delay]
    undelayed = [structs.replace(loop, delay=0.0) for loop in controller.loop]
    law = realise(Controller(loop=tuple(undelayed)))
    parts = zip(loops.plant, law, *(delay.system for delay in delays), strict=True)
    whole: Any = tuple(np.asarray(block_diag(*same), dtype=np.complex128) for same in parts)
    seen, driven = loops.plant[3].shape
    channels = loops.blocks.size
    measured, moved = places(controller, loops.inputs, loops.outputs)
    count = len(delays)
    gain = np.zeros(whole[3].T.shape)
    for i in range(count):
        gain[driven + i, channels + measured[i]] = 1.0
        gain[driven + count + i, seen + i] = 1.0
        gain[channels + moved[i], seen + count + i] = -1.0
    # errors see R y, and add to -u
    outputs, inputs = loops.channels
    rows = [*outputs[:-1], *(seen + i for i in late), outputs[-1]]
    columns = [*inputs[:-1], *(channels + moved[i] for i in late), inputs[-1]]
    a, b, c, d = (
        np.asarray(part, dtype=np.complex128)
        for part in subsystem(close_feedback(whole, gain), rows, columns)
    )
    d[-1, -1] += loops.offset
    errors = np.array([delays[i].error for i in late])
    of_errors = np.s_[channels : channels + len(late)]
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
