"""Specifications as plain tables: of a beam made in Python, and of a table the specification,
by way of its file."""

from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

import beamchain as bc
from random_appendages import toml


def table_of(structure: "bc.Beam | bc.Spec") -> dict:
    """The table that `finite_elements` takes: segments,
    joints and lumps with everything that is stated."""
    given = msgspec.to_builtins(structure)
    names = {"segments": "segment", "joints": "joint", "lumps": "lump"}
    table = {
        names.get(key, key): value
        for key, value in given.items()
        if key in names or key in names.values()
    }
    return {key: [_stated(row) for row in rows] for key, rows in table.items() if rows}


def _stated(value):
    if isinstance(value, dict):
        return {key: _stated(inner) for key, inner in value.items() if inner is not None}
    return value


def spec_of(table: dict) -> "bc.Spec":
    """The specification of a table, read from its file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "spec.toml"
        path.write_text(toml({"name": "appendage", **table}))
        return bc.read_spec(path)
