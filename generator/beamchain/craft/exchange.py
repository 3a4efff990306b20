"""One appendage of a craft exchanged for another: the craft's response by a solve of six equations,
and six more for each port of the appendage that carries something.

With `Z` the craft's dynamic mass, `R` the motion of its base body and `B` that of the appendage's
root, with the wrenches on its ports below, `W = R Z^-1 R^T`, `P = B Z^-1 R^T`, `S = R Z^-1 B^T` and
`Q = B Z^-1 B^T`. The appendage's part of `Z` is `B^T Y B` (`Attachment`); `Y + X` in place of `Y`
gives

    W - S X (1 + Q X)^-1 P

Theory: docs/theory.md, section 6.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from beamchain.engine.linear import Attachment, Linear, PortLoads, attachments, dynamic_mass
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array


class Exchange:
    """The accelerance of a craft's base body while one of its appendages is exchanged.

    Args:
        craft: the bare craft; its outputs are the accelerations of its base body.
        models: appendages in six motions, damped.
        roots: motion `(6, nv)` of each root in its axes.
        omega: `(k,)` where the response is taken [rad/s].
        carrying: what the ports of the appendages carry.
    """

    def __init__(
        self,
        craft: Linear,
        models: Sequence[PortModel],
        roots: Sequence[Array],
        omega: Array,
        carrying: PortLoads | None = None,
    ) -> None:
        self.omega: Array = omega
        self._places: list[Attachment] = attachments(roots, carrying)
        dynamic = dynamic_mass(craft, omega, models, roots, carrying)
        base = np.zeros((6, dynamic.shape[1]))
        base[:, : len(craft.mass)] = craft.outputs.acceleration
        moved = np.linalg.solve(dynamic, np.vstack([base, *(at.rows for at in self._places)]).T)
        self._base: NDArray[np.complex128] = base @ moved[:, :, :6]
        self._parts: list[tuple[NDArray[np.complex128], ...]] = []
        end = 6
        for model, at in zip(models, self._places, strict=True):
            start, end = end, end + len(at.rows)
            by_own = moved[:, :, start:end]
            parts = base @ by_own, at.rows @ by_own, at.rows @ moved[:, :, :6]
            self._parts.append((at.block(model, omega), *parts))

    def response(self, number: int, model: PortModel) -> NDArray[np.complex128]:
        """`(k, 6, 6)` with `model` for appendage `number`."""
        known, seen, between, felt = self._parts[number]
        change = self._places[number].block(model, self.omega) - known
        unit = np.eye(change.shape[1])
        return self._base - seen @ change @ np.linalg.solve(unit + between @ change, felt)
