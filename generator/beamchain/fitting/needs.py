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

from beamchain.ports.compare import (
    STANDARD_HUBS,
    Block,
    Reference,
    keeps_tolerance,
    tolerance_statement,
    with_damping,
)
from beamchain.ports.compose import model_in_space
from beamchain.ports.coupled import CoupledPort
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, PORTS, Array

FAR = 25.0  # times the bandwidth: modes above act through their static flexibility only
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
    """The in-band error of candidate models on the hub in space, evaluated block by block.

    Ports that neither the hub nor the appendage couples are independent blocks: the norm of the
    whole is the largest of theirs. `rigid_mass`, `hub_mass` `(6, 6)` about the root, without a hub
    the worst of three; `bandwidth` [rad/s].
    """

    def __init__(
        self,
        full: Mapping[str, PortModel],
        rigid_mass: Array,
        hub_mass: Array | None,
        axes: Sequence[str],
        bandwidth: float,
    ) -> None:
        rigid = np.array(rigid_mass)
        size = float(np.max(np.diag(rigid)[3:]))
        for i in range(6):  # an appendage that states no polar inertia has a trace of it
            rigid[i, i] = max(rigid[i, i], 1e-9 * size)
        self.full: dict[str, PortModel] = {
            p: with_damping(model).condensed(FAR * bandwidth) for p, model in full.items()
        }
        self.frequencies: dict[str, Array] = {
            port: model.frequencies for port, model in full.items()
        }
        self.rigid: Array = rigid
        self.bandwidth: float = bandwidth
        self.keep: list[int] = sorted({AXES[axis] for axis in axes})
        hubs = [hub_mass] if hub_mass is not None else [factor * rigid for factor in STANDARD_HUBS]
        self.groups: list[list[tuple[str, ...]]] = [
            list(filter(self._kept, self._blocks(hub))) for hub in hubs
        ]
        self._known: dict[tuple[object, ...], float] = {}
        self._references = [
            Reference([self._block(hub, block) for block in groups], bandwidth)
            for hub, groups in zip(hubs, self.groups, strict=True)
        ]

    def reaches(self, port: str) -> bool:
        """Whether a port can move any hub motion that matters."""
        return any(port in block for blocks in self.groups for block in blocks)

    def error(
        self,
        models: Mapping[str, PortModel],
        label: Mapping[str, object],
        tolerance: float | None = None,
    ) -> float:
        """In-band error of `models` (a port without one is rigid);
        `label` names each port's model for reuse.

        `tolerance`: as of `ports.compare.maximum_of`, for a search.
        """
        worst = 0.0
        for number, blocks in enumerate(self.groups):
            for i, block in enumerate(blocks):
                key = (number, block, tuple(label.get(port) for port in block), tolerance)
                if key not in self._known:
                    model = self._block_model(
                        block, {p: with_damping(models[p]) for p in block if p in models}
                    )
                    self._known[key] = self._references[number].error(i, model, tolerance)
                worst = max(worst, self._known[key])
        return worst

    def error_in_space(self, whole: CoupledPort) -> float:
        """In-band error of an appendage in six motions with its whole damping matrix."""
        held = replace(whole, rigid_mass=self.rigid)
        motions = np.eye(6)
        return max(
            (
                reference.error(i, held.seen(motions[:, _motions_of(block)]))
                for reference, blocks in zip(self._references, self.groups, strict=True)
                for i, block in enumerate(blocks)
            ),
            default=0.0,
        )

    def _kept(self, block: tuple[str, ...]) -> list[int]:
        motions = [i for port in block for i in _motions(port)]
        return [i for i in self.keep if i in motions]

    def _blocks(self, hub: Array) -> list[tuple[str, ...]]:
        """Groups of ports that the hub couples."""
        total = hub + self.rigid
        scale = np.sqrt(np.diag(total))
        coupled = np.abs(total) / np.outer(scale, scale) > 1e-12
        blocks: list[set[str]] = []
        for port in PORTS:
            linked = [
                b
                for b in blocks
                if any(coupled[np.ix_(_motions(port), _motions(other))].any() for other in b)
            ]
            blocks = [b for b in blocks if b not in linked] + [{port}.union(*linked)]
        return [tuple(port for port in PORTS if port in block) for block in blocks]

    def _block(self, hub: Array, block: tuple[str, ...]) -> Block:
        motions = _motions_of(block)
        keep = tuple(motions.index(i) for i in self._kept(block))
        return Block(hub[np.ix_(motions, motions)], self._block_model(block, self.full), keep)

    def _block_model(self, block: tuple[str, ...], models: Mapping[str, PortModel]) -> PortModel:
        """One model in the motions of a block."""
        motions = _motions_of(block)
        six = model_in_space({p: models[p] for p in block if p in models}, self.rigid)
        return PortModel(
            six.rigid_mass[np.ix_(motions, motions)],
            six.frequencies,
            six.participation[:, motions],
            six.damping,
        )


