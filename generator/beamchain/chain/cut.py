"""Where an appendage is cut: hinges as evenly spaced as the modes let them be,
real hinge lines and the user's kept.

The margin grows as the first hinges move towards the root;
the most even cut with enough margin is wanted.

Theory: docs/theory.md, section 4.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import OptimizeResult, minimize
from scipy.special import expit, logit

from beamchain.chain.residual_margin import (
    MARGIN,
    SAME_PLACE,
    SHORTEST,
    HingeDemand,
    Margins,
    shortest_link,
)
from beamchain.errors import RealisationError
from beamchain.ports.motions import Array
from beamchain.structure.mass_line import MassLine

HOPELESS = -0.65  # margin below which no search over three or more hinges arrived
ENOUGH = 0.1  # margin at which the search for a feasible cut ends, as evening out takes it back
SPREADS = np.geomspace(0.5, 0.002, 24)  # first free hinge, in lengths
POWERS = (1.0, 1.5, 2.0, 3.0, 4.0)  # how the others follow
NEAR = (0.3, 0.2, 0.134, 0.09, 0.06, 0.04, 0.02)  # hinges by a further port, in lengths from it
SWEEPS = 8  # of the relaxation towards even links
STEPS = (1.0, 0.75, 0.5, 0.25, 0.1, 0.03)
MANY_TRIED = 4_000  # margins worked out, after which the best cut so far is taken
MOST_TRIED = 8_000  # the same where none was found: one to two seconds
LEAST_MARGIN = 0.004  # of the same beside a further port, whose own share is what is left
NONE_LOST = 1e-12  # of the residual mass
MOST_ADDED = 4  # hinges tried beyond what the modes need


@dataclass(frozen=True, eq=False)
class Cut:
    """Where the hinges stand: x `(c,)` [m], their ports, and the least margin; how many are `added`
    to those that the modes need, and the `reason`: what the cut without them lacks."""

    x: Array
    ports: tuple[tuple[str, ...], ...]
    margin: float
    added: int
    reason: str = ""


def choose_cut(
    line: MassLine,
    wanted: Sequence[HingeDemand],
    lines: Sequence[float],
    further: Sequence[float] = (),
    most_added: int = MOST_ADDED,
) -> Cut:
    """The most even cut that holds the modes; hinges at `lines`, ports at `further` [m].

    Up to `most_added` hinges, and one per line, are tried beyond those that the modes need.
    """
    standing = (x for group in wanted for places in group.fixed.values() for x in places)
    fixed = _merge_close([*lines, *standing], line.length)
    most = most_added + fixed.size if most_added else 0
    enough = LEAST_MARGIN if further else MARGIN
    search = Margins(line, tuple(wanted), tuple(further))
    added = 0
    reason = ""
    while True:
        count = max(count for group in search.wanted for count in group.counts.values())
        x, margin = _best(search, fixed, count - fixed.size)
        if margin >= enough:
            search = search.of(*_fewest(search, x, wanted))
            return _cut_at(search, _even(search, x, fixed), added, reason)
        margins = search.assigned(x)[2] if np.isfinite(margin) else [-np.inf] * len(wanted)
        reason = reason or _margin_sentence(search.wanted, margins)
        if added == most or search.effort.tried > MOST_TRIED:
            raise RealisationError(_no_cut_sentence(reason, added, further))
        added += 1
        search = search.of(
            *(g.more() if m < MARGIN else g for g, m in zip(search.wanted, margins, strict=True))
        )


def _cut_at(search: Margins, x: Array, added: int, reason: str) -> Cut:
    """The hinges at `x` that a group takes."""
    margin, chosen, _ = search.assigned(x)
    ports = [tuple(port for group in chosen for i, port in group if i == k) for k in range(x.size)]
    used = [k for k in range(x.size) if ports[k]]
    return Cut(x[used], tuple(ports[k] for k in used), margin, added, reason)


def _fewest(search: Margins, x: Array, wanted: Sequence[HingeDemand]) -> list[HingeDemand]:
    """The groups of a search, each with no more hinges than it needs on a cut that others needed;
    `wanted`: as they were before hinges were added."""
    out = list(search.wanted)
    for k, first in enumerate(wanted):
        least = first
        while least.counts != search.wanted[k].counts:
            if search.of(least).assigned(x)[0] >= MARGIN:
                out[k] = least
                break
            least = least.more()
        for port in first.counts if len(first.counts) > 1 else ():
            while out[k].counts[port] > first.counts[port]:
                fewer = out[k].fewer(port)
                if search.of(fewer).assigned(x)[0] < MARGIN:
                    break
                out[k] = fewer
    return out


def _no_cut_sentence(reason: str, added: int, further: Sequence[float]) -> str:
    cure = (
        "fewer points beside the root (a port in the middle can be the end of one appendage, with "
        "a second one right on it)."
        if further
        else "check the rigid mass and the participation."
    )
    return (
        f"no cut of the appendage holds these modes: {reason} (further hinges tried: {added}); "
        f"keep fewer modes, or {cure}"
    )


def _margin_sentence(groups: Sequence[HingeDemand], margins: Sequence[float]) -> str:
    k = int(np.argmin(margins))
    ports = " and ".join(groups[k].modes.ports)
    if not np.isfinite(margins[k]):
        return f"the modes in {ports} leave no positive residual mass"
    return (
        f"in {ports} the limp chain weighs {1.0 - margins[k]:.3g} times the residual mass, "
        f"where {1.0 - MARGIN:g} is the limit"
    )


def _merge_close(places: Sequence[float], length: float) -> Array:
    out: list[float] = []
    for x in sorted(places):
        if not out or x - out[-1] > SAME_PLACE * length:
            out.append(x)
    return np.array(out)


def _best(search: Margins, fixed: Array, free: int) -> tuple[Array, float]:
    """Hinges with enough margin and the longest shortest link, else with most margin."""
    if free <= 0:
        return fixed, search.value(fixed)
    length = search.line.length
    good: tuple[float, Array, float] | None = None
    most: tuple[float, Array] = (-np.inf, fixed)
    for pattern in _patterns(length, free, search.further):
        if search.effort.tried > (MANY_TRIED if good is not None else MOST_TRIED):
            break
        low, high = 0, SPREADS.size  # the margin grows as the first hinge nears the root
        while low < high:
            middle = (low + high) // 2
            x = np.sort(np.concatenate([fixed, pattern(float(SPREADS[middle]))]))
            margin = search.value(x, whole=good is None)
            short = shortest_link(x, length)
            if margin >= MARGIN:
                high = middle
                if good is None or short > good[0]:
                    good = short, x, margin
            else:
                low = middle + 1 if short >= SHORTEST else low
                high = high if short >= SHORTEST else middle
                if margin > most[0]:
                    most = margin, x
    if good is not None:
        return good[1], good[2]
    return _climb(search, fixed, *most)


def _patterns(
    length: float, free: int, further: Sequence[float]
) -> Iterator[Callable[[float], Array]]:
    """Free hinges [m] by the place of the first, graded towards root and further ports."""

    def graded_places(a: float, power: float, count: int, end: float) -> Array:
        s = a ** (1.0 / power)
        return end * (s + (1.0 - s) * np.arange(count) / max(count, 1)) ** power

    for power in POWERS if free > 1 else POWERS[:1]:
        if not further:
            yield lambda a, p=power: graded_places(a, p, free, length)
    near = [np.array([-1.0, -0.4]), np.array([-1.0, 0.5]), np.array([-0.5, 0.5])]
    for gap in NEAR if further else ():
        for around in near:
            own = np.concatenate([x + gap * length * around for x in further])
            own = own[(own > 0.0) & (own < length)]
            if not 0 < own.size <= free:
                continue
            for power in POWERS[:3]:
                yield lambda a, p=power, o=own: np.concatenate(
                    [graded_places(a, p, free - o.size, 0.97 * float(o.min())), o]
                )


def _climb(search: Margins, fixed: Array, margin: float, x: Array) -> tuple[Array, float]:
    """The margin raised from a start, hinges between 0 and the tip."""
    if not np.isfinite(margin):
        return x, margin
    length = search.line.length
    own = np.array([v for v in x if not np.any(np.abs(fixed - v) <= SAME_PLACE * length)])
    if (margin < HOPELESS and own.size > 2) or search.effort.tried > MOST_TRIED:
        return x, margin

    def places(free: Array) -> Array:
        return np.sort(np.concatenate([fixed, length * expit(free)]))

    def lost(free: Array) -> float:
        value = search.value(places(free))
        # rounding takes the share of almost no residual mass beyond all of it
        return np.log(max(1.0 - value, NONE_LOST)) if np.isfinite(value) else 50.0

    def enough(intermediate_result: OptimizeResult) -> None:
        found = intermediate_result.fun < np.log(1.0 - ENOUGH) and not search.further
        if found or search.effort.tried > MOST_TRIED:
            raise StopIteration

    found = minimize(
        lost,
        logit(np.clip(own / length, SAME_PLACE, 1.0 - SAME_PLACE)),
        method="Nelder-Mead",
        callback=enough,
        options={"maxfev": 60 * own.size, "xatol": 1e-3, "fatol": 1e-3},
    )
    better = places(found.x)
    value = search.value(better)
    return (better, value) if value > margin else (x, margin)


def _even(search: Margins, x: Array, fixed: Array) -> Array:
    """Free hinges moved between their neighbours' middles as the margin allows."""
    length = search.line.length
    x = x.copy()
    for _ in range(SWEEPS):
        if search.effort.tried > MOST_TRIED:
            break
        before = x.copy()
        for i in range(x.size):
            if np.any(np.abs(fixed - x[i]) <= SAME_PLACE * length):
                continue
            low = x[i - 1] if i else 0.0
            high = x[i + 1] if i + 1 < x.size else length
            for step in STEPS:
                moved = x.copy()
                moved[i] += step * ((low + high) / 2.0 - x[i])
                if (
                    abs(moved[i] - x[i]) > 1e-6 * length
                    and search.value(moved, whole=False) >= MARGIN
                ):
                    x = moved
                    break
        if np.max(np.abs(x - before)) < 1e-4 * length:
            break
    return x
