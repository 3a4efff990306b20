"""What holds over an interval of frequencies for all values of the deltas: multipliers D, G from a
semidefinite program, and the gain that they prove between the ends of the interval.

With N the closed loop, `[z, e] = N [w, d]`, `w = Delta z`, and D > 0, G Hermitian, both commuting
with Delta, every delta real and between -1 and 1,

    F(omega) = diag(D, g) - N^H diag(D, 1) N - j (G N - N^H G) > 0

proves `|e|^2 < g |d|^2` for all Delta: multiply by [w, d] from both sides; w^H D w <= z^H D z, and
w^H G z is real. As w = 0 is then the only solution without d, at every Delta, no pole reaches the
imaginary axis there. Complex deltas of a size of at most 1 have G = 0.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from beamchain.errors import InputError
from beamchain.toolkit import Array, Complex

SLACK = 1e-5  # of D that a program leaves, for the rounding of its solution
LEAST = 1e-7  # least eigenvalue of D, its channels in balance
TIDY = 1e-8  # of the squares of D and G: holds those that matter to nothing
NOT_SEEN = 1e-12  # of the gain, by way of a channel: what rounding makes of none
NO_COUPLING = 1e-16  # of the largest coupling of a channel
RAISED = 1e-6  # relative, by which g is raised above what is needed where F was looked at
ROUNDS = 30  # of raising g
# of programs, which are in balance; proofs follow
SETTINGS = {
    "accept_unknown": True,
    "chordal_decomposition_enable": False,
    "direct_solve_method": "faer",
    "equilibrate_enable": False,
    "max_threads": 1,
    "tol_feas": 1e-6,
    "tol_gap_abs": 1e-5,
    "tol_gap_rel": 1e-5,
}
LONGEST = 60.0  # [s] that a program may take
BEYOND = 10.0  # times the lower end, up to which an interval without an upper end is looked at


class ComplexSystem(NamedTuple):
    """`C (j omega - A)^-1 B + D` with complex matrices."""

    a: Complex
    b: Complex
    c: Complex
    d: Complex

    def at(self, omega: Array) -> Complex:
        """`(k, outputs, inputs)` at frequencies `(k,)`, the last of which may be infinite."""
        finite = omega[np.isfinite(omega)]
        eye = np.eye(self.a.shape[0])
        shifted = 1j * finite[:, None, None] * eye - self.a
        parts = [self.c @ np.linalg.solve(shifted, self.b[None]) + self.d]
        return np.concatenate([*parts, *[self.d[None]] * (omega.size - finite.size)])


class Delta(NamedTuple):
    """A number on the diagonal of Delta, so often; complex of a size of at most 1 where not real
    in [-1, 1]."""

    repetitions: int
    real: bool


@dataclass(frozen=True)
class Multipliers:
    """D and G `(channels, channels)`, block diagonal."""

    d: Complex
    g: Complex

    def needed(self, n: Complex) -> Array:
        """`(k,)` the least g for which F is positive at `n` `(k, channels + 1, channels + 1)`;
        infinite where it never is."""
        size = self.d.shape[0]
        y = np.eye(size + 1, dtype=np.complex128)
        y[:size, :size] = self.d
        turned = np.zeros_like(n)
        turned[:, :size] = self.g @ n[:, :size]
        f = -_transposed(n) @ y @ n - 1j * (turned - _transposed(turned))
        f[:, :size, :size] += self.d
        out = np.full(n.shape[0], np.inf)
        for k, each in enumerate(f):
            try:
                root = np.linalg.cholesky(each[:size, :size])
            except np.linalg.LinAlgError:
                continue
            # with f = [[f11, f12], [f21, g - q]]: g > q + f21 f11^-1 f12
            half = np.linalg.solve(root, each[:size, size])
            out[k] = float(np.vdot(half, half).real - each[size, size].real)
        return out


class Program(NamedTuple):
    """The solution of a semidefinite program.

    Args:
        multipliers: D and G.
        g: the least that is common to all its frequencies.
        likely: `(deltas,)` mean of every delta in the program's worst case.
        unsure: `(deltas,)` what the program allows by not taking a delta for one number, as it is
            in a plant: its variance in the worst case, in units of g.
    """

    multipliers: Multipliers
    g: float
    likely: Array
    unsure: Array


class Proof(NamedTuple):
    """What multipliers prove over an interval: g, and where it is needed [rad/s]; infinite where
    they prove nothing."""

    g: float
    omega: float


def _transposed(n: NDArray[Any]) -> Complex:
    return np.asarray(np.conj(np.swapaxes(n, -1, -2)), dtype=np.complex128)


def balanced(system: ComplexSystem, omega: Array, gain: float, unknown: int = 0) -> ComplexSystem:
    """The same with e in units of `gain` times d, and channels scaled so that at the frequencies
    each is driven as much by d as it drives e.

    The last `unknown` channels, for which multipliers are not looked for, and those between which
    and d or e there is nothing but rounding, are scaled so that each is driven as much by those
    before it as it drives them: the dead time of another axis may yet reach the deltas.
    """
    n = np.abs(system.at(omega)).max(axis=0)
    n[-1] /= gain
    driven = n[:-1, -1] + 1e-12 * n[:-1].max(initial=1e-300)
    drives = n[-1, :-1] + 1e-12 * n[:, :-1].max(initial=1e-300)
    scale = np.append(np.sqrt(drives / driven), 1.0)
    of_others = driven * drives < NOT_SEEN
    of_others[of_others.size - unknown :] = True
    others = np.append(~of_others, True)
    for channel in np.flatnonzero(of_others):
        least = NO_COUPLING * float(n[[channel], :].max() + n[:, channel].max()) + 1e-300
        driven_by = float((n[channel, others] / scale[others]).max())
        driving = float((n[others, channel] * scale[others]).max())
        scale[channel] = np.sqrt(max(driving, least) / max(driven_by, least))
        others[channel] = True  # the next ones may concern it
    after = scale.copy()
    after[-1] = 1.0 / gain
    a, b, c, d = system
    return ComplexSystem(a, b / scale, c * after[:, None], d * after[:, None] / scale)


def zero_crossings(
    system: ComplexSystem, multipliers: Multipliers, g: float, centre: float
) -> Array:
    """Frequencies `(m,)` among which are all where det F is zero, F regular at `centre`.

    With nu = omega - centre and A0 = (j centre - A)^-1, N = N0 + C A0 (s - A0)^-1 A0 B at s = j/nu:
    zeros of det F are imaginary eigenvalues s of a Hamiltonian matrix. Those that rounding may have
    moved off the axis count as well: of all eigenvalues, the real parts of nu are given.
    """
    a = np.linalg.inv(1j * centre * np.eye(system.a.shape[0]) - system.a)
    b = a @ system.b
    c = system.c @ a
    n = system.at(np.array([centre]))[0]
    size = multipliers.d.shape[0]
    y = np.eye(size + 1, dtype=np.complex128)
    y[:size, :size] = multipliers.d
    x = y.copy()
    x[size, size] = g
    turned = np.zeros_like(y)
    turned[:size, :size] = multipliers.g
    # of N = C x + N0 u, F is x^H Q x + 2 Re x^H S u + u^H R u
    q = -_transposed(c) @ y @ c
    s = -_transposed(c) @ y @ n + 1j * _transposed(c) @ turned
    r = x - _transposed(n) @ y @ n - 1j * (turned @ n - _transposed(n) @ turned)
    of_states = np.linalg.solve(r, _transposed(s))
    of_costates = np.linalg.solve(r, _transposed(b))
    matrix = np.block(
        [
            [a - b @ of_states, -b @ of_costates],
            [-q + s @ of_states, -_transposed(a) + s @ of_costates],
        ]
    )
    values = np.linalg.eigvals(matrix)
    values = values[np.abs(values) > 1e-14 * np.abs(values).max(initial=1e-300)]
    return np.asarray(centre + (1j / values).real, dtype=np.float64)


def prove(system: ComplexSystem, multipliers: Multipliers, low: float, high: float) -> Proof:
    """The least g that multipliers prove from `low` to `high` [rad/s], which may be infinite.

    F ceases to be positive only where its determinant is zero. So it is looked at between all
    neighbours among the frequencies where that may be, and g raised to what is needed there, until
    it is enough.
    """
    look = _between(np.array([low, high]))
    needed = multipliers.needed(system.at(look))
    g = float(needed.max())
    where = float(look[np.argmax(needed)])
    centre = float(look[np.argmin(needed[np.isfinite(look)])])
    for _ in range(ROUNDS):
        if not np.isfinite(g):
            break
        g *= 1.0 + RAISED
        zeros = zero_crossings(system, multipliers, g, centre)
        inside = np.sort(zeros[(zeros > low) & (zeros < high)])
        look = _between(np.array([low, *inside, high]))
        needed = multipliers.needed(system.at(look))
        if needed.max() <= g:
            return Proof(g, where)
        g = float(needed.max())
        where = float(look[np.argmax(needed)])
    return Proof(float("inf"), where)


def _between(ends: Array) -> Array:
    """Ends, and frequencies between neighbours."""
    last = ends[-1] if np.isfinite(ends[-1]) else BEYOND * ends[-2]
    finite = np.append(ends[:-1], last)
    middles = (finite[1:] + finite[:-1]) / 2.0
    return np.unique(np.concatenate([ends, finite, middles]))


def solve_program(n: Complex, deltas: Sequence[Delta]) -> Program | None:
    """D and G for which the g common to all of `n` `(k, channels + 1, channels + 1)` is least;
    None where there are none.

    Args:
        n: the closed loop at some frequencies, its channels in balance and its gain about 1.
        deltas: on the diagonal of Delta.
    """
    cp = cvxpy()
    channels = n.shape[1] - 1
    blocks = _blocks(deltas)
    of_d = np.concatenate([_hermitian(block, channels) for block, _ in blocks])
    real = [_hermitian(block, channels) for block, real in blocks if real]
    of_g = np.concatenate([of_d[:0], *real])
    last = np.zeros((1, channels + 1, channels + 1))
    last[0, -1, -1] = 1.0
    x = cp.Variable(of_d.shape[0] + of_g.shape[0] + 1)
    d = x[: of_d.shape[0]]
    positive: list[Any] = []
    for at in n:
        through = at[:-1]
        # every element of the bases of D and of G in F
        in_d = -_transposed(through) @ of_d @ through
        in_d[:, :-1, :-1] += (1.0 - SLACK) * of_d
        turned = np.pad(of_g @ through, ((0, 0), (0, 1), (0, 0)))
        in_g = -1j * (turned - _transposed(turned))
        constant = -np.outer(at[-1].conj(), at[-1])
        basis = np.concatenate([in_d, in_g, last]).astype(np.complex128)
        positive.append(_matrix(cp, basis, x, constant))
    least = [_of_block(cp, of_d, block, d) for block, _ in blocks]
    conditions = [matrix >> 0 for matrix in positive]
    cost = x[-1] + TIDY * cp.sum_squares(x[:-1])
    problem = cp.Problem(cp.Minimize(cost), [*conditions, *least])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of inexact solutions: `prove` looks at them
            problem.solve(solver=cp.CLARABEL, time_limit=LONGEST, **SETTINGS)
    except cp.error.SolverError:
        return None
    if x.value is None or not np.all(np.isfinite(x.value)):
        return None
    worst = [_complex(np.asarray(condition.dual_value)) for condition in conditions]
    split = of_d.shape[0]
    found = Multipliers(
        np.tensordot(x.value[:split], of_d, 1), np.tensordot(x.value[split:-1], of_g, 1)
    )
    moments = [_moments(block, n, worst, found.d[block, block]) for block, _ in blocks]
    likely, unsure = np.transpose(moments)
    return Program(found, float(x.value[-1]), likely, unsure)


def _blocks(deltas: Sequence[Delta]) -> list[tuple[slice, bool]]:
    """Where every delta stands on the diagonal, and whether it is real."""
    ends = np.cumsum([0, *(delta.repetitions for delta in deltas)]).tolist()
    places = zip(ends[:-1], ends[1:], deltas, strict=True)
    return [(slice(start, stop), delta.real) for start, stop, delta in places]


def _hermitian(block: slice, size: int) -> Complex:
    """`(r^2, size, size)` a basis of the Hermitian matrices of a block of r rows."""
    rows = range(block.start, block.stop)
    out: list[Complex] = []
    for i in rows:
        for k in rows:
            unit = np.zeros((size, size), dtype=np.complex128)
            unit[i, k] = 1.0 if i <= k else 1j
            out.append((unit + _transposed(unit)) / 2.0)
    return np.array(out)


def _matrix(cp: Any, basis: Complex, x: Any, constant: Complex) -> Any:
    """`sum of x_k basis_k + constant` as a real symmetric matrix."""
    size = 2 * basis.shape[-1]
    columns = _real(basis).reshape(basis.shape[0], -1).T
    return cp.reshape(columns @ x + _real(constant).ravel(), (size, size), order="C")


def _of_block(cp: Any, basis: Complex, block: slice, d: Any) -> Any:
    """D of a block is positive."""
    mine = basis[:, block, block]
    picked = np.flatnonzero(np.abs(mine).max(axis=(1, 2)) > 0.0)
    least = LEAST * np.eye(mine.shape[-1])
    return _matrix(cp, mine[picked], d[picked], -least.astype(np.complex128)) >> 0


def _real(matrix: Complex) -> Array:
    """A Hermitian matrix as a real symmetric one."""
    return np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]])


def _complex(matrix: Array) -> Complex:
    """The part of a real symmetric matrix that `_real` gives, times 2."""
    n = matrix.shape[0] // 2
    a, b, c, d = matrix[:n, :n], matrix[:n, n:], matrix[n:, :n], matrix[n:, n:]
    return a + d + 1j * (c - b)


def _moments(block: slice, n: Complex, worst: Sequence[Complex], d: Complex) -> tuple[float, float]:
    """Mean of a delta in the worst case of a program, and its variance in units of g.

    With W = E[x x^H], x = [w, d], `E[delta^2]` is `tr E[w w^H] / tr E[z z^H]` and `E[delta]` is
    `tr E[w z^H] / tr E[z z^H]`. What the program allows w is worth `tr D E[z z^H]` of g, which is
    next to nothing where the delta is hardly driven, whatever rounding makes its variance.
    """
    zz = ww = wz = worth = 0.0
    for at, w in zip(n, worst, strict=True):
        z = at[block]
        of_z = z @ w @ _transposed(z)
        zz += float(np.trace(of_z).real)
        worth += float(np.trace(d @ of_z).real)
        ww += float(np.trace(w[block, block]).real)
        wz += float(np.trace(w[block] @ _transposed(z)).real)
    return (wz / zz, (ww / zz - (wz / zz) ** 2) * worth) if zz > 0.0 else (0.0, 0.0)


def cvxpy() -> Any:
    """cvxpy, with Clarabel.

    Raises:
        InputError: they are not installed.
    """
    try:
        cvxpy = import_module("cvxpy")
        import_module("clarabel")
    except ImportError:
        raise InputError(
            "bound: upper bounds need cvxpy and Clarabel; pip install beamchain[robust]."
        ) from None
    return cvxpy
