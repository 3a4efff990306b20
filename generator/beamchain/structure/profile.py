"""Open, multi-cell and composite profiles, through sectionproperties (the extra `sections`).

Its axes x and y are y and z here. A beam bends about principal axes through its centre of mass and
twists about that axis without bending: a profile whose shear centre or elastic centre lies beside
it, or whose principal axes are turned, is refused with the figure. Warping is not restrained.
"""

import copy
import dataclasses
import warnings
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from beamchain.checks import Struct, field, of_type, positive
from beamchain.errors import InputError
from beamchain.late import importing
from beamchain.structure.section import Custom, Draw, Equivalent, Material, Solid

OFF_AXIS = 0.01  # of the radius of gyration: a coupling of a frequency by 1e-4
TURNED = 1e-4  # product of inertia over the moments: the same
THIN = 1.0  # elements over the square of the mean thickness: they are quadratic
MOST_ELEMENTS = 5000.0
MOST_POINTS = 5000
EXTRA = "pip install 'beamchain[sections]'"

Point = tuple[float, float]
_outline = field("corners [y, z] of the outline, in order; it closes itself", "m")
_holes = field("outlines of holes, each a list of corners [y, z]", "m")


class ProfilePart(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A part of a composite profile, of a material of its own; parts touch and do not overlap.

    Example:
        >>> import beamchain as bc
        >>> skin = bc.Material(youngs_modulus=7e10, density=1600.0, shear_modulus=5e9)
        >>> corners = ((0.0, 0.0), (0.1, 0.0), (0.1, 0.001), (0.0, 0.001))
        >>> len(bc.ProfilePart(outline=corners, material=skin).outline)
        4
    """

    outline: Annotated[tuple[Point, ...], _outline]
    material: Annotated[Material, field("material of the part")]
    holes: Annotated[tuple[tuple[Point, ...], ...], _holes] = ()


class Profile(
    Solid,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="shape",
    tag="profile",
):
    """A profile by its outline or its parts, computed by sectionproperties (the extra `sections`).

    In a segment it becomes a `Custom` section or, with parts, an `Equivalent` one, which need the
    extra no more.

    Example:
        >>> import beamchain as bc
        >>> bc.Profile(outline=((0.0, 0.0), (0.1, 0.0), (0.1, 0.05), (0.0, 0.05))).rotation
        0.0
    """

    outline: Annotated[tuple[Point, ...], _outline] = ()
    holes: Annotated[tuple[tuple[Point, ...], ...], _holes] = ()
    parts: Annotated[
        tuple[ProfilePart, ...],
        field("parts with materials of their own, in place of outline and holes"),
    ] = ()
    rotation: Annotated[
        float, field("angle about x by which the profile is turned before it is used", "rad")
    ] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if bool(self.outline) == bool(self.parts):
            raise InputError(
                'a "profile" section needs outline = [[y, z], ...], or parts = [{ outline = ..., '
                "material = ... }, ...], and not both."
            )
        if self.parts and self.holes:
            raise InputError("holes are given beside parts; write them into the part they are in.")

    def section(self) -> Custom | Equivalent:
        """The section that it is: `Custom` or, with parts, `Equivalent`.

        Raises:
            InputError: the outline is no area, sectionproperties is missing, or the profile couples
                bending and torsion or the two planes.
        """
        rings = [(part.outline, part.holes) for part in self.parts] or [(self.outline, self.holes)]
        found = _measure(_section_of(rings, self.rotation), _stiffness(self.parts))
        found.check("write rotation = {radians:.9g} into the section", self.rotation)
        if self.parts:
            return found.equivalent()
        return Custom(
            area=found.axial,
            second_moment_z=found.bending_xy,
            second_moment_y=found.bending_xz,
            torsion_constant=found.torsion,
        )


def section_from(
    section: Any, *, material: Material | None = None, unit: float = 1.0
) -> Equivalent:
    """The section of a sectionproperties `Section`: open, multi-cell or composite.

    Its axes x and y become y and z. EI, EA, mass and inertia per length are sums over its
    materials, GJ is that of a warping analysis weighted by the shear moduli.

    Args:
        section: a `sectionproperties.analysis.Section`, with its mesh; what was calculated before
            makes no difference.
        material: of all of it; default: those of its geometry, whose elastic modulus and density
            are then in N and kg per unit of length squared and cubed.
        unit: its unit of length [m]; 1e-3 for millimetres.

    Raises:
        InputError: it is no such section, has no materials, or its shear centre lies off the axis
            of mass, or its principal axes are turned against y and z: with the distance or angle.

    Example:
        >>> import beamchain as bc
        >>> bc.section_from("channel")
        Traceback (most recent call last):
            ...
        beamchain.errors.InputError: section = 'channel' is a str; give a sectionproperties Section.
    """
    geometry = getattr(section, "geometry", None)
    if geometry is None or not hasattr(section, "calculate_warping_properties"):
        raise InputError(
            f"section = {section!r:.60} is a {type(section).__name__}; give a sectionproperties "
            "Section."
        )
    if material is not None:
        of_type("material", material, Material, "a bc.Material")
    unit = positive("unit", unit, "m")
    parts = _parts_of(geometry)
    if material is None:
        if any(part.material.name == "default" for part in parts):
            raise InputError(
                "the section has sectionproperties' default material, which has no stiffness; give "
                "material=bc.Material(...), or materials to its geometry."
            )
        stiffness = [
            Stiffness(
                float(part.material.elastic_modulus) / unit**2,
                float(part.material.shear_modulus) / unit**2,
                float(part.material.density) / unit**3,
            )
            for part in parts
        ]
    else:
        stiffness = [_moduli(material)] * len(parts)
    found = _measure(section, stiffness, unit)
    found.check("turn its geometry, geometry.rotate_section({degrees:.9g})")
    return found.equivalent()


class Stiffness(NamedTuple):
    """Young's modulus, shear modulus [N/m^2] and density [kg/m^3] of a part."""

    youngs_modulus: float
    shear_modulus: float
    density: float


class Properties(NamedTuple):
    """Stiffness and mass of a profile, in SI; per unit of modulus and density where it has none.

    `shear_centre`, `elastic_centre`: `(2,)` from the centre of mass; `extent`: `(2,)` along y, z.
    """

    axial: float
    bending_xy: float
    bending_xz: float
    product: float
    torsion: float
    mass: float
    polar: float
    shear_centre: tuple[float, float]
    elastic_centre: tuple[float, float]
    extent: tuple[float, float]

    def check(self, cure: str, turned: float = 0.0) -> None:
        """Refuse what couples bending and torsion, or the two planes.

        `cure`: how to turn it, which so far is `turned` [rad].
        """
        gyration = np.sqrt(self.polar / self.mass)
        for word, place, why in (
            ("shear centre", self.shear_centre, "bending and torsion are coupled"),
            ("elastic centre", self.elastic_centre, "bending and extension are coupled"),
        ):
            distance = float(np.hypot(*place))
            if distance > OFF_AXIS * gyration:
                raise InputError(
                    f"the {word} of the profile lies {distance:.6g} m from its centre of mass "
                    f"(y {place[0]:.6g}, z {place[1]:.6g}; at most {OFF_AXIS:g} of the radius of "
                    f"gyration {gyration:.4g} m is taken), so that {why}, which no beam here has; "
                    "close or mirror the profile, or import the modes of a finite-element model "
                    "([imported])."
                )
        # y and z are principal where the product of inertia vanishes
        if abs(self.product) > TURNED * np.sqrt(self.bending_xy * self.bending_xz):
            # tan(2 angle) = -2 I_yz / (I_yy - I_zz)
            angle = 0.5 * np.arctan2(-2.0 * self.product, self.bending_xz - self.bending_xy)
            angle = (angle + np.pi / 4.0) % (np.pi / 2.0) - np.pi / 4.0  # the nearest of four
            turn = turned - angle
            told = cure.format(radians=turn, degrees=float(np.degrees(turn)))
            raise InputError(
                f"the principal axes of the profile are turned by {np.degrees(angle):.6g} degrees "
                f"about x against y and z, so that the two planes of bending are coupled; {told}, "
                f"and turn the frame it is mounted on by {np.degrees(-turn):.6g} degrees about x."
            )

    def equivalent(self) -> Equivalent:
        """The section by its stiffness and mass, drawn as large as it is."""
        return Equivalent(
            bending_stiffness_xy=self.bending_xy,
            bending_stiffness_xz=self.bending_xz,
            torsion_stiffness=self.torsion,
            axial_stiffness=self.axial,
            linear_mass=self.mass,
            polar_inertia=self.polar,
            draw=Draw(width=max(self.extent), thickness=min(self.extent)),
        )


def _moduli(material: Material) -> Stiffness:
    return Stiffness(material.youngs_modulus, material.g, material.density)


def _stiffness(parts: Sequence[ProfilePart]) -> list[Stiffness]:
    """Of parts; a profile without has modulus and density 1."""
    return [_moduli(part.material) for part in parts] or [Stiffness(1.0, 1.0, 1.0)]


def _parts_of(geometry: Any) -> list[Any]:
    return list(getattr(geometry, "geoms", None) or [geometry])


def _measure(section: Any, stiffness: Sequence[Stiffness], unit: float = 1.0) -> Properties:
    """Properties of a meshed section whose parts have these moduli; `unit` of its lengths [m]."""
    moduli, shear_moduli, densities = zip(*stiffness, strict=True)
    elastic = _weighted(section, moduli)
    props = elastic.section_props
    shear = heavy = elastic
    if len(set(stiffness)) > 1:
        # sectionproperties weighs torsion by E, and G is what resists it
        shear = _weighted(section, shear_moduli)
        heavy = _weighted(section, densities, warping=False)
    torsion = float(shear.section_props.j) * (shear_moduli[0] / shear.materials[0].elastic_modulus)
    mass = heavy.section_props
    density = densities[0] / heavy.materials[0].elastic_modulus
    centre = np.array([mass.cx, mass.cy])
    shear_centre = (np.array(elastic.get_sc_t()) - centre) * unit
    elastic_centre = (np.array([props.cx, props.cy]) - centre) * unit
    low, high = (
        np.array(bound)
        for bound in (section.mesh_nodes.min(axis=0), section.mesh_nodes.max(axis=0))
    )
    extent = (high - low) * unit
    return Properties(
        axial=float(props.ea) * unit**2,
        bending_xy=float(props.iyy_c) * unit**4,
        bending_xz=float(props.ixx_c) * unit**4,
        product=float(props.ixy_c) * unit**4,
        torsion=torsion * unit**4,
        mass=density * float(mass.ea) * unit**2,
        polar=density * float(mass.ixx_c + mass.iyy_c) * unit**4,
        shear_centre=(float(shear_centre[0]), float(shear_centre[1])),
        elastic_centre=(float(elastic_centre[0]), float(elastic_centre[1])),
        extent=(float(extent[0]), float(extent[1])),
    )


def _weighted(section: Any, weights: Sequence[float], *, warping: bool = True) -> Any:
    """A section of the same mesh, analysed with a weight for each part in place of E."""
    geometry = copy.deepcopy(section.geometry)
    largest = max(weights)
    known: dict[float, Any] = {}
    for part, weight in zip(_parts_of(geometry), weights, strict=True):
        same = dataclasses.replace(
            part.material,
            name=f"weight {weight!r}",
            elastic_modulus=max(weight, 1e-12 * largest),
            poissons_ratio=0.0,
        )
        part.material = known.setdefault(weight, same)
    out = type(section)(geometry)
    try:
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            out.calculate_geometric_properties()
            if warping:
                out.calculate_warping_properties()
    except (RuntimeError, ValueError, np.linalg.LinAlgError) as error:
        raise InputError(
            f"sectionproperties cannot analyse the profile ({str(error).splitlines()[0]}); check "
            "its outline and its mesh."
        ) from None
    if any("disjoint" in str(warning.message) for warning in said):
        raise InputError(
            "parts of the profile do not touch, so that nothing holds them together; let them "
            "share an edge."
        )
    return out


Ring = tuple[Sequence[Point], Sequence[Sequence[Point]]]


def _section_of(rings: Sequence[Ring], rotation: float) -> Any:
    """A meshed sectionproperties `Section` of some outlines with their holes, turned."""
    try:
        with importing, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of its own imports
            import shapely  # pyright: ignore[reportMissingModuleSource]
            from sectionproperties.analysis import (  # pyright: ignore[reportMissingImports]
                Section,
            )
            from sectionproperties.pre import (  # pyright: ignore[reportMissingImports]
                CompoundGeometry,
                Geometry,
            )
    except ImportError as error:
        raise InputError(
            f'a "profile" section needs sectionproperties ({error}); {EXTRA}, or give its '
            'properties as shape = "custom" or "equivalent".'
        ) from None
    count = sum(len(outline) + sum(map(len, holes)) for outline, holes in rings)
    if count > MOST_POINTS:
        raise InputError(f"the profile has {count} corners; at most {MOST_POINTS} are taken.")
    shapes: list[Any] = []
    for k, (outline, holes) in enumerate(rings):
        where = "outline" if len(rings) == 1 else f"parts[{k}].outline"
        if len(outline) < 3 or any(len(hole) < 3 for hole in holes):
            raise InputError(f"{where} or one of its holes has fewer than 3 corners.")
        shape = shapely.Polygon(outline, holes)
        if not shape.is_valid or shape.area <= 0.0:
            reason = shapely.is_valid_reason(shape)
            raise InputError(
                f"{where} with its holes is no area ({reason}); list the corners once around, and "
                "keep holes inside."
            )
        shapes.append(shapely.affinity.rotate(shape, rotation, origin=(0, 0), use_radians=True))
    for k, shape in enumerate(shapes):
        for other, before in enumerate(shapes[:k]):
            if shape.intersection(before).area > 1e-9 * min(shape.area, before.area):
                raise InputError(
                    f"parts[{other}] and parts[{k}] overlap; each place has one material."
                )
    geometries = [Geometry(shape) for shape in shapes]
    geometry = geometries[0] if len(geometries) == 1 else CompoundGeometry(geometries)
    sizes = [_element_size(shape) for shape in shapes]
    geometry.create_mesh(mesh_sizes=sizes)
    return Section(geometry)


def _element_size(shape: Any) -> float:
    """Largest area of an element: several across the mean thickness, but not too many."""
    thickness = 2.0 * shape.area / shape.length
    return max(thickness**2 / THIN, shape.area / MOST_ELEMENTS)
