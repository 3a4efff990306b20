"""Where an appendage is cut: hinges as evenly spaced as the modes let them be, real hinge lines and the user's kept.

Modal tendons can give modes to a cut if the limp chain does not weigh more on the root than the residual mass of the
modes (`chain.tendons`). The share of that residual mass which is left over is the cut's margin. It grows as the first
hinges move towards the root, so that the most even cut with enough margin is the one wanted.

Theory: docs/theory.md, section 4.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, islice, pairwise

import numpy as np
from scipy.optimize import OptimizeResult, minimize

from beamchain.chain.chain import Freedom, Link
from beamchain.chain.tendons import Modes, group_motion
from beamchain.errors import RealisationError
from beamchain.ports.motions import PORT_MOTION, Array, shifted
from beamchain.structure.mass_line import MassLine

MARGIN = 0.02  # of the residual mass, that the inequality must leave
SHORTEST = 1e-3  # of the length: a shorter link is none
HOPELESS = -0.65  # margin below which no search over three or more hinges arrived: of 58, the worst began at -0.62
ENOUGH = 0.1  # margin at which the search for a feasible cut ends, as evening out takes it back
SPREADS = np.geomspace(0.5, 0.002, 24)  # first free hinge, in lengths
POWERS = (1.0, 1.5, 2.0, 3.0, 4.0)  # how the others follow
NEAR = (0.3, 0.2, 0.134, 0.09, 0.06, 0.04, 0.02)  # hinges by a further port, in lengths from it
SWEEPS = 8  # of the relaxation towards even links
STEPS = (1.0, 0.75, 0.5, 0.25, 0.1, 0.03)
MANY_TRIED = 4_000  # margins worked out, after which the best cut so far is taken
MOST_TRIED = 30_000  # the same where none was found: some four seconds
MOST_CHOICES = 8  # of hinges for a port that needs fewer than there are
LEAST_MARGIN = 0.004  # of the same beside a further port, whose own share is what is left
MOST_ADDED = 4  # hinges tried beyond what the modes need
NOTHING_LEFT = 1e-11  # of the rigid mass: less residual mass than this is none
ROUNDED = 1e-13  # of the whole inertia: what differences of its parts lose
FLAT = 1e-12  # of the largest second moment: thickness of a lamina
SAME_PLACE = 1e-9  # of the length
TABLE = 1001  # stations of the mass behind them, between which is interpolated

#: Motion of the root equal to a unit motion of a hinge at x: the first vector less x times the second.
TURNS = {
    port: (motion[:, -1], -shifted(np.array([-1.0, 0.0, 0.0])) @ motion[:, -1] + motion[:, -1])
    for port, motion in PORT_MOTION.items()
}


@dataclass(frozen=True, eq=False)
class Wanted:
    """A group of ports and how many hinges each needs.

    Args:
        modes: of the group.
        counts: hinges per port.
        fixed: per port, x of hinges that stand [m].
    """

    modes: Modes
    counts: Mapping[str, int]
    fixed: Mapping[str, tuple[float, ...]]

    def more(self) -> "Wanted":
        """The same with one more hinge in every port."""
        return Wanted(self.modes, {port: count + 1 for port, count in self.counts.items()}, self.fixed)


@dataclass(frozen=True, eq=False)
class Cut:
    """Where the hinges stand.

    Args:
        x: `(c,)` from the root [m].
        ports: per hinge, the ports in which it moves.
        margin: least share of the residual mass that is left, over all groups.
        added: hinges beyond what the modes need.
        reason: why they were added.
    """

    x: Array
    ports: tuple[tuple[str, ...], ...]
    margin: float
    added: int
    reason: str = ""

    def shortest(self, length: float) -> float:
        """Length of the shortest link over the whole."""
        return shortest_link(self.x, length)


def shortest_link(x: Array, length: float) -> float:
    """Shortest distance between neighbouring hinges, root (where no hinge stands at it) and tip, over the length."""
    edges = [*([] if x.size and x[0] <= SAME_PLACE * length else [0.0]), *x.tolist(), length]
    return min(b - a for a, b in pairwise(edges)) / length


class _Table:
    """Mass matrices behind places along an appendage, good enough to choose by."""

    def __init__(self, line: MassLine) -> None:
        self.length: float = line.length
        steps = np.array([[x, x + 1e-8 * line.length] for x in line.steps]).ravel()
        self._grid = np.unique(np.concatenate([np.linspace(0.0, line.length, TABLE), steps]))
        table = line.behind(np.concatenate([[-line.length], self._grid]))
        self.rigid: Array = table[0]
        self._behind = table[1:]
        self.tried: int = 0

    def behind(self, x: Array) -> Array:
        """`(c, 6, 6)` mass matrix behind each of `x` `(c,)`."""
        at = np.clip(np.searchsorted(self._grid, x, side="right") - 1, 0, self._grid.size - 2)
        part = (x - self._grid[at]) / (self._grid[at + 1] - self._grid[at])
        low, high = self._behind[at], self._behind[at + 1]
        return low + np.clip(part, 0.0, 1.0)[:, None, None] * (high - low)


@dataclass(eq=False)
class _Search:
    """Margins of candidate cuts of one appendage."""

    table: _Table
    wanted: tuple[Wanted, ...]
    further: tuple[float, ...]
    _known: dict[int, tuple[Array, Array, Array, Array]] = field(
        default_factory=dict[int, tuple[Array, Array, Array, Array]]
    )

    def margin(self, group: Wanted, x: Array, freedoms: Sequence[Freedom], behind: Array) -> float:
        """Least eigenvalue of what the inequality leaves, over the residual mass (and the further ports' own).

        Args:
            group: whose modes.
            x: `(c,)` hinges [m].
            freedoms: of the group.
            behind: `(c, 6, 6)` mass matrix behind each hinge.
        """
        self.table.tried += 1
        motion, given, floor, left_over = self._constants(group)
        at = np.array([i for i, _ in freedoms])
        own = np.array([TURNS[p][0] - x[i] * TURNS[p][1] for i, p in freedoms])
        pulled = (behind[at] @ own[:, :, None])[:, :, 0]  # momentum of what moves, per freedom
        kinematics = (pulled @ motion).T
        inertia = np.where(at[:, None] >= at[None, :], pulled @ own.T, (pulled @ own.T).T)  # of the later of two
        own = own.T
        rows = [kinematics]
        for place in self.further:
            moved = motion.T @ shifted(np.array([place, 0.0, 0.0])) @ own
            rows.append(moved * (x[at] < place))
        stack = np.vstack(rows)
        try:
            root = np.linalg.cholesky(inertia)
        except np.linalg.LinAlgError:
            return -np.inf
        unit = np.linalg.solve(root, stack.T).T
        left = unit @ unit.T - given
        m = motion.shape[1]
        blocks = [left_over]
        for k in range(1, len(rows)):
            own_rows = unit[k * m : (k + 1) * m]
            blocks.append(own_rows @ own_rows.T)
        left[:m, :m] += floor
        return _least_share(left, blocks)

    def _constants(self, group: Wanted) -> tuple[Array, Array, Array, Array]:
        """What a group's margin takes that no hinge changes: its motion, its modes' share, a floor, the residual mass."""
        key = id(group)
        if key not in self._known:
            motion, rows = group_motion(group.modes.ports), group.modes.rows
            mass = motion.T @ self.table.rigid @ motion
            part = rows[:, : motion.shape[1]]
            floor = NOTHING_LEFT * np.diag(np.diag(mass))
            self._known[key] = motion, rows.T @ rows, floor, mass - part.T @ part + floor
        return self._known[key]

    def assigned(self, x: Array, *, whole: bool = True) -> tuple[float, list[list[Freedom]], list[float]]:
        """Least margin, and per group its freedoms and margin, for hinges at `x`; not `whole`: up to one that fails."""
        behind = self.table.behind(x)
        chosen: list[list[Freedom]] = []
        margins: list[float] = []
        for group in self.wanted:
            best: tuple[float, list[Freedom]] = (-np.inf, [])
            for freedoms in self._choices(group, x):
                value = self.margin(group, x, freedoms, behind)
                if value > best[0] or not best[1]:
                    best = value, freedoms
                if value >= MARGIN:
                    break
            chosen.append(best[1])
            margins.append(best[0])
            if best[0] < MARGIN and not whole:
                break
        return min(margins), chosen, margins

    def _choices(self, group: Wanted, x: Array) -> Iterator[list[Freedom]]:
        """Hinges that a group may take: those that stand, and of the others some, evenly spread ones first."""
        close = SAME_PLACE * self.table.length
        own: dict[str, list[int]] = {}
        free: dict[str, list[int]] = {}
        more: dict[str, int] = {}
        for port, count in group.counts.items():
            fixed = group.fixed.get(port, ())
            own[port] = [i for i, at in enumerate(x) if any(abs(at - f) <= close for f in fixed)]
            free[port] = [i for i in range(x.size) if i not in own[port]]
            more[port] = max(min(count - len(own[port]), len(free[port])), 0)

        def taken(pick: Mapping[str, Sequence[int]]) -> list[Freedom]:
            return sorted((i, p) for p in own for i in [*own[p], *(free[p][k] for k in pick[p])])

        yield taken({p: [k * len(free[p]) // more[p] for k in range(more[p])] for p in own})
        if all(more[p] == len(free[p]) for p in own):
            return
        yield taken({p: range(more[p]) for p in own})
        if len(own) == 1:
            [port] = own
            for pick in islice(combinations(range(len(free[port])), more[port]), MOST_CHOICES):
                yield taken({port: pick})

    def value(self, x: Array, *, whole: bool = True) -> float:
        """Least margin of hinges at `x`; -inf where a link is too short. Not `whole`: of the groups up to one that fails."""
        if shortest_link(x, self.table.length) < SHORTEST or np.any(np.diff(x) <= 0.0):
            return -np.inf
        return self.assigned(x, whole=whole)[0]


def _least_share(left: Array, blocks: Sequence[Array]) -> float:
    """Least eigenvalue of `left` with each diagonal block scaled by the inverse root of its own measure."""
    size = left.shape[0]
    scale = np.zeros((size, size))
    at = 0
    for block in blocks:
        try:
            scale[at : at + len(block), at : at + len(block)] = np.linalg.inv(np.linalg.cholesky(block))
        except np.linalg.LinAlgError:
            return -np.inf
        at += len(block)
    with np.errstate(all="ignore"):
        unit = scale @ left @ scale.T
    return float(np.linalg.eigvalsh(unit)[0]) if np.all(np.isfinite(unit)) else -np.inf


def choose_cut(line: MassLine, wanted: Sequence[Wanted], lines: Sequence[float], further: Sequence[float] = ()) -> Cut:
    """The most even cut that holds the modes.

    Args:
        line: how the mass lies.
        wanted: per group of ports.
        lines: x where hinges must stand [m].
        further: x of further ports that must be exact too [m].

    Raises:
        RealisationError: no cut holds them; by how much, and what would.
    """
    length = line.length
    fixed = _merged([*lines, *(x for group in wanted for places in group.fixed.values() for x in places)], length)
    groups = list(wanted)
    table = _Table(line)
    first: str | None = None
    tried = 0
    for added in range(MOST_ADDED + fixed.size + 1):
        if table.tried > MOST_TRIED:
            break
        tried = added
        search = _Search(table, tuple(groups), tuple(further))
        size = max(fixed.size, *(count for group in groups for count in group.counts.values()))
        x, margin = _best(search, fixed, size - fixed.size)
        enough = LEAST_MARGIN if further else MARGIN
        if margin >= enough:
            search = _Search(table, tuple(_fewest(search, x, wanted, groups)), tuple(further))
            x = _even(search, x, fixed)
            margin, chosen, _ = search.assigned(x)
            ports = [tuple(p for group in chosen for i, p in group if i == k) for k in range(x.size)]
            used = [k for k in range(x.size) if ports[k]]
            return Cut(x[used], tuple(ports[k] for k in used), margin, added, first or "")
        margins = search.assigned(x)[2] if np.isfinite(margin) else [-np.inf] * len(groups)
        if first is None:
            first = _told(groups, margins)
        groups = [g.more() if m < MARGIN else g for g, m in zip(groups, margins, strict=True)]
    raise RealisationError(
        f"no cut of the appendage holds these modes: {first} (further hinges tried: {tried}); "
        + (
            "keep fewer modes, or fewer points beside the root."
            if further
            else "keep fewer modes, or check the rigid mass and the participation."
        )
    )


def _fewest(search: _Search, x: Array, wanted: Sequence[Wanted], groups: Sequence[Wanted]) -> list[Wanted]:
    """The groups, each with no more hinges than it needs on a cut that others needed."""
    out = list(groups)
    for k, first in enumerate(wanted):
        least = first
        while least.counts != groups[k].counts:
            if _Search(search.table, (least,), search.further).assigned(x)[0] >= MARGIN:
                out[k] = least
                break
            least = least.more()
    return out


def _told(groups: Sequence[Wanted], margins: Sequence[float]) -> str:
    k = int(np.argmin(margins))
    ports = " and ".join(groups[k].modes.ports)
    if not np.isfinite(margins[k]):
        return f"the modes in {ports} leave no positive residual mass"
    return f"in {ports} the limp chain weighs {1.0 - margins[k]:.3g} times the residual mass, where {1.0 - MARGIN:g} is the limit"


def _merged(places: Sequence[float], length: float) -> Array:
    out: list[float] = []
    for x in sorted(places):
        if not out or x - out[-1] > SAME_PLACE * length:
            out.append(x)
    return np.array(out)


def _best(search: _Search, fixed: Array, free: int) -> tuple[Array, float]:
    """Hinges with enough margin and the longest shortest link; else those with the largest margin."""
    if free <= 0:
        return fixed, search.value(fixed)
    length = search.table.length
    good: tuple[float, Array, float] | None = None
    most: tuple[float, Array] = (-np.inf, fixed)
    for pattern in _patterns(length, free, search.further):
        if search.table.tried > (MANY_TRIED if good is not None else MOST_TRIED):
            break
        low, high = 0, SPREADS.size  # the margin grows as the first hinge nears the root
        while low < high:
            middle = (low + high) // 2
            x = np.sort(np.concatenate([fixed, pattern(float(SPREADS[middle]))]))
            margin, short = search.value(x, whole=good is None), shortest_link(x, length)
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
    return _climbed(search, fixed, *most)


def _patterns(length: float, free: int, further: Sequence[float]) -> Iterator[Callable[[float], Array]]:
    """Free hinges by the place of the first, in lengths: graded towards the root, and towards further ports.

    Args:
        length: of the appendage [m].
        free: how many hinges.
        further: x of further ports [m].
    """

    def graded(a: float, power: float, count: int, end: float) -> Array:
        s = a ** (1.0 / power)
        return end * (s + (1.0 - s) * np.arange(count) / max(count, 1)) ** power

    for power in POWERS if free > 1 else POWERS[:1]:
        if not further:
            yield lambda a, p=power: graded(a, p, free, length)
    near = [np.array([-1.0, -0.4]), np.array([-1.0, 0.5]), np.array([-0.5, 0.5])]
    for gap in NEAR if further else ():
        for around in near:
            own = np.concatenate([x + gap * length * around for x in further])
            own = own[(own > 0.0) & (own < length)]
            if own.size > free:
                continue
            for power in POWERS[:3]:
                yield lambda a, p=power, o=own: np.concatenate([graded(a, p, free - o.size, 0.97 * float(o.min())), o])


def _climbed(search: _Search, fixed: Array, margin: float, x: Array) -> tuple[Array, float]:
    """The margin raised from a start, hinges between 0 and the tip."""
    if not np.isfinite(margin):
        return x, margin
    length = search.table.length
    own = np.array([v for v in x if not np.any(np.abs(fixed - v) <= SAME_PLACE * length)])
    if (margin < HOPELESS and own.size > 2) or search.table.tried > MOST_TRIED:
        return x, margin

    def places(free: Array) -> Array:
        return np.sort(np.concatenate([fixed, length / (1.0 + np.exp(-free))]))

    def lost(free: Array) -> float:
        value = search.value(places(free))
        return np.log(1.0 - value) if np.isfinite(value) else 50.0

    def enough(intermediate_result: OptimizeResult) -> None:
        found = intermediate_result.fun < np.log(1.0 - ENOUGH) and not search.further
        if found or search.table.tried > MOST_TRIED:
            raise StopIteration

    found = minimize(
        lost, np.log(own / (length - own)), method="Nelder-Mead", callback=enough,
        options={"maxfev": 60 * own.size, "xatol": 1e-3, "fatol": 1e-3},
    )  # fmt: skip
    better = places(found.x)
    value = search.value(better)
    return (better, value) if value > margin else (x, margin)


def _even(search: _Search, x: Array, fixed: Array) -> Array:
    """The cut with its free hinges moved towards the middles of their neighbours as far as the margin allows."""
    length = search.table.length
    x = x.copy()
    for _ in range(SWEEPS):
        if search.table.tried > MOST_TRIED:
            break
        before = x.copy()
        for i in range(x.size):
            if np.any(np.abs(fixed - x[i]) <= SAME_PLACE * length):
                continue
            low, high = x[i - 1] if i else 0.0, x[i + 1] if i + 1 < x.size else length
            for step in STEPS:
                moved = x.copy()
                moved[i] += step * ((low + high) / 2.0 - x[i])
                if abs(moved[i] - x[i]) > 1e-6 * length and search.value(moved, whole=False) >= MARGIN:
                    x = moved
                    break
        if np.max(np.abs(x - before)) < 1e-4 * length:
            break
    return x


def _rounded(about: Array, noise: float) -> Array:
    """`(3, 3)` inertia about the centre, no second moment below zero by rounding: a lamina's is nothing across it."""
    moments = np.trace(about) / 2.0 * np.eye(3) - about
    values, axes = np.linalg.eigh(moments)
    if not -noise < values[0] < FLAT * values[2]:
        return about
    values = np.maximum(values, FLAT * values[2])
    return float(np.sum(values)) * np.eye(3) - (axes * values) @ axes.T


def bodies(line: MassLine, x: Array) -> list[Link]:
    """The appendage's own rigid pieces between the hinges, as they are; see `polar.settled` for thin ones."""
    behind = line.behind(np.concatenate([[-line.length], x]))
    pieces = [*(a - b for a, b in pairwise(behind)), behind[-1]]
    edges = [0.0, *x.tolist(), line.length]
    out: list[Link] = []
    for a, b, matrix in zip(edges[:-1], edges[1:], pieces, strict=True):
        mass = float(np.trace(matrix[:3, :3])) / 3.0
        if mass <= 0.0:
            out.append(Link(a, b - a, 0.0, a, (0.0, 0.0, 0.0)))
            continue
        centre = np.array([matrix[1, 5] - matrix[2, 4], 2.0 * matrix[2, 3], -2.0 * matrix[1, 3]]) / 2.0 / mass
        about = matrix[3:, 3:] - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        about = _rounded(about, ROUNDED * float(np.trace(behind[0][3:, 3:])))
        if np.max(np.abs(about - np.diag(np.diag(about)))) < ROUNDED * float(np.trace(behind[0][3:, 3:])):
            about = np.diag(np.diag(about))
        centre[1:] = np.where(np.abs(centre[1:]) < ROUNDED * line.length, 0.0, centre[1:])
        inertia = (float(about[0, 0]), float(about[1, 1]), float(about[2, 2]))
        products = (float(about[0, 1]), float(about[0, 2]), float(about[1, 2]))
        out.append(Link(a, b - a, mass, float(centre[0]), inertia, (float(centre[1]), float(centre[2])), products))
    return out
