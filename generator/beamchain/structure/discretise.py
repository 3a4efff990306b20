"""From segments, joints and lumps to finite elements, refined until the lowest modes stand still.

Theory: docs/theory.md, section 2.
"""

from bisect import bisect_left, bisect_right
from functools import lru_cache
from itertools import accumulate, pairwise
from math import ceil, log2
from typing import NamedTuple

import msgspec
import numpy as np

from beamchain.errors import InputError
from beamchain.ports.model import PortModel
from beamchain.structure import elements
from beamchain.structure.segment import Joint, Lump, Segment, Stations

STEEPEST = 1e100  # ratio of a dimension between the ends of a segment
FEW = 12  # pieces up to which segments alone choose the degree
MANY = 100  # pieces beyond which the degree is raised by two at a time
FAR = 1e-3  # relative change from which the degree is raised faster
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
def converged(parts: Parts, port: str, modes: int, stations: tuple[float, ...] = ()) -> PortModel:
    """Raise the degree until the lowest held and free frequencies stand still."""
    parts = _joined(parts)
    wanted = max(modes, 1)
    count = len(_edges(parts))
    functions, step = 4 + ceil((10 + 1.6 * wanted) / len(parts.segments)), 4
    if count > FEW:
        functions = 2 + ceil((10 + 1.6 * wanted) / count)
    if count > MANY:
        functions, step = functions + 2, 2
    coarse, least, stood = _discretised(parts, port, functions, wanted, stations), np.inf, 0
    while True:
        fine = _discretised(parts, port, functions + step, wanted, stations)
        changes: list[float] = []
        for a, b in ((coarse.frequencies, fine.frequencies), (coarse.free_frequencies, fine.free_frequencies)):
            k = min(wanted, a.size, b.size)
            changes.append(float(np.max(np.abs(b[:k] / a[:k] - 1.0), initial=0.0)))
        change, enough = max(changes), 1e-12 * max(10.0, wanted)
        stood = stood + 1 if change > 0.3 * least else 0  # on rounding, which no degree mends
        stands = stood > (0 if change < 1e-9 or changes[0] < enough else 2) and change < FAR
        if change < enough or stands or functions > 60:
            return fine
        functions, coarse, least = functions + step, fine, min(change, least)
        step = min(2 * step, 8) if change > FAR else step


def _joined(parts: Parts) -> Parts:
    """The same beam with equal neighbours made one."""
    hinged = {joint.after_segment for joint in parts.joints}
    out: list[Segment] = []
    place = {0: 0}  # of each segment's far end, before and after
    for i, segment in enumerate(parts.segments):
        last = out[-1] if out else None
        free = i not in hinged and segment.section_end is None
        if last is not None and free and msgspec.structs.replace(last, length=segment.length) == segment:
            out[-1] = msgspec.structs.replace(last, length=last.length + segment.length)
        else:
            out.append(segment)
        place[i + 1] = len(out)
    joints = tuple(msgspec.structs.replace(j, after_segment=place[j.after_segment]) for j in parts.joints)
    return Parts(tuple(out), joints, parts.lumps)


def _discretised(parts: Parts, port: str, functions: int, wanted: int, stations: tuple[float, ...]) -> PortModel:
    bending = port in ("xy", "xz")
    pieces = _pieces(parts, port, functions, stations)
    if any(np.any(p.stiffness <= 0.0) for p in pieces):
        raise InputError(
            f'port "{port}": a segment states no stiffness there (an "equivalent" section with 0, rigid); '
            f"set modes.{port} = 0 or give its stiffness."
        )
    turning = any(np.any(p.inertia > 0.0) for p in pieces) or any(b.inertia[0] for b in parts.lumps)
    if port == "torsion" and not turning:
        raise InputError(
            'port "torsion": the appendage has no polar inertia; give polar_inertia or set modes.torsion = 0.'
        )
    ends = parts.ends
    hinges = [elements.Spring(ends[j.after_segment], c) for j in parts.joints if (c := j.stiffness(port)) is not None]
    about = {"xy": 2, "xz": 1}
    bodies = [
        elements.Body(b.x, b.mass, b.inertia[about[port]]) if bending
        else elements.Body(b.x, b.inertia[0] if port == "torsion" else b.mass)
        for b in parts.lumps
    ]  # fmt: skip
    rows = elements.MotionRows(pieces, hinges, bodies, functions, bending=bending, stations=stations)
    large = functions * (len(pieces) + sum(p.shear_stiffness is not None for p in pieces)) > WRITTEN
    return elements.assemble_lowest(rows, wanted) if large else elements.assemble(rows)


def _edges(parts: Parts, stations: tuple[float, ...] = ()) -> list[tuple[Segment, float, float, float]]:
    """Segment, its start, from, to [m]: cut at lumps, stations and strong tapers."""
    out: list[tuple[Segment, float, float, float]] = []
    cuts = sorted([*(lump.x for lump in parts.lumps), *stations])
    ends = parts.ends
    slack = 1e-9 * ends[-1]
    for x0, segment in zip(ends[:-1], parts.segments, strict=True):
        inner = cuts[bisect_right(cuts, x0 + slack) : bisect_left(cuts, x0 + segment.length - slack)]
        if not segment.taper < STEEPEST:
            raise InputError(
                f"a segment tapers by {segment.taper:.3g} along its length, more than {STEEPEST:g}, beyond double precision; "
                "end it where it is still a structure."
            )
        count = max(1, ceil(log2(segment.taper) - 1e-9))
        # geometric grading: every piece tapers by the same ratio
        grown = segment.taper ** (np.arange(1, count) / count)
        edges = (grown - 1.0) / (segment.taper - 1.0) if count > 1 else np.zeros(0)
        if count > 1 and segment.shrinks:
            edges = 1.0 - edges
        points = sorted({x0, x0 + segment.length, *inner, *(x0 + segment.length * float(e) for e in edges)})
        out += [(segment, x0, a, b) for a, b in pairwise(points)]
    return out


@lru_cache(maxsize=8)
def _sampled(parts: Parts, functions: int, stations: tuple[float, ...]) -> list[tuple[Segment, float, float, Stations]]:
    """The stretches of `_edges`, sampled at the Gauss points for all ports."""
    xi, _ = elements.gauss(functions + 5)
    return [
        (segment, a, b, segment.at((a + (b - a) * (1.0 + xi) / 2.0 - x0) / segment.length))
        for segment, x0, a, b in _edges(parts, stations)
    ]


def _pieces(parts: Parts, port: str, functions: int, stations: tuple[float, ...]) -> list[elements.Piece]:
    """The stretches of `_edges`, sampled for one port."""
    bending = port in ("xy", "xz")
    stiffness = f"bending_{port}" if bending else port
    out: list[elements.Piece] = []
    for segment, a, b, at in _sampled(parts, functions, stations):
        sheared = bending and segment.theory == "timoshenko"
        shear, rotary = (getattr(at, f"{kind}_{port}") if sheared else None for kind in ("shear", "rotary"))
        inertia = at.polar if port == "torsion" else at.mass
        out.append(elements.Piece(a, b - a, getattr(at, stiffness), inertia, shear, rotary))
    return out
