"""A key that a table does not have is answered with the keys that it has."""

import pytest

import beamchain as bc

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
