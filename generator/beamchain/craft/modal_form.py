"""A linear craft in real modal blocks: chains of integrators for rigid motion,
oscillators, what decays.

First order, over `(w eta, r', eta', a)` behind the rigid positions `r`, on which nothing
depends. Blocks that nothing couples are read off; those that damping or gyroscopic moments
couple are separated by their eigenvectors, or kept together, where a pole that oscillates in one
pose is real in another. A discrete plant is taken apart in the same way, by `(A - 1)/h` instead of
A.
"""

from collections import Counter
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

OSCILLATES = 2  # where blocks of oscillators stand in the order
APART = 1e-12  # relative: a smaller coupling is none
ZERO = 1e-11  # relative: smaller singular values are zero
SKEW = 1e7  # condition of eigenvectors beyond which blocks stay together
UNSEEN = 1e-12  # relative: less than this is driven or seen by nothing
# noise of a step's differences beside that of continuous time: the limits above are so much higher
SAMPLED = 100.0
MODAL = ("kg^0.5 m", "kg^0.5 m/s")  # units of the amplitude of a mode of unit mass, and of its rate


class _Coordinates(NamedTuple):
    """The coordinates `(w eta, r', eta', a)` behind the rigid positions: one entry for each.

    `states`: name and unit. `weight`: the size of each, so that they compare. `frequency`: w of the
    first of them [rad/s]. `rigid`: the number of rigid rates, which follow those.
    """

    states: list[tuple[str, str]]
    weight: Array
    frequency: Array
    rigid: int

    def is_flexible(self, i: int) -> bool:
        """Whether coordinate i is a `w eta`."""
        return i < self.frequency.size

    def is_rigid_rate(self, i: int) -> bool:
        """Whether coordinate i is an `r'`."""
        return self.frequency.size <= i < self.frequency.size + self.rigid

    def by_mode(self) -> list[int]:
        """All of them: rigid rates, actuators' states, each mode's `w eta` and its rate."""
        flexible = self.frequency.size
        rates = flexible + self.rigid  # the first eta'
        pairs = [i for k in range(flexible) for i in (k, rates + k)]
        return [*range(flexible, rates), *range(rates + flexible, len(self.states)), *pairs]


class Block(NamedTuple):
    """States that depend on no others.

    `order`: by which blocks are sorted: rigid rates (0; all coordinates, where they stay together),
    what decays (1), oscillators (2), then the coordinate. `basis`: a column per state, over the
    coordinates. `matrix`: of the states' rates. `states`: name and unit of each. `weight`: the size
    of each.
    """

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
        link = (link > self.limit * link.max(initial=1e-300)).astype(int)
        seen = np.abs(rows).max(axis=0) > self.limit
        driven = np.abs(columns).max(axis=1) > self.limit
        for _ in self.names:  # along chains of integrators, and within a block
            seen, driven = seen | (seen @ link > 0), driven | (link @ driven > 0)
        return seen & driven

    def oscillators(self, names: Sequence[str]) -> list[str]:
        """Those of the names that stand for a state and its rate."""
        return [name for name in names if {name, f"{name}_rate"} <= set(self.names)]

    def states_of(self, oscillator: str) -> list[int]:
        """Where an oscillator's amplitude and its rate stand among the states."""
        return [self.names.index(name) for name in (oscillator, f"{oscillator}_rate")]

    def poles_of(self, oscillator: str) -> NDArray[np.complex128]:
        """`(2,)` eigenvalues of an oscillator's block."""
        at = self.states_of(oscillator)
        return np.linalg.eigvals(self.a[np.ix_(at, at)]).astype(np.complex128)

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
        driven, pick = column_range(
            np.hstack([self.b[part] for part in parts]) / w[:, None], self.limit
        )
        driven = driven * w[:, None] / w[pick]  # all directions by those that are kept
        seen, among = column_range(
            np.vstack([_level(self.c[:, part] @ driven * w[pick]) for part in parts]).T, self.limit
        )
        # Z = C driven diag(w) = Z[:, among] seen^T, so that x' = diag(w[among]) seen^T diag(1/w) x
        onto = w[pick][among][:, None] * seen.T / w[pick]
        keep = [pick[i] for i in among]
        states = [2 * i + k for i in keep for k in (0, 1)] + list(range(chain, len(self.names)))
        out = self.picked(states, (len(keep), len(keep)))
        count = 2 * len(keep)
        for k, part in enumerate(parts):
            out.b[k:count:2] = onto @ self.b[part][pick]
            out.c[:, k:count:2] = self.c[:, part] @ driven[:, among]
        return out


