"""A linear craft in real modal blocks: chains of integrators for rigid motion, oscillators, what decays.

First order, over `(w eta, r', eta', a)` behind the rigid positions `r`, on which nothing depends. Blocks that nothing
couples are read off; those that damping or gyroscopic moments couple are separated by their eigenvectors. A discrete plant
is taken apart in the same way, by `(A - 1)/h` instead of A.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr
from scipy.optimize import linear_sum_assignment
from scipy.sparse.csgraph import connected_components

from beamchain.plants.normal_modes import NormalModes
from beamchain.ports.motions import Array

Flags = NDArray[np.bool_]
Ints = NDArray[np.intp]
Complex = NDArray[np.complex128]

APART = 1e-12  # relative: a smaller coupling is none
ZERO = 1e-11  # relative: smaller singular values are zero
SKEW = 1e7  # condition of eigenvectors beyond which blocks stay together
UNSEEN = 1e-9  # relative: less than this is driven or seen by nothing
MODAL = ("kg^0.5 m", "kg^0.5 m/s")  # units of the amplitude of a mode of unit mass, and of its rate


@dataclass(frozen=True, eq=False)
class Block:
    """States on which no others but rigid positions depend.

    Args:
        basis: `(n, k)` columns over the coordinates behind `r`.
        matrix: `(k, k)` of the derivative.
        names, units: of the states.
        weight: `(k,)` size of a state, so that states compare.
    """

    basis: Array
    matrix: Array
    names: tuple[str, ...]
    units: tuple[str, ...]
    weight: Array


@dataclass(frozen=True, eq=False)
class ModalForm:
    """All states of a craft: rigid positions, rigid rates, what else there is, oscillators by mode.

    Args:
        a, b, c, d: over all states.
        names, units: of the states.
        weight: size of each, so that states compare.
        rigid: number of rigid positions, and of rigid rates.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    names: tuple[str, ...]
    units: tuple[str, ...]
    weight: Array
    rigid: tuple[int, int]

    def active(self) -> Flags:
        """`(states,)` which states something drives and something sees."""
        rows, columns = _level(self.c * self.weight), _level((self.b / self.weight[:, None]).T).T
        link = np.abs(self.a) * np.outer(1.0 / self.weight, self.weight)
        link = (link > UNSEEN * max(float(link.max(initial=0.0)), 1e-300)).astype(int)
        seen, driven = np.abs(rows).max(axis=0) > UNSEEN, np.abs(columns).max(axis=1) > UNSEEN
        for _ in range(3):  # along a chain of integrators, and within a block
            seen, driven = seen | (seen @ link > 0), driven | (link @ driven > 0)
        return seen & driven

    def reduced(self, keep: Flags) -> "ModalForm":
        """Only the states that are kept; a rigid rate stands behind its position."""
        first, second = self.rigid
        order = sorted(range(first + second), key=lambda i: (self._position(i), i))
        pick = [i for i in [*order, *range(first + second, len(self.names))] if keep[i]]
        left = sum(bool(keep[i]) for i in range(first)), sum(bool(keep[i]) for i in range(first, first + second))
        return ModalForm(
            self.a[np.ix_(pick, pick)], self.b[pick], self.c[:, pick], self.d, tuple(self.names[i] for i in pick),
            tuple(self.units[i] for i in pick), self.weight[pick], left,
        )  # fmt: skip

    def _position(self, i: int) -> int:
        name = self.names[i].removesuffix("_rate")
        return self.names.index(name) if name in self.names else i

    def spanned(self) -> "ModalForm":
        """Double integrators of fewer directions where the inputs drive, or the outputs see, no more."""
        first, second = self.rigid
        chain = 2 * first
        one, two = slice(0, chain, 2), slice(1, chain, 2)
        link = self.a[:chain, :chain]
        if first != second or chain == 0 or not np.allclose(link, np.kron(np.eye(first), [[0.0, 1.0], [0.0, 0.0]])):
            return self
        w = self.weight[two]
        driven, pick = _range(np.hstack([self.b[one], self.b[two]]) / w[:, None])
        driven = driven * w[:, None] / w[pick]  # all directions by those that are kept
        seen, among = _range((np.vstack([_level(self.c[:, k] @ driven * w[pick]) for k in (one, two)])).T)
        onto = seen.T * w[pick] / w[pick][among][:, None]
        back = driven[:, among]
        keep = [pick[i] for i in among]
        states = [2 * i + k for i in keep for k in (0, 1)] + list(range(chain, len(self.names)))
        b, c = self.b[states].copy(), self.c[:, states].copy()
        count = 2 * len(keep)
        for k, part in enumerate((one, two)):
            b[k:count:2] = onto @ self.b[part][pick]
            c[:, k:count:2] = self.c[:, part] @ back
        return ModalForm(
            self.a[np.ix_(states, states)], b, c, self.d, tuple(self.names[i] for i in states),
            tuple(self.units[i] for i in states), self.weight[states], (len(keep), len(keep)),
        )  # fmt: skip


