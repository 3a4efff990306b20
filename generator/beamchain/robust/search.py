"""One search for the samples of an uncertain loop that reach farthest: every point that is tried
counts for all figures."""

from collections.abc import Callable, Iterable, Iterator
from typing import Generic, Protocol, TypeVar

import numpy as np
from scipy.optimize import minimize

from beamchain.robust.uncertain_loop import Figure, Reach
from beamchain.toolkit import Array

AGAIN = 1e-3  # relative, by which what was tried for others is worse, to search from there
TIE = 1e-6  # relative, by which a sample that reaches farther is another one
LIMITED = 0.5  # reach along a real ray, from which on a gain is limited
# logarithm of the reach that stands for an unstable sample: that of the largest number
UNSTABLE = float(np.log(np.finfo(np.float64).max))

Tell = Callable[[str], None]


class Samples(Protocol):
    """What is searched."""

    figures: tuple[Figure, ...]

    def reach(self, deltas: Array) -> Reach:
        """How far a sample `(blocks,)` reaches."""
        ...

    def slope(self, figure: int, deltas: Array, omega: float) -> Array:
        """`(blocks,)` slope of the logarithm of a reach, which is at a frequency."""
        ...

    def corners(self) -> list[Array]:
        """Samples to which slopes point."""
        ...


Loop = TypeVar("Loop", bound=Samples)


class Search(Generic[Loop]):
    """A search for the worst samples of all figures at once.

    `tried` are the samples, in order; none is looked at twice.

    Args:
        loop: whose samples they are.
        tell: told how many were tried.
    """

    def __init__(self, loop: Loop, tell: Tell | None = None) -> None:
        self.loop = loop
        self.tried: list[Array] = []
        self._reaches: dict[bytes, Reach] = {}
        self._tell = tell

    def reach(self, deltas: Array) -> Reach:
        """How far a sample `(blocks,)` reaches."""
        key = deltas.tobytes()
        if key not in self._reaches:
            self._reaches[key] = self.loop.reach(deltas)
            self.tried.append(deltas.copy())
            if self._tell:
                self._tell(f"samples tried: {len(self.tried)}")
        return self._reaches[key]

    def run(self, starts: Iterable[Array]) -> None:
        """Try samples, the corners to which slopes point, and for every figure a local search from
        the worst of all that was tried for any of them, with the ends of every range, one at a
        time, where that ends; again where others have found a worse one.

        It ends where one is unstable: nothing is worse.
        """
        if not self._all_stable(starts) or not self._all_stable(self.loop.corners()):
            return
        settled = [LIMITED if figure.ray in (1.0, -1.0) else 0.0 for figure in self.loop.figures]
        while True:
            again = np.flatnonzero(self.sizes > np.array(settled) * (1.0 + AGAIN))
            if not again.size:
                return
            figure = int(again[0])
            self.climb(figure, self.worst(figure))
            worst = self.worst(figure)
            settled[figure] = float(self.reach(worst).sizes[figure])
            if not self.stable or not self._all_stable(_beside(worst)):
                return

    @property
    def stable(self) -> bool:
        """Whether all samples that were tried are stable."""
        return bool(np.isfinite(self.sizes).all())

    @property
    def sizes(self) -> Array:
        """`(figures,)` the farthest that any sample reaches."""
        return self._all_sizes().max(axis=0)

    def worst(self, figure: int) -> Array:
        """The sample that reaches farthest."""
        return self.tried[int(np.argmax(self._all_sizes()[:, figure]))]

    def found(self) -> list[Array]:
        """The samples that are the worst of some figure, each once; of those as bad the first."""
        sizes = self._all_sizes()
        first = np.argmax(sizes >= sizes.max(axis=0) * (1.0 - TIE), axis=0)
        return [self.tried[int(k)] for k in dict.fromkeys(first.tolist())]

    def _all_sizes(self) -> Array:
        return np.array([self._reaches[deltas.tobytes()].sizes for deltas in self.tried])

    def _all_stable(self, samples: Iterable[Array]) -> bool:
        """Whether all samples are stable; none is tried after one that is not."""
        return all(self.reach(deltas).stable for deltas in samples)

    def climb(self, figure: int, start: Array) -> None:
        """A local search from a stable sample, and the corner to which the slopes point where it
        ends."""

        def cost(deltas: Array) -> tuple[float, Array]:
            """Minus the logarithm of the reach, and its slopes; an unstable sample is the least
            there is, where the search ends."""
            reach = self.reach(deltas)
            if not reach.stable:
                return -UNSTABLE, np.zeros_like(deltas)
            slope = self.loop.slope(figure, deltas, float(reach.omega[figure]))
            return -float(np.log(reach.sizes[figure])), -slope

        bounds = [(-1.0, 1.0)] * start.size
        end = minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds)
        _, slopes = cost(np.asarray(end.x))
        if self.stable:
            self.reach(np.where(slopes < 0.0, 1.0, -1.0))


def _beside(deltas: Array) -> Iterator[Array]:
    """The same with one of them after the other at either end of its range."""
    for k in range(deltas.size):
        for end in (-1.0, 1.0):
            moved = deltas.copy()
            moved[k] = end
            yield moved


def stability_limit(loop: Samples, unstable: Array) -> float:
    """The frequency at which a loop begins to ring [rad/s] where stability ends on the way from
    the nominal values to unstable ones, by bisection; 0 where it drifts away."""
    limit = loop.reach(unstable)
    low = 0.0
    high = 1.0
    while high - low > 1e-9:
        middle = (low + high) / 2.0
        reach = loop.reach(middle * unstable)
        if reach.stable:
            low = middle
        else:
            high = middle
            limit = reach
    return float(limit.omega[0])
