"""A material gives its shear modulus and Poisson's ratio from whichever was stated."""

import pytest

from appendages import close
from beamchain import Material

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
