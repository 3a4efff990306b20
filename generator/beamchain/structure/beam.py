"""The elastic appendage: segments, compliant joints and lumped bodies along a straight axis x, root at x = 0."""

from bisect import bisect_right
from collections.abc import Sequence
from functools import cached_property
from itertools import accumulate
from typing import Annotated, NamedTuple

import msgspec
import numpy as np

from beamchain.checks import Struct, field, one_of, whole_number
from beamchain.errors import InputError
from beamchain.ports.model import PortModel
from beamchain.ports.motions import PORTS, Array
from beamchain.structure import elements
from beamchain.structure.discretise import Parts, converged
from beamchain.structure.segment import Joint, Lump, Segment, check_carried, repeated

MOST_SEGMENTS = 1000
MOST_LUMPS = 1000


class Moments(NamedTuple):
    """Mass, first and second moment about the root, polar and rotary inertia, SI."""

    mass: float
    first: float
    second: float
    polar: float
    rotary_xy: float
    rotary_xz: float


def straight_mass_matrices(moments: Array) -> Array:
    """`(k, 6, 6)` mass matrices about the root of stretches with their mass on the x axis: `(k, 6)` as in `Moments`."""
    mass, first, second, polar, rotary_xy, rotary_xz = moments.T
    out = np.zeros((len(moments), 6, 6))
    for i, values in enumerate((mass, mass, mass, polar, second + rotary_xz, second + rotary_xy)):
        out[:, i, i] = values
    out[:, 1, 5] = out[:, 5, 1] = first
    out[:, 2, 4] = out[:, 4, 2] = -first
    return out


def _moments(lump: Lump) -> Array:
    """`(6,)` as in `Moments`, of a body."""
    ix, iy, iz = lump.inertia
    return np.array([lump.mass, lump.mass * lump.x, lump.mass * lump.x**2, ix, iz, iy])


