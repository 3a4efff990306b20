"""Plants as files: NumPy's `.npz`, `.json`, and `.mat` for MATLAB's `ss(A, B, C, D)`."""

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from beamchain.checks import path_of
from beamchain.errors import InputError
from beamchain.files import to_json, write_files
from beamchain.import_lock import importing

SUFFIXES = (".npz", ".json", ".mat")


def write_arrays(
    path: str | Path,
    record: Mapping[str, Any],
    *,
    force: bool,
    also: Mapping[Path, str] | None = None,
) -> Path:
    """Write a record of arrays, numbers and lists of words by name,
    in the format that the path's ending says.

    `also`: further files to write with it, content by path.
    """
    place = path_of("path", path)
    if place.suffix.lower() not in SUFFIXES:
        raise InputError(
            f"path = {str(place)!r} ends in {place.suffix!r}; write to a name in "
            f"{', '.join(SUFFIXES)}."
        )
    stream: Any = io.BytesIO()
    if place.suffix.lower() == ".json":
        stream.write(to_json(dict(record)).encode())
    elif place.suffix.lower() == ".npz":
        np.savez(
            stream,
            allow_pickle=False,
            **{name: np.asarray(value) for name, value in record.items()},
        )
    else:
        with importing:
            from scipy.io import savemat

        savemat(stream, {name: _matlab(value) for name, value in record.items()})
    write_files([*dict(also or {}).items(), (place, stream.getvalue())], force=force)
    return place


def _matlab(value: Any) -> Any:
    """Lists of words as cell arrays; stacks of matrices with the stack's index last."""
    if isinstance(value, list | tuple) and all(isinstance(item, str) for item in value):
        out = np.empty((len(value), 1), dtype=object)
        out[:, 0] = list(value)
        return out
    array = np.asarray(value)
    return np.moveaxis(array, 0, -1) if array.ndim == 3 else value
