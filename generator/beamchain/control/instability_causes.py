"""Why a closed loop is unstable: its growing poles followed back to the open loop, with all loops
and with some of them.

Where axes have the same design, growing poles of several loops lie together, their eigenvectors are
any in the space that they span, and no way of one of them says whose it is. There every loop is
closed alone, and each pole is that of the loop which has one there by itself.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import linear_sum_assignment

from beamchain.control.closed_loop import ClosedLoop
from beamchain.control.instability import WORDS, Instability, Kind
from beamchain.control.pole_paths import Closed, Pole, crossing, follow, open_pole, pole_of
from beamchain.control.systems import Complex
from beamchain.ports.motions import Array

ALIKE = 1e-6  # relative, of shares of states in a pole that are one
TOGETHER = 0.05  # relative distance of growing poles within which their ways are not told apart
OWN = 0.2  # of a pole's growth: distance to the pole that one loop alone has there
SAME = 1e-3  # of it, where the other loops do nothing to it
ORDER = ("mode", "rigid", "state", "controller")  # in which two origins are named
Progress = Callable[[int, int], None]


class _Origin(NamedTuple):
    """What an open pole belongs to."""

    name: str
    kind: Kind


def no_progress(done: int, count: int) -> None:
    """What is told of the progress, to nobody."""


def instabilities(closed: ClosedLoop, tell: Progress = no_progress) -> tuple[Instability, ...]:
    """The growing poles of a closed loop, one of each pair, the fastest growing first.

    `tell`: is told how many of them have been followed, and of how many.
    """
    every = np.ones(len(closed.inputs))
    values, vectors = _growing(closed, every)
    s = closed.to_s(values)
    numbers = np.argsort(-s.real, kind="stable").tolist()
    start = _start(closed)
    owners = _owners(closed, s[numbers], start)
    out: list[Instability] = []
    for number, owner in zip(numbers, owners, strict=True):
        tell(len(out), len(numbers))
        value, right = complex(values[number]), vectors[:, number]
        pole = pole_of(partial(closed.closed, loops=every), 1.0, value, right)
        if owner is None:
            whole = _from_open(closed, every, pole, start)
            gain, at = crossing(whole.closed, whole.poles, closed.growth)
            blames = [_Blame(closed, i, pole, start) for i in range(len(closed.inputs))]
            alone = {blame.input: blame.alone() for blame in blames}
            without = tuple(blame.input for blame in blames if blame.ends_without())
        else:
            whole = owner.way
            factor, at = crossing(whole.closed, whole.poles, closed.growth)
            alone = {owner.input: factor}
            gain = factor
            if not owner.is_same:
                both = _from_open(closed, every, pole, start)
                gain, at = crossing(both.closed, both.poles, closed.growth)
            without = (owner.input,) if owner.ends_without else ()
        origin = whole.origin(start)
        out.append(
            Instability(
                pole=complex(s[number]),
                origin=origin.name,
                kind=origin.kind,
                gain=gain,
                crossing=_frequency(closed, at),
                alone={name: factor for name, factor in alone.items() if factor is not None},
                stable_without=without,
                timestep=closed.step,
            )
        )
    return tuple(out)


def _frequency(closed: ClosedLoop, pole: complex) -> float:
    """At which a pole s, or z, crosses the axis [rad/s]."""
    if not np.isfinite(pole):
        return float("inf")
    return abs(complex(closed.to_s(np.array([pole]))[0]).imag)


class _Start(NamedTuple):
    """Open poles `(n,)`, their eigenvectors and what each belongs to."""

    poles: Complex
    vectors: Complex
    origins: Sequence[_Origin]


class _Way(NamedTuple):
    """A pole from gain 0 upwards.

    Args:
        closed: the matrix at a gain.
        poles: the first is one of the open loop.
        numbers: of the open poles from which it, and the other one of its pair, come.
    """

    closed: Closed
    poles: Sequence[Pole]
    numbers: Sequence[int]

    def origin(self, start: _Start) -> _Origin:
        """Of the pair: where it met others on the real axis, each may have its own."""
        one, *others = (start.origins[number] for number in self.numbers)
        if not others or one in others:
            return one
        first, second = sorted((one, others[0]), key=lambda origin: ORDER.index(origin.kind))
        return _Origin(f"{_words(first)} with {_words(second)}", "several")


def _from_open(closed: ClosedLoop, loops: Array, pole: Pole, start: _Start) -> _Way:
    """The way of a pole of some loops from the open loop."""
    matrix = partial(closed.closed, loops=loops)
    path = follow(matrix, pole, 0.0)
    smallest = [path.poles[-1]]
    if path.partner is not None:
        smallest.append(follow(matrix, path.partner, 0.0).poles[-1])
    opened = start.poles, start.vectors
    numbers = [_own_direction(start, open_pole(matrix, one, opened), one) for one in smallest]
    first = pole_of(matrix, 0.0, complex(start.poles[numbers[0]]), start.vectors[:, numbers[0]])
    return _Way(matrix, [first, *reversed(path.poles)], numbers)


def _own_direction(start: _Start, number: int, pole: Pole) -> int:
    """Of open poles of one kind that are one, as rigid motions at zero, the one in whose direction
    a pole leaves."""
    far = np.abs(start.poles - start.poles[number])
    size = float(np.abs(start.poles).max(initial=1e-300))
    one = far <= ALIKE * (np.abs(start.poles[number]) + 1e-3 * size)
    kind = start.origins[number].kind
    one &= np.array([origin.kind == kind for origin in start.origins])
    overlap = np.where(one, np.abs(pole.right.conj() @ start.vectors), -1.0)
    # both of a double pole have the same direction
    return number if overlap[number] > (1.0 - ALIKE) * overlap.max() else int(overlap.argmax())


class _Owner(NamedTuple):
    """The loop that has a growing pole by itself.

    Args:
        input: of the loop.
        way: of its pole, all others open.
        is_same: whether the others do nothing to the pole.
        ends_without: whether fewer poles grow with this loop open.
    """

    input: str
    way: _Way
    is_same: bool
    ends_without: bool


def _owners(closed: ClosedLoop, poles: Complex, start: _Start) -> list[_Owner | None]:
    """Of growing poles s `(k,)` that lie together, the loop of each; None of those that are told
    apart by their ways, and of those that no loop alone has."""
    out: list[_Owner | None] = [None] * poles.size
    apart = np.abs(poles[:, None] - poles) / np.abs(poles)[:, None]
    np.fill_diagonal(apart, np.inf)
    together = np.flatnonzero(apart.min(axis=1, initial=np.inf) <= TOGETHER)
    if not together.size:
        return out
    loops = np.eye(len(closed.inputs))
    found = [(i, pole) for i in range(len(loops)) for pole in _new_poles(closed, loops[i], start)]
    if not found:
        return out
    single = closed.to_s(np.array([pole.value for _, pole in found], dtype=np.complex128))
    distance = np.abs(poles[together, None] - single) / poles[together, None].real
    rows, columns = linear_sum_assignment(np.minimum(distance, OWN))
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        if distance[row, column] >= OWN:
            continue
        i, pole = found[column]
        way = _from_open(closed, loops[i], pole, start)
        is_same = bool(distance[row, column] <= SAME)
        left = _growing(closed, 1.0 - loops[i])[0].size
        out[int(together[row])] = _Owner(closed.inputs[i], way, is_same, left < poles.size)
    return out


def _growing(closed: ClosedLoop, loops: Array) -> tuple[Complex, Complex]:
    """Growing poles, one of each pair, and their eigenvectors, with some of the loops closed."""
    found, vectors = np.linalg.eig(closed.closed(1.0, loops))
    values = found.astype(np.complex128)
    s = closed.to_s(values)
    upper = (closed.growth(values) > 0.0) & (s.imag >= -1e-9 * np.abs(s))
    return values[upper], vectors[:, upper].astype(np.complex128)


def _new_poles(closed: ClosedLoop, loops: Array, start: _Start) -> list[Pole]:
    """Growing poles that are none of the open loop's, with some of the loops closed."""
    values, vectors = _growing(closed, loops)
    return [
        pole_of(partial(closed.closed, loops=loops), 1.0, complex(value), vectors[:, k])
        for k, value in enumerate(values)
        if np.abs(start.poles - value).min(initial=np.inf) > ALIKE * abs(value)
    ]


