"""An upper bound of the structured singular value mu of a matrix for a perturbation of every
channel by a complex number of its own, by scaling the channels.

mu(M) is one over the size of the smallest `Delta = diag(delta_1, ..., delta_n)` that makes
`1 - M Delta` singular. Of any positive diagonal D, the largest singular value of `D M D^-1` is an
upper bound; it is convex in log D, and for up to three channels the smallest is mu itself
(Packard and Doyle 1993, https://doi.org/10.1016/0005-1098(93)90175-S).
"""

import numpy as np
from scipy.optimize import minimize

from beamchain.control.systems import Complex
from beamchain.ports.motions import Array

SHARPER = (4.0, 16.0, 64.0, 256.0, 1024.0, 4096.0, 16384.0)  # exponents of the sum that stands
# for the largest singular value: what the last is too large by is log(n)/16384
WIDEST = 30.0  # of log D
ROUNDS = 30  # of balancing
SETTLED = 1e-7  # relative, of a scale that balances: the bound is right to its square


def balanced_bounds(m: Complex) -> Array:
    """`(k,)` upper bounds of matrices `(k, n, n)`, quickly: D that makes rows and columns equal."""
    size = np.abs(m) ** 2
    n = m.shape[-1]
    size[:, range(n), range(n)] = 0.0
    scale = np.ones(m.shape[:2])
    tiny = 1e-300
    for _ in range(ROUNDS if n > 1 else 0):
        before = scale.copy()
        for i in range(n):
            row = (size[:, i] / scale**2).sum(axis=1)
            column = (size[:, :, i] * scale**2).sum(axis=1)
            # d_i^2 sum_j |m_ij|^2/d_j^2 = sum_j d_j^2 |m_ji|^2/d_i^2
            scale[:, i] = np.clip(((column + tiny) / (row + tiny)) ** 0.25, 1e-13, 1e13)
        scale /= scale[:, :1]
        if np.all(np.abs(scale - before) <= SETTLED * scale):
            break
    scaled = m * scale[:, :, None] / scale[:, None, :]
    return np.asarray(np.linalg.norm(scaled, 2, axis=(1, 2)), dtype=np.float64)


def bound(m: Complex) -> float:
    """The smallest upper bound of a matrix `(n, n)` that scaling gives."""
    n = m.shape[0]
    if n == 1:
        return float(np.abs(m[0, 0]))
    top = float(np.linalg.norm(m, 2))
    if top == 0.0:
        return 0.0
    m = m / top
    logs = np.zeros(n - 1)
    least = 1.0
    for exponent in SHARPER:
        found = minimize(
            _power_sum,
            logs,
            args=(m, exponent),
            jac=True,
            method="L-BFGS-B",
            bounds=[(-WIDEST, WIDEST)] * (n - 1),
            options={"ftol": 1e-15, "gtol": 1e-11},
        )
        logs = np.asarray(found.x, dtype=np.float64)
        least = min(least, float(np.linalg.norm(_scaled(m, logs), 2)))
    return top * least


def _scaled(m: Complex, logs: Array) -> Complex:
    d = np.exp(np.append(0.0, logs))
    return m * d[:, None] / d


def _power_sum(logs: Array, m: Complex, exponent: float) -> tuple[float, Array]:
    """`log(sum sigma^p)/p` of the singular values of `D M D^-1`, and its slope by log D.

    `d sigma / d log d_k = sigma (|u_k|^2 - |v_k|^2)` with its left and right vectors u and v.
    """
    left, sigma, right = np.linalg.svd(_scaled(m, logs))
    top = sigma[0]
    weight = (sigma / top) ** exponent
    value = float(np.log(top) + np.log(weight.sum()) / exponent)
    each = np.abs(left) ** 2 - np.abs(right.T) ** 2
    slope = each @ (weight / weight.sum())
    return value, np.asarray(slope[1:], dtype=np.float64)
