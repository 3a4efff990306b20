"""Isotropic material of a segment."""

from beamchain.checks import Struct, number, own_numbers, positive
from beamchain.errors import InputError


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
