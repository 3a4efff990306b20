"""Reading without surprises: bounded size, plain text,
one sentence where a file is not what it should be."""

import zipfile
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io

from beamchain.errors import InputError
from beamchain.files import LARGEST_TOML, note_input

# bytes of a print; a model with 1e5 nodes and 100 mode shapes stays below
LARGEST_FILE = 500_000_000
LARGEST_JSON = 10_000_000
LONGEST = 4000  # freedoms: rows or columns of a dense matrix

WITHOUT_SHAPES = "print the modes without the mode shapes"
PRINTED_FILE = "give the printed file, not the binary one"


def check_size(path: Path, largest: int = LARGEST_FILE, *, smaller: str = WITHOUT_SHAPES) -> None:
    """Refuse files that are empty or too large; `smaller`: how to get less of it."""
    note_input(path)
    try:
        size = path.stat().st_size
    except OSError as error:
        raise InputError(
            f"file {str(path)!r} cannot be read ({error.strerror}); check the path."
        ) from None
    if size == 0:
        raise InputError(f"file {str(path)!r} is empty; export the modes again.")
    if size > largest:
        raise InputError(
            f"file {str(path)!r} has {size} bytes, more than the {largest} taken; {smaller}."
        )


def lines(
    path: Path, *, smaller: str = WITHOUT_SHAPES, no_text: str = PRINTED_FILE
) -> Iterator[str]:
    """Lines of a print without their ends; `smaller` and `no_text`: the cures where it is too
    large, and where it is no text."""
    check_size(path, smaller=smaller)
    try:
        with path.open("r", encoding="latin-1", newline=None) as stream:
            for number, line in enumerate(stream, 1):
                if "\0" in line:
                    raise InputError(f"file {str(path)!r} is no text (line {number}); {no_text}.")
                yield line.rstrip("\n")
    except OSError as error:
        raise InputError(
            f"file {str(path)!r} cannot be read ({error.strerror}); check its permissions."
        ) from None


def text(path: Path, largest: int = LARGEST_TOML) -> str:
    """A whole UTF-8 file."""
    check_size(path, largest)
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"file {str(path)!r} is not UTF-8 text (byte {error.start}); save it as UTF-8."
        ) from None
    except OSError as error:
        raise InputError(
            f"file {str(path)!r} cannot be read ({error.strerror}); check its permissions."
        ) from None


def npz_arrays(
    path: Path, wanted: Collection[str] | None = None, *, longest: int | None = LONGEST
) -> dict[str, Any]:
    """The wanted arrays of an .npz file, or all; `longest`: of rows and columns."""
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
        names = [name for name in archive.files if wanted is None or name in wanted]
        out = {name: archive[name] for name in names}
    for name, array in out.items():
        _check(path, name, array.shape, longest)
    return out


def mat_arrays(
    path: Path, wanted: Collection[str] | None = None, *, longest: int | None = LONGEST
) -> dict[str, Any]:
    """The wanted arrays of a .mat file, or all; arguments as of `npz_arrays`."""
    held = [
        (str(name), shape)
        for name, shape, _ in io.whosmat(str(path))
        if wanted is None or name in wanted
    ]
    for name, shape in held:
        _check(path, name, shape, longest)
    arrays = io.loadmat(str(path), variable_names=[name for name, _ in held])
    return {name: arrays[name] for name, _ in held}


def names_held(path: Path) -> list[str]:
    """Names of all arrays of an .npz or .mat file."""
    if path.suffix.lower() == ".mat":
        return [str(name) for name, _, _ in io.whosmat(str(path))]
    with zipfile.ZipFile(path) as archive:
        return [name.removesuffix(".npy") for name in archive.namelist()]


def _check(path: Path, name: str, shape: tuple[int, ...], longest: int | None) -> None:
    if longest is not None and (len(shape) > 2 or any(size > longest for size in shape)):
        raise InputError(
            f"file {str(path)!r}: {name} has the shape {shape}; at most {longest} freedoms are "
            "taken: reduce the model first."
        )
