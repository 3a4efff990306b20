"""Open, multi-cell and composite profiles, through sectionproperties (the extra `sections`).

Its axes x and y are y and z here. A beam bends about principal axes through its centre of mass and
twists about that axis without bending: a profile whose shear centre or elastic centre lies beside
it, or whose principal axes are turned, is refused with the figure. Warping is not restrained.
"""

import copy
import dataclasses
import warnings
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from beamchain.checks import kind_of, of_type, positive
from beamchain.errors import InputError
from beamchain.structure.section import Draw, Equivalent, Material

OFF_AXIS = 0.01  # of the radius of gyration: a coupling of a frequency by 1e-4
TURNED = 1e-4  # product of inertia over the moments: the same


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
        >>> bc.spec.section_from("channel")
        Traceback (most recent call last):
            ...
        beamchain.errors.InputError: section = 'channel' is a str; give a sectionproperties Section.
    """
    geometry = getattr(section, "geometry", None)
    if geometry is None or not hasattr(section, "calculate_warping_properties"):
        raise InputError(
            f"section = {section!r:.60} is {kind_of(section)}; give a sectionproperties Section."
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
    found.check()
    return found.equivalent()


class Stiffness(NamedTuple):
    """Young's modulus, shear modulus [N/m^2] and density [kg/m^3] of a part."""

    youngs_modulus: float
    shear_modulus: float
    density: float


class Properties(NamedTuple):
    """Stiffness and mass of a profile, in SI.

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

    def check(self) -> None:
        """Refuse what couples bending and torsion, or the two planes."""
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
            turn = float(np.degrees(-angle))
            raise InputError(
                f"the principal axes of the profile are turned by {np.degrees(angle):.6g} degrees "
                f"about x against y and z, so that the two planes of bending are coupled; turn "
                f"its geometry, geometry.rotate_section({turn:.9g}), and the frame it is mounted "
                f"on by {-turn:.6g} degrees about x."
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
