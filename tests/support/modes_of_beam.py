"""A beam's modes as another program would deliver them: of the tests' own finite elements,
by way of a modes file."""

import json
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import beamchain as bc
import finite_elements as fe
from spec_tables import table_of

# a linear taper's mass per length is quadratic, its polar inertia quartic: five stations are exact
STATIONS = 5
DENSITIES = ("mass", "polar", "rotary_xy", "rotary_xz")
FULL_DIGITS = 15  # a number with as many was computed, not printed


@dataclass(frozen=True)
class Delivered:
    """Modes by frequency `(n,)`, `(n, 6)`, `(n, 6)`, rigid mass `(6, 6)`,
    length and mass along x."""

    frequencies: np.ndarray
    participation: np.ndarray
    tip: np.ndarray
    mass: np.ndarray
    length: float
    line: list
    points: list


def delivered(beam: "bc.Beam", modes: dict[str, int]) -> Delivered:
    """The lowest modes per port of a beam, and its mass along x, exact for linear tapers."""
    table = table_of(beam)
    found = fe.cantilever(table, modes)
    line, x = [], 0.0
    for segment in table["segment"]:
        at = fe.section_properties(segment, np.linspace(0.0, 1.0, STATIONS))
        line.append(
            {"start": x, "length": segment["length"], **{name: at[name] for name in DENSITIES}}
        )
        x += segment["length"]
    points = []
    for lump in table.get("lump", ()):
        about_x, about_y, about_z = lump.get("inertia", (0.0, 0.0, 0.0))
        points.append(
            {
                "x": lump["x"],
                "mass": lump["mass"],
                "polar": about_x,
                "rotary_xy": about_z,
                "rotary_xz": about_y,
            }
        )
    return Delivered(
        found.frequencies,
        found.participation,
        found.tip,
        fe.rigid_mass(table),
        fe.length(table),
        line,
        points,
    )


def modes_text(beam: "bc.Beam", modes: dict[str, int]) -> str:
    """The lowest modes per port of a beam as a .toml file of full digits."""
    data = delivered(beam, modes)

    def listed(values):
        return "[" + ", ".join(repr(float(v)) for v in values) + "]"

    def table(key, rows):
        return [f"{key} = [", *(f"  {listed(row)}," for row in rows), "]"]

    out = [
        f"note = {json.dumps('a beam; SI, about the port')}",
        f"frequencies = {listed(data.frequencies)}",
    ]
    out += table("participation", data.participation.T) + table("mass", data.mass)
    out.append(f"damping = {listed(np.zeros(data.frequencies.size))}")
    out.append(f"digits = {FULL_DIGITS}")
    out += table("tip", data.tip.T)
    out.append(f"length = {data.length!r}")
    for piece in data.line:
        out += ["", "[[line]]"]
        out += [
            f"{name} = {float(v)!r}" if np.ndim(v) == 0 else f"{name} = {listed(v)}"
            for name, v in piece.items()
        ]
    for point in data.points:
        out += ["", "[[points]]", *(f"{name} = {float(value)!r}" for name, value in point.items())]
    return "\n".join(out) + "\n"


def modes_of_beam(beam: "bc.Beam", modes: dict[str, int]) -> "bc.ModalData":
    """The lowest modes per port, read from their file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "modes.toml"
        path.write_text(modes_text(beam, modes))
        return bc.read_modes(path)
