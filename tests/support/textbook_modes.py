"""What a file of modes or matrices would state, from the definitions: point masses, a straight
frame, a uniform rod."""

import numpy as np

from beamchain import ModalData
from solver import Section, mesh


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
    """Mass and stiffness `(6 n + 6)` of a straight frame along x."""
    return mesh(length, elements, Section(5e5, 40.0, 60.0, 90.0, 1.5, 0.01))


def uniform_rod(**more) -> dict:
    """The table of a uniform rod of 30 kg and 8 m: 30 4 = 120 kg m, 30 8^2 / 3 = 640 kg m^2."""
    mass = np.diag([30.0, 30.0, 30.0, 0.5, 640.0, 640.0])
    mass[1, 5] = mass[5, 1] = 120.0
    mass[2, 4] = mass[4, 2] = -120.0
    rows = [[0.0], [4.2], [0.0], [0.0], [0.0], [24.9]]
    return {"mass": mass.tolist(), "frequencies": [1.3], "participation": rows, **more}
