"""A linear craft in real modal blocks: chains of integrators for rigid motion,
oscillators, what decays.

First order, over `(w eta, r', eta', a)` behind the rigid positions `r`, on which nothing
depends. Blocks that nothing couples are read off; those that damping or gyroscopic moments
couple are separated by their eigenvectors. A discrete plant is taken apart in the same way, by
`(A - 1)/h` instead of A.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr
from scipy.optimize import linear_sum_assignment
from scipy.sparse.csgraph import connected_components

from beamchain.engine.normal_modes import NormalModes
from beamchain.ports.motions import Array

Flags = NDArray[np.bool_]

APART = 1e-12  # relative: a smaller coupling is none
ZERO = 1e-11  # relative: smaller singular values are zero
SKEW = 1e7  # condition of eigenvectors beyond which blocks stay together
UNSEEN = 1e-12  # relative: less than this is driven or seen by nothing
# noise of a step's differences beside that of continuous time: the limits above are so much higher
SAMPLED = 100.0
MODAL = ("kg^0.5 m", "kg^0.5 m/s")  # units of the amplitude of a mode of unit mass, and of its rate


class Block(NamedTuple):
    """States that depend on no others: order, columns over the coordinates, matrix,
    (name, unit) each, size each."""

    order: tuple[int, int]
    basis: Array
    matrix: Array
    states: list[tuple[str, str]]
    weight: Array


@dataclass(frozen=True, eq=False)
class ModalForm:
    """All states of a craft: rigid positions, rigid rates, what else there is, oscillators by mode.

    `weight` is the size of each state, so that they compare; `rigid` the number of rigid positions,
    and of rigid rates; relatively below `limit` nothing is driven or seen.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    names: tuple[str, ...]
    units: tuple[str, ...]
    weight: Array
    rigid: tuple[int, int]
    limit: float = UNSEEN

    def active(self) -> Flags:
        """`(states,)` which states something drives and something sees."""
        rows = _level(self.c * self.weight)
        columns = _level((self.b / self.weight[:, None]).T).T
        link = np.abs(self.a) * np.outer(1.0 / self.weight, self.weight)
        link = (link > self.limit * max(float(link.max(initial=0.0)), 1e-300)).astype(int)
        seen = np.abs(rows).max(axis=0) > self.limit
        driven = np.abs(columns).max(axis=1) > self.limit
        for _ in range(3):  # along a chain of integrators, and within a block
            seen, driven = seen | (seen @ link > 0), driven | (link @ driven > 0)
        return seen & driven

    def oscillators(self, names: Sequence[str]) -> list[str]:
        """Those of the names that stand for a state and its rate."""
        return [name for name in names if {name, f"{name}_rate"} <= set(self.names)]

    def minimal(self) -> "ModalForm":
        """Only the states that something drives and something sees."""
        return self.reduced(self.active()).spanned()

    def picked(self, pick: list[int], rigid: tuple[int, int]) -> "ModalForm":
        """Some of the states, in this order."""
        names, units = (tuple(words[i] for i in pick) for words in (self.names, self.units))
        a = self.a[np.ix_(pick, pick)]
        b = self.b[pick]
        c = self.c[:, pick]
        weight = self.weight[pick]
        return replace(self, a=a, b=b, c=c, names=names, units=units, weight=weight, rigid=rigid)

    def reduced(self, keep: Flags) -> "ModalForm":
        """Only the states that are kept; a rigid rate stands behind its position."""
        first = self.rigid[0]
        chain = sum(self.rigid)
        at = {f"{name}_rate": i for i, name in enumerate(self.names[:first])}
        order = sorted(range(chain), key=lambda i: (at.get(self.names[i], i), i))
        pick = [i for i in [*order, *range(chain, len(self.names))] if keep[i]]
        return self.picked(pick, (int(np.sum(keep[:first])), int(np.sum(keep[first:chain]))))

    def spanned(self) -> "ModalForm":
        """Double integrators of fewer directions where the inputs drive,
        or the outputs see, no more."""
        first = self.rigid[0]
        chain = 2 * self.rigid[0]
        ideal = np.kron(np.eye(first), [[0.0, 1.0], [0.0, 0.0]])
        if (
            self.rigid[0] != self.rigid[1]
            or not chain
            or not np.allclose(self.a[:chain, :chain], ideal)
        ):
            return self
        parts = slice(0, chain, 2), slice(1, chain, 2)
        w = self.weight[parts[1]]
        driven, pick = _range(np.hstack([self.b[part] for part in parts]) / w[:, None], self.limit)
        driven = driven * w[:, None] / w[pick]  # all directions by those that are kept
        seen, among = _range(
            np.vstack([_level(self.c[:, part] @ driven * w[pick]) for part in parts]).T, self.limit
        )
        onto = seen.T * w[pick] / w[pick][among][:, None]
        keep = [pick[i] for i in among]
        states = [2 * i + k for i in keep for k in (0, 1)] + list(range(chain, len(self.names)))
        out = self.picked(states, (len(keep), len(keep)))
        count = 2 * len(keep)
        for k, part in enumerate(parts):
            out.b[k:count:2], out.c[:, k:count:2] = (
                onto @ self.b[part][pick],
                self.c[:, part] @ driven[:, among],
            )
        return out


