"""The rivals are the recipes they are named after: published errors, their orders, the 2008 paper's closed forms."""

import numpy as np
import pytest

from appendages import close, seed_boom, soft_root_boom, stepped_boom, tapered_boom, unit_beam
from beamchain.chain.rivals import (
    RECIPES,
    cut,
    equal_links,
    rigid_link,
    seed_chain,
    seed_frequency_factors,
    seed_parameters,
    seed_ratio,
)
from beamchain.errors import InputError
from beamchain.structure.exact import UniformBeam

PERCENT = 0.5  # the published errors are in whole percent
CLOSED = 1e-10  # (17), (18) against singular values of a 6 x 2 matrix; c enters by its root
SLOPE = 0.1  # log-log slope between the last two refinements of the ladder
SUMS = 1e-12  # sums over links

EXACT = UniformBeam(1.0, 1.0, 1.0)
ORDERS = {"naive": -1.0, "classical": -2.0, "midpoint": -2.0}


def held_error(count, recipe):
    return equal_links(unit_beam(), count, recipe).port().frequencies[0] / EXACT.cantilever_frequencies(1)[0] - 1.0


# -- the three recipes -------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("count", "percent"), [(2, -34), (4, -20), (8, -11), (16, -6), (32, -3)])
def test_naive_recipe_has_the_published_error(count, percent):
    assert 100.0 * held_error(count, "naive") == close(percent, abs=PERCENT)


@pytest.mark.parametrize("recipe", RECIPES)
def test_order_of_the_clamped_frequency(recipe):
    errors = [abs(held_error(count, recipe)) for count in (16, 32, 64)]
    assert np.log2(errors[2] / errors[1]) == close(ORDERS[recipe], abs=SLOPE)


@pytest.mark.parametrize("mass", [0.1, 1.0, 10.0, 1000.0])
@pytest.mark.parametrize("recipe", RECIPES)
def test_order_of_the_first_coupled_frequency(recipe, mass):
    hub = np.diag([mass, mass / 10.0])
    exact = EXACT.coupled_frequencies(hub, 1)[0]
    counts = np.array([8, 16, 32, 64])
    errors = [
        abs(equal_links(unit_beam(), int(n), recipe).port().with_hub(hub).free_frequencies[0] / exact - 1.0)
        for n in counts
    ]
    slopes = np.diff(np.log(errors)) / np.diff(np.log(counts))
    assert slopes[-1] == close(ORDERS[recipe], abs=SLOPE)
    assert np.all(np.diff(errors) < 0.0)


def test_midpoint_is_the_strongest_of_the_three_on_a_heavy_hub():
    hub = np.diag([1000.0, 100.0])
    exact = EXACT.coupled_frequencies(hub, 1)[0]
    errors = {
        r: abs(equal_links(unit_beam(), 16, r).port().with_hub(hub).free_frequencies[0] / exact - 1.0) for r in RECIPES
    }
    assert errors["midpoint"] < errors["classical"] < errors["naive"]


@pytest.mark.parametrize("recipe", RECIPES)
def test_hinges_and_stiffness_of_a_uniform_beam(recipe):
    n = 5
    chain = equal_links(unit_beam(), n, recipe)
    shift = 0.5 if recipe == "midpoint" else 0.0
    assert [h.x for h in chain.hinges] == close([(i + shift) / n for i in range(n)], rel=SUMS)
    stiffness = np.full(n, float(n))  # EI N / L
    if recipe == "classical":
        stiffness[0] *= 2.0
    assert [h.stiffness["xy"] for h in chain.hinges] == close(stiffness.tolist(), rel=SUMS)
    assert len(chain.links) == n + 1
    if recipe != "midpoint":  # a hinge at the root: its inner link is nothing
        assert chain.links[0].mass == 0.0
        assert chain.links[0].length == 0.0


@pytest.mark.parametrize("make", [seed_boom, tapered_boom, stepped_boom])
@pytest.mark.parametrize("recipe", RECIPES)
def test_frozen_it_is_the_frozen_beam(make, recipe):
    beam = make()
    for count in (1, 3, 8):
        assert equal_links(beam, count, recipe).rigid_mass() == close(beam.rigid_mass(), rel=SUMS)