def _level(rows: Array) -> Array:
    """Rows with 1 for their largest entry."""
    return rows / np.abs(rows).max(axis=1, keepdims=True, initial=1e-300)


def column_range(matrix: Array, limit: float) -> tuple[Array, list[int]]:
    """`(n, k)` basis of the columns of `(n, m)` which is the identity in k rows, and those rows."""
    u, s, _ = np.linalg.svd(matrix, full_matrices=False)
    u = u[:, s > limit * s[:1]]
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
    together: bool,
) -> ModalForm:
    """A craft's first-order system A, B, C, D over (q, q', a) in modal blocks;
    its normal modes give the coordinates.

    `labels`: name and unit of every degree of freedom. `names`: of the normal modes. `lags`: of the
    actuators' states. `noise`: of the system, beside that of continuous time. `together`: in one
    block, whose states are the coordinates themselves, whatever oscillates.
    """
    n_rigid = modes.rigid.shape[1]
    from_modal, to_modal = modes.transformation(len(lags))
    a = to_modal @ system[0] @ from_modal
    b = to_modal @ system[1]
    c = system[2] @ from_modal

    rigid_labels = [labels[i] for i in modes.pivots]
    rigid_size: Array = np.sqrt(np.diag(modes.rigid.T @ modes.mass @ modes.rigid))
    coordinates = _Coordinates(
        states=[
            *((name, MODAL[0]) for name in names),
            *((f"rigid_{name}_rate", f"{unit}/s") for name, unit in rigid_labels),
            *((f"{name}_rate", MODAL[1]) for name in names),
            *((name, "") for name in lags),
        ],
        weight=_weights(a[n_rigid:, n_rigid:], modes.frequency.size, rigid_size),
        frequency=modes.frequency,
        rigid=n_rigid,
    )
    blocks = (_one_block if together else _blocks)(a[n_rigid:, n_rigid:], coordinates, noise)
    basis, matrix = _in_blocks(a, blocks, n_rigid, noise)

    states = [(f"rigid_{name}", unit) for name, unit in rigid_labels]
    states += [state for block in blocks for state in block.states]
    first = [state for block in blocks if block.order[0] == 0 for state in block.states]
    rigid_rates = {f"rigid_{name}_rate" for name, _ in rigid_labels}
    of_mode = [False] * len(rigid_labels)
    of_mode += [block.order[0] == OSCILLATES for block in blocks for _ in block.states]
    weight = np.concatenate([1.0 / rigid_size, *(block.weight for block in blocks)])
    b_blocks = np.asarray(np.linalg.solve(basis * weight, b), dtype=np.float64)
    return ModalForm(
        a=matrix,
        b=b_blocks * weight[:, None],
        c=c @ basis,
        d=system[3],
        names=_numbered([name for name, _ in states], of_mode),
        units=tuple(unit for _, unit in states),
        weight=weight,
        rigid=(n_rigid, sum(name in rigid_rates for name, _ in first)),
        limit=UNSEEN * noise**1.5,
    )


def _weights(a: Array, n_flexible: int, rigid_size: Array) -> Array:
    """The size of every coordinate `(w eta, r', eta', a)`, of which `a` is the matrix: unit energy
    for what has mass; an actuator's state weighs what it accelerates."""
    weight = np.concatenate([np.ones(n_flexible), 1.0 / rigid_size, np.ones(n_flexible)])
    accelerated = np.abs(a[: weight.size, weight.size :]) / weight[:, None]
    return np.append(weight, 1.0 / accelerated.max(axis=0, initial=1e-300))


def _one_block(a: Array, coordinates: _Coordinates, noise: float) -> list[Block]:
    """All coordinates, of which `a` is the matrix, as states of one block, rigid rates first."""
    every = coordinates.by_mode()
    scaled = a * np.outer(1.0 / coordinates.weight, coordinates.weight)
    coupled = np.abs(scaled) > APART * noise * np.abs(scaled).max(initial=1e-300)
    block = _kept_together(np.where(coupled, scaled, 0.0)[np.ix_(every, every)], every, coordinates)
    basis = np.zeros_like(block.basis)
    basis[every] = block.basis * coordinates.weight[every][:, None]
    return [block._replace(order=(0, 0), basis=basis)]


