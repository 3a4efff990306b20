"""Parts of a beam: segments, compliant joints between them, rigid bodies carried on the way."""

from functools import partial
from typing import Annotated, Any, Literal, NamedTuple

import msgspec
import numpy as np

from beamchain.checks import Struct, field, kind_of, not_negative
from beamchain.errors import InputError
from beamchain.ports.motions import Array
from beamchain.structure.section import Equivalent, Material, Section

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


EXAMPLES = {
    "section": "Round(diameter=0.02), Tube(...), Rectangle(...), Box(...), Custom(...) "
    "or Equivalent(...)",
    "material": "Material(youngs_modulus=7e10, density=2700.0)",
}


class Segment(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A stretch of the appendage with one section, or a linear taper between two.

    Example:
        >>> import beamchain as bc
        >>> panel = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> array = bc.Beam(segments=(bc.Segment(length=2.0, section=panel, repeat=4),))
        >>> array.length
        8.0
    """

    length: Annotated[float, field("length along x", "m", above=0.0)]
    section: Annotated[Section, field("section at the root end")]
    section_end: Annotated[
        Section | None,
        field("section at the tip end, of the same shape, for a linear taper"),
    ] = None
    material: Annotated[
        Material | None,
        field('material; needed for every shape but "equivalent", which takes none'),
    ] = None
    nonstructural_mass: Annotated[
        float, field("mass carried without stiffness, such as cables and cells", "kg/m", least=0.0)
    ] = 0.0
    theory: Annotated[Theory, field('beam theory; "timoshenko" adds shear and rotary inertia')] = (
        "euler"
    )
    shear_factor: Annotated[
        float | None,
        field(
            "shear factor k of Timoshenko; that of Cowper for the shape where left out",
            "",
            above=0.0,
        ),
    ] = None
    repeat: Annotated[
        int, field("number of such segments, one behind the other", "", least=1, most=500)
    ] = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, value, kind in (
            ("section", self.section, Section),
            ("material", self.material, Material | None),
        ):
            if not isinstance(value, kind):
                raise InputError(
                    f"{name} = {value!r:.60} is {kind_of(value)}; give one as {EXAMPLES[name]}."
                )
        if self.section_end is not None and type(self.section_end) is not type(self.section):
            raise InputError(
                f'section_end has shape "{_shape_name(self.section_end)}" but section has '
                f'"{_shape_name(self.section)}"; '
                "a taper needs the same shape at both ends: split the segment where the shape "
                "changes."
            )
        if isinstance(self.section, Equivalent):
            if self.material is not None:
                raise InputError(
                    'material is given beside an "equivalent" section, which already holds EI and '
                    "mass; "
                    "leave material out."
                )
            if self.theory == "timoshenko":
                raise InputError(
                    'theory = "timoshenko" needs a drawn section; an "equivalent" one takes theory '
                    '= "euler".'
                )
            self._check_rigid_ends(self.section)
        elif self.material is None:
            raise InputError(
                "material is missing; "
                "add material = { youngs_modulus = 7e10, density = 2700.0, poissons_ratio = 0.33 }."
            )
        if self.shear_factor is not None and self.theory != "timoshenko":
            raise InputError(
                'shear_factor is given but theory = "euler" has no shear; set theory = '
                '"timoshenko".'
            )

    def _check_rigid_ends(self, section: Equivalent) -> None:
        """Refuse a taper between rigid and a stiffness, which no line joins."""
        here, there = section.dimensions(), self.end.dimensions()
        for name in ("torsion_stiffness", "axial_stiffness"):
            if (here[name] == 0.0) != (there[name] == 0.0):
                raise InputError(
                    f"{name} is {here[name]:g} in section and {there[name]:g} in section_end; 0 is "
                    "rigid, from which no linear taper leads to a stiffness: give it at both ends, "
                    "or leave it out at both."
                )

    @property
    def taper(self) -> float:
        """Largest ratio between a dimension at the two ends, at least 1."""
        return self.section.ratio(self.end)

    @property
    def end(self) -> Section:
        """The section at the tip end."""
        return self.section if self.section_end is None else self.section_end

    def at(self, fraction: Array) -> Stations:
        """Stiffness and inertia at `fraction` `(k,)` of the length."""
        if isinstance(self.section, Equivalent):
            dims = self.section.at(self.end, fraction)
            zeros = np.zeros_like(fraction)
            return Stations(
                bending_xy=dims["bending_stiffness_xy"],
                bending_xz=dims["bending_stiffness_xz"],
                torsion=dims["torsion_stiffness"],
                axial=dims["axial_stiffness"],
                mass=dims["linear_mass"] + self.nonstructural_mass,
                polar=dims["polar_inertia"],
                shear_xy=zeros,
                shear_xz=zeros,
                rotary_xy=zeros,
                rotary_xz=zeros,
            )
        assert self.material is not None
        e = self.material.youngs_modulus
        g = self.material.g
        rho = self.material.density
        properties = self.section._properties(self.end, fraction)
        s = properties.geometry
        given = self.shear_factor
        shear_xy, shear_xz = (
            (factor.at(self.material.nu) if given is None else given) * g * s.area
            for factor in (properties.shear_xy, properties.shear_xz)
        )
        return Stations(
            bending_xy=e * s.second_moment_z,
            bending_xz=e * s.second_moment_y,
            torsion=g * s.torsion_constant,
            axial=e * s.area,
            mass=rho * s.area + self.nonstructural_mass,
            polar=rho * s.polar_moment,
            shear_xy=shear_xy,
            shear_xz=shear_xz,
            rotary_xy=rho * s.second_moment_z,
            rotary_xz=rho * s.second_moment_y,
        )

    @property
    def shrinks(self) -> bool:
        """Whether the dimension with the largest ratio is smaller at the tip end."""
        pairs = self.section.pairs(self.end)
        root, tip = max(pairs, key=lambda pair: max(pair[0] / pair[1], pair[1] / pair[0]))
        return root > tip


def expand_repeats(segments: Any) -> Any:
    """The segments one by one, those with `repeat` as often as they occur;
    what is no list of segments stays."""
    if not isinstance(segments, list | tuple):
        return segments
    if not all(isinstance(segment, Segment) for segment in segments):
        return segments
    expanded: list[Segment] = []
    for segment in segments:
        single = segment
        if segment.repeat != 1:
            single = msgspec.structs.replace(segment, repeat=1)
        expanded += [single] * segment.repeat
    return tuple(expanded)


def _shape_name(section: Any) -> str:
    return type(section).__name__.lower()


_stiffness_field = partial(field, unit="N m/rad", above=0.0, cure="Leave it out for a rigid joint.")


class Joint(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A compliant hinge line between segments; a stiffness left out is rigid.

    Example:
        >>> import beamchain as bc
        >>> bc.Joint(after_segment=1, stiffness_xy=600.0).stiffness("xy")
        600.0
    """

    after_segment: Annotated[
        int,
        field(
            "number of the segment at whose tip end it stands; 0 is the root",
            "",
            least=0,
            most=10000,
        ),
    ]
    stiffness_xy: Annotated[float | None, _stiffness_field("rotational stiffness in plane xy")] = (
        None
    )
    stiffness_xz: Annotated[float | None, _stiffness_field("rotational stiffness in plane xz")] = (
        None
    )
    stiffness_torsion: Annotated[float | None, _stiffness_field("rotational stiffness about x")] = (
        None
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if (
            self.stiffness_xy is None
            and self.stiffness_xz is None
            and self.stiffness_torsion is None
        ):
            raise InputError(
                "the joint gives no stiffness; give stiffness_xy, stiffness_xz or "
                "stiffness_torsion, or remove it."
            )

    def stiffness(self, port: str) -> float | None:
        """Stiffness in a port [N m/rad]; None: rigid."""
        return getattr(self, f"stiffness_{port}", None)


class Lump(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A rigid body carried along the appendage.

    Example:
        >>> import beamchain as bc
        >>> bc.Lump(x=8.0, mass=0.5, inertia=(1e-3, 1e-3, 1e-3)).mass
        0.5
    """

    x: Annotated[float, field("distance from the root", "m", least=0.0)]
    mass: Annotated[float, field("mass", "kg", above=0.0)]
    inertia: Annotated[
        tuple[float, float, float],
        field("principal moments of inertia about its own centre", "kg m^2", least=0.0),
    ] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_body_inertia("inertia", self.inertia)


HEAVIEST = 1e12  # a carried mass over what bends, which keeps four digits of the beam


def check_carried_body(
    place: str,
    mass: float,
    inertia: tuple[float, float, float],
    *,
    segments_mass: float,
    length: float,
) -> None:
    """Refuse a body [kg], [kg m^2] so heavy that it leaves the beam no digits."""
    for name, value, least, unit in (
        ("mass", mass, segments_mass, "kg"),
        ("inertia", max(inertia), segments_mass * length**2, "kg m^2"),
    ):
        if value > HEAVIEST * least:
            raise InputError(
                f"{place}.{name} = {value!r} {unit} is {value / least:.1e} times that of the "
                f"segments themselves ({least:.4g} {unit}), at most {HEAVIEST:g} times is taken, "
                f"or no digit of the beam is left; check the unit ({unit})."
            )


def check_body_inertia(name: str, values: tuple[float, float, float]) -> None:
    """Refuse three principal inertias that no rigid body has."""
    if not hasattr(values, "__len__") or len(values) != 3:
        raise InputError(f"{name} = {values!r} must hold three numbers [Ixx, Iyy, Izz] in kg m^2.")
    a, b, c = sorted(not_negative(f"{name}[{i}]", v, "kg m^2") for i, v in enumerate(values))
    if c > (a + b) * (1.0 + 1e-9):
        raise InputError(
            f"{name} = {list(values)!r} belongs to no rigid body: the largest exceeds the sum of "
            "the other two; check the order [Ixx, Iyy, Izz] and the units (kg m^2)."
        )
