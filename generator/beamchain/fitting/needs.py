"""What a scene does not need: the fewest modes that keep its promise,
proved against the whole beam.

The promise is the in-band error of the hub's motion (`ports.compare.Reference`), on the hub in
space, in the motions that matter.

Theory: docs/theory.md, section 6.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from beamchain.ports.compare import (
    STANDARD_HUBS,
    Block,
    Reference,
    keeps_tolerance,
    tolerance_statement,
)
from beamchain.ports.compose import model_in_space
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, Array

FAR = 25.0  # times the bandwidth: modes above act through their static flexibility only
COUPLED = 1e-12  # relative, below which nothing couples two motions
STEPS = 30  # from neighbour to neighbour, at most
MOST = 8  # modes tried per port: beyond, the exact chain is rarely physical
IDLE = 0.01  # of an error that misses the tolerance: modes that lower it by less are not kept

#: Motions of the hub by the names of SPEC's `scene.axes`.
AXES = {"tx": 0, "ty": 1, "tz": 2, "x": 3, "y": 4, "z": 5}

#: Model of a port reduced to a number of modes for a target ("clamped", "free", "hub").
Reduce = Callable[[str, str, int], PortModel]


@dataclass(frozen=True)
class LeftOut:
    """Something the model does without: what, why, and the in-band error it costs."""

    what: str
    why: str
    cost: float


@dataclass(frozen=True, eq=False)
class Choice:
    """The smallest model that keeps the promise, or the best there is.

    Args:
        modes: kept per port; ports without modes are rigid.
        target: which modes: "clamped", "free" or "hub".
        error: in-band error of the reduced models.
        met: 1.01 times the error stays within the tolerance.
        left_out: the ledger.
        cannot: what the model cannot answer.
        reasoning: how the choice was made, a line each.
    """

    modes: dict[str, int]
    target: str
    error: float
    met: bool
    left_out: tuple[LeftOut, ...]
    cannot: tuple[str, ...]
    reasoning: tuple[str, ...]


class Promise:
    """The in-band error of candidate models of an appendage on the hub, in the motions that matter.

    Motions that neither the hub nor the appendage couples make independent blocks: the norm of the
    whole is the largest of theirs.

    Args:
        exact: the appendage with every mode, in m motions of its root.
        hub_mass: `(m, m)` about the root; without one the worst of three.
        wanted: numbers of the motions that matter, 0 to m - 1.
        bandwidth: upper end of the band [rad/s].
        undamped: as of `ports.compare.compared_ratios`.
    """

    def __init__(
        self,
        exact: PortModel,
        hub_mass: Array | None,
        wanted: Sequence[int],
        bandwidth: float,
        undamped: float,
    ) -> None:
        self.exact: PortModel = exact
        self.wanted: list[int] = sorted(wanted)
        self.bandwidth: float = bandwidth
        self.hubs: list[Array] = (
            [factor * exact.rigid_mass for factor in STANDARD_HUBS]
            if hub_mass is None
            else [hub_mass]
        )
        self._blocks = [self._coupled_motions(hub) for hub in self.hubs]
        self._references = [
            Reference([self._block(hub, motions) for motions in blocks], bandwidth, undamped)
            for hub, blocks in zip(self.hubs, self._blocks, strict=True)
        ]
        self._known: dict[tuple[object, ...], float] = {}

    def reaches(self, motions: Sequence[int]) -> bool:
        """Whether the root's `motions` can move any hub motion that matters."""
        return any(
            not set(motions).isdisjoint(block) for blocks in self._blocks for block in blocks
        )

    def error(self, model: PortModel, tolerance: float | None = None) -> float:
        """In-band error of any model in the same motions.

        Its rigid mass does not count. `tolerance`: as of `ports.compare.maximum_of`, for a search.
        """
        worst = 0.0
        for number, blocks in enumerate(self._blocks):
            for i, motions in enumerate(blocks):
                worst = max(worst, self._block_error(number, i, motions, model, tolerance))
        return worst

    def _block_error(
        self,
        number: int,
        i: int,
        motions: list[int],
        model: PortModel,
        tolerance: float | None,
    ) -> float:
        """In-band error in block i on hub `number`, known for models that were asked for before."""
        values = self._modes_seen(model, motions)
        key = (number, i, tolerance, *(array.tobytes() for array in values))
        if key not in self._known:
            seen = self._seen(model, motions)
            self._known[key] = self._references[number].error(i, seen, tolerance)
        return self._known[key]

    def _coupled_motions(self, hub: Array) -> list[list[int]]:
        """Blocks of motions that are coupled on a hub; those without a wanted one are left out."""
        total = hub + self.exact.rigid_mass
        scale = np.sqrt(np.diag(total))
        coupled = np.abs(total) / np.outer(scale, scale) > COUPLED
        moved = self._moved(self.exact).astype(int)
        coupled |= (moved.T @ moved) > 0
        count, number_of = connected_components(coupled, directed=False)
        blocks = [np.flatnonzero(number_of == k).tolist() for k in range(int(count))]
        return [block for block in blocks if not set(block).isdisjoint(self.wanted)]

    def _moved(self, model: PortModel) -> NDArray[np.bool_]:
        """`(n, m)` whether a mode moves a motion by more than rounding."""
        scale = np.sqrt(np.diag(self.exact.rigid_mass))
        return np.abs(model.participation) / scale > COUPLED

    def _block(self, hub: Array, motions: list[int]) -> Block:
        keep = tuple(i for i, motion in enumerate(motions) if motion in self.wanted)
        return Block(hub[np.ix_(motions, motions)], self._seen(self.exact, motions), keep)

    def _seen(self, model: PortModel, motions: list[int]) -> PortModel:
        """A model in the motions of a block, with the modes that move there."""
        rigid_mass = self.exact.rigid_mass[np.ix_(motions, motions)]
        return PortModel(rigid_mass, *self._modes_seen(model, motions))

    def _modes_seen(self, model: PortModel, motions: list[int]) -> tuple[Array, Array, Array]:
        """Frequencies, participation and damping of the modes that move there."""
        modes = np.any(self._moved(model)[:, motions], axis=1)
        rows = model.participation[modes][:, motions]
        damping = model.damping[np.ix_(*[modes] * model.damping.ndim)]
        return model.frequencies[modes], rows, damping


