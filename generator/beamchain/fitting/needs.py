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
from beamchain.ports.coupled import CoupledPort
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, Array

FAR = 25.0  # times the bandwidth: modes above act through their static flexibility only
COUPLED = 1e-12  # relative, below which nothing couples two motions
STEPS = 30  # from neighbour to neighbour, at most
MOST = 8  # modes tried per port: beyond, the exact chain is rarely physical

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
    """

    def __init__(
        self, exact: PortModel, hub_mass: Array | None, wanted: Sequence[int], bandwidth: float
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
            Reference([self._block(hub, motions) for motions in blocks], bandwidth)
            for hub, blocks in zip(self.hubs, self._blocks, strict=True)
        ]
        self._known: dict[tuple[object, ...], float] = {}

    def reaches(self, motions: Sequence[int]) -> bool:
        """Whether the root's `motions` can move any hub motion that matters."""
        return any(
            not set(motions).isdisjoint(block) for blocks in self._blocks for block in blocks
        )

    def error(self, model: PortModel | CoupledPort, tolerance: float | None = None) -> float:
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
        model: PortModel | CoupledPort,
        tolerance: float | None,
    ) -> float:
        """In-band error in block i on hub `number`, known for models that were asked for before."""
        if isinstance(model, CoupledPort):
            whole = replace(model, rigid_mass=self.exact.rigid_mass)
            seen = whole.seen(np.eye(self.exact.motions)[:, motions])
            return self._references[number].error(i, seen, tolerance)
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
        return model.frequencies[modes], rows, model.damping[modes]


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
    tried = [_choose_for(promise, candidates, target, tolerance, fixed, tip) for target in targets]
    ranks = [(not c.met, sum(c.modes.values()) if c.met else c.error) for c, _ in tried]
    at = min(range(len(tried)), key=lambda k: ranks[k])
    best, error = tried[at]
    ledger = _ledger(promise, candidates, best.modes, error)
    best = replace(best, error=error(best.modes), left_out=tuple(ledger))
    lines: list[str] = []
    for c in [best if k == at else c for k, (c, _) in enumerate(tried)]:
        kept = (
            ", ".join(f"{count} in {port}" for port, count in c.modes.items() if count) or "rigid"
        )
        above = "" if c.met else f" ({tolerance_statement(c.error, tolerance)})"
        lines.append(f'target "{c.target}": {kept}, in-band error {c.error:.2e}{above}')
    chosen = f'chosen: target "{best.target}", {sum(best.modes.values())} flexible modes'
    return replace(best, reasoning=(*lines, chosen, *best.reasoning))


def _choose_for(
    promise: Promise,
    candidates: Candidates,
    target: str,
    tolerance: float,
    fixed: Mapping[str, int],
    tip: bool,
) -> tuple[Choice, Callable[..., float]]:
    """The choice for one target, its ledger still empty, and the error of mode counts,
    of ports that stay whole."""
    reduced = cache(partial(candidates.reduce, target))

    @cache
    def error_of(kept: tuple[int | None, ...], asked: float | None) -> float:
        """With so many modes of each port; None: it stays whole."""
        models = {
            port: model if count is None else reduced(port, count)
            for (port, model), count in zip(candidates.whole.items(), kept, strict=True)
            if count != 0
        }
        return promise.error(model_in_space(models, promise.exact.rigid_mass), asked)

    def error(
        counts: Mapping[str, int], whole: Sequence[str] = (), asked: float | None = tolerance
    ) -> float:
        kept = tuple(None if p in whole else counts.get(p, 0) for p in candidates.whole)
        return error_of(kept, asked)

    counts: dict[str, int] = {}
    alone: dict[str, float] = {}
    least: dict[str, int] = {}
    most = {port: min(MOST, values.size) for port, values in candidates.frequencies.items()}
    for port, frequencies in candidates.frequencies.items():
        others = [p for p in candidates.whole if p != port]
        inside = int(np.sum(frequencies <= promise.bandwidth))
        floor = inside if tip and port in ("xy", "xz") else 0
        least[port] = fixed.get(port, min(floor, most[port]))
        counts[port] = least[port]
        if port not in fixed:
            while (
                not keeps_tolerance(error(counts, others), tolerance) and counts[port] < most[port]
            ):
                counts[port] += 1
        alone[port] = error(counts, others)
    # ports that the hub couples may need more together than alone
    while not keeps_tolerance(error(counts), tolerance):
        room = [
            port
            for port, count in counts.items()
            if port not in fixed and count < most[port] and promise.reaches(_motions(port))
        ]
        if not room:
            break
        gains = {p: error({**counts, p: counts[p] + 1}) for p in room}
        port = min(gains, key=lambda p: gains[p])
        if gains[port] >= error(counts) * (1.0 - 1e-9):
            break
        counts[port] += 1
    for port in counts:  # and no more than needed
        while port not in fixed and counts[port] > least[port]:
            fewer = {**counts, port: counts[port] - 1}
            if not keeps_tolerance(error(fewer), tolerance) and error(fewer) > error(counts):
                break
            counts = fewer
    counts = _no_better_neighbour(
        counts, error, tolerance, least, {p: n for p, n in most.items() if p not in fixed}
    )
    total = error(counts)
    reasons = (
        f"{port} alone, the others whole: {alone[port]:.2e} with {counts[port]} modes"
        for port in counts
    )
    cannot = tuple(_cannot(candidates, counts, tip))
    choice = Choice(
        counts, target, total, keeps_tolerance(total, tolerance), (), cannot, tuple(reasons)
    )
    return choice, partial(error, asked=None)


