"""An initial modal model from the data alone, mode by mode,
and the number of modes that the data support.

To the model found so far the mode is added whose pole, of those near peaks of the residuals'
spectrum, explains most of them in a least-squares fit of a few spectral lines; then all poles and
residues are refined together. A mode counts if it lowers the Bayesian information criterion (minus
twice the log likelihood, plus log(N) per parameter).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from beamchain.identification.likelihood import Likelihood
from beamchain.identification.response import Data, Piece, Raw, Spectrum, real_columns
from beamchain.identification.structure import delay_of_steps
from beamchain.toolkit import Array

MOST_MODES = 14
DAMPINGS = (0.0005, 0.002, 0.007, 0.02, 0.05)
WIDTHS = (1, 5, 25, 125, 625)  # lines over which the spectrum is smoothed to find peaks
# of a line, to either side of a peak: half a line is half a turn over the piece
BETWEEN = (-0.6, -0.3, 0.0, 0.3, 0.6)
PEAKS = 6  # per width
LINES = 160  # most spectral lines for one candidate
REACH = 6.0  # half widths of a resonance, or lines, on either side
PIECES = 3  # the longest, that are searched for peaks
ITERATIONS = 20
FEW_ITERATIONS = 7  # on the whole of a long log, to see whether a mode more is there
LAST_ITERATIONS = 25
ENOUGH = 30_000  # samples, with which the search in a long log begins
NOTHING = 1e-20  # mean square relative to the data that is none


class Order(NamedTuple):
    """A number of modes that was tried: criterion, likelihood gained over one mode fewer,
    frequencies and damping."""

    modes: int
    criterion: float
    gain: float
    frequencies: Array
    damping: Array


class InitialModel(NamedTuple):
    """The raw model, all orders tried, the best of them, the information in its parameters,
    and numbers per mode."""

    raw: Raw
    orders: tuple[Order, ...]
    better: int
    form: "Form"
    matrix: Array
    each: float


class Form:
    """Raw models as parameters: logarithms of frequency and damping, shape of the outputs,
    drive of the inputs, rigid part.

    Args:
        raw: a model whose residues give their size and, per mode, the output that moves most,
            whose shape is 1.
        rigid: size of the rigid part.
        step: [s] unit of the delay, which is a parameter if there are modes;
            that of a craft without modes would stand for their motion.
    """

    def __init__(self, raw: Raw, rigid: float, step: float) -> None:
        self.shape: tuple[int, ...] = raw.rigid.shape
        self.rigid: float = rigid
        self.step: float = step
        self.delay: float = raw.delay
        self.sizes: list[float] = [max(float(np.max(np.abs(g))), 1e-300) for g in raw.residues]
        self.lead: list[int] = [int(np.argmax(np.linalg.norm(g, axis=1))) for g in raw.residues]

    def raw(self, theta: Array) -> Raw:
        """The raw model of parameters."""
        p, m = self.shape
        n = len(self.sizes)
        width = 2 * (p + m)
        table = theta[: n * width].reshape(n, width)
        w = np.exp(table[:, 0])
        z = np.exp(table[:, 1])
        if not np.all(z < 1.0):
            raise ValueError("overdamped")
        shapes = np.ones((n, p), dtype=np.complex128)
        drives = np.zeros((n, m), dtype=np.complex128)
        for k, (size, lead) in enumerate(zip(self.sizes, self.lead, strict=True)):
            shapes[k, np.arange(p) != lead] = table[k, 2 : 1 + p] + 1j * table[k, 1 + p : 2 * p]
            drives[k] = size * (table[k, 2 * p : 2 * p + m] + 1j * table[k, 2 * p + m :])
        poles = w * (-z + 1j * np.sqrt(1.0 - z**2))
        residues = shapes[:, :, None] * drives[:, None, :]
        rigid = self.rigid * theta[n * width : n * width + p * m].reshape(p, m)
        delay = delay_of_steps(theta[-1], self.step) if n else self.delay
        return Raw(poles, residues, shapes, rigid, delay)

    def theta(self, raw: Raw) -> Array:
        """The parameters of a raw model; of a residue the part of one shape."""
        out = list[Array]()
        for pole, g, size, lead in zip(raw.poles, raw.residues, self.sizes, self.lead, strict=True):
            drive = g[lead]
            shape = np.delete(g @ drive.conj(), lead) / max(
                float(np.sum(np.abs(drive) ** 2)), 1e-300
            )
            drive = drive / size
            logs = np.log([abs(pole), max(-pole.real / abs(pole), 1e-7)])
            out += [logs, shape.real, shape.imag, drive.real, drive.imag]
        delay = [raw.delay / self.step] if self.sizes else []
        return np.concatenate([*out, raw.rigid.ravel() / self.rigid, delay])


def initial_model(
    pieces: Sequence[Data], rigid: Array, scale: Array, modes: int | None
) -> InitialModel:
    """Modes one after another until the criterion rises, or until there are as many as asked for.

    `rigid` `(p, m)` is a first guess of the accelerations of the frozen craft per torque, `scale`
    `(p,)` the size of the outputs.
    """
    size = float(np.max(np.abs(rigid)))
    part = beginnings(pieces)
    search = _Search(part, Raw.without_modes(rigid), scale, size)
    most = MOST_MODES if modes is None else modes + 1
    search.go(most, 2 if modes is None else most + 1, 2)
    if part is not pieces:
        first = search
        begin = search.better if modes is None else min(modes, len(search.models) - 1)
        search = _Search(pieces, first.models[begin], scale, size)
        search.prepend(first, begin)
        search.go(most, 1, 1, FEW_ITERATIONS)
    better = search.better
    final = search.models[better if modes is None else min(modes, len(search.models) - 1)].sorted()
    form = Form(final, size, time_unit(pieces))
    likelihood = Likelihood(pieces, form.raw, scale)
    weights = likelihood.weights(likelihood.squares(final))
    matrix = likelihood.normal(form.theta(final), weights)[1]
    return InitialModel(final, tuple(search.orders), better, form, matrix, search.each)


def time_unit(pieces: Sequence[Data]) -> float:
    """[s] a sample's step, of frequency responses the shortest time that they resolve."""
    first = pieces[0]
    if isinstance(first, Piece):
        return float(np.median(first.steps))
    return 1.0 / max(float(p.omega[-1]) for p in pieces if isinstance(p, Spectrum))


