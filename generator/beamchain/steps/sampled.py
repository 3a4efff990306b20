"""The response at the step: positions of a body at the samples, per wrench held over each step,
of a file and exactly.

Both are scaled by `2 (z - 1)^2 / (h^2 (z + 1))`,
with which the sampled rigid response is the rigid accelerance.

Theory: docs/theory.md, section 5; the definition of the error: docs/time.md.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import schur

from beamchain.engine.linear import Linear, Signal
from beamchain.ports.compare import grid_of, relative_error
from beamchain.ports.motions import Array
from beamchain.steps.integrators import Complex
from beamchain.steps.step_map import Motion

FAR = 1000.0  # times the band: modes of the whole craft beyond act by their static shapes only
FASTEST = 2.6  # rad per step up to which the response is looked at
LOOSE = 1e-12  # of the largest damping, or of the fastest pole: rounding
SEEN = 1e-4  # of the rigid response: peaks of modes beyond the band that are lower are not resolved
BLOCK = 2000  # frequencies worked on at a time
SHARPER = 3  # times that the neighbourhood of the largest error is looked at more closely
POINTS = 21  # there

Responder = Callable[[Complex], NDArray[np.complex128]]


@dataclass(frozen=True, eq=False)
class Response:
    """A sampled response `(k, m, m)` at `z - 1` `(k,)`,
    and its poles `s` [1/s] with the size of their peaks.

    `lost` `(n,)`: by how much further to the left its poles lie with damping that they lack [1/s].
    """

    at: Responder
    poles: Complex
    peaks: Array
    lost: Array


def exact_response(exact: Linear, timestep: float, lacking: Array | None = None) -> Response:
    """The exact motion under a wrench held over each step, in closed form, mode by mode.

    `exact`: pushed and looked at in the same motions of a body; `lacking` `(nv, nv)`: damping that
    it is compared with and does not have, None for nothing.
    """
    h = timestep
    rows = exact.outputs.acceleration
    modes = exact.modes()
    w, shapes = modes.frequency, modes.shapes
    inertia = np.linalg.cholesky(modes.rigid.T @ exact.mass @ modes.rigid)
    rigid = modes.rigid @ np.linalg.inv(inertia).T  # of unit mass
    nothing = LOOSE * np.max(np.abs(shapes.T @ exact.damping @ shapes), initial=1e-300)
    values, turn = np.linalg.eigh(rigid.T @ exact.damping @ rigid)
    free = rows @ rigid @ turn[:, values <= nothing]
    dragged = rigid @ turn[:, values > nothing]  # motions that dampers hold, but no spring
    p = rows @ shapes
    loose = rows @ dragged
    n, m = w.size, loose.shape[1]
    held = np.hstack([shapes, dragged])
    # states (w y, y', rates of what is loose):
    # they do not feel where the loose motions have come to
    flow = np.zeros((2 * n + m, 2 * n + m))
    flow[:n, n : 2 * n], flow[n : 2 * n, :n] = np.diag(w), -np.diag(w)
    flow[n:, n:] = -held.T @ exact.damping @ held
    poles, vectors, back = _eigenvectors(flow.tobytes())
    lost = np.zeros(poles.size)
    if lacking is not None:
        # d s = -l^T C r of a pole's left and right vectors
        push = held.T @ lacking @ held @ vectors[n:]
        lost = np.sum(back[:, n:] * push.T, axis=1).real
        # what is faster than the samples decays at once by all that it lacks
        fast = np.abs(poles.imag) * h > np.pi
        poles = poles - np.where(fast, lost, 0.0)
    into = back[:, n:] @ np.vstack([p.T, loose.T])  # (poles, inputs)
    of_modes = (p / w) @ vectors[:n]  # (outputs, poles)
    of_loose = loose @ vectors[2 * n :]
    turned = np.expm1(poles * h)
    count = rows.shape[0]
    # a pole's transfer 1/(s - a), and 1/(s (s - a)) of what is loose,
    # for an input held over the step
    weight = turned / poles
    first = np.einsum("ik,kj->kij", of_modes + of_loose / poles, into) * weight[:, None, None]
    second = -h * np.einsum("ik,kj->ij", of_loose / poles, into)
    table = first.reshape(poles.size, count**2)
    still = (free @ free.T).reshape(1, -1)

    def at(step: Complex) -> NDArray[np.complex128]:
        factor = (2.0 * step**2 / (h**2 * (step + 2.0)))[:, None]
        summed = (1.0 / (step[:, None] - turned[None, :])) @ table + second.reshape(1, -1) / step[
            :, None
        ]
        return (still + factor * summed).reshape(-1, count, count)

    ends = np.where(np.abs(turned + 2.0) > 1e-3, np.abs(turned + 2.0), 1e-3)
    gap = np.maximum(1.0 - np.exp(poles.real * h), 1e-12)
    peaks = np.linalg.norm(first, axis=(1, 2)) / gap * 2.0 * np.abs(turned) ** 2 / (h**2 * ends)
    return Response(at, poles, peaks, lost)


class Exact:
    """An exact motion up to a band [rad/s], to be held against several steps.

    Args:
        stated: pushed and looked at in the motions that count, with every mode.
        compared: the same with the damping at which errors are compared.
        band: modes of the whole that are far beyond act by their static shapes only.
        own: how many of the first coordinates are the craft's, not modes of appendages.
    """

    def __init__(self, stated: Linear, compared: Linear, band: float, own: int) -> None:
        self.band: float = band
        # gathered as a whole, not appendage by appendage: what a heavy body on a port moves on is
        # the flexibility of modes that are far beyond the band while the body is not there
        shapes = stated.shapes_up_to(FAR * band, own)
        names = tuple(Signal(f"shape {k + 1}", "") for k in range(shapes.shape[1]))
        self._near: Linear = stated.in_coordinates(shapes, names)
        self._lacking: Array = shapes.T @ (compared.damping - stated.damping) @ shapes
        self._last: tuple[float, Response] | None = None

    def __getstate__(self) -> dict[str, Any]:  # a response is a function, which does not travel
        return vars(self) | {"_last": None}

    def at_step(self, timestep: float) -> Response:
        """The response at a step [s]; that of the last one is known."""
        if self._last is None or self._last[0] != timestep:
            self._last = timestep, exact_response(self._near, timestep, self._lacking)
        return self._last[1]


@lru_cache(maxsize=2)  # one craft is looked at with many steps, and they do not change its motion
def _eigenvectors(matrix: bytes) -> tuple[Complex, Complex, Complex]:
    """Eigenvalues, right and left eigenvectors of a square matrix."""
    entries = np.frombuffer(matrix)
    values, vectors = np.linalg.eig(entries.reshape(2 * [round(np.sqrt(entries.size))]))
    vectors = vectors.astype(np.complex128)
    back = np.asarray(np.linalg.inv(vectors), dtype=np.complex128)
    return values.astype(np.complex128), vectors, back


def step_response(motion: Motion, rows: Array) -> Response:
    """What a compiled file does, stepped with the mean of this and the last wrench;
    RK4 with the wrench itself.

    `rows` `(m, nv)`: motion of the body.
    """
    h, n = motion.timestep, motion.squares.size
    seen = rows @ motion.shapes
    free = seen[:, : motion.loose]
    mine = seen[:, motion.loose :]
    pick = np.concatenate([np.arange(motion.loose, n), n + np.arange(motion.loose, n)])
    # positions in units of the rates they go with: slow poles are lost without
    phase = h * np.sqrt(np.abs(motion.squares[motion.loose :]))
    unit = np.where(phase > 0.0, phase, 1.0)
    scale = np.concatenate([unit, np.ones(unit.size)])
    difference = scale[:, None] * motion.difference[np.ix_(pick, pick)] / scale
    triangle, turn = schur(difference, output="complex")
    pushed = scale[:, None] * motion.drive[np.ix_(pick, np.arange(motion.loose, n))]
    drive = np.conj(turn.T) @ pushed @ mine.T
    out = np.hstack([mine / unit, np.zeros_like(mine)]) @ turn
    mean = motion.integrator != "RK4"
    count = rows.shape[0]

    def at(step: Complex) -> NDArray[np.complex128]:
        solved = np.zeros((step.size, drive.shape[0], count), dtype=np.complex128)
        # (z - 1) x - T x = b, from the last row upwards
        for i in range(drive.shape[0] - 1, -1, -1):
            right = drive[i] + np.einsum("j,kjm->km", triangle[i, i + 1 :], solved[:, i + 1 :])
            solved[:, i] = right / (step - triangle[i, i])[:, None]
        factor = 2.0 * step**2 / (h**2 * (step + 2.0))
        if mean:
            factor = factor * (step + 2.0) / (2.0 * (1.0 + step))
        return free @ free.T + factor[:, None, None] * np.einsum("oi,kim->kom", out, solved)

    shown = 1.0 + np.diag(triangle).astype(np.complex128)
    poles = np.asarray(np.log(shown[np.abs(shown) > 1e-14]) / h, dtype=np.complex128)
    return Response(at, poles, np.full(poles.size, np.inf), np.zeros(poles.size))


@dataclass(frozen=True)
class SampledError:
    """The in-band error of the response at the step,
    and the frequency at which it is largest [rad/s]."""

    error: float
    frequency: float


def represents(timestep: float, band: float) -> bool:
    """Whether a step [s] is judged up to all of a band [rad/s]."""
    return band * timestep <= FASTEST


def judged_part(timestep: float, band: float) -> str:
    """Up to which frequency a step is judged, as the end of a sentence, and the longest step that
    represents the band; empty where this one does.

    Example:
        >>> judged_part(0.5, 64.57)
        ', judged up to 5.2 rad/s: a band up to 64.57 rad/s needs a step of 0.04025 s or less'
    """
    if represents(timestep, band):
        return ""
    longest = (1.0 - 5e-4) * FASTEST / band  # so that it still does with four digits
    return (
        f", judged up to {FASTEST / timestep:.4g} rad/s: a band up to {band:.4g} rad/s needs a "
        f"step of {longest:.4g} s or less"
    )


def off_by(error: float) -> str:
    """How far a motion is off, in words."""
    return f"by {error:.2e}" if np.isfinite(error) else "without bound, since the step is unstable"


def sampled_error(
    exact: Exact,
    motion: Motion,
    rows: Array,
    *,
    scale: Array,
    frozen: float,
) -> SampledError:
    """The in-band error of a file at its own step, up to the band of `exact` and below 2.6 rad per
    step.

    Infinite where the step is unstable.

    `scale` `(m, m)`, `frozen`: what makes the accelerance dimensionless, and the norm of the
    rigid one, as in the error in continuous time. Both responses are taken at
    `z = exp((j + d) w h)`, with d the damping ratio that the exact pole nearest to w lacks of that
    at which it is compared: none but below the least ratio.
    """
    if motion.grows:  # what grows has no response
        return SampledError(float("inf"), 0.0)
    h = motion.timestep
    truth = exact.at_step(h)
    ours = step_response(motion, rows)
    top = min(exact.band, FASTEST / h)
    seen = truth.peaks * float(np.max(scale)) > SEEN * frozen
    turns = np.round(truth.poles[seen].imag * h / (2.0 * np.pi))
    # where the samples show a mode that is faster than they are
    aliases = truth.poles[seen] - 2j * np.pi * turns / h
    ringing = truth.poles.imag > 0.0
    places = truth.poles.imag[ringing]
    shifts = truth.lost[ringing] / places

    def shift(omega: Array) -> Array:
        if not places.size:
            return np.zeros(omega.size)
        return shifts[np.argmin(np.abs(omega[:, None] - places), axis=1)]

    def error(omega: Array) -> Array:
        parts = []
        for first in range(0, omega.size, BLOCK):
            some = omega[first : first + BLOCK]
            step = np.expm1((1j + shift(some)) * some * h)
            parts.append(relative_error(ours.at(step) * scale, truth.at(step) * scale, frozen))
        return np.concatenate(parts)

    known = [_peaks(poles, shift) for poles in (truth.poles, aliases, ours.poles)]
    omega = grid_of(known, top)
    found = error(omega)
    for _ in range(SHARPER):
        k = int(np.argmax(found))
        near = omega[max(k - 1, 0) : k + 2]
        more = np.linspace(near[0], near[-1], POINTS)
        omega, order = np.unique(np.concatenate([omega, more]), return_index=True)
        found = np.concatenate([found, error(more)])[order]
    k = int(np.argmax(found))
    return SampledError(float(found[k]), float(omega[k]))


def _peaks(poles: Complex, shift: Callable[[Array], Array]) -> Array:
    """Frequency [rad/s] and ratio of the peaks of poles `(n,)` above the real axis."""
    above = poles[(poles.imag >= 0.0) & (np.abs(poles) > 0.0)]
    size = np.abs(above)
    return np.column_stack([size, np.clip(-above.real / size, 0.0, 1.0) + shift(size)])
