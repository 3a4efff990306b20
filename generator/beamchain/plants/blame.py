"""Why a closed loop is unstable: its growing poles followed back to the open loop, with all loops
and with some of them."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from beamchain.plants.closed_loop import ClosedLoop
from beamchain.plants.instability import WORDS, Instability, Kind
from beamchain.plants.pole_paths import follow
from beamchain.plants.systems import Complex
from beamchain.ports.motions import Array

ORDER = ("mode", "rigid", "state", "controller")  # in which two origins are named


class _Origin(NamedTuple):
    """What an open pole belongs to."""

    name: str
    kind: Kind


class _Grown(NamedTuple):
    """A pole that grows at the end of its path."""

    origin: _Origin
    pole: complex
    gain: float
    crossing: float


def instabilities(closed: ClosedLoop) -> tuple[Instability, ...]:
    """The growing poles of a closed loop, the fastest growing first."""
    count = len(closed.inputs)
    every = np.ones(count)
    grown = _grown(closed, every)
    if count == 1:
        single = closed.inputs[0]
        return tuple(_stated(closed, one, {single: one.gain}, (single,)) for one in grown)
    single = [_first(_grown(closed, row)) for row in np.eye(count)]
    without = [_first(_grown(closed, every - row)) for row in np.eye(count)]
    out: list[Instability] = []
    for one in grown:
        key = _key(one.origin)
        alone = {
            name: found[key].gain
            for name, found in zip(closed.inputs, single, strict=True)
            if key in found
        }
        ended = tuple(
            name for name, found in zip(closed.inputs, without, strict=True) if key not in found
        )
        out.append(_stated(closed, one, alone, ended))
    return tuple(out)


def _stated(
    closed: ClosedLoop, one: _Grown, alone: Mapping[str, float], ended: tuple[str, ...]
) -> Instability:
    return Instability(
        one.pole,
        one.origin.name,
        one.origin.kind,
        one.gain,
        one.crossing,
        alone,
        ended,
        closed.step,
    )


def _first(grown: list[_Grown]) -> dict[str, _Grown]:
    """By what they grow from, that which begins first."""
    out: dict[str, _Grown] = {}
    for one in sorted(grown, key=lambda one: -one.gain):
        out[_key(one.origin)] = one
    return out


def _key(origin: _Origin) -> str:
    """Origins that count as one: rigid motions mix, the controller's states too."""
    return origin.kind if origin.kind in ("rigid", "controller") else origin.name


def _grown(closed: ClosedLoop, loops: Array) -> list[_Grown]:
    """Poles that grow with some of the loops closed, one of each pair."""
    start, origins = _start(closed)
    paths = follow(lambda gain: closed.closed(gain, loops), start)
    ends = paths.poles[-1]
    out: list[_Grown] = []
    for number in np.flatnonzero(closed.growth(ends) > 0.0).tolist():
        s = complex(closed.to_s(ends[[number]])[0])
        if s.imag < -1e-9 * abs(s):
            continue
        partner = int(np.argmin(np.abs(ends - np.conj(ends[number]))))
        origin = _together(origins[number], origins[partner])
        gain, crossing = paths.crossing(number, closed.growth)
        frequency = abs(complex(closed.to_s(np.array([crossing]))[0]).imag)
        out.append(_Grown(origin, s, gain, frequency))
    return sorted(out, key=lambda one: -one.pole.real)


def _start(closed: ClosedLoop) -> tuple[tuple[Complex, Complex], list[_Origin]]:
    """Open poles, their eigenvectors and what each belongs to."""
    (poles, vectors), (own, others) = (
        np.linalg.eig(part[0]) for part in (closed.plant, closed.controller)
    )
    names = [_origin(closed, name) for name in closed.states]
    share = np.abs(vectors)
    if vectors.size and np.linalg.cond(vectors) < 1e12:
        share = share * np.abs(np.linalg.inv(vectors)).T
    origins = [names[int(np.argmax(share[:, k]))] for k in range(poles.size)]
    origins += [_Origin("the controller", "controller")] * own.size
    start = np.concatenate([poles, own]).astype(np.complex128)
    return (start, block_diag(vectors, others).astype(np.complex128)), origins


def _together(one: _Origin, other: _Origin) -> _Origin:
    """Origin of a pair of poles: where it met others on the real axis, each may have its own."""
    if one == other:
        return one
    if one.kind == other.kind == "rigid":
        return _Origin("of several axes", "rigid")
    first, second = sorted((one, other), key=lambda origin: ORDER.index(origin.kind))
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
