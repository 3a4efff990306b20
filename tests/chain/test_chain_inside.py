"""Tests internals, `chain.recursion`, `chain.chain`, `chain.cut`, `chain.baselines`: what no
specification is known to reach.

Targets that a beam does not have, chains that are not asked for,
the 2008 paper's closed forms at any split of its rod.
"""

import numpy as np
import pytest

from appendages import close, seed_boom, unit_beam
from arrays import tube
from beamchain.chain.baselines import (
    freeze_between,
    seed_chain,
    seed_frequency_factors,
    seed_parameters,
    seed_ratio,
)
from beamchain.chain.chain import Link
from beamchain.chain.recursion import Nodes, planar_chain, realise, realise_scalar, split

SUMS = 1e-12  # sums of masses and first moments
CLOSED = 1e-10  # (17), (18) against singular values of a 6 x 2 matrix; c enters by its root


def test_rigid_target_is_a_dumbbell():
    # no modes: one rod with the beam's mass, centre and inertia: end mass at the root m/4,
    # 3/4 at 2/3 of the length
    nodes = realise(unit_beam().port("xy", 4).truncated(0))
    assert nodes.masses == close([0.25, 0.75], rel=SUMS)
    assert nodes.lengths == close([2.0 / 3.0], rel=SUMS)
    assert nodes.stiffness.size == 0


def test_split_where_the_natural_one_would_be_negative():
    nodes = Nodes(np.array([0.1, 0.2, 0.3, 0.4]), np.array([1.0, 2.0, 1.0]), np.array([1.0, 1.0]))
    # less than the root node, more than two nodes hold
    for wanted in ([0.05, 0.4, 0.55], [0.5, 0.1, 0.4]):
        mass, com, inertia = split(nodes, np.array(wanted), share=0.02)
        assert np.all(mass > 0.0)
        assert np.all(inertia > 0.0)
        assert np.all((com > 0.0) & (com < nodes.lengths))
        # the whole is unchanged: mass, first and second moment of the point masses
        x = nodes.positions
        start = nodes.positions[:-1]
        assert mass.sum() == close(nodes.masses.sum(), rel=SUMS)
        assert mass @ (start + com) == close(nodes.masses @ x, rel=SUMS)
        assert mass @ (start + com) ** 2 + inertia.sum() == close(nodes.masses @ x**2, rel=SUMS)


def test_hinge_angles_of_the_modes_diagonalise_stiffness_and_mass():
    # row k holds psi_k of the mass-normalised mode: strain energy W_k^2 / 2,
    # no coupling of two modes
    beam = seed_boom()
    chain = planar_chain(realise(beam.port("xy", 8).truncated(4)), beam.line)
    port = chain.port("xy")
    shapes = chain.shapes("xy")
    stiffness = np.array([h.stiffness["xy"] for h in chain.hinges])
    energy = (shapes * stiffness) @ shapes.T
    assert energy == close(np.diag(port.frequencies**2), abs=1e-10 * port.frequencies[-1] ** 2)
    _, rows = chain.rows(chain.freedoms(["xy"]))
    assert shapes @ (rows.T @ rows) @ shapes.T == close(np.eye(4), abs=1e-11)
    # signs belong to the participation: tip rotation of mode k is the sum of its angles
    assert np.sum(shapes, axis=1) == close(port.tip[:, 1], rel=1e-9)


@pytest.mark.parametrize("n", [1, 3, 7, 12])
def test_strings_are_positive_for_any_number_of_modes(n):
    inertias, springs = realise_scalar(tube().port("torsion", 14).truncated(n))
    assert np.all(inertias > 0.0)
    assert np.all(springs > 0.0)
    assert inertias.sum() == close(tube().rigid_mass()[3, 3], rel=1e-12)


@pytest.mark.parametrize("k", np.linspace(0.05, 0.95, 10))
def test_closed_forms_17_and_18(k):
    c = 51.325
    beam = seed_boom()
    free = seed_chain(beam, k, c).port().free_frequencies
    m = beam.rigid_mass()[0, 0]
    length = 15.0
    scale = np.sqrt(c / m) / length
    # (17) as printed has (k - 1) below the fraction,
    # which makes both frequencies negative: magnitudes
    printed = (
        4 * np.sqrt(6) / abs((k - 1) * np.sqrt(1 + 2 * k - 3 * k**2)),
        4 * np.sqrt(6) / abs(k * (k - 1) * np.sqrt(3 - 2 * k - k**2)),
    )
    assert np.sort(printed) * scale == close(free, rel=CLOSED)
    assert seed_frequency_factors(k) == close(printed, rel=1e-14)
    assert seed_ratio(k) == close(printed[0] / printed[1], rel=1e-13)  # (18)


def test_closed_forms_are_found_again():
    for k in (0.03, 0.1, 0.26985, 0.7):
        w1, w2 = seed_frequency_factors(k)
        found, c = seed_parameters(
            13.0, 15.0, w1 * np.sqrt(50.0 / 13.0) / 15.0, w2 * np.sqrt(50.0 / 13.0) / 15.0
        )
        assert found == close(k, rel=1e-12)
        assert c == close(50.0, rel=1e-11)


def test_cut_keeps_hinges_where_they_are_asked():
    chain = freeze_between(unit_beam(), np.array([0.25, 0.5]), np.array([1.0, 2.0]), "xz")
    assert [h.x for h in chain.hinges] == [0.25, 0.5]
    assert chain.ports == ("xz",)
    # a hinge at the root stands on nothing
    rooted = freeze_between(unit_beam(), np.array([0.0, 0.5]), np.array([1.0, 2.0]), "xz")
    assert rooted.links[0] == Link(0.0, 0.0, 0.0, 0.0, (0.0, 0.0, 0.0))
    assert [link.mass for link in rooted.links[1:]] == close([0.5, 0.5], rel=SUMS)
