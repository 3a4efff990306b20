"""Motion rows: what every maker of modes writes down first, and the modes that follow.

Theory: docs/theory.md, section 1.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from beamchain.ports.motions import Array

SINGULAR = 1e-14  # of the largest singular value: below, a coordinate moves no mass


class NormalModes(NamedTuple):
    """Mass-normalised modes of a structure whose root is held.

    `frequencies` `(n,)` [rad/s]; `participation` `(n, m)`; `momenta` `(r, n)` weighted motion;
    `coordinates` `(f, n)`.
    """

    frequencies: Array
    participation: Array
    momenta: Array
    coordinates: Array


@dataclass(frozen=True, eq=False)
class Rows:
    """Motion of a structure in rows that are weighted by the roots of its masses and springs.

    With the root's motion `x` and elastic coordinates `y` the kinetic energy is
    `|rigid x' + elastic y'|^2 / 2` and the strain energy `|springs y|^2 / 2`. No mass and no
    stiffness matrix is formed, so that every frequency keeps its digits.

    Args:
        rigid: `(r, m)`.
        elastic: `(r, f)`.
        springs: `(s, f)` of full column rank; None: the unit matrix.
        damping: `(f, f)` damping matrix; None: none.
        points: `(p, f)` further motions, unweighted; None: none.
    """

    rigid: Array
    elastic: Array
    springs: Array | None = None
    damping: Array | None = None
    points: Array | None = None

    def normal_modes(self) -> NormalModes:
        """The modes with the root held, ascending.

        With `springs = Q T` and `elastic T^-1 = U diag(s) V^T`: frequencies `1 / s`,
        participation `U^T rigid`, coordinates `T^-1 V / s`.
        """
        inverse = self._inverse_springs()
        weighted = self.elastic if inverse is None else self.elastic @ inverse
        u, s, vt = np.linalg.svd(weighted, full_matrices=False)
        keep = s > SINGULAR * s.max(initial=0.0)
        u, s, vt = u[:, keep], s[keep], vt[keep]
        coordinates = vt.T / s
        return NormalModes(
            frequencies=1.0 / s,
            participation=u.T @ self.rigid,
            momenta=u,
            coordinates=coordinates if inverse is None else inverse @ coordinates,
        )

    def _inverse_springs(self) -> Array | None:
        if self.springs is None or self.springs.size == 0:
            return None
        stretched = self.springs[np.any(self.springs != 0.0, axis=1)]
        return np.linalg.inv(np.linalg.qr(stretched, mode="r"))
