"""Upper bounds over all real deltas in [-1, 1]: the structured singular value, and the worst gain of a closed loop.

For Hermitian D > 0 and G that commute with Delta, `w = Delta z` gives `w* D w <= z* D z` and `w* G z = z* G w`. With
`[z, e] = N [w, d]` the gain from d to e is at most g where

    diag(D, g^2) - N* diag(D, 1) N - j (diag(G, 0) N - N* diag(G, 0)) > 0,

a linear matrix inequality in D, G and g^2 (Fan, Tits and Doyle, IEEE Transactions on Automatic Control 36, 1991). Newton
steps on its barrier minimise g; every point on the way is a bound by itself, however far the minimum is.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import eigh

from beamchain.craft.robust.systems import Complex
from beamchain.ports.motions import Array

TIGHT = 2e-3  # relative, to which the square of the least gain is found
WIDEST = 6  # repetitions beyond which the quantities of a delta are bounded as if each had its own
LARGEST = 1e6  # of D, where N is balanced
NEWTON = 40  # steps at most per centre
NONE = 1e-2  # a structured singular value below this is as good as none


def bounds(n: Complex, groups: Sequence[Sequence[int]]) -> tuple[Array, Array]:
    """Upper bounds `(k,)` of the structured singular value of Delta, and of the gain from d to e.

    The second is infinite where the first is not below one. `n`: `(k, channels + 1, channels + 1)` N at k frequencies;
    `groups`: channels that have a delta in common.
    """
    size = n.shape[1] - 1
    basis = _hermitian(size, groups)
    out = np.array([_bound(one, basis) for one in n]).reshape(-1, 2)
    return out[:, 0], out[:, 1]


def _bound(n: Complex, basis: Complex) -> tuple[float, float]:
    unit = float(np.abs(n[-1, -1])) or float(np.linalg.norm(n[-1])) or 1.0
    n = _balanced(np.vstack([n[:-1], n[-1:] / unit]))  # gains near one
    p = basis.shape[0]
    stable = _Barrier(n[:-1, :-1], basis, 1.0)
    x = np.concatenate([np.real(np.einsum("pii->p", basis)) / 2.0, np.zeros(p)])  # D = 1/2
    stable.level, mu = 1.1 * float(np.linalg.norm(n[:-1, :-1], 2)) + 1e-6, np.inf
    for _ in range(60):
        x = stable.centre(x, np.zeros(2 * p))
        reached = stable.least(x)
        done = reached > 0.97 * mu or reached < NONE
        mu = min(mu, reached)
        if done:
            break
        stable.level = reached + 0.1 * (stable.level - reached)
    if mu >= 1.0:
        return mu, np.inf
    gain = _Barrier(n, basis, LARGEST)
    scales = np.geomspace(1e-5, 1e5, 41)
    squares = np.array([gain.square(x * scale) for scale in scales])
    at = int(np.argmin(squares))
    best = float(squares[at])
    x, weight = np.append(x * scales[at], 1.1 * best), 3.0 * n.shape[0] / best
    while 3.0 * n.shape[0] / weight > TIGHT * best:
        weight *= 20.0
        x = gain.centre(x, np.append(np.zeros(2 * p), weight))
        best = min(best, gain.square(x[:-1]))
    return mu, unit * float(np.sqrt(best))


def _hermitian(size: int, groups: Sequence[Sequence[int]]) -> Complex:
    """`(p, size, size)` basis of the Hermitian matrices that have a block per group."""
    out: list[Complex] = []
    for group in groups:
        for i in group:
            for j in group:
                one = np.zeros((size, size), dtype=np.complex128)
                one[i, j] += 1.0 if i <= j else 1.0j
                out.append((one + one.conj().T) / (2.0 if i == j else 1.0))
    return np.array(out).reshape(len(out), size, size)


class _Barrier:
    """Minus the logarithms of the determinants of the inequality, of D and of `top - D`.

    The unknowns are the coordinates of D and G in `basis`, behind them the square of the gain. N without d and e gives the
    inequality of the structured singular value, with `level` for its square root.
    """

    def __init__(self, n: Complex, basis: Complex, top: float) -> None:
        self.level, self._n, self._top = 1.0, n, top
        self._size, self._gain = basis.shape[1], n.shape[0] > basis.shape[1]
        pairs = np.argwhere(np.abs(basis).sum(axis=0) > 0.0)  # (a, b) of the elements `e_a e_b*` that D and G have
        self._a, self._b = pairs.T
        self._to_real = basis[:, self._a, self._b]

    def _parts(self, x: Array) -> tuple[Complex, Complex]:
        p = self._to_real.shape[0]
        d, g = np.zeros((2, self._size, self._size), dtype=np.complex128)
        d[self._a, self._b], g[self._a, self._b] = x[:p] @ self._to_real, x[p : 2 * p] @ self._to_real
        return d, g

    def _inequality(self, x: Array, square: float = 0.0) -> Complex:
        d, g = self._parts(x)
        k, n = self._size, self._n
        out = -n[:k].conj().T @ d @ n[:k]
        turned = np.zeros_like(out)
        turned[:k] = g @ n[:k]
        out -= 1j * (turned - turned.conj().T)
        out[:k, :k] += self.level**2 * d
        if self._gain:
            out -= np.outer(n[-1].conj(), n[-1])
            out[-1, -1] += square
        return out

    def least(self, x: Array) -> float:
        """The smallest level that these D and G allow."""
        d, _ = self._parts(x)
        whole = self.level**2 * d - self._inequality(x)
        return float(np.sqrt(max(eigh(whole, d, eigvals_only=True)[-1], 0.0)))

    def square(self, x: Array) -> float:
        """The least square of the gain that these D and G allow; infinite where they allow none."""
        whole = self._inequality(x)
        try:
            np.linalg.cholesky(whole[:-1, :-1])
        except np.linalg.LinAlgError:
            return np.inf
        return float((whole[-1, :-1] @ np.linalg.solve(whole[:-1, :-1], whole[:-1, -1]) - whole[-1, -1]).real)

    def _three(self, x: Array) -> tuple[Complex, Complex, Complex]:
        d, _ = self._parts(x)
        return self._inequality(x, float(x[-1])), d, self._top * np.eye(self._size) - d

    def _value(self, x: Array, cost: Array) -> float:
        try:
            logs = [np.log(np.diag(np.linalg.cholesky(one)).real).sum() for one in self._three(x)]
        except np.linalg.LinAlgError:
            return np.inf
        return float(cost @ x) - 2.0 * float(np.sum(logs))

    def _slopes(self, x: Array) -> tuple[Array, Array]:
        """Gradient and Hessian, `tr(P T)` and `tr(P T P T)`: every T is `[e_a, n_a*] S [e_b, n_b]*` of two rows."""
        whole, low, high = (np.linalg.inv(one) for one in self._three(x))
        k, a, b, u = self._size, self._a, self._b, self._to_real
        rows = np.vstack([np.eye(k, self._n.shape[1]), self._n[:k]])
        q = rows @ whole @ rows.conj().T
        kinds = ((0, 0, self.level**2 + 0j), (k, k, -1.0 + 0j)), ((0, k, -1j), (k, 0, 1j))  # S of D, of G
        among = {(v, r): q[np.ix_(b + v, a + r)] for v in (0, k) for r in (0, k)}
        gradient: list[Complex] = [np.array(-sum(s * q[b + t, a + r] for r, t, s in kind)) for kind in kinds]
        hessian: list[list[Complex]] = [[np.array(sum(s * z * among[v, r].T * among[t, w] for r, t, s in one for w, v, z in two))
                    for two in kinds] for one in kinds]  # fmt: skip
        for inverse, sign in ((low, -1.0), (high, 1.0)):
            gradient[0] = gradient[0] + sign * inverse[b, a]
            crossed = inverse[b[:, None], a[None, :]]
            hessian[0][0] = hessian[0][0] + crossed.T * crossed
        first = np.concatenate([(u @ part).real for part in gradient])
        second = np.block([[(u @ part @ u.T).real for part in row] for row in hessian])
        if not self._gain:
            return first, second
        last = whole[-1] @ rows.conj().T
        cross = [sum(s * last[a + r] * last.conj()[b + t] for r, t, s in kind) for kind in kinds]
        mixed = np.concatenate([(u @ part).real for part in cross])[:, None]
        corner = np.array([[float(np.abs(whole[-1, -1]) ** 2)]])
        return np.append(first, -whole[-1, -1].real), np.block([[second, mixed], [mixed.T, corner]])

    def centre(self, x: Array, cost: Array) -> Array:
        """Newton steps for the least of `cost x` and the barrier, from a point where the inequalities hold."""
        here = self._value(x, cost)
        for _ in range(NEWTON):
            first, second = self._slopes(x)
            size = np.sqrt(np.maximum(np.diag(second), 1e-300))
            scaled = second / np.outer(size, size) + 1e-13 * np.eye(x.size)
            step = -np.linalg.solve(scaled, (cost + first) / size) / size
            decrement, length = -float((cost + first) @ step), 1.0
            there = self._value(x + step, cost)
            while length > 1e-8 and not there <= here - 0.1 * length * decrement:
                length /= 2.0
                there = self._value(x + length * step, cost)
            if length <= 1e-8:
                break
            x, here = x + length * step, there
            if decrement < 0.1:
                break
        return x


def _balanced(n: Complex) -> Complex:
    """N with its channels scaled so that what goes in and comes out of each is alike; no gain changes."""
    out = n.copy()
    for _ in range(20):
        for i in range(n.shape[0] - 1):
            others = [j for j in range(n.shape[0]) if j != i]
            row, column = (float(np.linalg.norm(part)) for part in (out[i, others], out[others, i]))
            if row > 0.0 and column > 0.0:
                scale = np.sqrt(column / row)
                out[i] *= scale
                out[:, i] /= scale
    return out
