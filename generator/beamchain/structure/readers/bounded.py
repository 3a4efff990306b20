"""Reading without surprises: bounded size, plain text,
one sentence where a file is not what it should be."""

import math
import zipfile
import zlib
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
LONGEST_LINE = 10_000  # characters
MOST_LINES = 5_000_000  # of a print; one of the largest size has lines of a hundred characters
LONGEST = 4000  # rows or columns of what is unpacked
UNPACKED = 300_000_000  # bytes of matrices
CHUNK = 1 << 20


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
                if "\0" in line or len(line) > LONGEST_LINE:
                    raise InputError(f"file {str(path)!r} is no text (line {number}); {no_text}.")
                if number > MOST_LINES:
                    raise InputError(
                        f"file {str(path)!r} has more than the {MOST_LINES} lines taken; {smaller}."
                    )
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
    path: Path,
    wanted: Collection[str] | None = None,
    *,
    longest: int | None = LONGEST,
    unpacked: int = UNPACKED,
) -> dict[str, Any]:
    """The wanted arrays of an .npz file, or all; `longest`: of rows and columns, `unpacked`:
    bytes of all together."""
    out: dict[str, Any] = {}
    with zipfile.ZipFile(path) as archive:
        entries = {
            info.filename.removesuffix(".npy"): info
            for info in archive.infolist()
            if info.filename.endswith(".npy")
        }
        entries = {name: info for name, info in entries.items() if wanted is None or name in wanted}
        total = sum(info.file_size for info in entries.values())
        if total > unpacked:
            raise _too_large(path, unpacked)
        for name, info in entries.items():
            with archive.open(info) as stream:
                version = np.lib.format.read_magic(stream)
                header = (
                    np.lib.format.read_array_header_1_0
                    if version == (1, 0)
                    else np.lib.format.read_array_header_2_0
                )
                shape, _, kind = header(stream)
            _check(path, name, shape, longest)
            if kind.hasobject:
                raise ValueError(f"{name} holds Python objects")
            if math.prod(shape) * kind.itemsize > info.file_size:
                raise ValueError(f"{name} is shorter than its shape {shape}")
            with archive.open(info) as stream:
                out[name] = np.lib.format.read_array(stream, allow_pickle=False)
    return out


def mat_arrays(
    path: Path,
    wanted: Collection[str] | None = None,
    *,
    longest: int | None = LONGEST,
    unpacked: int = UNPACKED,
) -> dict[str, Any]:
    """The wanted arrays of a .mat file, or all; arguments as of `npz_arrays`."""
    _check_unpacked(path, unpacked)
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


def _too_large(path: Path, unpacked: int) -> InputError:
    return InputError(
        f"file {str(path)!r} unpacks to more than {unpacked} bytes; write less into one file."
    )


def _check(path: Path, name: str, shape: tuple[int, ...], longest: int | None) -> None:
    if longest is not None and (len(shape) > 2 or any(size > longest for size in shape)):
        raise InputError(
            f"file {str(path)!r}: {name} has the shape {shape}; at most {longest} freedoms are "
            "taken: reduce the model first."
        )


def _check_unpacked(path: Path, unpacked: int) -> None:
    """Unpack the compressed variables of a MATLAB 5 file in pieces, keeping nothing.

    Source: MAT-File Format, The MathWorks: a header of 128 bytes,
    then elements of a type (15: compressed) and a size.
    """
    total = 0
    with path.open("rb") as stream:
        head = stream.read(128)
        order = "little" if head[126:128] == b"IM" else "big"
        while len(tag := stream.read(8)) == 8:
            kind = int.from_bytes(tag[:4], order)
            size = int.from_bytes(tag[4:], order)
            if kind != 15:
                stream.seek(size, 1)
                continue
            unpack = zlib.decompressobj()
            while size > 0 and (piece := stream.read(min(size, CHUNK))):
                size -= len(piece)
                while piece:
                    total += len(unpack.decompress(piece, CHUNK))
                    piece = unpack.unconsumed_tail
                    if total > unpacked:
                        raise _too_large(path, unpacked)
