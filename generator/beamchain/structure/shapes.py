"""Shapes of a beam's cantilever modes, for pictures: marched outwards from what the root feels.

Good for some six modes: the march amplifies an error by exp(wave number x length).
"""

from bisect import bisect_right

import numpy as np

from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array
from beamchain.structure.beam import Beam
from beamchain.structure.segment import Lump, Stations

STEPS = 240  # of fourth order, over the whole appendage


def mode_shapes(beam: Beam, port: str, model: PortModel) -> tuple[Array, Array]:
    """`x` `(k,)` [m] and displacement (or angle) `(n, k)` in the modes of `model`."""
    bending = port in ("xy", "xz")
    square = model.frequencies**2
    # displacement, rotation, moment, force; or motion, strain force
    state = np.zeros((4 if bending else 2, model.modes))
    if bending:
        state[2], state[3] = square * model.participation[:, 1], -square * model.participation[:, 0]
    else:
        state[1] = square * model.participation[:, 0]
    x, shapes = [0.0], [state[0]]
    length, starts = beam.length, beam.starts
    close = 1e-9 * length
    bodies = [(min(lump.x, length), lump) for lump in beam.lumps]
    ends = [*starts, length]
    hinges = [(ends[j.after_segment], c) for j in beam.joints if (c := j.stiffness(port)) is not None]
    stops = sorted({0.0, *starts, *(at for at, _ in bodies), length})
    for start, end in zip(stops, [*stops[1:], None], strict=True):
        lumps = [lump for at, lump in bodies if abs(at - start) <= close]
        joints = [stiffness for at, stiffness in hinges if abs(at - start) <= close]
        state = _stop(lumps, joints, port, state, square)
        if end is None or end - start <= close:
            continue
        index = bisect_right(starts, start + close) - 1
        x0, segment = starts[index], beam.segments[index]
        count = max(int(np.ceil(STEPS * (end - start) / length)), 4)
        at = segment.at((np.linspace(start, end, 2 * count + 1) - x0) / segment.length)
        slopes = _slopes(at, port, square, rotary=segment.theory == "timoshenko")
        h = (end - start) / count
        for i in range(count):  # Runge and Kutta's four stages
            first, middle, last = slopes[2 * i], slopes[2 * i + 1], slopes[2 * i + 2]
            a = _apply(first, state)
            b = _apply(middle, state + h / 2.0 * a)
            c = _apply(middle, state + h / 2.0 * b)
            d = _apply(last, state + h * c)
            state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
            x.append(start + (i + 1) * h)
            shapes.append(state[0])
    return np.array(x), np.array(shapes).T


def _apply(slope: Array, state: Array) -> Array:
    """`d state / dx`; `slope` `(m, s, s)` one matrix per mode, `state` `(s, m)`."""
    return np.einsum("mij,jm->im", slope, state)


def _slopes(at: Stations, port: str, square: Array, *, rotary: bool) -> Array:
    """`(k, m, s, s)` matrices of the beam's equations at `k` stations for `m` modes."""
    k, m = at.mass.size, square.size
    if port in ("torsion", "axial"):
        stiffness, inertia = (at.torsion, at.polar) if port == "torsion" else (at.axial, at.mass)
        out = np.zeros((k, m, 2, 2))
        out[:, :, 0, 1] = (1.0 / stiffness)[:, None]
        out[:, :, 1, 0] = -inertia[:, None] * square
        return out
    bending, shear, turn = (getattr(at, f"{kind}_{port}") for kind in ("bending", "shear", "rotary"))
    out = np.zeros((k, m, 4, 4))
    out[:, :, 0, 1] = 1.0
    out[:, :, 1, 2] = (1.0 / bending)[:, None]
    out[:, :, 2, 3] = 1.0
    out[:, :, 3, 0] = at.mass[:, None] * square
    if rotary:
        out[:, :, 0, 3] = -(1.0 / shear)[:, None]
        out[:, :, 2, 1] = -turn[:, None] * square
    return out


def _stop(lumps: list[Lump], hinges: list[float], port: str, state: Array, square: Array) -> Array:
    """Across bodies and then joints at one place: a body hangs before a joint."""
    state = state.copy()
    bending = port in ("xy", "xz")
    for lump in lumps:
        if bending:
            state[3] += square * lump.mass * state[0]
            state[2] -= square * lump.inertia[2 if port == "xy" else 1] * state[1]
        else:
            state[1] -= square * (lump.inertia[0] if port == "torsion" else lump.mass) * state[0]
    for stiffness in hinges:
        if bending:
            state[1] += state[2] / stiffness
        else:
            state[0] += state[1] / stiffness
    return state
