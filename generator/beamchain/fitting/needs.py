"""What a scene is promised of an appendage: the in-band error of the hub's motion
(`ports.compare.Reference`), on the hub in space, in the motions that matter.

Theory: docs/theory.md, section 6.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from beamchain.ports.compare import STANDARD_HUBS, Block, Reference, with_damping
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, Array

TOPS = 8  # frequencies at which a mode has to lower the error, to be worth a trial
FAR = 25.0  # times the bandwidth: modes above act through their static flexibility only
COUPLED = 1e-12  # relative, below which nothing couples two motions
MOST = 8  # modes tried per port: beyond, the exact chain is rarely physical

#: Errors by the number of a block and the model in its motions.
Known = dict[tuple[int, PortModel], float]

#: Motions of the hub by the names of SPEC's `scene.axes`.
AXES = {"tx": 0, "ty": 1, "tz": 2, "x": 3, "y": 4, "z": 5}


class Promise:
    """The in-band error of candidate models of an appendage on the hub, in the motions that matter.

    Motions that neither the hub nor the appendage couples make independent blocks: the norm of the
    whole is the largest of theirs.

    Args:
        exact: the appendage with every mode, in m motions of its root.
        hub_mass: `(m, m)` about the root; without one the worst of three.
        motions: which of the six those are.
        wanted: those of the six that matter.
        bandwidth: upper end of the band [rad/s].
        undamped: as of `ports.compare.compared_ratios`.
    """

    def __init__(
        self,
        exact: PortModel,
        hub_mass: Array | None,
        motions: Sequence[int],
        wanted: Sequence[int],
        bandwidth: float,
        undamped: float,
    ) -> None:
        self.exact: PortModel = exact
        self.motions: tuple[int, ...] = tuple(motions)
        self.asked: frozenset[int] = frozenset(wanted)
        self.wanted: list[int] = [i for i, motion in enumerate(motions) if motion in wanted]
        self.band: float = bandwidth
        self.hubs: list[Array] = (
            [factor * exact.rigid_mass for factor in STANDARD_HUBS]
            if hub_mass is None
            else [hub_mass]
        )
        self._undamped: float = undamped
        self._models: dict[tuple[object, ...], PortModel] = {}
        # the blocks of every hub: its reference, their number there, their motions
        self._blocks: list[tuple[Reference, int, list[int]]] = []
        for hub in self.hubs:
            blocks = self._coupled_motions(hub)
            of_hub = [self._block(hub, motions) for motions in blocks]
            reference = Reference(of_hub, bandwidth, undamped)
            self._blocks += [(reference, i, motions) for i, motions in enumerate(blocks)]
        self._known: dict[float | None, Known] = {}

    def reaches(self, port: str) -> bool:
        """Whether a port can move any hub motion that matters."""
        moved = np.any(PORT_MOTION[port] != 0.0, axis=1)[list(self.motions)]
        return any(np.any(moved[motions]) for _, _, motions in self._blocks)

    def of_models(self, models: Sequence[PortModel], tolerance: float | None = None) -> float:
        """In-band error of the one model, in six motions; see `error`."""
        return self.error(self._only(models), tolerance)

    def of_exchange(self, number: int, model: PortModel) -> float:
        """In-band error of the one model, of which what lies far above the band is gathered."""
        del number
        return self.of_models([model.condensed(FAR * self.band)])

    def floor(self, models: Sequence[PortModel]) -> Callable[[Sequence[PortModel]], float]:
        """The error of another model where that of this one is highest; its in-band error is no
        smaller."""
        model = self._only(models)
        tops = [
            reference.highest(i, self._seen(model, motions), TOPS)
            for reference, i, motions in self._blocks
        ]

        def at_tops(block: int, seen: PortModel) -> float:
            reference, i, _ = self._blocks[block]
            return reference.error_at(i, seen, tops[block])

        known: Known = {}
        return lambda others: self._largest(at_tops, self._only(others), known)

    def _only(self, models: Sequence[PortModel]) -> PortModel:
        """The one model in the motions of the promise."""
        (model,) = models
        if len(self.motions) == 6:
            return model
        return model.in_motions(np.eye(6)[:, list(self.motions)])

    def error(self, model: PortModel, tolerance: float | None = None) -> float:
        """In-band error of any model in the same motions.

        Its rigid mass does not count. `tolerance`: as of `ports.compare.maximum_of`, for a search.
        """

        def in_band(block: int, seen: PortModel) -> float:
            reference, i, _ = self._blocks[block]
            return reference.error(i, seen, tolerance)

        return self._largest(in_band, model, self._known.setdefault(tolerance, {}))

    def _largest(
        self, error: Callable[[int, PortModel], float], model: PortModel, known: Known
    ) -> float:
        """The largest error of a block, by its number and the model in its motions; `known` for
        modes that were asked for before."""
        worst = 0.0
        for block, (_, _, motions) in enumerate(self._blocks):
            seen = self._seen(model, motions)
            if (block, seen) not in known:
                known[block, seen] = error(block, seen)
            worst = max(worst, known[block, seen])
        return worst

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
        """A model in the motions of a block, with the modes that move there; the same one for the
        same modes."""
        modes = np.any(self._moved(model)[:, motions], axis=1)
        arrays = (
            model.frequencies[modes],
            model.participation[modes][:, motions],
            model.damping[np.ix_(*[modes] * model.damping.ndim)],
        )
        key = (*motions, *(array.tobytes() for array in arrays))
        if key not in self._models:
            rigid_mass = self.exact.rigid_mass[np.ix_(motions, motions)]
            self._models[key] = with_damping(PortModel(rigid_mass, *arrays), self._undamped)
        return self._models[key]
