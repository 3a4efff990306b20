"""How far the estimate may be off: covariance, whiteness of the residuals, and what is said where they are not white."""

import numpy as np
from scipy.stats import chi2

from beamchain.craft.identification.likelihood import Likelihood
from beamchain.craft.identification.response import Piece
from beamchain.ports.motions import Array

LAGS = 25  # of the test
COLOURED = 1e-3  # probability of white residuals below which intervals are widened


def whiteness(likelihood: Likelihood, residuals: list[Array]) -> Array:
    """`(p,)` probability that residuals as correlated come from white noise (Ljung and Box), nan without a time log."""
    p = likelihood.scale.size
    out = np.full(p, np.nan)
    for i in range(p):
        count, products, squares = 0, np.zeros(LAGS), 0.0
        for piece, left in zip(likelihood.pieces, residuals, strict=True):
            if isinstance(piece, Piece) and piece.time.size > 2 * LAGS:
                one = left[:, i]
                count += int(piece.use[:, i].sum())
                squares += float(one @ one)
                products += [float(one[:-k] @ one[k:]) for k in range(1, LAGS + 1)]
        if count > 4 * LAGS and squares > 0.0:
            rho = products / squares
            out[i] = float(chi2.sf(count * (count + 2) * np.sum(rho**2 / (count - np.arange(1, LAGS + 1))), LAGS))
    return out


def covariance(likelihood: Likelihood, theta: Array, squares: Array, *, coloured: bool) -> Array:
    """Covariance of the parameters; with coloured residuals that of Newey and West where it is larger.

    The noise is estimated with the numbers that the parameters and the free responses take away from the data.
    """
    longest = max((piece.time.size for piece in likelihood.pieces if isinstance(piece, Piece)), default=0)
    lags = int(min(longest // 10, 4.0 * longest ** (1.0 / 3.0))) if coloured else 0
    taken = theta.size + sum(
        2 * likelihood.model(theta).poles.size + piece.outputs.shape[1]
        for piece in likelihood.pieces
        if isinstance(piece, Piece)
    )
    total = float(likelihood.counts.sum())
    squares = squares * total / max(total - taken, 1.0)
    _, matrix, _, meat = likelihood.normal(theta, likelihood.weights(squares), lags)
    plain = inverse(matrix)
    if not lags:
        return plain
    wide = plain @ meat @ plain
    grown = np.sqrt(np.maximum(np.diag(wide) / np.maximum(np.diag(plain), 1e-300), 1.0))
    return plain * np.outer(grown, grown)


def inverse(matrix: Array) -> Array:
    """Inverse of a positive matrix; what nothing determines gets a huge variance."""
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    least = np.maximum(
        size, 1e-12 * float(np.max(size, initial=1e-300))
    )  # a number that nothing depends on stays finite
    return (vectors / np.maximum(values, 1e-15)) @ vectors.T / np.outer(least, least)