def _blocks(a: Array, coordinates: _Coordinates, noise: float) -> list[Block]:
    """The blocks of the matrix `a` of the coordinates, sorted."""
    scaled = a * np.outer(1.0 / coordinates.weight, coordinates.weight)
    largest = float(np.abs(scaled).max(initial=1e-300))
    coupled = np.abs(scaled) > APART * noise * largest
    count, group_of = connected_components(coupled, directed=False)
    blocks: list[Block] = []
    for k in range(int(count)):
        group = np.flatnonzero(group_of == k)
        zero = ZERO * noise * largest
        for part in _separated(scaled[group][:, group], group.tolist(), coordinates, zero):
            basis = np.zeros((coordinates.weight.size, part.basis.shape[1]))
            basis[group] = part.basis * coordinates.weight[group][:, None]
            blocks.append(part._replace(basis=basis))
    return sorted(blocks, key=lambda block: block.order)


def _in_blocks(a: Array, blocks: list[Block], n_rigid: int, noise: float) -> tuple[Array, Array]:
    """`(n, n)` basis and matrix of the whole system, the rigid positions first.

    With the block's states z, y = X z, the rigid positions follow r' = R X z. Where the block's
    matrix Z has an inverse, r - R X Z^-1 z stands still and takes the place of r; otherwise R X
    remains in the matrix.
    """
    basis = np.eye(len(a))
    matrix = np.zeros(a.shape)
    start = n_rigid
    for block in blocks:
        columns = slice(start, start + len(block.states))
        basis[n_rigid:, columns] = block.basis
        matrix[columns, columns] = block.matrix
        rigid_rate = a[:n_rigid, n_rigid:] @ block.basis
        is_rigid = block.order[0] == 0
        if not is_rigid and np.linalg.cond(block.matrix) < 1.0 / ZERO:
            basis[:n_rigid, columns] = rigid_rate @ np.linalg.inv(block.matrix)
        else:
            seen = np.abs(rigid_rate) > APART * noise
            matrix[:n_rigid, columns] = np.where(seen, rigid_rate, 0.0)
        start = columns.stop
    return basis, matrix


def _numbered(names: list[str], of_mode: list[bool]) -> tuple[str, ...]:
    """The names, a repeated one with its number: `a, b, a` become `a, b, a_2`.

    States of modes are found by their names and keep them: what decays may be named after the
    same coordinate.
    """
    out = list(names)
    times = Counter[str]()
    for i in sorted(range(len(names)), key=lambda i: not of_mode[i]):
        times[names[i]] += 1
        if times[names[i]] > 1:
            out[i] = f"{names[i]}_{times[names[i]]}"
    return tuple(out)


def _separated(
    matrix: Array, group: list[int], coordinates: _Coordinates, zero: float
) -> list[Block]:
    """The blocks of coupled coordinates `group`, over those coordinates divided by their weights;
    `matrix` is theirs, `(n, n)`, and singular values up to `zero` are none.

    Eigenvectors separate what moves, the null space is what stands still; where either is too
    badly conditioned, the coordinates stay together.
    """
    left, singular, right = np.linalg.svd(matrix)
    rank = int(np.sum(singular > zero))
    image = left[:, :rank]
    still = right[rank:].T
    poles, vectors = np.linalg.eig(image.T @ matrix @ image)
    vectors = (image @ vectors).astype(np.complex128)
    if _is_skew(vectors) or _is_skew(left[:, rank:].T @ still):
        return [_kept_together(matrix, group, coordinates)]
    blocks = _standing_still(still, group, coordinates)

    flexible = [row for row, i in enumerate(group) if coordinates.is_flexible(i)]
    turning = [row for row, i in enumerate(group) if coordinates.is_rigid_rate(i)]
    oscillating = np.flatnonzero(np.imag(poles) > 0.0)
    mode_of = _modes_of(vectors, oscillating, flexible, turning)
    for k in range(rank):
        pole = complex(poles[k])
        vector = vectors[:, k]
        row = mode_of.get(k, int(np.argmax(np.abs(vector))))
        i = group[row]
        if pole.imag == 0.0:
            blocks.append(_decay(pole.real, vector / vector[row], i, coordinates))
        elif pole.imag > 0.0:  # its conjugate is the same block
            is_mode = k in mode_of
            oscillator = _oscillator(pole, vector / vector[row], i, coordinates, is_mode)
            blocks.append(oscillator)
    return blocks