def _motions_of(block: tuple[str, ...]) -> list[int]:
    return sorted(i for port in block for i in _motions(port))


@cache
def _motions(port: str) -> list[int]:
    return [int(i) for i in np.flatnonzero(np.any(PORT_MOTION[port] != 0.0, axis=1))]


def choose(
    promise: Promise,
    reduce: Reduce,
    targets: Sequence[str],
    tolerance: float,
    fixed: Mapping[str, int],
    tip: bool = False,
) -> Choice:
    """The fewest modes whose in-band error stays within `tolerance`;
    the first of `targets` wins a tie.

    `fixed`: ports whose number the user decided; `tip`: keep every plane mode inside the band.
    """
    tried = [_choose_for(promise, reduce, target, tolerance, fixed, tip) for target in targets]
    ranks = [(not c.met, sum(c.modes.values()) if c.met else c.error) for c, _ in tried]
    at = min(range(len(tried)), key=lambda k: ranks[k])
    best, error = tried[at]
    best = replace(
        best, error=error(best.modes), left_out=tuple(_ledger(promise, best.modes, error))
    )
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
    reduce: Reduce,
    target: str,
    tolerance: float,
    fixed: Mapping[str, int],
    tip: bool,
) -> tuple[Choice, Callable[..., float]]:
    """The choice for one target, its ledger still empty, and the error of mode counts,
    of ports that stay whole."""
    known: dict[tuple[str, int], PortModel] = {}

    def error(
        counts: Mapping[str, int], whole: Sequence[str] = (), asked: float | None = tolerance
    ) -> float:
        models: dict[str, PortModel] = {}
        label: dict[str, object] = {}
        for port in promise.full:
            if port in whole:
                models[port], label[port] = promise.full[port], "whole"
            elif counts.get(port, 0):
                key = (port, counts[port])
                if key not in known:
                    known[key] = reduce(target, *key)
                models[port], label[port] = known[key], (target, counts[port])
            else:
                label[port] = 0
        return promise.error(models, label, asked)

    counts: dict[str, int] = {}
    alone: dict[str, float] = {}
    least: dict[str, int] = {}
    most = {port: min(MOST, values.size) for port, values in promise.frequencies.items()}
    for port in promise.full:
        others = [p for p in promise.full if p != port]
        floor = (
            int(np.sum(promise.frequencies[port] <= promise.bandwidth))
            if tip and port in ("xy", "xz")
            else 0
        )
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
        room = [p for p in counts if p not in fixed and counts[p] < most[p] and promise.reaches(p)]
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
    cannot = tuple(_cannot(promise, counts, tip))
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
    promise: Promise, counts: Mapping[str, int], error: Callable[..., float]
) -> list[LeftOut]:
    out: list[LeftOut] = []
    for port, frequencies in promise.frequencies.items():
        kept = counts[port]
        others = [p for p in promise.full if p != port]
        if kept >= frequencies.size:
            continue
        first = float(frequencies[kept])
        whole = f"{port} (first mode {first:.3g} rad/s)"
        above = f"{port} mode {kept + 1} ({first:.3g} rad/s)"
        if not promise.reaches(port):
            names = [name for name, i in AXES.items() if i in promise.keep]
            what = whole if kept == 0 else above
            out.append(LeftOut(what, f"no path to hub axes {', '.join(names)}", 0.0))
            continue
        what = whole if kept == 0 else f"{above} and above"
        where = "outside" if first > promise.bandwidth else "inside"
        out.append(
            LeftOut(what, f"{where} {promise.bandwidth:.4g} rad/s", error(dict(counts), others))
        )
    return out


def _cannot(promise: Promise, counts: Mapping[str, int], tip: bool) -> list[str]:
    out: list[str] = []
    for port, frequencies in promise.frequencies.items():
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
