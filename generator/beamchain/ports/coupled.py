"""A port whose dampers couple its modes, as plain joint damping does."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from beamchain.ports.motions import Array


@dataclass(frozen=True, eq=False)
class CoupledPort:
    """An elastic structure seen from its root, with its whole damping matrix.

    `D(s) = M - s^2 L^T (s^2 I + s C + W^2)^-1 L`. With a diagonal `C` it is a `PortModel`.

    Args:
        rigid_mass: `(m, m)` `M`.
        frequencies: `(n,)` `W` of the undamped cantilever modes [rad/s].
        participation: `(n, m)` rows `L` of the mass-normalised modes.
        rates: `(n, n)` `C` in these modes [1/s].
    """

    rigid_mass: Array
    frequencies: Array
    participation: Array
    rates: Array

    @property
    def modes(self) -> int:
        """Number of flexible modes."""
        return self.frequencies.size

    def D(self, omega: Array) -> NDArray[np.complex128]:  # noqa: N802 (the field's letter)
        """Dynamic mass `(m, m, k)`: wrench per unit acceleration at `omega` `(k,)` [rad/s]."""
        s = 1j * omega[:, None, None]
        inner = s**2 * np.eye(self.modes) + s * self.rates + np.diag(self.frequencies**2)
        flexible = self.participation.T @ np.linalg.solve(inner, s**2 * self.participation)
        return np.moveaxis(self.rigid_mass - flexible, 0, -1)

    def with_hub(self, hub: Array) -> "CoupledPort":
        """The same with a rigid hub `(m, m)` on its port."""
        return replace(self, rigid_mass=self.rigid_mass + hub)

    def seen(self, motions: Array) -> "CoupledPort":
        """The same in some motions of the root, columns of `motions` `(m, k)`,
        the others held."""
        return replace(
            self,
            rigid_mass=motions.T @ self.rigid_mass @ motions,
            participation=self.participation @ motions,
        )
