"""Where a log without a prior leaves force and mass open: a slender, nearly massless cantilever with the moments found.

A chain needs mass along its length, and modes that push where they turn. What is stated has a billionth of the hub's mass, so
that on the same craft nothing changes that the log has shown, and the lever arms of a uniform cantilever's modes.
"""

import numpy as np

from beamchain.craft.identification.structure import Parts, frozen_inertia, turning
from beamchain.ports.motions import Array, body_mass_matrix

SLIGHT = 1e-9  # of the hub's mass
POLAR = 1e-6  # of the inertia across, where nothing turns about the length
SAFE = 0.9  # factor on force and mass centre, until the residual mass is positive
#: force over moment of a uniform cantilever's modes, times its length
LEVERS = np.array([1.37650, 4.78081, 7.84867, 10.99591, 14.13715, 17.27876])


def stated(parts: Parts, axes: Array) -> tuple[Array, Array, float]:
    """Rigid mass `(6, 6)`, participation `(n, 6)` and length [m].

    Args:
        parts: as identified, without force.
        axes: `(3, a)` that were driven.
    """
    gained = axes.T @ (turning(parts).inertia - frozen_inertia(parts.hub)) @ axes
    inertia = axes @ gained @ axes.T
    across = [i for i in (1, 2) if inertia[i, i] > 0.0]
    size = min((float(inertia[i, i]) for i in across), default=float(inertia[0, 0]))
    for i in range(3):
        if inertia[i, i] <= 0.0:
            inertia[i, i] = size if i else POLAR * size
    mass = SLIGHT * float(parts.hub[0, 0])
    length = float(np.sqrt(3.0 * size / mass))
    centre = np.array([length / 2.0, 0.0, 0.0])
    rigid = body_mass_matrix(mass, centre, np.zeros((3, 3)))
    rigid[3:, 3:] = inertia
    rows = parts.participation.copy()
    for i, force, sign in ((2, 1, 1.0), (1, 2, -1.0)):  # a turn about z goes with a push along y, about y along -z
        strong = np.argmax(np.abs(rows[:, 3:]), axis=1) == i
        for rank, k in enumerate(np.flatnonzero(strong)[np.argsort(parts.frequencies[strong])]):
            lever = LEVERS[rank] if rank < LEVERS.size else np.pi * (rank + 0.5)
            rows[k, force] = sign * lever * rows[k, 3 + i] / length
    scale = np.sqrt(np.diag(rigid))
    while np.linalg.eigvalsh((rigid - rows.T @ rows) / np.outer(scale, scale))[0] <= 0.0 and np.any(
        np.abs(rows[:, :3]) > 1e-9
    ):
        rows[:, :3] *= SAFE
        rigid[3:, :3] *= SAFE
        rigid[:3, 3:] = rigid[3:, :3].T
    return rigid, rows, length
