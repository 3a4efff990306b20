"""A rigid body carried along the appendage."""

import msgspec

from beamchain.checks import not_negative, own_numbers, positive
from beamchain.errors import InputError


class Lump(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A rigid body carried at `x` [m]: `mass` [kg], principal `inertia` about its own centre [kg m^2]."""

    x: float
    mass: float
    inertia: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        own_numbers(self)
        not_negative("x", self.x, "m")
        positive("mass", self.mass, "kg")
        body_inertia("inertia", self.inertia)


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