@pytest.mark.parametrize("make", [tapered_boom, stepped_boom, soft_root_boom])
@pytest.mark.parametrize("recipe", RECIPES)
def test_compliance_of_the_hinges_is_the_beam_s(make, recipe):
    # the whole beam bends as much under a tip moment, but for the stretch that a recipe leaves out or counts twice
    beam = make()
    total = sum(1.0 / h.stiffness["xy"] for h in equal_links(beam, 8, recipe).hinges)
    h = beam.length / 8
    whole = beam.compliance(0.0, beam.length, "xy")
    if recipe == "classical":
        whole -= beam.compliance(beam.length - h / 2, beam.length, "xy")
    assert total == close(whole, rel=1e-10)


@pytest.mark.parametrize("make", [tapered_boom, stepped_boom])
def test_recipes_converge_on_other_beams(make):
    beam = make()
    exact = beam.port("xy", 3).frequencies[0]
    errors = [abs(equal_links(beam, n, "midpoint").port().frequencies[0] / exact - 1.0) for n in (21, 42, 84)]
    assert np.log2(errors[2] / errors[1]) == close(-2.0, abs=2 * SLOPE)


def test_a_rigid_link_is_the_piece_of_the_beam():
    beam = seed_boom()
    link = rigid_link(beam, 3.0, 7.0)
    m = 7800.0 * np.pi * 0.006**2 * 4.0
    assert (link.mass, link.com) == close((m, 5.0), rel=SUMS)
    assert link.inertia == close((m * 0.006**2 / 2, m * 16.0 / 12.0, m * 16.0 / 12.0), rel=1e-11)


def test_unknown_recipes_and_counts_are_refused():
    with pytest.raises(InputError, match="recipe = 'equal' is unknown; choose one of naive, classical, midpoint"):
        equal_links(unit_beam(), 3, "equal")
    with pytest.raises(InputError, match="links = 0 must be a whole number from 1 to 5000"):
        equal_links(unit_beam(), 0, "naive")


# -- the paper's three links -------------------------------------------------------------------------------------------
@pytest.mark.parametrize("k", np.linspace(0.05, 0.95, 10))
def test_closed_forms_17_and_18(k):
    c = 51.325
    beam = seed_boom()
    free = seed_chain(beam, k, c).port().free_frequencies
    m, length = beam.rigid_mass()[0, 0], 15.0
    scale = np.sqrt(c / m) / length
    # (17) as printed has (k - 1) below the fraction, which makes both frequencies negative: magnitudes
    printed = (
        4 * np.sqrt(6) / abs((k - 1) * np.sqrt(1 + 2 * k - 3 * k**2)),
        4 * np.sqrt(6) / abs(k * (k - 1) * np.sqrt(3 - 2 * k - k**2)),
    )
    assert np.sort(printed) * scale == close(free, rel=CLOSED)
    assert seed_frequency_factors(k) == close(printed, rel=1e-14)
    assert seed_ratio(k) == close(printed[0] / printed[1], rel=1e-13)  # (18)


def test_closed_forms_are_found_again():
    for k in (0.1, 0.26985, 0.7):
        w1, w2 = seed_frequency_factors(k)
        found, c = seed_parameters(13.0, 15.0, w1 * np.sqrt(50.0 / 13.0) / 15.0, w2 * np.sqrt(50.0 / 13.0) / 15.0)
        assert found == close(k, rel=1e-12)
        assert c == close(50.0, rel=1e-11)


@pytest.mark.parametrize("pair", [(2.0, 1.0), (1.0, 1.0), (0.0, 1.0)])
def test_frequencies_in_the_wrong_order_are_refused(pair):
    with pytest.raises(InputError, match="must lie between 0 and 1 for the paper's three links"):
        seed_parameters(1.0, 1.0, *pair)


def test_the_seed_recipe_is_for_uniform_beams():
    with pytest.raises(InputError, match='method = "seed" is the paper\'s recipe for a uniform beam'):
        seed_chain(tapered_boom(), 0.3, 1.0)


def test_links_of_the_seed_chain():
    chain = seed_chain(seed_boom(), 0.2, 7.0)
    assert [link.length for link in chain.links] == close([6.0, 3.0, 6.0], rel=SUMS)
    assert [h.stiffness["xy"] for h in chain.hinges] == [7.0, 7.0]


def test_cut_keeps_hinges_where_they_are_asked():
    chain = cut(unit_beam(), np.array([0.25, 0.5]), np.array([1.0, 2.0]), "xz")
    assert [h.x for h in chain.hinges] == [0.25, 0.5]
    assert chain.ports == ("xz",)
