"""Closed forms beside uncertain numbers: what a draw makes of a quantity, what a correlation may
be, and the waves that fit into a beam."""

import numpy as np
import pytest
from scipy.special import ndtr

import beamchain as bc
from formulas import half_waves


def normal(**width):
    return bc.spec.Uncertainty(distribution="normal", **width)


@pytest.mark.parametrize("score", [-7.0, -2.5, -0.4, 0.0, 1.1, 2.9, 7.0])
def test_a_draw_is_a_share_or_a_part_added_cut_at_three_deviations(score):
    held = min(max(score, -3.0), 3.0)
    assert normal(relative=0.1).value(50.0, score) == pytest.approx(50.0 * (1.0 + 0.1 * held))
    assert normal(absolute=0.7).value(-2.0, score) == pytest.approx(-2.0 + 0.7 * held)
    uniform = bc.spec.Uncertainty(relative=0.1, distribution="uniform")
    share = 2.0 * float(ndtr(score)) - 1.0
    assert uniform.value(50.0, score) == pytest.approx(50.0 * (1.0 + 0.1 * share))


def test_how_far_a_quantity_may_come():
    assert normal(relative=0.1).reach(-50.0) == pytest.approx(15.0)
    assert normal(absolute=0.7).reach(-50.0) == pytest.approx(2.1)
    assert bc.spec.Uncertainty(absolute=0.7, distribution="uniform").reach(9.0) == 0.7


@pytest.mark.parametrize(
    ("of", "matrix", "words"),
    [
        ((), (), "0 names"),
        (("a.frequency", "b.frequency"), ((1.0, 0.5),), "2 x 2"),
        (("a.frequency", "b.frequency"), ((1.0, 0.5), (0.5,)), "2 x 2"),
        (("a.frequency", "a.frequency"), ((1.0, 0.5), (0.5, 1.0)), "each name once"),
        (("a.frequency", "b.frequency"), ((1.0, 0.5), (0.4, 1.0)), "symmetric"),
        (("a.frequency", "b.frequency"), ((1.1, 0.5), (0.5, 1.1)), "diagonal"),
        (("a.frequency", "b.frequency"), ((1.0, 1.2), (1.2, 1.0)), "-0.2"),
    ],
)
def test_what_no_correlation_is(of, matrix, words):
    with pytest.raises(bc.InputError, match=words):
        bc.spec.Correlation(of=of, matrix=matrix)


def test_half_waves_of_a_beam_are_its_length_over_half_a_wavelength():
    """`k = omega sqrt(m/S)` of twist and stretching, `k^4 = omega^2 m/EI` of bending; k L/pi of
    them."""
    section = bc.Equivalent(
        bending_stiffness_xy=400.0,
        bending_stiffness_xz=90.0,
        torsion_stiffness=55.0,
        axial_stiffness=7e3,
        linear_mass=1.7,
        polar_inertia=0.3,
    )
    parts = tuple(bc.Segment(length=part, section=section) for part in (2.0, 3.5))
    beam = bc.Beam(segments=parts)
    omega, length = 23.0, 5.5
    for port, stiffness in (("xy", 400.0), ("xz", 90.0)):
        wave = (omega**2 * 1.7 / stiffness) ** 0.25
        assert half_waves(beam, port, omega) == pytest.approx(wave * length / np.pi)
    twist = omega * np.sqrt(0.3 / 55.0)
    assert half_waves(beam, "torsion", omega) == pytest.approx(twist * length / np.pi)
    stretch = omega * np.sqrt(1.7 / 7e3)
    assert half_waves(beam, "axial", omega) == pytest.approx(stretch * length / np.pi)


def test_a_matrix_that_is_a_correlation_is_taken_as_it_is():
    names, matrix = ("a.frequency", "b.frequency"), ((1.0, -0.5), (-0.5, 1.0))
    taken = bc.spec.Correlation(of=names, matrix=matrix)
    assert np.array_equal(taken.matrix, matrix)
