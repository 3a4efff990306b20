"""An unknown lag of the sensors behind the torques, from which the log fits best."""

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from beamchain.identification.channels import Channels
from beamchain.identification.response import Piece, Raw
from beamchain.identification.start import fewer, refined
from beamchain.ports.motions import Array

MOST = 20  # steps of lag that are tried
TOLERANCE = 1e-3  # of a step
ITERATIONS = 8


def aligned(data: Channels, raw: Raw) -> tuple[float, Channels]:
    """The lag [s], and the channels with their torques delayed by it.

    A torque that changes within a step acts with its mean over the step, which is exact for the rigid motion.

    Args:
        data: of time logs.
        raw: a model of them without the lag.
    """
    part = fewer([piece for piece in data.pieces if isinstance(piece, Piece)])
    step = float(np.median(np.concatenate([piece.steps for piece in part if isinstance(piece, Piece)])))
    size = float(np.max(np.abs(raw.rigid)))

    def cost(lag: float) -> float:
        moved = [delayed(piece, lag * step) for piece in part if isinstance(piece, Piece)]
        return refined(moved, raw, data.scale, size, ITERATIONS)[1]

    coarse = np.arange(-1.0, MOST + 1.0)
    best = float(coarse[int(np.argmin([cost(float(one)) for one in coarse]))])
    found = minimize_scalar(cost, bounds=(best - 1.0, best + 1.0), method="bounded", options={"xatol": TOLERANCE})
    lag = float(found.x) * step
    return lag, data._replace(pieces=[delayed(p, lag) if isinstance(p, Piece) else p for p in data.pieces])


def delayed(piece: Piece, lag: float) -> Piece:
    """A piece whose torques act later [s]; what acted before it began is taken as its first torque."""
    t = piece.time
    once = np.vstack([np.zeros((1, piece.inputs.shape[1])), np.cumsum(np.diff(t)[:, None] * piece.inputs[:-1], axis=0)])
    at = t - lag

    def impulse(column: int) -> Array:
        """Of the torque, from the start of the piece until each time less the lag."""
        before = np.minimum(at - t[0], 0.0) * piece.inputs[0, column]
        after = np.maximum(at - t[-1], 0.0) * piece.inputs[-1, column]
        return np.interp(at, t, once[:, column]) + before + after

    total = np.column_stack([impulse(m) for m in range(piece.inputs.shape[1])])
    held = np.diff(total, axis=0) / np.diff(t)[:, None]
    return replace(piece, inputs=np.vstack([held, held[-1:]]))
