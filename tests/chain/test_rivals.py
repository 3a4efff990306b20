"""The rivals are the recipes they are named after: published errors, their orders,
the 2008 paper's closed forms.

Each is exported and read back by plain MuJoCo;
the beam is that of closed forms and of the tests' own finite elements.
"""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import quad

import finite_elements as fe
import readback as rb
from appendages import close, seed_boom, stepped_boom, tapered_boom
from arrays import space_beam
from beamchain import Beam, InputError, Joint
from beamchain.chain.baselines import equal_links, seed_chain
from rival_files import equal_file, paper_file
from spec_tables import table_of
from written_chain import read_chain

CLOSED = 1e-10  # (17), (18) against singular values of a 6 x 2 matrix; c enters by its root
SLOPE = 0.1  # log-log slope between the last two refinements of the ladder
SUMS = 1e-12  # sums over links

RECIPES = ("classical", "midpoint")
ORDER = -2.0
CANTILEVER = 1.8751040687119611**2  # of the unit beam


@cache
def exported(make, count, recipe):
    return equal_file(make(), count, recipe)


@cache
def reading(make, count, recipe):
    return rb.read(exported(make, count, recipe))


def held_error(count, recipe):
    return reading(space_beam, count, recipe).frequencies[0] / CANTILEVER - 1.0


def on_hub(count, recipe, mass):
    """Relative error of the first coupled frequency of the unit beam on a hub."""
    hub = np.diag([mass] * 3 + [mass / 10.0] * 3)
    exact = fe.port(table_of(space_beam()), "xy", 8).coupled(np.diag([mass, mass / 10.0]), 1)[0]
    return abs(reading(space_beam, count, recipe).coupled(hub, 1)[0] / exact - 1.0)


# -- equal links -----------------------------------------------------------------------------------
@pytest.mark.parametrize("recipe", RECIPES)
def test_order_of_the_clamped_frequency(recipe):
    errors = [abs(held_error(count, recipe)) for count in (16, 32, 64)]
    assert np.log2(errors[2] / errors[1]) == close(ORDER, abs=SLOPE)


@pytest.mark.parametrize("mass", [0.1, 1.0, 10.0, 1000.0])
@pytest.mark.parametrize("recipe", RECIPES)
def test_order_of_the_first_coupled_frequency(recipe, mass):
    counts = np.array([8, 16, 32, 64])
    errors = [on_hub(int(n), recipe, mass) for n in counts]
    slopes = np.diff(np.log(errors)) / np.diff(np.log(counts))
    assert slopes[-1] == close(ORDER, abs=SLOPE)
    assert np.all(np.diff(errors) < 0.0)


def test_midpoint_is_the_stronger_on_a_heavy_hub():
    errors = {recipe: on_hub(16, recipe, 1000.0) for recipe in RECIPES}
    assert errors["midpoint"] < errors["classical"]


@pytest.mark.parametrize("recipe", RECIPES)
def test_hinges_and_stiffness_of_a_uniform_beam(recipe):
    n = 5
    chain = read_chain(exported(space_beam, n, recipe))
    shift = 0.5 if recipe == "midpoint" else 0.0
    assert [h.x for h in chain.hinges] == close([(i + shift) / n for i in range(n)], rel=SUMS)
    stiffness = np.full(n, float(n))  # EI N / L
    if recipe == "classical":
        stiffness[0] *= 2.0
    assert [h.stiffness["xy"] for h in chain.hinges] == close(stiffness.tolist(), rel=SUMS)
    if recipe != "midpoint":  # a hinge at the root: nothing stands inside it
        assert sum(body.mass for body in chain.bodies if body.com < 0.5 / n) == 0.0


@pytest.mark.parametrize("make", [seed_boom, tapered_boom, stepped_boom])
@pytest.mark.parametrize("recipe", RECIPES)
def test_frozen_it_is_the_frozen_beam(make, recipe):
    for count in (1, 8):
        assert reading(make, count, recipe).rigid == close(
            fe.rigid_mass(table_of(make())), rel=SUMS
        )


