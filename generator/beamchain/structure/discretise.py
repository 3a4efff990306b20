"""From segments, joints and lumps to finite elements, refined until the lowest modes stand still.

Theory: docs/theory.md, section 2.
"""

from bisect import bisect_left, bisect_right
from functools import lru_cache, partial
from itertools import accumulate, pairwise
from math import ceil, log2
from typing import NamedTuple

import msgspec
import numpy as np

from beamchain.errors import InputError
from beamchain.ports.model import PortModel
from beamchain.ports.motions import Array
from beamchain.structure import elements
from beamchain.structure.segment import Joint, Lump, Segment, Stations

STEEPEST = 1e100  # ratio of a dimension between the ends of a segment
LIMPEST = 1e-200  # [N m^2, N]: a smaller stiffness underflows
FEW = 12  # pieces up to which segments alone choose the degree
MANY = 100  # pieces beyond which the degree is raised by two at a time
FAR = 1e-3  # relative change from which the degree is raised faster
SAMPLED = 4  # functions between stations
WRITTEN = 400  # coordinates beyond which the rows are not written down


class Parts(NamedTuple):
    """What a beam is made of."""

    segments: tuple[Segment, ...]
    joints: tuple[Joint, ...]
    lumps: tuple[Lump, ...]

    @property
    def ends(self) -> list[float]:
        """x of the root and of the tip end of each segment [m]."""
        return [0.0, *accumulate(segment.length for segment in self.segments)]


@lru_cache(maxsize=256)
def converged_model(
    parts: Parts,
    port: str,
    modes: int,
    stations: tuple[float, ...] = (),
    *,
    shaped: bool = False,
) -> PortModel:
    """Raise the degree until the lowest held and free frequencies stand still.

    `shaped`: with the shapes of its modes, those of a beam of hundreds of pieces as well.
    """
    parts = _join_equal_neighbours(parts)
    wanted = max(modes, 1)
    count = len(_edges(parts))
    functions = 4 + ceil((10 + 1.6 * wanted) / len(parts.segments))
    step = 4
    if count > FEW:
        functions = 2 + ceil((10 + 1.6 * wanted) / count)
    if count > MANY:
        functions += 2
        step = 2
    enough = 1e-12 * max(10.0, wanted)
    discretised = partial(_discretise, parts, port, wanted=wanted, stations=stations, shaped=shaped)
    coarse = discretised(functions)
    least = np.inf
    stalls = 0  # rounds in a row without progress: rounding, which no degree mends
    while True:
        functions += step
        fine = discretised(functions)
        held = _largest_change(coarse.frequencies, fine.frequencies, wanted)
        free = _largest_change(coarse.free_frequencies, fine.free_frequencies, wanted)
        change = max(held, free)
        stalls = stalls + 1 if change > 0.3 * least else 0
        allowed_stalls = 0 if change < 1e-9 or held < enough else 2
        at_rounding = stalls > allowed_stalls and change < FAR
        if change < enough or at_rounding or functions - step > 60:
            return fine
        coarse = fine
        least = min(change, least)
        step = min(2 * step, 8) if change > FAR else step


def sampled_model(parts: Parts, port: str, modes: int, stations: tuple[float, ...]) -> PortModel:
    """The beam cut at many stations, with few functions between them and no refinement.

    Its lowest modes are good to some 1e-6: enough to be drawn.
    """
    return _discretise(parts, port, SAMPLED, wanted=max(modes, 1), stations=stations, shaped=False)


def _largest_change(coarse: Array, fine: Array, wanted: int) -> float:
    """Largest relative change of the lowest `wanted` frequencies."""
    count = min(wanted, coarse.size, fine.size)
    changes = np.abs(fine[:count] / coarse[:count] - 1.0)
    return float(np.max(changes, initial=0.0))


def _join_equal_neighbours(parts: Parts) -> Parts:
    """The same beam with equal neighbours made one."""
    hinged = {joint.after_segment for joint in parts.joints}
    segments: list[Segment] = []
    new_number = {0: 0}  # of the segment whose far end a joint stands at, by its old number
    for i, segment in enumerate(parts.segments):
        last = segments[-1] if segments else None
        joinable = last is not None and i not in hinged and segment.section_end is None
        if (
            last is not None
            and joinable
            and msgspec.structs.replace(last, length=segment.length) == segment
        ):
            segments[-1] = msgspec.structs.replace(last, length=last.length + segment.length)
        else:
            segments.append(segment)
        new_number[i + 1] = len(segments)
    joints = [
        msgspec.structs.replace(joint, after_segment=new_number[joint.after_segment])
        for joint in parts.joints
    ]
    return Parts(tuple(segments), tuple(joints), parts.lumps)


def _discretise(
    parts: Parts,
    port: str,
    functions: int,
    *,
    wanted: int,
    stations: tuple[float, ...],
    shaped: bool,
) -> PortModel:
    """The beam in one port with so many strain `functions` in each piece."""
    bending = port in ("xy", "xz")
    pieces = _pieces(parts, port, functions, stations)
    if any(np.any(piece.stiffness <= 0.0) for piece in pieces):
        raise InputError(
            f'port "{port}": a segment states no stiffness there (an "equivalent" section with 0, '
            f"rigid); set modes.{port} = 0 or give its stiffness."
        )
    limpest = min(float(np.min(piece.stiffness)) for piece in pieces)
    if limpest < LIMPEST:
        raise InputError(
            f'port "{port}": a segment has the stiffness {limpest:.3g}, below {LIMPEST:g}, beyond '
            f"double precision; set modes.{port} = 0 or give its stiffness."
        )
    has_inertia = any(np.any(piece.inertia > 0.0) for piece in pieces)
    lump_turns = any(lump.inertia[0] for lump in parts.lumps)
    if port == "torsion" and not (has_inertia or lump_turns):
        raise InputError(
            'port "torsion": the appendage has no polar inertia; give polar_inertia or set '
            "modes.torsion = 0."
        )
    rows = elements.MotionRows(
        pieces,
        hinges=_springs(parts, port),
        bodies=[_body(lump, port) for lump in parts.lumps],
        functions=functions,
        bending=bending,
        stations=stations,
    )
    sheared = sum(piece.shear_stiffness is not None for piece in pieces)
    coordinates = functions * (len(pieces) + sheared)
    if coordinates > WRITTEN:
        model = elements.assemble_lowest(rows, wanted, shaped=shaped)
    else:
        model = elements.assemble(rows)
    if model is None:
        raise _convergence_error(parts, port, wanted)
    return model