class Beam(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, dict=True):
    """A straight elastic appendage.

    Example:
        >>> import beamchain as bc
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> boom = bc.Beam(segments=(bc.Segment(length=8.0, section=section),))
        >>> boom.port("xy").frequencies[:2].round(3)
        array([1.228, 7.699])
    """

    segments: Annotated[tuple[Segment, ...], field("parts of the appendage, from the root to the tip")]
    joints: Annotated[tuple[Joint, ...], field("compliant hinge lines between segments")] = ()
    lumps: Annotated[tuple[Lump, ...], field("rigid bodies carried along the appendage")] = ()

    def __post_init__(self) -> None:
        for name, kind in (("segments", Segment), ("joints", Joint), ("lumps", Lump)):
            given = getattr(self, name)
            if not isinstance(given, list | tuple) or not all(isinstance(item, kind) for item in given):
                raise InputError(
                    f"{name} = {given!r:.60} must be a list of {kind.__name__}: {name}=[{kind.__name__}(...)]."
                )
            msgspec.structs.force_setattr(self, name, tuple(repeated(given)))
        if not self.segments:
            raise InputError(
                "the beam has no segment; give at least one [[segment]] with length, section and material."
            )
        if len(self.segments) > MOST_SEGMENTS:
            raise InputError(
                f"{len(self.segments)} segments are given; at most {MOST_SEGMENTS} are taken: join equal neighbours."
            )
        if len(self.lumps) > MOST_LUMPS:
            raise InputError(
                f"{len(self.lumps)} lumps are given; at most {MOST_LUMPS} are taken: join neighbours, or state them as "
                "nonstructural_mass."
            )
        for joint in self.joints:
            if joint.after_segment >= len(self.segments):
                raise InputError(
                    f"joint.after_segment = {joint.after_segment} must lie between 0 (the root) and "
                    f"{len(self.segments) - 1}, since nothing hangs behind the last of {len(self.segments)} segments."
                )
        after = [joint.after_segment for joint in self.joints]
        if len(set(after)) != len(after):
            raise InputError(f"two joints stand after the same segment (after_segment = {after}); merge them into one.")
        length, own = self.length, self.own_mass if self.lumps else 0.0
        for lump in self.lumps:
            if lump.x > length * (1.0 + 1e-9):
                raise InputError(
                    f"lump.x = {lump.x!r} m lies beyond the tip at {length!r} m; move it onto the appendage."
                )
            check_carried("lump", lump.mass, lump.inertia, own, length)

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
        xi, weights = elements.gauss(6)
        return sum(float(weights @ s.at((1.0 + xi) / 2.0).mass) * s.length / 2.0 for s in self.segments)

    @property
    def steps(self) -> tuple[float, ...]:
        """x of its lumps [m]."""
        return tuple(lump.x for lump in self.lumps)

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
            modes: lowest modes (free, held or on any hub) converged to 1e-11 relative, or to rounding.
            stations: x of further points [m]; their motion in the modes follows that of the tip in `tip`.

        Returns:
            All modes of the discretisation, more than `modes`, so that its residual mass is the beam's own to the
            same precision.

        Raises:
            InputError: unknown port, or a port in which the appendage is rigid.
        """
        one_of("port", port, PORTS)
        parts = Parts(self.segments, self.joints, self.lumps)
        return converged(parts, port, whole_number("modes", modes, 0, 60), tuple(sorted(float(x) for x in stations)))

    def hinge_lines(self, port: str) -> tuple[float, ...]:
        """x of its joints that are compliant in a port [m]."""
        ends = [*self._starts, self.length]
        return tuple(ends[joint.after_segment] for joint in self.joints if joint.stiffness(port) is not None)

    def rigid_mass(self) -> Array:
        """`(6, 6)` mass matrix of the frozen appendage about the root, motions (x, y, z, rotations)."""
        return straight_mass_matrices(np.array([self.moments(0.0, self.length, closed=True)]))[0]

    @cached_property
    def _whole(self) -> Array:
        """`(s, 6)` as in `Moments`, of every segment."""
        ends = [*self._starts[1:], self.length]
        return np.vstack([
            self._stretch(i, np.array([a]), b) for i, (a, b) in enumerate(zip(self._starts, ends, strict=True))
        ])  # fmt: skip

    def _stretch(self, index: int, start: Array, end: float) -> Array:
        """`(k, 6)` as in `Moments`, of a segment between each of `start` `(k,)` and `end` [m]."""
        segment, x0 = self.segments[index], self._starts[index]
        xi, weights = elements.gauss(6)
        half = (end - start)[:, None] / 2.0
        x = start[:, None] + half * (1.0 + xi)
        at = segment.at(np.clip((x.ravel() - x0) / segment.length, 0.0, 1.0))
        turn = 1.0 if segment.theory == "timoshenko" else 0.0
        mass, polar, xy, xz = (v.reshape(x.shape) for v in (at.mass, at.polar, at.rotary_xy, at.rotary_xz))
        values = np.stack([mass, mass * x, mass * x**2, polar, turn * xy, turn * xz], axis=-1)
        return np.einsum("kq,kqi->ki", half * weights, values)

    def moments(self, start: float, end: float, *, closed: bool = False) -> Moments:
        """Moments of the stretch `[start, end)` about the root; `closed` takes in a lump at `end` itself."""
        total = np.zeros(6)
        for i, (x0, segment) in enumerate(zip(self._starts, self.segments, strict=True)):
            a, b = max(start, x0), min(end, x0 + segment.length)
            if b > a:
                total += (
                    self._whole[i] if (a, b) == (x0, x0 + segment.length) else self._stretch(i, np.array([a]), b)[0]
                )
        edge = 1e-9 * self.length
        for lump in self.lumps:
            if start - edge <= lump.x < end - edge or (closed and abs(lump.x - end) <= edge):
                total += _moments(lump)
        return Moments(*(float(v) for v in total))

    def behind(self, x: Array) -> Array:
        """`(k, 6, 6)` mass matrix about the root of what lies behind each `x` `(k,)` [m]; a lump there hangs before it."""
        edge = 1e-9 * self.length
        beyond = np.vstack([np.cumsum(self._whole[::-1], axis=0)[::-1], np.zeros((1, 6))])
        index = np.maximum(np.searchsorted(np.array(self._starts), x, side="right") - 1, 0)
        total = beyond[index + 1]
        for i in np.unique(index).tolist():
            end, here = self._starts[i] + self.segments[i].length, index == i
            total[here] += self._stretch(i, np.clip(x[here], self._starts[i], end), end)
        for lump in self.lumps:
            total += np.where(lump.x > x + edge, 1.0, 0.0)[:, None] * _moments(lump)
        return straight_mass_matrices(total)

    def _at(self, x: float) -> tuple[Segment, float]:
        """The segment at `x` [m] and the fraction of its length there."""
        index = max(bisect_right(self._starts, x) - 1, 0)
        return self.segments[index], (x - self._starts[index]) / self.segments[index].length

    def density(self, x: float, port: str) -> Array:
        """`(3,)` derivative of mass, first and second moment of a `port` at `x` [m], without lumps."""
        segment, fraction = self._at(x)
        at = segment.at(np.array([fraction]))
        mass = float(at.mass[0])
        rotary = float((at.rotary_xy if port == "xy" else at.rotary_xz)[0]) if segment.theory == "timoshenko" else 0.0
        return np.array([mass, mass * x, mass * x**2 + rotary])

    def compliance(self, start: float, end: float, port: str) -> float:
        """Rotation of the stretch `[start, end)` in a `port` per unit moment, joints inside included [rad/(N m)]."""
        total = 0.0
        xi, weights = elements.gauss(24)
        for x0, segment in zip(self._starts, self.segments, strict=True):
            a, b = max(start, x0), min(end, x0 + segment.length)
            pieces = 1 if segment.taper == 1.0 else 8
            for i in range(pieces if b > a else 0):
                low, wide = a + (b - a) * i / pieces, (b - a) / pieces
                at = segment.at((low + wide * (1.0 + xi) / 2.0 - x0) / segment.length)
                stiffness = getattr(at, port if port == "torsion" else f"bending_{port}")
                total += float(weights @ (1.0 / stiffness)) * wide / 2.0
        edge = 1e-9 * self.length
        ends = [*self._starts, self.length]
        for joint in self.joints:
            c = joint.stiffness(port)
            if c is not None and start - edge <= ends[joint.after_segment] < end - edge:
                total += 1.0 / c
        return total

    def depth(self, x: float, plane: str) -> float:
        """Extent of the section at `x` in a plane [m], for drawing; 0 where the shape is not known."""
        segment, fraction = self._at(x)
        f = min(max(fraction, 0.0), 1.0)
        first, last = segment.section.depth(plane), segment.end.depth(plane)
        return (1.0 - f) * (first or last) + f * (last or first)  # one end may say nothing
