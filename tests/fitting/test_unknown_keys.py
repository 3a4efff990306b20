"""A key that a table does not have is answered with the keys that it has.

Tests an internal as well, `meant`, which every answer to an unknown name asks."""

import control
import pytest

import beamchain as bc
from beamchain.checks import meant

SPEC = """
name = "boom"
[[segment]]
length = 2.0
section = { shape = "tube", outer_diameter = 0.05, wall = 0.002 }
material = { youngs_modulus = 7e10, density = 2700.0 }
[fit]
method = "exact"
"""
CASES = {
    "a key of another shape": (
        ("wall = 0.002", "wall = 0.002, diameter = 0.05"),
        [
            "segment[0].section: unknown key 'diameter'",
            "'outer_diameter'",
            'shape = "tube"',
            "shape, outer_diameter, wall",
        ],
    ),
    "a key of another shape, at the other end": (
        ("material", 'section_end = { shape = "round", diameter = 0.1, wall = 0.01 }\nmaterial'),
        [
            "section_end: unknown key 'wall'",
            "another table",
            'keys of shape = "round" are shape, diameter.',
        ],
    ),
    "a key of another table": (
        ('method = "exact"', "bandwidth = 3.0"),
        ["fit: unknown key 'bandwidth'", "another table", "keys of [fit] are springs"],
    ),
    "a slip": (
        ("density = 2700.0", "density = 2700.0, poisson_ratio = 0.3"),
        [
            "unknown key 'poisson_ratio'",
            "did you mean 'poissons_ratio'",
            "keys of [segment.material] are youngs_modulus",
        ],
    ),
    "a key in the file itself": (
        ('name = "boom"', 'name = "boom"\nbandwidth = 3.0'),
        ["unknown key 'bandwidth'", "keys of the file are name, segment"],
    ),
    "a table that nobody knows": (("[fit]", "[fitt]"), ["unknown key 'fitt'; did you mean 'fit'"]),
}


@pytest.mark.parametrize("name", CASES)
def test_the_answer_lists_the_keys(name, tmp_path):
    (old, new), words = CASES[name]
    assert old in SPEC
    path = tmp_path / "boom.toml"
    path.write_text(SPEC.replace(old, new))
    with pytest.raises(bc.InputError) as refused:
        bc.read_spec(path)
    for word in words:
        assert word in str(refused.value), str(refused.value)


def test_a_text_in_place_of_a_number_is_told_its_unit(tmp_path):
    path = tmp_path / "boom.toml"
    path.write_text(SPEC.partition("[fit]")[0] + '[scene]\nbandwidth = "1 Hz"\n')
    with pytest.raises(bc.InputError, match="but a number in rad/s is needed"):
        bc.read_spec(path)


def test_a_sampled_loop_in_a_file_is_told_where_to_go(tmp_path):
    path = tmp_path / "loops.toml"
    path.write_text(
        '[[loop]]\ninput = "u"\noutput = "y"\nnumerator = [1.0]\ndenominator = [1.0]\ndt = 0.1\n'
    )
    plant = control.ss(control.tf([1.0], [1.0, 1.0]))
    with pytest.raises(
        bc.InputError, match=r"unknown key 'dt'; a file of loops is continuous\. Give"
    ):
        bc.margins(plant, path)


def test_of_names_alike_the_one_that_holds_the_word_is_meant():
    assert meant("wing_n_", ["wing_wing_s_", "wing_wing_n_"]) == "did you mean 'wing_wing_n_'? "
    assert meant("wing_n_", ["wing_wing_n_", "wing_wing_s_"]) == "did you mean 'wing_wing_n_'? "
    assert meant("elephant", ["wing"]) == ""
