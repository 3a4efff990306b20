"""Maximum likelihood of a parametrised modal model over all pieces of the logs, by damped Gauss-Newton steps."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from beamchain.craft.identification.response import Piece, Raw, Spectrum
from beamchain.ports.motions import Array

DIFFERENCE = 1e-5  # step of the derivatives of raw numbers by central differences: leaves ten digits
SMALLEST = 1e-30  # sum of squares, relative to the data, that counts as none
LARGEST_STEP = 0.5  # of a parameter, which are logarithms and shares
SETTLED = 1e-3  # of a standard deviation: a step smaller than this changes nothing
LITTLE = 1e-3  # gain of minus twice the log likelihood that is worth no further step
TEMPERED = (1e-4, 1e-3, 1e-2, 0.1, 1.0)
MOST_DAMPING = 1e8
UNEQUAL = 0.02  # of the logarithm of the outputs' noise, by which it may change before all is weighted anew
DIGITS = 1e-13  # relative change of the parameters below which no digit is gained


class Found(NamedTuple):
    """Where the search ended: parameters, minus twice the logarithm of the likelihood, squares and counts per output."""

    theta: Array
    cost: float
    squares: Array
    counts: Array


@dataclass(eq=False)
class Likelihood:
    """Of a model given by parameters.

    Args:
        pieces: of the data.
        model: raw model of parameters.
        belief: weighted deviations of the parameters from what is known beforehand.
        scale: `(p,)` size of the outputs.
    """

    pieces: Sequence[Piece | Spectrum]
    model: Callable[[Array], Raw]
    belief: Callable[[Array], Array]
    scale: Array

    @property
    def counts(self) -> Array:
        """`(p,)` numbers that count per output."""
        out = np.zeros(self.scale.size)
        for piece in self.pieces:
            if isinstance(piece, Piece):
                out += piece.use.sum(axis=0)
            else:
                out[piece.output] += 2 * piece.omega.size
        return out

    def squares(self, raw: Raw) -> Array:
        """`(p,)` sums of squared residuals."""
        return np.sum([piece.assess(raw, 1.0 / self.scale)[0].squares for piece in self.pieces], axis=0)

    def cost(self, squares: Array, theta: Array) -> float:
        """Minus twice the logarithm of the likelihood, with the best noise per output, but for a constant."""
        n = self.counts
        on = n > 0
        level = np.maximum(squares[on] / n[on] / self.scale[on] ** 2, SMALLEST)
        return float(np.sum(n[on] * np.log(level)) + np.sum(self.belief(theta) ** 2))

    def slopes(self, theta: Array) -> Array:
        """`(raw, parameters)` derivatives of the raw numbers."""
        return derivatives(lambda x: self.model(x).flat(), theta)

    def normal(self, theta: Array, weights: Array, lags: int = 0) -> tuple[Array, Array, Array, Array]:
        """Squares, normal matrix, gradient and its covariance at `theta`, with weights on the outputs, beliefs included."""
        raw, slopes = self.model(theta), self.slopes(theta)
        said = [piece.assess(raw, weights, slopes, lags)[0] for piece in self.pieces]
        squares, matrix, gradient, meat = (np.sum(parts, axis=0) for parts in zip(*said, strict=True))
        believed, tilt = self.belief(theta), derivatives(self.belief, theta)
        return squares, matrix + tilt.T @ tilt, gradient - tilt.T @ believed, meat + tilt.T @ tilt

    def weights(self, squares: Array) -> Array:
        """`(p,)` inverse standard deviations of the noise."""
        n = np.maximum(self.counts, 1.0)
        return 1.0 / np.sqrt(np.maximum(squares / n, SMALLEST * self.scale**2))

    def best(self, theta: Array, iterations: int) -> Found:
        """The maximum near `theta`."""
        weights = self.weights(self.squares(self.model(theta)))
        squares, matrix, gradient, _ = self.normal(theta, weights)
        cost, damping = self.cost(squares, theta), 1e-8
        for _ in range(iterations):
            size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
            scaled, right = matrix / np.outer(size, size), gradient / size
            gained, change = -1.0, np.zeros_like(theta)
            weights = self.weights(squares)
            while damping < MOST_DAMPING:
                step = np.linalg.solve(scaled + damping * np.eye(theta.size), right)
                change = step / size
                change *= min(1.0, LARGEST_STEP / max(float(np.max(np.abs(change), initial=0.0)), 1e-300))
                try:
                    with np.errstate(over="raise", invalid="raise"):
                        trial = self.normal(theta + change, weights)
                        now = self.cost(trial[0], theta + change)
                except (np.linalg.LinAlgError, FloatingPointError, ValueError):
                    now = np.inf
                if now < cost:
                    gained = cost - now
                    theta, cost, (squares, matrix, gradient, _) = theta + change, now, trial  # pyright: ignore[reportPossiblyUnboundVariable]
                    damping = max(damping / 10.0, 1e-12)
                    break
                if float(np.max(np.abs(step), initial=0.0)) < SETTLED or now - cost < 1e-6:
                    break
                damping = max(10.0 * damping, 1e-6)
            if gained < LITTLE or np.max(np.abs(change), initial=0.0) < DIGITS:
                break
            # the noise that the next step is weighted with has changed: with one output only by a factor
            factors = self.weights(squares)[self.counts > 0] ** 2 / weights[self.counts > 0] ** 2
            if float(np.ptp(np.log(factors))) > UNEQUAL:
                squares, matrix, gradient, _ = self.normal(theta, self.weights(squares))
                continue
            ratio = float(np.mean(factors))
            believed, tilt = self.belief(theta), derivatives(self.belief, theta)
            matrix = ratio * (matrix - tilt.T @ tilt) + tilt.T @ tilt
            gradient = ratio * (gradient + tilt.T @ believed) - tilt.T @ believed
        return Found(theta, cost, squares, self.counts)


def derivatives(function: Callable[[Array], Any], theta: Array) -> Array:
    """Jacobian by central differences."""
    columns = list[Array]()
    for i in range(theta.size):
        high, low = theta.copy(), theta.copy()
        high[i] += DIFFERENCE
        low[i] -= DIFFERENCE
        columns.append((function(high) - function(low)) / (2.0 * DIFFERENCE))
    return np.stack(columns, axis=1) if columns else np.zeros((np.size(function(theta)), 0))


def compressed(
    raw: Callable[[Array], Array], wanted: Array, matrix: Array, belief: Callable[[Array], Array], theta: Array
) -> Array:
    """Parameters near `theta` whose raw numbers are most likely, the data replaced by a raw estimate and its information.

    The information is raised to its full size in steps, for it makes a long narrow valley.

    Args:
        raw: raw parameters of parameters.
        wanted: those of the data.
        matrix: their information.
        belief: as in `Likelihood`.
        theta: where to start.
    """
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    root = np.sqrt(np.maximum(values, 1e-14))[:, None] * vectors.T * size

    def residual(x: Array, part: float) -> Array:
        try:
            with np.errstate(over="raise", invalid="raise"):
                return np.concatenate([part * (root @ (raw(x) - wanted)), belief(x)])
        except (ValueError, FloatingPointError, np.linalg.LinAlgError):
            return np.full(root.shape[0] + believed, 1e30)

    believed = belief(theta).size
    for part in TEMPERED:
        largest = float(np.max(root)) * part
        if largest > 1e-6:
            found = least_squares(
                residual, theta, args=(part,), x_scale="jac", method="trf", max_nfev=40, xtol=1e-12, ftol=1e-10
            )
            theta = np.asarray(found.x)
    return theta