def _springs(parts: Parts, port: str) -> list[elements.Spring]:
    """Its joints that are compliant in a port."""
    ends = parts.ends
    springs: list[elements.Spring] = []
    for joint in parts.joints:
        stiffness = joint.stiffness(port)
        if stiffness is not None:
            springs.append(elements.Spring(ends[joint.after_segment], stiffness))
    return springs


def _body(lump: Lump, port: str) -> elements.PointBody:
    """A carried body as it acts in a port."""
    ix, iy, iz = lump.inertia
    if port == "torsion":
        return elements.PointBody(lump.x, mass=ix)
    if port == "axial":
        return elements.PointBody(lump.x, mass=lump.mass)
    return elements.PointBody(lump.x, mass=lump.mass, inertia=iz if port == "xy" else iy)


def _convergence_error(parts: Parts, port: str, wanted: int) -> InputError:
    """The error for a beam whose lowest frequencies are too far apart for double precision."""
    tapers = [segment.taper for segment in parts.segments]
    strongest = int(np.argmax(tapers))
    start, end = parts.ends[strongest : strongest + 2]
    return InputError(
        f'port "{port}": the {wanted} lowest frequencies lie too far apart for double precision '
        "and do not stand still; give weaker tapers (a dimension in the wrong unit?), stiffer "
        "joints, lighter lumps or fewer modes. The strongest taper is "
        f"{tapers[strongest]:.3g}, from x = {start:.6g} to {end:.6g} m."
    )


def _edges(
    parts: Parts, stations: tuple[float, ...] = ()
) -> list[tuple[Segment, float, float, float]]:
    """Segment, its start, from, to [m]: cut at lumps, stations and strong tapers."""
    pieces: list[tuple[Segment, float, float, float]] = []
    cuts = sorted([*(lump.x for lump in parts.lumps), *stations])
    ends = parts.ends
    slack = 1e-9 * ends[-1]
    for x0, segment in zip(ends[:-1], parts.segments, strict=True):
        first = bisect_right(cuts, x0 + slack)
        behind = bisect_left(cuts, x0 + segment.length - slack)
        inner = cuts[first:behind]
        if not segment.taper < STEEPEST:
            raise InputError(
                f"a segment tapers by {segment.taper:.3g} along its length, more than "
                f"{STEEPEST:g}, beyond double precision; end it where it is still a structure."
            )
        tapered = [x0 + segment.length * fraction for fraction in _taper_cuts(segment)]
        points = sorted({x0, x0 + segment.length, *inner, *tapered})
        pieces += [(segment, x0, a, b) for a, b in pairwise(points)]
    return pieces


def _taper_cuts(segment: Segment) -> list[float]:
    """Fractions of a segment's length between which it tapers by one ratio, 2 at most."""
    count = max(1, ceil(log2(segment.taper) - 1e-9))
    if count == 1:
        return []
    # with the dimension d = 1 + (taper - 1) x, d = taper^(i / count) at cut i
    dimensions = segment.taper ** (np.arange(1, count) / count)
    cuts = (dimensions - 1.0) / (segment.taper - 1.0)
    if segment.shrinks:
        cuts = 1.0 - cuts
    return cuts.tolist()


@lru_cache(maxsize=8)
def _sample_edges(
    parts: Parts, functions: int, stations: tuple[float, ...]
) -> list[tuple[Segment, float, float, Stations]]:
    """The stretches of `_edges`, sampled at the Gauss points for all ports."""
    xi, _ = elements.gauss(functions + 5)
    samples: list[tuple[Segment, float, float, Stations]] = []
    for segment, x0, a, b in _edges(parts, stations):
        x = a + (b - a) * (1.0 + xi) / 2.0
        # rounding may lead beyond the end, where a strong taper is negative
        fraction = np.clip((x - x0) / segment.length, 0.0, 1.0)
        samples.append((segment, a, b, segment.at(fraction)))
    return samples


def _pieces(
    parts: Parts, port: str, functions: int, stations: tuple[float, ...]
) -> list[elements.Piece]:
    """The stretches of `_edges`, sampled for one port."""
    bending = port in ("xy", "xz")
    kind = f"bending_{port}" if bending else port
    pieces: list[elements.Piece] = []
    for segment, a, b, at in _sample_edges(parts, functions, stations):
        sheared = bending and segment.theory == "timoshenko"
        piece = elements.Piece(
            start=a,
            length=b - a,
            stiffness=getattr(at, kind),
            inertia=at.polar if port == "torsion" else at.mass,
            shear_stiffness=getattr(at, f"shear_{port}") if sheared else None,
            rotary_inertia=getattr(at, f"rotary_{port}") if sheared else None,
        )
        pieces.append(piece)
    return pieces
