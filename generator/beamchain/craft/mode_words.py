"""What moves in a coupled mode of the spacecraft, in words: which appendages, in which port, and how the bus answers."""

from collections.abc import Sequence

import numpy as np

from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, PORTS, Array

SHARE = 0.1  # of the strain energy, above which an appendage is named
STILL = 1e-4  # of the kinetic energy, below which the bus is called still
ALONG = 0.5  # cosine between the momenta of two appendages, above which they move in phase
WORDS = {"xy": "bending xy", "xz": "bending xz", "torsion": "torsion", "axial": "axial"}
AXIS = ("along x", "along y", "along z", "about x", "about y", "about z")


def mode_words(
    names: Sequence[str],
    models: Sequence[PortModel],
    axes: Sequence[Array],
    coordinates: Sequence[Array],
    own_energy: float,
    bus: Array,
) -> str:
    """One coupled mode in words, such as "left and right opposed, bending xz; bus about y".

    Per appendage: name of its place, model in space, axes `(3, 3)` of its root in the world (columns), and modal
    `coordinates` `(n,)` in the mass-normalised mode. `own_energy`: twice the strain energy in the spacecraft's own
    springs; `bus` `(6,)`: motion of the base body times the square root of the inertia that it feels.
    """
    energies = [float(np.sum((m.frequencies * q) ** 2)) for m, q in zip(models, coordinates, strict=True)]
    total = max(sum(energies) + own_energy, 1e-300)
    moving = [i for i, energy in enumerate(energies) if energy > SHARE * total]
    parts: list[str] = []
    if moving:
        phase = _phase([axes[i] @ models[i].participation[:, :3].T @ coordinates[i] for i in moving])
        first = max(moving, key=lambda i: energies[i])
        port = WORDS[_port(models[first], coordinates[first])]
        parts.append(f"{' and '.join(names[i] for i in moving)}{phase}, {port}")
    if own_energy > SHARE * total:
        parts.append("springs of the spacecraft")
    k = int(np.argmax(np.abs(bus)))
    parts.append(f"bus {AXIS[k]}" if float(np.sum(bus**2)) > STILL else "bus still")
    return "; ".join(parts)


def _phase(momenta: Sequence[Array]) -> str:
    """Whether two appendages move the same way."""
    if len(momenta) != 2:
        return ""
    a, b = momenta
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    cosine = float(a @ b) / size if size > 0.0 else 0.0
    return " in phase" if cosine > ALONG else " opposed" if cosine < -ALONG else ""


def _port(model: PortModel, coordinates: Array) -> str:
    """The port in which the cantilever mode with the most strain energy participates most."""
    k = int(np.argmax((model.frequencies * coordinates) ** 2))
    scale = np.sqrt(np.where(np.diag(model.rigid_mass) > 0.0, np.diag(model.rigid_mass), np.inf))
    row = model.participation[k] / scale
    return max(PORTS, key=lambda port: float(np.sum((np.abs(PORT_MOTION[port]).T @ np.abs(row)) ** 2)))