@dataclass(frozen=True, eq=False)
class Candidates:
    """What a chain with independent ports may keep.

    Args:
        whole: per port every mode, damped; those far above the band gathered.
        frequencies: per port, of the modes that may be kept [rad/s].
        reduce: model of (target, port, modes), damped.
    """

    whole: Mapping[str, PortModel]
    frequencies: Mapping[str, Array]
    reduce: Reduce


def with_polar_inertia(rigid_mass: Array) -> Array:
    """`(6, 6)` with a trace of polar inertia where an appendage states none."""
    mass = np.array(rigid_mass)
    rotary = np.diag(mass)[3:]
    return mass + np.diag([0.0] * 3 + list(np.maximum(1e-9 * rotary.max() - rotary, 0.0)))


@cache
def _motions(port: str) -> list[int]:
    return [int(i) for i in np.flatnonzero(np.any(PORT_MOTION[port] != 0.0, axis=1))]


def choose(
    promise: Promise,
    candidates: Candidates,
    targets: Sequence[str],
    tolerance: float,
    fixed: Mapping[str, int],
    tip: bool = False,
) -> Choice:
    """The fewest modes whose in-band error stays within `tolerance`;
    the first of `targets` wins a tie.

    `fixed`: ports whose number the user decided; `tip`: keep every plane mode inside the band.
    """
    searches = [
        _Search(
            promise, candidates, target=target, tolerance=tolerance, fixed=fixed, whole_band=tip
        )
        for target in targets
    ]
    tried = [search.choice() for search in searches]
    ranks = [(not c.met, sum(c.modes.values()) if c.met else c.error) for c in tried]
    at = min(range(len(tried)), key=lambda k: ranks[k])
    best, search = tried[at], searches[at]
    ledger = _ledger(search, best.modes)
    tried[at] = best = replace(best, error=search.error(best.modes), left_out=tuple(ledger))
    lines = [_result_of_target(c, tolerance) for c in tried]
    chosen = f'chosen: target "{best.target}", {sum(best.modes.values())} flexible modes'
    return replace(best, reasoning=(*lines, chosen, *best.reasoning))


def _result_of_target(choice: Choice, tolerance: float) -> str:
    """What the search for a target ended with, in a line."""
    kept = [f"{count} in {port}" for port, count in choice.modes.items() if count]
    above = "" if choice.met else f" ({tolerance_statement(choice.error, tolerance)})"
    return (
        f'target "{choice.target}": {", ".join(kept) or "rigid"}, '
        f"in-band error {choice.error:.2e}{above}"
    )


