"""Reading without surprises: bounded size, plain text, one sentence where a file is not what it should be."""

import zipfile
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io

from beamchain.errors import InputError
from beamchain.files import LARGEST_TOML

LARGEST_FILE = 500_000_000  # bytes of a print; a model with 1e5 nodes and 100 mode shapes stays below
LARGEST_JSON = 10_000_000
LONGEST_LINE = 10_000  # characters
LONGEST = 4000  # rows or columns of what is unpacked
UNPACKED = 300_000_000  # bytes
CHUNK = 1 << 20


def check_size(path: Path, largest: int = LARGEST_FILE) -> None:
    """Refuse files that are empty or too large."""
    try:
        size = path.stat().st_size
    except OSError as error:
        raise InputError(f"file {str(path)!r} cannot be read ({error.strerror}); check the path.") from None
    if size == 0:
        raise InputError(f"file {str(path)!r} is empty; export the modes again.")
    if size > largest:
        raise InputError(
            f"file {str(path)!r} has {size} bytes, more than the {largest} taken; print the modes without the mode "
            "shapes."
        )


def lines(path: Path) -> Iterator[str]:
    """Lines of a print without their ends."""
    check_size(path)
    try:
        with path.open("r", encoding="latin-1", newline=None) as stream:
            for number, line in enumerate(stream, 1):
                if "\0" in line or len(line) > LONGEST_LINE:
                    raise InputError(
                        f"file {str(path)!r} is no text (line {number}); give the printed file, not the binary one."
                    )
                yield line.rstrip("\n")
    except OSError as error:
        raise InputError(f"file {str(path)!r} cannot be read ({error.strerror}); check its permissions.") from None


def text(path: Path, largest: int = LARGEST_TOML) -> str:
    """A whole UTF-8 file."""
    check_size(path, largest)
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"file {str(path)!r} is not UTF-8 text (byte {error.start}); save it as UTF-8.") from None
    except OSError as error:
        raise InputError(f"file {str(path)!r} cannot be read ({error.strerror}); check its permissions.") from None


def npz_arrays(path: Path, wanted: Collection[str]) -> dict[str, Any]:
    """The wanted arrays of an .npz file."""
    out: dict[str, Any] = {}
    with zipfile.ZipFile(path) as archive:
        for info in archive.infolist():
            name = info.filename.removesuffix(".npy")
            if name not in wanted or name == info.filename:
                continue
            with archive.open(info) as stream:
                version = np.lib.format.read_magic(stream)
                header = (
                    np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                )
                shape, _, kind = header(stream)
            _check(path, name, shape)
            if kind.hasobject:
                raise ValueError(f"{name} holds Python objects")
            if info.file_size > UNPACKED:
                raise InputError(
                    f"file {str(path)!r}: {name} unpacks to {info.file_size} bytes; reduce the model first."
                )
            with archive.open(info) as stream:
                out[name] = np.lib.format.read_array(stream, allow_pickle=False)
    return out


def mat_arrays(path: Path, wanted: Collection[str]) -> dict[str, Any]:
    """The wanted arrays of a .mat file."""
    _check_unpacked(path)
    found = [(str(name), shape) for name, shape, _ in io.whosmat(str(path)) if name in wanted]
    for name, shape in found:
        _check(path, name, shape)
    held = io.loadmat(str(path), variable_names=[name for name, _ in found])
    return {name: held[name] for name, _ in found}


def _check(path: Path, name: str, shape: tuple[int, ...]) -> None:
    if len(shape) > 2 or any(size > LONGEST for size in shape):
        raise InputError(
            f"file {str(path)!r}: {name} has the shape {shape}; at most {LONGEST} freedoms are taken: reduce the model "
            "first."
        )


def _check_unpacked(path: Path) -> None:
    """Unpack the compressed variables of a MATLAB 5 file in pieces, keeping nothing.

    Source: MAT-File Format, The MathWorks: a header of 128 bytes, then elements of a type (15: compressed) and a size.
    """
    total = 0
    with path.open("rb") as stream:
        head = stream.read(128)
        order = "little" if head[126:128] == b"IM" else "big"
        while len(tag := stream.read(8)) == 8:
            kind, size = int.from_bytes(tag[:4], order), int.from_bytes(tag[4:], order)
            if kind != 15:
                stream.seek(size, 1)
                continue
            unpack = zlib.decompressobj()
            while size > 0 and (piece := stream.read(min(size, CHUNK))):
                size -= len(piece)
                while piece:
                    total += len(unpack.decompress(piece, CHUNK))
                    piece = unpack.unconsumed_tail
                    if total > UNPACKED:
                        raise InputError(
                            f"file {str(path)!r} unpacks to more than {UNPACKED} bytes; reduce the model first."
                        )
