"""Port models composed of independent ports.

Theory: docs/theory.md, section 1.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORT_MOTION, Array


def model_in_space(ports: Mapping[str, PortModel], rigid_mass: ArrayLike) -> PortModel:
    """One model with six motions from independent ports and the rigid mass `(6, 6)`; each mode is
    labelled with its port."""
    parts = [model.replaced(labels=(port,) * model.modes) for port, model in ports.items()]
    return joined(parts, [PORT_MOTION[port] for port in ports], rigid_mass)


def joined(
    parts: Sequence[PortModel], motions: Sequence[Array], rigid_mass: ArrayLike
) -> PortModel:
    """One model with six motions from parts that do not couple, its modes ascending.

    Args:
        parts: each in its own motions.
        motions: `(6, m)` of each part: motion in space per unit of its own motions.
        rigid_mass: `(6, 6)` of the whole.
    """
    rows = [part.participation @ motion.T for part, motion in zip(parts, motions, strict=True)]
    points = [
        _points_in_space(part.tip, motion)
        for part, motion in zip(parts, motions, strict=True)
        if part.tip is not None
    ]
    participation = np.vstack([np.zeros((0, 6)), *rows])
    frequencies = np.concatenate([np.zeros(0), *(part.frequencies for part in parts)])
    damping = np.concatenate([np.zeros(0), *(part.damping for part in parts)])
    labels = [label for part in parts for label in part.labels or ("",) * part.modes]
    order = np.argsort(frequencies, kind="stable")
    known = points and len(points) == len(parts) and len({p.shape[1] for p in points}) == 1
    return PortModel(
        np.asarray(rigid_mass),
        frequencies=frequencies[order],
        participation=participation[order],
        damping=damping[order],
        tip=np.vstack(points)[order] if known else None,
        labels=tuple(labels[k] for k in order),
        points=parts[0].points if known else (),
    )


def _points_in_space(tip: Array, motion: Array) -> Array:
    """`(n, 6 k)` motion in space of the tip and of further points, of `tip` `(n, m k)`."""
    points = tip.reshape(len(tip), tip.shape[1] // motion.shape[1], motion.shape[1])
    in_space = points @ motion.T
    return np.asarray(in_space.reshape(len(tip), 6 * points.shape[1]), dtype=np.float64)
