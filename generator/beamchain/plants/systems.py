"""State spaces as four arrays: feedback closed, states that take no part removed, responses."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, schur, solve_sylvester

from beamchain.ports.motions import Array

System = tuple[Array, Array, Array, Array]
Complex = NDArray[np.complex128]
UNSEEN = 1e-11  # relative, below which a state takes no part
LINKED = 1e-14  # of the largest in its row, below which an element of A is rounding
CHUNK = 100  # frequencies that are solved together
GROWS = 1e-9  # growth of a pole relative to the fastest one, below which it is rounding
# size of a pole relative to the plant's fastest one, below which it is at zero: what rounding,
# 1e-16, makes of a double integrator
AT_REST = 1e-7


def close_feedback(system: System, gain: Array) -> System:
    """A system with `input = gain output + further input`, `gain` `(inputs, outputs)`;
    all its signals stay."""
    a, b, c, d = system
    left = np.linalg.inv(np.eye(d.shape[0]) - d @ gain)
    back = b @ gain @ left
    return a + back @ c, b + back @ d, left @ c, left @ d


def with_deltas(system: System, deltas: Array) -> System:
    """A system with its first signals closed by `(channels,)` deltas,
    and the signals that are left."""
    n = deltas.size
    gain = np.zeros(system[3].T.shape)
    gain[:n, :n] = np.diag(deltas)
    a, b, c, d = close_feedback(system, gain)
    return a, b[:, n:], c[n:], d[n:, n:]


def close_loop(
    system: System, controller: System, rows: Sequence[int], columns: Sequence[int]
) -> System:
    """A system with a controller from its outputs `rows` to its inputs `columns`, negative
    feedback; all signals stay, the controller's behind its own."""
    a, b, c, d = (
        np.asarray(block_diag(p, q), dtype=np.float64)
        for p, q in zip(system, controller, strict=True)
    )
    outputs, inputs = system[3].shape
    gain = np.zeros(d.T.shape)
    gain[inputs + np.arange(len(rows)), rows] = 1.0
    gain[columns, outputs + np.arange(len(columns))] = -1.0
    return close_feedback((a, b, c, d), gain)


def taking_part(
    a: NDArray[np.bool_], driven: NDArray[np.bool_], seen: NDArray[np.bool_]
) -> list[int]:
    """Which states are linked, by `a`, to one that is driven and to one that is seen."""
    for _ in range(a.shape[0]):
        driven, seen = driven | (a @ driven), seen | (a.T @ seen)
    return np.flatnonzero(driven & seen).tolist()


def linking(system: System) -> list[int]:
    """The states that link an input of a system to an output."""
    a, b, c, _ = system
    link = np.abs(a) > LINKED * np.abs(a).max(axis=1, initial=1e-300)[:, None]
    driven = (np.abs(b) > UNSEEN * np.abs(b).max(axis=0, initial=1e-300)).any(axis=1)
    seen = (np.abs(c) > UNSEEN * np.abs(c).max(axis=1, initial=1e-300)[:, None]).any(axis=0)
    return taking_part(link, driven, seen)


def picked(system: System, outputs: list[int], inputs: list[int]) -> System:
    """Some of the signals, and the states that link them."""
    a, b, c, d = system
    some = a, b[:, inputs], c[outputs], d[np.ix_(outputs, inputs)]
    return with_states(some, linking(some))


def with_states(system: System, keep: list[int]) -> System:
    """Only some of the states."""
    a, b, c, d = system
    return a[np.ix_(keep, keep)], b[keep], c[:, keep], d


def size_at_rest(plant_poles: Complex, top: float) -> float:
    """Size of a pole s below which it is at rest [rad/s], beside a plant and a closed loop whose
    fastest pole has the size `top`."""
    return AT_REST * min(float(np.abs(plant_poles).max(initial=0.0)), top)


def growth(poles: Complex, rest: float, top: float) -> Array:
    """`(k,)` growth [1/s] of poles s; above zero: unstable. Those at rest do not grow, and what
    rounding makes of poles on the axis does not count."""
    return np.where(np.abs(poles) < rest, 0.0, poles.real) - GROWS * top


def parted(system: System, apart: Callable[[complex], bool]) -> tuple[System, System]:
    """A system as the sum of two, the second with the poles for which `apart` holds and without
    a direct part; their real Schur form is made block diagonal."""
    a, b, c, d = system

    def first(real: float, imaginary: float) -> bool:
        return not apart(complex(real, imaginary))

    form, basis, count = schur(a, output="real", sort=first)
    n = int(count)
    # [1 X; 0 1] makes [T_1 T_12; 0 T_2] block diagonal where T_1 X - X T_2 = -T_12
    x = solve_sylvester(form[:n, :n], -form[n:, n:], -form[:n, n:])
    driven, seen = basis.T @ b, c @ basis
    kept = form[:n, :n], driven[:n] - x @ driven[n:], seen[:, :n], d
    rest = form[n:, n:], driven[n:], seen[:, :n] @ x + seen[:, n:], np.zeros_like(d)
    return kept, rest


def response(system: System, s: Complex) -> Complex:
    """`(k, outputs, inputs)` values at `s` `(k,)`."""
    a, b, c, d = system
    eye = np.eye(a.shape[0])
    parts: list[Complex] = []
    for chunk in np.array_split(s, max(1, -(-s.size // CHUNK))):
        # C (s - A)^-1 B + D
        states = np.linalg.solve(
            chunk[:, None, None] * eye - a, np.broadcast_to(b, (chunk.size, *b.shape))
        )
        parts.append((c @ states + d).astype(np.complex128))
    return np.concatenate(parts)