def _level(rows: Array) -> Array:
    """Rows with 1 for their largest entry."""
    return rows / np.maximum(np.abs(rows).max(axis=1, keepdims=True, initial=0.0), 1e-300)


def _range(matrix: Array) -> tuple[Array, list[int]]:
    """`(n, k)` basis of the columns of `(n, m)` which is the identity in k rows, and those rows."""
    u, s, _ = np.linalg.svd(matrix, full_matrices=False)
    u = u[:, s > UNSEEN * s.max(initial=0.0)]
    _, _, order = qr(u.T, pivoting=True, mode="economic")
    rows = sorted(int(i) for i in order[: u.shape[1]])
    return np.asarray(u @ np.linalg.inv(u[rows]), dtype=np.float64), rows


class _Coordinates:
    """`(w eta, r', eta', a)`, and the names of what stands in each place."""

    def __init__(
        self, modes: NormalModes, own: Sequence[tuple[str, str]], names: Sequence[str], lags: Sequence[str]
    ) -> None:
        self.w, self.own, self.names = modes.frequency, list(own), list(names)
        self.nf, self.nr = modes.frequency.size, len(own)
        self.size: Array = np.sqrt(np.diag(modes.rigid.T @ modes.mass @ modes.rigid))
        self.weights: Array = np.concatenate([np.ones(self.nf), 1.0 / self.size, np.ones(self.nf + len(lags))])
        self.all = [
            *((name, MODAL[0]) for name in names), *((f"rigid_{name}_rate", f"{unit}/s") for name, unit in own),
            *((f"{name}_rate", MODAL[1]) for name in names), *((name, "") for name in lags),
        ]  # fmt: skip

    def alone(self, x: Array, matrix: Array, places: Sequence[int]) -> Block:
        """States that are the coordinates of these places."""
        factor = np.array([1.0 / self.w[i] if i < self.nf else 1.0 for i in places])  # eta instead of w eta
        names, units = zip(*(self.all[i] for i in places), strict=True)
        matrix = matrix * np.outer(factor, 1.0 / factor)
        return Block(
            x / factor, matrix, names, units, np.array([factor[j] * self.weights[i] for j, i in enumerate(places)])
        )

    def oscillator(self, v: Complex, s: complex, mode: int | None) -> Block:
        """`x1' = x2`, `x2' = -|s|^2 x1 + 2 Re(s) x2` of an eigenvector, `v = X1 + s X2`."""
        if mode is not None:
            v, (name, unit), weight = v / v[mode] * self.w[mode], self.all[mode], 1.0 / abs(s)
        else:
            i = int(np.argmax(np.abs(v / self.weights)))
            name, unit = self.all[i]
            if self.nf <= i < self.nf + self.nr:
                name, unit = f"nutation_{self.own[i - self.nf][0]}", self.own[i - self.nf][1]
            v, weight = v / v[i] * s, self.weights[i] / abs(s)
        second = v.imag / s.imag
        return Block(
            np.column_stack([v.real - s.real * second, second]), np.array([[0.0, 1.0], [-(abs(s) ** 2), 2.0 * s.real]]),
            (name, f"{name}_rate"), (unit, MODAL[1] if mode is not None else f"{unit}/s"), np.array([1.0, abs(s)]) * weight,
        )  # fmt: skip