def _level(rows: Array) -> Array:
    """Rows with 1 for their largest entry."""
    return rows / np.maximum(np.abs(rows).max(axis=1, keepdims=True, initial=0.0), 1e-300)


def _range(matrix: Array, limit: float) -> tuple[Array, list[int]]:
    """`(n, k)` basis of the columns of `(n, m)` which is the identity in k rows, and those rows."""
    u, s, _ = np.linalg.svd(matrix, full_matrices=False)
    u = u[:, s > limit * s.max(initial=0.0)]
    _, _, order = qr(u.T, pivoting=True, mode="economic")
    rows = sorted(int(i) for i in order[: u.shape[1]])
    return np.asarray(u @ np.linalg.inv(u[rows]), dtype=np.float64), rows


def modal_form(
    modes: NormalModes,
    system: tuple[Array, Array, Array, Array],
    labels: Sequence[tuple[str, str]],
    names: Sequence[str],
    lags: Sequence[str],
    noise: float,
) -> ModalForm:
    """A craft's first-order system A, B, C, D over (q, q', a) in modal blocks;
    its normal modes give the coordinates.

    `labels`: name and unit of every degree of freedom. `names`: of the normal modes. `lags`: of the
    actuators' states. `noise`: of the system, beside that of continuous time.
    """
    nr = modes.rigid.shape[1]
    nf = modes.frequency.size
    own = [labels[i] for i in modes.pivots]
    there, back = modes.transformation(len(lags))
    a = back @ system[0] @ there
    b = back @ system[1]
    c = system[2] @ there
    size: Array = np.sqrt(np.diag(modes.rigid.T @ modes.mass @ modes.rigid))
    weights = np.concatenate([np.ones(nf), 1.0 / size, np.ones(nf)])
    push = np.abs(a[nr : nr + weights.size, nr + weights.size :] / weights[:, None]).max(
        axis=0, initial=1e-300
    )
    weights = np.append(weights, 1.0 / push)  # an actuator's state weighs what it accelerates
    words = [
        *((name, MODAL[0]) for name in names),
        *((f"rigid_{name}_rate", f"{unit}/s") for name, unit in own),
        *((f"{name}_rate", MODAL[1]) for name in names),
        *((name, "") for name in lags),
    ]
    scaled = a[nr:, nr:] * np.outer(1.0 / weights, weights)
    top = max(float(np.abs(scaled).max(initial=0.0)), 1e-300)
    count, group = connected_components(np.abs(scaled) > APART * noise * top, directed=False)
    blocks: list[Block] = []
    for k in range(int(count)):
        mine = np.flatnonzero(group == k)
        m = scaled[mine][:, mine]
        for part in _separated(
            m, [int(i) for i in mine], ZERO * noise * top, modes.frequency, nr, words, weights
        ):
            basis = np.zeros((weights.size, part.basis.shape[1]))
            basis[mine] = part.basis * weights[mine][:, None]
            blocks.append(part._replace(basis=basis))
    blocks.sort(key=lambda block: block.order)
    basis = np.eye(a.shape[0])
    matrix = np.zeros(a.shape)
    start = nr
    rates = 0
    for block in blocks:
        mine = slice(start, start + len(block.states))
        basis[nr:, mine], matrix[mine, mine] = block.basis, block.matrix
        moved = a[:nr, nr:] @ block.basis  # what the block does to the rigid positions
        rates += block.order[0] == 0
        if block.order[0] and np.linalg.cond(block.matrix) < 1.0 / ZERO:
            basis[:nr, mine] = moved @ np.linalg.inv(block.matrix)
        else:
            matrix[:nr, mine] = np.where(np.abs(moved) > APART * noise, moved, 0.0)
        start = mine.stop
    weight = np.concatenate([1.0 / size, *(block.weight for block in blocks)])
    states = [
        *((f"rigid_{name}", unit) for name, unit in own),
        *(state for block in blocks for state in block.states),
    ]
    said = [name for name, _ in states]
    said = [
        name if said.index(name) == i else f"{name}_{said[:i].count(name) + 1}"
        for i, name in enumerate(said)
    ]
    b = np.asarray(np.linalg.solve(basis * weight, b), dtype=np.float64) * weight[:, None]
    units = tuple(unit for _, unit in states)
    return ModalForm(
        matrix,
        b,
        c @ basis,
        system[3],
        tuple(said),
        units,
        weight,
        (nr, rates),
        UNSEEN * noise**1.5,
    )


