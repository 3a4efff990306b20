"""The independent check: exact dynamic stiffness of a tapered beam, marched from the tip inwards.

Nothing here is shared with `beamchain.structure`: no elements, no strain functions, no eigenvalue
solver. Each short piece has the transfer matrix `exp(Omega)` (Magnus' expansion of sixth order,
three Gauss points) of

    w' = theta,  theta' = M / EI,  M' = -V,  V' = -omega^2 m w,

and the dynamic stiffness S of everything outside it is carried inwards, which neither overflows nor
cancels however long the beam is in waves. Modes are counted, not searched for: the number of
natural frequencies below omega is the number of negative eigenvalues met on the way (W. H.
Wittrick, F. W. Williams, Q. J. Mech. Appl. Math. 24 (1971) 263).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RATIO = 1.03  # of the diameters at the two ends of a piece, at most
WAVE = 0.5  # length of a piece over that of a wave (divided by 2 pi), at most
TERMS = 18  # of the exponential's series
# relative offset in omega^2 at which participation is read;
# an error of 1e-6 in omega spoils 5e-5 of it
FAR = 3e-4


@dataclass(frozen=True)
class Rod:
    """A solid round rod whose diameter falls or grows linearly, on a free tip.

    Args:
        length: [m].
        inner, outer: diameters at the root and at the tip [m].
        modulus: [N/m^2].
        density: [kg/m^3].
        tip_mass: carried at the tip [kg].
        joint: `(x, stiffness)` of a compliant joint [m, N m/rad], or None.
    """

    length: float
    inner: float
    outer: float
    modulus: float
    density: float
    tip_mass: float = 0.0
    joint: tuple[float, float] | None = None

    def rigid(self) -> Array:
        """`(2, 2)` mass matrix about the root, in closed form [kg, kg m, kg m^2]."""
        a = self.inner
        b = self.outer - self.inner
        length = self.length
        c = self.density * np.pi / 4.0

        def moment(p: int) -> float:
            """Integral of c (a + b x / L)^2 x^p."""
            return (
                c * length ** (p + 1) * (a * a / (p + 1) + 2.0 * a * b / (p + 2) + b * b / (p + 3))
            )

        m = moment(0) + self.tip_mass
        s = moment(1) + self.tip_mass * length
        j = moment(2) + self.tip_mass * length**2
        return np.array([[m, s], [s, j]])

    def _edges(self, wave: float) -> Array:
        """Ends of the pieces over the length, fine enough for a wave number `wave` per length
        at the thinner end."""
        d = self.inner, self.outer
        steps = max(int(np.ceil(abs(np.log(d[1] / d[0])) / np.log(RATIO))), 1)
        if d[0] == d[1]:
            graded = np.array([0.0, 1.0])
        else:
            graded = (np.geomspace(d[0], d[1], steps + 1) - d[0]) / (d[1] - d[0])
            graded[0], graded[-1] = 0.0, 1.0
        cuts = [] if self.joint is None else [self.joint[0] / self.length]
        points = np.unique(np.concatenate([graded, cuts]))
        out = [0.0]
        for a, b in zip(points[:-1], points[1:], strict=True):
            local = wave / np.sqrt(float(np.min(self._diameter(np.array([a, b])))) / max(d))
            count = max(int(np.ceil((b - a) * local / WAVE)), 1)
            out += [float(a + (b - a) * (i + 1) / count) for i in range(count)]
        return np.array(out)

    def _diameter(self, x: Array) -> Array:
        return self.inner + (self.outer - self.inner) * x

    def dynamics(self, squares: Array) -> tuple[Array, Array]:
        """Dynamic stiffness over -omega^2, that is the dynamic mass D,
        and the number of held modes below.

        Args:
            squares: `(f,)` omega^2 [rad^2/s^2], positive.

        Returns:
            D `(f, 2, 2)` and counts `(f,)`.
        """
        largest = max(self.inner, self.outer)
        ei0 = self.modulus * np.pi / 64.0 * largest**4
        m0 = self.density * np.pi / 4.0 * largest**2
        unit = ei0 / (m0 * self.length**4)
        lam = np.asarray(squares, dtype=np.float64) / unit
        edges = self._edges(float(np.max(lam)) ** 0.25)
        h = np.diff(edges)
        middle = (edges[:-1] + edges[1:]) / 2.0
        gauss = h / 2.0 * np.sqrt(0.6)
        first, second, third = (
            self._system(middle + side * gauss, lam) for side in (-1.0, 0.0, 1.0)
        )
        pieces = _exponential(first, second, third, h)
        tip = self.tip_mass / (m0 * self.length)
        s = np.zeros((lam.size, 2, 2))
        s[:, 0, 0] = -lam * tip
        count = np.zeros(lam.size)
        joint = None if self.joint is None else self.joint[0] / self.length
        spring = 0.0 if self.joint is None else self.joint[1] * self.length / ei0
        for k in range(h.size - 1, -1, -1):
            t = pieces[k]
            t11 = t[:, :2, :2]
            t12 = t[:, :2, 2:]
            t21 = t[:, 2:, :2]
            t22 = t[:, 2:, 2:]
            loose = t22 + s @ t12
            count += _negative(loose @ np.linalg.inv(t12))
            s = np.linalg.solve(loose, t21 + s @ t11)
            s = (s + np.swapaxes(s, 1, 2)) / 2.0
            if joint is not None and abs(float(edges[k]) - joint) < 1e-12:
                turn = spring + s[:, 1, 1]
                count += turn < 0.0
                s = s - s[:, :, 1:] * s[:, 1:, :] / turn[:, None, None]
        mass = m0 * self.length
        size = np.array([[mass, mass * self.length], [mass * self.length, mass * self.length**2]])
        return -s / lam[:, None, None] * size, count

    def _system(self, x: Array, lam: Array) -> Array:
        """`(k, f, 4, 4)` of the first-order system at `x`; displacement, rotation, shear, moment;
        unit length."""
        d = self._diameter(x) / max(self.inner, self.outer)
        a = np.zeros((x.size, lam.size, 4, 4))
        a[:, :, 0, 1] = 1.0
        a[:, :, 1, 3] = (1.0 / d**4)[:, None]
        a[:, :, 3, 2] = -1.0
        a[:, :, 2, 0] = -(d**2)[:, None] * lam
        return a

    def check_poles(
        self, squares: Array, tolerance: float, hub: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """Whether each given omega^2 is a natural frequency,
        and its participation (port values with a hub).

        Args:
            squares: `(n,)` omega^2 that are claimed, ascending.
            tolerance: relative, in omega.
            hub: `(2, 2)` mass matrix about the root of a hub the root is fixed to; None: held root.

        Returns:
            `(n,)` whether exactly one natural frequency lies within the tolerance, `(n, 2, 2)`
            outer products of participation (of port values with a hub), and `(n,)` number of modes
            below the tolerance's upper end: 1, 2, 3 .. where none is missing.
        """
        near = 2.0 * tolerance
        factors = np.array([1.0 - near, 1.0 + near, 1.0 - FAR, 1.0 + FAR])
        at = (squares[:, None] * factors).ravel()
        mass, held = self.dynamics(at)
        below = held
        if hub is None:
            response = mass
        else:
            total = hub + mass
            response = -np.linalg.inv(total)
            below = held + _negative(-at[:, None, None] * total) - 2
        response = response.reshape(squares.size, 4, 2, 2)
        outer = FAR / 2.0 * (response[:, 2] - response[:, 3])
        below = below.reshape(squares.size, 4)
        inside = below[:, 1] - below[:, 0] == 1
        return inside, outer, below[:, 1]


def _exponential(first: Array, second: Array, third: Array, h: Array) -> Array:
    """`exp(Omega)` of every piece from its system at three Gauss points.

    Source: S. Blanes, F. Casas, J. A. Oteo, J. Ros, Physics Reports 470 (2009) 151, equation (257).
    """
    step = h[:, None, None, None]
    a1 = step * second
    omega = a1
    if np.any(first != third):
        a2 = np.sqrt(15.0) / 3.0 * step * (third - first)
        a3 = 10.0 / 3.0 * step * (third - 2.0 * second + first)
        c1 = _commutator(a1, a2)
        c2 = -_commutator(a1, 2.0 * a3 + c1) / 60.0
        omega = a1 + a3 / 12.0 + _commutator(-20.0 * a1 - a3 + c1, a2 + c2) / 240.0
    out = np.broadcast_to(np.eye(4), omega.shape).copy()
    term = out.copy()
    for k in range(1, TERMS):
        term = term @ omega / k
        out = out + term
    return out


def _commutator(a: Array, b: Array) -> Array:
    return a @ b - b @ a


def _negative(matrices: Array) -> Array:
    """Number of negative eigenvalues of symmetric `(f, 2, 2)`, scaled so that small ones count."""
    a, d = matrices[:, 0, 0], matrices[:, 1, 1]
    b = (matrices[:, 0, 1] + matrices[:, 1, 0]) / 2.0
    determinant = a * d - b * b
    return np.where(determinant < 0.0, 1, np.where(a < 0.0, 2, 0))
