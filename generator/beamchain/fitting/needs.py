"""What a scene is promised of an appendage: the in-band error of the hub's motion
(`ports.compare.Reference`), on the hub in space, in the motions that matter.

Theory: docs/theory.md, section 6.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from beamchain.ports.compare import STANDARD_HUBS, Block, Reference
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, Array

TOPS = 8  # frequencies at which a mode has to lower the error, to be worth a trial
FAR = 25.0  # times the bandwidth: modes above act through their static flexibility only
COUPLED = 1e-12  # relative, below which nothing couples two motions
MOST = 8  # modes tried per port: beyond, the exact chain is rarely physical

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
        self._blocks = [self._coupled_motions(hub) for hub in self.hubs]
        self._references = [
            Reference([self._block(hub, motions) for motions in blocks], bandwidth, undamped)
            for hub, blocks in zip(self.hubs, self._blocks, strict=True)
        ]
        self._known: dict[tuple[object, ...], float] = {}

    def reaches(self, port: str) -> bool:
        """Whether a port can move any hub motion that matters."""
        moved = np.any(PORT_MOTION[port] != 0.0, axis=1)[list(self.motions)]
        return any(np.any(moved[block]) for blocks in self._blocks for block in blocks)

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
            (reference, i, motions, reference.highest(i, self._seen(model, motions), TOPS))
            for reference, blocks in zip(self._references, self._blocks, strict=True)
            for i, motions in enumerate(blocks)
        ]

        known: dict[tuple[object, ...], float] = {}

        def of_block(top: int, other: PortModel) -> float:
            reference, i, motions, points = tops[top]
            key = (top, *(array.tobytes() for array in self._modes_seen(other, motions)))
            if key not in known:
                known[key] = reference.error_at(i, self._seen(other, motions), points)
            return known[key]

        def error(others: Sequence[PortModel]) -> float:
            other = self._only(others)
            return max(of_block(top, other) for top in range(len(tops)))

        return error

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


def with_polar_inertia(rigid_mass: Array) -> Array:
    """`(6, 6)` with a trace of polar inertia where an appendage states none."""
    mass = np.array(rigid_mass)
    rotary = np.diag(mass)[3:]
    return mass + np.diag([0.0] * 3 + list(np.maximum(1e-9 * rotary.max() - rotary, 0.0)))
