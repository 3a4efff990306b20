"""Cross-sections and materials. Bending in plane xy uses the second moment about z, bending in plane xz the one about y.

Only sections whose y and z axes are principal and whose shear centre lies on the axis are represented: these shapes
have both by symmetry, and `custom` asks the user for principal values.
"""

from typing import NamedTuple

import numpy as np

from beamchain.checks import Struct, not_negative, number, own_numbers, positive
from beamchain.errors import InputError
from beamchain.ports.motions import Array

ZETA_5 = 1.03692775514337  # Riemann's zeta at 5


class Material(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Isotropic linear elastic material, SI.

    Args:
        youngs_modulus: E [N/m^2].
        density: rho [kg/m^3].
        poissons_ratio: nu, above -1 and at most 0.5; gives the shear modulus where that is not given.
        shear_modulus: G [N/m^2].

    Raises:
        InputError: a value is out of range, or both poissons_ratio and shear_modulus are given and disagree.
    """

    youngs_modulus: float
    density: float
    poissons_ratio: float | None = None
    shear_modulus: float | None = None

    def __post_init__(self) -> None:
        own_numbers(self)
        positive("youngs_modulus", self.youngs_modulus, "N/m^2")
        positive("density", self.density, "kg/m^3")
        if self.poissons_ratio is not None:
            nu = number("poissons_ratio", self.poissons_ratio, "")
            if not -1.0 < nu <= 0.5:
                raise InputError(f"poissons_ratio = {nu!r} must lie above -1 and at most at 0.5; metals have 0.3.")
        if self.shear_modulus is not None:
            positive("shear_modulus", self.shear_modulus, "N/m^2")
            if self.poissons_ratio is not None:
                from_ratio = self.youngs_modulus / (2.0 * (1.0 + self.poissons_ratio))
                if abs(from_ratio / self.shear_modulus - 1.0) > 1e-6:
                    raise InputError(
                        f"shear_modulus = {self.shear_modulus!r} and poissons_ratio = {self.poissons_ratio!r} disagree "
                        f"(the ratio gives {from_ratio:.6g} N/m^2); give one of them."
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


class Geometry(NamedTuple):
    """Properties of a section at `k` stations, each `(k,)`, SI."""

    area: Array
    second_moment_z: Array
    second_moment_y: Array
    torsion_constant: Array
    polar_moment: Array


class _Section(Struct, frozen=True, kw_only=True):
    """Dimensions of a section; `at` interpolates them linearly towards the other end of a taper."""

    def __post_init__(self) -> None:
        own_numbers(self)
        for name in self.__struct_fields__:
            positive(name, getattr(self, name), "m")

    def at(self, end: "_Section", fraction: Array) -> dict[str, Array]:
        """Dimensions at `fraction` `(k,)` of the way to `end`, a section of the same shape."""
        here, there = self.dimensions(), end.dimensions()
        return {name: (1.0 - fraction) * here[name] + fraction * there[name] for name in here}

    def dimensions(self) -> dict[str, float]:
        """The numbers that are interpolated; what was left out stands at its default."""
        return {name: float(getattr(self, name)) for name in self.__struct_fields__}

    def ratio(self, end: "_Section") -> float:
        """Largest ratio of a dimension between the two ends, at least 1."""
        pairs = [(getattr(self, name), getattr(end, name)) for name in self.__struct_fields__]
        return max([1.0, *(max(a / b, b / a) for a, b in pairs if a > 0.0 and b > 0.0)])

    def depth(self, plane: str) -> float:
        """Extent in the plane of bending [m], for drawing; 0 where the shape is not known."""
        return 0.0

    def cowper(self, nu: float, plane: str) -> float:
        """Shear factor of G. R. Cowper, J. Appl. Mech. 33 (1966) 335."""
        return 1.0


class _Solid(_Section, frozen=True, kw_only=True):
    """A section that a drawing fixes, so that a material gives its stiffness and mass."""

    def geometry(self, end: "_Section", fraction: Array) -> Geometry:
        """Section properties at `fraction` `(k,)` of the way to `end`."""
        raise NotImplementedError


class Round(_Solid, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="shape", tag="round"):
    """Solid circle of `diameter` [m]."""

    diameter: float

    def geometry(self, end: _Section, fraction: Array) -> Geometry:
        d = self.at(end, fraction)["diameter"]
        i = np.pi * d**4 / 64.0
        return Geometry(np.pi * d**2 / 4.0, i, i, 2.0 * i, 2.0 * i)

    def depth(self, plane: str) -> float:
        return self.diameter

    def cowper(self, nu: float, plane: str) -> float:
        return 6.0 * (1.0 + nu) / (7.0 + 6.0 * nu)


class Tube(_Solid, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="shape", tag="tube"):
    """Hollow circle of `outer_diameter` and `wall` thickness [m]."""

    outer_diameter: float
    wall: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if 2.0 * self.wall > self.outer_diameter * (1.0 + 1e-12):
            raise InputError(
                f"wall = {self.wall!r} m is more than half of outer_diameter = {self.outer_diameter!r} m; "
                'make the wall thinner or use shape = "round".'
            )

    def geometry(self, end: _Section, fraction: Array) -> Geometry:
        dims = self.at(end, fraction)
        d, t = dims["outer_diameter"], dims["wall"]
        # written in d and t, so that a thin wall costs no digits
        area = np.pi * t * (d - t)
        i = area * (d**2 - 2.0 * d * t + 2.0 * t**2) / 8.0
        return Geometry(area, i, i, 2.0 * i, 2.0 * i)

    def depth(self, plane: str) -> float:
        return self.outer_diameter

    def cowper(self, nu: float, plane: str) -> float:
        m2 = (1.0 - 2.0 * self.wall / self.outer_diameter) ** 2
        return 6.0 * (1.0 + nu) * (1.0 + m2) ** 2 / ((7.0 + 6.0 * nu) * (1.0 + m2) ** 2 + (20.0 + 12.0 * nu) * m2)


class Rectangle(_Solid, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="shape", tag="rectangle"):
    """Solid rectangle of `width_y` and `width_z` [m]."""

    width_y: float
    width_z: float

    def geometry(self, end: _Section, fraction: Array) -> Geometry:
        dims = self.at(end, fraction)
        b, h = dims["width_y"], dims["width_z"]
        iz, iy = h * b**3 / 12.0, b * h**3 / 12.0
        return Geometry(b * h, iz, iy, rectangle_torsion(b, h), iz + iy)

    def depth(self, plane: str) -> float:
        return self.width_y if plane == "xy" else self.width_z

    def cowper(self, nu: float, plane: str) -> float:
        return 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu)


class Box(_Solid, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="shape", tag="box"):
    """Hollow rectangle of outer `width_y`, `width_z` and `wall` thickness [m]; thin-walled in torsion (Bredt)."""

    width_y: float
    width_z: float
    wall: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if 2.0 * self.wall >= min(self.width_y, self.width_z):
            raise InputError(
                f"wall = {self.wall!r} m must be less than half of the smaller width "
                f'{min(self.width_y, self.width_z)!r} m; make the wall thinner or use shape = "rectangle".'
            )

    def geometry(self, end: _Section, fraction: Array) -> Geometry:
        dims = self.at(end, fraction)
        b, h, t = dims["width_y"], dims["width_z"], dims["wall"]
        area = 2.0 * t * (b + h - 2.0 * t)
        bi, hi = b - 2.0 * t, h - 2.0 * t
        iz, iy = (h * b**3 - hi * bi**3) / 12.0, (b * h**3 - bi * hi**3) / 12.0
        bm, hm = b - t, h - t
        return Geometry(area, iz, iy, 2.0 * t * (bm * hm) ** 2 / (bm + hm), iz + iy)

    def depth(self, plane: str) -> float:
        return self.width_y if plane == "xy" else self.width_z

    def cowper(self, nu: float, plane: str) -> float:
        # thin-walled box; n: flange over web, equal thickness
        b, h = (self.width_y, self.width_z) if plane == "xz" else (self.width_z, self.width_y)
        n = b / h
        m = n  # m = b t_flange / (h t_web)
        above = 10.0 * (1.0 + nu) * (1.0 + 3.0 * m) ** 2
        below = (
            12.0
            + 72.0 * m
            + 150.0 * m**2
            + 90.0 * m**3
            + nu * (11.0 + 66.0 * m + 135.0 * m**2 + 90.0 * m**3)
            + 10.0 * n**2 * ((3.0 + nu) * m + 3.0 * m**2)
        )
        return above / below


class Custom(_Solid, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="shape", tag="custom"):
    """Any section by its numbers: `area` [m^2], moments [m^4] about principal axes through the centroid.

    Args:
        area: cross-section area [m^2].
        second_moment_z: about z, bending in plane xy [m^4].
        second_moment_y: about y, bending in plane xz [m^4].
        torsion_constant: Saint-Venant constant J [m^4].
        polar_moment: second_moment_y + second_moment_z where not given [m^4].
    """

    area: float
    second_moment_z: float
    second_moment_y: float
    torsion_constant: float
    polar_moment: float = 0.0

    def __post_init__(self) -> None:
        own_numbers(self)
        for name in ("second_moment_z", "second_moment_y", "torsion_constant"):
            positive(name, getattr(self, name), "m^4")
        positive("area", self.area, "m^2")
        not_negative("polar_moment", self.polar_moment, "m^4")
        both = self.second_moment_z + self.second_moment_y
        if self.polar_moment and abs(self.polar_moment / both - 1.0) > 0.05:
            raise InputError(
                f"polar_moment = {self.polar_moment!r} m^4 should be second_moment_y + second_moment_z = {both:.6g} "
                "m^4 (the axes must be principal); leave it out, or state polar inertia with an `equivalent` section."
            )

    def geometry(self, end: _Section, fraction: Array) -> Geometry:
        v = self.at(end, fraction)
        iz, iy = v["second_moment_z"], v["second_moment_y"]
        return Geometry(v["area"], iz, iy, v["torsion_constant"], v["polar_moment"])

    def dimensions(self) -> dict[str, float]:
        """Dimensions; the polar moment is the sum of the other two where left out."""
        out = super().dimensions()
        return {**out, "polar_moment": out["polar_moment"] or out["second_moment_y"] + out["second_moment_z"]}


class Equivalent(_Section, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="shape", tag="equivalent"):
    """A truss or array by its measured stiffness and mass per length; takes no material.

    Args:
        bending_stiffness_xy: EI in plane xy [N m^2].
        bending_stiffness_xz: EI in plane xz [N m^2]; as in xy where not given.
        torsion_stiffness: GJ [N m^2]; 0: rigid in torsion.
        axial_stiffness: EA [N]; 0: rigid along x.
        linear_mass: mass per length [kg/m].
        polar_inertia: about x, per length [kg m].
    """

    bending_stiffness_xy: float
    linear_mass: float
    bending_stiffness_xz: float = 0.0
    torsion_stiffness: float = 0.0
    axial_stiffness: float = 0.0
    polar_inertia: float = 0.0

    def __post_init__(self) -> None:
        own_numbers(self)
        positive("bending_stiffness_xy", self.bending_stiffness_xy, "N m^2")
        positive("linear_mass", self.linear_mass, "kg/m")
        units = {"bending_stiffness_xz": "N m^2", "torsion_stiffness": "N m^2", "axial_stiffness": "N"}
        for name, unit in units.items():
            not_negative(name, getattr(self, name), unit)
        not_negative("polar_inertia", self.polar_inertia, "kg m")

    def dimensions(self) -> dict[str, float]:
        """Dimensions; EI in xz is that in xy where left out."""
        out = super().dimensions()
        return {**out, "bending_stiffness_xz": out["bending_stiffness_xz"] or out["bending_stiffness_xy"]}


Section = Round | Tube | Rectangle | Box | Custom | Equivalent


def rectangle_torsion(b: Array, h: Array) -> Array:
    """Saint-Venant constant of `b` x `h` (Timoshenko, Goodier, art. 109)."""
    long, short = np.maximum(b, h), np.minimum(b, h)
    odd = np.arange(1, 16, 2)[:, None]
    # tanh - 1 dies out at once; what it leaves is the sum of 1 / n^5 over odd n
    decay = np.exp(-odd * np.pi * long / short)
    rest = -2.0 * decay / (1.0 + decay) / odd**5
    series = np.sum(rest, axis=0) + 31.0 / 32.0 * ZETA_5
    return long * short**3 / 3.0 * (1.0 - 192.0 / np.pi**5 * short / long * series)
