"""Maximum likelihood of a parametrised modal model over all pieces of the logs,
and how far the estimate may be off."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import chi2

from beamchain.identification.response import Data, Piece, Raw
from beamchain.toolkit import Array

# step of the derivatives of raw numbers by central differences: leaves ten digits
DIFFERENCE = 1e-5
SMALLEST = 1e-30  # sum of squares, relative to the data, that counts as none
LARGEST_STEP = 0.5  # of a parameter, which are logarithms and shares
SETTLED = 1e-3  # of a standard deviation: a step smaller than this changes nothing
LITTLE = 1e-3  # gain of minus twice the log likelihood that is worth no further step
TEMPERED = (1e-4, 1e-3, 1e-2, 0.1, 1.0)
MOST_DAMPING = 1e8
# of the logarithm of the outputs' noise, by which it may change before all is weighted anew
UNEQUAL = 0.02
DIGITS = 1e-13  # relative change of the parameters below which no digit is gained
LAGS = 25  # of the test for whiteness
COLOURED = 1e-3  # probability of white residuals below which intervals are widened
FAILURES = (np.linalg.LinAlgError, FloatingPointError, ValueError)  # of parameters too far off


class Found(NamedTuple):
    """Where the search ended: parameters, minus twice the logarithm of the likelihood,
    squares and counts per output."""

    theta: Array
    cost: float
    squares: Array
    counts: Array


def no_belief(theta: Array) -> Array:
    """Nothing is known beforehand."""
    return theta[:0]


@dataclass(eq=False)
class Likelihood:
    """Of a model given by parameters.

    Args:
        pieces: of the data.
        model: raw model of parameters.
        scale: `(p,)` size of the outputs.
        belief: weighted deviations of the parameters from what is known beforehand.
    """

    pieces: Sequence[Data]
    model: Callable[[Array], Raw]
    scale: Array
    belief: Callable[[Array], Array] = no_belief

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
        return np.sum(
            [piece.assess(raw, 1.0 / self.scale)[0].squares for piece in self.pieces], axis=0
        )

    def cost(self, squares: Array, theta: Array) -> float:
        """Minus twice the logarithm of the likelihood, with the best noise per output,
        but for a constant."""
        n = self.counts
        on = n > 0
        level = np.maximum(squares[on] / n[on] / self.scale[on] ** 2, SMALLEST)
        return float(np.sum(n[on] * np.log(level)) + np.sum(self.belief(theta) ** 2))

    def data_cost(self, found: Found) -> float:
        """Minus twice the logarithm of the likelihood of the data alone."""
        return found.cost - float(np.sum(self.belief(found.theta) ** 2))

    def normal(
        self, theta: Array, weights: Array, lags: int = 0
    ) -> tuple[Array, Array, Array, Array]:
        """Squares, normal matrix, gradient and its covariance at `theta`,
        with weights on the outputs, beliefs included."""
        raw = self.model(theta)
        slopes = derivatives(lambda x: self.model(x).flat(), theta)
        assessed = [piece.assess(raw, weights, slopes, lags)[0] for piece in self.pieces]
        squares, matrix, gradient, meat = (
            np.sum(parts, axis=0) for parts in zip(*assessed, strict=True)
        )
        sure, tilt = self.belief_terms(theta)
        return squares, matrix + sure, gradient - tilt, meat + sure

    def belief_terms(self, theta: Array) -> tuple[Array, Array]:
        """What the belief adds to the normal matrix and takes from the gradient."""
        tilt = derivatives(self.belief, theta)
        return tilt.T @ tilt, tilt.T @ self.belief(theta)

    def weights(self, squares: Array) -> Array:
        """`(p,)` inverse standard deviations of the noise."""
        n = np.maximum(self.counts, 1.0)
        return 1.0 / np.sqrt(np.maximum(squares / n, SMALLEST * self.scale**2))

    def best(self, theta: Array, iterations: int) -> Found:
        """The maximum near `theta`, by damped Gauss-Newton steps.

        They need the normal matrix only, which pieces add up without a Jacobian of all samples in
        memory, and take the noise of each output anew at every step, which `least_squares` cannot.
        """
        weights = self.weights(self.squares(self.model(theta)))
        squares, matrix, gradient, _ = self.normal(theta, weights)
        cost = self.cost(squares, theta)
        damping = 1e-8
        for _ in range(iterations):
            size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
            scaled = matrix / np.outer(size, size)
            right = gradient / size
            gained = -1.0
            change = np.zeros_like(theta)
            weights = self.weights(squares)
            while damping < MOST_DAMPING:
                step = np.linalg.solve(scaled + damping * np.eye(theta.size), right)
                change = step / size
                change *= min(
                    1.0, LARGEST_STEP / max(float(np.max(np.abs(change), initial=0.0)), 1e-300)
                )
                try:
                    with np.errstate(over="raise", invalid="raise"):
                        trial = self.normal(theta + change, weights)
                        now = self.cost(trial[0], theta + change)
                except FAILURES:
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
            # the noise that the next step is weighted with has changed:
            # with one output only by a factor
            factors = self.weights(squares)[self.counts > 0] ** 2 / weights[self.counts > 0] ** 2
            if float(np.ptp(np.log(factors))) > UNEQUAL:
                squares, matrix, gradient, _ = self.normal(theta, self.weights(squares))
                continue
            ratio = float(np.mean(factors))
            sure, tilt = self.belief_terms(theta)
            matrix, gradient = ratio * (matrix - sure) + sure, ratio * (gradient + tilt) - tilt
        return Found(theta, cost, squares, self.counts)

    def whiteness(self, residuals: Sequence[Array]) -> Array:
        """`(p,)` probability that residuals as correlated come from white noise (Ljung and Box),
        nan without a time log."""
        out = np.full(self.scale.size, np.nan)
        long = [
            (piece.use, left)
            for piece, left in zip(self.pieces, residuals, strict=True)
            if isinstance(piece, Piece) and piece.time.size > 2 * LAGS
        ]
        for i in range(out.size):
            count = sum(int(use[:, i].sum()) for use, _ in long)
            products = np.sum(
                [
                    [v[: v.size - k] @ v[k:] for k in range(LAGS + 1)]
                    for v in (r[:, i] for _, r in long)
                ],
                axis=0,
            )
            if count > 4 * LAGS and products[0] > 0.0:
                rho = products[1:] / products[0]
                out[i] = float(
                    chi2.sf(
                        count * (count + 2) * np.sum(rho**2 / (count - np.arange(1, LAGS + 1))),
                        LAGS,
                    )
                )
        return out

    def covariance(self, theta: Array, squares: Array, *, coloured: bool) -> Array:
        """Covariance of the parameters; with coloured residuals that of Newey and West
        where it is larger.

        The noise is estimated with the numbers that the parameters and the free responses take
        away from the data.
        """
        logs = [piece for piece in self.pieces if isinstance(piece, Piece)]
        longest = max((piece.time.size for piece in logs), default=0)
        lags = int(min(longest // 10, 4.0 * longest ** (1.0 / 3.0))) if coloured else 0
        taken = theta.size + len(logs) * (2 * self.model(theta).poles.size + self.scale.size)
        total = float(self.counts.sum())
        _, matrix, _, meat = self.normal(
            theta, self.weights(squares * total / max(total - taken, 1.0)), lags
        )
        plain = inverse(matrix)
        if not lags:
            return plain
        wide = plain @ meat @ plain
        grown = np.sqrt(np.maximum(np.diag(wide) / np.maximum(np.diag(plain), 1e-300), 1.0))
        return plain * np.outer(grown, grown)


def inverse(matrix: Array) -> Array:
    """Inverse of a positive matrix; what nothing determines gets a huge variance."""
    size, values, vectors = _balance(matrix)
    # what nothing depends on stays finite
    least = np.maximum(size, 1e-12 * float(np.max(size, initial=1e-300)))
    return (vectors / np.maximum(values, 1e-15)) @ vectors.T / np.outer(least, least)


def _balance(matrix: Array) -> tuple[Array, Array, Array]:
    """Roots of a matrix's diagonal; eigenvalues and vectors of the matrix over them."""
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    return size, values, vectors