def whole_compliance(table, start, end):
    """Rotation between two places per bending moment in plane xy, joints included."""
    total, x = 0.0, 0.0
    joints = {joint["after_segment"]: joint["stiffness_xy"] for joint in table.get("joint", ())}
    for number, segment in enumerate(table["segment"]):
        if number in joints and start <= x < end:
            total += 1.0 / joints[number]
        a = max(x, start)
        b = min(x + segment["length"], end)
        if b > a:

            def inverse(at, segment=segment, start=x):
                return 1.0 / float(
                    fe.section_properties(segment, (at - start) / segment["length"])["bending_xy"]
                )

            total += quad(inverse, a, b, epsabs=0.0, epsrel=1e-13, limit=200)[0]
        x += segment["length"]
    return total


def soft_root_boom():
    return Beam(segments=space_beam().segments, joints=(Joint(after_segment=0, stiffness_xy=3.0),))


@pytest.mark.parametrize("make", [tapered_boom, stepped_boom, soft_root_boom])
@pytest.mark.parametrize("recipe", RECIPES)
def test_compliance_of_the_hinges_is_the_beam_s(make, recipe):
    # the whole beam bends as much under a tip moment,
    # but for the stretch that a recipe leaves out or counts twice
    beam = make()
    total = sum(1.0 / h.stiffness["xy"] for h in read_chain(exported(make, 8, recipe)).hinges)
    left_out = beam.length / 16 if recipe == "classical" else 0.0
    assert total == close(whole_compliance(table_of(beam), 0.0, beam.length - left_out), rel=1e-10)


@pytest.mark.parametrize("make", [tapered_boom, stepped_boom])
def test_recipes_converge_on_other_beams(make):
    exact = fe.port(table_of(make()), "xy", 3).frequencies[0]
    errors = [abs(reading(make, n, "midpoint").frequencies[0] / exact - 1.0) for n in (21, 42, 84)]
    assert np.log2(errors[2] / errors[1]) == close(-2.0, abs=2 * SLOPE)


def test_a_rigid_link_is_the_piece_of_the_beam():
    links = [
        body for body in read_chain(exported(seed_boom, 5, "classical")).bodies if body.mass > 0.0
    ]
    m, h = 7800.0 * np.pi * 0.006**2 * 3.0, 3.0
    for i, link in enumerate(links):
        assert (link.mass, link.com) == close((m, (i + 0.5) * h), rel=SUMS)
        turning = m * h**2 / 12.0
        assert np.diag(link.inertia) == close(
            np.array([m * 0.006**2 / 2, turning, turning]), rel=1e-11
        )


def test_unknown_recipes_and_counts_are_refused():
    with pytest.raises(InputError, match="recipe = 'equal' is unknown; choose one of"):
        equal_links(space_beam(), 3, "equal")
    with pytest.raises(InputError, match=r"links = 0 must be"):
        equal_links(space_beam(), 0, "classical")


# -- the paper's three links -----------------------------------------------------------------------
def test_closed_forms_17_and_18():
    text = paper_file(seed_boom())
    chain = read_chain(text)
    (a, b), length = (hinge.x for hinge in chain.hinges), 15.0
    k = (b - a) / length
    c = chain.hinges[0].stiffness["xy"]
    assert chain.hinges[1].stiffness["xy"] == c
    assert a == close((1.0 - k) / 2.0 * length, rel=SUMS)
    m = 7800.0 * np.pi * 0.006**2 * 15.0
    # (17) as printed has (k - 1) below the fraction,
    # which makes both frequencies negative: magnitudes
    printed = (
        4 * np.sqrt(6) / abs((k - 1) * np.sqrt(1 + 2 * k - 3 * k**2)),
        4 * np.sqrt(6) / abs(k * (k - 1) * np.sqrt(3 - 2 * k - k**2)),
    )
    free = rb.read(text).coupled()
    assert np.sort(printed) * np.sqrt(c / m) / length == close(free, rel=CLOSED)
    assert free[0] / free[1] == close(min(printed) / max(printed), rel=CLOSED)  # (18)


def test_the_paper_s_links_need_a_uniform_beam():
    with pytest.raises(InputError, match="three links stand for a uniform beam"):
        seed_chain(tapered_boom(), 0.3, 1.0)
