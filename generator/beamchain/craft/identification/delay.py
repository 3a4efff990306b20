"""An unknown lag of the sensors behind the torques, from which the log fits best."""

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from beamchain.craft.identification.channels import Channels
from beamchain.craft.identification.response import Piece
from beamchain.craft.identification.start import fewer, refined, searched
from beamchain.ports.motions import Array

MOST = 15  # steps of lag that are tried
FEW = 2500  # samples, with which whole steps are tried
TOLERANCE = 1e-3  # of a step
WHOLE = 2e-3  # of a step, by which a lag may differ from a whole number that is taken instead
ITERATIONS = 10
MODES = (2, 8)  # with which whole steps are tried, and with which the lag is refined


def aligned(data: Channels, guess: Array) -> tuple[float, Channels]:
    """The lag [s], and the channels with their torques delayed by it.

    A torque that changes within a step acts with its mean over the step, which is exact for the rigid motion. `guess` `(p, m)`
    is the accelerations of the frozen craft per torque.
    """
    part = [piece for piece in fewer(data.pieces) if isinstance(piece, Piece)]
    first = [piece.part(0, min(piece.time.size, FEW)) for piece in part[:1]]
    step = float(np.median(np.concatenate([piece.steps for piece in part])))
    size = float(np.max(np.abs(guess)))

    def moved(pieces: list[Piece], lag: float) -> list[Piece]:
        return [delayed(piece, lag * step) for piece in pieces]

    tried = {lag: searched(moved(first, lag), guess, data.scale, MODES[0])[0] for lag in range(-1, MOST + 1)}
    best = float(min(tried, key=lambda lag: tried[lag]))
    raw = searched(moved(part, best), guess, data.scale, MODES[1])[1]

    def cost(lag: float) -> float:
        return refined(moved(part, lag), raw, data.scale, size, ITERATIONS)[1]

    found = minimize_scalar(cost, bounds=(best - 1.0, best + 1.0), method="bounded", options={"xatol": TOLERANCE})
    steps = float(found.x)
    lag = (round(steps) if abs(steps - round(steps)) < WHOLE else steps) * step
    return lag, data._replace(pieces=[delayed(p, lag) if isinstance(p, Piece) else p for p in data.pieces])


def delayed(piece: Piece, lag: float) -> Piece:
    """A piece whose torques act later [s]; what acted before it began is taken as its first torque."""
    t = piece.time
    at = t - lag

    before, after = np.minimum(at - t[0], 0.0)[:, None], np.maximum(at - t[-1], 0.0)[:, None]
    # the impulse of the torque, from the start of the piece until each time less the lag
    total = np.column_stack([np.interp(at, t, one) for one in piece.once.T])
    total += before * piece.inputs[0] + after * piece.inputs[-1]
    held = np.diff(total, axis=0) / np.diff(t)[:, None]
    return replace(piece, inputs=np.vstack([held, held[-1:]]))
