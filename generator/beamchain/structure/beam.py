"""The elastic appendage: segments, compliant joints and lumped bodies along a straight axis x.

The root is at x = 0.
"""

from bisect import bisect_right
from collections.abc import Sequence
from functools import cached_property
from itertools import accumulate
from typing import Annotated

import msgspec
import numpy as np

from beamchain.checks import Struct, field, finite_array, one_of, whole_number
from beamchain.errors import InputError
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array
from beamchain.structure import elements
from beamchain.structure.discretise import Parts, converged_model
from beamchain.structure.mass_line import MassLine, MassPiece
from beamchain.structure.segment import Joint, Lump, Segment, check_carried_body, expand_repeats

MOST_SEGMENTS = 1000
MOST_LUMPS = 1000


TAPER = 4  # degree of the inertias of a section whose dimensions grow linearly


class Beam(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, dict=True):
    """A straight elastic appendage.

    Example:
        >>> import beamchain as bc
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> boom = bc.Beam(segments=(bc.Segment(length=8.0, section=section),))
        >>> boom.port("xy").frequencies[:2].round(3)
        array([1.228, 7.699])
    """

    segments: Annotated[
        tuple[Segment, ...], field("parts of the appendage, from the root to the tip")
    ]
    joints: Annotated[tuple[Joint, ...], field("compliant hinge lines between segments")] = ()
    lumps: Annotated[tuple[Lump, ...], field("rigid bodies carried along the appendage")] = ()

    def __post_init__(self) -> None:
        for name, kind in (("segments", Segment), ("joints", Joint), ("lumps", Lump)):
            items = getattr(self, name)
            is_list = isinstance(items, list | tuple)
            if not is_list or not all(isinstance(item, kind) for item in items):
                raise InputError(
                    f"{name} = {items!r:.60} must be a list of {kind.__name__}: "
                    f"{name}=[{kind.__name__}(...)]."
                )
            msgspec.structs.force_setattr(self, name, tuple(expand_repeats(items)))
        if not self.segments:
            raise InputError(
                "the beam has no segment; give at least one [[segment]] with length, section and "
                "material."
            )
        if len(self.segments) > MOST_SEGMENTS:
            raise InputError(
                f"{len(self.segments)} segments are given; at most {MOST_SEGMENTS} are taken: join "
                "equal neighbours."
            )
        if len(self.lumps) > MOST_LUMPS:
            raise InputError(
                f"{len(self.lumps)} lumps are given; at most {MOST_LUMPS} are taken: join "
                "neighbours, or state them as nonstructural_mass."
            )
        for joint in self.joints:
            if joint.after_segment >= len(self.segments):
                raise InputError(
                    f"joint.after_segment = {joint.after_segment} must lie between 0 (the root) "
                    f"and {len(self.segments) - 1}, since nothing hangs behind the last of "
                    f"{len(self.segments)} segments."
                )
        after = [joint.after_segment for joint in self.joints]
        if len(set(after)) != len(after):
            raise InputError(
                f"two joints stand after the same segment (after_segment = {after}); merge them "
                "into one."
            )
        length = self.length
        segments_mass = self.own_mass if self.lumps else 0.0
        for lump in self.lumps:
            if lump.x > length * (1.0 + 1e-9):
                raise InputError(
                    f"lump.x = {lump.x!r} m lies beyond the tip at {length!r} m; move it onto the "
                    "appendage."
                )
            check_carried_body(
                "lump", lump.mass, lump.inertia, segments_mass=segments_mass, length=length
            )

    @cached_property
    def length(self) -> float:
        """Root to tip [m]."""
        return sum(segment.length for segment in self.segments)

    @property
    def starts(self) -> list[float]:
        """x of the root end of each segment [m]."""
        return list(self._starts)

    @cached_property
    def _starts(self) -> tuple[float, ...]:
        return (0.0, *accumulate(segment.length for segment in self.segments[:-1]))

    @property
    def own_mass(self) -> float:
        """Mass of the segments, without lumps [kg]."""
        return float(msgspec.structs.replace(self, lumps=()).line.whole[0, 0])

    @cached_property
    def line(self) -> MassLine:
        """How its mass lies along x."""
        fractions = np.linspace(0.0, 1.0, TAPER + 1)
        pieces: list[MassPiece] = []
        for start, segment in zip(self._starts, self.segments, strict=True):
            at = segment.at(fractions)
            rotary = 1.0 if segment.theory == "timoshenko" else 0.0
            values = [at.mass, at.polar, rotary * at.rotary_xy, rotary * at.rotary_xz]
            pieces.append(MassPiece(start, segment.length, np.column_stack(values)))
        rows = [[b.x, b.mass, b.inertia[0], b.inertia[2], b.inertia[1]] for b in self.lumps]
        return MassLine(
            self.length,
            tuple(pieces),
            np.array(rows).reshape(-1, 5),
            hinge_lines={port: self.hinge_lines(port) for port in PORTS},
            exact=True,
        )

    @property
    def uniform(self) -> bool:
        """One prismatic Euler segment and nothing else: the transcendental solution holds."""
        only = self.segments[0]
        plain = only.taper == 1.0 and only.theory == "euler"
        return len(self.segments) == 1 and plain and not self.joints and not self.lumps

    def port(self, port: str = "xy", modes: int = 8, stations: Sequence[float] = ()) -> PortModel:
        """The port model of the appendage at its root.

        Args:
            port: "xy", "xz", "torsion" or "axial".
            modes: lowest modes (free, held or on any hub) converged to 1e-11 relative,
                or to rounding.
            stations: x of further points [m]; their motion in the modes follows that
                of the tip in `tip`.

        Returns:
            All modes of the discretisation, more than `modes`, so that its residual mass is the
            beam's own to the same precision.

        Raises:
            InputError: unknown port, or a port in which the appendage is rigid.
        """
        one_of("port", port, PORTS)
        parts = Parts(self.segments, self.joints, self.lumps)
        places = np.sort(finite_array("stations", stations, (None,), unit="m")).tolist()
        count = whole_number("modes", modes, 0, 60)
        return converged_model(parts, port, count, tuple(places))

    def hinge_lines(self, port: str) -> tuple[float, ...]:
        """x of its joints that are compliant in a port [m]."""
        ends = [*self._starts, self.length]
        compliant = [joint for joint in self.joints if joint.stiffness(port) is not None]
        return tuple(ends[joint.after_segment] for joint in compliant)

    def rigid_mass(self) -> Array:
        """`(6, 6)` mass matrix of the frozen appendage about the root,
        motions (x, y, z, rotations)."""
        return self.line.rigid_mass()

    def _at(self, x: float) -> tuple[Segment, float]:
        """The segment at `x` [m] and the fraction of its length there."""
        index = max(bisect_right(self._starts, x) - 1, 0)
        segment = self.segments[index]
        return segment, (x - self._starts[index]) / segment.length

    def density(self, x: float, port: str) -> Array:
        """`(3,)` derivative of mass, first and second moment of a `port` at `x` [m],
        without lumps."""
        segment, fraction = self._at(x)
        at = segment.at(np.array([fraction]))
        mass = float(at.mass[0])
        rotary = 0.0
        if segment.theory == "timoshenko":
            rotary = float((at.rotary_xy if port == "xy" else at.rotary_xz)[0])
        return np.array([mass, mass * x, mass * x**2 + rotary])

    def compliance(self, start: float, end: float, port: str) -> float:
        """Rotation of the stretch `[start, end)` in a `port` per unit moment, joints inside
        included [rad/(N m)]."""
        total = 0.0
        xi, weights = elements.gauss(24)
        kind = port if port == "torsion" else f"bending_{port}"
        for x0, segment in zip(self._starts, self.segments, strict=True):
            a = max(start, x0)
            b = min(end, x0 + segment.length)
            if b <= a:
                continue
            pieces = 1 if segment.taper == 1.0 else 8
            width = (b - a) / pieces
            for i in range(pieces):
                low = a + (b - a) * i / pieces
                x = low + width * (1.0 + xi) / 2.0
                stiffness = getattr(segment.at((x - x0) / segment.length), kind)
                total += float(weights @ (1.0 / stiffness)) * width / 2.0
        edge = 1e-9 * self.length
        ends = [*self._starts, self.length]
        for joint in self.joints:
            stiffness = joint.stiffness(port)
            inside = start - edge <= ends[joint.after_segment] < end - edge
            if stiffness is not None and inside:
                total += 1.0 / stiffness
        return total

    def depth(self, x: float, plane: str) -> float:
        """Extent of the section at `x` in a plane [m], for drawing;
        0 where the shape is not known."""
        segment, fraction = self._at(x)
        f = min(max(fraction, 0.0), 1.0)
        # the shape of one end may be unknown
        first = segment.section.depth(plane) or segment.end.depth(plane)
        last = segment.end.depth(plane) or segment.section.depth(plane)
        return (1.0 - f) * first + f * last