class _Search:
    """The search for as few modes per port as keep the promise with a target.

    Args:
        promise: the error that is asked for.
        candidates: what the ports may keep.
        target: "clamped", "free" or "hub".
        tolerance: of the in-band error.
        fixed: ports whose number the user decided.
        whole_band: every bending mode inside the band is kept.
    """

    def __init__(
        self,
        promise: Promise,
        candidates: Candidates,
        *,
        target: str,
        tolerance: float,
        fixed: Mapping[str, int],
        whole_band: bool,
    ) -> None:
        self.promise: Promise = promise
        self.candidates: Candidates = candidates
        self.target: str = target
        self.tolerance: float = tolerance
        self.whole_band: bool = whole_band
        self.most: dict[str, int] = {
            port: min(MOST, values.size) for port, values in candidates.frequencies.items()
        }
        self.least: dict[str, int] = {
            port: fixed.get(port, self._modes_in_band(port)) for port in self.most
        }
        self.free: list[str] = [port for port in self.most if port not in fixed]
        self._reduced = cache(partial(candidates.reduce, target))
        self._known: dict[tuple[object, ...], float] = {}

    def choice(self) -> Choice:
        """The numbers of modes, with an empty ledger."""
        enough = {port: self._enough_alone(port) for port in self.most}
        alone = {port: self._searched(enough, self.others(port)) for port in self.free}
        counts = self._enough_together(enough)
        counts = self._no_more_than_needed(counts)
        counts = self._no_better_neighbour(counts)
        counts = self._no_idle_modes(counts, enough)
        error = self._searched(counts)
        return Choice(
            modes=counts,
            target=self.target,
            error=error,
            met=keeps_tolerance(error, self.tolerance),
            left_out=(),
            cannot=tuple(_cannot(self.candidates, counts, self.whole_band)),
            reasoning=tuple(
                f"{port} alone, the others whole: {error:.2e} with {enough[port]} modes"
                for port, error in alone.items()
            ),
        )

    def error(
        self,
        counts: Mapping[str, int],
        whole: Sequence[str] = (),
        tolerance: float | None = None,
    ) -> float:
        """In-band error with so many modes of each port; `whole`: ports that keep all of theirs;
        `tolerance`: as of `Promise.error`."""
        kept = tuple(None if p in whole else counts[p] for p in self.candidates.whole)
        key = (tolerance, *kept)
        if key not in self._known:
            models = {
                port: model if count is None else self._reduced(port, count)
                for (port, model), count in zip(self.candidates.whole.items(), kept, strict=True)
                if count != 0
            }
            model = model_in_space(models, self.promise.exact.rigid_mass)
            self._known[key] = self.promise.error(model, tolerance)
        return self._known[key]

    def others(self, port: str) -> list[str]:
        """All ports but one."""
        return [p for p in self.candidates.whole if p != port]

    def _searched(self, counts: Mapping[str, int], whole: Sequence[str] = ()) -> float:
        """The error as exactly as the search needs it."""
        return self.error(counts, whole, self.tolerance)

    def _keeps(self, counts: Mapping[str, int], whole: Sequence[str] = ()) -> bool:
        """Whether the error stays within the tolerance."""
        return keeps_tolerance(self._searched(counts, whole), self.tolerance)

    def _modes_in_band(self, port: str) -> int:
        """Bending modes that are kept because they lie in the band."""
        if not self.whole_band or port not in ("xy", "xz"):
            return 0
        inside = int(np.sum(self.candidates.frequencies[port] <= self.promise.bandwidth))
        return min(inside, self.most[port])

    def _enough_alone(self, port: str) -> int:
        """Modes of a port with which the promise is kept while the others stay whole."""
        count = self.least[port]
        if port not in self.free:
            return count
        others = self.others(port)
        while count < self.most[port] and not self._keeps({port: count}, others):
            count += 1
        return count

    def _enough_together(self, counts: dict[str, int]) -> dict[str, int]:
        """More modes where ports that the hub couples need more together than alone."""
        while not self._keeps(counts):
            more = [
                {**counts, port: counts[port] + 1}
                for port in self.free
                if counts[port] < self.most[port] and self.promise.reaches(_motions(port))
            ]
            best = min(more, key=self._searched, default=None)
            if best is None or self._searched(best) >= self._searched(counts) * (1.0 - 1e-9):
                return counts
            counts = best
        return counts

    def _no_more_than_needed(self, counts: dict[str, int]) -> dict[str, int]:
        """The same without modes, port by port, that the promise does not need."""
        for port in self.free:
            while counts[port] > self.least[port]:
                fewer = {**counts, port: counts[port] - 1}
                if not self._keeps(fewer) and self._searched(fewer) > self._searched(counts):
                    break
                counts = fewer
        return counts

    def _rank(self, counts: Mapping[str, int]) -> tuple[bool, int, float]:
        """Less is better: fewer modes that keep the tolerance, or as many with less error;
        where none keeps it, less error."""
        error = self._searched(counts)
        if keeps_tolerance(error, self.tolerance):
            return False, sum(counts.values()), error
        return True, 0, error

    def _no_better_neighbour(self, counts: dict[str, int]) -> dict[str, int]:
        """Counts that no change by one in a free port, nor by one in each of two, makes better."""
        single = [{port: step} for port in self.free for step in (-1, 1)]
        paired = [
            {a: i, b: j} for a, b in combinations(self.free, 2) for i in (-1, 1) for j in (-1, 1)
        ]
        best = self._rank(counts)
        for _ in range(STEPS):
            around = [
                {**counts, **{port: counts[port] + step for port, step in change.items()}}
                for change in single + paired
            ]
            # where the tolerance is kept, more modes cannot be better
            room = np.inf if best[0] else best[1]
            around = [
                some
                for some in around
                if all(self.least[port] <= some[port] <= self.most[port] for port in self.free)
                and sum(some.values()) <= room
            ]
            ranks = [self._rank(some) for some in around]
            at = min(range(len(around)), key=lambda k: ranks[k], default=None)
            if at is None or not _better(ranks[at], best):
                break
            counts, best = around[at], ranks[at]
        return counts

    def _no_idle_modes(self, counts: dict[str, int], enough: Mapping[str, int]) -> dict[str, int]:
        """Where the tolerance is missed all the same, the same without modes beyond those `enough`
        for a port alone that hardly lower the error: those of typed counts may be all of it."""
        bound = self._searched(counts) * (1.0 + IDLE)
        for port in self.free:
            while counts[port] > enough[port] and not self._keeps(counts):
                fewer = {**counts, port: counts[port] - 1}
                if self._searched(fewer) > bound:
                    break
                counts = fewer
        return counts


