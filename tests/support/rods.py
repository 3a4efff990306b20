"""Point masses on massless rods with springs between them,
as the modes of an appendage in plane xy."""

import numpy as np

import beamchain as bc
from appendages import dense_port


def modes_of_rods(masses: np.ndarray, lengths: np.ndarray, stiffness: np.ndarray) -> "bc.ModalData":
    """Masses `(N + 1,)` from the root, rods `(N,)` between them and springs `(N - 1,)`
    at the inner masses."""
    positions = np.concatenate([[0.0], np.cumsum(lengths)])
    # every node's mass to the rod inside it, the root's to the first
    rods = [(m, float(x), 0.0) for m, x in zip(masses[1:], positions[1:], strict=True)]
    first = rods[0][1]
    total = masses[0] + masses[1]
    rods[0] = (total, masses[1] * first / total, masses[0] * masses[1] / total * first**2)
    rigid, frequencies, rows = dense_port(
        rods, list(zip(positions[1:-1].tolist(), stiffness.tolist(), strict=True))
    )
    mass, turning = rigid[0, 0], rigid[1, 1]
    whole = np.diag([mass, mass, mass, 1e-4 * turning, turning, turning])
    whole[1, 5] = whole[5, 1] = rigid[0, 1]
    whole[2, 4] = whole[4, 2] = -rigid[0, 1]
    participation = np.zeros((frequencies.size, 6))
    participation[:, [1, 5]] = rows
    return bc.ModalData(whole, frequencies, participation, length=float(positions[-1]))


def drawn(
    seed: int, modes: int, low: float = 0.3, high: float = 3.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Masses, lengths and springs of rods with so many modes."""
    rng = np.random.default_rng(seed)
    return tuple(rng.uniform(low, high, size) for size in (modes + 2, modes + 1, modes))