def derivatives(function: Callable[[Array], Any], theta: Array) -> Array:
    """Jacobian by central differences."""
    steps = DIFFERENCE * np.eye(theta.size)
    columns = [
        (function(theta + step) - function(theta - step)) / (2.0 * DIFFERENCE) for step in steps
    ]
    return np.stack(columns, axis=1) if columns else np.zeros((np.size(function(theta)), 0))


def fit_raw_numbers(
    raw: Callable[[Array], Array],
    wanted: Array,
    matrix: Array,
    belief: Callable[[Array], Array],
    theta: Array,
) -> Array:
    """Parameters near `theta` whose raw numbers are most likely, the data replaced by raw ones
    (`wanted`) and their information.

    The information `matrix` is raised to its full size in steps, for it makes a long narrow valley.
    """
    size, values, vectors = _balance(matrix)
    root = np.sqrt(np.maximum(values, 1e-14))[:, None] * vectors.T * size
    beliefs = belief(theta).size

    def residual(x: Array, part: float) -> Array:
        try:
            with np.errstate(over="raise", invalid="raise"):
                return np.concatenate([part * (root @ (raw(x) - wanted)), belief(x)])
        except FAILURES:
            return np.full(root.shape[0] + beliefs, 1e30)

    for part in TEMPERED:
        if float(np.max(root)) * part > 1e-6:
            found = least_squares(
                residual,
                theta,
                args=(part,),
                x_scale="jac",
                method="trf",
                max_nfev=40,
                xtol=1e-12,
                ftol=1e-10,
            )
            theta = np.asarray(found.x)
    return theta