def _better(new: tuple[bool, int, float], old: tuple[bool, int, float]) -> bool:
    """Whether a rank is better by more than rounding."""
    return new[:2] < old[:2] or (new[:2] == old[:2] and new[2] < old[2] * (1.0 - 1e-6))


def _ledger(search: _Search, counts: Mapping[str, int]) -> list[LeftOut]:
    """What was left out of each port, and the error it costs by itself."""
    promise = search.promise
    out: list[LeftOut] = []
    for port, frequencies in search.candidates.frequencies.items():
        kept = counts[port]
        if kept >= frequencies.size:
            continue
        first = float(frequencies[kept])
        what = f"{port} (first mode {first:.3g} rad/s)"
        if kept:
            what = f"{port} mode {kept + 1} ({first:.3g} rad/s)"
        if not promise.reaches(_motions(port)):
            names = [name for name, i in AXES.items() if i in promise.wanted]
            out.append(LeftOut(what, f"no path to hub axes {', '.join(names)}", 0.0))
            continue
        if kept:
            what += " and above"
        where = "outside" if first > promise.bandwidth else "inside"
        cost = search.error(counts, search.others(port))
        out.append(LeftOut(what, f"{where} {promise.bandwidth:.4g} rad/s", cost))
    return out


def _cannot(candidates: Candidates, counts: Mapping[str, int], tip: bool) -> list[str]:
    """What a model with these modes has no answer to."""
    out: list[str] = []
    for port, frequencies in candidates.frequencies.items():
        if counts[port] == 0:
            word = {"torsion": "twist and torsion loads", "axial": "axial loads"}.get(
                port, f"bending loads in {port}"
            )
            out.append(f"{word}: {port} is rigid")
        elif counts[port] < frequencies.size:
            out.append(f"{port} motion above {frequencies[counts[port]]:.3g} rad/s")
    if not tip:
        out.append(
            "tip pointing: the chain is right at the root; set scene.tip = true where the tip "
            "matters"
        )
    return out
