"""Tests an internal, `structure.elements.assemble`: orders of convergence,
which a converged beam cannot show.

What is asserted of converged beams stands in test_elements.py.
"""

from itertools import pairwise

import numpy as np
import pytest

from appendages import close
from beamchain.structure import elements
from uniform_beam import held_roots

# what `Beam.port` promises for the modes asked for, with room for the rounding of ten modes
FREQUENCY = 1e-11
SLOPE = 0.15  # log-log slope between two refinements, before the asymptote is quite reached


def test_effective_masses_sum_to_the_rigid_mass():
    # a held beam without a root lump has no residual mass:
    # what the discretisation leaves shrinks as it is refined
    left = []
    for functions in (8, 16, 32):
        piece = elements.Piece(0.0, 1.0, np.ones(functions + 5), np.ones(functions + 5))
        port = elements.assemble(
            elements.MotionRows([piece], hinges=[], bodies=[], functions=functions, bending=True)
        )
        left.append(port.residual_mass[0, 0] / port.rigid_mass[0, 0])
    assert left[0] > left[1] > left[2] > 0.0


def uniform_pieces(count, functions):
    points = functions + 5
    h = 1.0 / count
    pieces = [elements.Piece(i * h, h, np.ones(points), np.ones(points)) for i in range(count)]
    return elements.assemble(
        elements.MotionRows(pieces, hinges=[], bodies=[], functions=functions, bending=True)
    )


@pytest.mark.parametrize(("functions", "order"), [(1, 2), (2, 4), (3, 6)])
def test_h_convergence_has_twice_the_order_of_the_strain(functions, order):
    exact = held_roots(2)[1] ** 2
    counts = np.array([6, 12, 24])
    errors = np.array(
        [uniform_pieces(int(n), functions).frequencies[1] / exact - 1.0 for n in counts]
    )
    assert np.all(errors > 0.0)  # Rayleigh: a constrained beam is stiffer
    slopes = np.diff(np.log(errors)) / np.diff(np.log(counts))
    assert slopes[-1] == close(-order, abs=SLOPE)


def test_p_convergence_is_faster_than_any_power():
    exact = held_roots(3)[2] ** 2
    errors = [uniform_pieces(1, p).frequencies[2] / exact - 1.0 for p in (5, 7, 9, 11)]
    falls = [a / b for a, b in pairwise(errors)]
    assert falls[0] > 10.0
    assert falls == sorted(falls)  # every pair of functions is worth more than the pair before


@pytest.mark.slow
def test_refinement_costs_no_digits():
    # cubic Hermite elements lose the first frequency to rounding as they are refined
    # (4e-6 at 160 of them)
    exact = held_roots(1)[0] ** 2
    assert uniform_pieces(160, 4).frequencies[0] == close(exact, rel=FREQUENCY)