def modal_form(
    modes: NormalModes,
    system: tuple[Array, Array, Array, Array],
    labels: Sequence[tuple[str, str]],
    names: Sequence[str],
    activations: Sequence[str] = (),
) -> ModalForm:
    """A craft's first-order system in modal blocks.

    Args:
        modes: its rigid motions and normal modes, which give the coordinates.
        system: A, B, C, D over (q, q', a).
        labels: name and unit of every degree of freedom.
        names: of the normal modes.
        activations: names of the actuators' states.
    """
    nr = modes.rigid.shape[1]
    own = [labels[i] for i in modes.pivots]
    there, back = modes.transformation(len(activations))
    a, b, c = back @ system[0] @ there, back @ system[1], system[2] @ there
    at = _Coordinates(modes, own, names, activations)
    inner = a[nr:, nr:]
    scaled = inner * np.outer(1.0 / at.weights, at.weights)
    top = max(float(np.abs(scaled).max(initial=0.0)), 1e-300)
    _, group = connected_components(np.abs(scaled) > APART * top, directed=False)
    rates: list[tuple[int, Block]] = []
    others: list[tuple[int, Block]] = []
    flexible: list[tuple[int, Block]] = []
    for k in range(int(group.max(initial=-1)) + 1):
        mine = np.flatnonzero(group == k)
        for key, block in _separated(scaled, mine, top, at):
            place = rates if key < 0 else flexible if key < at.nf else others
            place.append((key, block))
    blocks = [block for part in (rates, others, flexible) for _, block in sorted(part, key=lambda item: abs(item[0]))]
    n, count = a.shape[0], len(rates)
    basis, matrix = np.zeros((n, n)), np.zeros((n, n))
    basis[:nr, :nr] = np.eye(nr)
    start = nr
    for i, block in enumerate(blocks):
        mine = slice(start, start + len(block.names))
        basis[nr:, mine], matrix[mine, mine] = block.basis, block.matrix
        moved = a[:nr, nr:] @ block.basis  # what the block does to the rigid positions
        if i >= count and np.linalg.cond(block.matrix) < 1.0 / ZERO:
            basis[:nr, mine] = moved @ np.linalg.inv(block.matrix)
        else:
            matrix[:nr, mine] = np.where(np.abs(moved) > APART, moved, 0.0)
        start += len(block.names)
    weight = np.concatenate([1.0 / at.size, *(block.weight for block in blocks)])
    states = [*(f"rigid_{name}" for name, _ in own), *(name for block in blocks for name in block.names)]
    states = [
        name if states.index(name) == i else f"{name}_{states[:i].count(name) + 1}" for i, name in enumerate(states)
    ]
    return ModalForm(
        matrix, np.asarray(np.linalg.solve(basis * weight, b), dtype=np.float64) * weight[:, None], c @ basis, system[3],
        tuple(states),
        (*(unit for _, unit in own), *(unit for block in blocks for unit in block.units)), weight, (nr, count),
    )  # fmt: skip


def _separated(scaled: Array, mine: Ints, top: float, at: _Coordinates) -> "list[tuple[int, Block]]":
    """The blocks of coordinates that are coupled: key below 0: a rigid rate; below nf: that mode; above: another."""
    m = scaled[np.ix_(mine, mine)]
    size, n = mine.size, scaled.shape[0]

    def spread(x: "Array | Complex") -> Complex:
        out = np.zeros((n, *x.shape[1:]), dtype=np.complex128)
        out[mine] = x
        return (out.T * at.weights).T

    out: list[tuple[int, Block]] = []
    left, s, right = np.linalg.svd(m)
    null = int(np.sum(s <= ZERO * top))
    values, v = np.linalg.eig(left[:, : size - null].T @ m @ left[:, : size - null])
    v = left[:, : size - null] @ v
    simple = null == 0 or np.linalg.cond(left[:, size - null :].T @ right[size - null :].T) < SKEW
    if not simple or (size > null and np.linalg.cond(v) > SKEW):
        unit = spread(np.eye(size)).real / at.weights[mine]
        whole = at.alone(unit, m * np.outer(at.weights[mine], 1.0 / at.weights[mine]), [int(i) for i in mine])
        flexible = [int(i) for i in mine if i < at.nf]
        return [(min(flexible, default=at.nf), whole)]
    if null:
        basis, rows = _range(right[size - null :].T)
        for j, row in enumerate(rows):
            i = int(mine[row])
            key = -1 - (i - at.nf) if at.nf <= i < at.nf + at.nr else n
            column = spread(basis[:, [j]]).real / at.weights[i]
            out.append((key, Block(column, np.zeros((1, 1)), (at.all[i][0],), (at.all[i][1],), at.weights[[i]])))
    modes = [int(i) for i in mine if i < at.nf]
    swings = [k for k in range(values.size) if values[k].imag > 0.0]
    full = spread(v)
    amplitude = np.abs(full[np.ix_(modes, swings)]) / np.linalg.norm(v[:, swings], axis=0)
    chosen = (
        {swings[j]: modes[i] for i, j in zip(*linear_sum_assignment(-amplitude), strict=True)}
        if modes and swings
        else {}
    )
    for k in range(values.size):
        value = complex(values[k])
        if value.imag > 0.0:
            mode = chosen.get(k)
            out.append((n if mode is None else mode, at.oscillator(full[:, k], value, mode)))
        elif value.imag == 0.0:
            column = full[:, k].real
            i = int(np.argmax(np.abs(column / at.weights)))
            out.append(
                (
                    n,
                    Block(
                        (column / column[i])[:, None],
                        np.array([[value.real]]),
                        (at.all[i][0],),
                        (at.all[i][1],),
                        at.weights[[i]],
                    ),
                )
            )
    return out
