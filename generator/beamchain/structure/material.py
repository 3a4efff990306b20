"""Isotropic material of a segment."""

from typing import Annotated

from beamchain.checks import Struct, field
from beamchain.errors import InputError


class Material(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Isotropic linear elastic material.

    Raises:
        InputError: a value is out of range, or poissons_ratio and shear_modulus are given and disagree.

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
