"""Shapes of a beam's cantilever modes, for pictures: integrated outwards from the root's loads.

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
    square = model.frequencies**2
    state = _root_state(port, model)
    x = [0.0]
    shapes = [state[0]]
    length = beam.length
    starts = beam.starts
    close = 1e-9 * length
    bodies = [(min(lump.x, length), lump) for lump in beam.lumps]
    ends = [*starts, length]
    hinges: list[tuple[float, float]] = []
    for joint in beam.joints:
        stiffness = joint.stiffness(port)
        if stiffness is not None:
            hinges.append((ends[joint.after_segment], stiffness))
    stops = sorted({0.0, *starts, *(place for place, _ in bodies), length})
    for start, end in zip(stops, [*stops[1:], None], strict=True):
        lumps = [lump for place, lump in bodies if abs(place - start) <= close]
        joints = [stiffness for place, stiffness in hinges if abs(place - start) <= close]
        state = _pass_stop(state, square, lumps=lumps, joints=joints, port=port)
        if end is None or end - start <= close:
            continue
        index = bisect_right(starts, start + close) - 1
        x0 = starts[index]
        segment = beam.segments[index]
        count = max(int(np.ceil(STEPS * (end - start) / length)), 4)
        places = np.linspace(start, end, 2 * count + 1)
        stations = segment.at((places - x0) / segment.length)
        slopes = _slopes(stations, port, square, timoshenko=segment.theory == "timoshenko")
        h = (end - start) / count
        for i in range(count):  # Runge and Kutta's four stages
            first = slopes[2 * i]
            middle = slopes[2 * i + 1]
            last = slopes[2 * i + 2]
            a = _apply(first, state)
            b = _apply(middle, state + h / 2.0 * a)
            c = _apply(middle, state + h / 2.0 * b)
            d = _apply(last, state + h * c)
            state = state + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
            x.append(start + (i + 1) * h)
            shapes.append(state[0])
    return np.array(x), np.array(shapes).T


def _root_state(port: str, model: PortModel) -> Array:
    """`(s, m)` state at the held root, whose loads are `W^2 L`.

    Displacement, rotation, moment and shear force in bending, else displacement and force.
    """
    square = model.frequencies**2
    if port in ("xy", "xz"):
        state = np.zeros((4, model.modes))
        state[2] = square * model.participation[:, 1]
        state[3] = -square * model.participation[:, 0]
        return state
    state = np.zeros((2, model.modes))
    state[1] = square * model.participation[:, 0]
    return state


def _apply(slope: Array, state: Array) -> Array:
    """`d state / dx`; `slope` `(m, s, s)` one matrix per mode, `state` `(s, m)`."""
    return np.einsum("mij,jm->im", slope, state)


def _slopes(stations: Stations, port: str, square: Array, *, timoshenko: bool) -> Array:
    """`(k, m, s, s)` matrices of the beam's equations at `k` stations for `m` modes.

    With displacement w, rotation t, moment M and force Q: `w' = t - Q / (k G A)`, `t' = M / EI`,
    `M' = Q - W^2 rho I t`, `Q' = W^2 m w`; both extra terms are Timoshenko's. In torsion and axial
    motion `w' = Q / stiffness`, `Q' = -W^2 inertia w`.
    """
    k = stations.mass.size
    m = square.size
    if port in ("torsion", "axial"):
        stiffness = stations.torsion if port == "torsion" else stations.axial
        inertia = stations.polar if port == "torsion" else stations.mass
        out = np.zeros((k, m, 2, 2))
        out[:, :, 0, 1] = (1.0 / stiffness)[:, None]
        out[:, :, 1, 0] = -inertia[:, None] * square
        return out
    bending = getattr(stations, f"bending_{port}")
    out = np.zeros((k, m, 4, 4))
    out[:, :, 0, 1] = 1.0
    out[:, :, 1, 2] = (1.0 / bending)[:, None]
    out[:, :, 2, 3] = 1.0
    out[:, :, 3, 0] = stations.mass[:, None] * square
    if timoshenko:
        shear = getattr(stations, f"shear_{port}")
        rotary = getattr(stations, f"rotary_{port}")
        out[:, :, 0, 3] = -(1.0 / shear)[:, None]
        out[:, :, 2, 1] = -rotary[:, None] * square
    return out


def _pass_stop(
    state: Array, square: Array, *, lumps: list[Lump], joints: list[float], port: str
) -> Array:
    """The state behind bodies and then joints at one place: a body hangs before a joint."""
    state = state.copy()
    bending = port in ("xy", "xz")
    for lump in lumps:
        if bending:
            state[3] += square * lump.mass * state[0]
            state[2] -= square * lump.inertia[2 if port == "xy" else 1] * state[1]
        else:
            state[1] -= square * (lump.inertia[0] if port == "torsion" else lump.mass) * state[0]
    for stiffness in joints:
        if bending:
            state[1] += state[2] / stiffness
        else:
            state[0] += state[1] / stiffness
    return state
