"""Arrays of NumPy and MATLAB files, looked at before they are unpacked: a small file may claim or hold gigabytes."""

import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io

from beamchain.errors import InputError

LONGEST = 4000  # rows or columns of what is unpacked
UNPACKED = 300_000_000  # bytes
CHUNK = 1 << 20


def numpy(path: Path, wanted: Collection[str]) -> dict[str, Any]:
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


def matlab(path: Path, wanted: Collection[str]) -> dict[str, Any]:
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
