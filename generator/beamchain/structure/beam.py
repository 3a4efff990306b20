"""The elastic appendage: segments, compliant joints and lumped bodies along a straight axis x, root at x = 0."""

from functools import lru_cache
from itertools import pairwise
from math import ceil, log2
from typing import Any, Literal, NamedTuple

import msgspec
import numpy as np

from beamchain.checks import not_negative, one_of, positive, whole
from beamchain.errors import InputError
from beamchain.port import PORTS, Array, PortModel
from beamchain.structure import elements
from beamchain.structure.material import Material
from beamchain.structure.section import Equivalent, Section

MOST_SEGMENTS = 200

Theory = Literal["euler", "timoshenko"]


class Stations(NamedTuple):
    """Stiffness and inertia per length at `k` stations, each `(k,)`, SI."""

    bending_xy: Array
    bending_xz: Array
    torsion: Array
    axial: Array
    mass: Array
    polar: Array
    shear_xy: Array
    shear_xz: Array
    rotary_xy: Array
    rotary_xz: Array


class Segment(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A stretch of the appendage with one section, or a linear taper between two.

    Args:
        length: [m].
        section: at its root end.
        section_end: at its tip end, same shape; none: prismatic.
        material: needed for every shape but `equivalent`, which takes none.
        nonstructural_mass: carried without stiffness [kg/m].
        theory: "euler" or "timoshenko" (shear and rotary inertia).
        shear_factor: Timoshenko's k; Cowper's value for the shape where not given.
    """

    length: float
    section: Section
    section_end: Section | None = None
    material: Material | None = None
    nonstructural_mass: float = 0.0
    theory: Theory = "euler"
    shear_factor: float | None = None

    def __post_init__(self) -> None:
        positive("length", self.length, "m")
        not_negative("nonstructural_mass", self.nonstructural_mass, "kg/m")
        one_of("theory", self.theory, ("euler", "timoshenko"))
        if self.section_end is not None and type(self.section_end) is not type(self.section):
            raise InputError(
                f'section_end has shape "{_shape(self.section_end)}" but section has "{_shape(self.section)}"; '
                "a taper needs the same shape at both ends: split the segment where the shape changes."
            )
        if isinstance(self.section, Equivalent):
            if self.material is not None:
                raise InputError(
                    'material is given beside an "equivalent" section, which already holds EI and mass; '
                    "leave material out."
                )
            if self.theory == "timoshenko":
                raise InputError(
                    'theory = "timoshenko" needs a drawn section; an "equivalent" one takes theory = "euler".'
                )
        elif self.material is None:
            raise InputError(
                "material is missing; "
                "add material = { youngs_modulus = 7e10, density = 2700.0, poissons_ratio = 0.33 }."
            )
        if self.shear_factor is not None:
            positive("shear_factor", self.shear_factor, "")
            if self.theory != "timoshenko":
                raise InputError('shear_factor is given but theory = "euler" has no shear; set theory = "timoshenko".')

    @property
    def taper(self) -> float:
        """Largest ratio between a dimension at the two ends, at least 1."""
        return self.section.ratio(self.section if self.section_end is None else self.section_end)

    def at(self, fraction: Array) -> Stations:
        """Stiffness and inertia at `fraction` `(k,)` of the length."""
        end = self.section if self.section_end is None else self.section_end
        if isinstance(self.section, Equivalent):
            v = self.section.at(end, fraction)
            nothing = np.zeros_like(fraction)
            return Stations(
                v["bending_stiffness_xy"], v["bending_stiffness_xz"], v["torsion_stiffness"], v["axial_stiffness"],
                v["linear_mass"] + self.nonstructural_mass, v["polar_inertia"], nothing, nothing, nothing, nothing,
            )  # fmt: skip
        assert self.material is not None
        e, g, rho, nu = self.material.youngs_modulus, self.material.g, self.material.density, self.material.nu
        s = self.section.geometry(end, fraction)
        kxy, kxz = (
            self.section.cowper(nu, plane) if self.shear_factor is None else self.shear_factor for plane in ("xy", "xz")
        )
        return Stations(
            e * s.second_moment_z, e * s.second_moment_y, g * s.torsion_constant, e * s.area,
            rho * s.area + self.nonstructural_mass, rho * s.polar_moment,
            kxy * g * s.area, kxz * g * s.area, rho * s.second_moment_z, rho * s.second_moment_y,
        )  # fmt: skip


class Joint(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A compliant hinge line after a segment; a stiffness left out is rigid.

    Args:
        after_segment: 1, 2, ...; 0: at the root.
        stiffness_xy: [N m/rad].
        stiffness_xz: [N m/rad].
        stiffness_torsion: [N m/rad].
    """

    after_segment: int
    stiffness_xy: float | None = None
    stiffness_xz: float | None = None
    stiffness_torsion: float | None = None

    def __post_init__(self) -> None:
        whole("after_segment", self.after_segment, 0, 10_000)
        for name in ("stiffness_xy", "stiffness_xz", "stiffness_torsion"):
            if getattr(self, name) is not None:
                positive(name, getattr(self, name), "N m/rad", cure="Leave it out for a rigid joint.")
        if self.stiffness_xy is None and self.stiffness_xz is None and self.stiffness_torsion is None:
            raise InputError(
                "the joint gives no stiffness; give stiffness_xy, stiffness_xz or stiffness_torsion, or remove it."
            )

    def stiffness(self, port: str) -> float | None:
        """Stiffness in a port [N m/rad]; None: rigid."""
        return getattr(self, f"stiffness_{port}", None)


class Lump(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A rigid body carried at `x` [m]: `mass` [kg], principal `inertia` about its own centre [kg m^2]."""

    x: float
    mass: float
    inertia: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        not_negative("x", self.x, "m")
        positive("mass", self.mass, "kg")
        body_inertia("inertia", self.inertia)


def body_inertia(name: str, values: tuple[float, float, float]) -> None:
    """Three principal inertias that a rigid body can have."""
    if len(values) != 3:
        raise InputError(f"{name} = {values!r} must hold three numbers [Ixx, Iyy, Izz] in kg m^2.")
    a, b, c = sorted(not_negative(f"{name}[{i}]", v, "kg m^2") for i, v in enumerate(values))
    if c > (a + b) * (1.0 + 1e-9):
        raise InputError(
            f"{name} = {list(values)!r} belongs to no rigid body: the largest exceeds the sum of the other two; "
            "check the order [Ixx, Iyy, Izz] and the units (kg m^2)."
        )


class Moments(NamedTuple):
    """Mass, first and second moment about the root and polar inertia of a stretch [kg, kg m, kg m^2, kg m^2]."""

    mass: float
    first: float
    second: float
    polar: float
    rotary_xy: float
    rotary_xz: float


class Beam(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A straight elastic appendage.

    Args:
        segments: from the root outwards.
        joints: compliant hinge lines between segments.
        lumps: rigid bodies carried along the way.
    """

    segments: tuple[Segment, ...]
    joints: tuple[Joint, ...] = ()
    lumps: tuple[Lump, ...] = ()

    def __post_init__(self) -> None:
        for name in ("segments", "joints", "lumps"):
            object_setattr(self, name, tuple(getattr(self, name)))
        if not self.segments:
            raise InputError(
                "the beam has no segment; give at least one [[segment]] with length, section and material."
            )
        if len(self.segments) > MOST_SEGMENTS:
            raise InputError(
                f"{len(self.segments)} segments are given; at most {MOST_SEGMENTS} are taken: join equal neighbours."
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
        for lump in self.lumps:
            if lump.x > self.length * (1.0 + 1e-9):
                raise InputError(
                    f"lump.x = {lump.x!r} m lies beyond the tip at {self.length!r} m; move it onto the appendage."
                )

    @property
    def length(self) -> float:
        """Root to tip [m]."""
        return sum(segment.length for segment in self.segments)

    @property
    def starts(self) -> list[float]:
        """x of the root end of each segment [m]."""
        return [sum(segment.length for segment in self.segments[:i]) for i in range(len(self.segments))]

    @property
    def uniform(self) -> bool:
        """One prismatic Euler segment and nothing else: the transcendental solution holds."""
        only = self.segments[0]
        return (
            len(self.segments) == 1
            and only.taper == 1.0
            and only.theory == "euler"
            and not self.joints
            and not self.lumps
        )

    def port(self, port: str = "xy", modes: int = 8) -> PortModel:
        """How the appendage pushes back at its root.

        Args:
            port: "xy", "xz", "torsion" or "axial".
            modes: lowest modes (free, held or on any hub) converged to 1e-11 relative, or to rounding.

        Returns:
            All modes of the discretisation, more than `modes`, so that its residual mass is the beam's own to the
            same precision.

        Raises:
            InputError: unknown port, or a port in which the appendage is rigid.
        """
        one_of("port", port, PORTS)
        return _converged(self, port, whole("modes", modes, 0, 60))

    def rigid_mass(self) -> Array:
        """`(6, 6)` mass matrix of the frozen appendage about the root, motions (x, y, z, rotations)."""
        m = self.moments(0.0, self.length, closed=True)
        out = np.diag([m.mass, m.mass, m.mass, m.polar, m.second + m.rotary_xz, m.second + m.rotary_xy])
        out[1, 5] = out[5, 1] = m.first
        out[2, 4] = out[4, 2] = -m.first
        return out

    def moments(self, start: float, end: float, *, closed: bool = False) -> Moments:
        """Moments of the stretch `[start, end)` about the root; `closed` takes in a lump at `end` itself."""
        total = np.zeros(6)
        xi, weights = elements.gauss(6)
        for x0, segment in zip(self.starts, self.segments, strict=True):
            a, b = max(start, x0), min(end, x0 + segment.length)
            if b <= a:
                continue
            x = a + (b - a) * (1.0 + xi) / 2.0
            at = segment.at((x - x0) / segment.length)
            w = weights * (b - a) / 2.0
            rotary = segment.theory == "timoshenko"
            total += np.array([
                w @ at.mass, w @ (at.mass * x), w @ (at.mass * x**2), w @ at.polar,
                w @ at.rotary_xy if rotary else 0.0, w @ at.rotary_xz if rotary else 0.0,
            ])  # fmt: skip
        edge = 1e-9 * self.length
        for lump in self.lumps:
            if start - edge <= lump.x < end - edge or (closed and abs(lump.x - end) <= edge):
                ix, iy, iz = lump.inertia
                m, x = lump.mass, lump.x
                total += [m, m * x, m * x**2, ix, iz, iy]
        return Moments(*(float(v) for v in total))

    def density(self, x: float, port: str) -> Array:
        """`(3,)` derivative of mass, first and second moment (rotary inertia in it) at `x` [m] in a `port`, without lumps."""
        index = max(int(np.searchsorted(np.array(self.starts), x, side="right")) - 1, 0)
        segment = self.segments[index]
        at = segment.at(np.array([(x - self.starts[index]) / segment.length]))
        mass = float(at.mass[0])
        rotary = float((at.rotary_xy if port == "xy" else at.rotary_xz)[0]) if segment.theory == "timoshenko" else 0.0
        return np.array([mass, mass * x, mass * x**2 + rotary])

    def compliance(self, start: float, end: float, port: str) -> float:
        """Rotation of the stretch `[start, end)` in a `port` per unit moment, joints inside included [rad/(N m)]."""
        total = 0.0
        xi, weights = elements.gauss(24)
        for x0, segment in zip(self.starts, self.segments, strict=True):
            a, b = max(start, x0), min(end, x0 + segment.length)
            pieces = 1 if segment.taper == 1.0 else 8
            for i in range(pieces if b > a else 0):
                low, wide = a + (b - a) * i / pieces, (b - a) / pieces
                at = segment.at((low + wide * (1.0 + xi) / 2.0 - x0) / segment.length)
                stiffness = at.bending_xy if port == "xy" else at.bending_xz if port == "xz" else at.torsion
                total += float(weights @ (1.0 / stiffness)) * wide / 2.0
        edge = 1e-9 * self.length
        ends = [*self.starts, self.length]
        for joint in self.joints:
            c = joint.stiffness(port)
            if c is not None and start - edge <= ends[joint.after_segment] < end - edge:
                total += 1.0 / c
        return total

    def depth(self, x: float, plane: str) -> float:
        """Extent of the section at `x` in a plane [m], for drawing; 0 where the shape is not known."""
        index = int(np.searchsorted(np.array(self.starts), x, side="right")) - 1
        segment = self.segments[max(index, 0)]
        f = min(max((x - self.starts[max(index, 0)]) / segment.length, 0.0), 1.0)
        end = segment.section if segment.section_end is None else segment.section_end
        return (1.0 - f) * segment.section.depth(plane) + f * end.depth(plane)


object_setattr = msgspec.structs.force_setattr


def _shape(section: Any) -> str:
    return type(section).__name__.lower()


def _pieces(beam: Beam, port: str, functions: int) -> list[elements.Piece]:
    """The segments, cut at lumps and cut again where they taper strongly, sampled for one port."""
    out: list[elements.Piece] = []
    xi, _ = elements.gauss(functions + 5)
    cuts = [lump.x for lump in beam.lumps]
    for x0, segment in zip(beam.starts, beam.segments, strict=True):
        inner = [c for c in cuts if x0 + 1e-9 * beam.length < c < x0 + segment.length - 1e-9 * beam.length]
        count = max(1, ceil(log2(segment.taper) - 1e-9))
        # geometric grading: every piece tapers by the same ratio
        grown = segment.taper ** (np.arange(1, count) / count)
        edges = (grown - 1.0) / (segment.taper - 1.0) if count > 1 else np.zeros(0)
        if count > 1 and _shrinks(segment):
            edges = 1.0 - edges
        points = sorted({x0, x0 + segment.length, *inner, *(x0 + segment.length * float(e) for e in edges)})
        for a, b in pairwise(points):
            at = segment.at((a + (b - a) * (1.0 + xi) / 2.0 - x0) / segment.length)
            bending = port in ("xy", "xz")
            sheared = bending and segment.theory == "timoshenko"
            out.append(
                elements.Piece(
                    start=a,
                    length=b - a,
                    stiffness={"xy": at.bending_xy, "xz": at.bending_xz, "torsion": at.torsion, "axial": at.axial}[
                        port
                    ],
                    inertia=at.polar if port == "torsion" else at.mass,
                    shear_stiffness=(at.shear_xy if port == "xy" else at.shear_xz) if sheared else None,
                    rotary_inertia=(at.rotary_xy if port == "xy" else at.rotary_xz) if sheared else None,
                )
            )
    return out


def _shrinks(segment: Segment) -> bool:
    """The dimension with the largest ratio is smaller at the tip end."""
    assert segment.section_end is not None
    pairs = [(getattr(segment.section, n), getattr(segment.section_end, n)) for n in segment.section.__struct_fields__]
    a, b = max(((a, b) for a, b in pairs if a > 0 and b > 0), key=lambda p: max(p[0] / p[1], p[1] / p[0]))
    return a > b


def _discretised(beam: Beam, port: str, functions: int) -> PortModel:
    bending = port in ("xy", "xz")
    pieces = _pieces(beam, port, functions)
    if any(np.any(p.stiffness <= 0.0) for p in pieces):
        raise InputError(
            f'port "{port}": a segment states no stiffness there (an "equivalent" section with 0, rigid); '
            f"set modes.{port} = 0 or give its stiffness."
        )
    if (
        port == "torsion"
        and not any(np.any(p.inertia > 0.0) for p in pieces)
        and not any(b.inertia[0] for b in beam.lumps)
    ):
        raise InputError(
            'port "torsion": the appendage has no polar inertia; give polar_inertia or set modes.torsion = 0.'
        )
    ends = [0.0, *(x + s.length for x, s in zip(beam.starts, beam.segments, strict=True))]
    hinges = [elements.Hinge(ends[j.after_segment], c) for j in beam.joints if (c := j.stiffness(port)) is not None]
    about = {"xy": 2, "xz": 1, "torsion": 0}
    bodies = [
        elements.Body(
            lump.x,
            lump.inertia[0] if port == "torsion" else lump.mass,
            lump.inertia[about.get(port, 0)] if bending else 0.0,
        )
        for lump in beam.lumps
    ]
    return elements.assemble(pieces, hinges, bodies, functions, bending=bending)


@lru_cache(maxsize=256)
def _converged(beam: Beam, port: str, modes: int) -> PortModel:
    """Raise the polynomial degree until the lowest `modes` held and free frequencies stand still."""
    wanted = max(modes, 1)
    functions = 4 + ceil((10 + 1.6 * wanted) / len(beam.segments))
    coarse, before = _discretised(beam, port, functions), np.inf
    while True:
        fine = _discretised(beam, port, functions + 4)
        change = 0.0
        for a, b in ((coarse.frequencies, fine.frequencies), (coarse.free_frequencies, fine.free_frequencies)):
            k = min(wanted, a.size, b.size)
            change = max(change, float(np.max(np.abs(b[:k] / a[:k] - 1.0), initial=0.0)))
        stands = change < 1e-9 and change > 0.3 * before  # rounding, which no degree mends
        if change < 1e-12 * max(10.0, wanted) or stands or functions > 60:
            return fine
        functions, coarse, before = functions + 4, fine, change