def _separated(
    m: Array,
    mine: list[int],
    zero: float,
    w: Array,
    nr: int,
    words: list[tuple[str, str]],
    weights: Array,
) -> list[Block]:
    """The blocks of coupled coordinates `mine`, over those coordinates divided by their weights."""
    nf = w.size
    size = len(mine)
    own = weights[mine]
    left, s, right = np.linalg.svd(m)
    live = int(np.sum(s > zero))
    values, v = np.linalg.eig(left[:, :live].T @ m @ left[:, :live])
    v = (left[:, :live] @ v).astype(np.complex128)
    flexible = [j for j in range(size) if mine[j] < nf]
    together = np.linalg.cond(v) > SKEW if live else False
    if together or (live < size and np.linalg.cond(left[:, live:].T @ right[live:].T) > SKEW):
        # eta instead of w eta
        factor = np.array([1.0 / w[i] if i < nf else weights[i] for i in mine])
        order = (2, mine[flexible[0]]) if flexible else (1, 0)
        states = [words[i] for i in mine]
        return [
            Block(order, np.diag(1.0 / factor), m * np.outer(factor, 1.0 / factor), states, factor)
        ]
    out: list[Block] = []
    if live < size:
        basis, rows = _range(right[live:].T, 0.0)
        for j, row in enumerate(rows):
            i = mine[row]
            order = (0, i) if nf <= i < nf + nr else (1, i)
            out.append(
                Block(order, basis[:, [j]] / own[row], np.zeros((1, 1)), [words[i]], own[[row]])
            )
    swings = [k for k in range(live) if values[k].imag > 0.0]
    amplitude = np.abs(v[flexible][:, swings]) / np.linalg.norm(v[:, swings], axis=0)
    chosen = {
        swings[j]: flexible[i] for i, j in zip(*linear_sum_assignment(-amplitude), strict=True)
    }
    for k in range(live):
        pole = complex(values[k])
        x = v[:, k]
        j = chosen.get(k, int(np.argmax(np.abs(v[:, k]))))
        (name, unit), i = words[mine[j]], mine[j]
        if pole.imag == 0.0:
            out.append(
                Block(
                    (1, i),
                    (x / x[j]).real[:, None] / own[j],
                    np.array([[pole.real]]),
                    [words[i]],
                    own[[j]],
                )
            )
        if pole.imag <= 0.0:
            continue
        if k in chosen:  # amplitude 1
            order, x, weight, rate = (2, i), x / x[j] * w[i], 1.0 / abs(pole), MODAL[1]
        else:
            order, x, weight, rate = (1, i), x / x[j] * pole / own[j], own[j] / abs(pole), unit
            name, unit = (
                name.replace("rigid_", "nutation_").removesuffix("_rate"),
                unit.removesuffix("/s"),
            )
        second = x.imag / pole.imag
        basis = np.column_stack([x.real - pole.real * second, second])  # x1' = x2, x = X1 + pole X2
        matrix = np.array([[0.0, 1.0], [-(abs(pole) ** 2), 2.0 * pole.real]])
        states = [(name, unit), (f"{name}_rate", rate)]
        out.append(Block(order, basis, matrix, states, np.array([1.0, abs(pole)]) * weight))
    return out