class _Blame:
    """What one loop does to a growing pole: it is followed as all other loops open, and as it
    opens.

    Args:
        closed: the closed loop.
        number: of the input.
        pole: the growing one, all loops closed.
        start: open poles.
    """

    def __init__(self, closed: ClosedLoop, number: int, pole: Pole, start: _Start) -> None:
        self.input = closed.inputs[number]
        self._closed = closed
        self._only: Array = np.eye(len(closed.inputs))[number]
        self._pole = pole
        self._start = start

    def alone(self) -> float | None:
        """Factor of the loop's gain from which on the pole grows with all others open; None: it
        does not."""
        closed = self._closed
        pole = self._opened(1.0 - self._only)
        if not self._grows(pole):
            return None
        way = _from_open(closed, self._only, pole._replace(gain=1.0), self._start)
        return crossing(way.closed, way.poles, closed.growth)[0]

    def ends_without(self) -> bool:
        """Whether the pole no longer grows with this loop open."""
        return not self._grows(self._opened(self._only))

    def _opened(self, loops: Array) -> Pole:
        """The pole once some loops are open."""
        every = np.ones(loops.size)
        path = follow(
            lambda part: self._closed.closed(1.0, every - part * loops),
            self._pole._replace(gain=0.0),
            1.0,
        )
        return path.poles[-1]

    def _grows(self, pole: Pole) -> bool:
        return bool(self._closed.growth(np.array([pole.value]))[0] > 0.0)


def _start(closed: ClosedLoop) -> _Start:
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
    return _Start(start, block_diag(vectors, others).astype(np.complex128), origins)


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
