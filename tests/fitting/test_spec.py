"""Specifications: repeated segments, and the schema that describes every field."""

import json

import msgspec
import numpy as np
import pytest

import beamchain as bc
from spec_tables import spec_of
from terminal import run

SECTION = {"shape": "equivalent", "bending_stiffness_xy": 2e3, "linear_mass": 4.0}
ROOM = 1e-12  # relative; the same beam is assembled twice


def test_a_repeated_segment_is_as_many_tables():
    joint = {"after_segment": 3, "stiffness_xy": 500.0}
    short = spec_of(
        {
            "segment": [
                {"length": 1.0, "section": SECTION},
                {"length": 2.0, "section": SECTION, "repeat": 3},
            ],
            "joint": [joint],
        }
    )
    long = spec_of(
        {
            "segment": [
                {"length": 1.0, "section": SECTION},
                *[{"length": 2.0, "section": SECTION}] * 3,
            ],
            "joint": [joint],
        }
    )
    assert short.segment == long.segment
    assert short.beam.length == 7.0
    one = short.beam.port("xy").frequencies[:4]
    other = long.beam.port("xy").frequencies[:4]
    np.testing.assert_allclose(one, other, rtol=ROOM)


def test_a_beam_in_python_takes_repeats():
    panel = bc.Segment(
        length=2.0,
        section=bc.Rectangle(width_y=0.02, width_z=1.0),
        repeat=4,
        material=bc.Material(youngs_modulus=2e9, density=80.0),
    )
    beam = bc.Beam(segments=[panel], joints=[bc.Joint(after_segment=3, stiffness_xy=400.0)])
    assert len(beam.segments) == 4
    assert beam.length == 8.0
    assert [segment.repeat for segment in bc.Spec(segment=(panel,)).segment] == [1, 1, 1, 1]


def tables():
    """Name and table of every object in the schema."""
    return [
        (name, table)
        for name, table in json.loads(run("init", "schema")[1])["$defs"].items()
        if "properties" in table
    ]


def test_the_schema_describes_every_field():
    for name, table in tables():
        assert table["description"], name
        for key, field in table["properties"].items():
            if key != "shape":  # the tag of a section
                assert len(field.get("description", "")) > 3, f"{name}.{key}"


def test_the_schema_holds_bounds_and_defaults():
    properties = {name: table["properties"] for name, table in tables()}
    assert properties["Segment"]["length"] == {
        "description": "length along x [m]",
        "type": "number",
        "exclusiveMinimum": 0.0,
    }
    assert properties["Segment"]["repeat"]["maximum"] == 500
    assert properties["Material"]["poissons_ratio"]["maximum"] == 0.5
    assert properties["Scene"]["tolerance"]["default"] == 1e-3


def test_bounds_of_the_schema_are_those_of_the_check():
    for struct in (
        bc.Round,
        bc.Tube,
        bc.Box,
        bc.Material,
        bc.Joint,
        bc.Lump,
        bc.Scene,
        bc.Equivalent,
        bc.spec.Draw,
    ):
        for field in msgspec.json.schema(struct)["$defs"][struct.__name__]["properties"].items():
            key, told = field
            if "exclusiveMinimum" in told:
                with pytest.raises(bc.InputError, match=key):
                    struct(**{**needed(struct), key: told["exclusiveMinimum"]})


def needed(struct):
    """The smallest set of allowed values."""
    values = {
        bc.Joint: {"after_segment": 0, "stiffness_xy": 1.0},
        bc.Box: {"width_y": 1.0, "width_z": 1.0, "wall": 0.1},
        bc.Tube: {"outer_diameter": 1.0, "wall": 0.1},
        bc.Lump: {"x": 0.0, "mass": 1.0},
    }
    return values.get(struct) or {f.name: 1.0 for f in msgspec.structs.fields(struct) if f.required}


def test_help_lists_the_fields_with_their_units():
    assert "length: length along x [m]." in (bc.Segment.__doc__ or "")
    assert "mass: mass [kg]." in (bc.Hub.__doc__ or "")


def test_a_port_may_stand_at_the_tip():
    bay = bc.Segment(length=2.0, section=bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=1.0))
    spec = bc.Spec(segment=(bay, bay), port=(bc.spec.Port(name="end", x=4.0),))
    assert spec.port[0].x == 4.0
