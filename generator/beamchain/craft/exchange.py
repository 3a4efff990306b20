"""One appendage of a craft exchanged for another: the craft's response by a solve of six equations.

With `Z` the craft's dynamic mass, `R` the motion of its base body and `J` that of the appendage's
root, `W = R Z^-1 R^T`, `P = J Z^-1 R^T`, `S = R Z^-1 J^T` and `Q = J Z^-1 J^T`. `D + X` in place of
the appendage's dynamic mass `D` gives

    W - S X (1 + Q X)^-1 P

Theory: docs/theory.md, section 6.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from beamchain.engine.linear import Linear
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array


class Exchange:
    """The accelerance of a craft's base body while one of its appendages is exchanged.

    Args:
        craft: the bare craft; its outputs are the accelerations of its base body.
        models: appendages in six motions, damped.
        roots: motion `(6, nv)` of each root in its axes.
        omega: `(k,)` where the response is taken [rad/s].
    """

    def __init__(
        self, craft: Linear, models: Sequence[PortModel], roots: Sequence[Array], omega: Array
    ) -> None:
        self.omega: Array = omega
        motion = np.vstack([craft.outputs.acceleration, *roots])
        whole = np.moveaxis(craft.on_body(motion).response(omega, models, roots), -1, 0)
        self._base: NDArray[np.complex128] = whole[:, :6, :6]
        self._parts: list[tuple[NDArray[np.complex128], ...]] = []
        for i, model in enumerate(models):
            own = slice(6 * i + 6, 6 * i + 12)
            parts = whole[:, :6, own], whole[:, own, own], whole[:, own, :6]
            self._parts.append((np.moveaxis(model.D(omega), -1, 0), *parts))

    def response(self, number: int, model: PortModel) -> NDArray[np.complex128]:
        """`(k, 6, 6)` with `model` for appendage `number`."""
        known, seen, between, felt = self._parts[number]
        change = np.moveaxis(model.D(self.omega), -1, 0) - known
        return self._base - seen @ change @ np.linalg.solve(np.eye(6) + between @ change, felt)
