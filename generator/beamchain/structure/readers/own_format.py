"""beamchain's own file of modes (.toml, .json): what people type in."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from beamchain.errors import InputError
from beamchain.files import LARGEST_TOML, tables
from beamchain.structure.mass_line import MassPiece
from beamchain.structure.modal_data import EXACT, ModalData
from beamchain.structure.readers.safe_reading import LARGEST_JSON, text

FULL_DIGITS = 15  # a number with as many was computed, not printed


class LinePiece(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A stretch of the mass line: densities at equally spaced stations, both ends included."""

    start: float
    length: float
    mass: tuple[float, ...]
    polar: tuple[float, ...] = ()
    rotary_xy: tuple[float, ...] = ()
    rotary_xz: tuple[float, ...] = ()


class LinePoint(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A body on the mass line: mass, polar and rotary inertia."""

    x: float
    mass: float
    polar: float = 0.0
    rotary_xy: float = 0.0
    rotary_xz: float = 0.0


class ModesFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The keys of a modes file; lengths, masses in any units, about one reference point.

    Args:
        frequencies: with the port held [rad/s]; or frequencies_hz.
        participation: six rows (x, y, z, rotations about x, y, z), one column per mode.
        mass: 6 x 6 rigid mass matrix.
        damping: ratio, one or per mode.
        tip: six rows, one column per mode: motion of the tip in each mode.
        digits: of the printed numbers; counted where left out.
        length: root to tip; where line and points end, or estimated from the mass, where left
            out.
        line, points: how the mass lies along x.
        uncertain: what is not known exactly of the modes, as in [uncertain] of a SPEC.toml.
    """

    frequencies: tuple[float, ...] = ()
    frequencies_hz: tuple[float, ...] = ()
    participation: tuple[tuple[float, ...], ...] = ()
    mass: tuple[tuple[float, ...], ...] = ()
    generalized_mass: tuple[float, ...] = ()
    damping: float | tuple[float, ...] = 0.0
    tip: tuple[tuple[float, ...], ...] = ()
    length: float | None = None
    digits: int | None = None
    line: tuple[LinePiece, ...] = ()
    points: tuple[LinePoint, ...] = ()
    uncertain: dict[str, Any] = {}
    note: str = ""


def read(path: Path, subcase: int | None = None) -> ModalData:
    """Modal data of a .toml or .json file, in its units."""
    if subcase is not None:
        raise InputError(
            f"subcase = {subcase} is given, but {path.name!r} holds one set of modes; leave "
            "subcase out."
        )
    as_json = path.suffix.lower() == ".json"
    content = text(path, LARGEST_JSON if as_json else LARGEST_TOML)
    try:
        parsed = json.loads(content) if as_json else tables(content)
        given = msgspec.convert(parsed, ModesFile)
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        if isinstance(error, msgspec.ValidationError):
            keys = ", ".join(ModesFile.__struct_fields__)
            raise InputError(
                f"file {str(path)!r}: {error}; the keys of a modes file are {keys}."
            ) from None
        kind = path.suffix.lower()[1:].upper()
        raise InputError(
            f"file {str(path)!r} is no {kind} ({error}); it is cut or mangled: export it again."
        ) from None
    return replace(_data(given, path.name), uncertain=given.uncertain)


def _data(given: ModesFile, name: str) -> ModalData:
    if bool(given.frequencies) == bool(given.frequencies_hz):
        raise InputError(f"file {name!r}: give frequencies (rad/s) or frequencies_hz, one of them.")
    w = np.array(
        given.frequencies or [2.0 * np.pi * f for f in given.frequencies_hz], dtype=np.float64
    )
    n = w.size
    table = _table(name, "participation", given.participation, n)
    mass = _table(name, "mass", given.mass, 6)
    if given.generalized_mass:
        modal = np.array(given.generalized_mass)
        if modal.shape != (n,) or np.any(modal <= 0.0):
            raise InputError(
                f"file {name!r}: generalized_mass needs {n} positive numbers, one per mode."
            )
        table = table * np.sqrt(modal)
    damping = (
        np.full(n, given.damping)
        if isinstance(given.damping, float | int)
        else np.array(given.damping)
    )
    if np.any(damping < 0.0) or np.any(damping >= 1.0):
        raise InputError(
            f"file {name!r}: damping = {damping.tolist()} must lie between 0 and 1 (0.005 is "
            "usual)."
        )
    tip = _table(name, "tip", given.tip, n).T if given.tip else None
    length = given.length
    if length is None and (given.line or given.points):
        length = max([*(p.start + p.length for p in given.line), *(p.x for p in given.points)])
    digits = (
        given.digits if given.digits is not None else _digits([*given.participation, *given.mass])
    )
    precision = EXACT if digits >= FULL_DIGITS else 5.0 * 10.0**-digits
    steps = [] if digits >= FULL_DIGITS else [f"numbers of {digits} digits"]
    if given.generalized_mass:
        steps.append("modes scaled to unit generalized mass")
    return ModalData(
        mass,
        w,
        table.T,
        damping,
        tip,
        length,
        tuple(_piece(name, p) for p in given.line),
        np.array([[p.x, p.mass, p.polar, p.rotary_xy, p.rotary_xz] for p in given.points]).reshape(
            -1, 5
        ),
        precision,
        name,
        tuple(steps),
    )


def _table(
    name: str, key: str, rows: tuple[tuple[float, ...], ...], columns: int
) -> np.ndarray[Any, Any]:
    shape = f"{len(rows)} rows of {', '.join(sorted({str(len(row)) for row in rows})) or 'nothing'}"
    if len(rows) != 6 or any(len(row) != columns for row in rows):
        turned = len(rows) == columns and all(len(row) == 6 for row in rows)
        raise InputError(
            f"file {name!r}: {key} has {shape}; give 6 rows (x, y, z, rotations about x, y, z) of "
            f"{columns} numbers." + (" It stands turned: swap rows and columns." if turned else "")
        )
    return np.array(rows, dtype=np.float64)


def _digits(rows: list[tuple[float, ...]]) -> int:
    """Most significant digits that any number was given with."""
    most = 1
    for row in rows:
        for value in row:
            mantissa = (
                repr(float(value)).lower().split("e")[0].replace(".", "").lstrip("-0").rstrip("0")
            )
            most = max(most, len(mantissa))
    return most


def _piece(name: str, piece: LinePiece) -> MassPiece:
    k = len(piece.mass)
    columns = [
        piece.mass,
        *(values or (0.0,) * k for values in (piece.polar, piece.rotary_xy, piece.rotary_xz)),
    ]
    if k == 0 or k > 9 or any(len(c) != k for c in columns):
        raise InputError(
            f"file {name!r}: a piece of line needs 1 to 9 masses, and as many polar and rotary "
            "inertias."
        )
    return MassPiece(piece.start, piece.length, np.array(columns, dtype=np.float64).T)
