"""A material gives its shear modulus and Poisson's ratio from whichever was stated,
and refuses contradictions."""

import pytest

from appendages import close
from beamchain import BeamchainError, InputError, Material

CLOSED = 1e-15  # one division


def test_shear_modulus_from_poissons_ratio():
    material = Material(youngs_modulus=7e10, density=2700.0, poissons_ratio=0.33)
    assert material.g == close(7e10 / 2.66, rel=CLOSED)
    assert material.nu == 0.33


def test_poissons_ratio_from_shear_modulus():
    material = Material(youngs_modulus=7e10, density=2700.0, shear_modulus=2.8e10)
    assert material.g == 2.8e10
    assert material.nu == close(0.25, rel=CLOSED)


def test_metals_ratio_where_nothing_is_given():
    material = Material(youngs_modulus=2.6e11, density=7800.0)
    assert material.nu == 0.3
    assert material.g == close(1e11, rel=CLOSED)


def test_both_may_be_given_when_they_agree():
    material = Material(
        youngs_modulus=2.6e11, density=7800.0, poissons_ratio=0.3, shear_modulus=1e11 * (1 + 5e-7)
    )
    assert material.g == 1e11 * (1 + 5e-7)


@pytest.mark.parametrize("nu", [-0.99, 0.0, 0.5])
def test_ratios_at_the_ends_of_the_range(nu):
    assert Material(youngs_modulus=1.0, density=1.0, poissons_ratio=nu).g == close(
        0.5 / (1 + nu), rel=CLOSED
    )


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"youngs_modulus": 0.0}, r"youngs_modulus = 0\.0 must be above zero \(N/m\^2\)"),
        ({"density": -1.0}, r"density = -1\.0 must be above zero \(kg/m\^3\)"),
        ({"density": float("nan")}, "density = nan cannot be used"),
        ({"youngs_modulus": 1e31}, "youngs_modulus = 1e\\+31 cannot be used; .* at most 1e\\+30"),
        ({"poissons_ratio": 0.51}, r"poissons_ratio = 0\.51 must lie above -1 and be at most 0\.5"),
        ({"poissons_ratio": -1.0}, r"poissons_ratio = -1\.0 must lie above -1"),
        ({"shear_modulus": 0.0}, r"shear_modulus = 0\.0 must be above zero"),
        (
            {"poissons_ratio": 0.3, "shear_modulus": 9e10},
            r"shear_modulus = 90000000000\.0 and poissons_ratio = 0\.3 disagree \(the ratio gives "
            r"1e\+11",
        ),
    ],
)
def test_unusable_materials_are_refused(values, message):
    with pytest.raises(InputError, match=message):
        Material(**{"youngs_modulus": 2.6e11, "density": 7800.0} | values)


def test_errors_are_the_packages_and_pythons():
    with pytest.raises(BeamchainError):
        Material(youngs_modulus=0.0, density=1.0)
    with pytest.raises(ValueError, match="youngs_modulus"):
        Material(youngs_modulus=0.0, density=1.0)
