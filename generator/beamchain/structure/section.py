"""Cross-sections and materials.

Bending in plane xy uses the second moment about z, bending in plane xz the one about y.

Only sections whose y and z axes are principal and whose shear centre lies on the axis are
represented: these shapes have both by symmetry, and `custom` asks the user for principal values.
"""

from collections.abc import Mapping
from typing import Annotated, NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyval

from beamchain.checks import Struct, field
from beamchain.errors import InputError
from beamchain.ports.motions import Array

ZETA_5 = 1.03692775514337  # Riemann's zeta at 5
ROOT = np.zeros(())  # fraction of a taper at which it starts

SOFT = 1e6  #: modulus [N/m^2]: rubber has more
IN_MEGA = 1e3  # a modulus from here on that is soft was meant in MPa, below in GPa


class Material(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Isotropic linear elastic material.

    Raises:
        InputError: a value is out of range, or poissons_ratio and shear_modulus are
            given and disagree.

    Example:
        >>> import beamchain as bc
        >>> round(bc.Material(youngs_modulus=7e10, density=2700.0, poissons_ratio=0.33).g / 1e9, 2)
        26.32
    """

    youngs_modulus: Annotated[float, field("modulus of elasticity E", "N/m^2", above=0.0)]
    density: Annotated[float, field("density", "kg/m^3", above=0.0)]
    poissons_ratio: Annotated[
        float | None,
        field(
            "ratio of Poisson, which gives the shear modulus; 0.3 where neither is given",
            "",
            above=-1.0,
            most=0.5,
            cure="Metals have 0.3.",
        ),
    ] = None
    shear_modulus: Annotated[float | None, field("shear modulus G", "N/m^2", above=0.0)] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.shear_modulus is not None and self.poissons_ratio is not None:
            from_ratio = self.youngs_modulus / (2.0 * (1.0 + self.poissons_ratio))
            if abs(from_ratio / self.shear_modulus - 1.0) > 1e-6:
                raise InputError(
                    f"shear_modulus = {self.shear_modulus!r} and poissons_ratio = "
                    f"{self.poissons_ratio!r} disagree (the ratio gives {from_ratio:.6g} N/m^2); "
                    "give one of them."
                )

    @property
    def nu(self) -> float:
        """Poisson's ratio, 0.3 where nothing is given [-]."""
        if self.poissons_ratio is not None:
            return self.poissons_ratio
        if self.shear_modulus is not None:
            return self.youngs_modulus / (2.0 * self.shear_modulus) - 1.0
        return 0.3

    @property
    def g(self) -> float:
        """Shear modulus [N/m^2]."""
        if self.shear_modulus is not None:
            return self.shear_modulus
        return self.youngs_modulus / (2.0 * (1.0 + self.nu))


def soft_modulus(modulus: float) -> str:
    """What is odd about a modulus below `SOFT`, and what was probably meant."""
    unit, factor = ("MPa", 1e6) if modulus >= IN_MEGA else ("GPa", 1e9)
    return (
        f"youngs_modulus = {modulus:g} N/m^2 is softer than rubber; if {unit} were meant, write "
        f"{modulus * factor:g}"
    )


class Geometry(NamedTuple):
    """Properties of a section at `k` stations, each `(k,)`, SI."""

    area: Array
    second_moment_z: Array
    second_moment_y: Array
    torsion_constant: Array
    polar_moment: Array


class Outline(NamedTuple):
    """Half widths of a section along y and z `(k,)` [m], a circle or a rectangle; NaN where they
    are not known."""

    half_y: Array
    half_z: Array
    is_round: bool


class ShearFactor(NamedTuple):
    """Shear factor `(1 + nu)/(p + q nu)` of Poisson's ratio nu, after G. R. Cowper, J. Appl. Mech.
    33 (1966) 335."""

    p: Array | float = 1.0
    q: Array | float = 1.0

    def at(self, nu: float) -> Array | float:
        """That of nu."""
        return (1.0 + nu) / (self.p + self.q * nu)


class SectionProperties(NamedTuple):
    """What follows from the dimensions of a section, at `k` stations.

    `shear_xy`, `shear_xz`: by plane of bending.
    """

    geometry: Geometry
    outline: Outline
    shear_xy: ShearFactor
    shear_xz: ShearFactor


class _Section(Struct, frozen=True, kw_only=True):
    """Dimensions of a section; `at` interpolates them linearly towards the other end of a taper."""

    def at(self, end: "_Section", fraction: Array) -> dict[str, Array]:
        """Dimensions at `fraction` `(k,)` of the way to `end`, a section of the same shape."""
        here = self.dimensions()
        there = end.dimensions()
        return {name: (1.0 - fraction) * here[name] + fraction * there[name] for name in here}

    def dimensions(self) -> dict[str, float]:
        """The numbers that are interpolated; what was left out stands at its default."""
        names = [name for name in self.__struct_fields__ if name != "draw"]
        return {name: float(getattr(self, name)) for name in names}

    def ratio(self, end: "_Section") -> float:
        """Largest ratio of a dimension between the two ends, at least 1."""
        ratios = [max(a / b, b / a) for a, b in self.pairs(end)]
        return max([1.0, *ratios])

    def pairs(self, end: "_Section") -> list[tuple[float, float]]:
        """Every dimension at the two ends, without those that are 0."""
        there = end.dimensions()
        pairs = [(here, there[name]) for name, here in self.dimensions().items()]
        return [(a, b) for a, b in pairs if a > 0.0 and b > 0.0]

    def depth(self, plane: str) -> float:
        """Extent in the plane of bending [m], for drawing; 0 where the shape is not known."""
        raise NotImplementedError


class Solid(_Section, frozen=True, kw_only=True):
    """A section that a drawing fixes, so that a material gives its stiffness and mass."""

    def _of(self, dims: Mapping[str, Array]) -> SectionProperties:
        """The properties of a section of this shape with other dimensions, by name."""
        raise NotImplementedError

    def _properties(self, end: "_Section", fraction: Array) -> SectionProperties:
        """All properties at `fraction` `(k,)` of the way to `end`."""
        return self._of(self.at(end, fraction))

    def geometry(self, end: "_Section", fraction: Array) -> Geometry:
        """Section properties at `fraction` `(k,)` of the way to `end`."""
        return self._properties(end, fraction).geometry

    def half_widths(self, end: "_Section", fraction: Array) -> Outline:
        """The outermost fibres at `fraction` `(k,)` of the way to `end`."""
        return self._properties(end, fraction).outline

    def depth(self, plane: str) -> float:
        outline = self.half_widths(self, ROOT)
        half = float(outline.half_y if plane == "xy" else outline.half_z)
        return 0.0 if np.isnan(half) else 2.0 * half

    def cowper(
        self, nu: float, plane: str, end: "_Section | None" = None, fraction: Array = ROOT
    ) -> Array | float:
        """Shear factor for Poisson's ratio `nu` in a `plane` at `fraction` of the way to `end`."""
        properties = self._properties(end or self, fraction)
        return (properties.shear_xy if plane == "xy" else properties.shear_xz).at(nu)


class Round(
    Solid, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="shape", tag="round"
):
    """Solid circle.

    Example:
        >>> import beamchain as bc
        >>> bc.Round(diameter=0.012)
        Round(diameter=0.012)
    """

    diameter: Annotated[float, field("diameter", "m", above=0.0)]

    def _of(self, dims: Mapping[str, Array]) -> SectionProperties:
        d = dims["diameter"]
        shear = ShearFactor(7.0 / 6.0)
        return _circular(np.pi * d**2 / 4.0, np.pi * d**4 / 64.0, d / 2.0, shear)


class Tube(
    Solid, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="shape", tag="tube"
):
    """Hollow circle.

    Example:
        >>> import beamchain as bc
        >>> bc.Tube(outer_diameter=0.05, wall=0.002)
        Tube(outer_diameter=0.05, wall=0.002)
    """

    outer_diameter: Annotated[float, field("outer diameter", "m", above=0.0)]
    wall: Annotated[float, field("wall thickness", "m", above=0.0)]

    def __post_init__(self) -> None:
        super().__post_init__()
        if 2.0 * self.wall > self.outer_diameter * (1.0 + 1e-12):
            raise InputError(
                f"wall = {self.wall!r} m is more than half of outer_diameter = "
                f"{self.outer_diameter!r} m; "
                'make the wall thinner or use shape = "round".'
            )

    def _of(self, dims: Mapping[str, Array]) -> SectionProperties:
        d = dims["outer_diameter"]
        t = dims["wall"]
        # written in d and t, so that a thin wall costs no digits
        area = np.pi * t * (d - t)
        i = area * (d**2 - 2.0 * d * t + 2.0 * t**2) / 8.0
        # k = 6 (1 + nu) (1 + m^2)^2 / ((7 + 6 nu) (1 + m^2)^2 + (20 + 12 nu) m^2),
        # m: inner over outer diameter
        m2 = (1.0 - 2.0 * t / d) ** 2
        r = m2 / (1.0 + m2) ** 2
        return _circular(area, i, d / 2.0, ShearFactor((7.0 + 20.0 * r) / 6.0, 1.0 + 2.0 * r))


class Rectangle(
    Solid,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="shape",
    tag="rectangle",
):
    """Solid rectangle.

    Example:
        >>> import beamchain as bc
        >>> bc.Rectangle(width_y=0.022, width_z=1.2)
        Rectangle(width_y=0.022, width_z=1.2)
    """

    width_y: Annotated[float, field("width along y", "m", above=0.0)]
    width_z: Annotated[float, field("width along z", "m", above=0.0)]

    def _of(self, dims: Mapping[str, Array]) -> SectionProperties:
        b = dims["width_y"]
        h = dims["width_z"]
        iz = h * b**3 / 12.0
        iy = b * h**3 / 12.0
        geometry = Geometry(b * h, iz, iy, rectangle_torsion(b, h), iz + iy)
        shear = ShearFactor(12.0 / 10.0, 11.0 / 10.0)
        return SectionProperties(geometry, Outline(b / 2.0, h / 2.0, is_round=False), shear, shear)


class Box(
    Solid, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="shape", tag="box"
):
    """Hollow rectangle; thin-walled in torsion (Bredt).

    Example:
        >>> import beamchain as bc
        >>> bc.Box(width_y=0.1, width_z=0.2, wall=0.003)
        Box(width_y=0.1, width_z=0.2, wall=0.003)
    """

    width_y: Annotated[float, field("outer width along y", "m", above=0.0)]
    width_z: Annotated[float, field("outer width along z", "m", above=0.0)]
    wall: Annotated[float, field("wall thickness", "m", above=0.0)]

    def __post_init__(self) -> None:
        super().__post_init__()
        if 2.0 * self.wall >= min(self.width_y, self.width_z):
            raise InputError(
                f"wall = {self.wall!r} m must be less than half of the smaller width "
                f"{min(self.width_y, self.width_z)!r} m; make the wall thinner or use shape = "
                '"rectangle".'
            )

    def _of(self, dims: Mapping[str, Array]) -> SectionProperties:
        b = dims["width_y"]
        h = dims["width_z"]
        t = dims["wall"]
        area = 2.0 * t * (b + h - 2.0 * t)
        inner_b = b - 2.0 * t
        inner_h = h - 2.0 * t
        iz = (h * b**3 - inner_h * inner_b**3) / 12.0
        iy = (b * h**3 - inner_b * inner_h**3) / 12.0
        # Bredt: J = 4 A_m^2 t / U_m, with the area and length of the wall's middle line
        middle_b = b - t
        middle_h = h - t
        torsion = 2.0 * t * (middle_b * middle_h) ** 2 / (middle_b + middle_h)
        geometry = Geometry(area, iz, iy, torsion, iz + iy)
        outline = Outline(b / 2.0, h / 2.0, is_round=False)
        return SectionProperties(geometry, outline, _box_shear(h / b), _box_shear(b / h))


class Custom(
    Solid, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="shape", tag="custom"
):
    """Any section, given by its properties about principal axes through the centroid.

    Example:
        >>> import beamchain as bc
        >>> bc.Custom(
        ...     area=1e-3, second_moment_z=2e-7, second_moment_y=3e-7, torsion_constant=1e-8
        ... ).area
        0.001
    """

    area: Annotated[float, field("area of the cross-section", "m^2", above=0.0)]
    second_moment_z: Annotated[
        float, field("second moment of area about z, for bending in plane xy", "m^4", above=0.0)
    ]
    second_moment_y: Annotated[
        float, field("second moment of area about y, for bending in plane xz", "m^4", above=0.0)
    ]
    torsion_constant: Annotated[
        float, field("torsion constant J of Saint-Venant", "m^4", above=0.0)
    ]
    polar_moment: Annotated[
        float,
        field("polar moment; the sum of both second moments where left out", "m^4", least=0.0),
    ] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        total = self.second_moment_z + self.second_moment_y
        if self.polar_moment and abs(self.polar_moment / total - 1.0) > 0.05:
            raise InputError(
                f"polar_moment = {self.polar_moment!r} m^4 should be second_moment_y + "
                f"second_moment_z = {total:.6g} m^4 (the axes must be principal); leave it out, or "
                "state polar inertia with an `equivalent` section."
            )

    def _of(self, dims: Mapping[str, Array]) -> SectionProperties:
        geometry = Geometry(*(dims[name] for name in Geometry._fields))
        unknown = np.full_like(geometry.area, np.nan)
        shear = ShearFactor()
        return SectionProperties(geometry, Outline(unknown, unknown, is_round=False), shear, shear)

    def dimensions(self) -> dict[str, float]:
        """Dimensions; the polar moment is the sum of the other two where left out."""
        dims = super().dimensions()
        total = dims["second_moment_y"] + dims["second_moment_z"]
        return {**dims, "polar_moment": dims["polar_moment"] or total}


class Draw(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Outer dimensions with which a section is drawn; they have no part in mass or stiffness.

    A section thinner than a quarter of its width is drawn as a panel with cells, any other
    as a truss. The width lies across the plane in which the section is softer, along z
    where both are equal.

    Raises:
        InputError: the thickness is more than the width.

    Example:
        >>> import beamchain as bc
        >>> bc.Equivalent(
        ...     bending_stiffness_xy=2e3,
        ...     linear_mass=4.0,
        ...     draw=bc.spec.Draw(width=1.2, thickness=0.03),
        ... ).depth("xz")
        1.2
    """

    width: Annotated[float, field("width drawn", "m", above=0.0)]
    thickness: Annotated[float, field("thickness drawn, at most the width", "m", above=0.0)]

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.thickness > self.width:
            raise InputError(
                f"thickness = {self.thickness!r} m is more than width = {self.width!r} m; give the "
                "larger as the width."
            )

    @property
    def panel(self) -> bool:
        """Whether it is thin enough to be a panel."""
        return self.thickness < self.width / 4.0


class Equivalent(
    _Section,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="shape",
    tag="equivalent",
):
    """A truss or array, given by its measured stiffness and mass per length; needs no material.

    Example:
        >>> import beamchain as bc
        >>> mast = bc.Equivalent(
        ...     bending_stiffness_xy=8e5,
        ...     torsion_stiffness=1.5e5,
        ...     linear_mass=2.0,
        ...     polar_inertia=0.12,
        ... )
        >>> mast.torsion_stiffness
        150000.0
    """

    bending_stiffness_xy: Annotated[
        float, field("bending stiffness EI in plane xy", "N m^2", above=0.0)
    ]
    linear_mass: Annotated[float, field("mass per length", "kg/m", above=0.0)]
    bending_stiffness_xz: Annotated[
        float,
        field("bending stiffness EI in plane xz; as in xy where left out", "N m^2", least=0.0),
    ] = 0.0
    torsion_stiffness: Annotated[
        float, field("torsional stiffness GJ; 0 is rigid", "N m^2", least=0.0)
    ] = 0.0
    axial_stiffness: Annotated[float, field("axial stiffness EA; 0 is rigid", "N", least=0.0)] = 0.0
    polar_inertia: Annotated[
        float, field("moment of inertia about x per length", "kg m", least=0.0)
    ] = 0.0
    draw: Annotated[
        Draw | None,
        field(
            "width and thickness of its picture; a plain truss where left out; no mass or stiffness"
        ),
    ] = None

    def depth(self, plane: str) -> float:
        if self.draw is None:
            return 0.0
        stiffness_xz = self.dimensions()["bending_stiffness_xz"]
        soft = "xz" if stiffness_xz < self.bending_stiffness_xy else "xy"
        return self.draw.thickness if plane == soft else self.draw.width

    def dimensions(self) -> dict[str, float]:
        """Dimensions; EI in xz is that in xy where left out."""
        dims = super().dimensions()
        stiffness_xz = dims["bending_stiffness_xz"] or dims["bending_stiffness_xy"]
        return {**dims, "bending_stiffness_xz": stiffness_xz}


Section = Round | Tube | Rectangle | Box | Custom | Equivalent


def _circular(
    area: Array, second_moment: Array, radius: Array, shear: ShearFactor
) -> SectionProperties:
    """Of a circle, solid or hollow."""
    i = second_moment
    outline = Outline(radius, radius, is_round=True)
    return SectionProperties(Geometry(area, i, i, 2.0 * i, 2.0 * i), outline, shear, shear)


def _box_shear(n: Array) -> ShearFactor:
    """Of a thin-walled box with n = b / h and m = b t_flange / (h t_web), here both the same:

    k = 10 (1 + nu) (1 + 3 m)^2 / (12 + 72 m + 150 m^2 + 90 m^3
        + nu (11 + 66 m + 135 m^2 + 90 m^3) + 10 n^2 ((3 + nu) m + 3 m^2))
    """
    unit = 10.0 * (1.0 + 3.0 * n) ** 2
    p, q = polyval(n, [12.0, 72.0, 150.0, 120.0, 30.0]), polyval(n, [11.0, 66.0, 135.0, 100.0])
    return ShearFactor(p / unit, q / unit)


def rectangle_torsion(b: Array, h: Array) -> Array:
    """Saint-Venant constant of `b` x `h` (Timoshenko, Goodier, art. 109).

    `J = long short^3 / 3 (1 - 192 / pi^5 short / long sum tanh(n pi long / (2 short)) / n^5)`
    over odd n.
    """
    long = np.maximum(b, h)
    short = np.minimum(b, h)
    odd = np.arange(1, 16, 2)[:, None]
    # sum 1 / n^5 over odd n is 31 / 32 zeta(5); the terms (tanh - 1) / n^5 then die out at once
    decay = np.exp(-odd * np.pi * long / short)
    terms = -2.0 * decay / (1.0 + decay) / odd**5
    series = np.sum(terms, axis=0) + 31.0 / 32.0 * ZETA_5
    return long * short**3 / 3.0 * (1.0 - 192.0 / np.pi**5 * short / long * series)