def rigid_model(pieces: Sequence[Data], rigid: Array, scale: Array) -> Raw:
    """The model without modes that fits best, on a part of long logs."""
    return refine(
        beginnings(pieces),
        Raw.without_modes(rigid),
        scale,
        float(np.max(np.abs(rigid))),
        ITERATIONS,
    )[0]


def beginnings(pieces: Sequence[Data]) -> Sequence[Data]:
    """The beginnings of long pieces, with which a search begins;
    the same pieces where they are short."""
    longest = longest_pieces(pieces)
    if not longest or sum(p.time.size for p in pieces if isinstance(p, Piece)) < 2 * ENOUGH:
        return pieces
    return [p.part(0, min(p.time.size, ENOUGH // len(longest))) for p in longest]


def longest_pieces(pieces: Sequence[Data]) -> list[Piece]:
    """The longest, that are searched for peaks."""
    return sorted((p for p in pieces if isinstance(p, Piece)), key=lambda p: -p.time.size)[:PIECES]


class _Search:
    """Modes added one after another on some pieces, from a model on."""

    def __init__(self, pieces: Sequence[Data], raw: Raw, scale: Array, size: float) -> None:
        self.pieces, self.scale, self.size = pieces, scale, size
        self.orders, self.models = list[Order](), list[Raw]()
        raw, self.cost, self.left, self.n = refine(pieces, raw, scale, size, LAST_ITERATIONS)
        # a free response per piece and mode is fitted too
        self.each = 2.0 * sum(raw.rigid.shape) + 2.0 * sum(
            isinstance(piece, Piece) for piece in pieces
        )
        self._add(raw, 0.0)

    @property
    def better(self) -> int:
        """Modes with the lowest criterion."""
        return min(self.orders, key=lambda one: one.criterion).modes

    def _add(self, raw: Raw, gain: float) -> None:
        w = np.abs(raw.poles)
        order = np.argsort(w)
        criterion = self.cost + self.each * w.size * np.log(self.n)
        self.orders.append(Order(w.size, criterion, gain, w[order], (-raw.poles.real / w)[order]))
        self.models.append(raw)

    def prepend(self, other: "_Search", modes: int) -> None:
        """Lower orders of a search on a part, as if they were of the whole."""
        ratio = self.n / other.n
        top = self.orders[0].criterion - other.orders[modes].criterion * self.n / other.n
        lower = [
            o._replace(criterion=top + ratio * o.criterion, gain=ratio * o.gain)
            for o in other.orders[:modes]
        ]
        self.orders = [*lower, self.orders[0]._replace(gain=ratio * other.orders[modes].gain)]
        self.models = [*other.models[:modes], self.models[0]]

    def go(self, most: int, failures: int, trials: int, iterations: int = ITERATIONS) -> None:
        """Add modes, up to `most`, until the criterion has risen `failures` times;
        `trials` poles are tried for each."""
        failed = 0
        while len(self.models) <= most and self.left > NOTHING and failed < failures:
            raw = self.models[-1]
            found = list[tuple[Raw, float, float, float]]()
            for pole in candidates(self.pieces, raw, self.scale)[:trials]:
                more = add_mode(raw, pole, self.pieces, self.scale)
                found.append(refine(self.pieces, more, self.scale, self.size, iterations))
                if found[-1][1] < self.cost - self.each * np.log(self.n):
                    break
            if not found:
                break
            raw, now, self.left, self.n = min(found, key=lambda one: one[1])
            gain, self.cost = self.cost - now, now
            self._add(raw, gain)
            failed = 0 if self.better == len(self.models) - 1 else failed + 1


def refine(
    pieces: Sequence[Data], raw: Raw, scale: Array, rigid: float, iterations: int
) -> tuple[Raw, float, float, float]:
    """The model refined, minus twice its log likelihood, mean square left relative to the data,
    and count of numbers."""
    form = Form(raw, rigid, time_unit(pieces))
    found = Likelihood(pieces, form.raw, scale).best(form.theta(raw), iterations)
    left = float(np.max(found.squares / np.maximum(found.counts, 1.0) / scale**2))
    return form.raw(found.theta), found.cost, left, float(found.counts.sum())


def add_mode(raw: Raw, pole: complex, pieces: Sequence[Data], scale: Array) -> Raw:
    """The model with one mode more, of the residue that fits best while all else is held."""
    p, m = raw.rigid.shape
    top = np.zeros((p, 2 * m, 2 * m))
    right = np.zeros((p, 2 * m))
    for piece in pieces:
        left = piece.assess(raw, 1.0 / scale)[1]
        if isinstance(piece, Spectrum):
            weight = piece.weight * np.exp(-1j * piece.omega * raw.delay)
            a = weight / (1j * piece.omega - pole)
            b = weight / (1j * piece.omega - pole.conjugate())
            table = np.column_stack([a + b, 1j * (a - b)])
            at = [2 * piece.input, 2 * piece.input + 1]
            top[piece.output][np.ix_(at, at)] += (table.conj().T @ table).real
            right[piece.output][at] += (table.conj().T @ left).real
            continue
        driven = piece.state(pole, piece.held(raw.delay), slopes=False).value
        free = piece.free(pole)
        for i in range(p):
            use = piece.use[:, i]
            forced = real_columns(piece.read(driven, i))[use]
            moves = real_columns(piece.read(free, i)[:, None])
            basis = np.column_stack([moves, piece.constants(i)])[use]
            solved = np.linalg.lstsq(basis.T @ basis, basis.T @ forced)[0]
            forced = forced - basis @ solved
            top[i] += forced.T @ forced
            right[i] += forced.T @ left[use, i]
    g = np.array([np.linalg.lstsq(a, b)[0] for a, b in zip(top, right, strict=True)]).reshape(
        p, m, 2
    )
    shapes, values, drives = np.linalg.svd(g[..., 0] + 1j * g[..., 1])
    shape = shapes[:, 0] / shapes[int(np.argmax(np.abs(shapes[:, 0]))), 0]
    residue = values[0] * shapes[:, :1] @ drives[:1]
    return raw._replace(
        poles=np.append(raw.poles, pole),
        residues=np.concatenate([raw.residues, residue[None]]),
        shapes=np.concatenate([raw.shapes, shape[None]]),
    )


def candidates(pieces: Sequence[Data], raw: Raw, scale: Array) -> list[complex]:
    """Poles near peaks of the residuals' spectrum, that explains most first;
    of each stretch of the spectrum the best."""
    found = dict[complex, float]()
    weights = 1.0 / scale
    for piece in longest_pieces(pieces):
        for pole, gain in _of_piece(piece, piece.assess(raw, weights)[1] * weights):
            found[pole] = found.get(pole, 0.0) + gain
    tables = [(p, p.assess(raw, weights)[1], p.weight) for p in pieces if isinstance(p, Spectrum)]
    omega = np.unique(np.concatenate([np.zeros(0), *(p.omega for p, _, _ in tables)]))
    for w in omega[:: max(1, omega.size // 800)]:
        for z in DAMPINGS:
            pole = complex(-z * w, w)
            gain = 0.0
            for p, left, weight in tables:
                near = np.abs(p.omega - w) < max(
                    REACH * z * w, REACH * float(np.median(np.diff(p.omega)))
                )
                if near.any():
                    shape = weight[near] / (1j * p.omega[near] - pole)
                    gain += float(abs(np.vdot(shape, left[near])) ** 2 / np.vdot(shape, shape).real)
            found[pole] = gain
    out = list[complex]()
    for pole in sorted(found, key=lambda one: -found[one]):
        if all(abs(abs(pole) - abs(other)) > 0.02 * abs(pole) for other in out):
            out.append(pole)
    return out


def _of_piece(piece: Piece, left: Array) -> list[tuple[complex, float]]:
    n = piece.time.size
    h = float(piece.time[-1] - piece.time[0]) / (n - 1)
    u = piece.inputs
    if not piece.even:
        grid = piece.time[0] + h * np.arange(n)
        left, u = (
            np.column_stack([np.interp(grid, piece.time, one) for one in table.T])
            for table in (left, u)
        )
    angles = np.array(piece.kinds) == "attitude"
    rate = np.where(angles, np.gradient(left, h, axis=0), left)
    lines = np.fft.rfft(rate, axis=0)
    torque = np.fft.rfft(u, axis=0)
    omega = 2.0 * np.pi * np.arange(lines.shape[0]) / (n * h)
    step = omega[1]
    smooth = np.abs(lines[1:-1] - (lines[:-2] + lines[2:]) / 2.0) ** 2  # Hann's window
    energy = np.concatenate([[0.0], smooth.sum(axis=1), [0.0]])
    floor = float(np.median(energy[1:-1])) + 1e-300
    trials = list[complex]()
    for width in WIDTHS:
        if width > n // 16 and width > 1:
            break
        level = (uniform_filter1d(energy, width) - floor) * width
        top = (
            np.flatnonzero(
                (level[1:-1] >= level[:-2]) & (level[1:-1] >= level[2:]) & (level[1:-1] > 0.0)
            )
            + 1
        )
        for i in top[np.argsort(level[top])[::-1][:PEAKS]]:
            trials += [
                complex(-z, 1.0) * (omega[i] + part * step) for z in DAMPINGS for part in BETWEEN
            ]
    out = list[tuple[complex, float]]()
    for pole in trials:
        reach = max(REACH * step, -REACH * pole.real)
        low = int(max((pole.imag - reach) / step, 1))
        high = int(min((pole.imag + reach) / step + 2, omega.size - 1))
        stride = max(1, (high - low) // LINES)
        pick = np.arange(low, high, stride)
        if pick.size < u.shape[1] + 3:
            continue
        z = np.exp(1j * omega[pick] * h)
        p = np.exp(pole * h)
        table = np.column_stack([torque[pick] * ((p - 1.0) / pole / (z - p))[:, None], z / (z - p)])
        q, _ = np.linalg.qr(table / np.maximum(np.linalg.norm(table, axis=0), 1e-300))
        out.append((pole, stride * float(np.sum(np.abs(q.conj().T @ lines[pick]) ** 2))))
    return out
