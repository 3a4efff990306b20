"""Specifications and other tables written as dicts,
read by the package from a file as a user's would be."""

import tempfile
from pathlib import Path

import beamchain as bc
from random_appendages import toml


def spec_of(table, name="spec") -> bc.Spec:
    """The specification of a dict, through a TOML file of its own."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{name}.toml"
        path.write_text(toml(table))
        return bc.read_spec(path)