def _no_better_neighbour(
    counts: dict[str, int],
    error: Callable[..., float],
    tolerance: float,
    least: Mapping[str, int],
    most: Mapping[str, int],
) -> dict[str, int]:
    """Mode counts that no change by one in a port, nor by one in each of two ports, makes better.

    Better: it keeps the tolerance with fewer modes, or with as many and less error; where none
    keeps it, less error. Ports without an upper bound in `most` stay as they are.
    """

    def rank(some: Mapping[str, int]) -> tuple[bool, int, float]:
        found = error(some)
        return (
            (False, sum(some.values()), found)
            if keeps_tolerance(found, tolerance)
            else (True, 0, found)
        )

    single = [{port: step} for port in most for step in (-1, 1)]
    paired = [{a: i, b: j} for a, b in combinations(most, 2) for i in (-1, 1) for j in (-1, 1)]
    best = rank(counts)
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
            if all(least[port] <= some[port] <= most[port] for port in most)
            and sum(some.values()) <= room
        ]
        ranks = [rank(some) for some in around]
        at = min(range(len(around)), key=lambda k: ranks[k], default=None)
        if at is None or not _better(ranks[at], best):
            break
        counts, best = around[at], ranks[at]
    return counts


def _better(new: tuple[bool, int, float], old: tuple[bool, int, float]) -> bool:
    """Whether a rank is better by more than rounding."""
    return new[:2] < old[:2] or (new[:2] == old[:2] and new[2] < old[2] * (1.0 - 1e-6))


def _ledger(
    promise: Promise,
    candidates: Candidates,
    counts: Mapping[str, int],
    error: Callable[..., float],
) -> list[LeftOut]:
    """What was left out of each port, and the error it costs by itself."""
    out: list[LeftOut] = []
    for port, frequencies in candidates.frequencies.items():
        kept = counts[port]
        others = [p for p in candidates.whole if p != port]
        if kept >= frequencies.size:
            continue
        first = float(frequencies[kept])
        whole = f"{port} (first mode {first:.3g} rad/s)"
        above = f"{port} mode {kept + 1} ({first:.3g} rad/s)"
        if not promise.reaches(_motions(port)):
            names = [name for name, i in AXES.items() if i in promise.wanted]
            what = whole if kept == 0 else above
            out.append(LeftOut(what, f"no path to hub axes {', '.join(names)}", 0.0))
            continue
        what = whole if kept == 0 else f"{above} and above"
        where = "outside" if first > promise.bandwidth else "inside"
        out.append(
            LeftOut(what, f"{where} {promise.bandwidth:.4g} rad/s", error(dict(counts), others))
        )
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
