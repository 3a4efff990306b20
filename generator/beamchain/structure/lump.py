"""A rigid body carried along the appendage."""

from typing import Annotated

from beamchain.checks import Struct, field, not_negative
from beamchain.errors import InputError


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
        tuple[float, float, float], field("principal moments of inertia about its own centre", "kg m^2", least=0.0)
    ] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        body_inertia("inertia", self.inertia)


HEAVIEST = 1e12  # a carried mass over what bends: beyond, double precision keeps four digits of the beam


def check_carried(place: str, mass: float, inertia: tuple[float, float, float], own: float, length: float) -> None:
    """A body that leaves the beam its digits.

    Args:
        place: "lump" or "payload".
        mass, inertia: of the body [kg], [kg m^2].
        own: mass of the segments [kg].
        length: root to tip [m].
    """
    for name, value, least, unit in (("mass", mass, own, "kg"), ("inertia", max(inertia), own * length**2, "kg m^2")):
        if value > HEAVIEST * least:
            raise InputError(
                f"{place}.{name} = {value!r} {unit} is {value / least:.1e} times that of the segments themselves "
                f"({least:.4g} {unit}), at most {HEAVIEST:g} times is taken, or no digit of the beam is left; check the "
                f"unit ({unit})."
            )


def body_inertia(name: str, values: tuple[float, float, float]) -> None:
    """Three principal inertias that a rigid body can have."""
    if not hasattr(values, "__len__") or len(values) != 3:
        raise InputError(f"{name} = {values!r} must hold three numbers [Ixx, Iyy, Izz] in kg m^2.")
    a, b, c = sorted(not_negative(f"{name}[{i}]", v, "kg m^2") for i, v in enumerate(values))
    if c > (a + b) * (1.0 + 1e-9):
        raise InputError(
            f"{name} = {list(values)!r} belongs to no rigid body: the largest exceeds the sum of the other two; "
            "check the order [Ixx, Iyy, Izz] and the units (kg m^2)."
        )
