"""Why a closed loop is unstable: its growing poles followed back to the open loop, with all loops
and with some of them."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import linear_sum_assignment

from beamchain.plants.closed_loop import ClosedLoop
from beamchain.plants.instability import WORDS, Instability, Kind
from beamchain.plants.pole_paths import TOGETHER, follow
from beamchain.plants.systems import Complex

ALIKE = 1e-6  # relative, of shares of states in a pole that are one
ORDER = ("mode", "rigid", "state", "controller")  # in which two origins are named


class _Origin(NamedTuple):
    """What an open pole belongs to."""

    name: str
    kind: Kind


def instabilities(closed: ClosedLoop) -> tuple[Instability, ...]:
    """The growing poles of a closed loop, one of each pair, the fastest growing first."""
    every = np.ones(len(closed.inputs))
    start, origins = _start(closed)
    paths = follow(lambda gain: closed.closed(gain, every), start)
    ends = paths.poles[-1]
    s = closed.to_s(ends)
    upper = s.imag >= -1e-9 * np.abs(s)
    numbers = np.flatnonzero((closed.growth(ends) > 0.0) & upper).tolist()
    blames = [_Blame(closed, i, start, ends) for i in range(len(closed.inputs))] if numbers else []
    out: list[Instability] = []
    for number in sorted(numbers, key=lambda number: -float(s[number].real)):
        gain, crossing = paths.crossing(number, closed.growth, closed.rounding)
        origin = _together(origins, ends, number)
        alone = {blame.input: blame.alone(number) for blame in blames}
        out.append(
            Instability(
                pole=complex(s[number]),
                origin=origin.name,
                kind=origin.kind,
                gain=gain,
                crossing=_frequency(closed, crossing),
                alone={name: factor for name, factor in alone.items() if factor is not None},
                stable_without=tuple(blame.input for blame in blames if blame.ends_without(number)),
                timestep=closed.step,
            )
        )
    return tuple(out)


def _frequency(closed: ClosedLoop, pole: complex) -> float:
    """At which a pole s, or z, crosses the axis [rad/s]."""
    if not np.isfinite(pole):
        return float("inf")
    return abs(complex(closed.to_s(np.array([pole]))[0]).imag)


class _Blame:
    """What one loop does to the growing poles: they are followed as all other loops open, and as it
    opens.

    Args:
        closed: the closed loop.
        number: of the input.
        start: open poles and their eigenvectors.
        ends: `(n,)` closed poles, in the order that counts.
    """

    def __init__(
        self, closed: ClosedLoop, number: int, start: tuple[Complex, Complex], ends: Complex
    ) -> None:
        self.input = closed.inputs[number]
        self._closed = closed
        only = np.eye(len(closed.inputs))[number]
        every = np.ones(len(closed.inputs))
        values, vectors = np.linalg.eig(closed.closed(1.0, every))
        _, order = linear_sum_assignment(np.abs(ends[:, None] - values))
        here = values[order].astype(np.complex128), vectors[:, order].astype(np.complex128)
        # without the others, and without it
        self._others_open = follow(
            lambda part: closed.closed(1.0, every - part * (every - only)), here
        ).poles[-1]
        self._open = follow(lambda part: closed.closed(1.0, every - part * only), here).poles[-1]
        self._paths = follow(lambda gain: closed.closed(gain, only), start)

    def alone(self, number: int) -> float | None:
        """Factor of the loop's gain from which on a pole grows with all others open; None: it does
        not."""
        pole = self._others_open[number]
        if self._closed.growth(np.array([pole]))[0] <= 0.0:
            return None
        same = int(np.argmin(np.abs(self._paths.poles[-1] - pole)))
        return self._paths.crossing(same, self._closed.growth, self._closed.rounding)[0]

    def ends_without(self, number: int) -> bool:
        """Whether a pole no longer grows with this loop open."""
        return bool(self._closed.growth(self._open[[number]])[0] <= 0.0)


def _start(closed: ClosedLoop) -> tuple[tuple[Complex, Complex], list[_Origin]]:
    """Open poles, their eigenvectors and what each belongs to."""
    (poles, vectors), (own, others) = (
        np.linalg.eig(part[0]) for part in (closed.plant, closed.controller)
    )
    names = [_origin(closed, name) for name in closed.states]
    share = np.abs(vectors)
    if vectors.size and np.linalg.cond(vectors) < 1e12:
        share = share * np.abs(np.linalg.inv(vectors)).T
    # the first of those that are alike, so that both poles of a pair have one
    largest = share >= (1.0 - ALIKE) * share.max(axis=0, initial=0.0)
    origins = [names[int(np.argmax(largest[:, k]))] for k in range(poles.size)]
    origins += [_Origin("the controller", "controller")] * own.size
    start = np.concatenate([poles, own]).astype(np.complex128)
    return (start, block_diag(vectors, others).astype(np.complex128)), origins


def _together(origins: list[_Origin], ends: Complex, number: int) -> _Origin:
    """Origin of a pair of poles: where it met others on the real axis, each may have its own."""
    one = origins[number]
    far = np.abs(ends - np.conj(ends[number]))
    partners = np.flatnonzero(far <= far.min() + TOGETHER * abs(ends[number]))
    others = [origins[int(partner)] for partner in partners]
    if one in others:
        return one
    first, second = sorted((one, others[0]), key=lambda origin: ORDER.index(origin.kind))
    return _Origin(f"{_words(first)} with {_words(second)}", "several")


def _words(origin: _Origin) -> str:
    return f"{WORDS[origin.kind]}{origin.name}"


def _origin(closed: ClosedLoop, state: str) -> _Origin:
    """What a state of the plant belongs to."""
    position = state.removesuffix("_rate")
    if position in closed.modes:
        return _Origin(position, "mode")
    if state.startswith("rigid_"):
        return _Origin(position.removeprefix("rigid_"), "rigid")
    return _Origin(state, "state")
