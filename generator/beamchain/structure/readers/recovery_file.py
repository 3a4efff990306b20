"""Files of recovery rows: .npz with arrays, .toml with a table per row."""

from pathlib import Path

import msgspec
import numpy as np

from beamchain.checks import path_of
from beamchain.errors import InputError
from beamchain.files import no_file, tables
from beamchain.structure.readers.safe_reading import check_size, npz_arrays, text
from beamchain.structure.recovery_rows import RecoveryRows

ENDINGS = (".npz", ".toml")
ARRAYS = ("names", "units", "modes", "accelerations", "root", "points")


class Row(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One quantity: what it is called, and its numbers per mode and per motion of the root."""

    name: str
    unit: str = ""
    modes: tuple[float, ...] = ()
    accelerations: tuple[float, ...] = ()
    root: tuple[float, ...] = ()
    point: tuple[float, ...] = ()


class RowsFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The tables [[row]] of a file of recovery rows."""

    row: tuple[Row, ...]


def read_recovery(path: str | Path) -> RecoveryRows:
    """Recovery rows of a .npz or .toml file.

    Raises:
        InputError: the file is missing or mangled, or its sizes disagree.
    """
    path = path_of("recovery", path, "the path of a file of recovery rows")
    kind = path.suffix.lower()
    if kind == ".op4":
        raise InputError(
            f"file {str(path)!r} holds matrices, not rows; take MUG1 or MEF1 out of it with "
            "bc.spec.read_op4, and give rows made of them (RecoveryRows, or a .npz)."
        )
    if kind not in ENDINGS:
        raise InputError(
            f"file {str(path)!r} has an unknown ending; recovery rows are read from "
            f"{', '.join(ENDINGS)}."
        )
    if what := no_file(path):
        raise InputError(f"file {str(path)!r} {what}; give the path of the recovery rows.")
    return _of_npz(path) if kind == ".npz" else _of_toml(path)


def _of_npz(path: Path) -> RecoveryRows:
    check_size(path)
    try:
        arrays = npz_arrays(path, ARRAYS)
    except InputError:
        raise
    except Exception as error:  # zip and NumPy each raise their own kind
        raise InputError(
            f"file {str(path)!r} cannot be read ({type(error).__name__}: {error}); it is cut or of "
            "another kind: write it again with numpy.savez, arrays of numbers and of text."
        ) from None
    if "names" not in arrays:
        have = ", ".join(sorted(arrays)) or "nothing of that kind"
        raise InputError(
            f"file {str(path)!r} holds no names (it holds {have}); recovery rows need names, and "
            "modes or accelerations."
        )
    words: dict[str, tuple[str, ...]] = {}
    for name in ("names", "units"):
        if name in arrays:
            values = np.atleast_1d(arrays.pop(name))
            if values.dtype.kind != "U" or values.ndim != 1:
                raise InputError(
                    f"file {str(path)!r}: {name} must be a list of words, not an array of "
                    f"{values.dtype} with the shape {values.shape}."
                )
            words[name] = tuple(str(word) for word in values)
    return RecoveryRows(**words, **arrays, source=path.name)


def _of_toml(path: Path) -> RecoveryRows:
    try:
        given = msgspec.convert(tables(text(path)), RowsFile)
    except InputError:
        raise
    except msgspec.ValidationError as error:
        raise InputError(
            f"file {str(path)!r}: {error}; a file of recovery rows holds [[row]] with name, unit, "
            "modes, accelerations, root and point."
        ) from None
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"file {str(path)!r} is no TOML ({error}); it is cut or mangled: write it again."
        ) from None
    arrays: dict[str, np.ndarray] = {}
    for name, key in (
        ("modes", "modes"),
        ("accelerations", "accelerations"),
        ("root", "root"),
        ("points", "point"),
    ):
        lists = [getattr(row, key) for row in given.row]
        width = max((len(values) for values in lists), default=0)
        for row, values in zip(given.row, lists, strict=True):
            if values and len(values) != width:
                raise InputError(
                    f"file {str(path)!r}: row {row.name!r} has {len(values)} numbers in {key}, "
                    f"others have {width}; give each as many."
                )
        arrays[name] = np.array([values or (0.0,) * width for values in lists])
    return RecoveryRows(
        names=tuple(row.name for row in given.row),
        units=tuple(row.unit for row in given.row),
        source=path.name,
        **arrays,
    )
