"""Whether the rigid links of a cut can hold the residual mass of the wanted modes,
and with what margin.

Theory: docs/theory.md, section 4.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, islice, pairwise

import numpy as np

from beamchain.chain.chain import Freedom
from beamchain.chain.tendons import ModeGroup, group_motion
from beamchain.ports.motions import PORT_MOTION, Array, offset_matrix
from beamchain.structure.mass_line import MassLine

MARGIN = 0.02  # of the residual mass, that the inequality must leave
SHORTEST = 1e-3  # of the length: a shorter link is none
MOST_CHOICES = 8  # of hinges for a port that needs fewer than there are
NOTHING_LEFT = 1e-11  # of the rigid mass: less residual mass than this is none
SAME_PLACE = 1e-9  # of the length

#: Motion of the root equal to a unit motion of a hinge at x:
#: the first vector less x times the second.
TURNS = {
    port: (
        motion[:, -1],
        -offset_matrix(np.array([-1.0, 0.0, 0.0])) @ motion[:, -1] + motion[:, -1],
    )
    for port, motion in PORT_MOTION.items()
}


@dataclass(frozen=True, eq=False)
class HingeDemand:
    """A group of modes, hinges that each port needs, and those that stand [m]."""

    modes: ModeGroup
    counts: Mapping[str, int]
    fixed: Mapping[str, tuple[float, ...]]

    def more(self) -> "HingeDemand":
        """The same with one more hinge in every port."""
        return HingeDemand(
            self.modes, {port: count + 1 for port, count in self.counts.items()}, self.fixed
        )

    def fewer(self, port: str) -> "HingeDemand":
        """The same with one hinge less in a port."""
        return HingeDemand(self.modes, {**self.counts, port: self.counts[port] - 1}, self.fixed)


def shortest_link(x: Array, length: float) -> float:
    """Shortest distance between neighbouring hinges, root and tip, over the length."""
    edges = [*([] if x.size and x[0] <= SAME_PLACE * length else [0.0]), *x.tolist(), length]
    return min(b - a for a, b in pairwise(edges)) / length


@dataclass
class Effort:
    """How many margins a search has worked out."""

    tried: int = 0


@dataclass(eq=False)
class Margins:
    """Margins of candidate cuts of one appendage."""

    line: MassLine
    wanted: tuple[HingeDemand, ...]
    further: tuple[float, ...]
    effort: Effort = field(default_factory=Effort)
    _known: dict[int, tuple[Array, Array, Array, Array]] = field(
        default_factory=dict[int, tuple[Array, Array, Array, Array]]
    )

    def of(self, *groups: HingeDemand) -> "Margins":
        """Those of other groups, at the same effort."""
        return Margins(self.line, groups, self.further, self.effort)

    def margins(
        self, group: HingeDemand, x: Array, choices: Sequence[Sequence[Freedom]], behind: Array
    ) -> Array:
        """`(c,)` least eigenvalue of what is left, for each choice of freedoms; -inf where a link
        or a residual mass has no inertia. `behind` `(h, 6, 6)`: mass behind the hinges."""
        motion, given, floor, left_over = self._constants(group)
        at = np.array([[i for i, _ in freedoms] for freedoms in choices])
        turns = [[TURNS[p][0] - x[i] * TURNS[p][1] for i, p in each] for each in choices]
        own = np.array(turns).reshape(*at.shape, 6)
        pulled = (behind[at] @ own[..., None])[..., 0]  # momentum of what moves, per freedom
        both = pulled @ own.swapaxes(1, 2)
        # of the later of two
        inertia = np.where(at[:, :, None] >= at[:, None, :], both, both.swapaxes(1, 2))
        rows = [(pulled @ motion).swapaxes(1, 2)]
        for place in self.further:
            moved = motion.T @ offset_matrix(np.array([place, 0.0, 0.0])) @ own.swapaxes(1, 2)
            rows.append(moved * (x[at] < place)[:, None, :])
        m = motion.shape[1]
        with np.errstate(all="ignore"):
            unit = np.concatenate(rows, axis=1) @ _whitening(inertia)
            left = unit @ unit.swapaxes(1, 2) - given
            left[:, :m, :m] += floor
            scale = np.zeros_like(left)
            for k in range(len(rows)):
                part = slice(k * m, (k + 1) * m)
                size = unit[:, part] @ unit[:, part].swapaxes(1, 2) if k else left_over[None]
                scale[:, part, part] = _whitening(size)
            shares = scale.swapaxes(1, 2) @ left @ scale
        sound = np.all(np.isfinite(shares), axis=(1, 2))
        out = np.full(len(choices), -np.inf)
        out[sound] = np.linalg.eigvalsh(shares[sound])[:, 0]
        return out

    def _constants(self, group: HingeDemand) -> tuple[Array, Array, Array, Array]:
        """Motion, the modes' share, a floor, and the residual mass of a group."""
        key = id(group)
        if key not in self._known:
            motion = group_motion(group.modes.ports)
            rows = group.modes.rows
            mass = motion.T @ self.line.whole @ motion
            part = rows[:, : motion.shape[1]]
            floor = NOTHING_LEFT * np.diag(np.diag(mass))
            self._known[key] = motion, rows.T @ rows, floor, mass - part.T @ part + floor
        return self._known[key]

    def assigned(
        self, x: Array, *, whole: bool = True
    ) -> tuple[float, list[list[Freedom]], list[float]]:
        """Least margin, and per group its freedoms and margin, for hinges at `x`."""
        behind = self.line.behind(x)
        chosen: list[list[Freedom]] = []
        margins: list[float] = []
        for group in self.wanted:
            choices = list(self._choices(group, x))
            values = self.margins(group, x, choices, behind)
            enough = values >= MARGIN
            k = int(np.argmax(enough) if np.any(enough) else np.argmax(values))
            # as long as it takes
            looked = k + 1 if enough[k] else len(choices)
            self.effort.tried += looked * (1 + len(choices[k]) // 8)
            chosen.append(choices[k])
            margins.append(float(values[k]))
            if values[k] < MARGIN and not whole:
                break
        return min(margins), chosen, margins

    def _choices(self, group: HingeDemand, x: Array) -> Iterator[list[Freedom]]:
        """Hinges that a group may take: those that it requires, with as many others as it needs."""
        close = SAME_PLACE * self.line.length
        required: dict[str, list[int]] = {}
        others: dict[str, list[int]] = {}
        needed: dict[str, int] = {}
        for port, count in group.counts.items():
            fixed = group.fixed.get(port, ())
            required[port] = [
                k for k, at in enumerate(x) if any(abs(at - f) <= close for f in fixed)
            ]
            others[port] = [k for k in range(x.size) if k not in required[port]]
            needed[port] = max(min(count - len(required[port]), len(others[port])), 0)
        for pick in _picks(others, needed):
            yield sorted((k, port) for port in pick for k in [*required[port], *pick[port]])

    def value(self, x: Array, *, whole: bool = True) -> float:
        """Least margin of hinges at `x`; -inf where a link is too short."""
        if shortest_link(x, self.line.length) < SHORTEST or np.any(np.diff(x) <= 0.0):
            return -np.inf
        return self.assigned(x, whole=whole)[0]


def _picks(
    others: Mapping[str, Sequence[int]], needed: Mapping[str, int]
) -> Iterator[Mapping[str, Sequence[int]]]:
    """Per port, as many hinges as needed: evenly spread, the first, and for a single port any."""
    evenly_spread = {
        port: [free[k * len(free) // needed[port]] for k in range(needed[port])]
        for port, free in others.items()
    }
    yield evenly_spread
    if all(len(evenly_spread[port]) == len(free) for port, free in others.items()):
        return
    yield {port: free[: needed[port]] for port, free in others.items()}
    if len(others) == 1:
        [(port, free)] = others.items()
        for pick in islice(combinations(free, needed[port]), MOST_CHOICES):
            yield {port: pick}


def _whitening(matrices: Array) -> Array:
    """`(c, n, n)` W with `W^T A W = 1`; not finite where A is not positive."""
    sound = np.all(np.isfinite(matrices), axis=(1, 2))
    out = np.full(matrices.shape, np.nan)
    values, vectors = np.linalg.eigh(matrices[sound])
    with np.errstate(all="ignore"):
        out[sound] = vectors / np.sqrt(values)[:, None, :]
    return out
