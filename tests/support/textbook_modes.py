"""What a file of modes or matrices would state, from the definitions: point masses, a straight
frame, a uniform rod."""

import numpy as np

from beamchain import ModalData


class Cloud:
    """Point masses with orthonormal modes, written down about any point in any axes and units,
    from the definition.

    Nothing is transformed: `L = sum m (u, x cross u)` is evaluated anew each time.
    """

    def __init__(self, seed: int, points: int = 9, modes: int = 4) -> None:
        rng = np.random.default_rng(seed)
        self.at = rng.normal(size=(points, 3)) * [3.0, 1.0, 0.5] + [2.0, 0.1, 0.0]
        self.mass = rng.uniform(0.5, 3.0, points)
        # orthonormal once weighted by sqrt(m)
        shapes = np.linalg.qr(rng.normal(size=(3 * points, modes)))[0]
        self.shapes = shapes.T.reshape(modes, points, 3) / np.sqrt(self.mass)[:, None]
        self.frequencies = np.sort(rng.uniform(1.0, 50.0, modes))

    def data(self, point=(0.0, 0.0, 0.0), axes=None, length=1.0, mass=1.0, **more) -> ModalData:
        """About `point`, in `axes` (rows), in units of `length` m and `mass` kg."""
        turn = np.eye(3) if axes is None else axes
        x = (self.at - point) @ turn.T / length
        m = self.mass / mass
        u = self.shapes @ turn.T * np.sqrt(mass)
        rows = np.concatenate(
            [np.einsum("p,kpi->ki", m, u), np.einsum("p,kpi->ki", m, np.cross(x, u))], axis=1
        )
        rigid = np.zeros((6, 6))
        for xi, mi in zip(x, m, strict=True):
            for motion_i in np.eye(6):
                moved = motion_i[:3] + np.cross(motion_i[3:], xi)
                rigid[int(np.argmax(motion_i))] += mi * np.concatenate([moved, np.cross(xi, moved)])
        return ModalData(rigid, self.frequencies, rows, **more)


def frame(elements: int = 6, length: float = 2.0) -> tuple[np.ndarray, np.ndarray]:
    """Mass and stiffness `(6 n + 6)` of a straight frame along x, textbook cubic elements,
    consistent mass."""
    le, n = length / elements, 6 * elements + 6
    k = np.zeros((n, n))
    m = np.zeros((n, n))
    ea = 5e5
    gj = 40.0
    ei = (90.0, 60.0)
    rho = 1.5
    j = 0.01

    def bending(dofs, stiff, sign):
        s = np.diag([1.0, sign, 1.0, sign])
        kb = (
            np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]])
            * stiff
            / le**3
        )
        mb = (
            np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]])
            * rho
            * le
            / 420
        )
        by_length = np.outer([1, le, 1, le], [1, le, 1, le])
        kb, mb = kb * by_length, mb * by_length
        k[np.ix_(dofs, dofs)] += s @ kb @ s
        m[np.ix_(dofs, dofs)] += s @ mb @ s

    for e in range(elements):
        a, b = 6 * e, 6 * e + 6
        bending([a + 1, a + 5, b + 1, b + 5], ei[0], 1.0)
        bending([a + 2, a + 4, b + 2, b + 4], ei[1], -1.0)
        for d, stiff, inertia in ((0, ea, rho), (3, gj, j)):
            dofs = [a + d, b + d]
            k[np.ix_(dofs, dofs)] += stiff / le * np.array([[1, -1], [-1, 1]])
            m[np.ix_(dofs, dofs)] += inertia * le / 6 * np.array([[2, 1], [1, 2]])
    return m, k


def uniform_rod(**more) -> dict:
    """The table of a uniform rod of 30 kg and 8 m: 30 4 = 120 kg m, 30 8^2 / 3 = 640 kg m^2."""
    mass = np.diag([30.0, 30.0, 30.0, 0.5, 640.0, 640.0])
    mass[1, 5] = mass[5, 1] = 120.0
    mass[2, 4] = mass[4, 2] = -120.0
    rows = [[0.0], [4.2], [0.0], [0.0], [0.0], [24.9]]
    return {"mass": mass.tolist(), "frequencies": [1.3], "participation": rows, **more}