def _is_skew(vectors: Array | NDArray[np.complex128]) -> bool:
    """Whether the columns are too nearly dependent to separate anything."""
    return vectors.size > 0 and bool(np.linalg.cond(vectors) > SKEW)


def _modes_of(
    vectors: NDArray[np.complex128],
    oscillating: NDArray[np.intp],
    flexible: list[int],
    turning: list[int],
) -> dict[int, int]:
    """The flexible row that each oscillating eigenvector is named after: of these and the rows of
    rigid rates, those in which their amplitudes are largest together.

    Nutation has a rigid row, and none here: an overdamped mode leaves its flexible row free.
    """
    candidates = [*flexible, *turning]
    share = np.abs(vectors[candidates][:, oscillating])
    share = share / np.linalg.norm(vectors[:, oscillating], axis=0)
    rows, columns = linear_sum_assignment(-share)
    return {
        int(oscillating[column]): flexible[row]
        for row, column in zip(rows, columns, strict=True)
        if row < len(flexible)
    }


def _kept_together(matrix: Array, group: list[int], coordinates: _Coordinates) -> Block:
    """All coordinates of a group in one block, eta in place of w eta."""
    factor = np.array(
        [
            1.0 / coordinates.frequency[i] if coordinates.is_flexible(i) else coordinates.weight[i]
            for i in group
        ]
    )
    flexible = [i for i in group if coordinates.is_flexible(i)]
    return Block(
        order=(OSCILLATES, flexible[0]) if flexible else (1, 0),
        basis=np.diag(1.0 / factor),
        matrix=matrix * np.outer(factor, 1.0 / factor),
        states=[coordinates.states[i] for i in group],
        weight=factor,
    )


def _standing_still(still: Array, group: list[int], coordinates: _Coordinates) -> list[Block]:
    """A block for each direction `(n, k)` in which a group does not move of itself."""
    if not still.size:
        return []
    basis, rows = column_range(still, 0.0)
    blocks: list[Block] = []
    for column, row in enumerate(rows):
        i = group[row]
        weight = coordinates.weight[[i]]
        blocks.append(
            Block(
                order=(0 if coordinates.is_rigid_rate(i) else 1, i),
                basis=basis[:, [column]] / weight,
                matrix=np.zeros((1, 1)),
                states=[coordinates.states[i]],
                weight=weight,
            )
        )
    return blocks


def _decay(pole: float, vector: NDArray[np.complex128], i: int, coordinates: _Coordinates) -> Block:
    """What decays along an eigenvector that is 1 in coordinate i."""
    weight = coordinates.weight[[i]]
    return Block(
        order=(1, i),
        basis=vector.real[:, None] / weight,
        matrix=np.array([[pole]]),
        states=[coordinates.states[i]],
        weight=weight,
    )


def _oscillator(
    pole: complex,
    vector: NDArray[np.complex128],
    i: int,
    coordinates: _Coordinates,
    is_mode: bool,
) -> Block:
    """An oscillator along a complex eigenvector that is 1 in coordinate i: an elastic mode, named
    after its w eta, or the nutation of a rigid rate.

    With its states x1 and x2 = x1', coordinates y = X1 x1 + X2 x2 and pole p:
    X1 + p X2 = x, and x2' = -|p|^2 x1 + 2 Re p x2.
    """
    name, unit = coordinates.states[i]
    speed = abs(pole)
    if is_mode:  # a mode's amplitude eta is 1
        order = (OSCILLATES, i)
        x = vector * coordinates.frequency[i]
        weight = 1.0 / speed
        units = (unit, MODAL[1])
    else:  # the angle whose rate is the coordinate is 1
        order = (1, i)
        x = vector * pole / coordinates.weight[i]
        weight = coordinates.weight[i] / speed
        name = name.replace("rigid_", "nutation_").removesuffix("_rate")
        units = (unit.removesuffix("/s"), unit)
    x2 = x.imag / pole.imag
    x1 = x.real - pole.real * x2
    return Block(
        order=order,
        basis=np.column_stack([x1, x2]),
        matrix=np.array([[0.0, 1.0], [-(speed**2), 2.0 * pole.real]]),
        states=[(name, units[0]), (f"{name}_rate", units[1])],
        weight=np.array([1.0, speed]) * weight,
    )
